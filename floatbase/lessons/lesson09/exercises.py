"""Exercises of lesson 09, Feet with area."""

from __future__ import annotations

from functools import cache

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.friction import FrictionPolyhedron, WrenchSet, centre_of_pressure, contact_wrench
from floatbase.lessons.exercises import Exercise, OwnNumber
from floatbase.lessons.judges import (
    Example,
    Mistake,
    NumericJudge,
    Verdict,
    array_judge,
    first_fault,
    lasting_or_verdict,
)
from floatbase.lessons.lesson09.helpers import (
    LEAN_START,
    MU,
    SLOW_PERIOD,
    TIME_AFTER_LEAN,
    centre_of_pressure_path,
    leaning_controller,
    load_talos,
)
from floatbase.lessons.rounding import rounded
from floatbase.simulation import Rollout

ANKLE = 0.107  # m: height of the sensor of exercise 09.1 above the sole
# N, of exercise 09.1
CORNER_FORCES = ((30.0, 5.0, 210.0), (24.0, -6.0, 120.0), (14.0, 2.0, 60.0), (12.0, 9.0, 90.0))
LENGTH, WIDTH, LOAD, SOLE_MU = 0.24, 0.10, 400.0, 0.6  # m, m, N and μ of the sole of exercise 09.2
ROUND = 360  # facets that approximate a round cone with an error of 4e-5
LEAN, QUICK, EDGE, NEAR = 6.0, 1.5, 15.0, 2.0  # cm, s, mm, mm: requirements of exercise 09.3
_LOOSE = 1e-3  # weight of the posture in `standing_tasks`; below it, arms and trunk are loose


# 09.1 ---------------------------------------------------------------------------------------------


@cache
def ankle_sensor_reading() -> Array:
    """Return the reading of a sensor in the left ankle of Talos, shape (6,).

    The reading contains the force [N] and the moment about the sensor [N·m], in the world frame.
    """
    state = load_talos().standing()
    sole = fb.Contacts.flat_feet(load_talos()).only("left_sole_link")
    return contact_wrench(
        state, sole, np.array(CORNER_FORCES), state.point("left_sole_link") + [0.0, 0.0, ANKLE]
    )


def _pushed() -> Array:
    """Compute the centre of pressure as the mean of the corners, weighted by their forces."""
    state = load_talos().standing()
    sole = fb.Contacts.flat_feet(load_talos()).only("left_sole_link")
    return (
        centre_of_pressure(state, sole, np.array(CORNER_FORCES)) - state.point("left_sole_link")
    )[:2]


def _pressure_mistakes() -> list[Mistake]:
    f, (tx, ty, _) = ankle_sensor_reading()[:3], ankle_sensor_reading()[3:]
    right = _pushed()

    def read(height: float) -> Array:
        """Compute the centre of pressure at a height above the sensor."""
        return np.array([-ty + height * f[0], tx + height * f[1]]) / f[2]

    return [
        ("zero", np.zeros(2), "There is no answer yet: this is the point below the sensor."),
        ("no_height", read(0.0), "The height of the ankle is missing. The formula in the lesson is "
         "for a point on the ground."),
        ("height_sign", read(ANKLE), "The sign of the height is wrong: the ground is below the "
         "sensor."),
        ("swapped", read(-ANKLE)[::-1], "x and y are swapped. A force further ahead has a moment "
         "about y."),
        ("no_height_swapped", read(0.0)[::-1], "The height is missing, and x and y are swapped."),
        ("sign", -read(-ANKLE), "The sign is wrong: (x, y, 0) × (0, 0, f_z) = (y f_z, -x f_z, 0)."),
        ("millimetres", 1e3 * right, "That is in mm. The answer must be in m."),
        ("not_divided", right * f[2], "These are moments. Divide them by the normal force."),
        ("whole_force", right * f[2] / np.linalg.norm(f), "The normal force is f_z alone, not the "
         "magnitude of f."),
    ]  # fmt: skip


# 09.2 ---------------------------------------------------------------------------------------------


