"""The push roses of the lessons: what is kept is what the physics says, and the former lesson's
lies below in grey.
"""

from __future__ import annotations

import json
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

import floatbase as fb
from floatbase import lessons
from floatbase.errors import InputError
from floatbase.lessons import (
    controller_factory,
    measured_push_recovery,
    plot_push_recovery,
)

SECOND = "09 standing"  # a second rose of a lesson's own
STORED = json.loads(
    (Path(lessons.__file__).parent / "push_recovery.json").read_text(encoding="utf-8")
)
# of the kept push is survived and 1 / PART of it is not, on any processor: a fall amplifies
# rounding
PART = 0.6


@pytest.mark.parametrize("lesson", sorted(STORED))
def test_what_is_kept_is_what_the_physics_says(lesson: str) -> None:
    recovery = measured_push_recovery(lesson)
    outcomes = []
    for factor in (PART, 1 / PART):
        controller = controller_factory(lesson)()
        push = fb.Push(
            factor * recovery.pushes[2] * recovery.unit_vectors[2],
            start=0.2,
            duration=recovery.duration,
        )
        outcomes.append(
            fb.rollout(fb.Simulation(controller.robot), controller, 1.8, [push]).outcome
        )
    assert outcomes[0] == "completed" != outcomes[1]


@pytest.mark.parametrize("lesson", [name for name in sorted(STORED) if " " not in name])
def test_the_former_lesson_is_grey_or_a_second_rose_of_the_same_robot(lesson: str) -> None:
    axis = plot_push_recovery(lesson)
    own = [name for name in STORED if name.startswith(f"{lesson} ")]
    former = own or [name for name in sorted(STORED) if name < lesson and " " not in name][-1:]
    robots = {measured_push_recovery(name).state.robot.name for name in [lesson, *former]}
    assert len(robots) == 1
    expected = [measured_push_recovery(name).pushes for name in [lesson, *former]]
    assert np.array_equal([line.get_ydata()[:-1] for line in axis.get_lines()], expected)
    plt.close(axis.figure)


def test_a_second_rose_has_a_controller_of_its_own_and_nothing_below_it() -> None:
    assert (
        controller_factory(SECOND)().stepping_gait
        is None
        is not controller_factory(SECOND.split()[0])().stepping_gait
    )
    assert len(plot_push_recovery(SECOND).get_lines()) == 1
    plt.close("all")
    with pytest.raises(InputError, match="no controller to push"):
        controller_factory("09 flying")


def test_lessons_without_a_rose_are_told() -> None:
    with pytest.raises(InputError, match="no push-recovery map"):
        measured_push_recovery("00")
    with pytest.raises(InputError, match="no controller to push"):
        controller_factory("00")
