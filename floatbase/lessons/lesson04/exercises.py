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
    Example,
    NumericJudge,
    ShapeJudge,
    Verdict,
    array_or_verdict,
    function_or_verdict,
    minimiser_or_verdict,
)
from floatbase.lessons.lesson03 import standing_go2_eom, tilted_go2_eom
from floatbase.lessons.lesson04.helpers import DESIRED_ACCELERATION, MinimumCostController
from floatbase.objectives import tangential_bias
from floatbase.simulation import Rollout

# 04.1 ---------------------------------------------------------------------------------------------


def _gradient_by_newton() -> Array:
    """Compute the gradient from the contact forces: a_c = Σ f / m + g with λ = ζ(τ)."""
    eom = tilted_go2_eom()
    zeta, mass = fb.forces_from_torques(eom), eom.robot.mass
    sums = np.tile(np.eye(3), 4) / mass
    return (sums @ zeta.A).T @ (
        sums @ zeta.b + eom.robot.model.gravity.linear - DESIRED_ACCELERATION
    )


def _gradients() -> dict[str, Callable[[], Any]]:
    def gradient(
        drift: float = 1.0,
        offset: float = 1.0,
        turned: int = 0,
        back: Callable[[Array], Array] = np.transpose,
    ) -> Callable[[], Array]:
        def value() -> Array:
            eom = tilted_go2_eom()
            state, eta = eom.state, fb.accelerations_from_torques(eom)
            R = state.frame_pose("base").rotation
            desired = (DESIRED_ACCELERATION, R @ DESIRED_ACCELERATION, R.T @ DESIRED_ACCELERATION)[
                turned
            ]
            J = state.com_jacobian
            return back(eta.A) @ J.T @ (offset * J @ eta.b + drift * state.com_drift - desired)

        return value

    right = gradient()
    return {
        "zero": lambda: np.zeros(12),
        "sign": lambda: -right(),
        "drift_forgotten": gradient(drift=0.0),
        "drift_sign": gradient(drift=-1.0),
        "offset_forgotten": gradient(offset=0.0),
        "offset_and_drift_forgotten": gradient(drift=0.0, offset=0.0),
        "into_world": gradient(turned=1),
        "out_of_world": gradient(turned=2),
        "pseudo_inverse": gradient(back=np.linalg.pinv),
        "standing": _gradient_of_standing,
        "half": lambda: 2 * right(),
    }


def _gradient_of_standing() -> Array:
    """Return the gradient of the standing robot's cost through η of the moving robot."""
    state = standing_go2_eom().state
    cost = fb.Quadratic.from_residual(state.com_jacobian, DESIRED_ACCELERATION - state.com_drift)
    return cost.pullback(fb.accelerations_from_torques(tilted_go2_eom())).g


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
        return Verdict(False, f"Your function stops with {type(error).__name__}: {error}", "stops")
    return _parked(record)


