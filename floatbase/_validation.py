"""Argument checks, read-only arrays, and `Value`, the base of all immutable classes."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Sequence
from dataclasses import FrozenInstanceError, fields
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any, Self, TypeAlias, TypeGuard, TypeVar, overload

import numpy as np
import numpy.typing as npt

from floatbase.errors import MAX_REPR, InputError
from floatbase.errors import short_repr as short_repr  # with the checks, for other modules

Array: TypeAlias = npt.NDArray[np.floating[Any]]
T = TypeVar("T")
_FLOAT64 = np.dtype(np.float64)
# no quantity of a robot in SI units comes near it, and a product of ten such numbers is finite
MAX_MAGNITUDE = 1e30
_MIN_POSITIVE = 1.0 / MAX_MAGNITUDE  # a smaller positive number has a quotient that is too large
_ZERO_NORM = 1e-9  # a shorter vector is zero up to rounding and has no direction


class cached_property(functools.cached_property[T]):
    """A property computed on first use and then kept; threads that compete get the first result.

    No lock is taken, unlike in functools of Python 3.11. A value computes the same result
    every time, and a lock that another thread holds during a fork is never released in the child.
    """

    @overload
    def __get__(self, value: None, owner: type | None = None) -> Self: ...
    @overload
    def __get__(self, value: object, owner: type | None = None) -> T: ...
    def __get__(self, value: object, owner: type | None = None) -> Self | T:
        if value is None:
            return self
        computed: T = value.__dict__.setdefault(self.attrname, self.func(value))  # type: ignore[arg-type]  # it has a name
        return computed


class Value:
    """Base of immutable classes: a copy is the object itself, and arrays stay read-only in pickles.

    Pickles leave out cached properties, which are computed again on demand.
    """

    def __post_init__(self) -> None:
        """Check and convert each field that declares a check with `checked`."""
        cls: Any = type(self)
        for name, check in _field_checks(cls):
            value = check(f"{name} of {self._label()}", getattr(self, name))
            object.__setattr__(self, name, value)

    def _label(self) -> str:
        """Return the name of this value in messages about its fields."""
        return type(self).__name__

    def __setattr__(self, name: str, value: object) -> None:
        raise FrozenInstanceError(
            f"Cannot assign to field {name!r}: {type(self).__name__} is immutable. Make a changed "
            f"copy with replace()."
        )

    def __delattr__(self, name: str) -> None:
        raise FrozenInstanceError(
            f"Cannot delete field {name!r}: {type(self).__name__} is immutable."
        )

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: object) -> Self:
        return self

    def __getstate__(self) -> dict[str, Any]:
        computed = {
            name
            for name in vars(self)
            if isinstance(getattr(type(self), name, None), functools.cached_property)
        }
        # a field here, but computed by a base class
        computed -= set(getattr(self, "__dataclass_fields__", ()))
        kept = {name: value for name, value in vars(self).items() if name not in computed}
        return {
            name: dict(value) if isinstance(value, MappingProxyType) else value
            for name, value in kept.items()
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            for array in value.values() if type(value) is dict else [value]:
                if isinstance(array, np.ndarray):
                    array.flags.writeable = False
            object.__setattr__(
                self, name, MappingProxyType(value) if type(value) is dict else value
            )


def refuse_new_attributes(self: object, name: str, value: object) -> None:
    """Set an attribute, as `__setattr__` of a class whose public attributes are properties.

    Any other public name raises `AttributeError`: a misspelled one would be set and never read.
    Classes derived from such a class may set further attributes.
    """
    cls = type(self)
    if not name.startswith("_") and not hasattr(cls, name) and "__setattr__" in vars(cls):
        public = [known for known in dir(cls) if not known.startswith("_")]
        near = "".join(f" Did you mean {known!r}?" for known in get_close_matches(name, public, 1))
        raise AttributeError(f"A {cls.__name__} has no attribute {name!r} to set.{near}")
    object.__setattr__(self, name, value)


def checked(check: Callable[..., Any], *args: Any, **options: Any) -> dict[str, Any]:
    """Return field metadata that declares the check `check(name, value, *args, **options)`.

    For example `force: Array = field(metadata=checked(as_array, (3,), "N"))`.
    `Value.__post_init__` runs the checks in the order of the fields and stores what they return.
    """

    def check_field(name: str, value: Any) -> Any:
        return check(name, value, *args, **options)

    return {"check": check_field}


@functools.cache
def _field_checks(cls: Any) -> tuple[tuple[str, Callable[[str, Any], Any]], ...]:
    """Return name and check of each field of a dataclass that declares a check."""
    return tuple(
        (field.name, field.metadata["check"]) for field in fields(cls) if "check" in field.metadata
    )


def as_instance(name: str, value: object, cls: type[T], example: str = "") -> T:
    """Return `value` after checking that it is an instance of `cls`.

    `example` shows in the message how to get one; the default is the `_example` of the class.
    """
    if isinstance(value, cls):
        return value
    example = example or getattr(cls, "_example", "")
    raise InputError(
        f"{name} must be of type {cls.__name__}{f', such as {example}' if example else ''}, "
        f"not {short_repr(value)}."
    )


def as_string(name: str, value: object) -> str:
    """Return `value` after checking that it is a string that files and pages can hold."""
    if not isinstance(value, str):
        raise InputError(f"{name} must be a string, not {short_repr(value)}.")
    if not _is_storable(value):
        raise InputError(
            f"{name} is {short_repr(value)}, but it must not contain null characters or unpaired "
            f"surrogates."
        )
    return value


def _is_storable(text: str) -> bool:
    """Return whether a string has a UTF-8 encoding without null characters."""
    try:
        return b"\0" not in text.encode()
    except UnicodeEncodeError:  # unpaired surrogates
        return False


def as_strings(name: str, value: Any) -> tuple[str, ...]:
    """Return `value` as a tuple after checking that it is a list of strings, not one string."""
    is_list = isinstance(value, Sequence) and not isinstance(value, str)
    if is_list and all(isinstance(entry, str) for entry in value):
        return tuple(as_string(f"an entry of {name}", entry) for entry in value)
    example = value if isinstance(value, str) and len(value) <= MAX_REPR else "…"
    raise InputError(
        f'{name} must be a list of strings, such as ["{example}"], not {short_repr(value)}.'
    )


def as_bool(name: str, value: object) -> bool:
    """Return `value` as a bool after checking that it is one, since "no" would count as true."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    raise InputError(f"{name} must be True or False, not {short_repr(value)}.")


