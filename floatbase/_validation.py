"""Checked arguments, read-only arrays, and `Value`: what every value of the package is made of."""

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

from floatbase.errors import InputError

Array: TypeAlias = npt.NDArray[np.floating[Any]]
T = TypeVar("T")
_FLOAT64 = np.dtype(np.float64)
# in SI units nothing about a robot comes near, and a product of ten such numbers is still finite
MAX_MAGNITUDE = 1e30
_ZERO_NORM = 1e-9  # a vector shorter than this is zero but for rounding, and has no direction
_MAX_REPR = 60  # characters of a value that a message repeats


class cached_property(functools.cached_property[T]):
    """What a value computes of itself when it is first asked for, and keeps; where threads ask at
    once, what the first found.

    It takes no lock, as that of functools does in Python 3.11: values find the same whenever they
    compute it, and in a forked process nobody is left to release a lock that another thread held.
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
    """Base of values: they do not change, so a copy is the value itself, and out of a pickle their
    arrays come read-only.

    What a value has computed for itself (`cached_property`) stays behind and is computed anew.
    """

    def __post_init__(self) -> None:
        """Check and convert each field that declares how (`checked`)."""
        cls: Any = type(self)
        for name, check in _field_checks(cls):
            value = check(f"{name} of {self._label()}", getattr(self, name))
            object.__setattr__(self, name, value)

    def _label(self) -> str:
        """What messages about a field call this value."""
        return type(self).__name__

    def __setattr__(self, name: str, value: object) -> None:
        raise FrozenInstanceError(
            f"cannot assign to field {name!r}: a {type(self).__name__} does not change"
        )

    def __delattr__(self, name: str) -> None:
        raise FrozenInstanceError(
            f"cannot delete field {name!r}: a {type(self).__name__} does not change"
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
        computed -= set(
            getattr(self, "__dataclass_fields__", ())
        )  # given here, though a class above computes it
        kept = {name: value for name, value in vars(self).items() if name not in computed}
        return {
            name: dict(value) if isinstance(value, MappingProxyType) else value
            for name, value in kept.items()
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
            object.__setattr__(
                self, name, MappingProxyType(value) if type(value) is dict else value
            )


def refuse_new_attributes(self: object, name: str, value: object) -> None:
    """Set an attribute, as `__setattr__` of a class whose public attributes are properties.

    Any other public name raises `AttributeError`: a misspelled one would be set and never read.
    Classes derived from such a class may set attributes of their own.
    """
    cls = type(self)
    if not name.startswith("_") and not hasattr(cls, name) and "__setattr__" in vars(cls):
        public = [known for known in dir(cls) if not known.startswith("_")]
        near = "".join(f" Did you mean {known!r}?" for known in get_close_matches(name, public, 1))
        raise AttributeError(f"A {cls.__name__} has no attribute {name!r} to set.{near}")
    object.__setattr__(self, name, value)


def checked(check: Callable[..., Any], *args: Any, **options: Any) -> dict[str, Any]:
    """Metadata of a field that says how it is checked: `check(name, value, *args, **options)`.

    As in `force: Array = field(metadata=checked(as_array, (3,), "N"))`. `Value.__post_init__` runs
    the checks in the order of the fields, and each field becomes what its check returns.
    """

    def check_field(name: str, value: Any) -> Any:
        return check(name, value, *args, **options)

    return {"check": check_field}


@functools.cache
def _field_checks(cls: Any) -> tuple[tuple[str, Callable[[str, Any], Any]], ...]:
    """Name and check of each field of a dataclass that declares one."""
    return tuple(
        (field.name, field.metadata["check"]) for field in fields(cls) if "check" in field.metadata
    )


def as_instance(name: str, value: object, cls: type[T], example: str = "") -> T:
    """`value`, after checking that it is a `cls`.

    example: how to get one, for the message; by default the class's own, `_example`.
    """
    if isinstance(value, cls):
        return value
    example = example or getattr(cls, "_example", "")
    raise InputError(
        f"{name} must be of type {cls.__name__}{f', as {example}' if example else ''}, not "
        f"{short_repr(value)}."
    )


def as_string(name: str, value: object) -> str:
    """`value`, after checking that it is a text."""
    if isinstance(value, str):
        return value
    raise InputError(f"{name} must be a text, not {short_repr(value)}.")


def as_strings(name: str, value: Any) -> tuple[str, ...]:
    """`value` as a tuple, after checking that it is a list of texts, and not one text."""
    if (
        isinstance(value, Sequence)
        and not isinstance(value, str)
        and all(isinstance(entry, str) for entry in value)
    ):
        return tuple(value)
    example = value if isinstance(value, str) else "…"
    raise InputError(
        f'{name} must be a list of names, as in {name}=["{example}"], not {short_repr(value)}.'
    )


def as_bool(name: str, value: object) -> bool:
    """`value` as a bool, after checking that it is one: "no" would count as true."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    raise InputError(f"{name} must be True or False, not {short_repr(value)}.")


