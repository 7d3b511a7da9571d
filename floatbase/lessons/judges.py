"""Judges of exercises: comments on an answer that do not give the solution away."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from floatbase._validation import MAX_MAGNITUDE, Array
from floatbase.affine import Quadratic
from floatbase.errors import FloatbaseError, InputError
from floatbase.lessons.rounding import rounded

if TYPE_CHECKING:
    from floatbase.simulation import Rollout

# fraction of the right value: the error that rounding a number to two digits may cause
NEAR_MISS = 0.02
# an answer, and the name of the hint that it must get; "" for a right answer
Example: TypeAlias = tuple[Any, str]
# a known mistake: the name of its hint, the answer to which it leads, and the hint
Mistake: TypeAlias = tuple[str, Any, str]
# what may be wrong with an answer: the name of its hint, whether it is wrong, and the hint
Fault: TypeAlias = tuple[str, bool | np.bool_, str]


@dataclass(frozen=True)
class Verdict:
    """Result of a check. A notebook shows it as a line of text."""

    right: bool
    text: str
    hint: str = ""
    is_try: bool = True

    def __repr__(self) -> str:
        mark = "✓ Right." if self.right else "✗ Not yet." if self.is_try else "· Your turn."
        return f"{mark} {self.text}"


NO_ANSWER = Verdict(
    False, "There is no answer yet. Replace the placeholder by your expression.", "no_answer"
)


def first_fault(faults: Iterable[Fault]) -> Verdict | None:
    """Return a verdict on the first fault of an answer, or None if it has none of them."""
    return next((Verdict(False, text, hint) for hint, wrong, text in faults if wrong), None)


def stopped(error: Exception) -> Verdict:
    """Return the verdict on a learner's function that raises an exception."""
    return Verdict(False, f"Your function stops with {type(error).__name__}: {error}", "stops")


def minimizer_or_verdict(answer: Any, n: int, block: str, hint: str = "") -> Array | Verdict:
    """Return the minimizer of a learner's cost, or a verdict on what is wrong with the cost."""
    if answer is None or answer is Ellipsis:
        return NO_ANSWER
    if not isinstance(answer, Quadratic):
        given = type(answer).__name__
        return Verdict(
            False,
            f"The answer must be the cost, an fb.Quadratic on {block}, not {given}. Its "
            f"minimizer is not asked for.",
            "no_cost",
        )
    if answer.n != n:
        return Verdict(
            False,
            f"This cost has {answer.n} variables, but {block} has {n}.{hint and f' {hint}'}",
            "other_block",
        )
    try:
        return answer.minimizer()
    except FloatbaseError as error:
        return Verdict(False, f"The cost has no minimum: {error}", "no_least_point")


def array_or_verdict(answer: Any, *shapes: tuple[int, ...]) -> Array | Verdict:
    """Return an answer as an array of finite numbers, or a verdict on what is wrong with it."""
    if answer is None or answer is Ellipsis:
        return NO_ANSWER
    try:
        plain = np.asarray(answer)
        given = np.asarray(plain, dtype=np.float64) if not np.iscomplexobj(plain) else None
    except (TypeError, ValueError):
        given = None
    if given is None:
        return Verdict(
            False, f"The answer must be numbers, not {type(answer).__name__}.", "not_numbers"
        )
    if given.shape not in shapes:
        return Verdict(False, _shape_error(given.shape, shapes[0]), "shape")
    if not np.all(np.abs(given) <= MAX_MAGNITUDE):
        return Verdict(
            False,
            "The answer contains numbers that are infinite, NaN or far too large.",
            "not_finite",
        )
    return given


def array_judge(
    *shapes: tuple[int, ...],
) -> Callable[[Callable[[Array], Verdict]], Callable[[Any], Verdict]]:
    """Decorate a judge of arrays, so that it judges any answer."""

    def decorate(judge: Callable[[Array], Verdict]) -> Callable[[Any], Verdict]:
        @wraps(judge)
        def judge_answer(answer: Any) -> Verdict:
            given = array_or_verdict(answer, *shapes)
            return given if isinstance(given, Verdict) else judge(given)

        return judge_answer

    return decorate


