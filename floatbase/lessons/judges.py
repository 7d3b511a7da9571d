"""Judges of exercises: what is said of an answer, without giving the right one away."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
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

NEAR_MISS = 0.02  # of the right value: as much as a number with two digits may spoil
Example: TypeAlias = tuple[
    Any, str
]  # an answer, and the name of the hint that it must get; "" where it is right


@dataclass(frozen=True)
class Verdict:
    """What `check` answers; a notebook shows it as a line of text.

    hint: the name of the mistake that the text speaks of; "" where the answer is right.
    """

    right: bool
    text: str
    hint: str = ""

    def __repr__(self) -> str:
        return f"{'✓ Right.' if self.right else '✗ Not yet.'} {self.text}"


NO_ANSWER = Verdict(
    False, "There is no answer yet: replace the placeholder by your expression.", "no_answer"
)


def minimiser_or_verdict(answer: Any, n: int, block: str, hint: str = "") -> Array | Verdict:
    """The least point, (n,), of a cost that a learner gives, or a `Verdict` that says what is wrong
    with the cost.

    answer: whatever a learner may give. n: how many numbers it is to be on. block: their name.
        hint: where they are others.
    """
    if answer is None or answer is Ellipsis:
        return NO_ANSWER
    if not isinstance(answer, Quadratic):
        given = type(answer).__name__
        return Verdict(
            False,
            f"Give the cost, an fb.Quadratic on {block}, not its minimiser or {given}.",
            "no_cost",
        )
    if answer.n != n:
        return Verdict(
            False,
            f"This is a cost on {answer.n} numbers; {block} has {n}.{hint and f' {hint}'}",
            "other_block",
        )
    try:
        return answer.minimiser()
    except FloatbaseError as error:
        return Verdict(False, f"It has no least point: {error}", "no_least_point")


def array_or_verdict(answer: Any, *shapes: tuple[int, ...]) -> Array | Verdict:
    """The answer as an array of finite numbers in one of `shapes`, or a `Verdict` that says what is
    wrong with it.

    answer: whatever a learner may give. shapes: those allowed; a message names the first.
    """
    if answer is None or answer is Ellipsis:
        return NO_ANSWER
    try:
        plain = np.asarray(answer)
        given = np.asarray(plain, dtype=np.float64) if not np.iscomplexobj(plain) else None
    except (TypeError, ValueError):
        given = None
    if given is None:
        return Verdict(
            False, f"The answer should be numbers; this is {type(answer).__name__}.", "not_numbers"
        )
    if given.shape not in shapes:
        return Verdict(False, _shape_error(given.shape, shapes[0]), "shape")
    if not np.all(np.abs(given) <= MAX_MAGNITUDE):
        return Verdict(
            False, "The answer holds numbers that are not finite, or far too large.", "not_finite"
        )
    return given


def array_judge(
    *shapes: tuple[int, ...],
) -> Callable[[Callable[[Array], Verdict]], Callable[[Any], Verdict]]:
    """Turn a judge of arrays in one of `shapes` into a judge of any answer, as a decorator."""

    def decorate(judge: Callable[[Array], Verdict]) -> Callable[[Any], Verdict]:
        @wraps(judge)
        def judge_answer(answer: Any) -> Verdict:
            given = array_or_verdict(answer, *shapes)
            return given if isinstance(given, Verdict) else judge(given)

        return judge_answer

    return decorate


def function_or_verdict(answer: Any) -> Callable[..., Any] | Verdict:
    """The answer if it is a function, or a `Verdict` that says that it is none."""
    if answer is None or answer is Ellipsis:
        return Verdict(
            False, "There is no answer yet: give your function, without brackets.", "no_answer"
        )
    if not callable(answer):
        return Verdict(
            False,
            f"The answer is a function, written with def; this is {type(answer).__name__}.",
            "no_function",
        )
    return answer


def lasting_or_verdict(run: Callable[[], Rollout], why: str = "") -> Rollout | Verdict:
    """The record of a run on the physics, or a `Verdict` that says why there is none, or how it
    ended early.

    run: raises `InputError` where the answer makes no run. why: ends the text about an early end.
    """
    try:
        record = run()
    except InputError as error:
        return Verdict(False, str(error), "input_error")
    if record.outcome == "completed":
        return record
    stood = rounded(record.time[-1], "s")
    text = f"It does not last: {record.outcome} {stood} after the start.{why}"
    return Verdict(False, text, "falls")


def _shape_error(given: tuple[int, ...], expected: tuple[int, ...]) -> str:
    if not expected:
        return f"The answer is one number; this has shape {given}."
    if not given:
        return f"This is a single number; the answer should have shape {expected}."
    flat = sorted(given) == sorted((1, *expected))
    column = " This is a matrix with one row or column: `.ravel()` makes it flat." if flat else ""
    return f"The answer has shape {given}; it should have shape {expected}.{column}"


def format_vector(vector: npt.ArrayLike, digits: int = 0) -> str:
    """A vector as text, such as "(1, 0, -2)", by `rounded`, but with so many decimals at most."""
    return rounded(np.round(np.asarray(vector, dtype=np.float64), digits), digits=12, floor=0.0)


_GENERAL = {
    "nearly": "Nearly: less than 2 % off. Is a number in it rounded, or a small part left out?",
    "sign": "The size is right, the sign is not: whose force, and in which direction?",
    "transpose": "This is the transpose of the answer.",
    "unknown": "Neither right nor a mistake this check knows. Look at the units, then at the "
    "statement again.",
    "unknown_count": "Neither right nor a mistake this check knows. What is counted, and what is "
    "left out or counted twice?",
}


@dataclass(frozen=True, eq=False)
class NumericJudge:
    """A judge of numbers and arrays.

    right: computes the right value.
    praise: what a right answer is told.
    mistakes: name of a hint -> computes the value that this kind of mistake leads to.
    hints: the same names -> what is said then.
    tolerance: values whose difference is less than this part of the right value's largest number
        count as equal.
    is_count: the answer is a number of things, without sign or unit.
    """

    right: Callable[[], Any]
    praise: str
    mistakes: Mapping[str, Callable[[], Any]] = field(default_factory=dict)
    hints: Mapping[str, str] = field(default_factory=dict)
    tolerance: float = 1e-3
    is_count: bool = False

    def __call__(self, answer: Any) -> Verdict:
        right = np.asarray(self.right(), dtype=np.float64)
        given = array_or_verdict(answer, right.shape)
        if isinstance(given, Verdict):
            return given
        if self._equal(given, right):
            return Verdict(True, self.praise)
        for hint, wrong in self.mistakes.items():
            if self._equal(given, np.asarray(wrong(), dtype=np.float64)):
                return Verdict(False, self.hints[hint], hint)
        hint = self._of_any_answer(given, right)
        return Verdict(False, _GENERAL[hint], hint)

    def examples(self) -> Iterator[Example]:
        """The right answer, and one for each mistake."""
        yield self.right(), ""
        yield from ((wrong(), hint) for hint, wrong in self.mistakes.items())

    def _of_any_answer(self, given: Array, right: Array) -> str:
        """The hint, one of `_GENERAL`, for a wrong answer that is none of the known mistakes."""
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
        """Whether they differ by less than this part of b's largest number, or than
        `self.tolerance`, if that is more.
        """
        b, relative = np.asarray(b, dtype=np.float64), max(tolerance, self.tolerance)
        return a.shape == b.shape and bool(
            np.max(np.abs(a - b)) <= relative * (1e-9 + np.max(np.abs(b)))
        )


@dataclass(frozen=True, eq=False)
class ShapeJudge:
    """A judge that knows what a wrong shape means, and leaves other shapes to `judge`.

    shapes: shape -> what is said of it. The hint's name is made of it, such as "shape_4x3", or
        "shape_" of one number.
    """

    judge: Callable[[Any], Verdict]
    shapes: Mapping[tuple[int, ...], str]

    def __call__(self, answer: Any) -> Verdict:
        try:
            shape = np.shape(answer)
        except ValueError:  # rows of different lengths
            return self.judge(answer)
        if answer is None or answer is Ellipsis or shape not in self.shapes:
            return self.judge(answer)
        return Verdict(False, self.shapes[shape], self._name(shape))

    def examples(self) -> Iterator[Example]:
        """Those of `judge`, and an array of each wrong shape."""
        yield from getattr(self.judge, "examples", tuple)()
        yield from ((np.zeros(shape), self._name(shape)) for shape in self.shapes)

    @staticmethod
    def _name(shape: tuple[int, ...]) -> str:
        return f"shape_{'x'.join(map(str, shape))}"
