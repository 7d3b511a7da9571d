"""A class: packages without solutions, own numbers, late days, and gradebooks."""

import ast
import csv
import json
import os
import re
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from hints import MASS, right_answer

from floatbase import lessons
from floatbase.errors import InputError
from floatbase.lessons import all_exercises, check, hand_in, own_numbers, progress, reveal
from floatbase.lessons.publish import gradebook, grades, package
from floatbase.lessons.publish.__main__ import main

EXERCISES = all_exercises()
DUE = datetime(2026, 5, 1, 18, tzinfo=UTC)
LESSONS = ("00", "01", "06")  # of the assignment


pytestmark = pytest.mark.usefixtures("learner")


# the package of an assignment ---------------------------------------------------------------------


@pytest.fixture(scope="module")
def assigned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("class") / "package"
    package.write_assignment(folder, ["1", "05"], teacher="Prof. Curie", until="31 May, 18:00")
    return folder


def texts_of(path):
    """All text of a file, with the strings of a program or a notebook as they are when it runs."""
    text = path.read_bytes().decode("utf-8", "ignore")
    if path.suffix == ".py":
        strings = [
            node.value for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Constant)
        ]
        text += "\n".join(value for value in strings if isinstance(value, str))
    if path.suffix == ".ipynb":
        text += "\n".join("".join(cell["source"]) for cell in json.loads(text)["cells"])
    return text


def squeezed(line):
    return re.sub(r"\s+", "", line)


def test_an_assignment_holds_no_solution(assigned):
    files = [path for path in assigned.rglob("*") if path.is_file()]
    found = {path: texts_of(path) for path in files}
    secret = {(n, t) for n, e in EXERCISES.items() for t in (e.solution, e.explanation) if t}
    assert len(secret) > 60
    assert [(n, p) for n, t in secret for p, text in found.items() if t in text] == []
    # not even a line of a function or of a calculation, except where the stub has it
    programs = {p: squeezed(text) for p, text in found.items() if p.suffix == ".py"}
    for n, e in EXERCISES.items():
        stub = [squeezed(line) for line in e.stub.splitlines()]
        for line in map(squeezed, e.solution.splitlines()):
            is_code = not line.startswith(('"""', "from", "import")) and line not in stub
            if is_code and len(line) > 25:
                assert [p for p, text in programs.items() if line in text] == [], (n, line)
    # the search finds them where they are
    ours = texts_of(Path(lessons.__file__).parent / "lesson05/exercises.py")
    assert all(e.solution in ours for n, e in EXERCISES.items() if n.startswith("05."))
    names = {path.name for path in (assigned / "notebooks").glob("*.ipynb")}
    assert {name.split("_")[0] for name in names} == {"00", "01", "05"}
    assert (assigned / ".binder/jupyterhub_config.py").is_file()
    assert not any("solved" in path.name or "tests" in path.parts for path in files)


def test_an_assignment_checks_answers_and_names_the_teacher(assigned, learner):
    program = (
        "import sys; sys.dont_write_bytecode = True\n"
        "from floatbase.lessons import all_exercises, check, reveal\n"
        "for answer in (3.0, 4.0): check('00.1', answer)\n"
        "reveal('00.1')\n"
        "print(len(all_exercises()))\n"
        "import numpy as np\n"
        "from floatbase.lessons import lessonC\n"
        "names = {'longest_step': 'C.2', 'row_to_drop': 'C.3'}\n"
        "print([all_exercises()[n].judge(getattr(lessonC, f)).right for f, n in names.items()])\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONPATH": str(assigned)},
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stderr
    where, known, defaults = run.stdout.splitlines()
    assert defaults == "[True, True]"  # the lesson continues without the student's functions
    assert "Prof. Curie" in where and "31 May, 18:00" in where and "00.1" in where
    assert int(known) == len(EXERCISES)


