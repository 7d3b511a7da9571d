"""Panels of sliders: a slider starts where it was told to, and the number it shows is the number that is computed with."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

import floatbase as fb
from floatbase.lessons import slider_panel

RANGES = [
    (-6.0, 2.0, 6.0, 0.2), (-40.0, 30.0, 40.0, 1.0), (-1.5, -0.7, 1.5, 0.05), (0.0, 1.5, 4.0, 0.05), (0, 60, 80, 1.0),
    (0.0, 0.5, 1.0, 0.02), (0.0, 60.0, 120.0, 2.0), (-8, 0.5, 8, 0.1), (-5, -5, 0, 0.1), (0, 0.003, 0.01, 0.0002),
    (0, 250, 5000, 50.0), (-180.0, 0.0, 180.0, 5.0),
]  # fmt: skip


@pytest.fixture(scope="module")
def view() -> Iterator[fb.Viewer]:
    made = fb.Viewer(fb.load("ur5"))
    yield made
    made.close()


def panel(view: fb.Viewer, low: float, first: float, high: float) -> tuple[Any, list[float]]:
    """The slider of a panel that has one, and the values that its picture was drawn for."""
    drawn: list[float] = []
    return slider_panel(view, lambda x: drawn.append(x), x=(low, first, high)).children[2], drawn


@pytest.mark.parametrize(("low", "first", "high", "step"), RANGES)
def test_a_slider_goes_in_round_steps_through_its_first_value(
    view: fb.Viewer, low: float, first: float, high: float, step: float
) -> None:
    slider, drawn = panel(view, low, first, high)
    assert slider.step == pytest.approx(step, rel=1e-12)
    for bound in (low, first, high):
        assert (bound - low) / step == pytest.approx(round((bound - low) / step), abs=1e-6)
        assert float(format(bound, slider.readout_format)) == bound
    assert drawn == [first]


@pytest.mark.parametrize(("low", "first", "high", "step"), RANGES)
def test_what_a_slider_shows_is_what_is_computed_with(
    view: fb.Viewer, low: float, first: float, high: float, step: float
) -> None:
    slider, drawn = panel(view, low, first, high)
    for i in range(60):
        slider.value = min(low + i * slider.step, high)  # as a browser adds them up
        assert format(drawn[-1], slider.readout_format) == format(slider.value, slider.readout_format)
        assert drawn[-1] == round(drawn[-1], 4)
    assert len(drawn) > 50


def test_bounds_that_are_not_round_get_a_fine_step(view: fb.Viewer) -> None:
    slider, drawn = panel(view, 0.0, 2.0 / 3.0, 3.14159)
    assert slider.step <= 1e-4
    assert drawn[0] == pytest.approx(2.0 / 3.0, abs=1e-4)


def test_a_range_with_no_width_does_not_fail(view: fb.Viewer) -> None:
    assert panel(view, 2.0, 2.0, 2.0)[1] == [2.0]
