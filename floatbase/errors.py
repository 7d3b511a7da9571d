"""Every error that `floatbase` raises on purpose, under one root.

A message says what was wrong, what would be right, and what to do next.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from importlib import import_module
from types import ModuleType


class FloatbaseError(Exception):
    """Root of all errors of the package: `except fb.FloatbaseError` catches them all."""


class InputError(FloatbaseError, ValueError):
    """A value handed in cannot be used: wrong shape, NaN, a quaternion that is not of unit length,
    μ ≤ 0, …
    """


class UnknownNameError(FloatbaseError, KeyError):
    """A robot, frame, task or back end of that name does not exist; the message lists the near
    ones.
    """

    def __str__(self) -> str:  # KeyError would print the repr of the message
        return str(self.args[0])


class RobotWarning(UserWarning):
    """A robot was loaded that cannot do what one expects of it; the message says what."""


class SimulationWarning(UserWarning):
    """A rollout runs, and a part of what it was given does nothing; the message says which, and
    why.
    """


class InfeasibleError(FloatbaseError):
    """No point satisfies all constraints of a quadratic program.

    `constraints` holds the names of a smallest set of constraints in conflict: they can be met
    without any one of them. Other constraints may be in conflict too.
    """

    def __init__(self, message: str, constraints: Iterable[str] = ()):
        super().__init__(message)
        self.constraints = tuple(constraints)


class SolverError(FloatbaseError):
    """A solver gave up (iteration limit, cycling, not convex) although the problem was not shown to
    be infeasible.
    """


class MissingDependencyError(FloatbaseError, ImportError):
    """An optional dependency is not installed; the message names the extra that brings it."""


class SimulationError(FloatbaseError):
    """The physics cannot be built or stepped as requested."""


class ViewerError(FloatbaseError):
    """The picture cannot be made: port taken, no browser connected, …"""


def require(module: str, extra: str) -> ModuleType:
    """Import an optional dependency, as in `cp = require("cvxpy", extra="course")`.

    Raises `MissingDependencyError` where it is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module.partition(".")[0]:
            raise  # it is there, and lacks something itself
        raise MissingDependencyError(
            f"{module} is not installed. Install it with the extra {extra!r}: "
            f"pip install 'floatbase[{extra}]'."
        ) from None


def unknown_name(kind: str, name: object, known: Iterable[str], hint: str = "") -> UnknownNameError:
    """An `UnknownNameError` that lists the names nearest to `name`, and all of them when there are
    few.
    """
    known = sorted(known)
    query = str(name).strip().lower()
    matches = get_close_matches(query, {k.lower() for k in known}, n=5)
    close = [k for match in matches for k in known if k.lower() == match][:5] or [
        k for k in known if query in k.lower()
    ][:5]
    parts = ["near names: " + ", ".join(close)] if close else []
    if not close or len(known) <= 6:
        parts.append("known: " + ", ".join(known[:12]) + (", …" if len(known) > 12 else ""))
    return UnknownNameError(
        f"unknown {kind} {name!r}; {'; '.join(parts)}." + (f" {hint}" if hint else "")
    )
