"""Exercises of lesson 04, One cost, many spaces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.dynamics import EquationsOfMotion
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import (
    BugHunt,
    Example,
    Verdict,
    array_or_verdict,
    first_fault,
    function_or_verdict,
    minimizer_or_verdict,
    stopped,
)
from floatbase.lessons.lesson03 import standing_go2_eom
from floatbase.lessons.lesson04.helpers import DESIRED_ACCELERATION, MinimumCostController
from floatbase.objectives import tangential_bias
from floatbase.simulation import Rollout

# 04.2 ---------------------------------------------------------------------------------------------

TARGET = np.array([0.0, 0.02, 0.0])  # m: from where the centre of mass stands
RUN, PUSH_START = 2.0, 1.0  # s
PUSH = 30.0  # N, for 0.1 s
ARRIVED, AT_REST = 0.001, 0.01  # m and m/s: largest error and speed at the end


def judge_feedback(answer: Any) -> Verdict:
    """Judge a function of the state that returns a desired acceleration, in simulation."""
    program = function_or_verdict(answer)
    if isinstance(program, Verdict):
        return program
    robot, contacts = standing_go2_eom().robot, standing_go2_eom().contacts
    costs = _lesson_costs()

    def cost(eom: EquationsOfMotion) -> fb.Quadratic:
        state, eta = eom.state, fb.accelerations_from_torques(eom)
        a = np.asarray(program(state), dtype=np.float64)
        com = fb.Quadratic.from_residual(state.com_jacobian, a - state.com_drift)
        turn = fb.Quadratic.from_residual(
            state.frame_jacobian("base")[3:], -state.frame_drift("base")[3:]
        )
        return (com + turn).pullback(eta) + 1e-4 * costs["effort"]

    controller = MinimumCostController(robot, contacts, cost)
    push = fb.Push(np.array([0.0, PUSH, 0.0]), start=PUSH_START, duration=0.1)
    try:
        first = array_or_verdict(program(standing_go2_eom().state), (3,))
        if isinstance(first, Verdict):
            return first
        record = fb.rollout(fb.Simulation(robot), controller, RUN, [push], control_period=0.005)
    except Exception as error:  # whatever a learner's function raises
        return stopped(error)
    return _parked(record)


def _parked(record: Rollout) -> Verdict:
    """Judge where the centre of mass is at the end of a run."""
    error = record.final.com - standing_go2_eom().state.com - TARGET
    missed, speed = np.linalg.norm(error), np.linalg.norm(record.final.com_velocity)
    left = f"{1000 * missed:.1f} mm from the target, with {1000 * speed:.0f} mm/s"
    return first_fault([
        ("falls", record.outcome != "completed", "go2 falls. Which sign pulls it back "
         "to the target, and which sign slows it down?"),
        ("swings", speed > AT_REST, f"The centre of mass does not come to rest: it is {left}. Is "
         "there a damper, a term with the velocity, and is the spring stiff enough?"),
        ("stays", abs(missed - np.linalg.norm(TARGET)) < ARRIVED, "The centre of mass stays where "
         "it was. Does your function depend on `target`?"),
        ("misses", missed > ARRIVED, f"At the end the centre of mass is {left}. Use a stiffer "
         "spring, or the position relative to `target`."),
    ]) or Verdict(
        True,
        f"go2 arrives within {1000 * missed:.2f} mm and comes back after the push. This is a "
        "feedback controller.",
    )  # fmt: skip


def _feedbacks() -> list[Example]:
    """Return examples for exercise 04.2."""
    start = standing_go2_eom().state.com

    def feedback(kp: float, kd: float, target: Any = TARGET) -> Callable[[fb.State], Array]:
        return lambda now: -kp * (now.com - start - target) - kd * now.com_velocity

    return [
        (feedback(100.0, 20.0), ""), (feedback(60.0, 12.0), ""),
        (feedback(-100.0, 20.0), "falls"), (feedback(100.0, -20.0), "falls"),
        (feedback(100.0, 0.0), "swings"), (feedback(100.0, 20.0, np.zeros(3)), "stays"),
        (feedback(100.0, 20.0, 2.5 * TARGET), "misses"),
        (lambda now: now.position, "stops"), (lambda now: 0.5, "shape"),
    ]  # fmt: skip


def _lesson_costs() -> dict[str, Any]:
    """Return η and the lesson's costs: centre of mass and base rotation on q̈, effort on τ."""
    eom = standing_go2_eom()
    J, drift = eom.state.frame_jacobian("base")[3:], eom.state.frame_drift("base")[3:]
    return {
        "eta": fb.accelerations_from_torques(eom),
        "com": fb.Quadratic.from_residual(
            eom.state.com_jacobian, DESIRED_ACCELERATION - eom.state.com_drift
        ),
        "turn": fb.Quadratic.from_residual(J, -drift),
        "effort": fb.Quadratic.from_residual(np.eye(12), np.zeros(12)),
    }


# 04.3 ---------------------------------------------------------------------------------------------


