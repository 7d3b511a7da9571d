"""The concept inventory: well formed, from known mistakes, and a gain per concept."""

from __future__ import annotations

from pathlib import Path

import pytest

import floatbase
from floatbase.errors import InputError
from floatbase.lessons import all_exercises, hand_in
from floatbase.lessons.inventory import (
    CONCEPTS,
    KEY,
    LETTERS,
    QUESTIONS,
    gain_report,
    inventory,
    mistakes,
    scores,
    stored_letters,
)
from floatbase.lessons.publish import grades
from floatbase.lessons.publish.__main__ import main
from floatbase.lessons.questions import all_questions


@pytest.fixture(autouse=True)
def learner(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """One who has just begun, in a folder of their own."""
    monkeypatch.setenv("FLOATBASE_HOME", str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_nine_concepts_have_three_questions_with_four_different_answers_each() -> None:
    assert len(CONCEPTS) == 9 and {len(some) for some in CONCEPTS.values()} == {3}
    assert len({question.text for question in QUESTIONS}) == 27
    for question in QUESTIONS:
        assert len(set(question.answers)) == 4
        assert question.answers[question.place] == question.right
    # guessing one letter pays for nobody
    assert all(4 <= KEY.count(letter) <= 9 for letter in LETTERS)


def test_distractors_are_mistakes_that_the_course_knows() -> None:
    lessons = Path(floatbase.__file__).parent / "lessons"
    named = [mistake for q in QUESTIONS for mistake in q.wrong.values() if mistake]
    assert sum(any(q.wrong.values()) for q in QUESTIONS) >= 20 and len(named) >= 36
    for mistake in named:
        name, hint = mistake.split(":")
        if name[-1].isdigit():
            assert name in all_exercises()
            folder = lessons / f"lesson{name.split('.')[0]}"
            assert any(f'"{hint}"' in path.read_text() for path in folder.glob("*.py")), mistake
        else:
            assert hint in all_questions()[name].choices, mistake


def test_two_students_gain_what_they_learned(
    learner: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A guesser learns two concepts; another one knows half and loses nothing."""
    wrong = "".join("b" if right == "a" else "a" for right in KEY)
    files = []
    for name, before, after in (
        ("Ada", wrong, KEY[:6] + wrong[6:]),
        ("Emmy", KEY[:12] + wrong[12:], KEY[:26] + "-"),
    ):
        monkeypatch.setenv("FLOATBASE_HOME", str(learner / name))
        for time, letters in (("before", before), ("after", after)):
            inventory(time, f" {letters[:10].upper()} {letters[10:]}")
        assert stored_letters() == {"before": before, "after": after}
        files.append(str(hand_in(name)))
    first = scores(wrong)
    assert first is not None and set(first.values()) == {0} and scores(KEY[:-1]) is None
    capsys.readouterr()
    main(["grade", *files, "--inventory"])
    report = capsys.readouterr().out.splitlines()[-11:]
    assert report[0].endswith("(2 learners)")
    numbers = {line[:24].strip(): line[24:].split() for line in report[1:]}
    assert numbers["rows without a motor"] == ["50%", "100%", "1.00"]
    assert numbers["drift"] == ["50%", "50%", "0.00"]
    assert numbers["balance"] == ["0%", "33%", "0.33"]
    assert numbers["all"] == ["22%", "59%", "0.48"]
    assert len(mistakes(wrong)) > 5 and mistakes(KEY) == []
    assert grades.grade_file(files[0]).inventory["before"] == wrong


def test_questions_are_printed_without_the_key_and_odd_answers_are_refused(
    capsys: pytest.CaptureFixture[str],
) -> None:
    inventory()
    shown = capsys.readouterr().out
    assert shown.count("   a) ") == 27 and KEY not in shown
    for time, letters in (("before", KEY[:-1]), ("before", "e" * 27), ("now", KEY)):
        with pytest.raises(InputError):
            inventory(time, letters)
    assert stored_letters() == {}
    with pytest.raises(InputError, match="before and after"):
        gain_report([{}, {"before": KEY}, {"before": 5, "after": [KEY]}])