def as_callable(name: str, value: Any, usage: str) -> Any:
    """`value`, after checking that it can be called as `call` says, such as "rows(state, t)"."""
    if not callable(value) or isinstance(value, type):
        raise InputError(f"{name} must be a function, called as {usage}, not {short_repr(value)}.")
    arguments = [part for part in usage.partition("(")[2].strip(")").split(",") if part]
    if error := signature_error(value, *arguments):
        raise InputError(f"{name} must be a function that can be called as {usage}; {error}.")
    return value


def signature_error(function: Any, *args: object, **kwargs: object) -> str:
    """What a function takes, and why it cannot be called like this; "" where it can, or hides it,
    as compiled ones do.
    """
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return ""
    try:
        signature.bind(*args, **kwargs)
    except TypeError as error:
        return (
            f"{getattr(function, '__name__', type(function).__name__)} takes {signature}: {error}"
        )
    return ""


def as_integer(name: str, value: Any, minimum: int, maximum: int, reason: str = "") -> int:
    """`value` as an int, after checking that it is a whole number from `least` to `most`. why: the
    reason for the bounds.
    """
    is_number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(
        value, bool
    )
    if is_number and minimum <= value <= maximum and value == int(value):
        return int(value)
    raise InputError(
        f"{name} is {short_repr(value)}; it must be a whole number ≥ {minimum} and ≤ {maximum}"
        + (f": {reason}." if reason else ".")
    )


def read_only(value: Any) -> Array:
    """`value` as a float64 array that cannot be written to: a copy, unless it is one already.

    A read-only array is taken at its word: numpy does not tell of views that were taken of it
    before and can be written to.
    """
    if _is_read_only(value):
        return value
    return frozen(np.array(value, dtype=np.float64))


def frozen(array: Array) -> Array:
    """An array that nobody else has, which cannot be written to any more."""
    array.setflags(write=False)
    return array


def _is_read_only(value: Any) -> TypeGuard[Array]:
    """Whether `value` is a float64 array in one piece that cannot be written to, and no view of one
    that can.
    """
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
    """A float64 copy of numbers; None for anything else: complex or masked numbers, texts, truth
    values, dates, objects.
    """
    if type(value) is np.ndarray and value.dtype is _FLOAT64:
        return value.copy("K")  # most of them, and in the controller's loop
    try:
        array = np.array(value)
    except Exception:  # of another shape in each row, or of a class with an opinion of its own
        return None
    if array.dtype.kind not in "fiu" or isinstance(value, np.ma.MaskedArray):
        return None
    return array.astype(np.float64, copy=False)


def as_array(name: str, value: Any, shape: tuple[int | None, ...], unit: str = "") -> Array:
    """`value`, `read_only`, after checking that it holds plain numbers of `shape` (None = any
    length), finite ones.

    Raises `InputError` with the name, the shape found and the shape required.
    """
    array = value if _is_read_only(value) else numeric_copy(value)
    if array is None:
        required = f"numbers of shape {_shape_str(shape)}" if shape else "a number"
        raise InputError(
            f"{name} must be {required}{f' ({unit})' if unit else ''}, not {short_repr(value)}."
        )
    if array.shape != shape and not _shape_matches(array.shape, shape):
        required = f"have shape {_shape_str(shape)}" if shape else "be one number"
        hint = (
            ": one row alone is rows[:1], not rows[0]"
            if array.ndim == 1 and shape[:-1] in ((None,), (1,))
            else ""
        )
        raise InputError(
            f"{name} has shape {array.shape}; it must "
            f"{required}{f' ({unit})' if unit else ''}{hint}."
        )
    # the sum of squares tells in a third of the time, and is False for NaN too; where it is larger,
    # the entries decide
    if not (
        np.vdot(array, array) <= MAX_MAGNITUDE**2
        or (bounded := np.abs(array) <= MAX_MAGNITUDE).all()
    ):
        at = tuple(np.argwhere(~bounded)[0].tolist())
        place = (
            f"holds {array[at]:g} at index {list(at)}; every entry must be"
            if shape
            else f"is {array[at]:g}; it must be"
        )
        raise InputError(
            f"{name} {place} a finite "
            f"number{f' of at most {MAX_MAGNITUDE:g}' if np.isfinite(array[at]) else ''}."
        )
    return frozen(array)


