"""Numbers as readable text: two significant digits, no rounding noise, equal on all processors."""

from __future__ import annotations

from decimal import ROUND_HALF_UP, Decimal
from typing import Any

import numpy as np

from floatbase._validation import as_integer, as_positive, as_string, numeric_copy, short_repr
from floatbase.errors import InputError

# exponents of ten that are written out; other numbers are written as 1.6e7
_PLAIN_EXPONENTS = range(-4, 6)
# fraction of an array's largest entry; a smaller entry is a zero with rounding errors
_RELATIVE_NOISE = 1e-6
# additional digits of the first rounding: 12.5, and 12.4999999 from another processor, both give 13
_GUARD_DIGITS = 4


def rounded(x: Any, unit: str = "", digits: int = 2, floor: float = 1e-6) -> str:
    """Write numbers as text with a few significant digits, such as "69 mm" or "(0.1, 0, -2) N".

    Halves are rounded away from zero. The number is first rounded to four additional digits, so
    that the last bits of a computed number do not matter: 12.4999999 is "13", like 12.5. NaN is
    "not a number", without a unit. There is no "-0".

    Parameters
    ----------
    x : array_like
        A number, or numbers of any shape, which are written as "(…, …)", row by row.
    unit : str, optional
        Unit, which is written after the number.
    digits : int, optional
        Significant digits, from 1 to 12. Trailing zeros of a fraction are omitted: 2.0 is "2".
    floor : float, optional
        Numbers below this [in `unit`] are written as "0". So are entries of an array below 1e-6 of
        its largest entry.

    Returns
    -------
    str
        The text.

    Raises
    ------
    InputError
        If `x` does not contain numbers. Truth values are not numbers.

    Examples
    --------
    >>> rounded(0.06923, "m")
    '0.069 m'
    >>> rounded([0.1, 1e-12, -2.0], "N")
    '(0.1, 0, -2) N'
    """
    unit, digits = as_string("unit", unit), as_integer("digits", digits, 1, 12)
    floor = as_positive("floor", floor, allow_zero=True)
    decimals = rounded_decimals(x, digits, floor)
    if isinstance(decimals, Decimal) and not decimals.is_finite():
        return _format_decimal(decimals)
    return _format_nested(decimals) + (unit if unit == "°" else f" {unit}" if unit else "")


def rounded_decimals(x: Any, digits: int = 2, floor: float = 1e-6) -> Any:
    """Round numbers as `rounded` does, to a decimal or to nested lists of decimals."""
    numbers = numeric_copy(x)
    if numbers is None:
        raise InputError(f"x must be a number or an array of numbers, not {short_repr(x)}.")
    largest = np.abs(numbers[np.isfinite(numbers)]).max(initial=0.0) if numbers.ndim else 0.0
    smallest = max(floor, min(floor, _RELATIVE_NOISE) * largest)
    return _round_nested(numbers.tolist(), digits, smallest)


def _round_nested(numbers: Any, digits: int, smallest: float) -> Any:
    if isinstance(numbers, list):
        return [_round_nested(part, digits, smallest) for part in numbers]
    if numbers == 0.0 or abs(numbers) < smallest:
        return Decimal(0)
    first = Decimal(f"{numbers:.{digits + _GUARD_DIGITS - 1}e}")
    if not first.is_finite():
        return first
    return first.quantize(Decimal((0, (1,), first.adjusted() - digits + 1)), ROUND_HALF_UP)


def _format_nested(decimals: Any) -> str:
    if isinstance(decimals, list):
        return f"({', '.join(map(_format_nested, decimals))})"
    return _format_decimal(decimals)


def _format_decimal(x: Decimal) -> str:
    if x.is_nan():
        return "not a number"
    if x.is_infinite():
        return "infinite" if x > 0 else "minus infinite"
    exponent = x.adjusted()
    if exponent in _PLAIN_EXPONENTS:
        return _strip_trailing_zeros(f"{x:f}")
    return f"{_strip_trailing_zeros(f'{x.scaleb(-exponent):f}')}e{exponent}"


def _strip_trailing_zeros(text: str) -> str:
    """Remove the zeros at the end of a fraction."""
    return text.rstrip("0").rstrip(".") if "." in text else text
