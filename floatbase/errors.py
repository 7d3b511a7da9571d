"""Exceptions and warnings of the package.

Each message says what is wrong, what is expected, and what to do.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Collection, Iterable
from contextlib import suppress
from difflib import get_close_matches
from functools import wraps
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np

MAX_REPR = 60  # characters of a value that a message shows
_MAX_INTEGER = 10**30  # larger integers fill a message, and Python writes at most 4300 digits


class FloatbaseError(Exception):
    """Base of all exceptions of the package: `except fb.FloatbaseError` catches them all."""


class InputError(FloatbaseError, ValueError):
    """An argument is invalid: a wrong shape, NaN, a quaternion without unit length, μ ≤ 0, …."""


class UnknownNameError(FloatbaseError, KeyError):
    """No robot, frame, task or backend has this name; the message lists similar names."""

    def __str__(self) -> str:  # KeyError would print the repr of the message
        return str(self.args[0])


class UnknownArgumentError(UnknownNameError, TypeError):
    """A function or a constructor has no argument of this name; the message lists similar ones."""


class RobotWarning(UserWarning):
    """A loaded robot lacks something that most uses require; the message says what."""


class SimulationWarning(UserWarning):
    """An input of a simulation or a walk has no effect or does not fit; the message says why."""


class InfeasibleError(FloatbaseError):
    """No point satisfies all constraints of a quadratic program.

    Parameters
    ----------
    message : str or callable
        Message of the exception, or a function that returns an `InfeasibleError`. The function is
        called when the message or the constraints are read, because it searches for a conflict.
    constraints : iterable of str, optional
        Names of constraints in conflict, kept as the attribute `constraints`. Solvers of QPs name a
        minimal set: if any one of them is removed, the others can be satisfied. Other constraints
        may be in conflict, too.
    """

    def __init__(
        self, message: str | Callable[[], InfeasibleError], constraints: Iterable[str] = ()
    ):
        super().__init__(message)
        self._constraints = tuple(constraints)

    @property
    def constraints(self) -> tuple[str, ...]:
        """Names of constraints in conflict."""
        self._explain()
        return self._constraints

    def _explain(self) -> None:
        """Search for the conflict, if this has not been done."""
        if callable(self.args[0]):
            found = self.args[0]()
            self.args, self._constraints = found.args, found.constraints

    def __str__(self) -> str:
        self._explain()
        return super().__str__()

    def __repr__(self) -> str:
        self._explain()
        return super().__repr__()

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.constraints), vars(self)  # which holds the notes


class SolverError(FloatbaseError):
    """A solver stopped without a solution, although the problem was not shown to be infeasible.

    Reasons are the iteration limit, cycling, and a cost that is not convex.
    """


class MissingDependencyError(FloatbaseError, ImportError):
    """An optional dependency is missing; the message names the extra that installs it."""


class SimulationError(FloatbaseError):
    """The simulation cannot be built or stepped as requested."""


class ViewerError(FloatbaseError):
    """The viewer cannot do what was requested: port in use, no browser connected, …."""


def require(module: str, extra: str) -> ModuleType:
    """Import an optional dependency, as in `cp = require("cvxpy", extra="cvxpy")`.

    Parameters
    ----------
    module : str
        Name of the module.
    extra : str
        Extra of floatbase that installs it.

    Returns
    -------
    module
        The imported module.

    Raises
    ------
    MissingDependencyError
        If the module is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module.partition(".")[0]:
            raise  # the module exists, but one of its own imports is missing
        raise MissingDependencyError(
            f"{module} is not installed. Install it with the extra {extra!r}: "
            f"pip install 'floatbase[{extra}]'."
        ) from None


def warn(message: str, category: type[Warning]) -> None:
    """Issue a warning that points at the code that called the package."""
    frame, level = inspect.currentframe(), 1
    while frame is not None and str(frame.f_globals.get("__name__")).startswith("floatbase."):
        frame, level = frame.f_back, level + 1
    warnings.warn(message, category, stacklevel=level)


