"""Exercises: right answers are right in each of their forms, and a wrong one gets the hint that its
mistake is named by.
"""

import ast
import warnings
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hints import ODD

import floatbase
from floatbase.lessons import NumericJudge, all_exercises

EXERCISES = all_exercises()
LESSONS = sorted({name.split(".")[0] for name in EXERCISES})
# what gives a hint its name -> which argument that is
NAMED = {"Verdict": 2, "_StepCase": 0, "_Drop": 0}
# tried below, on all exercises
GENERAL = {"no_answer", "not_numbers", "not_finite", "no_cost", "no_least_point"}
# lesson -> hints that no answer is known to get, or not on every machine: what comes that far has
# passed other conditions
GUARDS = {
    "03": {"pulls"}, "05": {"slips"},
    "09": {"in_the_air", "beyond"}, "C": {"empty"}, "P": {"short"},
}  # fmt: skip


@cache
def examples(name):
    exercise = EXERCISES[name]
    return [*getattr(exercise.judge, "examples", tuple)(), *exercise.examples()]


def names_in(lesson):
    """Names of hints that are written in the modules of a lesson."""
    folder = Path(floatbase.__file__).parent / "lessons" / f"lesson{lesson}"
    names = []
    for path in folder.glob("*.py"):
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(call, ast.Call):
                continue
            function = ast.unparse(call.func)
            if function in NAMED:
                names += call.args[NAMED[function] :][:1]
            if function == "first_fault" and isinstance(call.args[0], ast.List):
                names += [row.elts[0] for row in call.args[0].elts if isinstance(row, ast.Tuple)]
    return {str(name.value) for name in names if isinstance(name, ast.Constant)}


@pytest.mark.parametrize("name", EXERCISES)
def test_right_answers_are_right_and_each_mistake_gets_its_hint(name):
    told = [(hint, EXERCISES[name].judge(answer)) for answer, hint in examples(name)]
    for hint, verdict in told:
        assert (verdict.right, verdict.hint) == (not hint, hint)
        assert verdict.text
    assert "" in {hint for hint, _ in told}


@pytest.mark.parametrize("lesson", LESSONS)
def test_every_hint_of_a_lesson_has_an_example(lesson):
    tried = {
        hint for name in EXERCISES if name.startswith(f"{lesson}.") for _, hint in examples(name)
    }
    assert names_in(lesson) - GENERAL - tried == GUARDS.get(lesson, set())


@pytest.mark.parametrize("name", EXERCISES)
def test_nothing_that_a_learner_may_give_makes_a_check_fail(name):
    with warnings.catch_warnings(action="error"):
        told = {kind: EXERCISES[name].judge(odd) for kind, odd in ODD.items()}
    for kind, verdict in told.items():
        assert not verdict.right and verdict.text and verdict.hint, kind
    assert told["nothing"].hint == told["Ellipsis"].hint == "no_answer"


@pytest.mark.parametrize(
    ("answer", "hint"),
    [
        ([[1.0, 2.0], [3.0, 4.0]], ""), ([[1.0, 2.0], [3.0, 4.05]], "nearly"),
        ([[-1, -2], [-3, -4]], "sign"),
        ([[1, 3], [2, 4]], "transpose"), (np.ones((2, 2)), "unknown"),
        ([1.0, 2.0, 3.0, 4.0], "shape"), (1.0, "shape"),
        (np.full((2, 2), np.nan), "not_finite"), ("heavy", "not_numbers"), (..., "no_answer"),
    ],
)  # fmt: skip
def test_answers_are_told_in_any_exercise_what_is_wrong_with_any_answer(answer, hint):
    assert NumericJudge(right=lambda: [[1.0, 2.0], [3.0, 4.0]], praise="")(answer).hint == hint


def test_a_wrong_count_is_told_to_say_what_it_counts():
    assert EXERCISES["10.2"].judge(1).hint == "unknown_count"


def test_a_cost_is_told_from_what_is_none():
    cost = next(answer for answer, hint in examples("04.3") if not hint)
    assert EXERCISES["04.3"].judge(cost.minimizer()).hint == "no_cost"
    assert EXERCISES["04.3"].judge(-1.0 * cost).hint == "no_least_point"
