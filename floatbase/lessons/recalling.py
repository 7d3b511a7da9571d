"""Recall: ask questions from earlier lessons again after days, missed questions first."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any

from floatbase._validation import short_repr
from floatbase.errors import InputError
from floatbase.lessons import progress
from floatbase.lessons.predictions import format_result, is_right, parse_answer, typed_numbers
from floatbase.lessons.questions import Question, all_questions

PER_DAY = 3  # questions at a time
FIRST_PAUSE, GROWTH = timedelta(days=2), 2  # after a right answer, and how the pause grows
LONGEST_PAUSE = timedelta(days=365)
MISSED_PAUSE = timedelta(days=1)  # after a wrong answer
SURE_AND_MISSED_PAUSE = timedelta(hours=12)
OLD = timedelta(days=30)  # age of an answer without a time
# times as `recall` and the pages write them; the pages use the same expression
TIME = (
    r"(?!0000)(\d{4}-\d\d-\d\dT(?:[01]\d|2[0-3]):\d\d:\d\d)(?:\.\d{1,6})?"
    r"(?:Z|[+-](?:[01]\d|2[0-3]):[0-5]\d)"
)

# a word without digits and indices; a single letter other than a is a symbol
_FIRST_WORD = re.compile(r"\**([a-z]{2,}|a)(?=[\s,.:;'-])")
_SYMBOLS = {
    "tau": "τ", "lambda": "λ", "xi": "ξ", "omega": "ω", "theta": "θ", "mu": "μ", "psi": "ψ",
    "Delta": "Δ", "times": "×", "cdot": "·", "le": "≤", "ge": "≥", "to": "→",
}  # fmt: skip
_FUNCTIONS = ("cosh", "sinh", "tanh", "arctan")


def recall(name: str = "", *answer: Any) -> None:
    """Ask three questions from earlier lessons again, or answer one of them.

    Only questions whose results you have seen are asked. A question that you missed comes back
    after a day. One that you knew comes back after 2, 4, 8, … days, at most a year. An answer to a
    question that is not due yet does not change its pause. Questions that are asked together are
    from different lessons, if there are enough.

    Parameters
    ----------
    name : str, optional
        Name of a question, such as "02.c". Without it, the questions that are due are printed.
    *answer : float, sequence of float or str
        Your answer, as for `predict`.

    Raises
    ------
    InputError
        If there is no such question, or if you have not seen its result yet.
    """
    if not name:
        asked = due_questions()
        for question in asked:
            print(question_text(question))
            print(f'    Answer with recall("{question.name}", …).\n')
        if not asked:
            print("There is nothing to recall today.")
        return
    settled = _settled()
    if name not in settled:
        raise InputError(
            f"There is no question {short_repr(name)} whose result you have seen. recall() prints "
            f"the questions that are due."
        )
    question, result = settled[name]
    given = answer[0] if len(answer) == 1 else list(answer)
    try:
        said = parse_answer(given, question.unit, question.choices, question.count)
    except InputError as error:
        print(f"{name}: {error}")
        return
    right = is_right(said, result, question.unit)
    print(f"{name}: {'right' if right else 'not yet'}, {format_result(result, question.unit)}.")
    if not right:
        print(f"Look it up in lesson {question.lesson}, {question.topic}.")
    now = datetime.now().astimezone()
    last, pause = _last_answer(progress.history()[name], question, result, now)
    if now - last < pause:
        print("The question was not due yet, so this answer does not change when it comes back.")
    progress.append(name, {"recalled": said, "knew": right, "time": progress.now()})


def due_questions(now: datetime | None = None) -> list[Question]:
    """Return the questions that are due, at most three, the most overdue first."""
    now = now or datetime.now().astimezone()
    history = progress.history()
    overdue = {}
    for name, (question, result) in _settled().items():
        last, pause = _last_answer(history[name], question, result, now)
        if now - last >= pause:
            overdue[name] = (now - last) / pause
    ordered = sorted(overdue, key=lambda name: (-overdue[name], name))
    questions = [all_questions()[name] for name in ordered]
    first = {question.lesson: question for question in reversed(questions)}.values()
    mixed = [question for question in questions if question in first]  # one per lesson
    return [*mixed, *(question for question in questions if question not in first)][:PER_DAY]


def _last_answer(
    events: list[dict[str, Any]], question: Question, result: Any, now: datetime
) -> tuple[datetime, timedelta]:
    """Return when the last answer that counts was given, and how long the question then rests.

    Until the result is shown, the last prediction counts. After that, only an answer to a question
    that is due counts.
    """
    last, pause, is_shown = None, MISSED_PAUSE, False
    for time, event in _in_order(events, now):
        knew = None
        if progress.is_answer(event.get("recalled")):
            knew, is_shown = event.get("knew") is True, True
        elif progress.is_answer(event.get("said")):
            knew = is_right(event["said"], result, question.unit)
        if knew is not None and (last is None or not is_shown or time - last >= pause):
            pause = _next_pause(knew, event, pause if is_shown else MISSED_PAUSE)
            last = time
        is_shown = is_shown or progress.is_answer(event.get("is"))
    return last or now - OLD, pause


def _next_pause(knew: bool, event: dict[str, Any], pause: timedelta) -> timedelta:
    """Return how long a question rests after an answer, from the pause before it."""
    if knew:
        return min(LONGEST_PAUSE, max(FIRST_PAUSE, GROWTH * pause))
    return SURE_AND_MISSED_PAUSE if event.get("sure") is True else MISSED_PAUSE


def _in_order(events: list[dict[str, Any]], now: datetime) -> list[tuple[datetime, dict[str, Any]]]:
    """Sort events by time. Imported answers may be later in the file than in time.

    An event without a time has the time of the event before it. An event in the future has none:
    its clock was wrong.
    """
    times = [_time_of(event) for event in events]
    past = [time if time and time <= now else None for time in times]
    last, timed = min([now - OLD, *filter(None, past)]), []
    for time, event in zip(past, events, strict=True):
        last = time or last
        timed.append((last, event))
    return sorted(timed, key=lambda pair: pair[0])


def _time_of(event: dict[str, Any]) -> datetime | None:
    time = event.get("time")
    if not isinstance(time, str) or not re.fullmatch(TIME, time, re.ASCII):
        return None
    try:
        return datetime.fromisoformat(time)
    except ValueError:  # such as 30 February
        return None


def _settled() -> dict[str, tuple[Question, Any]]:
    """Return the questions whose results the learner has seen, with these results.

    A damaged result counts as not seen. The lesson stores it again.
    """
    seen = progress.predictions()
    return {
        name: (question, seen[name]["is"])
        for name, question in all_questions().items()
        if question.recall
        and {"said", "is"} <= seen.get(name, {}).keys()
        and question.fits(seen[name]["is"])
    }


def question_text(question: Question) -> str:
    """Write a question as plain text, wrapped for a terminal."""
    parts = [f"{question.name}, {question.topic}", question.context, capitalized(question.text)]
    plain = [_plain(part) for part in parts if part]
    lines = [textwrap.fill(part, 88) for part in [*plain, f"({question.form})"]]
    return "\n".join(lines)


def _plain(text: str) -> str:
    """Remove Markdown and LaTeX from a text."""
    text = re.sub(r"\$([^$]+)\$", lambda formula: _plain_formula(formula[1]), text)
    return re.sub(r"[*`]|\[([^\]]*)\]\([^)]*\)", r"\1", text)


def _plain_formula(latex: str) -> str:
    for command, accent in (("dot", "\u0307"), ("ddot", "\u0308"), ("tilde", "\u0303")):
        latex = re.sub(rf"\\{command} *(\\?[A-Za-z]+)", rf"\1{accent}", latex)
    latex = re.sub(r"\\[,;: ]|\\(?:left|right|quad)\b", " ", latex)
    latex = latex.replace("\\tfrac12", "½")
    latex = re.sub(r"\\([A-Za-z]+)", lambda name: _SYMBOLS.get(name[1], name[1]), latex)
    return re.sub(r" +", " ", re.sub(r"[{}]", "", latex)).strip()


def capitalized(text: str) -> str:
    """Begin a text with a capital letter, unless it begins with a symbol or the name of a robot."""
    first = _FIRST_WORD.match(text)
    if first is None or first[1] in _FUNCTIONS:
        return text
    return text[: first.start(1)] + first[1].capitalize() + text[first.end(1) :]


def ask(read: Callable[[str], str] | None = None) -> None:
    """Ask the questions that are due in a terminal."""
    asked = due_questions()
    if not asked:
        print("There is nothing to recall today.")
    for question in asked:
        print(question_text(question))
        try:
            line = (read or input)("> ").strip()
        except EOFError:
            return
        if line:
            recall(question.name, line if question.choices else typed_numbers(line))
        print()
