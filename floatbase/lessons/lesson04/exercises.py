"""Exercises of lesson 04, One cost, many spaces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.dynamics import EquationsOfMotion, internal_forces
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import (
    Example,
    NumericJudge,
    ShapeJudge,
    Verdict,
    minimiser_or_verdict,
)
from floatbase.lessons.lesson03 import standing_go2_eom, tilted_go2_eom
from floatbase.lessons.lesson04.helpers import DESIRED_ACCELERATION
from floatbase.linear_algebra import rank
from floatbase.objectives import tangential_bias


def _gradient_by_newton() -> Array:
    """Compute the gradient from the contact forces: a_c = Σ f / m + g with λ = ζ(τ).

    This computation needs neither the Jacobian nor the drift of the centre of mass.
    """
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


def _flat_on_three_feet() -> int:
    """Count the flat directions of com + turn on three feet, in τ.

    β has the same dimension as τ there, since J has full rank.
    """
    state = standing_go2_eom().state
    return _unseen_by(np.vstack([state.com_jacobian, state.frame_jacobian("base")[3:]]))


def _flat_for_com() -> int:
    return _unseen_by(standing_go2_eom().state.com_jacobian)


def _unseen_by(rows: Array) -> int:
    eta = fb.accelerations_from_torques(_three_feet_eom())
    return eta.n_in - rank(rows @ eta.A)


def _squeezes_on_three_feet() -> int:
    return internal_forces(_three_feet_eom()).shape[1]


def _three_feet_eom() -> EquationsOfMotion:
    """Return the equations of motion of go2 standing on all feet except FL.

    Notes
    -----
    [FBR]_, eq. (7).
    """
    standing = standing_go2_eom()
    return fb.equations_of_motion(standing.state, standing.contacts.without("FL_foot"))


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
        statement="On three feet, com + turn has flat directions in β. How many independent "
        "ones of them move the free foot?",
        stub="moving = 6  # replace this number by what you find",
        solution="three = fb.feasible_space(fb.equations_of_motion(state, "
        'contacts.without("FL_foot")))\n'
        "flat = null_space((com + turn).pullback(three.qdd).H)\n"
        'moving = rank(state.frame_jacobian("FL_foot")[:3] @ three.qdd.A @ flat)',
        judge=NumericJudge(
            is_count=True,
            right=lambda: _flat_on_three_feet() - _squeezes_on_three_feet(),
            praise="Three feet have three internal forces. The other three flat directions move "
            "the free foot wherever you like.",
            mistakes={
                "all_flat": _flat_on_three_feet,
                "com_alone": _flat_for_com,
                "none": lambda: 0,
                "one": lambda: 1,
                "two": lambda: 2,
                "all": lambda: _three_feet_eom().d,
            },
            hints={
                "all_flat": "Those are all flat directions. Do three feet still have internal "
                "forces, and what do these move?",
                "com_alone": "That is the number of flat directions for `com` alone, or with "
                "internal forces counted twice. For com + turn it is six.",
                "none": "Does a free foot have to stay in place? Neither cost depends on it.",
                "one": "It is one foot, but a foot can move in more than one direction.",
                "two": "Upwards is a direction, too: the ground is not in the way.",
                "all": "That is all of β. Directions along which the costs are curved do not "
                "count.",
            },
        ),
        explanation="Three feet have 9 force components, and 9 - 6 = 3 directions are internal "
        "forces. They are flat and move nothing. The other 3 move the free foot wherever you "
        "like. Base and legs follow, so that both goals are still met.",
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
