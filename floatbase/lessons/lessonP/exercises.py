"""Exercises of lesson P, Playground."""

from __future__ import annotations

import numpy as np

import floatbase as fb
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
from floatbase.lessons.lessonP.helpers import (
    BAG_MASS,
    HIDDEN_MASS,
    com_sag,
    time_on_two_feet,
    unknown_mass_record,
)

G = 9.81  # m/s²
MAX_SAG, MIN_SAG = 10.0, 9.0  # mm: largest and smallest sag; less is stiffer than requested
ROUNDING = 0.05  # mm
MAX_KP = 1e5  # 1/s²: the largest kp that is simulated
MISTAKE_TOLERANCE = 0.01  # fraction of a mistake's value
TIME_ON_TWO_FEET = 1.0  # s: required time on two feet
HEIGHT = 1e-4  # m: smaller changes of height count as zero
FULL_MILLIMETRE = 5.5e-4  # m: a shift that is rounded to full millimetres is right


def _load() -> float:
    """Return the bag as a fraction of the robot's mass."""
    return BAG_MASS / fb.load("go2").mass


def _stiffness_mistakes() -> list[Mistake]:
    right, ratio, mass = _load() * G / (MAX_SAG / 1e3), _load(), fb.load("go2").mass
    return [
        ("robot_too", right * (1.0 + ratio) / ratio, "That carries the robot and the bag. But the "
         "controller knows the weight of the robot. Only the unknown weight makes it sink."),
        ("robot_alone", right / ratio, "That would be for the weight of the robot. Only the bag is "
         "unknown."),
        ("metres", right / 1e3, "Use metres: 10 mm is 0.01 m, and kp is per metre."),
        ("newtons", right * mass, "This is in newtons. kp is an acceleration per metre, 1/s², so "
         "divide by the mass that the controller assumes."),
        ("true_mass", right / (1.0 + ratio), "The controller plans forces for the mass that it "
         "assumes, the smaller one. Divide by that mass."),
        ("damping", 2.0 * right**0.5, "That looks like kd = 2 √kp, which acts on velocities. At "
         "rest they are zero."),
        ("no_g", right / G, "Without g, that is not an acceleration."),
    ]  # fmt: skip


@array_judge(())
def _judge_stiffness(given: Array) -> Verdict:
    """Judge a kp by a simulation of go2 with the bag."""
    kp = float(given)
    fault = first_fault([
        ("not_above_zero", kp <= 0.0, "A spring that pulls back needs kp > 0."),
        *((hint, abs(kp - slip) <= MISTAKE_TOLERANCE * slip, text)
          for hint, slip, text in _stiffness_mistakes()),
        ("too_stiff", kp > MAX_KP, "No motor can follow that: the control period is 4 ms."),
    ])  # fmt: skip
    if fault:
        return fault
    below = 1e3 * com_sag(kp)
    return first_fault([
        ("ground", not np.isfinite(below), "This is so soft that the robot sinks to the ground."),
        ("soft", below > MAX_SAG + ROUNDING, f"In simulation the robot sinks by {below:.1f} mm: "
         "too soft."),
        ("hard", below < MIN_SAG, f"In simulation the robot sinks by only {below:.1f} mm. A softer "
         "spring is enough and better for the motors."),
    ]) or Verdict(
        True,
        f"In simulation the robot sinks by {below:.1f} mm. (A kp does not weigh the bag, whose "
        "mass is still unknown.)",
    )  # fmt: skip


def _corners() -> tuple[Array, dict[str, Array]]:
    """Return the centre of mass and the feet from above, shape (2,) [m]."""
    state = fb.load("go2").standing()
    contacts = fb.Contacts.feet(state.robot)
    return state.com[:2], {
        name: place[:2]
        for name, place in zip(contacts.names, contacts.positions(state), strict=True)
    }


def _nearest(first: str = "FL_foot", second: str = "RR_foot") -> Array:
    """Return the shift of the centre of mass to the line through two feet, shape (3,) [m]."""
    com, feet = _corners()
    line = feet[second] - feet[first]
    along = np.linalg.lstsq(line[:, None], com - feet[first], rcond=None)[0]
    return np.append(feet[first] + line * along - com, 0.0)


def _shift_mistakes() -> list[Mistake]:
    com, feet = _corners()
    right, front, rear = _nearest(), feet["FL_foot"], feet["RR_foot"]
    to_front, to_rear, line = (np.append(x, 0.0) for x in (front - com, rear - com, rear - front))
    return [
        ("zero", np.zeros(3), "Nothing has moved yet. The centre of mass is beside the diagonal, "
         "so the robot tips."),
        ("other_diagonal", _nearest("FR_foot", "RL_foot"), "That is above the other diagonal, of "
         "FR and RL, which are to be lifted."),
        ("sign", -right, "The direction is wrong: go from the centre of mass to the line, not from "
         "the line."),
        ("on_FL", to_front, "That is above the foot FL. Standing on one end of the diagonal is "
         "harder than on both."),
        ("on_RR", to_rear, "That is above the foot RR. Standing on one end of the diagonal is "
         "harder than on both."),
        ("metres", 1e3 * right, "The answer must be in metres: this is in millimetres."),
        ("along", to_front - right, "That is the component of the shift *along* the diagonal. The "
         "component perpendicular to it is needed."),
        ("halfway", 0.5 * right, "That is half-way. The centre of mass is not above the line yet."),
        ("direction", line / np.linalg.norm(line), "That is only a direction: a unit vector along "
         "the diagonal."),
    ]  # fmt: skip


