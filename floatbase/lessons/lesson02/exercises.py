"""Exercises of lesson 02, Equations of motion and contact."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.dynamics import EquationsOfMotion
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import (
    NO_ANSWER,
    Example,
    NumericJudge,
    ShapeJudge,
    Verdict,
    format_vector,
)


@cache
def _moving_go2() -> tuple[fb.State, fb.Contacts]:
    """The moving go2 of the exercises, and its contacts."""
    robot = fb.load("go2")
    slow = robot.random_state(5)
    return slow.replace(v=8 * slow.v), fb.Contacts.points(robot)


def _velocity_of(state: fb.State, foot: str, step: float) -> Array:
    """Velocity of the foot's frame after `step` s of the same v."""
    return state.replace(q=state.integrate(step * state.v)).frame_velocity(foot)[:3]


def _drift() -> Array:
    """-J̇ q̇, (3,), m/s², world, by central differences of the foot's velocity at constant q̇."""
    state, _ = _moving_go2()
    h = 1e-5
    return -(_velocity_of(state, "FL_foot", h) - _velocity_of(state, "FL_foot", -h)) / (2 * h)


def _drift_in_the_foots_frame() -> Array:
    state, _ = _moving_go2()
    return np.asarray(state.frame_pose("FL_foot").rotation.T @ _drift())


def _drift_of_a_spatial_acceleration() -> Array:
    """Without ω × v: what Pinocchio's spatial acceleration gives in world axes."""
    state, _ = _moving_go2()
    moving = state.frame_velocity("FL_foot")
    return _drift() + np.cross(moving[3:], moving[:3])


def _generalised() -> Array:
    """Jᵀ λ by virtual work: the power of λ for each unit velocity, by finite differences of the
    foot's place.
    """
    state, _ = _moving_go2()
    force, h = np.array([10.0, -5.0, 40.0]), 1e-6
    ahead = [state.replace(q=state.integrate(h * e)).point("FL_foot") for e in np.eye(18)]
    back = [state.replace(q=state.integrate(-h * e)).point("FL_foot") for e in np.eye(18)]
    return np.array([force @ (a - b) / (2 * h) for a, b in zip(ahead, back, strict=True)])