def test_an_assignment_needs_known_lessons_and_a_new_folder(assigned, learner, capsys):
    with pytest.raises(InputError, match="99"):
        package.write_assignment(learner / "new", ["99"])
    assert not (learner / "new").exists()
    with pytest.raises(InputError, match="exists already"):
        package.write_assignment(assigned, ["01"])
    with pytest.raises(SystemExit):
        main(["assign", "99", "--to", "new", "--without-solutions"])


# own numbers --------------------------------------------------------------------------------------

OWN = [name for name, exercise in EXERCISES.items() if exercise.own]


@pytest.mark.parametrize("name", OWN)
def test_personal_numbers_have_their_own_right_answers(name):
    exercise = EXERCISES[name]
    assert exercise.own is not None and len(set(exercise.own.values)) > 4
    standard = [answer for answer, hint in exercise.examples() if not hint]
    standard += [a for a, hint in getattr(exercise.judge, "examples", tuple)() if not hint]
    for value in exercise.own.values[:3]:
        judge = exercise.own.judge(value)
        examples = [*getattr(judge, "examples", tuple)()]
        assert all(judge(answer).hint == hint for answer, hint in examples)
        assert not any(judge(answer).right for answer in standard)
        assert str(value).removesuffix(".0") in exercise.own.amount(value)
    assert all(exercise.own.judge(exercise.own.printed)(answer).right for answer in standard)


def test_a_student_always_gets_the_same_numbers(capsys):
    own = EXERCISES["00.1"].own
    values = {student: own.value("00.1", student) for student in map(str, range(60))}
    assert set(values.values()) == set(own.values)
    assert own.value("00.1", "7") == values["7"]
    own_numbers("7")
    printed = capsys.readouterr().out
    assert [line.split(":")[0] for line in printed.splitlines()[1:]] == OWN
    assert f"{values['7']} m/s²" in printed
    assert check("00.1", MASS * (9.81 + values["7"])).right
    for wrong in ("", "a\nb", "a" * 81, 5):
        with pytest.raises(InputError, match="id"):
            own_numbers(wrong)
    assert progress.student() == "7"


def test_an_answer_to_the_printed_number_is_told_the_own_number(learner, capsys):
    for name in OWN:
        own, printed = EXERCISES[name].own, right_answer(name, "")
        assert check(name, printed).right
        own_numbers("S7 ")
        numbers = [own.amount(number) for number in (own.printed, own.value(name, "s7"))]
        capsys.readouterr()
        for verdict in (check(name, printed), check(name, right_answer(name, "s8"))):
            assert not verdict.right and numbers[1] in verdict.text
        assert all(number in check(name, printed).text for number in numbers)
        placeholder = check(name, EXERCISES[name].placeholder())
        assert numbers[1] in placeholder.text and not placeholder.is_try
        reveal(name)
        assert numbers[1] in capsys.readouterr().out
        assert check(name, right_answer(name, "s7")).right
        progress.path().unlink()


@pytest.mark.parametrize(
    ("numbers", "of", "id", "results", "told"),  # without and with --own-numbers
    [
        ("s7", "s7", "", ("right", "right"), (False, False)),
        ("s7", "s7", "S7", ("right", "right"), (False, False)),
        ("s7", "", "", ("wrong", "wrong"), (True, True)),
        ("s8", "s8", "s7", ("right", "wrong"), (True, True)),  # of another student
        ("", "", "s7", ("right", "wrong"), (False, True)),  # the numbers in the lesson
        ("", "", "", ("right", "wrong"), (False, True)),
    ],
)
def test_each_answer_is_graded_by_the_numbers_that_it_uses(
    learner, capsys, numbers, of, id, results, told
):
    if numbers:
        own_numbers(numbers)
    for name in OWN:
        check(name, right_answer(name, of))
    path = hand_in("Ada", id=id)
    for required in (False, True):
        capsys.readouterr()
        main(["grade", str(path), "--table", "marks.csv", *["--own-numbers"] * required])
        printed = capsys.readouterr().out
        rows = list(csv.DictReader((learner / "marks.csv").open(encoding="utf-8")))
        assert {row["result"] for row in rows if row["exercise"] in OWN} == {results[required]}
        assert {name in printed for name in OWN} == {told[required]}


