"""Exercises of lesson 00, Start here."""

from __future__ import annotations

from functools import cache

import floatbase as fb
from floatbase.lessons.exercises import Exercise, Numeric
from floatbase.robots import Robot


@cache
def _go2() -> Robot:
    return fb.load("go2")


def _weight_of_links() -> float:
    """The weight, link by link: not by `robot.weight`."""
    return 9.81 * sum(inertia.mass for inertia in _go2().model.inertias)


EXERCISES = (
    Exercise(
        name="00.1",
        statement="go2 stands still. How large is the sum of the vertical forces that the ground exerts on its feet, in N?",
        stub="total = 100.0  # N: replace this number by an expression with robot.mass",
        solution="total = robot.mass * 9.81",
        judge=Numeric(
            right=_weight_of_links,
            tolerance=2e-3,  # g may be 9.8
            praise="Standing still means no vertical acceleration, so the ground carries exactly the weight.",
            mistakes={
                "That is a mass in kg; a force needs one more factor.": lambda: _go2().mass,
                "That takes g as 10 m/s²; the physics here has 9.81.": lambda: 10 * _go2().mass,
                "That is the share of one foot, on average; the question is about all feet.": lambda: _weight_of_links() / 4,
                "That is what the robot does to the ground; the answer is what the ground does to the robot.": lambda: (
                    -_weight_of_links()
                ),
            },
        ),
        explanation="Newton: the vertical forces of the ground minus the weight give mass times vertical acceleration, and "
        "that is zero.",
    ),
)