def _generalised_in_world_axes() -> Array:
    """The base's rows turned into the world: the usual confusion."""
    state, _ = _moving_go2()
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
    if (
        answer is None
        or answer is Ellipsis
        or (isinstance(answer, tuple) and any(part is None for part in answer))
    ):
        return NO_ANSWER
    if not isinstance(answer, (tuple, list)) or len(answer) != 2:
        return Verdict(False, "The answer should be two arrays, (torques, forces).", "not_two")
    try:
        tau, forces = (np.asarray(part, dtype=np.float64) for part in answer)
    except (TypeError, ValueError):
        return Verdict(
            False, "The answer should be two arrays of numbers, (torques, forces).", "not_numbers"
        )
    if tau.shape != (12,) or forces.shape not in ((12,), (4, 3)):
        return Verdict(
            False,
            f"The shapes are {tau.shape} and {forces.shape}; they should be (12,) and (12,).",
            "shapes",
        )
    forces = forces.ravel()
    if not (np.all(np.isfinite(tau)) and np.all(np.isfinite(forces))):
        return Verdict(False, "The answer holds numbers that are not finite.", "not_finite")
    state = fb.load("go2").standing()
    contacts = fb.Contacts.points(state.robot)
    # Newton and Euler for the whole robot, then each leg by its own Jacobian: not the rows of eom
    f = forces.reshape(4, 3)
    up = f.sum(axis=0) - [0.0, 0.0, state.robot.weight]
    moment = np.cross(contacts.positions(state) - state.com, f).sum(axis=0)
    if abs(up[2] + 2 * state.robot.weight) < 0.1:
        return Verdict(
            False,
            "These forces push the robot down: λ is what the ground does to the robot.",
            "sign",
        )
    if np.abs(up).max() > 0.1:
        return Verdict(
            False,
            f"The base's force rows are not balanced: {format_vector(up, 1)} N are left over.",
            "force_rows",
        )
    if np.abs(moment).max() > 0.02:
        return Verdict(
            False,
            f"The base's moment rows are not balanced: {format_vector(moment, 1)} N·m are left "
            f"over.",
            "moment_rows",
        )
    if f[:, 2].min() < 0.0:
        return Verdict(
            False, "It balances, but one foot pulls at the ground, which no ground allows.", "pulls"
        )
    pull = np.zeros(18)
    for contact, force in zip(contacts, f, strict=True):
        pull += contact.jacobian(state).T @ force
    gravity = state.h[6:]
    if np.abs(tau - (gravity - pull[6:])).max() < 0.02:
        return Verdict(
            True,
            "Nothing moves. The base's rows chose the forces, the joints' rows then chose the "
            "torques.",
        )
    if np.abs(tau - gravity).max() < 0.02:
        return Verdict(
            False,
            "These torques carry the legs alone: the term Jᵀ λ is missing from the joints' rows.",
            "gravity_alone",
        )
    if np.abs(tau - (gravity + pull[6:])).max() < 0.02:
        return Verdict(
            False,
            "In the joints' rows the sign of Jᵀ λ is wrong: S τ + Jᵀ λ stand on the same side.",
            "sign_of_forces",
        )
    if np.abs(tau + (gravity - pull[6:])).max() < 0.02:
        return Verdict(False, "The torques' size is right, the sign is not.", "torque_sign")
    worst = float(np.abs(tau - (gravity - pull[6:])).max())
    return Verdict(
        False,
        f"The base is balanced; the joints' rows are not: up to {worst:.1f} N·m are left over.",
        "joint_rows",
    )


def _holdings() -> list[Example]:
    """By the lever rule, and one leg at a time."""
    state = fb.load("go2").standing()
    contacts = fb.Contacts.points(state.robot)
    feet = abs(contacts.positions(state) - state.com)
    share = np.outer([feet[2, 0], feet[0, 0]], [feet[1, 1], feet[0, 1]]).ravel()
    forces = state.robot.weight / share.sum() * np.outer(share, [0.0, 0.0, 1.0])
    gravity = state.h[6:]
    tau = gravity - contacts.jacobian(state).T[6:] @ forces.ravel()
    squeeze = np.outer([1, -1, -1, 1], [0.0, 0.0, 100.0])
    return [
        ((tau, forces), ""), ((tau, forces.ravel()), ""), ((tau, -forces), "sign"),
        ((tau, 0.5 * forces), "force_rows"),
        ((tau, forces[::-1]), "moment_rows"), ((tau, forces + squeeze), "pulls"),
        ((gravity, forces), "gravity_alone"),
        ((2 * gravity - tau, forces), "sign_of_forces"), ((-tau, forces), "torque_sign"),
        ((tau + 1.0, forces), "joint_rows"),
        ((None, None), "no_answer"), (np.zeros(12), "not_two"),
        ((np.zeros(18), np.zeros(12)), "shapes"),
        ((np.full(12, np.nan), np.zeros(12)), "not_finite"), (("a", "b"), "not_numbers"),
    ]  # fmt: skip


