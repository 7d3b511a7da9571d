"""The figures of the course text as 3-D scenes: each function returns a viewer with one figure.

Figure 1: on the left a robot bolted to the ground, on the right a floating base. Figure 2: a
quadruped with its base, centre of mass and feet. Figure 3: on the left the friction cone, on the
right the plane through normal and force. `stepping` is the animation on the first pages.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array
from floatbase.behaviours import Gait, Stand
from floatbase.dynamics import Contacts
from floatbase.lessons import props
from floatbase.robots import load
from floatbase.simulation import Push, Simulation, rollout
from floatbase.viewer import Picture, View, Viewer, markers, prefixed, shapes
from floatbase.viewer.scene.colours import ALARM, CALM, COM, MEASURED, PATCH, RGB

MU = 0.7


def figure_1_left(background: str = "white") -> Viewer:
    """Draw a fixed-base robot that pushes against a wall."""
    robot = load("ur5")
    view = Viewer(robot, background=background)
    state = robot.standing()
    tool = np.array(state.frame_pose("tool0").translation)
    away = np.array([tool[0], tool[1], 0.0]) / np.linalg.norm(tool[:2])
    force = -60.0 * away
    moment = -np.cross(tool, force)
    size, scale = view.painter.size, 0.3 / 60.0
    ring = 0.28 * size * moment / np.linalg.norm(moment)
    extra = prefixed("wall", {"": props.wall([*(tool + 0.01 * away)[:2], 0.45], -away, 0.7, 0.9)})
    extra |= prefixed("bolts", props.bolts(np.zeros(3), 0.11))
    extra |= {"f/wall": shapes.arrow(tool, scale * force, MEASURED, size)}
    extra |= {"f/base": markers.curled_arrow([0.0, 0.0, 0.06], ring, MEASURED)}
    extra |= _labels(
        view, {"f{r}": tool + scale * force + [0, 0, 0.06], "τ{b}": [-0.16, -0.1, 0.22]}
    )
    view.show(
        state, com=False, extra=extra, title="Figure 1, left: the base is bolted to the ground"
    )
    return view.camera(View(-62.0, 14.0, 1.5))


def figure_1_right(background: str = "white") -> Viewer:
    """Draw a floating base with the sums of its contact forces."""
    robot = load("go2")
    view = Viewer(robot, background=background, scale=0.004)
    state, scale = robot.standing(), 0.004
    contacts = Contacts.points(robot, MU)
    forces = _example_forces(robot.weight)
    positions = contacts.positions(state)
    wrench = np.concatenate(
        [forces.sum(axis=0), np.cross(positions - state.com, forces).sum(axis=0)]
    )
    tips = positions + scale * forces
    labels = {f"f{{{i + 1}}}": tip + [0.045, -0.03, 0.0] for i, tip in enumerate(tips)}
    labels["f{4}"] = tips[3] + [-0.06, 0.04, 0.0]
    labels["f{c}"] = state.com + scale * wrench[:3] + [0.0, 0.0, 0.04]
    labels["τ{c}"] = state.com + [0.11, -0.07, 0.17]
    view.show(
        state, contacts, forces, wrench=wrench, cones=False, extra=_labels(view, labels),
        title="Figure 1, right: the base floats",
    )  # fmt: skip
    return view.camera(View(58.0, 16.0, 1.0, around=((0.0, 0.0, 0.45), 0.62)))


def figure_2(background: str = "white") -> Viewer:
    """Draw a quadruped with its base frame, its centre of mass x_c and its feet x_i."""
    robot = load("go2")
    view = Viewer(robot, background=background)
    state = robot.standing()
    contacts = Contacts.points(robot, MU)
    positions = contacts.positions(state)
    labels = {
        f"x{{{i + 1}}}": _outside(position, state.com) for i, position in enumerate(positions)
    }
    # behind the robot, since the foot itself would hide a label on the outside
    labels["x{4}"] = positions[3] + [-0.06, 0.04, 0.01]
    labels["x{c}"] = state.com + [0.065, -0.035, -0.035]
    pose = state.frame_pose(robot.base).homogeneous
    labels["base"] = pose[:3, 3] + [0.0, 0.0, 0.24]
    axes = prefixed("base", markers.frame_axes(pose, 0.2))
    rods = {f"lever/{i}": _rod(state.com, position, COM) for i, position in enumerate(positions)}
    view.show(
        state, contacts, cones=False, support=True, extra=_labels(view, labels) | rods | axes,
        title="Figure 2: quadrupedal robot",
    )  # fmt: skip
    return view.camera(View(62.0, 18.0, 1.05))


def figure_3_left(background: str = "white") -> Viewer:
    """Draw the friction cone with a force f, its normal part f_⊥ and its tangential part f_∥."""
    view, along, across = _cone_stage(background)
    force = along + across
    picture = _cone() | {
        "part/f": shapes.arrow(np.zeros(3), force, MEASURED),
        "part/normal": shapes.arrow(np.zeros(3), along, COM),
        "part/tangent": shapes.arrow(along, across, ALARM),
    }
    labels = {
        "f": force + [0, 0.05, 0.03],
        "f{⊥}": along / 2 - [0, 0.07, 0],
        "f{∥}": along + across / 2 + [0, 0, 0.05],
    }
    picture |= _labels(view, labels | {"n": [0.0, 0.0, 0.93]})
    picture["normal"] = _rod(np.zeros(3), np.array([0.0, 0.0, 0.9]), PATCH)
    view.draw(view.painter.ground_only() | picture, "Figure 3, left: friction cone")
    return view.camera(View(25.0, 14.0, 1.0, around=((0.0, 0.0, 0.42), 0.62)))


def figure_3_right(background: str = "white") -> Viewer:
    """Draw the plane through the normal and a force, where α_∥ is at most μ α_⊥."""
    view, along, across = _cone_stage(background)
    height, most = along[2], MU * along[2]
    plane = np.array([[0, 0, 0], [0, MU * 0.8, 0.8], [0, -MU * 0.8, 0.8]], dtype=float)
    picture = {
        "plane": shapes.Item(shapes.flat_polygon(plane, CALM, 0.25), np.eye(4)),
        "edge/left": _rod(np.zeros(3), plane[1], CALM),
        "edge/right": _rod(np.zeros(3), plane[2], CALM),
        "part/f": shapes.arrow(np.zeros(3), along + across, MEASURED),
        "part/normal": shapes.arrow(np.zeros(3), along, COM),
        "part/tangent": shapes.arrow(along, across, ALARM),
        "limit": _rod(along, along + [0.0, most, 0.0], PATCH),
        "surface": _rod(np.array([0.0, -0.6, 0.0]), np.array([0.0, 0.6, 0.0]), PATCH),
    }
    labels = {
        "f": 0.7 * along + [0, 0.08, 0],
        "α{⊥}": [0.0, -0.06, height / 2],
        "α{∥}": along + across / 2 + [0, 0, 0.05],
        "μ α{⊥}": along + [0.0, most + 0.08, 0.0],
    }
    picture |= _labels(view, labels)
    view.draw(view.painter.ground_only() | picture, "Figure 3, right: α∥ ≤ μ α⊥")
    return view.camera(View(0.0, 4.0, 1.0, around=((0.0, 0.0, 0.42), 0.62)))


def stepping(background: str = "white", height: int = 480) -> Viewer:
    """Play a quadruped that is pushed left with 300 N for 0.1 s and steps to catch itself."""
    robot = load("go2")
    stand = Stand(robot, Contacts.feet(robot), stepping_gait=Gait.trot(robot, swing=0.2))
    push = Push(np.array([0.0, 300.0, 0.0]), start=0.3)
    run = rollout(Simulation(robot), stand, 2.2, pushes=[push])
    view = Viewer(robot, background=background, height=height)
    return view.play(run, speed=0.5, planned=False, title="a 300 N push to the side, half speed")


FIGURES: dict[str, Callable[..., Viewer]] = {
    "figure_1_left": figure_1_left,
    "figure_1_right": figure_1_right,
    "figure_2": figure_2,
    "figure_3_left": figure_3_left,
    "figure_3_right": figure_3_right,
}


def _example_forces(weight: float) -> Array:
    """Return unequal forces inside the cones that carry the weight, shape (4, 3) [N]."""
    shares = np.array([0.32, 0.21, 0.27, 0.20])
    lean = np.array([[-0.25, 0.15, 1.0], [0.30, 0.20, 1.0], [0.10, 0.35, 1.0], [-0.35, 0.20, 1.0]])
    return weight * shares[:, None] * lean


def _cone_stage(background: str) -> tuple[Viewer, Array, Array]:
    """Return a viewer for a cone, and the normal and tangential part of a force, drawn in m."""
    view = Viewer(load("go2"), background=background)
    return view, np.array([0.0, 0.0, 0.6]), np.array([0.0, 0.26, 0.0])


def _cone() -> Picture:
    """Return a friction cone at the origin, 0.8 m high, with its contact patch."""
    return {
        "shape/cone": shapes.friction_cone(np.zeros(3), [0.0, 0.0, 1.0], MU, 0.8, "inside"),
        "patch/contact": shapes.contact_patch(np.zeros(3), [0.0, 0.0, 1.0], 0.05),
    }


def _rod(start: Array, end: Array, colour: RGB) -> shapes.Item:
    """Return a thin line from one point to another."""
    return props.rod_between(start, end, 0.004, colour)


def _outside(position: Array, centre: Array) -> Array:
    """Return a point 7 cm beside a foot, away from the centre of the robot."""
    away = (position - centre) * [1.0, 1.0, 0.0]
    return np.asarray(position + 0.07 * away / np.linalg.norm(away))


def _labels(view: Viewer, texts: Mapping[str, npt.ArrayLike]) -> Picture:
    """Return labels without plates; texts: text -> position, shape (3,) [m]."""
    height = 0.085 * view.painter.size
    return {
        f"label/{i}": shapes.label(at, text, height, view.painter.text_colour, plate=False)
        for i, (text, at) in enumerate(texts.items())
    }
