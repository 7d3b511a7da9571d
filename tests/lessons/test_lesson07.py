"""Lesson 07: its helpers do what they say."""

from __future__ import annotations

import re
import time
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import floatbase as fb
from floatbase.lessons.lesson03 import standing_go2_eom
from floatbase.lessons.lesson07 import (
    leaning_controller,
    make_controller,
    median_time_ms,
    multiplier_text,
    plot_one_foot,
    run_with_push,
    tuned_controller,
)

STATE = standing_go2_eom().state
GO2 = STATE.robot


def test_standing_gains_are_those_of_the_standing_tasks() -> None:
    qp, same = tuned_controller(100, 20, 10, 1e-3).qp(STATE), make_controller().qp(STATE)
    assert np.array_equal(qp.H, same.H) and np.array_equal(qp.g, same.g)


def test_a_push_goes_to_the_left_for_a_tenth_of_a_second() -> None:
    record = run_with_push(make_controller(), 30.0, 0.4)
    (push,) = record.pushes
    assert np.array_equal(push.force, [0, 30, 0]) and (push.start, push.duration) == (0.05, 0.1)
    assert record.com[150, 1] - record.com[40, 1] > 1e-3 and record.outcome == "completed"


def test_a_note_names_the_constraints_with_the_largest_multipliers_first() -> None:
    assert (
        multiplier_text(make_controller()(STATE.q, STATE.v).solution)
        == "no constraint has a multiplier above zero"
    )
    solution = fb.solve(leaning_controller(0.5).qp(STATE))
    note = multiplier_text(solution)
    prices = [float(text) for text in re.findall(r"([\d.]+) \(\w+ facet \d\)", note)]
    assert prices == sorted(prices, reverse=True) and len(prices) == len(solution.active) == 4


def test_the_force_of_one_foot_lies_in_the_corner_of_two_constraints() -> None:
    axes: Any = plot_one_foot()
    dot = next(line for line in axes.lines if line.get_marker() == "o")
    assert np.allclose(dot.get_xydata(), [[30.0, 60.0]])
    plt.close("all")


def test_milliseconds_are_milliseconds() -> None:
    assert 2.0 <= median_time_ms(lambda: time.sleep(0.002), 3) < 50.0
