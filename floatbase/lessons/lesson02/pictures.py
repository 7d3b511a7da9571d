"""Lesson 02, Equations of motion and contact: pictures of (4), a contact without its drift, a wheel that parks, exercises."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any

import ipywidgets as widgets
import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
import pinocchio as pin
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import floatbase as fb
from floatbase._arrays import Array
from floatbase._assets import assets_root
from floatbase.dynamics import EquationsOfMotion, PointContact, RollingWheel
from floatbase.lessons import Exercise, Numeric, Shaped, Verdict, slider_panel
from floatbase.robots import Robot
from floatbase.simulation import Rollout
from floatbase.viewer import ALARM, COM, MEASURED, PLANNED, Picture, View, Viewer, geometry, hexadecimal, marks, props, shapes

Motion = Callable[[EquationsOfMotion, Array, Array], tuple[Array, Array]]
MOMENT = 0.01  # m drawn for a newton metre
DISC_RADIUS = 0.2  # m, of assets/models/disc.urdf


# the equation as a picture ----------------------------------------------------------------------------------------------


def draw_equation(eom: EquationsOfMotion) -> Figure:
    """(4) drawn to scale: which entries of M, S and Jᵀ are not zero, with the base's rows above the line; four point feet."""
    feet = [str(name).split("_")[0] for name in eom.contacts.names]
    in_threes = 3.0 * np.arange(len(feet)) + 1.0  # the middle of each leg's joints, and of each foot's force
    parts = [("M q̈", eom.M, 6.0), ("+ h", eom.h[:, None], None), ("= S τ", eom.S, 0.0), ("+ Jᵀ λ", eom.J.T, 0.0)]
    widths = [max(part.shape[1], 1.6) for _, part, _ in parts]
    figure, axes = plt.subplots(1, 4, figsize=(9.5, 3.7), width_ratios=widths, layout="constrained")
    for axis, (name, part, first) in zip(axes, parts, strict=True):
        filled = np.abs(part) > 1e-9 * np.abs(part).max()
        axis.imshow(np.where(filled, 1.0, 0.0), cmap="Blues", vmin=0.0, vmax=1.6, aspect="equal")
        axis.axhline(5.5, color=hexadecimal(ALARM), linewidth=1.5)
        axis.set_title(name, fontsize=14)
        axis.set(xlabel=f"{part.shape[0]} × {part.shape[1]}", xticks=[], yticks=[])
        if first is not None:
            axis.set_xticks(in_threes + first, feet, fontsize="small")
    axes[0].set_xticks([2.5, *(in_threes + 6.0)], ["base", *feet], fontsize="small")
    axes[0].set_yticks([2.5, *(in_threes + 6.0)], ["base", *feet], fontsize="small")
    return figure


def force_panel(view: Viewer, state: fb.State, contacts: fb.Contacts, foot: str) -> widgets.VBox:
    """What Jᵀ makes of a force at one foot: the force and moment it is for the base, and the torques for the foot's leg."""
    J = fb.equations_of_motion(state, contacts).J[contacts.force_slice(foot)]
    base = state.frame_pose("base")
    leg = [i for i, name in enumerate(state.robot.joint_names) if name.startswith(foot[:2])]
    where = list(contacts.names).index(foot)

    def draw(forwards: float, up: float) -> str:
        force = np.array([forwards, 0.0, up])
        generalised = J.T @ force
        f, moment = base.rotation @ generalised[:3], base.rotation @ generalised[3:6]
        forces = np.zeros((len(contacts), 3))
        forces[where] = force
        size, scale = view.painter.size, view.scale
        drawn = marks.wrench(base.translation, scale * f, MOMENT * moment, size)
        extra = {f"base{path}": item for path, item in drawn.items()} if np.linalg.norm(force) > 1e-6 else {}
        if extra:
            extra["label/base"] = shapes.label(
                base.translation + scale * f + [0.0, 0.0, 0.04], "on the base", 0.028, plate=False
            )
            tip = state.point(foot) + scale * force
            extra["label/foot"] = shapes.label(tip + [0.05, 0.0, 0.02], "on the foot", 0.028, plate=False)
        picture = view.painter.picture(state, contacts, planned=forces, com=False, cones=False, extra=extra)
        view.draw({path.replace("planned/", "force/"): item for path, item in picture.items()})
        torques = ", ".join(f"{x + 0.0:.1f}" for x in np.round(generalised[6:][leg], 1))
        rest = np.delete(generalised[6:], leg)
        return (
            f"base rows: force {_row(generalised[:3])} N, moment {_row(generalised[3:6], 1)} N·m; joints of this leg "
            f"{torques} N·m; all other joints {np.abs(rest).max():.0f}"
        )

    panel = slider_panel(view, draw, forwards=(-40.0, 0.0, 40.0, "N"), up=(0.0, 60.0, 80.0, "N"))
    view.camera(View(76.0, 14.0, 1.0, around=((0.0, 0.0, 0.32), 0.42)))
    return panel