def _twist(facets: int = ROUND, mu: float = SOLE_MU, load: float = LOAD) -> float:
    """Compute the largest twist of the sole [N·m] by a linear program over its corner forces."""
    corners = np.array([[sx * LENGTH / 2, sy * WIDTH / 2, 0.0] for sx in (1, -1) for sy in (1, -1)])
    cone = FrictionPolyhedron(np.array([0.0, 0.0, 1.0]), mu, facets)
    limits = WrenchSet(corners, (cone,) * 4, np.zeros(3), load, np.full(4, np.inf))
    return limits.max_scaling([0.0, 0.0, 0.0, 0.0, 0.0, 1.0], [0.0, 0.0, load, 0.0, 0.0, 0.0])


def _twist_mistakes(load: float) -> list[Mistake]:
    right, friction = _twist(load=load), SOLE_MU * load
    return [
        ("zero", 0.0, "There is no answer yet."),
        ("pyramids", _twist(4, load=load), "That is for pyramids with four facets inside the "
         "cones. Here the cones are round."),
        ("half_length", friction * LENGTH / 2, "That is μ f_z times half the length. The lever arm "
         "of a corner goes from the middle to the corner."),
        ("half_width", friction * WIDTH / 2, "That is μ f_z times half the width. The lever arm of "
         "a corner goes from the middle to the corner."),
        ("whole_sides", friction * np.hypot(LENGTH, WIDTH), "Use half the sides, not the sides: "
         "the lever arms begin in the middle."),
        ("one_corner", right / 4, "That is for one corner, but four corners carry the load."),
        ("four_times", 4 * right, "Four corners share the load, so each has a quarter of it."),
        ("no_mu", right / SOLE_MU, "μ is missing: friction is less than the normal force."),
        ("mu_of_lesson", _twist(mu=MU, load=load), "That is for the μ of the lesson. Here it is "
         "0.6."),
        ("square", friction * (LENGTH + WIDTH) / 2, "Half the length plus half the width is the "
         "lever arm for square pyramids. Use the distance."),
        ("disc", 2 / 3 * friction * LENGTH / 2, "That is for a disc with the length of the sole "
         "and uniform pressure: 2/3 μ f_z times its radius."),
    ]  # fmt: skip


def _twist_judge(load: float = LOAD) -> NumericJudge:
    """Return the judge of exercise 09.2 for the force on the sole [N]."""
    return NumericJudge(
        right=lambda: _twist(load=load),
        praise="Each corner pushes perpendicular to its lever arm, as hard as friction allows.",
        mistakes=lambda: _twist_mistakes(load),
    )


# 09.3 ---------------------------------------------------------------------------------------------


@cache
def run_lean(seconds: float, posture: float) -> Rollout:
    """Simulate the lean of exercise 09.3 with a duration [s] and a weight of the posture."""
    controller = leaning_controller(LEAN, seconds, posture)
    ticks = int(np.ceil((LEAN_START + seconds + TIME_AFTER_LEAN) / SLOW_PERIOD))
    return fb.rollout(
        fb.Simulation(load_talos()), controller, ticks * SLOW_PERIOD, control_period=SLOW_PERIOD
    )


@array_judge((2,))
def _judge_lean(given: Array) -> Verdict:
    """Judge a lean in simulation."""
    seconds, posture = given.tolist()
    if not (0.05 <= seconds <= 20.0 and 0.0 <= posture <= 1e3):
        text = "The time must be from 0.05 to 20 s, and the weight from 0 to 1000."
        return Verdict(False, text, "range")
    why = " Hardly any task controls the arms and the trunk." if posture < _LOOSE else ""
    record = lasting_or_verdict(lambda: run_lean(seconds, posture), why)
    return record if isinstance(record, Verdict) else _judge_record(record, seconds)


