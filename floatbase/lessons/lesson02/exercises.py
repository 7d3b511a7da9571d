"""Exercises of lesson 02, Equations of motion and contact."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import (
    NO_ANSWER,
    Example,
    Mistake,
    NumericJudge,
    ShapeJudge,
    Verdict,
    first_fault,
    format_vector,
)
from floatbase.lessons.lesson03 import standing_go2_eom


@cache
def _moving_go2() -> tuple[fb.State, fb.Contacts]:
    """Return the moving go2 of the exercises, and its contacts."""
    robot = fb.load("go2")
    slow = robot.random_state(5)
    return slow.replace(v=8 * slow.v), fb.Contacts.points(robot)


def _generalised() -> Array:
    """Return Jᵀ λ by virtual work, with finite differences of the foot's position."""
    state, _ = _moving_go2()
    force, h = np.array([10.0, -5.0, 40.0]), 1e-6
    ahead = [state.replace(q=state.integrate(h * e)).point("FL_foot") for e in np.eye(18)]
    back = [state.replace(q=state.integrate(-h * e)).point("FL_foot") for e in np.eye(18)]
    return np.array([force @ (a - b) / (2 * h) for a, b in zip(ahead, back, strict=True)])


def _judge_holding(answer: Any) -> Verdict:
    """Judge torques and forces that keep a standing go2 still, by (4) row by row."""
    if (
        answer is None
        or answer is Ellipsis
        or (isinstance(answer, tuple) and any(part is None for part in answer))
    ):
        return NO_ANSWER
    if not isinstance(answer, (tuple, list)) or len(answer) != 2:
        return Verdict(False, "The answer must be two arrays, (torques, forces).", "not_two")
    try:
        tau, forces = (np.asarray(part, dtype=np.float64) for part in answer)
    except (TypeError, ValueError):
        text = "The answer must be two arrays of numbers, (torques, forces)."
        return Verdict(False, text, "not_numbers")
    if tau.shape != (12,) or forces.shape not in ((12,), (4, 3)):
        text = f"The shapes are {tau.shape} and {forces.shape}, but they must be (12,) and (12,)."
        return Verdict(False, text, "shapes")
    if not (np.all(np.isfinite(tau)) and np.all(np.isfinite(forces))):
        return Verdict(False, "The answer contains numbers that are infinite or NaN.", "not_finite")
    state = fb.load("go2").standing()
    contacts = fb.Contacts.points(state.robot)
    # Newton and Euler for the whole robot, then each leg by its own Jacobian: not the rows of eom
    f = forces.reshape(4, 3)
    up = f.sum(axis=0) - [0.0, 0.0, state.robot.weight]
    moment = np.cross(contacts.positions(state) - state.com, f).sum(axis=0)
    gravity, pull = state.h[6:], np.zeros(18)
    for contact, force in zip(contacts, f, strict=True):
        pull += contact.jacobian(state).T @ force
    right = gravity - pull[6:]

    def is_near(torques: Array) -> bool:
        return bool(np.abs(tau - torques).max() < 0.02)

    return first_fault([
        ("sign", abs(up[2] + 2 * state.robot.weight) < 0.1, "These forces push the robot down. λ "
         "is the force of the ground on the robot."),
        ("force_rows", np.abs(up).max() > 0.1, "The force rows of the base are not balanced: "
         f"{format_vector(up, 1)} N remains."),
        ("moment_rows", np.abs(moment).max() > 0.02, "The moment rows of the base are not "
         f"balanced: {format_vector(moment, 1)} N·m remains."),
        ("pulls", f[:, 2].min() < 0.0, "The forces are balanced, but one foot pulls on the ground, "
         "which is impossible."),
        ("gravity_alone", is_near(gravity), "These torques carry only the legs: the term Jᵀ λ is "
         "missing from the joint rows."),
        ("sign_of_forces", is_near(gravity + pull[6:]), "In the joint rows the sign of Jᵀ λ is "
         "wrong: S τ and Jᵀ λ are on the same side."),
        ("torque_sign", is_near(-right), "The magnitude of the torques is right, but the sign is "
         "wrong."),
        ("joint_rows", not is_near(right), "The base is balanced, but the joint rows are not: up "
         f"to {np.abs(tau - right).max():.1f} N·m remains."),
    ]) or Verdict(
        True,
        "Nothing moves. The base rows determined the forces, and then the joint rows determined "
        "the torques.",
    )  # fmt: skip


def _holdings() -> list[Example]:
    """Return examples, by the lever rule and one leg at a time."""
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