def _shape_matches(found: tuple[int, ...], shape: tuple[int | None, ...]) -> bool:
    for size, required in zip(found, shape, strict=False):
        if required is not None and required != size:
            return False
    return len(found) == len(shape)


def as_forces(forces: Any, k: int | None, name: str = "forces") -> Array:
    """Forces of contact points, (k,) or (k / 3, 3), N, as a read-only array of shape (k,), checked.
    k: None for any.
    """
    array = numeric_copy(forces)
    one_row_per_point = (
        array is not None and array.ndim == 2 and array.shape[1] == 3
    )  # not (3, k / 3): another order
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
    """`value` as a float, after checking that it is a plain number from `least` to `most`."""
    result = float(value if isinstance(value, float) else as_array(name, value, (), unit))
    if minimum <= result <= maximum:
        return result
    bounds = (
        "a finite number"
        if minimum == -MAX_MAGNITUDE and maximum == MAX_MAGNITUDE
        else f"from {minimum:g} to {maximum:g}"
    )
    raise InputError(f"{name} is {result:g}; it must be {bounds}{f' ({unit})' if unit else ''}.")


def as_positive(
    name: str, value: Any, unit: str = "", allow_zero: bool = False, maximum: float = MAX_MAGNITUDE
) -> float:
    """`value` as a float, after checking that it is above zero (or not below, with `allow_zero`)
    and at most `most`.
    """
    result = float(value if isinstance(value, float) else as_array(name, value, (), unit))
    if 0.0 < result <= maximum or (result == 0.0 and allow_zero):
        return result
    bound = f"at most {maximum:g}" if result > 0.0 else "≥ 0" if allow_zero else "> 0"
    raise InputError(f"{name} is {result:g}; it must be {bound}{f' {unit}' if unit else ''}.")


def short_repr(value: object) -> str:
    """A value as a message repeats it: short, and by its kind where it is not a plain one."""
    if isinstance(value, type):
        return f"the class {value.__name__}"
    if isinstance(value, np.ndarray) and value.ndim:
        return f"an array of {value.dtype} of shape {value.shape}"
    if isinstance(value, int) and abs(value) > MAX_MAGNITUDE:
        return f"a whole number beyond {MAX_MAGNITUDE:g}"
    if value is None or isinstance(
        value, str | bytes | int | float | complex | np.generic | list | tuple | np.ndarray
    ):
        text = " ".join(repr(value).split())
        return text if len(text) <= _MAX_REPR else f"{text[:_MAX_REPR]}…"
    return f"a value of type {type(value).__name__}"


def unit_vector(name: str, value: Any) -> Array:
    """`value` scaled to unit length, shape (3,); a zero vector is an `InputError`."""
    vector = as_array(name, value, (3,))
    length = float(np.linalg.norm(vector))
    if length < _ZERO_NORM:
        raise InputError(f"{name} is the zero vector; it must have a direction.")
    return read_only(vector / length)


def as_half_spaces(name: str, normal: Any, offset: Any) -> tuple[Array, Array]:
    """Planes normal · x = offset as unit normals, shape (n, 3), and offsets, shape (n,), m,
    checked.

    normal: (3,) for one plane, (n, 3) for several. offset: m, one number for all, or (n,).
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
    """a × b of two vectors, shape (3,); numpy's own takes twenty times as long on three numbers."""
    (a0, a1, a2), (b0, b1, b2) = a.tolist(), b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def _shape_str(shape: tuple[int | None, ...]) -> str:
    return str(tuple(n if n is None else int(n) for n in shape)).replace("None", "any")
