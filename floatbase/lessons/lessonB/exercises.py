"""Exercises of lesson B, Torque is an abstraction."""

from __future__ import annotations

import numpy as np

from floatbase._validation import Array
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import (
    Example,
    Mistake,
    NumericJudge,
    Verdict,
    array_judge,
    first_fault,
)
from floatbase.lessons.lessonB.helpers import push_response
from floatbase.lessons.rounding import rounded

FOOT, CRANK, GAMMA, PISTON = 0.40, 0.10, np.deg2rad(50.0), 5000.0  # of exercise B.1: m, m, rad, N
STEP = 1e-5  # rad, of a difference
# N·m, of exercise B.2
WANTED, GOT = np.array([12.0, 12.0, -12.0, -12.0]), np.array([9.0, 15.0, -9.0, -9.0])
LEVER, GAIN = np.array([0.036, 0.036, 0.036, -0.020]), 0.001  # m; 1/N
NEAR_HOME = 1.0  # mm, of exercise B.3
MOST_DAMPING = 20.0  # 1/s
LOST, SOFT = 50.0, 100.0  # mm; 1/s²


def _length(gamma: float, sign: float = -1.0) -> float:
    """Return the distance from the foot of the cylinder to the end of the rod [m]."""
    return float(np.linalg.norm([CRANK * np.cos(gamma) + sign * FOOT, CRANK * np.sin(gamma)]))


def _torque() -> float:
    """Return the force of the piston times the rate of its length per radian."""
    return PISTON * (_length(GAMMA + STEP) - _length(GAMMA - STEP)) / (2.0 * STEP)


@array_judge((2,))
def _judge_gains(given: Array) -> Verdict:
    """Judge gains by whether go2 with 5 Hz actuators comes back to within a millimetre."""
    kp, kd = map(float, given)
    fault = first_fault([
        ("not_above_zero", min(kp, kd) <= 0.0, "A gain must be above zero. Otherwise it has no "
         "effect or pushes the robot away."),
        ("swapped", kp < kd, "kp in 1/s² comes first, then kd in 1/s. Here kp is the smaller "
         "number."),
        ("damping", kd > MOST_DAMPING, f"kd = {rounded(kd)} is more than {MOST_DAMPING:g}, the "
         "limit for the measured velocities."),
    ])  # fmt: skip
    if fault:
        return fault
    outcome, off, swing = push_response(kp, kd)
    far = f"{rounded(off)} mm off at the end"
    lost = outcome != "completed" or off > LOST
    what = far if outcome == "completed" else outcome
    return first_fault([
        ("soft", lost and kp < SOFT, f"{what}: the gains are too low. The leakage pushes the robot "
         "aside before the force loops have compensated for it."),
        ("hard", lost, f"{what}: kp is far too high for this kd. A delayed torque amplifies the "
         "oscillation that it should damp."),
        ("swings", off > NEAR_HOME and swing > off, f"{far}, and the robot still oscillates by "
         f"{rounded(swing)} mm. The delay matters more for a fast oscillation. Reduce kp, or "
         "increase kd if possible."),
        ("leaks", off > NEAR_HOME, f"{far}, but nearly at rest there. The leakage pushes the robot "
         "aside, and kp is the spring that resists."),
    ]) or Verdict(
        True, f"{far}: stiff enough for the leakage, and not too stiff for the delayed torque."
    )  # fmt: skip


def _gains() -> list[Example]:
    return [
        ((490.0, 20.0), ""), ([420, 20], ""), ((100.0, 20.0), "leaks"), ((700.0, 20.0), "swings"),
        ((2000.0, 20.0), "hard"),
        ((2.0, 2.0), "soft"), ((490.0, 44.0), "damping"), ((20.0, 490.0), "swapped"),
        ((-490.0, 20.0), "not_above_zero"),
    ]  # fmt: skip


