"""Numbers as a reader wants them: two significant digits, zero below a floor, and the same on every
processor.
"""

from __future__ import annotations

from decimal import ROUND_HALF_UP, Decimal
from typing import Any

import numpy as np

from floatbase._validation import as_integer, as_positive, as_string, numeric_copy, short_repr
from floatbase.errors import InputError

_PLAIN_EXPONENTS = range(
    -4, 6
)  # exponents of ten that are written out; larger and smaller numbers are written as 1.6e7
# of an array's largest entry: a smaller one is what rounding has left of a zero
_RELATIVE_NOISE = 1e-6
# digits more that are rounded to first: 12.5 and what another processor makes of it, 12.4999999,
# both give 13
_GUARD_DIGITS = 4


def rounded(x: Any, unit: str = "", digits: int = 2, floor: float = 1e-6) -> str:
    """Numbers as text, each with so many significant digits: "69 mm", "(0.1, 0, -2) N". There is no
    "-0".

    x: a number, or an array or list of numbers of any shape, which become "(…, …)", row by row.
    unit: is written behind it.
    digits: significant ones, from 1 to 12; zeros at the end of a fraction are left out, so that 2.0
        is "2".
    floor: what is smaller than this is "0"; in an array so is an entry below 1e-6 of the largest.

    Halves are rounded away from zero, after a first rounding to four digits more, so that the last
    bits of a computed number decide nothing: 12.4999999 is "13" as 12.5 is. NaN is "not a number",
    without unit.

    Raises `InputError` for what holds no numbers, such as truth values: say what the number is that
    decides.
    """
    numbers = numeric_copy(x)
    if numbers is None:
        raise InputError(f"x must be a number or an array of numbers, not {short_repr(x)}.")
    unit, digits = as_string("unit", unit), as_integer("digits", digits, 1, 12)
    floor = as_positive("floor", floor, allow_zero=True)
    finite = np.abs(numbers[np.isfinite(numbers)])
    if numbers.ndim == 0 and not finite.size:
        return _format_scalar(float(numbers), digits, 0.0)
    smallest = (
        max(floor, min(floor, _RELATIVE_NOISE) * finite.max(initial=0.0)) if numbers.ndim else floor
    )
    return _format_nested(numbers.tolist(), digits, smallest) + (
        unit if unit == "°" else f" {unit}" if unit else ""
    )


def _format_nested(numbers: Any, digits: int, smallest: float) -> str:
    if isinstance(numbers, list):
        return f"({', '.join(_format_nested(part, digits, smallest) for part in numbers)})"
    return _format_scalar(numbers, digits, smallest)


def _format_scalar(x: float, digits: int, smallest: float) -> str:
    if np.isnan(x):
        return "not a number"
    if np.isinf(x):
        return "infinite" if x > 0 else "minus infinite"
    if x == 0.0 or abs(x) < smallest:
        return "0"
    first = Decimal(f"{x:.{digits + _GUARD_DIGITS - 1}e}")
    quantized = first.quantize(Decimal((0, (1,), first.adjusted() - digits + 1)), ROUND_HALF_UP)
    exponent = quantized.adjusted()
    if exponent in _PLAIN_EXPONENTS:
        return _strip_trailing_zeros(f"{quantized:f}")
    return f"{_strip_trailing_zeros(f'{quantized.scaleb(-exponent):f}')}e{exponent}"


def _strip_trailing_zeros(text: str) -> str:
    """Without the zeros at the end of a fraction."""
    return text.rstrip("0").rstrip(".") if "." in text else text
