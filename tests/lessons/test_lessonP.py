"""Lesson P: its runs are what they say, and can be plotted."""

from __future__ import annotations

from dataclasses import replace

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.lessons.lessonP import BAG, on_two_feet, plot_gains, plot_outcomes, sinks
from floatbase.playground import CARDS, Session, Settings

GO2 = judges.load("go2")
FORMULA = 0.07  # of what a spring says: legs have masses of their own


@pytest.mark.parametrize("kp", [100.0, 400.0, 1000.0])
def test_an_unknown_bag_stretches_the_spring(kp: float) -> None:
    assert sinks(kp) == pytest.approx(BAG / GO2.mass * 9.81 / kp, rel=FORMULA)
    assert sinks(kp, 0.0) == pytest.approx(0.0, abs=1e-5)


def _shift() -> np.ndarray:
    """By the formula for the foot of a plumb line on a line through two points."""
    state = GO2.standing()
    (x1, y1, _), (x2, y2, _), (x0, y0, _) = state.point("FL_foot"), state.point("RR_foot"), state.com
    a, b, c = y1 - y2, x2 - x1, x1 * y2 - x2 * y1
    return -(a * x0 + b * y0 + c) / (a**2 + b**2) * np.array([a, b, 0.0])


def test_it_stays_up_on_two_feet_for_longest_where_p_2_puts_it() -> None:
    shift = _shift()
    best = on_two_feet(shift)
    assert best > 1.0 > 0.2 + on_two_feet(-shift) and best > 1.3 * on_two_feet(np.zeros(3))
    assert best > 1.2 * on_two_feet(2 * shift)


def test_p_2_solves_the_first_challenge() -> None:
    x, y, _ = _shift()
    card = CARDS[0]
    session, judge = Session(GO2, replace(card.start, shift=(x, y, 0.0))), card.judge()
    for seconds, changes in ((1.0, {}), (2.4, {"lifted": ("FR_foot", "RL_foot")})):
        session.change(**changes)
        for _ in range(round(seconds / 0.032)):
            record = fb.rollout(session.sim, session.controller, 0.032, control_period=4e-3)
            session.see(record)
            judge.see(record, session)
    assert judge.won, judge.says


def test_outcomes_are_plotted_where_they_belong() -> None:
    stands, falls = (
        fb.rollout(session.sim, session.controller, 0.4, control_period=4e-3)
        for session in (Session(GO2), Session(GO2, Settings(believed_off=("zeros",))))
    )
    assert (stands.outcome, falls.outcome) == ("completed", "fell")
    axis = plot_outcomes({(0.1, 0.2): stands, (0.3, 0.2): falls}, "friction")
    said = {text.get_position(): text.get_text() for text in axis.texts}
    assert said == {(0, 0): "stands", (0, 1): "0.2 s"}
    assert [label.get_text() for label in axis.get_yticklabels()] == ["0.1", "0.3"]


def test_gains_that_fall_are_crosses_above_all_others() -> None:
    axis = plot_gains((100.0, 400.0, 900.0), (20.0, 10.0, float("inf")), 800.0)
    dots, crosses, border = axis.get_lines()
    assert np.asarray(dots.get_xydata()).tolist() == [[100.0, 20.0], [400.0, 10.0]]
    (at, high), *_ = np.asarray(crosses.get_xydata())
    assert at == 900.0 and high > 20.0
    assert np.all(np.asarray(border.get_xdata()) == 800.0)