def _row(vector: npt.ArrayLike, digits: int = 0) -> str:
    """Three numbers, without a minus before a zero."""
    return "(" + ", ".join(f"{x + 0.0:.{digits}f}" for x in np.round(np.asarray(vector), digits)) + ")"


# contact ----------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Answer:
    """Torques to apply and the contact forces that (7) says they bring about."""

    tau: Array
    forces: Array


class ConstantTorques:
    """A controller that always gives the same torques, and beside them the λ that `motion` finds for them from (7)."""

    def __init__(self, contacts: fb.Contacts, tau: npt.ArrayLike, motion: Motion):
        self.contacts, self.tau, self.motion = contacts, np.array(tau, dtype=np.float64), motion
        self.robot: Robot | None = None

    def __call__(self, q: Array, v: Array, t: float) -> _Answer:
        """The command for configuration q and velocity v."""
        assert self.robot is not None
        eom = fb.equations_of_motion(fb.State(self.robot, q, v), self.contacts)
        return _Answer(self.tau, self.motion(eom, self.tau, eom.b)[1])


def run_constant(robot: Robot, contacts: fb.Contacts, tau: npt.ArrayLike, motion: Motion, duration: float = 0.2) -> Rollout:
    """MuJoCo under constant torques; `planned` holds the λ of (7) at every millisecond, `measured` the engine's."""
    controller = ConstantTorques(contacts, tau, motion)
    controller.robot = robot
    return fb.rollout(fb.Simulation(robot), controller, duration)


def plot_both(record: Rollout, title: str) -> Axes:
    """Vertical forces at a front and at a rear foot, by (7) and by the engine; left and right are alike."""
    _, axis = plt.subplots(figsize=(8, 3), layout="constrained")
    names = list(record.contacts.names)
    for foot, where in (("FL_foot", "front"), ("RL_foot", "rear")):
        row = 3 * names.index(foot) + 2
        axis.plot(
            record.time, record.planned[:, row], color=hexadecimal(PLANNED), linewidth=4, alpha=0.7, label=f"(7), {where}"
        )
        axis.plot(record.time, record.measured[:, row], color=hexadecimal(MEASURED), label=f"MuJoCo, {where}")
        axis.annotate(f"each {where} foot", (record.time[90], record.measured[90, row]), (0, 8), textcoords="offset points")
    axis.set(xlabel="time [s]", ylabel="vertical force [N]", title=title)
    axis.grid(alpha=0.25)
    axis.legend(ncols=2, fontsize="small")
    return axis


def pins(robot: Robot) -> fb.Contacts:
    """A pin through the middle of every foot: contacts of radius 0, which do not roll."""
    return fb.Contacts([PointContact(foot.frame) for foot in robot.feet])


def collapse(
    state: fb.State, contacts: fb.Contacts, motion: Motion, drift: bool, duration: float = 0.2, step: float = 1e-3
) -> list[fb.State]:
    """(7) integrated without torques: the robot sinks on its feet. drift: take b as it is, or as zero."""
    tau, states = np.zeros(state.robot.d), [state]
    for _ in range(round(duration / step)):
        eom = fb.equations_of_motion(state, contacts)
        qdd, _ = motion(eom, tau, eom.b if drift else np.zeros_like(eom.b))
        v = state.v + step * qdd
        state = state.replace(q=state.integrate(step * (state.v + v) / 2), v=v)
        states.append(state)
    return states


