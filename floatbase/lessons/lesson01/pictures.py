"""Lesson 01, What is a floating base: an arm with its bolts cut, the pictures of Figure 1 as experiments, exercises."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import ipywidgets as widgets
import numpy as np
import numpy.typing as npt
import pinocchio as pin

import floatbase as fb
from floatbase._arrays import Array, read_only
from floatbase.dynamics import fixed_frame
from floatbase.lessons import Exercise, Numeric, Shaped, Verdict, numbers, slider_panel
from floatbase.objectives import Task, momentum_rate
from floatbase.robots import PLATE, Robot, unbolted
from floatbase.simulation import Rollout
from floatbase.viewer import MEASURED, Item, Picture, View, Viewer, below, marks, props, recording, shapes

PRESSING = (0.0, -1.7, 1.2, 0.5, np.pi / 2, 0.0)  # joints of ur5, rad: the tool points along x, 0.6 m above the ground


# robots -----------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Torques:
    """All that a rollout needs of a controller's answer: tau, shape (d,), N·m."""

    tau: Array


def joint_servo(
    state: fb.State, tau: npt.ArrayLike | None = None, path: Callable[[float], Array] | None = None,
    stiffness: float = 100.0, damping: float = 10.0,
) -> Callable[[Array, Array, float], Torques]:  # fmt: skip
    """A controller that knows joints only: tau + stiffness · (error of the joints) + damping · (error of their velocities).

    tau: (d,) N·m, what holds the joints at rest, 0 by default. path: offset from the joints of `state`, (d,) rad, as a
    function of the time in s; 0 by default. stiffness in N·m/rad, damping in N·m·s/rad, for every joint.
    """
    d = state.robot.d
    steady = np.zeros(d) if tau is None else np.array(tau)
    offset = path if path is not None else lambda t: np.zeros(d)

    def controller(q: Array, v: Array, t: float) -> Torques:
        rate = (offset(t + 1e-4) - offset(t - 1e-4)) / 2e-4
        error = q[-d:] - state.q[-d:] - offset(t)
        return Torques(steady - stiffness * error - damping * (v[-d:] - rate))

    return controller


def turn(joint: int, angle: float, duration: float) -> Callable[[float], Array]:
    """A smooth way of one of six joints to `angle`, rad, in `duration`, s."""
    return lambda t: angle * _smooth(t / duration) * np.eye(6)[joint]


def wave(first: int, second: int, size: float, duration: float) -> Callable[[float], Array]:
    """Two of six joints once around a circle of radius `size`, rad, in `duration`, s, and back where they were."""

    def path(t: float) -> Array:
        angle = 2.0 * np.pi * _smooth(t / duration)
        return size * (np.sin(angle) * np.eye(6)[first] + (1.0 - np.cos(angle)) * np.eye(6)[second])

    return path


