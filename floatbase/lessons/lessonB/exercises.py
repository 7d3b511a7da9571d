"""Exercises of lesson B, Torque is an abstraction."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from floatbase._validation import Array
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import Example, NumericJudge, Verdict, array_judge
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


def _valve_opening(error: Callable[[Array, Array], Array]) -> Callable[[], Array]:
    """Return a function that computes k times an error of the desired and actual piston force."""
    return lambda: np.asarray(GAIN * error(WANTED / LEVER, GOT / LEVER))


@array_judge((2,))
def _judge_gains(given: Array) -> Verdict:
    """Judge gains by whether go2 with 5 Hz actuators comes back to within a millimetre."""
    kp, kd = map(float, given)
    if min(kp, kd) <= 0.0:
        return Verdict(
            False,
            "A gain that is not above zero draws nothing back, or pushes it away.",
            "not_above_zero",
        )
    if kp < kd:
        return Verdict(
            False,
            "kp comes first, in 1/s², and then kd, in 1/s: here kp is the smaller one.",
            "swapped",
        )
    if kd > MOST_DAMPING:
        return Verdict(
            False,
            f"kd = {rounded(kd)} is more than the {MOST_DAMPING:g} that the measured velocities "
            f"allow.",
            "damping",
        )
    outcome, off, swing = push_response(kp, kd)
    far = f"{rounded(off)} mm off in the end"
    if outcome != "completed" or off > LOST:
        what = far if outcome == "completed" else outcome
        if kp < SOFT:
            return Verdict(
                False,
                f"{what}: too soft. What leaks pushes it aside before the loops have learned how "
                f"much it is.",
                "soft",
            )
        return Verdict(
            False,
            f"{what}: far too much kp for this kd. A late torque feeds the swing that it was to "
            f"end.",
            "hard",
        )
    if off <= NEAR_HOME:
        return Verdict(
            True,
            f"{far}: stiff enough for what leaks, and not yet too stiff for a torque that comes "
            f"late.",
        )
    if swing > off:
        why = "A late torque lags more behind a quick swing: less kp, or more kd, if you may."
        return Verdict(
            False, f"{far}, and it still swings, by {rounded(swing)} mm. {why}", "swings"
        )
    return Verdict(
        False,
        f"{far}, but nearly at rest there. What leaks pushes it aside, and kp is the spring that "
        f"holds against it.",
        "leaks",
    )


def _gains() -> list[Example]:
    return [
        ((490.0, 20.0), ""), ([420, 20], ""), ((100.0, 20.0), "leaks"), ((700.0, 20.0), "swings"),
        ((2000.0, 20.0), "hard"),
        ((2.0, 2.0), "soft"), ((490.0, 44.0), "damping"), ((20.0, 490.0), "swapped"),
        ((-490.0, 20.0), "not_above_zero"),
    ]  # fmt: skip


EXERCISES = (
    Exercise(
        name="B.1",
        statement="The torque of an excavator's cylinder on its arm, N·m.",
        stub="torque = piston * b  # N·m, if crank and cylinder were square; replace",
        namespace=lambda: {"piston": PISTON, "b": CRANK},
        solution="length = np.sqrt(a**2 + b**2 - 2 * a * b * np.cos(gamma))\ntorque = piston * a * "
        "b * np.sin(gamma) / length",
        judge=NumericJudge(
            right=_torque,
            praise="Force times dℓ/dq: which is the distance of the joint from the line of the "
            "cylinder.",
            mistakes={
                "square": lambda: PISTON * CRANK,
                "sin_gamma": lambda: PISTON * CRANK * np.sin(GAMMA),
                "cosine": lambda: PISTON * CRANK * np.cos(GAMMA),
                "other_side": lambda: PISTON * CRANK * CRANK * np.sin(GAMMA) / _length(GAMMA),
                "foot_lever": lambda: PISTON * FOOT * np.sin(GAMMA),
                "not_divided": lambda: PISTON * FOOT * CRANK * np.sin(GAMMA),
                "cosine_derivative": lambda: PISTON * FOOT * CRANK * np.cos(GAMMA) / _length(GAMMA),
                "degrees": lambda: (
                    PISTON
                    * FOOT
                    * CRANK
                    * np.sin(50.0)
                    / np.sqrt(FOOT**2 + CRANK**2 - 2 * FOOT * CRANK * np.cos(50.0))
                ),
                "plus": lambda: PISTON * FOOT * CRANK * np.sin(GAMMA) / _length(GAMMA, 1.0),
                "lever_alone": lambda: _torque() / PISTON,
            },
            hints={
                "square": "That would be so if crank and cylinder were square. They are not here.",
                "sin_gamma": "γ is the angle at the joint, between crank and foot. What counts is "
                "the angle between the crank "
                "and the "
                "cylinder, along which the force goes.",
                "cosine": "The cosine is along the crank, and has no lever. And γ is not the angle "
                "between crank and cylinder.",
                "other_side": "That is the crank times the sine of the angle at the foot. It goes "
                "with the other side: a.",
                "foot_lever": "That lever is a sin γ: the distance of the foot from the line of "
                "the crank.",
                "not_divided": "The derivative of ℓ²/2 is a b sin γ. You want that of ℓ: one more "
                "division by ℓ.",
                "cosine_derivative": "The derivative of the cosine is a sine.",
                "degrees": "np.sin and np.cos take radians; this is the sine of 50 radians.",
                "plus": "The law of cosines has a minus: at γ = 0 the crank points to the foot, "
                "and ℓ is shortest.",
                "lever_alone": "That is the lever, in m. The torque is the piston's force times "
                "it.",
            },
        ),
        explanation="ℓ² = a² + b² - 2 a b cos γ, so dℓ/dγ = a b sin γ / ℓ; and τ q̇ = F ℓ̇.",
    ),
    Exercise(
        name="B.2",
        statement="What the loop tells the valve in four situations, shape (4,).",
        stub="u = k * (wanted - got)  # shape (4,); replace: an error of the piston's force",
        namespace=lambda: {"k": GAIN, "wanted": WANTED, "got": GOT},
        solution="u = k * (wanted / lever - got / lever)",
        judge=NumericJudge(
            right=_valve_opening(lambda wanted, got: wanted - got),
            praise="Too little of a pull asks for oil on the other side; beyond the dead point out "
            "and in change their roles.",
            mistakes={
                "torque_error": lambda: GAIN * (WANTED - GOT),
                "sizes": _valve_opening(lambda wanted, got: abs(wanted) - abs(got)),
                "no_sign": _valve_opening(lambda wanted, got: abs(wanted - got)),
                "sign": _valve_opening(lambda wanted, got: got - wanted),
                "no_lever_sign": lambda: GAIN * (WANTED - GOT) / abs(LEVER),
                "lever_sign_alone": lambda: GAIN * (WANTED - GOT) * np.sign(LEVER),
                "times_lever": lambda: GAIN * (WANTED - GOT) * LEVER,
                "no_loop": _valve_opening(lambda wanted, got: wanted),
            },
            hints={
                "torque_error": "That is the error of the torque. The piston knows nothing of the "
                "joint: which force should "
                "it have?",
                "sizes": "'Too little: open it more' is not enough: for more *pull* the valve must "
                "open to the other side.",
                "no_sign": "A size has lost its sign: u says to which side the valve opens.",
                "sign": "All the other way: this lets out where oil is missing.",
                "no_lever_sign": "The lever's sign got lost: beyond the dead point the rod must go "
                "*in* to turn the joint "
                "forwards.",
                "lever_sign_alone": "The right sides. But a short lever needs a larger force for "
                "the same torque: divide by "
                "it.",
                "times_lever": "Force is torque divided by the lever, not times it.",
                "no_loop": "That opens for what is wanted, and never looks at what is there: no "
                "loop.",
            },
        ),
        explanation="F = τ / L, with L's sign. u > 0 feeds A, and the force grows; u < 0 feeds B, "
        "and it falls.",
    ),
    Exercise(
        name="B.3",
        statement="Gains kp and kd ≤ 20 with which go2 on 5 Hz comes back to within 1 mm.",
        stub="gains = (100.0, 20.0)  # kp in 1/s², kd in 1/s; kd at most 20; replace",
        solution="gains = (490.0, 20.0)",
        judge=_judge_gains,
        examples=_gains,
        explanation="What leaks is a force, so go2 stays aside by an amount ∝ 1/kp; but kp/kd must "
        "stay below 2π · 5 Hz.",
    ),
)