def strayed(states: Sequence[fb.State], contacts: fb.Contacts) -> Array:
    """How far the worst foot is from where it was first, m, for each state."""
    places = np.array([contacts.positions(state) for state in states])
    return np.asarray(np.linalg.norm(places - places[0], axis=2).max(axis=1))


def plot_strayed(curves: dict[str, Array], duration: float) -> Axes:
    """Feet that stray, curves in mm, on a scale that shows small ones too."""
    _, axis = plt.subplots(figsize=(8, 3), layout="constrained")
    for (name, curve), colour in zip(curves.items(), (ALARM, MEASURED, PLANNED), strict=False):
        time = np.linspace(0.0, duration, len(curve))
        axis.semilogy(time[1:], curve[1:], color=hexadecimal(colour), label=name)
    axis.set(xlabel="time [s]", ylabel="worst foot strayed [mm]", ylim=(1e-3, 1e2))
    axis.grid(alpha=0.25)
    axis.legend(loc="lower right", fontsize="small")
    return axis


def turning_about_its_tool(arm: Robot, speed: float = 3.0) -> fb.State:
    """The arm with all joints but the last moving, `speed` rad/s in all, such that the tool's origin rests: J q̇ = 0."""
    state = arm.standing()
    J = state.frame_jacobian("tool0")[:3]
    elbow_first = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    v = elbow_first - np.linalg.pinv(J) @ (J @ elbow_first)
    return state.replace(v=speed * v / np.linalg.norm(v))


def tool_path(record: Rollout) -> Array:
    """How far the arm's tool is from where it was first, mm, for every row of a record."""
    places = np.array([record.state(i).point("tool0") for i in range(len(record))])
    return 1e3 * np.asarray(np.linalg.norm(places - places[0], axis=1))


def play_tools(view: Viewer, forgotten: Rollout, kept: Rollout) -> Viewer:
    """The arm whose b was forgotten, in front of the veil of the one whose b was kept; a red line from where the tool was."""
    home = forgotten.state(0).point("tool0")
    rows = np.linspace(0, len(kept) - 1, 30).astype(int)
    pictures = []
    for i in rows:
        drawn = view.painter.picture(forgotten.state(i), com=False, ghost=kept.state(i))
        drawn["home"] = shapes.arrow(home + [0.0, 0.0, 0.25], [0.0, 0.0, -0.24], PLANNED, view.painter.size)
        way = forgotten.state(i).point("tool0") - home
        length = float(np.linalg.norm(way))
        if length > 2e-3:
            drawn["way"] = shapes.rod(home, geometry.frame_along(way / length), length, 0.012, ALARM)
        pictures.append(drawn)
    view.play_pictures(forgotten.time[rows], pictures, speed=0.1, ghost_name="with b")
    return view.camera(View(66.0, 14.0, 1.0, around=((0.24, 0.1, 0.62), 0.32)))


def play_collapse(
    view: Viewer, forgotten: Sequence[fb.State], kept: Sequence[fb.State], contacts: fb.Contacts, duration: float
) -> Viewer:
    """The robot whose b was forgotten, in front of the veil of the one whose b was kept; marks where the feet belong."""
    places = contacts.positions(forgotten[0])
    home = {f"home/{i}": shapes.contact_patch([*p[:2], 0.001], [0.0, 0.0, 1.0], 0.03) for i, p in enumerate(places)}

    def picture(ours: fb.State, theirs: fb.State) -> Picture:
        drawn = view.painter.picture(ours, com=False, ghost=theirs) | home
        for i, (a, b) in enumerate(zip(places, contacts.positions(ours), strict=True)):
            way = b - a
            length = float(np.linalg.norm(way))
            if length > 2e-3:  # beside the foot, where it is seen
                start = a + [0.0, 0.06 * np.sign(a[1]), 0.0]
                drawn[f"way/{i}"] = shapes.rod(start, geometry.frame_along(way / length), length, 0.006, ALARM)
        return drawn

    rows = np.linspace(0, len(kept) - 1, 30).astype(int)
    pictures = [picture(forgotten[i], kept[i]) for i in rows]
    view.play_pictures(np.linspace(0.0, duration, 30), pictures, speed=0.1, ghost_name="with b")
    return view.camera(View(72.0, 10.0, 1.0, around=((0.0, 0.0, 0.16), 0.36)))


