"""Recall: what was missed comes back soon, what was known later, and nothing else is asked."""

import json
import shutil
import subprocess
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import floatbase.__main__
from floatbase.errors import InputError
from floatbase.lessons import compare, predict, progress, recall
from floatbase.lessons.predictions import is_right, parse_answer, typed_numbers
from floatbase.lessons.publish import NOTEBOOKS, site
from floatbase.lessons.questions import all_questions
from floatbase.lessons.recalling import PER_DAY, ask, due_questions, question_text

RECALLED = [name for name, question in all_questions().items() if question.recall]
DUE_SCRIPT = Path(site.__file__).parent / "static" / "due.js"
START = datetime(2026, 3, 2, 9, tzinfo=UTC)
WEEKS = {0: "00", 1: "01", 7: "02", 9: "03", 14: "04", 21: "05"}  # day -> lesson of that day


HERE = Path(__file__).parent
HISTORIES = json.loads((HERE / "recall_histories.json").read_text(encoding="utf-8"))
NUMBERS = json.loads((HERE / "typed_numbers.json").read_text(encoding="utf-8"))

needs_node = pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
pytestmark = pytest.mark.usefixtures("learner")


def write(learner, entries):
    (learner / "progress.jsonl").write_text("\n".join(json.dumps(entry) for entry in entries))


def settled(name, day, right, sure=None):
    """A line about a prediction, as `predict` and `compare` write it."""
    time = (START + timedelta(days=day)).isoformat()
    question = all_questions()[name]
    result = question.choices[0] if question.choices else [1.0] * question.count
    entry = {"said": result if right else "none", "is": result, "unit": "N", "time": time}
    return {name: entry | ({} if sure is None else {"sure": sure})}


def test_the_course_has_at_least_forty_questions_to_recall_and_they_can_be_read():
    known = all_questions()
    assert len(RECALLED) >= 40
    assert len(known) > 140
    for name in RECALLED:
        text = question_text(known[name])
        assert text.startswith(name) and "?" in text
        assert max(map(len, text.splitlines())) <= 88
        assert "**" not in text and "Predict" not in text


def test_four_weeks_of_a_learner(learner):
    """A learner who knows two of three answers works through a lesson now and then."""
    random = np.random.default_rng(1)
    known = all_questions()
    entries = []
    taught = set()
    asked = {}
    per_day = []
    for day in range(28):
        write(learner, entries)
        now = START + timedelta(days=day, hours=1)
        today = due_questions(now)
        per_day.append(len(today))
        assert {question.name for question in today} <= taught
        for question in today:
            right = bool(random.random() < 2 / 3)
            asked.setdefault(question.name, []).append((day, right))
            event = {"recalled": 1.0, "knew": right, "time": now.isoformat()}
            entries.append({question.name: event})
        if day in WEEKS:
            names = [name for name in known if known[name].lesson == WEEKS[day]]
            entries += [settled(name, day + 0.1, bool(random.random() < 0.5)) for name in names]
            taught |= set(names)
    assert per_day[0] == 0 and max(per_day) == PER_DAY
    assert sum(per_day) > 28  # more than a question a day
    assert len(asked) > 12
    pauses = [(right, b - a) for days in asked.values() for (a, right), (b, _) in pairwise(days)]
    known_pauses, missed_pauses = ([p for right, p in pauses if right is r] for r in (True, False))
    assert min(known_pauses) >= 2 and min(missed_pauses) >= 1
    assert np.mean(known_pauses) > np.mean(missed_pauses)


@pytest.mark.parametrize(
    ("right", "sure", "hours"),
    [(True, None, 48), (False, None, 24), (False, True, 12), (True, True, 48)],
)
def test_a_question_rests_according_to_its_last_answer(learner, right, sure, hours):
    write(learner, [settled("02.d", 0, right, sure)])
    for off, asked in ((-1, []), (1, ["02.d"])):
        now = START + timedelta(hours=hours + off)
        assert [question.name for question in due_questions(now)] == asked


