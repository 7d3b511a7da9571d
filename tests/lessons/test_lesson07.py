"""Lesson 07: its helpers do what they say, and wrong answers of each kind get the hint that fits."""

from __future__ import annotations

import re
import time
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
from hints import missed, right

import floatbase as fb
from floatbase.control import AnalyticController
from floatbase.lessons.lesson03 import standing_go2
from floatbase.lessons.lesson07 import (
    WithoutRows,
    WithRows,
    leaning,
    milliseconds,
    named,
    plot_rounds,
    plot_ways,
    pushed,
    rose_controller,
    tuned,
)
from floatbase.viewer import GREYS, hexadecimal

STATE = standing_go2().state
GO2 = STATE.robot
INNER = 0.7 * np.cos(np.pi / 4)
SIDES = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])


def rows(slope: float = INNER, first: int = 36, length: float = 1.0) -> np.ndarray:
    """Four sides of a pyramid on three columns of x."""
    G = np.zeros((4, 42))
    G[:, first : first + 3] = length * np.column_stack([SIDES, np.full(4, -slope)])
    return G


def test_07_1_knows_each_wrong_count() -> None:
    assert right("07.1", 45)
    hints = {
        24: "motors alone", 44: "lesson's own", 42: "normal forces are missing", 33: "each way", 21: "motors are missing",
        39: "Four facets, or nine motors", 30: "normal forces are missing, and", 52: "four feet", 72: "equalities",
        50: "Neither right",
    }  # fmt: skip
    assert missed("07.1", [*hints.items(), (None, "no answer yet")]) == []


@pytest.mark.parametrize("order", [[0, 1, 2, 3], [3, 1, 0, 2]])
def test_07_2_takes_rows_in_any_order_of_any_length_and_of_two_digits(order: list[int]) -> None:
    for G in (rows(), rows(length=8.0), rows(0.495), rows(0.5)):
        assert right("07.2", G[order])


def test_07_2_knows_sign_pyramid_block_and_shape() -> None:
    half = rows()
    half[2] = 0
    wrong = {
        "nothing there yet": np.zeros((4, 42)),
        "feel RR": rows(first=39),
        "feel τ": rows(first=18),
        "feel FL": rows(first=30),
        "The sign": -rows(),
        "around the cone": rows(0.7),
        "which of the two forces": rows(1 / INNER),
        "One of the four rows is zero": half,
        "radians": rows(0.7 * np.cos(45)),
        "other forces than the pyramid": rows(0.6),
        "12 columns": rows()[:, 30:],
        "3 columns": rows()[:, 36:39],
        "Five rows": np.vstack([rows(), np.eye(42)[38]]),
        "transpose": rows().T,
        "shape": np.zeros(7),
        "no answer yet": None,
    }
    assert missed("07.2", [(answer, hint) for hint, answer in wrong.items()]) == []
    lean, up = rows(), rows()
    lean[0], up[0] = lean[2], up[0] * np.where(np.arange(42) == 38, -1, 1)
    assert missed("07.2", [(lean, "as far as it likes"), (up, "straight up is forbidden")]) == []


def test_07_3_predicts_from_prices_and_knows_sign_factor_and_force() -> None:
    solution = fb.solve(leaning(0.5).qp(STATE))
    f = solution["forces"].reshape(4, 3)
    names = standing_go2().contacts.names
    prices = [(names.index(row.owner), price) for row, price in solution.multipliers.items()]  # type: ignore[attr-defined]

    def change(of: Any, cos: float = np.pi / 8, more: float = 0.005) -> float:
        return -sum(price * of[i] * np.cos(cos) * more for i, price in prices)

    assert right("07.3", change(f[:, 2])) and right("07.3", round(change(f[:, 2]), 3))
    again = fb.solve(leaning(0.505).qp(STATE)).objective - solution.objective
    assert again == pytest.approx(change(f[:, 2]), rel=0.02) and again < 0
    wrong = {
        "The sign": -change(f[:, 2]),
        "factor of the facets is missing": change(f[:, 2], cos=0.0),
        "of 4 facets": change(f[:, 2], cos=np.pi / 4),
        "of its own foot": change(np.full(4, f[:, 2].sum())),
        "normal forces are missing": change(np.ones(4)),
        "how far it leans": change(np.hypot(f[:, 0], f[:, 1])),
        "Δμ = 1": change(f[:, 2], more=1.0),
        "Δμ = 0.01": change(f[:, 2], more=0.01),
        "nothing there yet": 0.0,
        "no answer yet": None,
        "Neither right": 17.0,
    }
    assert missed("07.3", [(answer, hint) for hint, answer in wrong.items()]) == []