# the wheel --------------------------------------------------------------------------------------------------------------


def disc() -> Robot:
    """A solid disc of 1 kg and 0.2 m radius, free to move; its axle is y."""
    return fb.load_urdf(assets_root() / "models" / "disc.urdf")


def wheel() -> RollingWheel:
    """The disc rolls on the level ground."""
    return RollingWheel("disc", np.array([0.0, 1.0, 0.0]), DISC_RADIUS)


def upright(
    robot: Robot, place: Sequence[float] = (0.0, 0.0), heading: float = 0.0, rolled: float = 0.0,
    speed: float = 0.0, turning: float = 0.0,
) -> fb.State:  # fmt: skip
    """The disc upright on the ground.

    place: of its centre, m. heading, rolled: rad. speed: m/s, of a disc that rolls along its heading. turning: rad/s, about
    the vertical.
    """
    R = pin.utils.rotate("z", heading) @ pin.utils.rotate("y", rolled)
    velocity = speed * np.array([np.cos(heading), np.sin(heading), 0.0])
    omega = speed / DISC_RADIUS * R[:, 1] + turning * np.array([0.0, 0.0, 1.0])
    q = np.concatenate([[*place, DISC_RADIUS], pin.Quaternion(R).normalized().coeffs()])
    return fb.State(robot, q, np.concatenate([R.T @ velocity, R.T @ omega]))


def park(robot: Robot, way: float = 0.5, turn: float = 0.7, steps: int = 20) -> list[fb.State]:
    """Roll ahead, turn, roll back, turn back, turn the roll of the disc included; every state with its velocity, 1 s a leg."""
    states, x, y, heading, rolled = [], 0.0, 0.0, 0.0, 0.0
    for speed, turning in ((way, 0.0), (0.0, turn), (-way, 0.0), (0.0, -turn)):
        for _ in range(steps):
            states.append(upright(robot, (x, y), heading, rolled, speed, turning))
            x, y = x + speed * np.cos(heading) / steps, y + speed * np.sin(heading) / steps
            heading, rolled = heading + turning / steps, rolled + speed / DISC_RADIUS / steps
    return [*states, upright(robot, (x, y), heading, rolled)]


def parking_panel(view: Viewer, robot: Robot) -> widgets.VBox:
    """Sliders for how the disc parks; its way on the ground, the disc before (veil), in the middle and after."""

    def draw(way: float, turn: float, time: float) -> str:
        states = park(robot, way, turn)
        picture = view.painter.stage()
        corners = [wheel().positions(state)[0] for state in states[::20]]
        for i, (a, b) in enumerate(pairwise(corners)):
            length = float(np.linalg.norm(b - a))
            if length > 1e-6:
                picture[f"way/{i}"] = shapes.rod(a, geometry.frame_along((b - a) / length), length, 0.006, COM)
        picture["wheel/now"] = _drawn(states[min(round(time * 20), len(states) - 1)], way, time)
        for name, at in (("start", corners[0]), ("end", corners[-1])):
            picture[f"mark/{name}"] = shapes.contact_patch(at + [0.0, 0.0, 0.002], [0.0, 0.0, 1.0], 0.035)
            picture[f"name/{name}"] = shapes.label(at + [-0.17, 0.0, 0.02], name, 0.05)
        view.draw(picture)
        gone = states[-1].q[:2] - states[0].q[:2]
        slip = max(float(np.abs(wheel().slip(state)).max()) for state in states)
        return (
            f"in the end: {gone[0]:+.2f} m ahead, <b>{gone[1]:+.2f} m to the left</b>, heading as before; "
            f"largest slip on the way {abs(slip):.3f} m/s"
        )

    panel = slider_panel(view, draw, way=(0.0, 0.5, 1.0, "m"), turn=(-1.5, -0.7, 1.5, "rad"), time=(0.0, 1.5, 4.0, "s"))
    view.camera(View(-115.0, 32.0, 1.0, around=((0.38, 0.05, 0.1), 0.62)))
    return panel


