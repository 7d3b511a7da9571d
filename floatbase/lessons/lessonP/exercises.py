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


def _load() -> float:
    """Return the bag as a fraction of the robot's mass."""
    return BAG_MASS / fb.load("go2").mass


def _stiffness_slips() -> dict[str, float]:
    """Return for each hint the kp of this mistake."""
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
    "robot_too": "That carries the robot and the bag; it knows its own weight. Only what it does "
    "not know makes it sink.",
    "robot_alone": "That would be for the robot's own weight. Only the bag is not known.",
    "metres": "Metres: 10 mm are 0.01 m, and kp is for metres.",
    "newtons": "Newtons: kp is an acceleration for each metre, 1/s²; divide by the mass that the "
    "controller believes.",
    "true_mass": "The controller plans forces for the mass that it believes, the smaller one: "
    "divide by that.",
    "damping": "That looks like kd = 2 √kp, which acts on velocities; at rest there are none.",
    "no_g": "Without g that is no acceleration.",
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
            "No motor follows that: the controller looks at the robot only every 4 ms.",
            "too_stiff",
        )
    below = 1e3 * com_sag(kp)
    if not np.isfinite(below):
        return Verdict(False, "So soft that the robot sinks to the ground.", "ground")
    if below > MAX_SAG + ROUNDING:
        return Verdict(False, f"On physics it sinks by {below:.1f} mm: too soft.", "soft")
    if below < MIN_SAG:
        return Verdict(
            False,
            f"On physics it sinks by {below:.1f} mm only: softer would do, and is kinder to "
            f"motors.",
            "hard",
        )
    return Verdict(
        True,
        f"On physics it sinks by {below:.1f} mm. (A kp does not weigh: the bag is still not "
        f"known.)",
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
    """Return the shift of the centre of mass to the line through two feet, shape (3,) [m].

    The nearest point is found by least squares along the line.
    """
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
        "zero": "Nothing is moved yet: the centre of mass is beside the diagonal, so the robot "
        "tips.",
        "other_diagonal": "That is over the other diagonal, of FR and RL, which are to be lifted.",
        "sign": "The other way round: from the centre of mass to the line, not from the line.",
        "not_shortest": "That is over the diagonal, but it is not the shortest way: a plumb line "
        "meets it at a right angle.",
        "on_FL": "That is over a foot. Standing on one end of the diagonal is harder than on both.",
        "on_RR": "That is over the foot RR. Standing on one end of the diagonal is harder than on "
        "both.",
        "metres": "Metres, please: that would be as many millimetres.",
        "along": "That is the part of the way *along* the diagonal; the part across it is needed.",
        "halfway": "Halfway. The centre of mass is not over the line yet.",
        "direction": "That is a direction: a unit vector along the diagonal.",
    },
    tolerance=0.02,
)


@array_judge((3,))
def _judge_shift(given: Array) -> Verdict:
    """Judge a shift by geometry, then by how long the robot stands on two feet in simulation."""
    if abs(given[2]) > HEIGHT:
        return Verdict(
            False,
            "Seen from above: the centre of mass keeps its height, so the third number is 0.",
            "height",
        )
    verdict = _SHIFT(given)
    if not verdict.right:
        return verdict
    times = [time_on_two_feet(shift) for shift in (np.zeros(3), given)]
    if times[1] < TIME_ON_TWO_FEET:
        return Verdict(
            False, f"On physics it stood on two feet for {times[1]:.1f} s only.", "short"
        )
    return Verdict(
        True,
        f"On physics it stays up on FL and RR for {times[1]:.1f} s, and for {times[0]:.1f} s where "
        f"it was.",
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
    return [*_SHIFT.examples(), (_nearest() + [0.0, 0.0, 0.1], "height")]


EXERCISES = (
    Exercise(
        name="P.1",
        statement="The kp of the task for the centre of mass with which go2 sinks 10 mm under a "
        "bag of 6 kg, 1/s².",
        stub="kp = 0.0  # 1/s²; replace by your expression",
        solution="kp = bag / go2.mass * 9.81 / 0.010",
        judge=_judge_stiffness,
        examples=_stiffnesses,
        explanation="At rest m (kp s + g) = (m + bag) g. On physics it is 3 to 6 % less, since "
        "legs have masses of their own.",
    ),
    Exercise(
        name="P.2",
        statement="The shortest horizontal shift of the centre of mass that brings it over the "
        "diagonal FL - RR, (3,), m.",
        stub="shift = np.zeros(3)  # m, world; replace by your expression",
        solution="line = feet['RR_foot'] - feet['FL_foot']\n"
        "across = np.array([-line[1], line[0], 0]) / np.linalg.norm(line[:2])\n"
        "shift = across * (across @ (feet['FL_foot'] - com))",
        judge=_judge_shift,
        examples=_shifts,
        explanation="The part of (foot - com) across the line; what is along the line does not "
        "matter.",
    ),
    Exercise(
        name="P.3",
        statement="The mass in the world of a record, as a multiple of what the controller "
        "believes.",
        stub="factor = 1.0  # replace by what you read from dark",
        solution="factor = dark.measured[-1, 2::3].sum() / go2.weight",
        judge=NumericJudge(
            right=lambda: HIDDEN_MASS,
            praise="Measured forces weigh, whatever anybody believes. (This is how a scale works, "
            "and a good robot has four.)",
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
                "believed": "That is what it believes.",
                "first_row": "That is the first row, before the ground has answered: wait until it "
                "is at rest.",
                "planned": "That is planned. It plans for an acceleration that never comes; take "
                "what was measured.",
                "missing": "That is what is missing, as a part; the question is all of it.",
                "inverse": "The other way round: believed for true.",
                "kilograms": "That is a mass in kg; as a multiple of what is believed, please.",
                "newtons": "Those are newtons; as a multiple of the weight that is believed, "
                "please.",
                "one_foot": "That is one foot's part on average: four feet carry.",
                "sinking": "That is from how far it sank, with kp = 100. Who says that kp was 100? "
                "Forces do not need it.",
            },
            tolerance=5e-3,
        ),
        examples=lambda: [(_measured(), "")],
        explanation="At rest the ground carries the true weight, and nothing else.",
    ),
)
