"""Checked, read-only arrays: what every value of the package is made of."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from floatbase.errors import InputError

Array: TypeAlias = npt.NDArray[np.floating[Any]]
_NO_LENGTH = 1e-9  # a vector shorter than this is zero but for rounding, and has no direction


def read_only(value: Any) -> Array:
    """A float64 copy of `value` that cannot be written to."""
    array = np.array(value, dtype=np.float64)
    array.flags.writeable = False
    return array


def checked(name: str, value: Any, shape: tuple[int | None, ...], unit: str = "") -> Array:
    """A read-only copy of `value`, after checking that it has `shape` (None = any length) and is finite.

    Raises `InputError` with the name, the shape found and the shape required.
    """
    try:
        array = read_only(value)
    except (TypeError, ValueError):
        required = f"numbers of shape {_text(shape)}" if shape else "a number"
        raise InputError(f"{name} must be {required}, not {value!r}.") from None
    if array.shape != shape and not _fits(array.shape, shape):
        raise InputError(f"{name} has shape {array.shape}; it must have shape {_text(shape)}{f' ({unit})' if unit else ''}.")
    # the sum of squares is finite where all entries are, but for huge ones, and ten times faster
    if not np.vdot(array, array) < np.inf and not np.all(np.isfinite(array)):
        where = np.argwhere(~np.isfinite(array))[0].tolist()
        raise InputError(f"{name} holds {array[tuple(where)]} at index {where}; every entry must be a finite number.")
    return array


def _fits(have: tuple[int, ...], shape: tuple[int | None, ...]) -> bool:
    return len(have) == len(shape) and all(n is None or one == n for one, n in zip(have, shape, strict=True))


def positive(name: str, value: Any, unit: str = "", allow_zero: bool = False) -> float:
    """`value` as a float, after checking that it is a finite number above zero (or not below, with `allow_zero`)."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be a number, not {value!r}.") from None
    if not np.isfinite(number) or number < 0 or (number == 0 and not allow_zero):
        bound = "≥ 0" if allow_zero else "> 0"
        raise InputError(f"{name} is {number:g}; it must be {bound}{' ' + unit if unit else ''}.")
    return number


def unit_vector(name: str, value: Any) -> Array:
    """`value` scaled to unit length, shape (3,); a zero vector is an `InputError`."""
    vector = checked(name, value, (3,))
    length = float(np.linalg.norm(vector))
    if length < _NO_LENGTH:
        raise InputError(f"{name} is the zero vector; it must have a direction.")
    return read_only(vector / length)


def cross(a: Array, b: Array) -> Array:
    """a × b of two vectors, shape (3,); numpy's own takes twenty times as long on three numbers."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _text(shape: tuple[int | None, ...]) -> str:
    return str(tuple(n if n is None else int(n) for n in shape)).replace("None", "any")