def _drawn(state: fb.State, way: float, time: float) -> shapes.Item:
    """The disc with spokes, so that its rolling is seen."""
    legs = np.clip(time - np.arange(4), 0.0, 1.0)
    rolled = way / DISC_RADIUS * (legs[0] - legs[2])
    return props.wheel(state.q[:3], state.frame_pose("disc").rotation[:, 1], DISC_RADIUS, rolled, width=0.05)


# exercises --------------------------------------------------------------------------------------------------------------


@cache
def _scene() -> tuple[fb.State, fb.Contacts]:
    """The moving go2 of the exercises, and its contacts."""
    robot = fb.load("go2")
    slow = robot.random_state(5)
    return slow.replace(v=8 * slow.v), fb.Contacts.points(robot)


def _velocity_of(state: fb.State, foot: str, step: float) -> Array:
    """Velocity of the foot's frame after `step` s of the same v."""
    return state.replace(q=state.integrate(step * state.v)).frame_velocity(foot)[:3]


def _drift() -> Array:
    """-J̇ q̇ by central differences of the foot's velocity at constant q̇."""
    state, _ = _scene()
    h = 1e-5
    return -(_velocity_of(state, "FL_foot", h) - _velocity_of(state, "FL_foot", -h)) / (2 * h)


def _drift_in_the_foots_frame() -> Array:
    state, _ = _scene()
    return np.asarray(state.frame_pose("FL_foot").rotation.T @ _drift())


def _drift_of_a_spatial_acceleration() -> Array:
    """Without ω × v: what Pinocchio's spatial acceleration gives in world axes."""
    state, _ = _scene()
    moving = state.frame_velocity("FL_foot")
    return _drift() + np.cross(moving[3:], moving[:3])


def _generalised() -> Array:
    """Jᵀ λ by virtual work: the power of λ for each unit velocity, by finite differences of the foot's place."""
    state, _ = _scene()
    force, h = np.array([10.0, -5.0, 40.0]), 1e-6
    ahead = [state.replace(q=state.integrate(h * e)).point("FL_foot") for e in np.eye(18)]
    back = [state.replace(q=state.integrate(-h * e)).point("FL_foot") for e in np.eye(18)]
    return np.array([force @ (a - b) / (2 * h) for a, b in zip(ahead, back, strict=True)])


def _generalised_in_world_axes() -> Array:
    """The base's rows turned into the world: the usual confusion."""
    state, _ = _scene()
    R = state.frame_pose("base").rotation
    wrong = _generalised()
    wrong[:3], wrong[3:6] = R @ wrong[:3], R @ wrong[3:6]
    return wrong


def _generalised_joints_only() -> Array:
    wrong = _generalised()
    wrong[:6] = 0.0
    return wrong


def _standing_go2() -> EquationsOfMotion:
    """go2 standing on four feet."""
    robot = fb.load("go2")
    return fb.equations_of_motion(robot.standing(), fb.Contacts.points(robot))