def _parked(record: Rollout) -> Verdict:
    """Judge where the centre of mass is at the end of a run."""
    error = record.final.com - standing_go2_eom().state.com - TARGET
    missed, speed = np.linalg.norm(error), np.linalg.norm(record.final.com_velocity)
    if record.outcome != "completed":
        return Verdict(
            False,
            f"go2 falls after {record.time[-1]:.2f} s. Which sign pulls it back to the target, and "
            f"which sign slows it down?",
            "falls",
        )
    left = f"{1000 * missed:.1f} mm from the target, with {1000 * speed:.0f} mm/s"
    if speed > AT_REST:
        return Verdict(
            False,
            f"The centre of mass does not come to rest: it is {left}. Add a damper, a term with "
            f"the velocity.",
            "swings",
        )
    if abs(missed - np.linalg.norm(TARGET)) < ARRIVED:
        return Verdict(
            False,
            "The centre of mass stays where it was. Does your function depend on `target`?",
            "stays",
        )
    if missed > ARRIVED:
        return Verdict(
            False,
            f"At the end the centre of mass is {left}. Use a stiffer spring, or the position "
            f"relative to `target`.",
            "misses",
        )
    return Verdict(
        True,
        f"go2 arrives within {1000 * missed:.2f} mm and comes back after the push. This is a "
        f"feedback controller.",
    )


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
    tau = minimiser_or_verdict(answer, eom.d, "τ", "Pull it back through η.")
    if isinstance(tau, Verdict):
        return tau
    eta, zeta = fb.accelerations_from_torques(eom), fb.forces_from_torques(eom)
    a = eom.state.com_jacobian @ eta(tau)
    turning = np.linalg.norm(eta(tau)[3:6])
    friction = np.linalg.norm(zeta(tau).reshape(4, 3)[:, :2], axis=1).max()
    if np.linalg.norm(a + DESIRED_ACCELERATION) < 0.05:
        return Verdict(False, "The sign is wrong: this accelerates to the right.", "sign")
    if np.linalg.norm(a - DESIRED_ACCELERATION) > 0.01:
        moves = (
            f"The centre of mass accelerates by {_rounded(a)} m/s², not "
            f"{_rounded(DESIRED_ACCELERATION)}"
        )
        return Verdict(False, f"{moves}. Increase the weight of this cost.", "com")
    if turning > 0.05:
        return Verdict(
            False,
            f"The centre of mass is right, but the base turns with {turning:.1f} rad/s². Which "
            f"cost is missing?",
            "turning",
        )
    if friction > 6.0:
        most = f"the friction force at one foot is {friction:.1f} N"
        return Verdict(
            False,
            f"The robot moves as desired, but {most}. The effort does not penalize friction. Use "
            f"a cost on λ, pulled back to τ.",
            "friction",
        )
    return Verdict(
        True,
        "Three costs, each written in the space where it is simple, and added in the space of "
        "the motors.",
    )


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
        statement="The gradient of ½‖J_c q̈ + J̇_c q̇ - desired‖² at τ = 0, with respect to the "
        "torques.",
        stub="gradient = np.zeros(12)  # replace: from eta_moving, J_moving, drift_moving, desired",
        solution="residual = J_moving @ eta_moving.b + drift_moving - desired\n"
        "gradient = eta_moving.A.T @ J_moving.T @ residual",
        judge=ShapeJudge(
            NumericJudge(
                right=_gradient_by_newton,
                praise="This is the chain rule: points go forward through η, and gradients come "
                "back through its transpose.",
                mistakes=_gradients(),
                hints={
                    "zero": "There is no answer yet. The gradient is zero at a minimum, but τ = "
                    "0 is not a minimum.",
                    "sign": "The sign is wrong. The residual is actual - desired, and the "
                    "gradient points uphill.",
                    "drift_forgotten": "The drift is missing. The centre of mass accelerates by "
                    "J_c q̈ + J̇_c q̇.",
                    "drift_sign": "The drift has the wrong sign.",
                    "offset_forgotten": "η has an offset: even with the motors off, the robot "
                    "accelerates by `eta_moving.b`.",
                    "offset_and_drift_forgotten": "The offset of η and the drift are both missing.",
                    "into_world": "The frame is wrong. `desired` is in world axes, like the "
                    "Jacobian and the drift. Do not rotate it.",
                    "out_of_world": "The frame is wrong. `desired` is in world axes already, "
                    "and the rotation of the base takes it out of these axes.",
                    "pseudo_inverse": "A gradient comes back through the transpose of η's "
                    "matrix. A pseudo-inverse is for points.",
                    "standing": "This is the cost of the standing robot. The moving robot has "
                    "another Jacobian and drift.",
                    "half": "The cost has a factor ½, which cancels the 2 from the square.",
                },
            ),
            {
                (18,): "18 numbers are the gradient with respect to q̈. One step back to the "
                "torques is missing.",
                (3,): "3 numbers are the residual. Two steps back to the torques are missing.",
                (12, 12): "That is a curvature, shape (12, 12). The gradient is a vector.",
            },
        ),
        explanation="This is (15) by hand. `pullback(eta).g` of the same cost gives it, too.",
    ),
    Exercise(
        name="04.2",
        statement="A function of the state that returns the desired acceleration of the centre of "
        "mass, shape (3,), m/s², world, which brings it to `target` and keeps it there.",
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
        statement="A cost on torques: 0.5 m/s² to the left, no turning, and at most 6 N of "
        "friction at every foot.",
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