def test_right_answers_double_the_pause(learner):
    entries, day = [settled("02.d", 0, True)], 2.0
    for pause in (4.0, 8.0, 16.0):
        time = (START + timedelta(days=day)).isoformat()
        entries.append({"02.d": {"recalled": 1.0, "knew": True, "time": time}})
        write(learner, entries)
        assert due_questions(START + timedelta(days=day + pause - 0.1)) == []
        assert len(due_questions(START + timedelta(days=day + pause + 0.1))) == 1
        day += pause


def test_what_was_missed_comes_first_and_lessons_are_mixed(learner):
    names = ["01.a", "01.b", "01.d", "02.d", "03.h"]
    write(learner, [settled(name, 0, name != "03.h") for name in names])
    asked = [question.name for question in due_questions(START + timedelta(days=5))]
    assert asked == ["03.h", "01.a", "02.d"]


def test_a_lettered_lesson_asks_nothing_that_was_not_taught_before(learner):
    """Lesson A needs lessons 01 and 02 only, so a learner may open it right after these."""
    known = all_questions()
    entries = [settled(name, 0, False) for name in known if known[name].lesson in ("01", "02")]
    unseen = {"said": 1.0, "time": START.isoformat()}  # predicted, result not seen yet
    write(learner, [*entries, *({name: unseen} for name in known if known[name].lesson == "A")])
    now = START + timedelta(days=30)
    asked = due_questions(now)
    assert len(asked) == PER_DAY
    assert {question.lesson for question in asked} == {"01", "02"}


def test_answers_are_told_and_kept(learner, capsys):
    recall()
    assert "nothing to recall" in capsys.readouterr().out
    predict("02.d", 10, unit="N")
    predict("02.c", "they stay", choices=["they sink", "they stay", "they fly up"])
    with pytest.raises(InputError, match=r"02\.d"):
        recall("02.d", 43)  # its result has not been shown yet
    compare("02.d", 43.1)
    compare("02.c", "they fly up")
    recall()
    assert "nothing" in capsys.readouterr().out.splitlines()[-1]  # not on the same day
    recall("02.d", 43)
    recall("02.d", 12)
    recall("02.d", "heavy")
    recall("02.c", "they fly")
    right, early, wrong, where, _, unusable, choice, _ = capsys.readouterr().out.splitlines()
    assert "right" in right and "43 N" in right and "not yet" in wrong and "lesson 02" in where
    assert "not due" in early
    assert "number" in unusable and "they fly up" in choice
    kept = [event["knew"] for event in progress.history()["02.d"] if "recalled" in event]
    assert kept == [True, False]
    assert progress.predictions()["02.d"]["said"] == 10  # predictions stay as they were


def test_the_command_asks_what_is_due(learner, monkeypatch, capsys):
    entry = {"said": 5, "is": [18, 12], "unit": "", "time": "2026-01-01T00:00:00+00:00"}
    guess = {"01.e": {"said": "true", "is": "false"}}
    write(learner, [{"01.d": entry}, settled("02.d", -60, False), guess])
    answers = iter(["18, 12", "", "__import__('os')"])
    monkeypatch.setattr("builtins.input", lambda prompt: next(answers))
    assert floatbase.__main__.main(["recall"]) == 0
    assert {name: len(events) for name, events in progress.history().items()} == {
        "01.d": 2, "02.d": 1, "01.e": 1,
    }  # fmt: skip
    assert progress.history()["01.d"][-1]["knew"] is True
    ask(lambda prompt: (_ for _ in ()).throw(EOFError))


def random_history(random, names, questions):
    """Lines about some of these questions, with predictions, results and answers to recall()."""
    entries = []
    for name in names:
        result, unit = questions[name]["result"], questions[name]["unit"]
        wrong = "none of them" if isinstance(result, str) else 3.25
        day = random.uniform(-60, 0)
        said = result if random.random() < 0.5 else wrong
        entry = {"said": said, "unit": unit, "time": time_of(day)}
        entry |= {"sure": bool(random.random() < 0.5)} if random.random() < 0.5 else {}
        entries.append({name: entry})
        if random.random() < 0.9:
            entries.append({name: {"is": result, "time": time_of(day + 0.01)}})
        for _ in range(random.integers(0, 4)):
            day += random.uniform(0, 20)
            knew = bool(random.random() < 0.6)
            time = time_of(day) if random.random() < 0.9 else random.choice(["", "soon"])
            entries.append({name: {"recalled": said, "knew": knew, "time": str(time)}})
    random.shuffle(entries)  # as imported answers are
    return entries