def as_callable(name: str, value: Any, usage: str) -> Any:
    """Return `value` after checking that it can be called as `usage`, such as "rows(state, t)"."""
    if not callable(value) or isinstance(value, type):
        raise InputError(
            f"{name} must be a function that can be called as {usage}, not {short_repr(value)}."
        )
    arguments = [part for part in usage.partition("(")[2].strip(")").split(",") if part]
    if error := signature_error(value, *arguments):
        raise InputError(f"{name} must be a function that can be called as {usage}, but {error}.")
    return value


def signature_error(function: Any, *args: object, **kwargs: object) -> str:
    """Return why a function cannot take these arguments, or "" if it can or has no signature."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return ""
    try:
        signature.bind(*args, **kwargs)
    except TypeError as error:
        function_name = getattr(function, "__name__", type(function).__name__)
        return f"the signature of {function_name} is {signature}: {error}"
    return ""


def as_integer(name: str, value: Any, minimum: int, maximum: int, reason: str = "") -> int:
    """Return `value` as an int after checking its bounds; `reason` explains them in the message."""
    is_number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(
        value, bool
    )
    if is_number and minimum <= value <= maximum and value == int(value):
        return int(value)
    raise InputError(
        f"{name} is {short_repr(value)}, but it must be an integer from {minimum} to {maximum}"
        + (f" ({reason})." if reason else ".")
    )


def read_only(value: Any) -> Array:
    """Return `value` as a read-only float64 array: a copy, unless it already is one.

    Read-only arrays are trusted and not copied: numpy cannot report earlier, writable views of
    them.
    """
    if _is_read_only(value):
        return value
    return frozen(np.array(value, dtype=np.float64))


def frozen(array: Array) -> Array:
    """Make an array read-only in place; nothing else may hold a reference to it."""
    array.setflags(write=False)
    return array


def _is_read_only(value: Any) -> TypeGuard[Array]:
    """Return whether `value` is a contiguous, read-only float64 array without a writable base."""
    if (
        type(value) is not np.ndarray
        or value.dtype is not _FLOAT64
        or (flags := value.flags).writeable
    ):
        return False
    base = value.base
    return flags.c_contiguous and (
        base is None or (type(base) is np.ndarray and not base.flags.writeable)
    )


def numeric_copy(value: Any) -> Array | None:
    """Return a float64 copy of real numbers, and None for anything else.

    Complex or masked numbers, strings, bytes, booleans, dates and objects give None.
    """
    if type(value) is np.ndarray and value.dtype is _FLOAT64:
        return value.copy("K")  # the most frequent case, and in the control loop
    try:
        array = np.array(value)
    except Exception:  # ragged rows, or a class whose conversion fails
        return None
    if array.dtype.kind not in "fiu" or isinstance(value, np.ma.MaskedArray | bytearray):
        return None
    return array.astype(np.float64, copy=False)


def as_array(name: str, value: Any, shape: tuple[int | None, ...], unit: str = "") -> Array:
    """Return `value` as a read-only array after checking its shape (None = any length) and entries.

    All entries must be finite real numbers of magnitude at most `MAX_MAGNITUDE`.
    """
    array = value if _is_read_only(value) else numeric_copy(value)
    if array is None:
        required = f"numbers of shape {_shape_str(shape)}" if shape else "a number"
        raise InputError(
            f"{name} must be {required}{f' [{unit}]' if unit else ''}, not {short_repr(value)}."
        )
    if array.shape != shape and not _shape_matches(array.shape, shape):
        required = f"have shape {_shape_str(shape)}" if shape else "be a single number"
        hint = ""
        if array.ndim == 1 and shape[:-1] in ((None,), (1,)):
            hint = " To select a single row, write rows[:1] instead of rows[0]."
        raise InputError(
            f"{name} has shape {array.shape}, but it must "
            f"{required}{f' [{unit}]' if unit else ''}.{hint}"
        )
    # testing the sum of squares takes a third of the time and is False for NaN too; if the sum is
    # larger, the entries decide
    if not (
        np.vdot(array, array) <= MAX_MAGNITUDE**2
        or (bounded := np.abs(array) <= MAX_MAGNITUDE).all()
    ):
        at = tuple(np.argwhere(~bounded)[0].tolist())
        place = f"is {array[at]:g}, but it must be"
        if shape:
            place = f"contains {array[at]:g} at index {list(at)}, but every entry must be"
        raise InputError(
            f"{name} {place} a finite "
            f"number{f' of magnitude at most {MAX_MAGNITUDE:g}' if np.isfinite(array[at]) else ''}."
        )
    return array if array is value else frozen(array)


def _shape_matches(found: tuple[int, ...], shape: tuple[int | None, ...]) -> bool:
    """Return whether a shape has the required lengths; None allows any length."""
    for size, required in zip(found, shape, strict=False):
        if required is not None and required != size:
            return False
    return len(found) == len(shape)


def one_or_each(name: str, value: object, n: int | None, shape: tuple[int, ...]) -> Array:
    """Return n arrays of this shape, from n arrays or from one array for all.

    If n is None, any number of arrays is accepted, and one array stays one array.
    """
    array = numeric_copy(value)
    for_each = array is not None and array.ndim > len(shape)
    checked = as_array(name, value, (n, *shape) if for_each else shape)
    return checked if n is None else np.broadcast_to(checked, (n, *shape))


def as_forces(forces: Any, k: int | None, name: str = "forces") -> Array:
    """Return contact forces, shape (k,) or (k / 3, 3), as a read-only array of shape (k,) [N].

    With `k` = None, any number of forces is accepted.
    """
    array = numeric_copy(forces)
    # shape (3, k / 3) has another order
    one_row_per_point = array is not None and array.ndim == 2 and array.shape[1] == 3
    return as_array(
        name, array.ravel() if array is not None and one_row_per_point else forces, (k,), "N"
    )


def as_number(
    name: str,
    value: Any,
    unit: str = "",
    minimum: float = -MAX_MAGNITUDE,
    maximum: float = MAX_MAGNITUDE,
) -> float:
    """Return `value` as a float after checking that it is a number from `minimum` to `maximum`."""
    result = float(value if isinstance(value, float) else as_array(name, value, (), unit))
    if minimum <= result <= maximum:
        return result
    bounds = f"from {minimum:g} to {maximum:g}"
    if minimum == -MAX_MAGNITUDE and maximum == MAX_MAGNITUDE:
        bounds = "a finite number"
    raise InputError(
        f"{name} is {result:g}, but it must be {bounds}{f' [{unit}]' if unit else ''}."
    )


def as_positive(
    name: str, value: Any, unit: str = "", allow_zero: bool = False, maximum: float = MAX_MAGNITUDE
) -> float:
    """Return `value` as a float after checking that it is positive and at most `maximum`.

    With `allow_zero`, zero is accepted too.
    """
    result = float(value if isinstance(value, float) else as_array(name, value, (), unit))
    if _MIN_POSITIVE <= result <= maximum or (0.0 <= result < _MIN_POSITIVE and allow_zero):
        return result
    bound = "at least 0" if allow_zero else "greater than 0"
    if result > maximum:
        bound = f"at most {maximum:g}"
    elif result > 0.0:
        bound = f"at least {_MIN_POSITIVE:g}"
    raise InputError(f"{name} is {result:g}, but it must be {bound}{f' [{unit}]' if unit else ''}.")


def unit_vector(name: str, value: Any) -> Array:
    """Return `value` scaled to unit length, shape (3,); refuse the zero vector."""
    vector = as_array(name, value, (3,))
    length = float(np.linalg.norm(vector))
    if length < _ZERO_NORM:
        raise InputError(f"{name} is the zero vector, but it must have a direction.")
    return read_only(vector / length)


def as_half_spaces(name: str, normal: Any, offset: Any) -> tuple[Array, Array]:
    """Return planes normal · x = offset as unit normals, shape (n, 3), and offsets, shape (n,) [m].

    `normal` has shape (3,) for one plane or (n, 3) for several; `offset` [m] is a single number for
    all planes or has shape (n,).
    """
    array = numeric_copy(normal)
    if array is None or array.ndim != 2 or array.shape[1] != 3 or not len(array):
        normals = unit_vector(f"normal of {name}", normal)[None]
    else:
        normals = np.array(
            [unit_vector(f"normal {i} of {name}", row) for i, row in enumerate(array)]
        )
    distance = numeric_copy(offset)
    shape = () if distance is None or distance.ndim == 0 else (len(normals),)
    offsets = np.broadcast_to(as_array(f"offset of {name}", offset, shape, "m"), len(normals))
    return read_only(normals), read_only(offsets)


def cross(a: Array, b: Array) -> Array:
    """Return a × b of two vectors, shape (3,); `np.cross` takes twenty times as long."""
    (a0, a1, a2), (b0, b1, b2) = a.tolist(), b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def _shape_str(shape: tuple[int | None, ...]) -> str:
    """Return a required shape as text, with "any" for None."""
    return str(tuple(n if n is None else int(n) for n in shape)).replace("None", "any")
