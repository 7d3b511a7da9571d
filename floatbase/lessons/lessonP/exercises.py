"""Exercises of lesson P, Playground."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import Example, NumericJudge, Verdict, array_judge
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


def _stiffness_slips() -> dict[str, float]:
    """Return, for each hint, the kp of this mistake."""
    right, ratio, mass = _load() * G / (MAX_SAG / 1e3), _load(), fb.load("go2").mass
    return {
        "robot_too": right * (1.0 + ratio) / ratio,
        "robot_alone": right / ratio,
        "metres": right / 1e3,
        "newtons": right * mass,
        "true_mass": right / (1.0 + ratio),
        "damping": 2.0 * right**0.5,
        "no_g": right / G,
    }


_STIFFNESS = {
    "robot_too": "That carries the robot and the bag. But the controller knows the weight of "
    "the robot. Only the unknown weight makes it sink.",
    "robot_alone": "That would be for the weight of the robot. Only the bag is unknown.",
    "metres": "Use metres: 10 mm is 0.01 m, and kp is per metre.",
    "newtons": "This is in newtons. kp is an acceleration per metre, 1/s², so divide by the "
    "mass that the controller assumes.",
    "true_mass": "The controller plans forces for the mass that it assumes, the smaller one. "
    "Divide by that mass.",
    "damping": "That looks like kd = 2 √kp, which acts on velocities. At rest they are zero.",
    "no_g": "Without g, that is not an acceleration.",
}


@array_judge(())
def _judge_stiffness(given: Array) -> Verdict:
    """Judge a kp by a simulation of go2 with the bag."""
    kp = float(given)
    if kp <= 0.0:
        return Verdict(False, "A spring that pulls back needs kp > 0.", "not_above_zero")
    for hint, slip in _stiffness_slips().items():
        if abs(kp - slip) <= MISTAKE_TOLERANCE * slip:
            return Verdict(False, _STIFFNESS[hint], hint)
    if kp > MAX_KP:
        return Verdict(
            False,
            "No motor can follow that: the control period is 4 ms.",
            "too_stiff",
        )
    below = 1e3 * com_sag(kp)
    if not np.isfinite(below):
        return Verdict(False, "This is so soft that the robot sinks to the ground.", "ground")
    if below > MAX_SAG + ROUNDING:
        return Verdict(False, f"In simulation the robot sinks by {below:.1f} mm: too soft.", "soft")
    if below < MIN_SAG:
        return Verdict(
            False,
            f"In simulation the robot sinks by only {below:.1f} mm. A softer spring is enough and "
            f"better for the motors.",
            "hard",
        )
    return Verdict(
        True,
        f"In simulation the robot sinks by {below:.1f} mm. (A kp does not weigh the bag, whose "
        f"mass is still unknown.)",
    )


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


def _towards(point: Callable[[dict[str, Array]], Array]) -> Array:
    com, feet = _corners()
    return np.append(point(feet) - com, 0.0)


def _unit_line() -> Array:
    _, feet = _corners()
    line = feet["RR_foot"] - feet["FL_foot"]
    return np.asarray(line / np.linalg.norm(line))


_SHIFT = NumericJudge(
    right=_nearest,
    praise="",
    mistakes={
        "zero": lambda: np.zeros(3),
        "other_diagonal": lambda: _nearest("FR_foot", "RL_foot"),
        "sign": lambda: -_nearest(),
        "not_shortest": lambda: _towards(lambda feet: (feet["FL_foot"] + feet["RR_foot"]) / 2.0),
        "on_FL": lambda: _towards(lambda feet: feet["FL_foot"]),
        "on_RR": lambda: _towards(lambda feet: feet["RR_foot"]),
        "metres": lambda: 1e3 * _nearest(),
        "along": lambda: _towards(lambda feet: feet["FL_foot"]) - _nearest(),
        "halfway": lambda: 0.5 * _nearest(),
        "direction": lambda: np.append(_unit_line(), 0.0),
    },
    hints={
        "zero": "Nothing has moved yet. The centre of mass is beside the diagonal, so the robot "
        "tips.",
        "other_diagonal": "That is above the other diagonal, of FR and RL, which are to be lifted.",
        "sign": "The direction is wrong: go from the centre of mass to the line, not from the "
        "line.",
        "not_shortest": "That is above the diagonal, but it is not the shortest shift. The "
        "shortest line meets the diagonal at a right angle.",
        "on_FL": "That is above the foot FL. Standing on one end of the diagonal is harder than "
        "on both.",
        "on_RR": "That is above the foot RR. Standing on one end of the diagonal is harder than "
        "on both.",
        "metres": "The answer must be in metres: this is in millimetres.",
        "along": "That is the component of the shift *along* the diagonal. The component "
        "perpendicular to it is needed.",
        "halfway": "That is half-way. The centre of mass is not above the line yet.",
        "direction": "That is only a direction: a unit vector along the diagonal.",
    },
    tolerance=0.02,
)


@array_judge((3,))
def _judge_shift(given: Array) -> Verdict:
    """Judge a shift by geometry, then by how long the robot stands on two feet in simulation."""
    if abs(given[2]) > HEIGHT:
        return Verdict(
            False,
            "Seen from above, the centre of mass keeps its height, so the third number is 0.",
            "height",
        )
    if np.abs(given - _nearest()).max() > FULL_MILLIMETRE:
        return _SHIFT(given)
    times = [time_on_two_feet(shift) for shift in (np.zeros(3), given)]
    if times[1] < TIME_ON_TWO_FEET:
        return Verdict(
            False, f"In simulation the robot stood on two feet for only {times[1]:.1f} s.", "short"
        )
    return Verdict(
        True,
        f"In simulation the robot stays up on FL and RR for {times[1]:.1f} s, and without the "
        f"shift for {times[0]:.1f} s.",
    )


def _measured(row: int = -1) -> float:
    return float(unknown_mass_record().measured[row, 2::3].sum()) / fb.load("go2").weight


def _planned() -> float:
    return float(unknown_mass_record().planned[-1, 2::3].sum()) / fb.load("go2").weight


def _by_sinking(kp: float) -> float:
    record = unknown_mass_record()
    return 1.0 + kp * float(record.state(0).com[2] - record.final.com[2]) / G


def _stiffnesses() -> list[Example]:
    right = _load() * G / (MAX_SAG / 1e3)
    return [
        *((kp, hint) for hint, kp in _stiffness_slips().items()), (right, ""), (0.97 * right, ""),
        (-right, "not_above_zero"),
        (0.8 * right, "soft"), (1.5 * right, "hard"), (1e6, "too_stiff"), (3.0, "ground"),
    ]  # fmt: skip


def _shifts() -> list[Example]:
    rounded_shift = np.round(_nearest(), 3)
    return [*_SHIFT.examples(), (rounded_shift, ""), (_nearest() + [0.0, 0.0, 0.1], "height")]


EXERCISES = (
    Exercise(
        name="P.1",
        statement="The kp, 1/s², of the task for the centre of mass with which go2 sinks by 10 "
        "mm under a bag of 6 kg.",
        stub="kp = 0.0  # 1/s²; replace by your expression",
        solution="kp = bag / go2.mass * 9.81 / 0.010",
        judge=_judge_stiffness,
        examples=_stiffnesses,
        explanation="At rest, m (kp s + g) = (m + bag) g. In simulation the sag is 3 to 6 % "
        "smaller, since the legs have masses of their own.",
    ),
    Exercise(
        name="P.2",
        statement="The shortest horizontal shift of the centre of mass that brings it above the "
        "diagonal FL - RR, shape (3,), m.",
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
        statement="The actual mass of the robot in a record, as a multiple of the mass that the "
        "controller assumes.",
        stub="factor = 1.0  # replace by what you read from dark",
        solution="factor = dark.measured[-1, 2::3].sum() / go2.weight",
        judge=NumericJudge(
            right=lambda: HIDDEN_MASS,
            praise="Measured forces weigh the robot, whatever the controller assumes. (A scale "
            "works like this, and a good robot has four.)",
            mistakes={
                "believed": lambda: 1.0,
                "first_row": lambda: _measured(0),
                "planned": _planned,
                "missing": lambda: HIDDEN_MASS - 1.0,
                "inverse": lambda: 1.0 / HIDDEN_MASS,
                "kilograms": lambda: HIDDEN_MASS * fb.load("go2").mass,
                "newtons": lambda: HIDDEN_MASS * fb.load("go2").weight,
                "one_foot": lambda: HIDDEN_MASS / 4.0,
                "sinking": lambda: _by_sinking(100.0),
            },
            hints={
                "believed": "That is the mass that the controller assumes.",
                "first_row": "That is the first row, before the contact forces have settled. "
                "Wait until the robot is at rest.",
                "planned": "That is the planned force. The plan is for an acceleration that "
                "never happens. Use the measured force.",
                "missing": "That is only the missing fraction. The question is about the total.",
                "inverse": "That is the inverse: assumed over actual mass.",
                "kilograms": "That is a mass in kg. The answer must be a multiple of the "
                "assumed mass.",
                "newtons": "That is in newtons. The answer must be a multiple of the assumed "
                "weight.",
                "one_foot": "That is the mean for one foot. Four feet carry the weight.",
                "sinking": "That follows from how far the robot sank, with kp = 100. But "
                "nothing says that kp was 100. The forces do not depend on it.",
            },
            tolerance=5e-3,
        ),
        examples=lambda: [(_measured(), "")],
        explanation="At rest, the ground carries the actual weight and nothing else.",
    ),
)