EXERCISES = (
    Exercise(
        name="02.1",
        statement="solo8 has four legs with two joints each. It lifts one and stands on three "
        "point feet. What is the shape of "
        "J, as (rows, columns)?",
        stub="shape_of_J = (3, 8)  # replace this",
        solution="shape_of_J = (9, 14)",
        judge=NumericJudge(
            is_count=True,
            right=lambda: (
                fb.equations_of_motion(
                    fb.load("solo8").standing(),
                    fb.Contacts.points(fb.load("solo8"), frames=["FL_FOOT", "FR_FOOT", "HL_FOOT"]),
                ).J.shape
            ),
            praise="Three rows for each point, one column for each direction the robot can move "
            "in: d + 6.",
            mistakes={
                "joints_alone": lambda: (9, 8),
                "base_is_one": lambda: (9, 9),
                "quaternion": lambda: (
                    9,
                    15,
                ),
                "transpose": lambda: (14, 9),
                "joints_of_one_foot": lambda: (3, 8),
                "one_foot": lambda: (3, 14),
                "four_feet": lambda: (12, 14),
                "lifted_leg": lambda: (9, 12),
                "joints_for_components": lambda: (6, 14),
                "go2": lambda: (9, 18),
            },
            hints={
                "joints_alone": "These are the joints' columns alone; the base's directions move a "
                "foot too.",
                "base_is_one": "A base has six directions, not one: φ maps from R^(d+6).",
                "quaternion": "15 numbers are in q, where the quaternion has four. J has a column "
                "for each direction of "
                "velocity.",
                "transpose": "This is the shape of the transpose.",
                "joints_of_one_foot": "Three rows would be one foot. And the base has columns too.",
                "one_foot": "Three rows would be one foot; three feet touch.",
                "four_feet": "Three feet touch, not four.",
                "lifted_leg": "The lifted leg's joints are directions, too: their columns are "
                "zero.",
                "joints_for_components": "A foot's velocity has three components, however many "
                "joints its leg has.",
                "go2": "18 columns are go2's, with three joints in each leg; solo8 has two.",
            },
        ),
        explanation="k = 3 for each of 3 feet, d + 6 = 8 + 6 columns.",
    ),
    Exercise(
        name="02.2",
        statement="`moving` is go2 in a tilted, moving state. The ground pushes its FL_foot (the "
        "frame's origin) with `push`. "
        "Which generalised force, shape (18,), enters (4)?",
        stub="generalised = np.zeros(18)  # replace this, using moving.frame_jacobian and push",
        solution='generalised = moving.frame_jacobian("FL_foot")[:3].T @ push',
        judge=ShapeJudge(
            shapes={
                (3,): "(4) has a row for each direction of velocity: J takes 18 numbers to 3, its "
                "transpose goes back.",
                (
                    12,
                ): "These are the joints alone. The force also pushes the base: its six rows are "
                "missing.",
                (6,): "frame_jacobian has six rows, three linear and three angular; a force at a "
                "point takes the first three.",
            },
            judge=NumericJudge(
                right=_generalised,
                praise="The same matrix that turns velocities into the foot's velocity turns its "
                "force into all rows.",
                mistakes={
                    "sign": lambda: -_generalised(),
                    "world_axes": (_generalised_in_world_axes),
                    "base_zero": (_generalised_joints_only),
                    "standing": lambda: (
                        fb.load("go2").standing().frame_jacobian("FL_foot")[:3].T
                        @ [10.0, -5.0, 40.0]
                    ),
                    "eom_standing": lambda: _standing_go2().J[:3].T @ [10.0, -5.0, 40.0],
                    "contact_point": lambda: (
                        fb.equations_of_motion(*_moving_go2()).J[:3].T @ [10.0, -5.0, 40.0]
                    ),
                    "turned": (
                        lambda: (
                            _moving_go2()[0].frame_jacobian("FL_foot")[:3].T
                            @ _moving_go2()[0].frame_pose("base").rotation.T
                            @ [10.0, -5.0, 40.0]
                        )
                    ),
                    "angular_rows": lambda: (
                        _moving_go2()[0].frame_jacobian("FL_foot")[3:].T @ [10.0, -5.0, 40.0]
                    ),
                    "zero": lambda: np.zeros(18),
                },
                hints={
                    "sign": "The sign is turned: λ is what the ground does to the robot, and it "
                    "stands on the side of S τ.",
                    "world_axes": "The base's rows are in world axes. v, and so the base's rows, "
                    "are in the base's own frame.",
                    "base_zero": "The base's rows are zero: only motors leave them alone, a foot's "
                    "force does not.",
                    "standing": "This is the Jacobian of the standing robot; `moving` has another "
                    "posture, so another J.",
                    "eom_standing": "This is the J of `eom`: for the standing robot, and for the "
                    "points that touch the ground.",
                    "contact_point": "This pushes at the point that touches the ground; `push` "
                    "acts at the frame's origin, 2 "
                    "cm off.",
                    "turned": "`push` is in world axes, and so are the rows of frame_jacobian: "
                    "nothing has to be turned.",
                    "angular_rows": "These are the angular rows of the Jacobian; a force at a "
                    "point takes the linear ones, "
                    "which come first.",
                    "zero": "Zero would mean that the force does nothing.",
                },
            ),
        ),
        explanation="Power is the same in both descriptions: λ · (J v) = (Jᵀ λ) · v for every v.",
    ),
    Exercise(
        name="02.3",
        statement="The same state. What must J q̈ be for the FL_foot's origin not to accelerate? "
        "(3,), m/s², world.",
        stub="b_foot = np.zeros(3)  # replace this",
        solution='b_foot = -moving.frame_drift("FL_foot")[:3]',
        judge=NumericJudge(
            right=_drift,
            praise="That much joint and base acceleration is needed only to keep the foot where it "
            "is.",
            mistakes={
                "zero": lambda: np.zeros(3),
                "sign": lambda: -_drift(),
                "contact_point": lambda: fb.equations_of_motion(*_moving_go2()).b[:3],
                "foot_axes": _drift_in_the_foots_frame,
                "spatial": (_drift_of_a_spatial_acceleration),
                "velocity": lambda: _velocity_of(_moving_go2()[0], "FL_foot", 0.0),
                "angular_rows": lambda: -_moving_go2()[0].frame_drift("FL_foot")[3:],
            },
            hints={
                "zero": "This forgets the drift: the foot accelerates even at q̈ = 0, because J "
                "changes as the robot moves.",
                "sign": "This is J̇ q̇ itself. J q̈ + J̇ q̇ = 0: which sign has b?",
                "contact_point": "This b is for the point that touches the ground, of a ball that "
                "rolls; asked is the frame's "
                "origin.",
                "foot_axes": "The right vector in the foot's axes; (5) is written in world axes "
                "here.",
                "spatial": "ω × v is missing: the acceleration of a point is not the spatial "
                "acceleration of its body.",
                "velocity": "This is the velocity of the foot; the answer is an acceleration.",
                "angular_rows": "These are the angular rows of the drift; a point takes the linear "
                "ones, which come first.",
            },
        ),
        explanation="d²φ/dt² = J q̈ + J̇ q̇ = 0, so b = -J̇ q̇. `frame_drift` is J̇ q̇: linear "
        "rows first.",
    ),
    Exercise(
        name="02.4",
        statement="A design without a controller: find torques and contact forces that keep the "
        "standing go2 still, from (4) "
        "with q̈ = 0: S τ + Jᵀ λ = h. 24 unknowns, 18 equations.",
        stub="hold_tau = eom.h[6:]\nhold_forces = np.tile([0.0, 0.0, go2.weight / 4], 4)  # a "
        "first guess",
        solution="both = np.linalg.lstsq(np.hstack([eom.S, eom.J.T]), eom.h, rcond=None)[0]\n"
        "hold_tau, hold_forces = both[:12], both[12:]",
        judge=_judge_holding,
        namespace=lambda: {"go2": fb.load("go2"), "eom": _standing_go2()},
        examples=_holdings,
        explanation="Six more unknowns than equations: lstsq takes the smallest, by the sum of all "
        "squares. That adds N² and "
        "(N·m)², so another unit would give other forces. The answers differ by forces that "
        "squeeze the robot from within; "
        "lesson 03 is about them.",
    ),
)