def short_repr(value: object) -> str:
    """Return a short representation of a value for error messages, or only its type.

    Parameters
    ----------
    value : object
        Value to represent.

    Returns
    -------
    str
        At most `MAX_REPR` characters and an ellipsis.
    """
    if isinstance(value, type):
        return f"the class {value.__name__}"
    if isinstance(value, np.ndarray) and value.ndim:
        return f"an array of shape {value.shape} and dtype {value.dtype}"
    if isinstance(value, int) and abs(value) > _MAX_INTEGER:
        return f"an integer of magnitude above {float(_MAX_INTEGER):g}"
    if value is None or isinstance(
        value, str | bytes | int | float | complex | np.generic | list | tuple | np.ndarray
    ):
        with suppress(Exception):  # of an entry that cannot be represented
            text = " ".join(repr(value).split())
            return text if len(text) <= MAX_REPR else f"{text[:MAX_REPR]}…"
    return f"a value of type {type(value).__name__}"


def explain_arguments(namespace: dict[str, Any], without: Collection[str] = ()) -> None:
    """Let public functions and constructors of a package raise `UnknownArgumentError`.

    Parameters
    ----------
    namespace : dict
        Global variables of the package, with `__all__`.
    without : collection of str, optional
        Names to leave as they are.
    """
    for name in set(namespace["__all__"]).difference(without):
        value = namespace.get(name)  # some are imported on first use
        if inspect.isfunction(value):
            namespace[name] = _explained(value)
            namespace[name].__module__ = namespace["__name__"]  # where pickles look for it
        elif inspect.isclass(value) and not getattr(value, "_is_protocol", False):
            for member, method in list(vars(value).items()):
                if member == "__init__" and inspect.isfunction(method):
                    setattr(value, member, _explained(method))
                elif isinstance(method, classmethod | staticmethod):
                    setattr(value, member, type(method)(_explained(method.__func__)))


def _explained(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function with an error that names unknown arguments."""

    @wraps(function)
    def explained(*args: Any, **kwargs: Any) -> Any:
        __tracebackhide__ = True  # IPython and pytest leave this line out of tracebacks
        try:
            return function(*args, **kwargs)
        except TypeError as error:
            if error.__traceback__ is None or error.__traceback__.tb_next is not None:
                raise  # from within the function
            known = set(inspect.signature(function).parameters) - {"self", "cls"}
            check_arguments(function.__qualname__.removesuffix(".__init__"), kwargs, known)
            raise  # a missing argument, or one too many

    return explained


def check_arguments(function: str, names: Iterable[str], known: Collection[str]) -> None:
    """Raise `UnknownArgumentError` if a function does not have arguments of these names.

    Parameters
    ----------
    function : str
        Name of the function or class.
    names : iterable of str
        Names of the arguments.
    known : collection of str
        Names of the arguments that it has.

    Raises
    ------
    UnknownArgumentError
        If a name is not known.
    """
    for name in names:
        if name not in known:
            message = str(unknown_name(f"argument of {function}", name, known))
            raise UnknownArgumentError(message) from None


def unknown_name(kind: str, name: object, known: Iterable[str], hint: str = "") -> UnknownNameError:
    """Make an `UnknownNameError` that lists similar names, and all names if there are few.

    Parameters
    ----------
    kind : str
        Kind of the named object, such as "frame".
    name : object
        Name that does not exist.
    known : iterable of str
        Names that exist.
    hint : str, optional
        Sentence at the end of the message.

    Returns
    -------
    UnknownNameError
        The exception, to be raised by the caller.
    """
    known = sorted(known)
    query = name.strip().lower() if isinstance(name, str) else ""
    matches = get_close_matches(query, {k.lower() for k in known}, n=5)
    close = [k for match in matches for k in known if k.lower() == match][:5] or [
        k for k in known if query and query in k.lower()
    ][:5]
    parts = ["Similar names: " + ", ".join(close)] if close else []
    if not close or len(known) <= 6:
        parts.append(
            "Available names: " + ", ".join(known[:12]) + (", …" if len(known) > 12 else "")
        )
    return UnknownNameError(
        f"Unknown {kind} {short_repr(name)}. {'. '.join(parts)}." + (f" {hint}" if hint else "")
    )
