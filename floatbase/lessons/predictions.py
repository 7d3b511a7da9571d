"""Predictions: learners say what a cell will show before they run it, and compare afterwards.

Predictions are stored in the learner's progress file and never leave this machine.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from floatbase._validation import MAX_MAGNITUDE, as_bool, as_string, numeric_copy, short_repr
from floatbase.errors import InputError
from floatbase.lessons import progress
from floatbase.lessons.rounding import rounded, rounded_decimals

RESULT_MIME = "application/vnd.floatbase.result+json"  # of the result that `compare` shows
_ANSWER_DIGITS = 6  # digits of a prediction, which is shown as it was typed
_RIGHT = "right"
# margins of a right prediction: fraction of the result, and of the largest of several results
_PART_OF_RESULT, _PART_OF_LARGEST = 0.1, 0.02
_ROUNDING = 1e-6  # in the unit of the prediction
_AS_ASCII = str.maketrans("−–\t\xa0", "--  ")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_units: dict[str, str] = {}  # of the predictions of this process


@dataclass(frozen=True)
class ComparedResult:
    """Line of text that `compare` shows, with its result as data for the site and the lecture."""

    text: str
    data: dict[str, Any]

    def __repr__(self) -> str:
        return self.text

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, Any]:
        return {"text/plain": self.text, RESULT_MIME: self.data}


def predict(
    name: str,
    *answer: Any,
    unit: str = "",
    choices: Sequence[str] = (),
    count: int = 1,
    sure: bool | None = None,
) -> None:
    """Predict what a cell will show.

    The prediction is saved, and a line is printed. If the answer cannot be used, the line says why,
    and nothing is saved.

    Parameters
    ----------
    name : str
        Name of the lesson and of the prediction, such as "02.c" or "C.a".
    *answer : float, sequence of float or str
        The prediction: a number, `count` numbers, or the first letters of one of `choices`. Without
        an answer, or with `...`, the prediction is skipped.
    unit : str, optional
        Unit of the number.
    choices : sequence of str, optional
        Strings to choose from. Without choices the answer is a number.
    count : int, optional
        How many numbers to predict.
    sure : bool, optional
        Whether you are sure. `review` then lists what you were sure of and got wrong.
    """
    _units[as_string("name of a prediction", name)] = unit
    stored = progress.predictions().get(name, {})
    given = answer[0] if len(answer) == 1 else list(answer) or ...
    if given is None or given is Ellipsis:
        before = stored.get("said")
        message = (
            f"you predicted {_quoted_answer(before, unit)} earlier; that still counts."
            if before is not None
            else "skipped. You can go on without a prediction."
        )
        print(f"{name}: {message}")
        return
    try:
        said = parse_answer(given, unit, choices, count)
    except InputError as error:
        print(f"{name}: {error} To skip the prediction, leave the ... in place.")
        return
    confidence = {} if sure is None else {"sure": as_bool("sure", sure)}
    how = {None: "", True: ", and you are sure", False: ", and you are not sure"}[sure]
    print(f"{name}: you predict {_quoted_answer(said, unit)}{how}.")
    _save(name, {"said": said, "unit": unit} | confidence, stored)


def compare(name: str, value: Any) -> None:
    """Print a result beside the prediction, and save the result if there was a prediction.

    Parameters
    ----------
    name : str
        Name of the prediction, as for `predict`.
    value : float, array_like or str
        The result that the cell has computed. Integers are printed in full, other numbers with two
        significant digits.

    Raises
    ------
    InputError
        If `value` is not a number, an array of numbers or a string.
    """
    from IPython.display import display  # outside a notebook, it prints

    as_string("name of a prediction", name)
    result: Any = as_string("value", value) if isinstance(value, str) else _stored_result(value)
    stored = progress.predictions().get(name, {})
    unit = _units.get(name, stored.get("unit", ""))
    shown = value if isinstance(value, str) else format_result(value, unit)
    data = {"name": name, "result": _rounded_result(result), "shown": shown}
    beside = _describe_prediction(stored, result, unit) if "said" in stored else ""
    display(ComparedResult(f"{name}: {shown}{beside}", data))
    if "said" in stored and (isinstance(value, str) or np.all(np.isfinite(result))):
        _save(name, {"is": result}, stored)


def review(lesson: str = "") -> None:
    """Print a table of your predictions: name, prediction, result and how far off you were.

    What you were sure of and got wrong comes first. The last line says how often you were right
    when you were sure, and when you were not.

    Parameters
    ----------
    lesson : str, optional
        Name of a lesson, such as "02" or "C", or of a single prediction, such as "02.c". By default
        all predictions are listed.
    """
    lesson = lesson_name(lesson)
    shown = {
        name: entry
        for name, entry in sorted(progress.predictions().items())
        if "said" in entry and lesson in ("", name, name.split(".")[0])
    }
    if not shown:
        print(f"There are no predictions{f' in lesson {lesson}' if lesson else ''} yet.")
        return
    ordered = sorted(shown.items(), key=lambda item: not _is_sure_and_wrong(item[1]))
    rows = [_review_row(name, entry) for name, entry in ordered]
    print(aligned([("", "you predicted", "result", ""), *rows], "   "))
    if calibration := _calibration(list(shown.values())):
        print(f"You were right {calibration}.")


def _review_row(name: str, entry: dict[str, Any]) -> tuple[str, str, str, str]:
    """Return name, prediction, result, and how far off the prediction was."""
    said, result, unit = entry["said"], entry.get("is"), entry.get("unit", "")
    if result is None:
        return name, _format_answer(said, unit), "not shown yet", ""
    off = _describe_error(said, result, unit)
    if _is_sure_and_wrong(entry):
        off = f"{off}, sure" if off else "sure"
    return name, _format_answer(said, unit), format_result(result, unit), off


def _calibration(entries: list[dict[str, Any]]) -> str:
    """Return in words how often the learner was right, by confidence."""
    parts = []
    for sure, what in ((True, "when you were sure"), (False, "when you were not sure")):
        settled = [entry for entry in entries if entry.get("sure") is sure and "is" in entry]
        right = [is_right(entry["said"], entry["is"], entry.get("unit", "")) for entry in settled]
        if right:
            parts.append(f"{what} {sum(right)} of {len(right)} times")
    return " and ".join(parts)


def aligned(rows: Sequence[Sequence[str]], gap: str) -> str:
    """Write rows of text as a table with columns of equal width."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = (gap.join(map(str.ljust, row, widths)).rstrip() for row in rows)
    return "\n".join(lines)


