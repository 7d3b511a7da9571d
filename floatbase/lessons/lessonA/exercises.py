"""Exercises of lesson A, Fictitious forces."""

from __future__ import annotations

from functools import cache

import numpy as np

import floatbase as fb
from floatbase._geometry import rotation_z
from floatbase._validation import Array
from floatbase.dynamics import bias_forces, coriolis_matrix
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import Mistake, NumericJudge

PLATFORM_RATE, CHILD_MASS = np.array([0.0, 0.0, 0.8]), 30.0  # of exercise A.1: rad/s; kg
# m and m/s, in the axes of the merry-go-round
CHILD_POSITION, CHILD_VELOCITY = np.array([2.0, 0.0, 0.0]), np.array([1.5, 0.0, 0.0])
LIFT_JOINT, ELBOW_JOINT = 1, 2  # of exercise A.2: ur5's joints
JOINT_VELOCITY = 2.0 * np.array([1.0, 1.0, -1.0, 1.0, 1.0, 1.0])  # rad/s, of exercise A.3
STEP = 1e-4  # s, and step of finite differences


@cache
def arm_state(v: tuple[float, ...] = (0.0,) * 6) -> fb.State:
    """Return ur5 in its standing posture, its joints moving with v [rad/s]."""
    return fb.load("ur5").standing().replace(v=np.array(v))


def _force_on_the_walker() -> Array:
    """Compute the force as mass times the second difference of the child's position."""

    def place(t: float) -> Array:
        return rotation_z(PLATFORM_RATE[2] * t) @ (CHILD_POSITION + t * CHILD_VELOCITY)

    return np.asarray(CHILD_MASS * (place(STEP) - 2.0 * place(0.0) + place(-STEP)) / STEP**2)


def _walker(coriolis: float, inward: float) -> Array:
    """Add multiples of m 2 ω × ṗ and m ω × (ω × p)."""
    sideways = 2.0 * np.cross(PLATFORM_RATE, CHILD_VELOCITY)
    towards_axis = np.cross(PLATFORM_RATE, np.cross(PLATFORM_RATE, CHILD_POSITION))
    return np.asarray(CHILD_MASS * (coriolis * sideways + inward * towards_axis))


def _pair(i: int = LIFT_JOINT, j: int = ELBOW_JOINT) -> Array:
    """Compute the Coriolis part that two joints at 1 rad/s have together."""
    e = np.eye(6)
    return np.asarray(
        coriolis_matrix(arm_state(tuple(e[i]))) @ e[j]
        + coriolis_matrix(arm_state(tuple(e[j]))) @ e[i]
    )


def _velocity_part() -> Array:
    return bias_forces(arm_state(tuple(JOINT_VELOCITY))).fictitious


def _floor_mistakes() -> list[Mistake]:
    return [
        ("zero", np.zeros(3), "Without a force, the child would move straight in the world frame, "
         "and on a curve in these axes."),
        ("felt", _walker(-1.0, -1.0), "That is the force that the child seems to feel. The floor "
         "has to balance it, in the opposite direction."),
        ("no_factor_2", _walker(0.5, 1.0), "The factor 2 is wrong. Half of 2 ω × ṗ comes from the "
         "rotation of the velocity's axes, and half from the change of the position."),
        ("coriolis_alone", _walker(1.0, 0.0), "That balances only the Coriolis term. The child is "
         "also away from the axis."),
        ("inwards_alone", _walker(0.0, 1.0), "That would be right for a child that stands still. "
         "This child also walks."),
        ("inwards_sign", _walker(1.0, -1.0), "The sideways part is right, but the other part has "
         "the wrong sign: the floor has to bend the path towards the axis."),
        ("sideways_sign", _walker(-1.0, 1.0), "The inward part is right, but the sideways part has "
         "the wrong sign. The order in ω × ṗ matters."),
        ("no_mass", _walker(1.0, 1.0) / CHILD_MASS, "That is an acceleration, m/s². The mass is "
         "missing."),
        ("weight", _walker(1.0, 1.0) + [0.0, 0.0, 9.81 * CHILD_MASS], "Only the horizontal force "
         "is asked for. The floor also carries the weight, but that is not part of the answer."),
    ]  # fmt: skip