def time_of(day):
    return (START + timedelta(days=day)).isoformat(timespec="seconds")


@needs_node
def test_the_site_asks_what_recall_asks(learner):
    """due.js and `due_questions` on the same forty histories."""
    random = np.random.default_rng(2)
    data = site.recall.recall_data([])
    cases, expected = [], []
    for count in [*range(10), *[20, 46] * 15]:
        names = [str(name) for name in random.choice(RECALLED, count, replace=False)]
        write(learner, random_history(random, names, data["questions"]))
        expected.append([question.name for question in due_questions(START)])
        cases.append(progress.history())
    assert {0, PER_DAY} <= {len(names) for names in expected}
    given = data | {"cases": cases, "now": START.timestamp() * 1000}
    assert in_node("cases.map((one) => due(rule, questions, one, now))", given) == expected


def test_each_history_comes_back_when_it_should(learner):
    for case, time, is_due in moments():
        write(learner, [{case["question"]: event} for event in case["events"]])
        assert bool(due_questions(time)) is is_due, (case["claim"], time)


@needs_node
def test_each_history_comes_back_on_the_site_when_it_should():
    cases = [({case["question"]: case["events"]}, time) for case, time, _ in moments()]
    found = in_node(
        "cases.map(([one, now]) => due(rule, questions, one, Date.parse(now)).length > 0)",
        site.recall.recall_data([]) | {"cases": [(one, str(time)) for one, time in cases]},
    )
    for (case, time, is_due), asked in zip(moments(), found, strict=True):
        assert asked is is_due, (case["claim"], time)


def moments():
    """The histories of the table with the moments at which their questions are due, or are not."""
    for case in HISTORIES:
        for answer in ("not due", "due"):
            for time in case[answer]:
                yield case, datetime.fromisoformat(time), answer == "due"


def test_typed_numbers_are_those_of_the_table():
    for row in NUMBERS:
        said = typed_numbers(row["text"])
        if row["numbers"] is None:
            with pytest.raises(InputError):
                parse_answer(said, "", (), row["count"])
        else:
            found = parse_answer(said, "", (), row["count"])
            assert np.atleast_1d(found).tolist() == row["numbers"], row


@needs_node
def test_the_site_reads_the_numbers_of_the_table():
    found = in_node("cases.map(({text, count}) => numbersIn(text, count))", {"cases": NUMBERS})
    assert found == [row["numbers"] for row in NUMBERS]


def in_node(expression, given):
    """The value of an expression of JavaScript with the rules of the site and what is given."""
    names = ", ".join(given)
    program = f"""
        require(process.argv[1]);
        const {{due, numbersIn}} = floatbaseRules;
        const {{{names}}} = JSON.parse(require("fs").readFileSync(0));
        console.log(JSON.stringify({expression}));
    """
    ran = subprocess.run(
        ["node", "-e", program, str(DUE_SCRIPT)],
        input=json.dumps(given), capture_output=True, text=True, check=True,
    )  # fmt: skip
    return json.loads(ran.stdout)


def test_the_page_knows_every_question_and_its_result():
    data = site.recall.recall_data([NOTEBOOKS / "02_equations_of_motion.ipynb"])
    assert list(data["questions"]) == RECALLED
    for name, question in data["questions"].items():
        assert is_right(question["result"], question["result"], question["unit"])
        assert not set("*$`") & set(question["text"] + question["topic"]), name
        in_02 = "lessons/02_equations_of_motion.html" if name.startswith("02") else None
        assert question["address"] == in_02


def test_damaged_times_and_answers_do_no_harm(learner):
    for time in ("", "x", 5, None, "9999-12-31T23:59"):
        write(learner, [{"02.d": {"said": 1.0, "is": 2.0, "unit": "N", "time": time}}])
        due_questions()
    write(
        learner, [{"02.d": {"said": "text", "is": 2.0}}, {"02.d": {"recalled": 3, "knew": "yes"}}]
    )
    assert [question.name for question in due_questions()] == ["02.d"]
    assert not is_right("text", 2.0, "")