def _judge_record(record: Rollout, seconds: float) -> Verdict:
    """Judge a complete lean: where it ended, the centre of pressure, and the duration."""
    settled = record.time > 0.1  # the robot is put down at first
    corners = record.foot_positions[..., 0]
    toes, heels = corners.max(axis=1), corners.min(axis=1)
    pushed = centre_of_pressure_path(record)[:, 0]
    if np.isnan(pushed[settled]).any():
        text = (
            "For a moment no corner touches the ground. Arms and trunk are thrown about. What "
            "controls them?"
        )
        return Verdict(False, text, "in_the_air")
    ahead, behind = (1e3 * np.min(room[settled]) for room in (toes - pushed, pushed - heels))
    short = 1e3 * (record.com[0, 0] - record.final.com[0]) + 10.0 * LEAN
    where = "short" if short >= 0.0 else "too far"
    text = f"{rounded(abs(short), 'mm', floor=0.05)} {where} at the end; "
    text += f"the centre of pressure stays {rounded(ahead, 'mm', floor=0.5)} from the toes "
    text += f"and {rounded(behind, 'mm', floor=0.5)} from the heels"
    return first_fault([
        ("tips", min(ahead, behind) < 1.0, f"The robot tips: {text}. At an edge, the sole cannot "
         "push any harder."),
        ("toes_and_short", ahead < EDGE and abs(short) > NEAR, "Too close to the toes, and the "
         f"lean does not reach its goal: {text}."),
        ("toes", ahead < EDGE, f"Too close to the toes: {text}. Braking pushes there. How does it "
         "depend on the time?"),
        ("short", short > NEAR, f"The lean does not reach its goal: {text}. Another task holds it "
         "back."),
        ("beyond", short < -NEAR, f"The lean goes too far: {text}. Nothing brakes the rest of the "
         "body."),
        ("slow", seconds > QUICK, "Everything is right, but the lean takes "
         f"{rounded(seconds, 's', digits=3)}: {text}. It can be faster."),
    ]) or Verdict(True, f"In simulation: {text}.")  # fmt: skip


def _leans() -> list[Example]:
    return [
        ((1.5, 0.01), ""), ((1.45, 0.02), ""), ((1.0, 0.1), "toes_and_short"),
        ((0.6, 0.01), "tips"), ((1.1, 0.01), "toes"),
        ((1.3, 0.1), "short"), ((3.0, 0.01), "slow"), ((-1.0, 0.1), "range"),
        ((1.0, -0.1), "range"),
    ]  # fmt: skip


EXERCISES = (
    Exercise(
        name="09.1",
        stub="pushed_at = np.zeros(2)  # replace: forwards and to the left, m",
        solution="fx, fy, fz, tx, ty, tz = sensor\npushed_at = np.array([-ty - 0.107 * fx, tx - "
        "0.107 * fy]) / fz",
        judge=NumericJudge(
            right=_pushed,
            praise="The tangential force has a lever arm equal to the height of the ankle.",
            mistakes=_pressure_mistakes,
        ),
        examples=lambda: [(np.round(_pushed(), 5), "")],
        explanation="The moments about the point below the sensor, τ - (0, 0, -h) × f, are τ_x "
        "- h f_y and τ_y + h f_x.",
    ),
    Exercise(
        name="09.2",
        stub="largest_twist = 0.0  # N·m; replace by your expression",
        solution="largest_twist = 0.6 * 400 * np.hypot(0.12, 0.05)",
        judge=_twist_judge(),
        explanation="All corners have the same lever arm. So the result is μ f_z times the "
        "distance, however they share the load.",
        own=OwnNumber(
            "the force on the sole", "N", LOAD, (320.0, 360.0, 440.0, 480.0, 520.0), _twist_judge
        ),
    ),
    Exercise(
        name="09.3",
        stub="design = np.array([1.0, 0.1])  # seconds, weight of the posture",
        solution="design = np.array([1.5, 0.01])",
        judge=_judge_lean,
        examples=_leans,
        explanation="Braking moves the centre of pressure ahead of x_c by the deceleration over "
        "ω². The deceleration falls with the square of the time. The posture is a competing "
        "task: with a tenth of its weight, the lean ends where it should.",
    ),
)