def test_answers_before_and_after_own_numbers_keep_their_numbers(learner, capsys):
    check("00.1", right_answer("00.1", ""))
    check("01.1", right_answer("01.1", ""))
    own_numbers("s7")
    check("06.2", right_answer("06.2", "s7"))
    path = hand_in("Ada")
    said = capsys.readouterr().out
    assert "00.1: your answers do not use the numbers of s7" in said
    assert grades.grade_file(path).right == {"00.1", "01.1", "06.2"}
    assert grades.grade_file(path, own_numbers=True).right == {"01.1", "06.2"}
    with pytest.raises(InputError, match="lesson 05"):
        hand_in("Ada", lesson="5")
    assert hand_in("Ada", lesson="0").name == "answers-Ada-lesson00.json"


# hand-ins of a class ------------------------------------------------------------------------------


def write_answers(path, student, owner):
    """Write a file of right answers to all exercises but one, with the numbers of an owner."""
    names = [n for n in EXERCISES if n.split(".")[0] in LESSONS and n != "06.3"]
    answers = {n: progress.as_json(right_answer(n, owner if n in OWN else "")) for n in names}
    found = {
        "form": "answers to the floatbase course", "name": f"Student {student}", "id": student,
        "time": DUE.isoformat(), "predictions": {"00.a": {"said": "more"}},
        "exercises": {n: {"tries": 1, "right": 1, "answer": a} for n, a in answers.items()},
    }  # fmt: skip
    path.write_text(json.dumps(found))


def test_a_gradebook_matches_files_without_an_id_by_name(learner):
    (learner / "roster.csv").write_text(
        'Student,ID,SIS User ID,Section\n"Curie, Marie",1,m1,A\n"Noether, Emmy",2,e2,A\n'
    )
    check("00.1", 3.0)
    files = [hand_in("marie  CURIE"), hand_in("Emmy Noether", id="e9")]
    table = learner / "points.csv"
    graded = [grades.grade_file(path) for path in files]
    late = datetime.now(UTC) - timedelta(hours=36)
    policy = gradebook.Policy(("00",), due=late, late_days=2)
    args = ("canvas", graded, learner / "roster.csv", table)
    messages = gradebook.write_gradebook(*args, column="=Week", policy=policy)
    assert len(messages) == 2 and "late days used: 2" in "".join(messages)
    assert "e9 matches nobody" in "".join(messages)
    assert [row[-1] for row in csv.reader(table.open())] == ["=Week", "0"]
    with pytest.raises(InputError, match="ID number"):
        gradebook.write_gradebook("moodle", [], table, table, column="Week", policy=policy)


def test_points_are_written_to_the_assignment_of_that_name(learner):
    table = learner / "points.csv"
    (learner / "roster.csv").write_text("Student,ID,Week 1 (bonus) (7),Week 1 (8)\n")
    args = ("canvas", [], learner / "roster.csv", table)
    for column, written in (("Week 1", "Week 1 (8)"), ("Week 1 (bonus)", "Week 1 (bonus) (7)")):
        gradebook.write_gradebook(*args, column=column, policy=gradebook.Policy())
        assert next(csv.reader(table.open())) == ["Student", "ID", written]
        table.unlink()
    with pytest.raises(InputError, match="column"):
        gradebook.write_gradebook(*args, column="ID", policy=gradebook.Policy())


