"""Exercises of lesson 00, Start here."""

from __future__ import annotations

from functools import cache

import numpy as np

import floatbase as fb
from floatbase.lessons.exercises import Exercise, OwnNumber
from floatbase.lessons.judges import Mistake, NumericJudge
from floatbase.robots import Robot

UP = 2.0  # m/s², the requested acceleration


@cache
def _go2() -> Robot:
    return fb.load("go2")


@cache
def _sum_of_forces(up: float = UP) -> float:
    """Compute the vertical contact force from M q̈ + h, with neither the mass nor the weight."""
    state = _go2().standing()  # its base is level, so the third row is vertical
    qdd = np.zeros(_go2().nv)
    qdd[2] = up
    return float((state.M @ qdd + state.h)[2])


def _mistakes(up: float) -> list[Mistake]:
    mass, weight, g = _go2().mass, _go2().weight, _go2().gravity
    return [
        ("weight_alone", weight, "That is the weight alone. With this force the robot stays at "
         "rest or keeps its velocity."),
        ("ma_alone", up * mass, "That is m a, the sum of all forces on the robot. Is the "
         "ground's force the only one?"),
        ("downwards", weight - up * mass, "With this force the robot would accelerate "
         "downwards. Draw both forces. Which one is larger?"),
        ("acceleration", g + up, "That is an acceleration, in m/s². A force needs the "
         "mass."),
        ("mass_on_g_alone", weight + up, "The weight is right. Multiply the acceleration by the "
         "mass before you add it."),
        ("g_without_mass", up * mass + g, "m a is right, but g without the "
         "mass is not a force."),
        ("g_is_10", (10.0 + up) * mass, "That uses g = 10 m/s². The simulation uses 9.81 "
         "m/s²."),
        ("one_foot", _sum_of_forces(up) / 4, "That is the mean force at one foot. The question is "
         "about all feet."),
        ("reaction", -_sum_of_forces(up), "That is the force of the robot on the ground. The "
         "answer is the force of the ground on the robot."),
    ]  # fmt: skip


def _judge(up: float) -> NumericJudge:
    """Return the judge for an upward acceleration [m/s²]."""
    return NumericJudge(
        right=lambda: _sum_of_forces(up),
        tolerance=2e-3,  # g may be 9.8
        praise="The ground carries the weight and accelerates the mass: m (g + a).",
        mistakes=lambda: _mistakes(up),
    )


EXERCISES = (
    Exercise(
        name="00.1",
        stub="total = 100.0  # N: replace this number by an expression",
        solution="total = robot.mass * (robot.gravity + 2.0)",
        judge=_judge(UP),
        examples=lambda: [(_go2().mass * (9.8 + UP), "")],
        explanation="By Newton's law, the vertical forces of the ground minus the weight equal "
        "mass times acceleration. So their sum is m g + m a.",
        own=OwnNumber("the acceleration", "m/s²", UP, (1.2, 1.4, 1.6, 2.4, 2.6, 2.8), _judge),
    ),
)