def _torque_mistakes() -> list[Mistake]:
    force, a, b, gamma, length = PISTON, FOOT, CRANK, GAMMA, _length(GAMMA)
    wrong_length = np.sqrt(a**2 + b**2 - 2 * a * b * np.cos(50.0))  # degrees as radians
    return [
        ("square", force * b, "That would be right if crank and cylinder were perpendicular, but "
         "here they are not."),
        ("sin_gamma", force * b * np.sin(gamma), "γ is the angle at the joint, between the crank "
         "and the foot of the cylinder. The angle that matters is between the crank and the "
         "cylinder, which is the direction of the force."),
        ("cosine", force * b * np.cos(gamma), "The cosine gives the component along the crank, "
         "which has no lever arm. And γ is not the angle between crank and cylinder."),
        ("other_side", force * b * b * np.sin(gamma) / length, "That is the crank times the sine "
         "of the angle at the foot. That sine belongs to the other side, a."),
        ("foot_lever", force * a * np.sin(gamma), "That lever arm is a sin γ: the distance of the "
         "foot from the line of the crank."),
        ("not_divided", force * a * b * np.sin(gamma), "The derivative of ℓ²/2 is a b sin γ. You "
         "need the derivative of ℓ, so divide by ℓ."),
        ("cosine_derivative", force * a * b * np.cos(gamma) / length, "The derivative of the "
         "cosine is a sine."),
        ("degrees", force * a * b * np.sin(50.0) / wrong_length, "np.sin and np.cos take radians. "
         "This is the sine of 50 radians."),
        ("plus", force * a * b * np.sin(gamma) / _length(gamma, 1.0), "The law of cosines has a "
         "minus. At γ = 0 the crank points to the foot, and ℓ is shortest."),
        ("pythagoras", force * a * b * np.sin(gamma) / np.hypot(a, b), "ℓ² = a² + b² holds only "
         "for a right angle at the joint. Here the angle is 50°: use the law of cosines."),
        ("right_angle", force * a * b * np.sin(gamma) / np.sqrt(a**2 - b**2), "ℓ² = a² - b² holds "
         "only for a right angle between crank and cylinder. Use the law of cosines."),
        ("lever_alone", _torque() / force, "That is the lever arm, in m. The torque is the force "
         "of the piston times the lever arm."),
    ]  # fmt: skip


def _valve_mistakes() -> list[Mistake]:
    wanted, got, error = WANTED / LEVER, GOT / LEVER, GAIN * (WANTED - GOT)
    return [
        ("torque_error", error, "That is the error of the torque, but the piston only knows its "
         "force. Which force should it have?"),
        ("sizes", GAIN * (abs(wanted) - abs(got)), "It is not enough to open the valve more when "
         "the force is too small. For a stronger *pull*, the valve must open to the other side."),
        ("no_sign", GAIN * abs(wanted - got), "A sign is lost: u says to which side the valve "
         "opens."),
        ("sign", GAIN * (got - wanted), "All signs are wrong: this lets oil out where it is "
         "missing."),
        ("no_lever_sign", error / abs(LEVER), "The sign of the lever arm is lost. Beyond the dead "
         "point, the rod must move *in* to turn the joint forwards."),
        ("lever_sign_alone", error * np.sign(LEVER), "The sides are right. But with a short lever "
         "arm, the same torque needs a larger force: divide by the lever arm."),
        ("times_lever", error * LEVER, "The force is the torque divided by the lever arm, not "
         "multiplied by it."),
        ("no_loop", GAIN * wanted, "This opens the valve for the desired force and ignores the "
         "actual force: it is not a feedback loop."),
    ]  # fmt: skip


EXERCISES = (
    Exercise(
        name="B.1",
        stub="torque = piston * b  # N·m, if crank and cylinder were perpendicular; replace",
        namespace=lambda: {"piston": PISTON, "b": CRANK},
        solution="length = np.sqrt(a**2 + b**2 - 2 * a * b * np.cos(gamma))\ntorque = piston * a * "
        "b * np.sin(gamma) / length",
        judge=NumericJudge(
            right=_torque,
            praise="The torque is force times dℓ/dq, and dℓ/dq is the distance of the joint "
            "from the line of the cylinder.",
            mistakes=_torque_mistakes,
        ),
        explanation="ℓ² = a² + b² - 2 a b cos γ, so dℓ/dγ = a b sin γ / ℓ; and τ q̇ = F ℓ̇.",
    ),
    Exercise(
        name="B.2",
        stub="u = k * (wanted - got)  # shape (4,); replace: an error of the piston's force",
        namespace=lambda: {"k": GAIN, "wanted": WANTED, "got": GOT},
        solution="u = k * (wanted / lever - got / lever)",
        judge=NumericJudge(
            right=lambda: GAIN * (WANTED / LEVER - GOT / LEVER),
            praise="If a pull is too weak, oil is needed on the other side. Beyond the dead "
            "point, moving out and moving in swap their roles.",
            mistakes=_valve_mistakes,
        ),
        explanation="F = τ / L, with the sign of L. u > 0 feeds A, and the force increases. u < "
        "0 feeds B, and the force decreases.",
    ),
    Exercise(
        name="B.3",
        stub="gains = (100.0, 20.0)  # kp in 1/s², kd in 1/s; kd at most 20; replace",
        solution="gains = (490.0, 20.0)",
        judge=_judge_gains,
        examples=_gains,
        explanation="The leakage acts like a force, so go2 stays off its place by an amount ∝ "
        "1/kp. But kp/kd must stay below 2π · 5 Hz.",
    ),
)