@pytest.mark.parametrize(
    ("kind", "roster"),
    [
        ("canvas", "LastName;FirstName;ID;SIS Login ID;Section;Week\n    Points Possible;;;;;5\n"
         ";;;;;Manual Posting\nCurie;Marie;1;m1;A;\nNoether;Emmy;2;e2;A;4\n"),
        ("moodle", "First name\tLast name\tEmail address\tWeek\n"
         "Marie\tCurie\tm1\t-\nEmmy\tNoether\te2\t4\n"),
    ],
)  # fmt: skip
def test_a_gradebook_reads_other_forms_of_rosters(learner, kind, roster):
    """Importers delete a grade whose cell is empty, so a student without a file has no row."""
    (learner / "roster.csv").write_text(roster, encoding="utf-8-sig")
    check("00.1", MASS * 11.81)
    for one in (hand_in("Marie Curie"), hand_in("Marie", id="m1")):
        table = learner / "points.csv"
        policy = gradebook.Policy(("00",))
        graded = [grades.grade_file(one)]
        args = (kind, graded, learner / "roster.csv", table)
        assert gradebook.write_gradebook(*args, column="Week", policy=policy) == []
        header, *rows = [*csv.reader(table.open())]
        assert header == [name.strip() for name in re.split("[;\t]", roster.splitlines()[0])]
        assert [(row[0].strip(), row[-1]) for row in rows if row[-1] != "1"] == []
        assert len(rows) == (2 if kind == "canvas" else 1)


def results(learner, files, **options):
    metadata = learner / "submission_metadata.json"
    target = learner / "results.json"
    gradebook.write_gradescope_results(files, target, metadata=metadata, **options)
    return dict(json.loads(target.read_text()))


def test_gradescope_gets_a_score_for_each_exercise_and_hides_copied_files(learner):
    for student, owner in (("s00", "s00"), ("s03", "s00"), ("s01", "s01")):
        write_answers(learner / f"{student}.json", student, owner)
    (learner / "s04.json").write_text("{")
    meta = {
        "created_at": (DUE + timedelta(days=1.5)).isoformat(),
        "assignment": {"due_date": DUE.isoformat(), "title": "Week 1"},
        "users": [{"email": "s00@uni.edu", "id": 5, "name": "Student 0"}],
    }
    (learner / "submission_metadata.json").write_text(json.dumps(meta))
    policy = gradebook.Policy(LESSONS, late_days=2)
    found = results(learner, [learner / "s00.json"], policy=policy, own_numbers=True)
    names = [name for name in EXERCISES if name.split(".")[0] in LESSONS]
    assert [test["name"] for test in found["tests"]] == names
    assert found["score"] == sum(test["score"] for test in found["tests"]) == len(names) - 1
    assert {test["status"] for test in found["tests"]} == {"passed", "failed"}
    assert found["extra_data"]["late_days"] == 2
    other = results(learner, [learner / "s03.json"], policy=policy, own_numbers=True)
    assert [t["visibility"] for t in other["tests"]] == ["visible"] * len(names) + ["hidden"]
    late = results(learner, [learner / "s00.json"], policy=gradebook.Policy(LESSONS))
    assert late["score"] == 0 and "Too late" in late["output"]
    for files in ([], [learner / "s04.json"], [learner / "s00.json", learner / "s01.json"]):
        wrong = results(learner, files, policy=policy)
        assert wrong["score"] == 0 and wrong["output"] and "tests" not in wrong
    (learner / "submission_metadata.json").write_text("[")
    assert results(learner, [learner / "s00.json"])["score"] > 0


def test_an_autograder_consists_of_a_package_and_two_programs(learner, capsys):
    options = ["--lessons", "0", "1", "--late-days", "3", "--own-numbers"]
    main(["grade", "--gradescope", "auto", *options])
    folder = learner / "auto"
    for name in ("setup.sh", "run_autograder"):
        assert os.access(folder / name, os.X_OK)
        subprocess.run(["bash", "-n", str(folder / name)], check=True)
    run = (folder / "run_autograder").read_text()
    assert "--late-days 3 --lessons 00 01 --own-numbers" in run
    assert (folder / "floatbase/__init__.py").is_file() and (folder / "pyproject.toml").is_file()
    with pytest.raises(SystemExit):
        main(["grade", "--gradescope", "auto"])