def function_or_verdict(answer: Any) -> Callable[..., Any] | Verdict:
    """Return an answer that is a function, or a verdict that the answer is not a function."""
    if answer is None or answer is Ellipsis:
        return Verdict(
            False, "There is no answer yet. Pass your function, without parentheses.", "no_answer"
        )
    if not callable(answer):
        return Verdict(
            False,
            f"The answer must be a function, written with def, not {type(answer).__name__}.",
            "no_function",
        )
    return answer


def lasting_or_verdict(run: Callable[[], Rollout], why: str = "") -> Rollout | Verdict:
    """Run a simulation, and return its record or a verdict on why it failed or ended early."""
    try:
        record = run()
    except InputError as error:
        return Verdict(False, str(error), "input_error")
    if record.outcome == "completed":
        return record
    stood = rounded(record.time[-1], "s")
    text = f"The run ended early: {record.outcome} {stood} after the start.{why}"
    return Verdict(False, text, "falls")


def _shape_error(given: tuple[int, ...], expected: tuple[int, ...]) -> str:
    if not expected:
        return f"The answer must be one number, but it has shape {given}."
    if not given:
        return f"This is a single number. The answer must have shape {expected}."
    flat = sorted(given) == sorted((1, *expected))
    column = " It is a matrix with one row or column; `.ravel()` flattens it." if flat else ""
    return f"The answer has shape {given}, but it must have shape {expected}.{column}"


def format_vector(vector: npt.ArrayLike, digits: int = 0) -> str:
    """Write a vector as text, such as "(1, 0, -2)"."""
    return rounded(np.round(np.asarray(vector, dtype=np.float64), digits), digits=12, floor=0.0)


_GENERAL = {
    "nearly": "Close: less than 2 % off. Was a number rounded, or a small contribution left out?",
    "sign": "The magnitude is right, but the sign is wrong. Which body does the force act on, "
    "and in which direction?",
    "transpose": "This is the transpose of the answer.",
    "unknown": "This is not right, and it is not a mistake that this check recognizes. Check "
    "the units, then read the statement again.",
    "unknown_count": "This is not right, and it is not a mistake that this check recognizes. "
    "What is counted? Is anything left out or counted twice?",
}


def general_hint(name: str) -> str:
    """Return the text of a hint that any exercise can give, such as "nearly"."""
    return _GENERAL[name]


@dataclass(frozen=True, eq=False)
class NumericJudge:
    """Judge of numbers and arrays.

    Parameters
    ----------
    right : callable
        Function without arguments that computes the right value.
    praise : str
        Comment on a right answer.
    mistakes : callable, optional
        Function without arguments that returns a row for each known mistake: the name of its hint,
        the value to which the mistake leads, and the hint.
    tolerance : float, optional
        Relative tolerance: two values are equal if they differ by at most this fraction of the
        largest entry of the right value [-].
    is_count : bool, optional
        Whether the answer is a count, which has neither a sign nor a unit.
    """

    right: Callable[[], Any]
    praise: str
    mistakes: Callable[[], Iterable[Mistake]] = tuple
    tolerance: float = 1e-3
    is_count: bool = False

    def __call__(self, answer: Any) -> Verdict:
        """Judge an answer."""
        right = np.asarray(self.right(), dtype=np.float64)
        given = array_or_verdict(answer, right.shape)
        if isinstance(given, Verdict):
            return given
        if self._equal(given, right):
            return Verdict(True, self.praise)
        for hint, wrong, text in self.mistakes():
            if self._equal(given, np.asarray(wrong, dtype=np.float64)):
                return Verdict(False, text, hint)
        hint = self._of_any_answer(given, right)
        return Verdict(False, _GENERAL[hint], hint)

    def examples(self) -> Iterator[Example]:
        """Yield the right answer and one answer for each known mistake, each with its hint."""
        yield self.right(), ""
        yield from ((wrong, hint) for hint, wrong, _ in self.mistakes())

    def _of_any_answer(self, given: Array, right: Array) -> str:
        """Return the general hint, a key of `_GENERAL`, for a wrong answer of no known kind."""
        if self.is_count:
            return "unknown_count"
        if self._equal(given, right, NEAR_MISS):
            return "nearly"
        if self._equal(given, -right):
            return "sign"
        if right.ndim == 2 and right.shape[0] == right.shape[1] and self._equal(given, right.T):
            return "transpose"
        return "unknown"

    def _equal(self, a: Any, b: Any, tolerance: float = 0.0) -> bool:
        """Return whether two arrays are equal within a tolerance."""
        b, relative = np.asarray(b, dtype=np.float64), max(tolerance, self.tolerance)
        return a.shape == b.shape and bool(
            np.max(np.abs(a - b)) <= relative * (1e-9 + np.max(np.abs(b)))
        )


