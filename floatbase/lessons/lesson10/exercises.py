"""Exercises of lesson 10, A horizon."""

from __future__ import annotations

from functools import cache

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.behaviours import Jump
from floatbase.errors import InputError
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import (
    Example,
    Mistake,
    NumericJudge,
    Verdict,
    array_judge,
    first_fault,
)
from floatbase.lessons.lesson08 import largest_tilt, run_go2
from floatbase.simulation import Rollout

MU = 0.6
HEIGHT, DEPTH = 0.15, 0.09  # m, of exercise 10.1
FAR, CLEAR, TILT = 580.0, 155.0, 4.0  # mm, mm, °: requirements of exercise 10.2
_DURATION = 1.6  # s, of the jump of exercise 10.2


def _push_force() -> float:
    """Compute the force of exercise 10.1 from the work that it does on the body [N]."""
    robot = fb.load("go2")
    energy = robot.weight * (DEPTH + HEIGHT)  # from the crouch to the top
    return energy / DEPTH


@cache
def run_jump(height: float, distance: float) -> Rollout:
    """Simulate a jump of go2."""
    robot = fb.load("go2")
    jump = Jump(robot, fb.Contacts.feet(robot, mu=MU), height, distance, start=0.1)
    return run_go2(jump, _DURATION)


@array_judge((2,))
def _judge_jump(given: Array) -> Verdict:
    """Judge a jump in simulation."""
    height, distance = given.tolist()
    if not (0.02 <= height <= 1.0 and 0.0 <= distance <= 2.0):
        text = "The height must be from 0.02 to 1 m, and the distance from 0 to 2 m."
        return Verdict(False, text, "range")
    try:
        record = run_jump(height, distance)
    except InputError as error:
        return Verdict(False, f"The jump is refused. {error}", "refused")
    feet = 1e3 * (record.foot_positions - record.foot_positions[0])
    far, clear = float(feet[-1, :, 0].min()), float(feet[:, :, 2].min(axis=1).max())
    tilt = largest_tilt(record)
    text = f"the feet land {far:.0f} mm ahead, all are {clear:.0f} mm up at the top, and the "
    text += f"body tilts by {tilt:.1f}°"
    return first_fault([
        ("falls", record.outcome != "completed", f"The robot falls: {text}."),
        ("short", far < FAR, f"Too short: {text}."),
        ("low", clear < CLEAR, f"Too low for the bushes: {text}."),
        ("tilts", tilt > TILT, f"The body tilts too far: {text}. Shorter flights leave less time."),
    ]) or Verdict(True, f"In simulation: {text}.")  # fmt: skip


def _jumps() -> list[Example]:
    return [
        ((0.12, 0.6), ""), ((0.6, 0.6), "refused"), ((0.05, 0.6), "refused"),
        ((0.12, 0.4), "short"), ((0.1, 0.6), "low"), ((0.18, 0.58), "tilts"),
        ((-0.1, 0.6), "range"),
    ]  # fmt: skip


def _push_off_mistakes() -> list[Mistake]:
    mass, weight = fb.load("go2").mass, fb.load("go2").weight
    return [
        ("zero", 0.0, "There is no answer yet. How fast must the body be at take-off?"),
        ("no_weight", weight * HEIGHT / DEPTH, "That is the force that accelerates the body. The "
         "ground also carries the weight."),
        ("impulse", mass * np.sqrt(2 * 9.81 * HEIGHT), "That is the impulse, N·s. Over which "
         "distance does the force act?"),
        ("inverse", weight * (1 + DEPTH / HEIGHT), "Crouch and height are swapped: a deeper crouch "
         "needs less force."),
        ("one_foot", _push_force() / 4, "That is for one foot. The question is for all four."),
        ("mass", _push_force() / 9.81, "That uses the mass instead of the weight."),
        ("both", weight * (HEIGHT + DEPTH) / HEIGHT / 2, "The work is force times crouch, not "
         "force times height."),
    ]  # fmt: skip


EXERCISES = (
    Exercise(
        name="10.1",
        stub="push_off = 0.0  # replace: N",
        solution='push_off = fb.load("go2").weight * (1 + 0.15 / 0.09)',
        judge=NumericJudge(
            right=_push_force,
            praise="The force lifts the weight through the crouch, and the rest becomes height.",
            mistakes=_push_off_mistakes,
        ),
        explanation="The work of the force in the crouch, F d, lifts the body by d + h. So F = "
        "m g (1 + h / d).",
        namespace=lambda: {"fb": fb},
    ),
    Exercise(
        name="10.2",
        stub="jump_over = np.array([0.05, 0.3])  # height, distance, m",
        solution="jump_over = np.array([0.12, 0.6])",
        judge=_judge_jump,
        examples=_jumps,
        explanation="A low jump is short, so it must be fast, and the push-off needs friction. A "
        "high jump needs fast knees. Between both, the motors suffice.",
    ),
)