def _is_sure_and_wrong(entry: dict[str, Any]) -> bool:
    if not entry.get("sure") or "said" not in entry or "is" not in entry:
        return False
    return not is_right(entry["said"], entry["is"], entry.get("unit", ""))


def accepted(result: Any, unit: str) -> Any:
    """Return which predictions count as right."""
    if isinstance(result, str):
        return result
    numbers = result if isinstance(result, list) else [result]
    least = _PART_OF_LARGEST * max(map(abs, numbers)) if len(numbers) > 1 else 0.0
    intervals = []
    for number in numbers:
        is_count = isinstance(number, int) and not unit
        margin = 0.0 if is_count else max(_PART_OF_RESULT * abs(number), least)
        intervals.append((number - margin, number + margin))
    return intervals


def is_right(said: Any, result: Any, unit: str) -> bool:
    """Return whether a prediction counts as right; see `accepted`."""
    right = accepted(result, unit)
    if isinstance(right, str) or isinstance(said, str):
        return str(said).casefold() == str(right).casefold()
    numbers = said if isinstance(said, list) else [said]
    return len(numbers) == len(right) and all(
        low - _ROUNDING <= x <= high + _ROUNDING
        for x, (low, high) in zip(numbers, right, strict=True)
    )


def lesson_name(given: str) -> str:
    """Return the name of a lesson: "2" means lesson 02, and "c" means lesson C."""
    given = as_string("lesson", given)
    if len(given) == 1:
        return f"0{given}" if given.isdigit() else given.upper()
    return given


def _describe_prediction(known: dict[str, Any], result: Any, unit: str) -> str:
    """Return what `compare` writes about the prediction after the result."""
    off = _describe_error(known["said"], result, unit)
    if known.get("sure") and not is_right(known["said"], result, unit):
        off = f"{off}, and you were sure" if off else "and you were sure"
    if off == _RIGHT:
        return ", as you predicted"
    return f"; you predicted {_quoted_answer(known['said'], unit)}{off and f', {off}'}"


def _describe_error(said: Any, result: Any, unit: str) -> str:
    """Return in words how far a prediction is from the result, or "" if they cannot be compared."""
    if isinstance(said, str) or isinstance(result, str):
        return _RIGHT if str(said).casefold() == str(result).casefold() else ""
    if np.shape(said) != np.shape(result):
        return ""
    if isinstance(result, list):
        right = [_describe_error(a, b, unit) for a, b in zip(said, result, strict=True)].count(
            _RIGHT
        )
        return _RIGHT if right == len(result) else f"{right} of {len(result)} right"
    if isinstance(result, int) and not unit:  # a count
        missed = rounded(abs(said - result), digits=_ANSWER_DIGITS)
        return _RIGHT if said == result else f"{missed} too {'many' if said > result else 'few'}"
    texts = (rounded(said), rounded(result))
    if texts[0] == texts[1]:
        return _RIGHT
    if "0" in texts or not np.isfinite(result):
        return ""
    part = rounded(said / result)
    if said / result < 0:
        return "opposite sign"
    return (
        "close"
        if part == "1"
        else f"{part} of the result"
        if said / result < 1
        else f"{part} times the result"
    )


