"""Predictions: kept in the learner's file, shown beside the result, and never a reason for an
error.
"""

import json
import re

import numpy as np
import pytest
from IPython.core.displaypub import CapturingDisplayPublisher
from IPython.core.interactiveshell import InteractiveShell

from floatbase.errors import InputError
from floatbase.lessons import check, compare, predict, progress, review, rounded
from floatbase.lessons.predictions import RESULT_MIME, is_right

CHOICES = ["in the push", "at rest", "in the first millisecond"]


pytestmark = pytest.mark.usefixtures("learner")


@pytest.fixture
def said(capsys):
    """What was printed since it was last asked for."""
    return lambda: capsys.readouterr().out.splitlines()


def lines(learner):
    """What stands in the learner's file, without times."""
    path = learner / "progress.jsonl"
    text = path.read_text() if path.exists() else ""
    found = [json.loads(line) for line in text.splitlines() if line]
    for entry in (entry for one in found for entry in one.values()):
        entry.pop("time", None)
    return found


@pytest.mark.parametrize(
    ("given", "result", "shown"),
    [
        (400, 69.2, ["69 mm", "400 mm", "5.8"]), (40, 69.2, ["69 mm", "40 mm", "0.58"]),
        (70, 69.2, ["69 mm", "70 mm"]),
        (69, 69.2, ["69 mm"]), (-40, 69.2, ["69 mm", "-40 mm"]), (0, 69.2, ["69 mm", "0 mm"]),
        (3, 1e-12, ["0 mm", "3 mm"]),
        (0, -1e-12, ["0 mm"]), (157.76, 1.0, ["1 mm", "157.76 mm", "160"]), (3, np.nan, ["3 mm"]),
        (3, np.inf, ["3 mm"]),
        ([1, 2], [1.01, 3.3], ["(1, 3.3) mm", "(1, 2) mm", "1", "2"]),
        ([1, 2], [1.0, 2.0], ["(1, 2) mm"]),
        ([1, 2], [1.0, 2.0, 3.0], ["(1, 2, 3) mm", "(1, 2) mm"]),  # of a lesson that has changed
    ],
)  # fmt: skip
def test_a_prediction_is_shown_beside_the_result_and_how_far_off_it_was(said, given, result, shown):
    predict("02.c", given, unit="mm", count=np.size(given))
    compare("02.c", np.array(result))
    before, after = said()
    assert before.startswith("02.c: ") and f"{rounded(given, 'mm', digits=6)}" in before
    found = re.findall(r"\([^)]*\) mm|-?\d+(?:\.\d+)?(?: mm)?", after.removeprefix("02.c: "))
    assert found == shown


@pytest.mark.parametrize("skipped", [(), (...,), (None,)])
def test_a_prediction_may_be_skipped_and_leaves_nothing_behind(learner, said, skipped):
    predict("02.c", *skipped, unit="mm")
    compare("02.c", 69.2)
    review("02")
    assert said()[1] == "02.c: 69 mm"
    assert list(learner.iterdir()) == []


def test_what_was_said_stands_in_a_new_copy_of_the_lesson(said):
    predict("02.c", 40, unit="mm")
    predict("02.c", ..., unit="mm")
    compare("02.c", 69.2)
    assert all("40 mm" in line for line in said())


def test_a_count_is_printed_whole_and_compared_by_difference(said):
    predict("03.a", 5)
    for result in (np.int64(6), 5, 123, 4):
        compare("03.a", result)
    numbers = [re.findall(r"\d+", line.removeprefix("03.a")) for line in said()[1:]]
    assert numbers == [["6", "5", "1"], ["5"], ["123", "5", "118"], ["4", "5", "1"]]


def test_several_numbers_need_no_brackets(said):
    for given in (([1, 2],), (1, 2)):
        predict("03.d", *given, unit="N", count=2)
    first, second = said()
    assert first == second and "(1, 2) N" in first


@pytest.mark.parametrize(
    "answer", ["in the f", "IN THE FIRST MILLISECOND", " In The First ", "in the first millisecond"]
)
def test_a_choice_is_known_by_its_beginning(said, answer):
    predict("00.b", answer, choices=CHOICES)
    compare("00.b", CHOICES[2])
    compare("00.b", CHOICES[1])
    assert progress.predictions() == {"00.b": {"said": CHOICES[2], "unit": "", "is": CHOICES[1]}}
    same, other = said()[1:]
    assert same.count(CHOICES[2]) == 1 and CHOICES[1] in other and CHOICES[2] in other