def _smooth(s: float) -> float:
    """From 0 to 1 with no velocity or acceleration at the ends."""
    s = min(max(s, 0.0), 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def weightless(robot: Robot) -> fb.Simulation:
    """The physics engine with its gravity switched off."""
    sim = fb.Simulation(robot)
    sim.model.opt.gravity[:] = 0.0
    return sim


def base_turn(record: Rollout) -> Array:
    """How the base has turned from the first row to the last, shape (3,), as axis times angle in degrees, world."""
    first, last = (record.state(i).frame_pose("base_link").rotation for i in (0, -1))
    return read_only(np.degrees(pin.log3(last @ first.T)))


# pictures ---------------------------------------------------------------------------------------------------------------


PRESSING_VIEW = View(66.0, 14.0, 1.0, around=((-0.05, 0.0, 0.38), 0.62))


def show_arm(view: Viewer, state: fb.State) -> Viewer:
    """The arm in front of the wall, with the axes x, y, z of the world at its base."""
    tool = state.point("tool0")
    extra = _wall(tool) | below("axes", marks.frame_axes(np.eye(4), 0.28))
    names: dict[str, npt.ArrayLike] = {
        "x": [0.32, 0.0, 0.03],
        "y": [0.0, 0.33, 0.03],
        "tool": tool + [-0.06, 0.0, 0.16],
        "wall": [tool[0], 0.0, 0.95],
    }
    extra |= {f"label/{name}": shapes.label(at, name, 0.05, plate=False) for name, at in names.items()}
    view.show(state, com=False, extra=extra)
    return view.camera(PRESSING_VIEW)


def pressing_panel(view: Viewer, state: fb.State) -> widgets.VBox:
    """Figure 1, left: a slider for how hard the arm presses; the wall answers with f_r, and the bolts with a force and τ_b."""
    view.show(state, com=False)
    view.camera(PRESSING_VIEW)
    tool = state.point("tool0")
    scene = _wall(tool) | below("bolts", props.bolts(np.zeros(3), 0.11))

    def draw(press: float) -> str:
        force = np.array([-press, 0.0, 0.0])
        bolts, moment = -force, -np.cross(tool, force)
        extra = dict(scene)
        if press:
            tip = tool + view.scale * force
            end = np.array([-0.14, 0.0, 0.03])  # behind the base, where it is seen
            start = end - view.scale * bolts
            extra["f/wall"] = shapes.arrow(tool, view.scale * force, MEASURED, view.painter.size)
            extra["f/bolts"] = shapes.arrow(start, view.scale * bolts, MEASURED, view.painter.size)
            extra["f/moment"] = marks.curled_arrow([0.0, 0.16, 0.1], 0.003 * moment, MEASURED)
            extra["label/wall"] = shapes.label(tip + [0.0, 0.0, 0.06], "f{r}", 0.06, plate=False)
            extra["label/bolts"] = shapes.label(start + [-0.02, 0.0, 0.06], "f{bolts}", 0.06, plate=False)
            extra["label/moment"] = shapes.label([0.26, 0.16, 0.14], "τ{b}", 0.06, plate=False)
        view.show(state, com=False, extra=extra)
        tau = state.h - state.frame_jacobian("tool0")[:3].T @ force
        return (
            f"wall on tool <b>{-press:.0f} N</b>, bolts on base <b>{press:+.0f} N</b> and "
            f"<b>{np.linalg.norm(moment):.0f} N·m</b>; largest motor torque {abs(tau).max():.0f} N·m"
        )

    return slider_panel(view, draw, press=(0.0, 60.0, 120.0, "N"))


def play_pressing(view: Viewer, record: Rollout) -> Viewer:
    """The arm on its plate in front of the wall, as the record has it, with the wall's force on the tool."""
    scene = _wall(record.state(0).point("tool0"))

    def picture(state: fb.State, i: int) -> Picture:
        drawn = _free_arm(view, state) | scene | {"plate": _plate(state)}
        for push in record.pushes:
            if push.acts_at(float(record.time[i])):
                vector = view.scale * push.force
                tool = state.point(push.frame)
                drawn["f/wall"] = shapes.arrow(tool, vector, MEASURED, view.painter.size)
                drawn["label/wall"] = shapes.label(tool + vector + [0.0, 0.0, 0.07], "f{r}", 0.06, plate=False)
        return drawn

    return _play(view, record, picture, View(66.0, 14.0, 1.0, around=((-0.12, 0.0, 0.35), 0.7)), speed=0.5)


def play_floating(view: Viewer, record: Rollout) -> Viewer:
    """The arm without bolts, gravity and ground, with axes on its base; a veil stays where it was first."""

    def picture(state: fb.State, i: int) -> Picture:
        drawn = _free_arm(view, state, first=record.state(0))
        return {path: item for path, item in drawn.items() if path not in ("ground", "com/line", "com/projection")}

    centre = tuple(float(x) for x in record.state(0).com)
    return _play(view, record, picture, View(40.0, 25.0, 1.0, around=(centre, 0.6)))  # type: ignore[arg-type]


def stance_panel(view: Viewer, state: fb.State, contacts: fb.Contacts) -> widgets.VBox:
    """Figure 1, right: sliders for what the body should do; the feet answer with f_i, whose sum is f_c and τ_c."""

    def draw(forwards: float, up: float, turn: float) -> str:
        tasks: list[Task] = [
            fb.CoMTask(state.com, acceleration=[forwards, 0.0, up], weight=1e3),
            fb.OrientationTask("base", angular_acceleration=[0.0, 0.0, turn], weight=1e3),
            fb.PostureTask(state.q),
        ]
        command = fb.WholeBodyController(state.robot, contacts, tasks)(state.q, state.v)
        f = command.forces.reshape(-1, 3)
        moment = np.cross(contacts.positions(state) - state.com, f).sum(axis=0)
        view.show(state, contacts, planned=f, wrench=np.concatenate([f.sum(axis=0), moment]))
        a = state.com_jacobian @ command.qdd
        return (
            f"f<sub>c</sub> = {_row(f.sum(axis=0))} N, m (a - g) = {_row(state.robot.mass * (a - [0, 0, -9.81]))} N, "
            f"τ<sub>c</sub> = {_row(moment)} N·m"
        )

    along = (-6.0, 0.0, 6.0, "m/s²")
    panel = slider_panel(view, draw, forwards=(-6.0, 2.0, 6.0, "m/s²"), up=along, turn=(-40.0, 0.0, 40.0, "rad/s²"))
    view.camera(View(62.0, 12.0, 1.0, around=((0.0, 0.0, 0.42), 0.62)))
    return panel


def thruster_panel(view: Viewer, state: fb.State, contacts: fb.Contacts) -> widgets.VBox:
    """go2 in space with a thruster at every foot, (4): sliders for left, right and a twist, left against right."""
    eom = fb.equations_of_motion(state, contacts)
    left = np.array([name[1] == "L" for name in contacts.names])
    gravity, feet = np.array([0.0, 0.0, 9.81]), contacts.positions(state)

    def draw(left_feet: float, right_feet: float, twist: float) -> str:
        f = np.zeros((4, 3))
        f[:, 2] = np.where(left, left_feet, right_feet)
        f[:, 0] = np.where(left, twist, -twist)
        qdd = eom.acceleration(np.zeros(eom.d), f)
        rate = momentum_rate(state, qdd) + np.concatenate([state.robot.mass * gravity, np.zeros(3)])
        picture = view.painter.picture(state, wrench=rate)
        drawn = {path: item for path, item in picture.items() if not path.startswith(("ground", "com/line", "com/projection"))}
        for name, foot, force in zip(contacts.names, feet, f, strict=True):
            if force.any():
                vector = view.scale * force
                start = foot - vector if force[2] > 0 else foot  # below the foot either way, where no leg hides it
                drawn[f"thrust/{name}"] = shapes.arrow(start, vector, MEASURED, 2 * view.painter.size)
        view.draw(drawn, title="blue arrows: thrusters")
        return f"f<sub>c</sub> = {_row(rate[:3])} N, τ<sub>c</sub> = {_row(rate[3:])} N·m"

    each = (-40.0, 30.0, 40.0, "N")
    panel = slider_panel(view, draw, left_feet=each, right_feet=each, twist=(-40.0, 0.0, 40.0, "N"))
    view.camera(View(50.0, 14.0, 1.0, around=((0.0, 0.0, 0.33), 0.55)))
    return panel


def _row(vector: npt.ArrayLike) -> str:
    """Three numbers, without a minus before a zero."""
    return "(" + ", ".join(f"{x + 0.0:.0f}" for x in np.round(np.asarray(vector, dtype=np.float64))) + ")"


def _wall(tool: Array) -> Picture:
    """The wall that the tool touches, and a dark pad where it does."""
    normal = np.array([-1.0, 0.0, 0.0])
    return below("wall", {"/slab": props.wall([tool[0] + 0.003, tool[1], 0.45], normal, 0.6, 0.9)})


def _plate(state: fb.State) -> Item:
    """The plate below the base: a wall's box in another pose."""
    width, thick = PLATE
    slab = props.wall(np.zeros(3), [1.0, 0.0, 0.0], 1.0, 1.0)
    pose = state.frame_pose("base_link")
    centre = pose.translation - pose.rotation[:, 2] * thick / 2
    return Item(slab.shape, shapes.placed(centre, pose.rotation, (width, width, thick)))


def _free_arm(view: Viewer, state: fb.State, first: fb.State | None = None) -> Picture:
    """The arm. first: where it was at first, as a veil, with axes."""
    drawn = view.painter.picture(state, com=first is not None, ghost=first)
    if first is not None:
        drawn |= below("axes", marks.frame_axes(state.frame_pose("base_link").homogeneous, 0.25))
    return drawn


def _play(view: Viewer, record: Rollout, picture: Callable[[fb.State, int], Picture], look: View, speed: float = 1.0) -> Viewer:
    rows = recording.thinned(record.time, 30.0)
    pictures = [picture(record.state(int(i)), int(i)) for i in rows]
    view.play_pictures(record.time[rows], pictures, speed=speed, ghost_name="where it was first")
    return view.camera(look)


# exercises --------------------------------------------------------------------------------------------------------------


@cache
def _pressed() -> tuple[fb.State, Array, Array]:
    """The pressing arm without bolts, the tool's position seen from the base, and f_r."""
    state = unbolted(fb.load("ur5", posture=PRESSING)).standing()
    return state, state.point("tool0") - state.point("base_link"), np.array([-60.0, 0.0, 0.0])


def _bolts_moment() -> Array:
    """From the constraint forces of (7): what the welded base's wrench becomes with the wall, less what it is without."""
    state, _, force = _pressed()
    J = state.frame_jacobian("tool0")[:3]
    eom = fb.equations_of_motion(state, fb.Contacts([fixed_frame("base_link")]))
    wrench = np.linalg.lstsq(eom.J.T, -J.T @ force + eom.S @ (J.T @ force)[6:], rcond=None)[0]
    return np.asarray(wrench[3:])


def _about_the_centre_of_mass() -> Array:
    state, _, force = _pressed()
    return -np.cross(state.point("tool0") - state.com, force)


def _with_the_weight() -> Array:
    state, tool, force = _pressed()
    lever = state.com - state.point("base_link")
    return -np.cross(tool, force) + np.cross(lever, [0.0, 0.0, state.robot.weight])


def _actuation_of_solo8() -> Array:
    """S, column by column: what (3) gives for one torque at a time."""
    robot = fb.load("solo8")
    columns = [np.concatenate([np.zeros(6), one]) for one in np.eye(robot.d)]
    return np.column_stack(columns)


def _carried_by_friction() -> float:
    """Largest horizontal force on a standing go2 that cones of 0.7 allow, from the cone's own number."""
    robot = fb.load("go2")
    contacts = fb.Contacts.points(robot, mu=0.7)
    return float(contacts.mus.max()) * sum(inertia.mass for inertia in robot.model.inertias) * 9.81


def _judge_thrust(answer: Any) -> Verdict:
    """Thrusts at the four feet of a standing go2: 200 N straight up in all, and no moment about the centre of mass."""
    f = numbers(answer, (4, 3), (12,))
    if isinstance(f, Verdict):
        return f
    f = f.reshape(4, 3)
    state = fb.load("go2").standing()
    eom = fb.equations_of_motion(state, fb.Contacts.points(state.robot))
    # by the momentum that (4) brings about, not by sums of forces and levers
    rate = momentum_rate(state, eom.acceleration(np.zeros(12), f)) + [0.0, 0.0, state.robot.weight, 0.0, 0.0, 0.0]
    if abs(rate[2] + 200.0) < 0.2:
        return Verdict(False, "The size is right, the sign is not: these thrusters push the robot down.")
    if abs(rate[:3] - [0.0, 0.0, 200.0]).max() > 0.2:
        return Verdict(False, f"The forces add up to {_row(rate[:3])} N; asked are (0, 0, 200) N.")
    if abs(rate[3:]).max() > 0.02:
        where = ", ".join(f"{x + 0.0:.1f}" for x in np.round(rate[3:], 1))
        return Verdict(False, f"The force is right, but it turns the robot: moment ({where}) N·m about the centre of mass.")
    return Verdict(True, "Straight up without turning. Six conditions on twelve numbers: there are many other answers.")


EXERCISES = (
    Exercise(
        name="01.1",
        statement="The moment, shape (3,), N·m, by which the bolts answer the wall. The wall pushes with f_r at `tool`, both "
        "seen from the base. The weight, which the bolts carry anyway, does not count.",
        stub="bolts_moment = np.zeros(3)  # N·m: replace this, using tool and f_r",
        solution="bolts_moment = -np.cross(tool, f_r)",
        judge=Numeric(
            right=_bolts_moment,
            praise="The bolts undo what the wall does: force and moment, each with the opposite sign.",
            mistakes={
                "This is the wall's own moment about the base. The bolts answer it: look at the sign, or at the order of the "
                "cross product.": lambda: -_bolts_moment(),
                "The moment is taken about the centre of mass; the bolts sit at the base.": _about_the_centre_of_mass,
                "This holds the weight's moment as well; asked is the answer to the wall alone.": _with_the_weight,
                "Zero would mean that nobody answers the wall. Which lever, and which force?": lambda: np.zeros(3),
                "This takes the height of the tool alone; it is also 11 cm to the side, and that is a lever too.": (
                    lambda: np.array([0.0, 60.0 * _pressed()[1][2], 0.0])
                ),
                "* multiplies number by number; a moment is the cross product of lever and force.": (
                    lambda: _pressed()[1] * _pressed()[2]
                ),
                "This is a force; a moment needs a lever: how far from the base does the force act?": lambda: -_pressed()[2],
                "This is f_r itself; a moment needs a lever, and the bolts answer the other way round.": lambda: _pressed()[2],
            },
        ),
        explanation="At rest the moments about the base add up to zero: tool × f_r + τ_b = 0.",
    ),
    Exercise(
        name="01.2",
        statement="solo8 has two joints in each of its four legs. Write its actuation matrix S of (3).",
        stub="S_solo8 = np.eye(8)  # replace this: stack what is missing",
        solution="S_solo8 = np.vstack([np.zeros((6, 8)), np.eye(8)])",
        judge=Shaped(
            shapes={
                (8, 8): "S maps 8 torques into all rows of the equations of motion. How many rows does a base add, and where?",
                (8, 14): "This is the transpose of the answer: S takes 8 torques to 14 rows.",
                (9, 8): "A base adds more than one row: three for its position, three for its orientation.",
                (18, 12): "That is the S of go2, with three joints in each leg; solo8 has two.",
                (15, 8): "15 counts the quaternion's four numbers. Rows of (4) go with velocities, and a rotation has three.",
            },
            judge=Numeric(
                right=_actuation_of_solo8,
                praise="Six rows that no motor reaches, then one row for each motor.",
                mistakes={
                    "The base comes first in q, as (2) has it; here its rows stand last.": lambda: np.roll(
                        _actuation_of_solo8(), -6, axis=0
                    ),
                    "Zeros everywhere: no motor drives anything. Where does each torque act?": lambda: np.zeros((14, 8)),
                    "Is there a torque that pushes a joint backwards? One sign too many.": lambda: -_actuation_of_solo8(),
                },
            ),
        ),
        explanation="(2) puts the six numbers of the base before the joints, so (3) puts six zeros before the torques.",
    ),
    Exercise(
        name="01.3",
        statement="go2 stands on a level floor with μ = 0.7 and is pulled sideways, low enough not to tip. What is the largest "
        "horizontal force, in N, that the floor can answer while the robot stays at rest?",
        stub="most = 1000.0  # N: replace this number by an expression",
        solution="most = 0.7 * go2.mass * 9.81",
        judge=Numeric(
            right=_carried_by_friction,
            tolerance=2e-3,  # g may be 9.8
            praise="The bolts' answer had no bound. This one is friction times weight, as long as no jump adds to it.",
            mistakes={
                "That takes g as 10 m/s²; the physics here has 9.81.": lambda: 10 * _carried_by_friction() / 9.81,
                "That is the weight. A horizontal force has to come from friction.": lambda: _carried_by_friction() / 0.7,
                "That is the share of one foot; four feet share the work.": lambda: _carried_by_friction() / 4,
                "All four feet together carry one weight, not four.": lambda: 4 * _carried_by_friction(),
                "That is friction times mass, in kg; a force needs one more factor.": lambda: _carried_by_friction() / 9.81,
                "μ multiplies the normal force; it does not divide it.": lambda: _carried_by_friction() / 0.49,
                "That is what the controller's four-sided pyramid allows. Asked is what the floor can do: the round cone.": (
                    lambda: _carried_by_friction() / np.sqrt(2.0)
                ),
                "Friction answers along the floor only as far as the normal force goes: multiply by μ, once.": (
                    lambda: 0.7 * _carried_by_friction()
                ),
            },
        ),
        explanation="Each foot gives at most μ times its normal force, and the normal forces add up to the weight.",
    ),
    Exercise(
        name="01.4",
        statement="A design: go2 floats in its standing posture with a thruster at every foot. Choose the forces, shape "
        "(4, 3), N, world, in the order of `contacts.names`, so that they add up to 200 N straight up and turn nothing. "
        "`contacts.positions(state)` and `state.com` are known.",
        stub="thrust = np.tile([0.0, 0.0, 50.0], (4, 1))  # N: four equal thrusts are a first guess",
        solution="lever = contacts.positions(state) - state.com\n"
        "G = np.vstack([np.tile(np.eye(3), 4), np.hstack([np.cross(np.eye(3), -r).T for r in lever])])\n"
        "thrust = np.linalg.lstsq(G, [0, 0, 200, 0, 0, 0], rcond=None)[0].reshape(4, 3)",
        judge=Shaped(_judge_thrust, {(3, 4): "This is the transpose: one row for each foot, three columns."}),
        explanation="Forces and moments are linear in the thrusts, six rows on twelve numbers; least squares gives the "
        "smallest thrusts that do it. Lesson 05 calls the two halves of this matrix G_f and G_τ, (20) and (21).",
    ),
)