def _save(name: str, entry: dict[str, Any], stored: dict[str, Any]) -> None:
    """Save what is new about a prediction."""
    if any(stored.get(key) != value for key, value in entry.items()):
        progress.append(name, entry | {"time": progress.now()})


def parse_answer(answer: Any, unit: str, choices: Sequence[str], count: int) -> Any:
    """Return the choice or the numbers that a learner's answer means; see `predict`."""
    return _match_choice(answer, choices) if choices else _parse_numbers(answer, unit, count)


def typed_numbers(line: str) -> list[float] | str:
    """Return the numbers in a line such as "12.5", "3, 4" or "[3 4]". Another line stays text.

    The pages of the site read numbers by the same rule, `numbersIn` in due.js.
    """
    text = line.translate(_AS_ASCII).strip(" ")
    if text[:1] + text[-1:] in ("[]", "()"):
        text = text[1:-1].strip(" ")
    parts = re.split(" *[,;] *| +", text)
    return [float(part) for part in parts] if all(map(_NUMBER.fullmatch, parts)) else line


def _match_choice(answer: Any, choices: Sequence[str]) -> str:
    """Return the choice that an answer means."""
    listed = ", ".join(f'"{choice}"' for choice in choices)
    if not isinstance(answer, str) or not answer.strip():
        raise InputError(f"Choose one of {listed}, in quotes.")
    wanted = answer.strip().casefold()
    meant = [choice for choice in choices if choice.casefold() == wanted]
    meant = meant or [choice for choice in choices if choice.casefold().startswith(wanted)]
    if len(meant) == 1:
        return meant[0]
    fault = "matches more than one of" if meant else "matches none of"
    raise InputError(f'"{answer.strip()[:40]}" {fault} {listed}.')


def _parse_numbers(answer: Any, unit: str, count: int) -> Any:
    """Return the number or the list of numbers in a learner's answer."""
    given = numeric_copy(answer)
    wanted = "one number" if count == 1 else f"a list of {count} numbers"
    form = "12.5" if count == 1 else f"[{', '.join(['12.5'] * count)}]"
    right = f"Write {wanted}{f', in {unit}' if unit else ''}, such as {form}."
    if given is None:
        raise InputError(
            f"{'Text' if isinstance(answer, str) else 'This'} cannot be used here. {right}"
        )
    if given.ndim > 1 or given.size != count:
        raise InputError(
            f"{given.size} {'number' if given.size == 1 else 'numbers'} cannot be used here. "
            f"{right}"
        )
    if not np.all(np.abs(given) <= MAX_MAGNITUDE):
        raise InputError(f"This number is infinite, NaN or far too large. {right}")
    said = [int(x) if x.is_integer() else x for x in given.ravel().tolist()]
    return said if count > 1 else said[0]


def _stored_result(value: Any) -> Any:
    """Convert a result to the form that is stored: a number or a flat list."""
    given = numeric_copy(value)
    if given is None:
        raise InputError(
            f"value must be a number, an array of numbers or a string, not {short_repr(value)}."
        )
    whole = np.asarray(value).dtype.kind in "iu"
    kept = [int(x) if whole else float(f"{x:.6g}") for x in np.ravel(given).tolist()]
    return kept if np.ndim(given) else kept[0]


def _rounded_result(result: Any) -> Any:
    """Round a stored result to the digits that are shown, which are equal on all processors."""
    if isinstance(result, str) or np.asarray(result).dtype.kind in "iu":
        return result
    if not np.all(np.isfinite(result)):
        return None
    decimals = rounded_decimals(result)
    return [float(x) for x in decimals] if isinstance(result, list) else float(decimals)


def format_result(value: Any, unit: str) -> str:
    """Write a result as text: integers in full, other numbers with two significant digits."""
    if isinstance(value, str):
        return value
    return rounded(value, unit, digits=12 if np.asarray(value).dtype.kind in "iu" else 2)


def _format_answer(said: Any, unit: str) -> str:
    return said if isinstance(said, str) else rounded(said, unit, digits=_ANSWER_DIGITS, floor=0.0)


def _quoted_answer(said: Any, unit: str) -> str:
    return f'"{said}"' if isinstance(said, str) else _format_answer(said, unit)