def test_a_choice_that_is_the_beginning_of_another_is_meant_when_it_is_said():
    predict("00.b", "less", choices=["less", "less than half"])
    assert progress.predictions()["00.b"]["said"] == "less"


@pytest.mark.parametrize("answer", ["in", "rest", "", 3, ["at rest"] * 2])
def test_what_is_no_choice_is_told_with_all_choices(learner, said, answer):
    predict("00.b", answer, choices=CHOICES)
    (line,) = said()
    assert all(choice in line for choice in CHOICES)
    assert lines(learner) == []


UNUSABLE = {
    "text": "40 mm", "truth": True, "not a number": np.nan, "endless": np.inf, "huge": 10**400,
    "complex": 1j, "function": abs,
    "empty": [], "ragged": [[1.0], [1.0, 2.0]], "object": object(), "dictionary": {},
    "decimal comma": (0, 58),
    "matrix": np.eye(1), "five": np.ones(5), "generator": (x for x in (1, 2)),
}  # fmt: skip


@pytest.mark.parametrize("kind", UNUSABLE)
@pytest.mark.parametrize("count", [1, 3])
def test_what_is_no_prediction_is_told_in_one_line(learner, said, kind, count):
    predict("02.c", UNUSABLE[kind], unit="mm", count=count)
    (line,) = said()
    assert "mm" in line and "..." in line
    assert lines(learner) == []


def test_the_same_again_adds_no_line_and_another_does(learner):
    for _ in range(3):
        predict("02.c", 40, unit="mm")
        compare("02.c", 69.2)
        compare("02.c", 69.2 * (1 + 1e-12))  # of another processor
    assert lines(learner) == [{"02.c": {"said": 40, "unit": "mm"}}, {"02.c": {"is": 69.2}}]
    predict("02.c", 50, unit="mm")
    assert lines(learner)[2:] == [{"02.c": {"said": 50, "unit": "mm"}}]


def test_predictions_are_no_tries_and_tries_no_predictions(learner):
    predict("00.a", 40, unit="mm")
    check("00.1", 3.0)
    assert list(progress.load()) == ["00.1"]
    assert progress.predictions() == {"00.a": {"said": 40, "unit": "mm"}}


def test_a_lesson_is_reviewed_and_all_of_them_are(said):
    predict("02.c", 40, unit="mm")
    compare("02.c", 69.2)
    predict("02.a", "at", choices=CHOICES)
    compare("02.a", CHOICES[1])
    predict("03.d", [1, 2], unit="N", count=2)
    said()
    review("02")
    table = said()
    review()
    first, second = table[1:]
    assert first.split()[:5] == ["02.a", *["at", "rest"] * 2]
    assert second.split()[:5] == ["02.c", "40", "mm", "69", "mm"]
    assert first.rindex("at rest") == second.rindex("69 mm")
    assert [line.split()[0] for line in said()] == ["you", "02.a", "02.c", "03.d"]
    for name, rows in (("2", ["02.a", "02.c"]), ("02.c", ["02.c"]), ("03.d", ["03.d"])):
        review(name)
        assert [line.split()[0] for line in said()] == ["you", *rows]


def test_a_lesson_named_by_a_letter_comes_after_the_numbered_ones(said):
    for name in ("C.b", "07.a", "C.a", "A.a"):
        predict(name, 2)
        compare(name, 3)
    said()
    shown = {"": ["07.a", "A.a", "C.a", "C.b"], "C": ["C.a", "C.b"], "c": ["C.a", "C.b"]}
    for lesson, rows in shown.items():
        review(lesson)
        assert [line.split()[0] for line in said()][1:] == rows
    review("B")
    (line,) = said()
    assert "lesson B" in line


DAMAGED = (
    "null", "5", "[1]", '"a"', "\0", "[" * 100_000, '{"02.c": 5}', '{"02.c": {}}',
    '{"02.c": {"said": null}}',
    '{"02.c": {"said": NaN, "is": Infinity}}', '{"02.c": {"said": [], "unit": 3}}',
    '{"02.c": {"said": [1, "a"]}}',
    '{"02.c": {"said": true}}', '{"02.c": {"said": 1e400}}', '{"02.c": {"said": {"is": 1}}}',
    '{"02.c": {"said": "\\ud800"}}',
    '{"\\ud800": {"said": 1}}', '{"02.c": {"said": 1' + "0" * 400 + "}}", '{"02.c": {"said": 4',
)  # fmt: skip


