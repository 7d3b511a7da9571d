"""Lesson P: its runs are what they say, and can be plotted."""

import judges
import numpy as np
import pytest

from floatbase.lessons.lessonP import BAG_MASS, com_sag, time_on_two_feet

GO2 = judges.load("go2")
FORMULA = 0.07  # of what a spring says: legs have masses of their own


@pytest.mark.parametrize("kp", [100.0, 400.0, 1000.0])
def test_an_unknown_mass_lowers_the_centre_of_mass_like_a_spring(kp):
    assert com_sag(kp) == pytest.approx(BAG_MASS / GO2.mass * 9.81 / kp, rel=FORMULA)
    assert com_sag(kp, 0.0) == pytest.approx(0.0, abs=1e-5)


def _shift():
    """By the formula for the foot of a plumb line on a line through two points."""
    state = GO2.standing()
    feet = state.point("FL_foot"), state.point("RR_foot")
    (x1, y1, _), (x2, y2, _), (x0, y0, _) = *feet, state.com
    a, b, c = y1 - y2, x2 - x1, x1 * y2 - x2 * y1
    return -(a * x0 + b * y0 + c) / (a**2 + b**2) * np.array([a, b, 0.0])


def test_the_answer_of_p_2_keeps_the_robot_up_for_longest():
    shift = _shift()
    best = time_on_two_feet(shift)
    assert best > 1.0 > 0.2 + time_on_two_feet(-shift) and best > 1.3 * time_on_two_feet(
        np.zeros(3)
    )
    assert best > 1.2 * time_on_two_feet(2 * shift)