def _shape_mistakes() -> list[Mistake]:
    return [
        ("joints_alone", (9, 8), "These are only the columns of the joints. The base also moves a "
         "foot, so it has columns, too."),
        ("base_is_one", (9, 9), "A base has six directions, not one: φ maps from R^(d+6)."),
        ("quaternion", (9, 15), "q has 15 numbers, four of them for the quaternion. J has a column "
         "for each component of the velocity."),
        ("transpose", (14, 9), "This is the shape of the transpose."),
        ("joints_of_one_foot", (3, 8), "Three rows are for one foot. The base has columns, too."),
        ("one_foot", (3, 14), "Three rows are for one foot. Three feet touch the ground."),
        ("four_feet", (12, 14), "Three feet touch the ground, not four."),
        ("lifted_leg", (9, 12), "The joints of the lifted leg count, too. Their columns are zero."),
        ("joints_for_components", (6, 14), "The velocity of a foot has three components, whatever "
         "the number of joints in its leg."),
        ("go2", (9, 18), "18 columns are for go2, which has three joints in each leg. solo8 has "
         "two."),
    ]  # fmt: skip


def _force_mistakes() -> list[Mistake]:
    force, state = np.array([10.0, -5.0, 40.0]), _moving_go2()[0]
    right, R, J = _generalised(), state.frame_pose("base").rotation, state.frame_jacobian("FL_foot")
    in_world = np.concatenate([R @ right[:3], R @ right[3:6], right[6:]])
    joints_only = np.concatenate([np.zeros(6), right[6:]])
    return [
        ("sign", -right, "The sign is wrong. λ is the force of the ground on the robot, "
         "and it is on the same side as S τ."),
        ("world_axes", in_world, "The base rows are in world axes. v, and so "
         "the base rows, are in the axes of the base."),
        ("base_zero", joints_only, "The base rows are zero. Motors do not act on "
         "the base, but a contact force does."),
        ("standing", fb.load("go2").standing().frame_jacobian("FL_foot")[:3].T @ force,
         "This is the Jacobian of the standing robot. `moving` has another posture, so J differs."),
        ("eom_standing", standing_go2_eom().J[:3].T @ force, "This is the J of `eom`, "
         "which is for the standing robot and for the points that touch the ground."),
        ("contact_point", fb.equations_of_motion(*_moving_go2()).J[:3].T @ force,
         "This force acts at the point that touches the ground. `ground_force` acts at the origin "
         "of the frame, 2 cm away."),
        ("turned", J[:3].T @ R.T @ force, "`ground_force` is in world axes, and so are the rows of "
         "frame_jacobian. No rotation is needed."),
        ("angular_rows", J[3:].T @ force, "These are the angular rows of the Jacobian. For a force "
         "at a point, use the linear rows, which come first."),
        ("zero", np.zeros(18), "Zero would mean that the force has no effect."),
    ]  # fmt: skip


EXERCISES = (
    Exercise(
        name="02.1",
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
            praise="Three rows for each point, and one column for each direction in which the "
            "robot can move: d + 6.",
            mistakes=_shape_mistakes,
        ),
        explanation="k = 3 · 3 for three feet, and there are d + 6 = 8 + 6 columns.",
    ),
    Exercise(
        name="02.2",
        stub="generalised = np.zeros(18)  # replace this: moving.frame_jacobian, ground_force",
        solution='generalised = moving.frame_jacobian("FL_foot")[:3].T @ ground_force',
        judge=ShapeJudge(
            shapes={
                (3,): "(4) has a row for each component of the velocity. J maps 18 numbers to "
                "3, and its transpose goes back.",
                (12,): "These are only the joints. The force also pushes on the base: its six rows "
                "are missing.",
                (6,): "frame_jacobian has six rows, three linear and three angular. For a force "
                "at a point, use the first three.",
            },
            judge=NumericJudge(
                right=_generalised,
                praise="The same matrix maps the velocities to the foot's velocity, and its "
                "transpose maps the foot's force to all rows.",
                mistakes=_force_mistakes,
            ),
        ),
        explanation="Power is the same in both descriptions: λ · (J v) = (Jᵀ λ) · v for every v.",
    ),
    Exercise(
        name="02.3",
        stub="hold_tau = eom.h[6:]\nhold_forces = np.tile([0.0, 0.0, go2.weight / 4], 4)  # a "
        "first guess",
        solution="both = np.linalg.lstsq(np.hstack([eom.S, eom.J.T]), eom.h, rcond=None)[0]\n"
        "hold_tau, hold_forces = both[:12], both[12:]",
        judge=_judge_holding,
        namespace=lambda: {"go2": fb.load("go2"), "eom": standing_go2_eom()},
        examples=_holdings,
        explanation="There are six more unknowns than equations. lstsq returns the solution "
        "with the smallest sum of squares. That sum adds N² and (N·m)², so other units would "
        "give other forces. The solutions differ by internal forces, which squeeze the robot. "
        "Lesson 03 is about them.",
    ),
)