def _judge_design(answer: Any) -> Verdict:
    """Judge a cost on torques by what its minimum does."""
    eom = standing_go2_eom()
    tau = minimizer_or_verdict(answer, eom.d, "τ", "Pull it back through η.")
    if isinstance(tau, Verdict):
        return tau
    eta, zeta = fb.accelerations_from_torques(eom), fb.forces_from_torques(eom)
    a = eom.state.com_jacobian @ eta(tau)
    turning = np.linalg.norm(eta(tau)[3:6])
    friction = np.linalg.norm(zeta(tau).reshape(4, 3)[:, :2], axis=1).max()
    return first_fault([
        ("sign", np.linalg.norm(a + DESIRED_ACCELERATION) < 0.05, "The sign is wrong: this "
         "accelerates to the right."),
        ("com", np.linalg.norm(a - DESIRED_ACCELERATION) > 0.01, "The centre of mass accelerates "
         f"by {_rounded(a)} m/s², not {_rounded(DESIRED_ACCELERATION)}. Increase the weight of "
         "this cost."),
        ("turning", turning > 0.05, "The centre of mass is right, but the base turns with "
         f"{turning:.1f} rad/s². Which cost is missing?"),
        ("friction", friction > 6.0, "The robot moves as desired, but the friction force at one "
         f"foot is {friction:.1f} N. The effort does not penalize friction. Use a cost on λ, "
         "pulled back to τ."),
    ]) or Verdict(
        True,
        "Each cost is written in the space where it is simple, and all are added in the space of "
        "the motors.",
    )  # fmt: skip


def _rounded(a: Array) -> list[float]:
    return [round(float(x), 3) + 0.0 for x in a]


def _designs() -> list[Example]:
    eom = standing_go2_eom()
    eta, com, turn, effort = _lesson_costs().values()
    zeta, wish = fb.forces_from_torques(eom), (com + turn).pullback(eta)
    friction = tangential_bias(eom.contacts).pullback(zeta)
    even = fb.Quadratic.from_residual(
        np.eye(12), np.tile([0.0, 2.0, eom.robot.weight / 4], 4), 1e-6
    ).pullback(zeta)
    to_the_right = fb.Quadratic.from_residual(
        eom.state.com_jacobian, -DESIRED_ACCELERATION - eom.state.com_drift
    )
    return [
        (wish + 1e-4 * effort + 3e-5 * friction, ""), (wish + 1e-4 * effort + 1e-4 * friction, ""),
        (wish + even, ""),
        (wish + 1e-4 * effort, "friction"), (com.pullback(eta) + 1e-4 * effort, "turning"),
        (wish + effort, "com"),
        ((to_the_right + turn).pullback(eta) + 1e-4 * effort, "sign"), (com, "other_block"),
    ]  # fmt: skip


EXERCISES = (
    Exercise(
        name="04.1",
        stub='fault = ["", ""]  # the line, and: frame, sign, transpose, missing term',
        solution='fault = ["2", "frame"]',
        judge=BugHunt(
            lines=("2", "3"),
            kind="frame",
            praise="The residual subtracts a vector in world axes from a vector in base axes. "
            "The axes agree only as long as the robot faces forwards.",
            refuted={
                "sign": "A wrong sign would have the same effect at every heading. At 0° the "
                "result is right, but at 90° it is wrong.",
                "transpose": "Rᵀ does take a vector from world axes to base axes. Does everything "
                "in the residual go there?",
                "missing term": "A missing term would have the same effect at every heading. At 0° "
                "the result is right, but at 90° it is wrong.",
            },
            elsewhere="At 0° the result is right, and at 90° it is turned by 90°. Which line "
            "depends on the heading?",
        ),
        explanation="Line 2 turns the Jacobian into base axes, and line 3 leaves the goal and the "
        "drift in world axes. Turn both or neither.",
    ),
    Exercise(
        name="04.2",
        stub="def go_and_stay(now):\n"
        "    return np.array([0, 0.5, 0])  # m/s², world; change it, with now and target",
        solution="def go_and_stay(now):\n"
        "    return -100 * (now.com - target) - 20 * now.com_velocity",
        judge=judge_feedback,
        namespace=lambda: {"target": standing_go2_eom().state.com + TARGET},
        examples=_feedbacks,
        explanation="A spring pulls the centre of mass to the target, and a damper brings it to "
        "rest. With 100 1/s², 20 1/s is the least damping without oscillation.",
    ),
    Exercise(
        name="04.3",
        stub="design = com.pullback(eta) + turn.pullback(eta) + 1e-4 * effort  # change or add "
        "costs",
        solution="from floatbase.objectives import tangential_bias\n\n"
        "friction = tangential_bias(contacts)  # on λ\n"
        "wishes = com.pullback(eta) + turn.pullback(eta) + 1e-4 * effort\n"
        "design = wishes + 1e-4 * friction.pullback(zeta)",
        judge=_judge_design,
        namespace=_lesson_costs,
        examples=_designs,
        explanation="Friction is simple in λ, so write the cost there and pull it back to the "
        "torques through ζ. Its weight is small enough not to spoil the acceleration.",
    ),
)