def _judge_holding(answer: Any) -> Verdict:
    """Torques and forces that keep a standing go2 still, by (4) row by row."""
    if answer is None or answer is Ellipsis or (isinstance(answer, tuple) and any(part is None for part in answer)):
        return Verdict(False, "There is no answer yet: replace the placeholder by your expression.")
    if not isinstance(answer, (tuple, list)) or len(answer) != 2:
        return Verdict(False, "The answer should be two arrays, (torques, forces).")
    try:
        tau, forces = (np.asarray(part, dtype=np.float64) for part in answer)
    except (TypeError, ValueError):
        return Verdict(False, "The answer should be two arrays of numbers, (torques, forces).")
    if tau.shape != (12,) or forces.shape not in ((12,), (4, 3)):
        return Verdict(False, f"The shapes are {tau.shape} and {forces.shape}; they should be (12,) and (12,).")
    forces = forces.ravel()
    if not (np.all(np.isfinite(tau)) and np.all(np.isfinite(forces))):
        return Verdict(False, "The answer holds numbers that are not finite.")
    state = fb.load("go2").standing()
    contacts = fb.Contacts.points(state.robot)
    # Newton and Euler for the whole robot, then each leg by its own Jacobian: not the rows of eom
    f = forces.reshape(4, 3)
    up = f.sum(axis=0) - [0.0, 0.0, state.robot.weight]
    moment = np.cross(contacts.positions(state) - state.com, f).sum(axis=0)
    if abs(up[2] + 2 * state.robot.weight) < 0.1:
        return Verdict(False, "These forces push the robot down: λ is what the ground does to the robot.")
    if np.abs(up).max() > 0.1:
        return Verdict(False, f"The base's force rows are not balanced: {_row(up, 1)} N are left over.")
    if np.abs(moment).max() > 0.02:
        return Verdict(False, f"The base's moment rows are not balanced: {_row(moment, 1)} N·m are left over.")
    if f[:, 2].min() < 0.0:
        return Verdict(False, "It balances, but one foot pulls at the ground, which no ground allows.")
    pull = np.concatenate([[0.0] * 6, np.zeros(12)])
    for contact, force in zip(contacts, f, strict=True):
        pull += contact.jacobian(state).T @ force
    gravity = state.h[6:]
    if np.abs(tau - (gravity - pull[6:])).max() < 0.02:
        return Verdict(True, "Nothing moves. The base's rows chose the forces, the joints' rows then chose the torques.")
    if np.abs(tau - gravity).max() < 0.02:
        return Verdict(False, "These torques carry the legs alone: the term Jᵀ λ is missing from the joints' rows.")
    if np.abs(tau - (gravity + pull[6:])).max() < 0.02:
        return Verdict(False, "In the joints' rows the sign of Jᵀ λ is wrong: S τ + Jᵀ λ stand on the same side.")
    if np.abs(tau + (gravity - pull[6:])).max() < 0.02:
        return Verdict(False, "The torques' size is right, the sign is not.")
    worst = float(np.abs(tau - (gravity - pull[6:])).max())
    return Verdict(False, f"The base is balanced; the joints' rows are not: up to {worst:.1f} N·m are left over.")


