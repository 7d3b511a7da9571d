"""Numbers as text: two significant digits, zero below a floor, independent of the last bits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from floatbase.errors import InputError
from floatbase.lessons import rounded

LAST_BITS = 1e-7  # relative: far more than what processors differ by in a lesson's numbers
# relative: the second of two digits is off by a half at most, and the first is 1 at least
HALF_A_STEP = 0.05
SECOND_ROUNDING = 1e-5  # relative: what the first rounding, to six digits, adds


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (69.2, "69"), (157.8, "160"), (0.578, "0.58"), (1.0, "1"), (2.04, "2"), (9.96, "10"),
        (-99.6, "-100"), (5, "5"),
        (np.float32(0.1), "0.1"), (np.int64(7), "7"), (0.00012, "0.00012"), (3e-5, "3e-5"),
        (123456, "120000"),
        (1.6e7, "1.6e7"), (-1.25e6, "-1.3e6"), (1e-7, "0"), (-1e-9, "0"), (-0.0, "0"),
        (np.nan, "not a number"),
        (np.inf, "infinite"), (-np.inf, "minus infinite"), (np.array(3.0), "3"),
    ],
)  # fmt: skip
def test_a_number_has_two_digits_and_no_minus_zero(number, text):
    assert rounded(number) == text


def test_unit_digits_and_floor_can_be_chosen():
    found = rounded(69.2, "mm"), rounded(30.0, "°"), rounded(np.nan, "mm")
    assert found == ("69 mm", "30°", "not a number")
    assert (rounded(157.76, "N", digits=4), rounded(157.76, "N", digits=1)) == ("157.8 N", "200 N")
    assert (rounded(3e-14, floor=0.0), rounded(0.04, "N", floor=0.05)) == ("3e-14", "0 N")


@pytest.mark.parametrize(
    ("numbers", "text"),
    [
        ([0.1, 1e-12, -2], "(0.1, 0, -2)"), (np.array([43.4, 0.123, -0.0]), "(43, 0.12, 0)"),
        ([], "()"), ([3], "(3)"),
        (np.eye(2), "((1, 0), (0, 1))"), ([1e9, 1.0], "(1e9, 0)"),
        ([np.nan, 1.0], "(not a number, 1)"),
    ],
)  # fmt: skip
def test_small_entries_of_an_array_are_zero(numbers, text):
    assert rounded(numbers) == text


def test_an_array_without_a_floor_keeps_its_smallest_entries():
    assert rounded([1.0, 3e-14], floor=0.0) == "(1, 3e-14)"


@pytest.mark.parametrize("half", [12.5, 2.45, 0.125, 1.05, 99.5, 0.355, 1.55, -0.0655])
def test_halves_are_rounded_away_from_zero_for_all_last_bits(half):
    assert rounded(half * (1 - LAST_BITS)) == rounded(half) == rounded(half * (1 + LAST_BITS))
    assert abs(float(rounded(half))) > abs(half)


@given(st.floats(1e-3, 1e9) | st.floats(-1e9, -1e-3))
def test_the_text_is_close_to_the_number(x):
    assert float(rounded(x)) == pytest.approx(x, rel=HALF_A_STEP + SECOND_ROUNDING)
    assert float(rounded(x, digits=12)) == pytest.approx(x, rel=1e-11)  # half of the twelfth digit


@pytest.mark.parametrize("nothing", [True, [True, False], "69", None, 1j, {}, [1.0, "x"]])
def test_values_without_numbers_are_refused(nothing):
    with pytest.raises(InputError, match="must be a number or an array of numbers"):
        rounded(nothing)
