"""Exercises of lesson 02, Equations of motion and contact."""

from __future__ import annotations

from typing import Any

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.dynamics import PointContact
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import (
    NO_ANSWER,
    Example,
    Mistake,
    NumericJudge,
    ShapeJudge,
    Verdict,
    array_or_verdict,
    first_fault,
    format_vector,
)
from floatbase.lessons.lesson02.helpers import RECORD_ROW, shoved_go2
from floatbase.lessons.lesson03 import standing_go2_eom


def _recorded_rows() -> Array:
    """Return six zeros and the recorded torques."""
    return np.concatenate([np.zeros(6), shoved_go2().tau[RECORD_ROW]])


def _row_mistakes() -> list[Mistake]:
    record, i = shoved_go2(), RECORD_ROW
    state, forces = record.state(i), record.measured[i]
    inertial = state.M @ (record.v[i + 1] - record.v[i]) / 1e-3
    bias, contact = state.h, fb.Contacts.points(state.robot).jacobian(state).T @ forces
    balls = fb.Contacts([PointContact(foot.frame) for foot in state.robot.feet])
    return [
        ("no_forces", inertial + bias, "This is inverse dynamics of a robot that touches nothing. "
         "Its base rows are what the ground supplies. Which term of (4) is missing?"),
        ("sign_of_forces", inertial + bias + contact, "The base rows show twice what the ground "
         "supplies. On which side of (4) is Jᵀ λ?"),
        ("at_rest", bias - contact, "Without M q̈, this is a robot that does not accelerate."),
        *(("other_rows", state.M @ (record.v[j] - record.v[i - 1]) / dt + bias - contact,
         "The forces at 300 ms act until 301 ms. Which two velocities belong to them?")
          for j, dt in ((i, 1e-3), (i + 1, 2e-3))),
        ("no_h", inertial - contact, "The third row is minus the weight. Which term of (4) "
         "contains gravity?"),
        ("at_ball", inertial + bias - balls.jacobian(state).T @ forces, "The moments are not zero: "
         "these forces act at the middle of each foot. They act where it touches the ground."),
    ]  # fmt: skip


def _error_of_line() -> Array:
    """Return by how much line 1 of exercise 02.2 is too large [m/s²]: axes that turn."""
    v = shoved_go2().v[RECORD_ROW]
    return np.asarray(np.cross(v[3:6], v[:3]))


def _error_mistakes() -> list[Mistake]:
    state, right = shoved_go2().state(RECORD_ROW), _error_of_line()
    return [
        ("no_error", 0.0 * right, "The line is right. By how much is its result wrong?"),
        ("force", state.robot.mass * right, "These are the base rows, in N. Which acceleration "
         "causes them?"),
        ("sign", -right, "The line is right, but the sign is wrong. The base rows are the mass "
         "times what line 1 adds."),
        ("world_axes", state.frame_pose("base").rotation @ right, "The line is right, but these "
         "numbers are in the axes of the world. The base rows are in the axes of the base."),
    ]  # fmt: skip


ERROR_JUDGE = NumericJudge(
    right=_error_of_line,
    tolerance=0.01,  # a number read from the printed rows has two digits
    praise="Line 1 is the acceleration of the base in the world. q̈ holds the rate of v in axes "
    "that turn, and the difference is ω × v_lin, as for the wheel.",
    mistakes=_error_mistakes,
)


def _judge_fault(answer: Any) -> Verdict:
    """Judge the line that is wrong, and by how much [m/s²]: four numbers, or one and a vector."""
    if isinstance(answer, (tuple, list)) and len(answer) == 2:
        answer = [answer[0], *np.ravel(answer[1])]
    given = array_or_verdict(answer, (4,))
    if isinstance(given, Verdict):
        return given
    line = given[0]
    return first_fault([
        ("no_line", line not in (1, 2, 3, 4), "The first number is the number of the wrong line, "
         "from 1 to 4."),
        ("line_2", line == 2, "Line 2 contains the angular acceleration of the base and the "
         "accelerations of the joints. Would a fault there leave the moment rows almost zero?"),
        ("line_3", line == 3, "A wrong state would give a wrong J, so the contact forces would "
         "have wrong moments. The moment rows are almost zero."),
        ("line_4", line == 4, "A wrong sign of the forces would show in the vertical row, and a "
         "wrong place in the moment rows. Both are almost zero at all four times."),
    ]) or ERROR_JUDGE(given[1:])  # fmt: skip


def _faults() -> list[Example]:
    """Return examples: the right line with each error, and the wrong lines."""
    lines = ((0, "no_line"), (2, "line_2"), (3, "line_3"), (4, "line_4"))
    return [
        *((np.array([1, *error]), hint) for error, hint in ERROR_JUDGE.examples()),
        *(((line, _error_of_line()), hint) for line, hint in lines),
    ]


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
        "Nothing moves. The base rows hold for your forces, and for these forces the joint rows "
        "leave only these torques.",
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


EXERCISES = (
    Exercise(
        name="02.1",
        stub="rows = np.zeros(18)  # replace this: record.state, record.measured",
        solution="""i = 300  # ms
now, later = record.state(i), record.state(i + 1)
terms = fb.equations_of_motion(now, contacts)
qdd = (later.v - now.v) / 0.001
rows = terms.M @ qdd + terms.h - terms.J.T @ record.measured[i]""",
        judge=ShapeJudge(
            shapes={
                (12,): "These may be the torques, but how do you know? The six base rows are your "
                "check. The answer needs all 18 rows.",
            },
            judge=NumericJudge(
                right=_recorded_rows,
                tolerance=5e-3,  # differences over a millisecond
                praise="Six zeros, and then the torques that the motors applied. The zeros check "
                "the model, the forces and the differences at once.",
                mistakes=_row_mistakes,
            ),
        ),
        explanation="(4) solved for S τ. The differences over one millisecond leave 0.01 N in "
        "the base rows. At 100 ms, these rows hold the push of 150 N, which is not in λ.",
    ),
    Exercise(
        name="02.2",
        stub="fault = np.array([0, 0.0, 0.0, 0.0])  # the line, and three numbers in m/s²",
        solution="""omega, v_lin = record.v[300, 3:6], record.v[300, :3]
fault = np.array([1, *np.cross(omega, v_lin)])""",
        judge=_judge_fault,
        examples=_faults,
        explanation="The base rows are wrong only while the base both turns and moves. The error "
        "is at right angles to ω and to v_lin. It is the mass times ω × v_lin, which line 1 "
        "contains and v̇ does not.",
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
