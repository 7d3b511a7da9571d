"""Predictions: a learner says what a cell will show before it runs; afterwards both stand side by
    side.

What was said is kept in the learner's progress file, on this machine alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from floatbase._validation import MAX_MAGNITUDE, as_string, numeric_copy
from floatbase.errors import InputError
from floatbase.lessons import progress
from floatbase.lessons.rounding import rounded

_ANSWER_DIGITS = 6  # digits of what the learner said: as it was typed
_RIGHT = "right"
# of this process: units of what was asked, and what could not be kept
_units: dict[str, str] = {}
_unsaved: dict[str, dict[str, Any]] = {}


def predict(
    name: str, *answer: Any, unit: str = "", choices: Sequence[str] = (), count: int = 1
) -> None:
    """Say what will happen before a cell shows it. Prints a line; what is no answer is told in
    words and not kept.

    name: of the lesson and the prediction, "02.c" or "C.a".
    answer: a number; a list of `count` numbers; one of `choices`, of which the beginning is enough;
        `...` or none skips it.
    unit: of the number.
    choices: the texts to choose from; without them the answer is a number.
    count: how many numbers.
    """
    _units[as_string("name of a prediction", name)] = unit
    stored = progress.predictions().get(name, {})
    given = answer[0] if len(answer) == 1 else list(answer) or ...
    if given is None or given is Ellipsis:
        before = (stored | _unsaved.get(name, {})).get("said")
        told = (
            f"you said {_quoted_answer(before, unit)}, and that stands."
            if before is not None
            else "skipped. Running on is fine."
        )
        print(f"{name}: {told}")
        return
    try:
        said = (
            _match_choice(given, tuple(choices)) if choices else _parse_numbers(given, unit, count)
        )
    except InputError as error:
        print(f"{name}: {error} Or leave ... there and run on.")
        return
    print(f"{name}: you say {_quoted_answer(said, unit)}.")
    if problem := _save(name, {"said": said, "unit": unit}, stored):
        print(problem)


def compare(name: str, value: Any) -> None:
    """Print the result of what was to be predicted, beside what was said, if anything was; with
    that it is kept.

    name: as in `predict`. value: a number, several, or a text: what the cell has computed. A whole
        number is printed whole, any
    other with two significant digits. Raises `InputError` for anything else.
    """
    as_string("name of a prediction", name)
    result: Any = value if isinstance(value, str) else _stored_result(value)
    stored = progress.predictions().get(name, {})
    known = stored | _unsaved.get(name, {})
    unit = _units.get(name, known.get("unit", ""))
    shown = value if isinstance(value, str) else _format_result(value, unit)
    if "said" not in known:
        print(f"{name}: {shown}")
        return
    off = _describe_error(known["said"], result, unit)
    beside = f"; you said {_quoted_answer(known['said'], unit)}{off and f', {off}'}"
    print(f"{name}: {shown}{', as you said' if off == _RIGHT else beside}")
    if isinstance(value, str) or np.all(np.isfinite(result)):
        _save(name, {"is": result}, stored)


def review(lesson: str = "") -> None:
    """Print what was predicted in a lesson, "02" or "C", or in all of them: name, what was said,
    what it is, how far off.

    The name of one prediction, such as "02.c", prints that one.
    """
    lesson = as_string("lesson", lesson)
    if len(lesson) == 1:  # 2 is lesson 02, and c is lesson C
        lesson = f"0{lesson}" if lesson.isdigit() else lesson.upper()
    stored = progress.predictions()
    known = {
        name: stored.get(name, {}) | _unsaved.get(name, {}) for name in sorted({*stored, *_unsaved})
    }
    rows = [("", "you said", "it is", "")]
    for name, entry in known.items():
        if "said" in entry and lesson in ("", name, name.split(".")[0]):
            said, result, unit = entry["said"], entry.get("is"), entry.get("unit", "")
            shown, off = (
                ("not seen yet", "")
                if result is None
                else (_format_result(result, unit), _describe_error(said, result, unit))
            )
            rows.append((name, _format_answer(said, unit), shown, off))
    if len(rows) == 1:
        print(f"Nothing was predicted{f' in lesson {lesson}' if lesson else ''} yet.")
        return
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print(
            "   ".join(f"{part:{width}}" for part, width in zip(row, widths, strict=True)).rstrip()
        )


def _describe_error(said: Any, result: Any, unit: str) -> str:
    """How far what was said is from the result, in words; "" where that cannot be told."""
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
        return "the other way"
    return (
        "nearly"
        if part == "1"
        else f"{part} of it"
        if said / result < 1
        else f"{part} times as much"
    )


def _save(name: str, entry: dict[str, Any], stored: dict[str, Any]) -> str:
    """Keep what is new. Where it cannot be kept it lives as long as this process; what prevented
    it, or "".
    """
    entry = _unsaved.pop(name, {}) | entry
    if all(stored.get(key) == value for key, value in entry.items()):
        return ""
    problem = progress.append(name, entry)
    if problem:
        _unsaved[name] = entry
    return problem


def _match_choice(answer: Any, choices: Sequence[str]) -> str:
    """The one of `choices` that an answer means."""
    listed = ", ".join(f'"{choice}"' for choice in choices)
    if not isinstance(answer, str) or not answer.strip():
        raise InputError(f"choose one of {listed}, in quotes.")
    wanted = answer.strip().casefold()
    meant = [choice for choice in choices if choice.casefold() == wanted]
    meant = meant or [choice for choice in choices if choice.casefold().startswith(wanted)]
    if len(meant) == 1:
        return meant[0]
    fault = "fits more than one of" if meant else "is none of"
    raise InputError(f'"{answer.strip()[:40]}" {fault} {listed}.')


def _parse_numbers(answer: Any, unit: str, count: int) -> Any:
    """A learner's number, or list of numbers."""
    given = numeric_copy(answer)
    wanted = "one number" if count == 1 else f"a list of {count} numbers"
    form = "12.5" if count == 1 else f"[{', '.join(['12.5'] * count)}]"
    right = f"write {wanted}{f', in {unit}' if unit else ''}, as {form}."
    if given is None:
        raise InputError(
            f"{'a text' if isinstance(answer, str) else 'this'} is no prediction here: {right}"
        )
    if given.ndim > 1 or given.size != count:
        raise InputError(
            f"{given.size} {'number is' if given.size == 1 else 'numbers are'} no prediction here: "
            f"{right}"
        )
    if not np.all(np.abs(given) <= MAX_MAGNITUDE):
        raise InputError(f"this is not finite, or far too large: {right}")
    said = [int(x) if x.is_integer() else x for x in given.ravel().tolist()]
    return said if count > 1 else said[0]


def _stored_result(value: Any) -> Any:
    """A result as it is kept: whole numbers whole, others to six digits, which are the same on
    every processor; lists flat.
    """
    given = numeric_copy(value)
    if given is None:
        raise InputError(
            f"value must be a number, several, or a text, not of the kind {type(value).__name__}."
        )
    whole = np.asarray(value).dtype.kind in "iu"
    kept = [int(x) if whole else float(f"{x:.6g}") for x in np.ravel(given).tolist()]
    return kept if np.ndim(given) else kept[0]


def _format_result(value: Any, unit: str) -> str:
    if isinstance(value, str):
        return value
    return rounded(value, unit, digits=12 if np.asarray(value).dtype.kind in "iu" else 2)


def _format_answer(said: Any, unit: str) -> str:
    return said if isinstance(said, str) else rounded(said, unit, digits=_ANSWER_DIGITS, floor=0.0)


def _quoted_answer(said: Any, unit: str) -> str:
    return f'"{said}"' if isinstance(said, str) else _format_answer(said, unit)