EXERCISES = (
    Exercise(
        name="02.1",
        statement="solo8 (two joints a leg) stands on three point feet. What is the shape of J, as (rows, columns)?",
        stub="shape_of_J = (3, 8)  # replace this",
        solution="shape_of_J = (9, 14)",
        judge=Numeric(
            count=True,
            right=lambda: (
                fb.equations_of_motion(
                    fb.load("solo8").standing(), fb.Contacts.points(fb.load("solo8"), frames=["FL_FOOT", "FR_FOOT", "HL_FOOT"])
                ).J.shape
            ),
            praise="Three rows for each point, one column for each direction the robot can move in: d + 6.",
            mistakes={
                "These are the joints' columns alone; the base's directions move a foot too.": lambda: (9, 8),
                "A base has six directions, not one: φ maps from R^(d+6).": lambda: (9, 9),
                "15 numbers are in q, where the quaternion has four. J has a column for each direction of velocity.": lambda: (
                    9,
                    15,
                ),
                "This is the shape of the transpose.": lambda: (14, 9),
                "Three rows would be one foot. And the base has columns too.": lambda: (3, 8),
                "Three rows would be one foot; three feet touch.": lambda: (3, 14),
                "Three feet touch, not four.": lambda: (12, 14),
                "18 columns are go2's, with three joints in each leg; solo8 has two.": lambda: (9, 18),
            },
        ),
        explanation="k = 3 for each of 3 feet, d + 6 = 8 + 6 columns.",
    ),
    Exercise(
        name="02.2",
        statement="`moving` is go2 in a tilted, moving state. The ground pushes its FL_foot (the frame's origin) with `push`. "
        "Which generalised force, shape (18,), enters (4)?",
        stub="generalised = np.zeros(18)  # replace this, using moving.frame_jacobian and push",
        solution='generalised = moving.frame_jacobian("FL_foot")[:3].T @ push',
        judge=Shaped(
            shapes={
                (3,): "(4) has a row for each direction of velocity: J takes 18 numbers to 3, its transpose goes back.",
                (12,): "These are the joints alone. The force also pushes the base: its six rows are missing.",
                (6,): "frame_jacobian has six rows, three linear and three angular; a force at a point takes the first three.",
            },
            judge=Numeric(
                right=_generalised,
                praise="The same matrix that turns velocities into the foot's velocity turns its force into all rows.",
                mistakes={
                    "The sign is turned: λ is what the ground does to the robot, and it stands on the side of S τ.": (
                        lambda: -_generalised()
                    ),
                    "The base's rows are in world axes. v, and so the base's rows, are in the base's own frame.": (
                        _generalised_in_world_axes
                    ),
                    "The base's rows are zero: only motors leave them alone, a foot's force does not.": (
                        _generalised_joints_only
                    ),
                    "This is the Jacobian of the standing robot; `moving` has another posture, so another J.": (
                        lambda: fb.load("go2").standing().frame_jacobian("FL_foot")[:3].T @ [10.0, -5.0, 40.0]
                    ),
                    "These are the angular rows of the Jacobian; a force at a point takes the linear ones, which come first.": (
                        lambda: _scene()[0].frame_jacobian("FL_foot")[3:].T @ [10.0, -5.0, 40.0]
                    ),
                    "Zero would mean that the force does nothing.": lambda: np.zeros(18),
                },
            ),
        ),
        explanation="Power is the same in both descriptions: λ · (J v) = (Jᵀ λ) · v for every v.",
    ),
    Exercise(
        name="02.3",
        statement="The same state. What must J q̈ be for the FL_foot's origin not to accelerate? (3,), m/s², world.",
        stub="b_foot = np.zeros(3)  # replace this",
        solution='b_foot = -moving.frame_drift("FL_foot")[:3]',
        judge=Numeric(
            right=_drift,
            praise="That much joint and base acceleration is needed only to keep the foot where it is.",
            mistakes={
                "This forgets the drift: the foot accelerates even at q̈ = 0, because J changes as the robot moves.": (
                    lambda: np.zeros(3)
                ),
                "This is J̇ q̇ itself. J q̈ + J̇ q̇ = 0: which sign has b?": lambda: -_drift(),
                "The right vector in the foot's axes; (5) is written in world axes here.": _drift_in_the_foots_frame,
                "ω × v is missing: the acceleration of a point is not the spatial acceleration of its body.": (
                    _drift_of_a_spatial_acceleration
                ),
                "This is the velocity of the foot; asked is an acceleration.": lambda: _velocity_of(
                    _scene()[0], "FL_foot", 0.0
                ),
                "These are the angular rows of the drift; a point takes the linear ones, which come first.": lambda: (
                    -_scene()[0].frame_drift("FL_foot")[3:]
                ),
            },
        ),
        explanation="d²φ/dt² = J q̈ + J̇ q̇ = 0, so b = -J̇ q̇. `frame_drift` is J̇ q̇: linear rows first.",
    ),
    Exercise(
        name="02.4",
        statement="A design without a controller: find torques and contact forces that keep the standing go2 still, from (4) "
        "with q̈ = 0: S τ + Jᵀ λ = h. 24 unknowns, 18 equations.",
        stub="hold_tau = eom.h[6:]\nhold_forces = np.tile([0.0, 0.0, go2.weight / 4], 4)  # a first guess",
        solution="both = np.linalg.lstsq(np.hstack([eom.S, eom.J.T]), eom.h, rcond=None)[0]\n"
        "hold_tau, hold_forces = both[:12], both[12:]",
        judge=_judge_holding,
        names=lambda: {"go2": fb.load("go2"), "eom": _standing_go2()},
        explanation="Six more unknowns than equations: lstsq takes the smallest. The other answers differ by forces that "
        "squeeze the robot from within; lesson 03 is about them.",
    ),
)
