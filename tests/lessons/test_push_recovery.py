"""Stored push-recovery maps of the lessons agree with the physics engine."""

import json
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

import floatbase as fb
from floatbase import lessons
from floatbase.errors import InputError
from floatbase.lessons import controller_factory, measured_push_recovery, plot_push_recovery

STORED = json.loads(
    (Path(lessons.__file__).parent / "push_recovery.json").read_text(encoding="utf-8")
)
# of the kept push is survived and 1 / PART of it is not, on any processor: a fall amplifies
# rounding
PART = 0.6


@pytest.mark.parametrize("lesson", sorted(STORED))
def test_the_engine_confirms_the_stored_maps(lesson):
    recovery = measured_push_recovery(lesson)
    outcomes = []
    for factor in (PART, 1 / PART):
        controller = controller_factory(lesson)()
        force = factor * recovery.pushes[2] * recovery.unit_vectors[2]
        push = fb.Push(force, 0.2, recovery.duration)
        run = fb.rollout(fb.Simulation(controller.robot), controller, 1.8, [push], 4e-3)
        outcomes.append(run.outcome)
    assert outcomes[0] == "completed" != outcomes[1]


def test_a_second_map_of_a_lesson_has_its_own_controller():
    assert controller_factory("09 standing")().stepping_gait is None
    assert controller_factory("09")().stepping_gait is not None
    assert len(plot_push_recovery("09 standing").get_lines()) == 1
    plt.close("all")


def test_unknown_maps_and_controllers_are_refused():
    with pytest.raises(InputError, match="no push-recovery map"):
        measured_push_recovery("00")
    for name in ("00", "09 flying"):
        with pytest.raises(InputError, match="no controller to push"):
            controller_factory(name)