def _pair_mistakes() -> list[Mistake]:
    right, gravity = _pair(), arm_state().h
    both = arm_state(tuple(np.eye(6)[LIFT_JOINT] + np.eye(6)[ELBOW_JOINT])).h
    return [
        ("zero", np.zeros(6), "There is no answer yet. Call h_of with the lift alone, with the "
         "elbow alone, and with both."),
        ("gravity_short", right - gravity, "Each call includes gravity. Here it was subtracted "
         "once too often."),
        ("gravity_left", right + gravity, "Gravity is still included once."),
        ("all_of_h", both, "That is all of h with both joints moving. It includes gravity and what "
         "each joint causes alone."),
        ("alone_left", both - gravity, "Gravity is gone, but what each joint causes alone is still "
         "included."),
        ("half", 0.5 * right, "That is half of it. The sum over i and j contains the pair twice, "
         "as (i, j) and as (j, i)."),
        ("twice", 2.0 * right, "That is twice the pair. It appears in h(lift + elbow), and with "
         "the opposite sign in h(lift - elbow)."),
        ("elbow_wrist", _pair(ELBOW_JOINT, ELBOW_JOINT + 1), "Those are other joints. Counted from "
         "0, lift is 1 and elbow is 2."),
        ("pan_lift", _pair(0, 1), "Those are pan and lift. Counted from 0, lift is 1 and elbow is "
         "2."),
    ]  # fmt: skip


def _velocity_mistakes() -> list[Mistake]:
    state = arm_state(tuple(JOINT_VELOCITY))
    v = state.v

    def inertia_derivative(direction: Array) -> Array:
        after, before = (
            state.replace(q=state.integrate(s * STEP * direction)).M for s in (1.0, -1.0)
        )
        return np.asarray((after - before) / (2.0 * STEP))

    rate = inertia_derivative(v) @ v  # Ṁ v
    slope = np.array([v @ inertia_derivative(unit) @ v for unit in np.eye(6)])  # of vᵀ M v
    return [
        ("zero", np.zeros(6), "Nothing there yet."),
        ("no_half_in_slope", rate - slope, "The kinetic energy is ½ vᵀ M v. The half is missing "
         "from its gradient."),
        ("rate_alone", rate, "That is Ṁ v alone. The gradient of the kinetic energy is missing."),
        ("slope_sign", rate + 0.5 * slope, "The sign of the gradient is wrong. Forces change the "
         "momentum, and the gradient is on their side of the equation."),
        ("slope_alone", -0.5 * slope, "That is the gradient of the kinetic energy alone. The rate "
         "of the momentum M v also contains Ṁ v."),
        ("half_on_rate", 0.5 * rate - slope, "The half belongs to the gradient of the kinetic "
         "energy, not to Ṁ v."),
        ("both_halved", 0.5 * (rate - slope), "Both terms are halved. The half belongs only to the "
         "kinetic energy."),
        ("sign", 0.5 * slope - rate, "The sign is wrong: C v is on the same side as M q̈."),
        ("gravity_too", rate - 0.5 * slope + arm_state().h, "This includes gravity. C v is only "
         "the velocity part of h."),
    ]  # fmt: skip


EXERCISES = (
    Exercise(
        name="A.1",
        stub="floor = np.zeros(3)  # N, in the merry-go-round's axes; replace by your expression",
        solution="coriolis = -2 * np.cross(omega, p_dot)\n"
        "centrifugal = -np.cross(omega, np.cross(omega, p))\n"
        "floor = -mass * (coriolis + centrifugal)",
        judge=NumericJudge(
            right=_force_on_the_walker,
            praise="The force is inwards to keep the child on the disc, and sideways to keep up "
            "with it. It is a real force, from the floor.",
            mistakes=_floor_mistakes,
        ),
        explanation="In these axes p̈ = 0, so the real force per mass and the two fictitious "
        "terms add up to zero.",
    ),
    Exercise(
        name="A.2",
        stub="pair = np.zeros(6)  # N·m; replace by calls of h_of",
        solution="lift, elbow = np.eye(6)[[1, 2]]\npair = h_of(lift + elbow) - h_of(lift) - "
        "h_of(elbow) + g",
        judge=NumericJudge(
            right=_pair,
            praise="This is the Coriolis term of this pair. Two calls are enough: half of "
            "h(lift + elbow) - h(lift - elbow). Do you see why?",
            mistakes=_pair_mistakes,
        ),
        explanation="h = g + Σ Γ_ij v_i v_j. Both joints moving minus each alone leaves 2 Γ_ij "
        "and minus one g, which is added back.",
    ),
    Exercise(
        name="A.3",
        stub="Cv = np.zeros(6)  # N·m; replace: from M_at and differences, without h",
        solution="change = lambda way: (M_at(1e-4 * way) - M_at(-1e-4 * way)) / 2e-4\n"
        "slopes = np.array([w @ change(unit) @ w for unit in np.eye(6)])\n"
        "Cv = change(w) @ w - slopes / 2",
        judge=NumericJudge(
            right=_velocity_part,
            praise="All fictitious forces follow from how the inertia changes with the posture. "
            "That is where h comes from.",
            mistakes=_velocity_mistakes,
        ),
        explanation="By Lagrange, d/dt (M v) = gradient of ½ vᵀ M v + forces. So M q̈ + (Ṁ v - "
        "gradient) = forces, and the expression in brackets is C v.",
    ),
)