@pytest.mark.parametrize("text", DAMAGED)
def test_damage_is_left_out_and_left_as_it_is(learner, said, text):
    (learner / "progress.jsonl").write_text(text)
    compare("02.c", 69.2)
    review()
    predict("02.c", 40, unit="mm")
    compare("02.c", 69.2)
    review()
    alone, none, _, beside, *table = said()
    assert alone.startswith("02.c: 69") and "02.c" not in none
    assert "69 mm" in beside and "40 mm" in beside and "02.c" in table[1]
    assert (learner / "progress.jsonl").read_text().startswith(text)


@pytest.mark.parametrize("before", ["a text", [1, 2]])
def test_what_was_said_to_another_question_of_that_name_does_no_harm(said, before):
    progress.append("02.c", {"said": before, "unit": "mm"})
    compare("02.c", 69.2)
    review()
    assert said()[0].startswith("02.c: 69 mm")


def test_a_name_that_was_left_out_is_missed():
    for call in (lambda: predict(3.0, unit="N"), lambda: compare(3.0, 2.0), lambda: review(2)):
        with pytest.raises(InputError, match="string"):
            call()
    assert progress.predictions() == {}


@pytest.mark.parametrize("nothing", [None, True, {}, 1j])
def test_a_result_that_is_none_is_refused(nothing):
    with pytest.raises(InputError, match="value"):
        compare("02.c", nothing)


def test_what_was_sure_and_wrong_comes_first_and_calibration_last(learner, said):
    for name, answer, result, sure in (
        ("02.c", 70, 69.2, True),
        ("02.d", 3, 43.0, False),
        ("02.e", 5, 80.0, True),
        ("02.f", 90, 80.0, None),
    ):
        predict(name, answer, unit="mm", sure=sure)
        compare(name, result)
    lines = said()
    assert "not sure" in lines[2] and "you were sure" in lines[5] and "sure" not in lines[6]
    review()
    _, *table, calibration = said()
    assert [line.split()[0] for line in table] == ["02.e", "02.c", "02.d", "02.f"]
    assert [line.endswith("sure") for line in table] == [True, False, False, False]
    assert re.findall(r"\d+ of \d+", calibration) == ["1 of 2", "0 of 1"]
    assert progress.predictions()["02.d"]["sure"] is False
    with pytest.raises(InputError, match="sure"):
        predict("02.c", 70, sure="yes")


@pytest.mark.parametrize(
    ("said", "result", "unit", "right"),
    [
        (45.0, 43.0, "N", True), (48.0, 43.0, "N", False), (-43.0, 43.0, "N", False),
        (5, 6, "", False), (6, 6, "", True), (0, 0.0, "N", True), (0.1, 0.0, "N", False),
        ([10, -10, 0], [9.8, -10.2, 0.1], "N·m", True), ([10, -10], [9.8, -10.2, 0.1], "N", False),
        ("Yes", "yes", "", True), ("yes", 3, "", False), (3, "yes", "", False),
    ],
)  # fmt: skip
def test_a_prediction_counts_as_right_within_a_tenth_of_the_result(said, result, unit, right):
    assert is_right(said, result, unit) is right


@pytest.mark.parametrize(
    ("result", "data"),
    [
        (43.1349, 43.0), (np.int64(1234), 1234), ([9.81, -10.2, 1e-9], [9.8, -10.0, 0.0]),
        ("at rest", "at rest"), (np.nan, None),
    ],
)  # fmt: skip
def test_a_result_travels_as_data_with_the_digits_that_are_shown(result, data):
    """Digits that are not shown differ from processor to processor."""
    publisher = CapturingDisplayPublisher()
    shell = InteractiveShell.instance(display_pub_class=CapturingDisplayPublisher)
    try:
        shell.display_pub = publisher
        compare("02.c", result)
    finally:
        InteractiveShell.clear_instance()
    (output,) = publisher.outputs
    text = output["data"]["text/plain"]
    assert output["data"][RESULT_MIME] == {
        "name": "02.c", "result": data, "shown": text.removeprefix("02.c: "),
    }  # fmt: skip