_SHIFT = NumericJudge(right=_nearest, praise="", mistakes=_shift_mistakes, tolerance=0.02)


@array_judge((3,))
def _judge_shift(given: Array) -> Verdict:
    """Judge a shift by geometry, then by how long the robot stands on two feet in simulation."""
    if abs(given[2]) > HEIGHT:
        text = "The shift is horizontal, so the third number is 0."
        return Verdict(False, text, "height")
    off = given - _nearest()
    if np.abs(off).max() > FULL_MILLIMETRE:
        verdict, across = _SHIFT(given), _nearest() / np.linalg.norm(_nearest())
        if not verdict.hint.startswith("unknown") or abs(across @ off) > FULL_MILLIMETRE:
            return verdict
        text = (
            "That is above the diagonal, but it is not the shortest shift. The shortest line meets "
            "the diagonal at a right angle."
        )
        return Verdict(False, text, "not_shortest")
    times = [time_on_two_feet(shift) for shift in (np.zeros(3), given)]
    if times[1] < TIME_ON_TWO_FEET:
        text = f"In simulation the robot stood on two feet for only {times[1]:.1f} s."
        return Verdict(False, text, "short")
    return Verdict(
        True,
        f"In simulation the robot stays up on FL and RR for {times[1]:.1f} s, and without the "
        f"shift for {times[0]:.1f} s.",
    )


def _measured(row: int = -1) -> float:
    return float(unknown_mass_record().measured[row, 2::3].sum()) / fb.load("go2").weight


def _stiffnesses() -> list[Example]:
    right = _load() * G / (MAX_SAG / 1e3)
    return [
        *((kp, hint) for hint, kp, _ in _stiffness_mistakes()), (right, ""), (0.97 * right, ""),
        (-right, "not_above_zero"),
        (0.8 * right, "soft"), (1.5 * right, "hard"), (1e6, "too_stiff"), (3.0, "ground"),
    ]  # fmt: skip


def _shifts() -> list[Example]:
    x, y, _ = right = _nearest()
    longer = [[x + y * y / x, 0.0, 0.0], [0.0, y + x * x / y, 0.0]]  # straight ahead, to the side
    return [
        *_SHIFT.examples(), (np.round(right, 3), ""), (right + [0.0, 0.0, 0.1], "height"),
        *((way, "not_shortest") for way in longer),
    ]  # fmt: skip


def _mass_mistakes() -> list[Mistake]:
    record, go2 = unknown_mass_record(), fb.load("go2")
    planned = record.planned[-1, 2::3].sum() / go2.weight
    sank = float(record.state(0).com[2] - record.final.com[2])
    return [
        ("believed", 1.0, "That is the mass that the controller assumes."),
        ("first_row", _measured(0), "That is the first row, before the contact forces have "
         "settled. Wait until the robot is at rest."),
        ("planned", planned, "That is the planned force. The plan is for an acceleration that "
         "never happens. Use the measured force."),
        ("missing", HIDDEN_MASS - 1.0, "That is only the missing fraction. The question is about "
         "the total."),
        ("inverse", 1.0 / HIDDEN_MASS, "That is the inverse: assumed over actual mass."),
        ("kilograms", HIDDEN_MASS * go2.mass, "That is a mass in kg. The answer must be a multiple "
         "of the assumed mass."),
        ("newtons", HIDDEN_MASS * go2.weight, "That is in newtons. The answer must be a multiple "
         "of the assumed weight."),
        ("one_foot", HIDDEN_MASS / 4.0, "That is the mean for one foot. Four feet carry the "
         "weight."),
        ("sinking", 1.0 + 100.0 * sank / G, "That follows from how far the robot sank, with kp = "
         "100. But nothing says that kp was 100. The forces do not depend on it."),
    ]  # fmt: skip


EXERCISES = (
    Exercise(
        name="P.1",
        stub="kp = 0.0  # 1/s²; replace by your expression",
        solution="kp = bag / go2.mass * 9.81 / 0.010",
        judge=_judge_stiffness,
        examples=_stiffnesses,
        explanation="At rest, m (kp s + g) = (m + bag) g. In simulation the sag is 3 to 6 % "
        "smaller, since the legs have masses of their own.",
    ),
    Exercise(
        name="P.2",
        stub="shift = np.zeros(3)  # m, world; replace by your expression",
        solution="line = feet['RR_foot'] - feet['FL_foot']\n"
        "across = np.array([-line[1], line[0], 0]) / np.linalg.norm(line[:2])\n"
        "shift = across * (across @ (feet['FL_foot'] - com))",
        judge=_judge_shift,
        examples=_shifts,
        explanation="The shift is the component of (foot - com) perpendicular to the line. The "
        "component along the line does not matter.",
    ),
    Exercise(
        name="P.3",
        stub="factor = 1.0  # replace by what you read from dark",
        solution="factor = dark.measured[-1, 2::3].sum() / go2.weight",
        judge=NumericJudge(
            right=lambda: HIDDEN_MASS,
            praise="Measured forces weigh the robot, whatever the controller assumes. (A scale "
            "works like this, and a good robot has four.)",
            mistakes=_mass_mistakes,
            tolerance=5e-3,
        ),
        examples=lambda: [(_measured(), "")],
        explanation="At rest, the ground carries the actual weight and nothing else.",
    ),
)
