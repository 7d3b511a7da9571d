"""Lesson 01: an arm whose bolts are cut, and the parts of Figure 1 as experiments."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

import floatbase as fb
from floatbase._validation import Array
from floatbase.lessons import props
from floatbase.lessons.judges import format_vector
from floatbase.lessons.panels import SliderPanel, slider_panel
from floatbase.lessons.rounding import rounded
from floatbase.objectives import Task, centroidal_momentum_rate
from floatbase.robots import PLATE_SIZE
from floatbase.simulation import Rollout
from floatbase.viewer import Item, Picture, View, Viewer, markers, prefixed, shapes
from floatbase.viewer.export import recording
from floatbase.viewer.scene.colours import MEASURED

# joints of ur5, rad: the tool points along x, 0.6 m above the ground
PRESSING_POSTURE = (0.0, -1.7, 1.2, 0.5, np.pi / 2, 0.0)
PRESSING_VIEW = View(100.0, 14.0, 1.0, around=((-0.05, 0.0, 0.38), 0.62))


def show_arm(view: Viewer, state: fb.State) -> Viewer:
    """Draw the arm in front of the wall, with the axes x, y, z of the world at its base."""
    tool = state.point("tool0")
    extra = _wall(tool) | prefixed("axes", markers.frame_axes(np.eye(4), 0.28))
    names: dict[str, npt.ArrayLike] = {
        "x": [0.32, 0.0, 0.03],
        "y": [0.0, 0.33, 0.03],
        "z": [0.09, 0.0, 0.28],
        "tool": tool + [-0.03, 0.0, -0.1],
        "wall": [tool[0], 0.0, 0.95],
    }
    extra |= {f"label/{name}": shapes.label(at, name, 0.05) for name, at in names.items()}
    view.show(state, com=False, extra=extra)
    return view.camera(PRESSING_VIEW)


def pressing_panel(view: Viewer, state: fb.State) -> SliderPanel:
    """Return a panel for Figure 1, left: a slider sets how hard the arm presses against a wall."""
    view.show(state, com=False)
    view.camera(PRESSING_VIEW)
    tool = state.point("tool0")
    scene = _wall(tool) | prefixed("bolts", props.bolts(np.zeros(3), 0.11))

    view.add_legend_entry("f", MEASURED, "forces on the arm, and the moment of the bolts")

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
            extra["f/moment"] = markers.curled_arrow([0.0, 0.16, 0.1], 0.003 * moment, MEASURED)
            extra["label/wall"] = shapes.label(tip + [0.0, 0.0, -0.08], "f{r}", 0.06)
            extra["label/bolts"] = shapes.label(start + [-0.02, 0.0, 0.06], "f{bolts}", 0.06)
            extra["label/moment"] = shapes.label([0.26, 0.16, 0.14], "τ{b}", 0.06)
        view.show(state, com=False, extra=extra)
        tau = abs(state.h - state.frame_jacobian("tool0")[:3].T @ force)
        limits = state.robot.torque_limits
        busiest = int(np.argmax(tau / limits))
        return (
            f"wall on tool <b>{rounded(-press, 'N', 3)}</b>, bolts on base "
            f"<b>{rounded(press, 'N', 3)}</b> and "
            f"<b>{np.linalg.norm(moment):.0f} N·m</b>; busiest motor: "
            f"{state.robot.joint_names[busiest]}, "
            f"{tau[busiest]:.0f} of {limits[busiest]:.0f} N·m"
        )

    return slider_panel(view, draw, press=(0.0, 60.0, 120.0, "N"))


def play_pressing(view: Viewer, record: Rollout) -> Viewer:
    """Play a record of the arm on its plate, with the force of the wall on the tool."""
    scene = _wall(record.state(0).point("tool0"))
    view.add_legend_entry("f", MEASURED, "force of the wall")

    def picture(state: fb.State, i: int) -> Picture:
        drawn = _draw_arm(view, state) | scene | {"plate": _plate(state)}
        for push in record.pushes:
            if push.acts_at(float(record.time[i])):
                vector = view.scale * push.force
                tool = state.point(push.frame)
                drawn["f/wall"] = shapes.arrow(tool, vector, MEASURED, view.painter.size)
                drawn["label/wall"] = shapes.label(tool + vector + [0.0, 0.0, 0.07], "f{r}", 0.06)
        return drawn

    return _play_record(
        view, record, picture, View(100.0, 14.0, 1.0, around=((-0.12, 0.0, 0.35), 0.7)), speed=0.5
    )


def play_floating(view: Viewer, record: Rollout) -> Viewer:
    """Play a record of the arm without bolts, gravity and ground, with axes on its base."""

    def picture(state: fb.State, i: int) -> Picture:
        return _without_ground(_draw_arm(view, state, first=record.state(0)))

    centre = tuple(float(x) for x in record.state(0).com)
    return _play_record(view, record, picture, View(40.0, 25.0, 1.0, around=(centre, 0.6)))  # type: ignore[arg-type]


def com_panel(view: Viewer, state: fb.State) -> SliderPanel:
    """Return a panel with go2 in the air: a slider swings its legs."""
    first = state.robot.nv - state.robot.d
    swing = np.zeros(state.robot.nv)
    swing[[first + i for i, name in enumerate(state.robot.joint_names) if "thigh" in name]] = -1.0
    pose = state.frame_pose("base")
    axes = prefixed("axes", markers.frame_axes(pose.homogeneous, 0.2))

    def draw(swing_forwards: float) -> str:
        now = state.replace(q=state.integrate(swing_forwards * swing))
        view.draw(_without_ground(view.painter.picture(now, extra=axes)))
        return (
            f"x<sub>c</sub> seen from the base: "
            f"{format_vector(1e3 * (pose.rotation.T @ (now.com - pose.translation)))} mm"
        )

    panel = slider_panel(view, draw, swing_forwards=(-1.0, 0.0, 1.0, "rad"))
    view.camera(View(78.0, 8.0, 1.0, around=((0.0, 0.0, 0.24), 0.36)))
    return panel


def stance_panel(view: Viewer, state: fb.State, contacts: fb.Contacts) -> SliderPanel:
    """Return a panel for Figure 1, right: sliders set the acceleration of the body."""

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
        newton = state.robot.mass * (state.com_jacobian @ command.qdd - [0, 0, -9.81])
        return (
            f"f<sub>c</sub> = {format_vector(f.sum(axis=0))} N, m (ẍ<sub>c</sub> - g) = "
            f"{format_vector(newton)} N, "
            f"τ<sub>c</sub> = {format_vector(moment)} N·m"
        )

    forwards, up = (-6.0, 2.0, 6.0, "m/s²"), (-4.0, 0.0, 4.0, "m/s²")
    panel = slider_panel(view, draw, forwards=forwards, up=up, turn=(-40.0, 0.0, 40.0, "rad/s²"))
    view.camera(View(62.0, 12.0, 1.0, around=((0.0, 0.0, 0.48), 0.66)))
    return panel


def thruster_panel(view: Viewer, state: fb.State, contacts: fb.Contacts) -> SliderPanel:
    """Return a panel with go2 in space and a thruster at every foot."""
    eom = fb.equations_of_motion(state, contacts)
    left = np.array([name[1] == "L" for name in contacts.names])
    gravity, feet = np.array([0.0, 0.0, 9.81]), contacts.positions(state)

    def draw(left_feet: float, right_feet: float, twist: float) -> str:
        f = np.zeros((4, 3))
        f[:, 2] = np.where(left, left_feet, right_feet)
        f[:, 0] = np.where(left, twist, -twist)
        qdd = eom.acceleration(np.zeros(eom.d), f)
        rate = centroidal_momentum_rate(state, qdd) + np.concatenate(
            [state.robot.mass * gravity, np.zeros(3)]
        )
        picture = view.painter.picture(state, wrench=rate)
        drawn = _without_ground(picture)
        for name, foot, force in zip(contacts.names, feet, f, strict=True):
            if force.any():
                vector = view.scale * force
                # below the foot either way, where no leg hides it
                start = foot - vector if force[2] > 0 else foot
                drawn[f"thrust/{name}"] = shapes.arrow(
                    start, vector, MEASURED, 2 * view.painter.size
                )
        view.draw(drawn)
        return (
            f"f<sub>c</sub> = {format_vector(rate[:3])} N, τ<sub>c</sub> = "
            f"{format_vector(rate[3:])} N·m"
        )

    view.add_legend_entry("thrust", MEASURED, "force of a thruster")
    each = (-40.0, 30.0, 40.0, "N")
    panel = slider_panel(view, draw, left_feet=each, right_feet=each, twist=(-40.0, 0.0, 40.0, "N"))
    view.camera(View(50.0, 14.0, 1.0, around=((0.0, 0.0, 0.38), 0.6)))
    return panel


def _without_ground(picture: Picture) -> Picture:
    """Remove the ground and the projection of the centre of mass from a picture."""
    return {
        path: item
        for path, item in picture.items()
        if not path.startswith(("ground", "com/line", "com/projection"))
    }


def _wall(tool: Array) -> Picture:
    """Return the wall that the tool touches at a point, shape (3,), 0.6 m wide and 0.9 m high."""
    normal = np.array([-1.0, 0.0, 0.0])
    return prefixed(
        "wall", {"/slab": props.wall([tool[0] + 0.003, tool[1], 0.45], normal, 0.6, 0.9)}
    )


def _plate(state: fb.State) -> Item:
    """Return the plate below the base: a wall that lies flat."""
    width, thick = PLATE_SIZE
    slab = props.wall(np.zeros(3), [1.0, 0.0, 0.0], 1.0, 1.0)
    pose = state.frame_pose("base_link")
    centre = pose.translation - pose.rotation[:, 2] * thick / 2
    return Item(slab.shape, shapes.transform(centre, pose.rotation, (width, width, thick)))


def _draw_arm(view: Viewer, state: fb.State, first: fb.State | None = None) -> Picture:
    """Draw the arm; with a first state as ghost, also the base's axes and the centre of mass."""
    drawn = view.painter.picture(state, com=first is not None, ghost=first)
    if first is not None:
        drawn |= prefixed(
            "axes", markers.frame_axes(state.frame_pose("base_link").homogeneous, 0.25)
        )
    return drawn


def _play_record(
    view: Viewer,
    record: Rollout,
    picture: Callable[[fb.State, int], Picture],
    look: View,
    speed: float = 1.0,
) -> Viewer:
    """Play a record as 30 pictures per second; picture: (state, row of the record) -> `Picture`."""
    rows = recording.sampled_rows(record.time, 30.0)
    pictures = [picture(record.state(int(i)), int(i)) for i in rows]
    view.play_pictures(record.time[rows], pictures, speed=speed, ghost_name="initial state")
    return view.camera(look)