@dataclass(frozen=True, eq=False)
class ShapeJudge:
    """Judge that comments on known wrong shapes and leaves every other shape to another judge."""

    judge: Callable[[Any], Verdict]
    shapes: Mapping[tuple[int, ...], str]

    def __call__(self, answer: Any) -> Verdict:
        """Judge an answer."""
        try:
            shape = np.shape(answer)
        except ValueError:  # rows of different lengths
            return self.judge(answer)
        if answer is None or answer is Ellipsis or shape not in self.shapes:
            return self.judge(answer)
        return Verdict(False, self.shapes[shape], self._name(shape))

    def examples(self) -> Iterator[Example]:
        """Yield the examples of `judge` and one array of each known wrong shape."""
        yield from getattr(self.judge, "examples", tuple)()
        yield from ((np.zeros(shape), self._name(shape)) for shape in self.shapes)

    @staticmethod
    def _name(shape: tuple[int, ...]) -> str:
        return f"shape_{'x'.join(map(str, shape))}"


@dataclass(frozen=True, eq=False)
class BugHunt:
    """Judge of a planted fault, which the answer names by its line and kind: ["1", "sign"].

    Parameters
    ----------
    lines : sequence of str
        Lines that may be named as the place of the fault.
    kind : str
        Kind of the fault.
    praise : str
        Comment on a right answer.
    refuted : mapping
        Evidence against each other kind of fault.
    elsewhere : str
        Evidence against all other lines.
    """

    lines: Sequence[str]
    kind: str
    praise: str
    refuted: Mapping[str, str]
    elsewhere: str

    def __call__(self, answer: Any) -> Verdict:
        """Judge an answer."""
        parts = list(answer) if isinstance(answer, list | tuple) else []
        if answer is None or answer is Ellipsis or parts == ["", ""]:
            return NO_ANSWER
        if len(parts) != 2 or not all(isinstance(part, str | int) for part in parts):
            text = 'The answer must be the line and the kind of the fault, such as ["1", "sign"].'
            return Verdict(False, text, "form")
        line, kind = (str(part).lower().replace("line", "").strip() for part in parts)
        kinds = sorted([self.kind, *self.refuted])
        return first_fault([
            ("no_kind", kind not in kinds, f"The kind must be one of: {', '.join(kinds)}."),
            *((name, kind == name, text) for name, text in self.refuted.items()),
            ("line", line not in self.lines, f"The kind is right. {self.elsewhere}"),
        ]) or Verdict(True, self.praise)  # fmt: skip

    def examples(self) -> Iterator[Example]:
        """Yield all right answers and one answer for each hint."""
        yield from (([line, self.kind], "") for line in self.lines)
        yield from (([self.lines[0], kind], kind) for kind in self.refuted)
        yield from [
            ((f"Line {self.lines[0]}", self.kind.upper()), ""), (["0", self.kind], "line"),
            ([self.lines[0], "?"], "no_kind"), (["1"], "form"), (["", ""], "no_answer"),
        ]  # fmt: skip