@pytest.mark.parametrize("design", [(400, 80, 10, 1e-3), (400, 70, 10, 1e-3), (500, 90, 30, 1e-3)])
def test_07_4_takes_designs_that_do_it_on_the_physics(design: tuple[float, ...]) -> None:
    assert right("07.4", design)


def test_07_4_knows_what_is_wrong_with_a_design() -> None:
    wrong = {
        "and a foot strays": (100, 20, 10, 1e-3),
        "does not come back": (25, 10, 10, 1e-3),
        "creeps home": (0, 80, 10, 1e-3),
        "does not last": (10, 1, 1, 1e-3),
        "A foot strays": (1e5, 20, 10, 1e-3),
        "are not negative": (100, -20, 10, 1e-3),
        "needs a weight": (100, 20, 0, 1e-3),
        "shape": (100, 20),
        "no answer yet": None,
    }
    assert missed("07.4", [(answer, hint) for hint, answer in wrong.items()]) == []


def test_standing_gains_are_those_of_the_standing_tasks() -> None:
    qp, same = tuned(100, 20, 10, 1e-3).qp(STATE), rose_controller().qp(STATE)
    assert np.array_equal(qp.H, same.H) and np.array_equal(qp.g, same.g)


def test_rows_are_taken_away_and_added() -> None:
    stands = rose_controller()
    full, same = stands(STATE.q, STATE.v), WithoutRows(stands, "normal force")(STATE.q, STATE.v, 0.0)
    np.testing.assert_allclose(same.tau, full.tau, atol=1e-6)
    costs = AnalyticController(GO2, standing_go2().contacts, STATE)
    alone, within = costs(STATE.q, STATE.v), WithRows(costs, stands)(STATE.q, STATE.v, 0.0)
    np.testing.assert_allclose(within.tau, alone.tau, atol=1e-6)  # where it stands no row is active
    hurried = STATE.replace(v=np.eye(18)[1] * 1.5)  # to the left, 1.5 m/s
    pulls = costs(hurried.q, hurried.v).forces[2::3].min()
    planned = WithRows(costs, stands)(hurried.q, hurried.v, 0.0).forces
    assert planned is not None and pulls < -1 < -1e-6 < planned[2::3].min()


def test_a_push_goes_to_the_left_for_a_tenth_of_a_second() -> None:
    record = pushed(rose_controller(), 30.0, 0.4)
    (push,) = record.pushes
    assert np.array_equal(push.force, [0, 30, 0]) and (push.start, push.duration) == (0.05, 0.1)
    assert record.com[150, 1] - record.com[40, 1] > 1e-3 and record.outcome == "completed"


def test_a_note_names_the_dearest_rows_first() -> None:
    assert named(rose_controller()(STATE.q, STATE.v).solution) == "no row has a price"
    solution = fb.solve(leaning(0.5).qp(STATE))
    note = named(solution)
    prices = [float(text) for text in re.findall(r"facet \d ([\d.]+)", note)]
    assert prices == sorted(prices, reverse=True) and len(prices) == len(solution.active) == 4


def test_pictures_show_what_they_are_given() -> None:
    figure: Any = plot_rounds([0, 1, 2], {"cold": [3, 4, 5], "warm": [1, 1, 1]})
    assert [line.get_ydata().tolist() for line in figure.axes[0].lines] == [[3, 4, 5], [1, 1, 1]]
    record = pushed(rose_controller(), 60.0, 0.3)
    ways: Any = plot_ways({"one": record})
    com, feet = ways.axes
    assert com.lines[0].get_ydata().max() == pytest.approx(
        1e3 * np.linalg.norm((record.com - record.com[0])[:, :2], axis=1).max()
    )
    assert feet.lines[0].get_ydata().max() == pytest.approx(1e3 * record.slip().max())
    lines = [line for drawn in (figure, ways) for axis in drawn.axes for line in axis.lines]
    assert {line.get_color() for line in lines} <= {hexadecimal(grey) for grey in GREYS}
    plt.close("all")


def test_milliseconds_are_milliseconds() -> None:
    assert 2.0 <= milliseconds(lambda: time.sleep(0.002), 3) < 50.0
