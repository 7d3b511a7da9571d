"""The form of the lessons: question, prediction, computed answer, reason, claims."""

import ast
import re
from collections import Counter
from functools import cache
from string import ascii_lowercase
from urllib.parse import unquote

import pytest

from floatbase.lessons import all_exercises
from floatbase.lessons.publish import NOTEBOOKS, equations, lesson_minutes, read_notebook

LONGEST = 88  # characters of a line that JupyterLab shows whole in a window of 1100 px
CLAIMS = "# claims of the text above"
LESSONS = pytest.mark.parametrize(
    "path", sorted(NOTEBOOKS.glob("*.ipynb")), ids=lambda path: path.stem
)
QUESTION = re.compile(r"\*\*Predict( [^*]*)?\*\*:")


@cache
def cells(path):
    return list(read_notebook(path).cells)


def tagged(cell, tag):
    return tag in cell.metadata.get("tags", [])


def code(path):
    return [cell for cell in cells(path) if cell.cell_type == "code"]


def asked(cell):
    """Names of the questions that a text asks."""
    found = QUESTION.findall(cell.source) if cell.cell_type == "markdown" else []
    return [name.strip() for name in found]


def calls(cell, function):
    """The calls of that function in a cell of code."""
    nodes = ast.walk(ast.parse(cell.source)) if cell.cell_type == "code" else ()
    found = [node for node in nodes if isinstance(node, ast.Call)]
    return [call for call in found if ast.unparse(call.func) == function]


def named(path, function):
    """Where a lesson calls `predict` or `compare`, and the names it gives."""
    return [
        (i, ast.literal_eval(call.args[0]))
        for i, cell in enumerate(cells(path))
        for call in calls(cell, function)
    ]


def asserts(cell):
    return cell.cell_type == "code" and any(
        isinstance(node, ast.Assert) for node in ast.walk(ast.parse(cell.source))
    )


def is_typed(value):
    """Whether an expression is an answer that somebody typed: there is no name in it."""
    return not any(isinstance(node, ast.Name) for node in ast.walk(value))


def taught(path):
    """For every text of a lesson, the equations that it says it teaches and those that it writes
    out with their number.
    """
    for cell in cells(path):
        if cell.cell_type == "markdown":
            yield (
                set(cell.metadata.get("teaches", [])),
                {f"({n})" for n in re.findall(r"\\tag\{(.*?)\}", cell.source)},
            )


@LESSONS
def test_predictions_are_named_in_order(path):
    lesson = path.stem.split("_")[0]
    names = [name for cell in cells(path) for name in asked(cell)]
    assert names, "a lesson without a question"
    assert names == [f"{lesson}.{letter}" for letter in ascii_lowercase[: len(names)]]
    assert [name for _, name in named(path, "predict")] == names


@LESSONS
def test_every_question_is_followed_by_an_empty_prediction(path):
    wrong = []
    for before, cell in zip(cells(path), cells(path)[1:], strict=False):
        predicted = calls(cell, "predict")
        if asked(before) and not predicted:
            wrong.append(f"{asked(before)}: no predict(…) right below")
        for call in predicted:
            name = ast.literal_eval(call.args[0])
            body = ast.parse(cell.source).body
            rest = [line for line in body if not isinstance(line, ast.Import | ast.ImportFrom)]
            fits = {
                "the question right above": asked(before) == [name],
                "a cell of its own": len(rest) == 1,
                "... as its answer": [ast.unparse(answer) for answer in call.args[1:]] == ["..."],
                'the tag "predict"': tagged(cell, "predict"),
                "its name as metadata": cell.metadata.get("prediction") == name,
            }
            wrong += [f"{name}: it needs {what}" for what, fit in fits.items() if not fit]
    assert wrong == []
    for cell in cells(path):
        predicts = bool(calls(cell, "predict"))
        assert predicts == tagged(cell, "predict") == ("prediction" in cell.metadata), cell.source


@LESSONS
def test_every_prediction_is_compared_once_with_a_computed_number(path):
    predicted = {name: i for i, name in named(path, "predict")}
    compared = {name: i for i, name in named(path, "compare")}
    assert len(compared) == len(named(path, "compare"))
    assert sorted(compared) == sorted(predicted)
    assert [name for name, i in compared.items() if i <= predicted[name]] == []
    comparing = [call for cell in cells(path) for call in calls(cell, "compare")]
    assert [ast.unparse(call) for call in comparing if is_typed(call.args[1])] == []


@LESSONS
def test_no_cell_between_a_prediction_and_its_reason_asserts_the_answer(path):
    wrong, predicting = [], ""
    for cell in cells(path):
        if cell.cell_type == "markdown":
            predicting = ""
        elif tagged(cell, "predict"):
            predicting = cell.metadata["prediction"]
        elif predicting and (asserts(cell) or tagged(cell, "claims")):
            wrong.append(f"{predicting}: {cell.source}")
    assert wrong == []


@LESSONS
def test_assertions_are_in_folded_cells_without_output(path):
    wrong = []
    for cell in code(path):
        body = ast.parse(cell.source).body
        fits = {
            "asserts outside of its claims": not asserts(cell)
            or any(tagged(cell, t) for t in ("claims", "exercise", "check"))
        }
        if tagged(cell, "claims"):
            fits |= {
                "claims nothing": asserts(cell),
                f"does not begin with {CLAIMS}": cell.source.startswith(CLAIMS),
                "is not folded": cell.metadata.get("jupyter", {}).get("source_hidden") is True,
                "prints": cell.outputs == []
                and not calls(cell, "print")
                and not isinstance(body[-1], ast.Expr),
            }
        wrong += [f"this cell {what}:\n{cell.source}" for what, fit in fits.items() if not fit]
    assert wrong == [], "\n\n".join(wrong)


@LESSONS
def test_code_fits_the_window_and_adds_no_zero_to_hide_a_minus(path):
    lesson = path.stem.split("_")[0]
    sources = [cell.source for cell in code(path)]
    sources += [e.solution for name, e in all_exercises().items() if name.startswith(f"{lesson}.")]
    lines = "\n".join(sources).splitlines()
    assert [line for line in lines if len(line) > LONGEST] == []
    assert [line for line in lines if re.search(r"\+ 0\.0\b(?!\d)", line)] == []


@LESSONS
def test_a_lesson_ends_with_a_review_of_its_predictions(path):
    lesson = path.stem.split("_")[0]
    ((at, call),) = [
        (i, call) for i, cell in enumerate(cells(path)) for call in calls(cell, "review")
    ]
    assert [ast.unparse(part) for part in call.args] == ([] if lesson == "00" else [repr(lesson)])
    assert at > max(i for i, _ in named(path, "compare"))


@LESSONS
def test_all_lessons_except_the_first_begin_with_recall(path):
    recalls = [i for i, cell in enumerate(code(path)) if cell.source.startswith("recall()")]
    assert recalls == ([] if path.stem.startswith("00") else [1])  # after the imports


@cache
def the_map():
    return equations.table()


@LESSONS
def test_the_map_lists_the_equations_that_a_lesson_writes_with_their_numbers(path):
    for teaches, tags in taught(path):
        assert {equation for equation in teaches if not equation.startswith("App.")} == tags
        assert teaches <= set(equations.TITLES), "the map has no such equation"
    parts = re.split(r"^#+ (?=\(|App)", the_map(), flags=re.MULTILINE)
    of_lesson = [part for part in parts if path.name in part]
    here = {e for e in equations.TITLES if any(part.startswith(f"{e} ") for part in of_lesson)}
    missing = {equation for teaches, _ in taught(path) for equation in teaches} - here
    assert missing == set(), "run `python -m floatbase.lessons.publish map`"


@LESSONS
def test_the_stated_time_is_the_computed_time_and_at_most_100_minutes(path):
    stated = re.search(r"\*\*Time\*\* (\d+) minutes", cells(path)[0].source)
    assert stated, "a lesson without a time"
    assert int(stated[1]) == lesson_minutes(path)
    assert int(stated[1]) <= (30 if path.stem.startswith("00") else 100)


@LESSONS
def test_each_picture_has_a_text_that_says_what_is_seen(path):
    texts = {cell.id: cell.metadata.get("alt", "") for cell in code(path)}
    pictures = {cell.id for cell in code(path) if tagged(cell, "picture")}
    assert {name for name, text in texts.items() if text} == pictures
    # a name, such as "3-D picture of go2", does not tell what is seen
    short = [texts[name] for name in pictures if len(texts[name].split()) < 8]
    marked = [texts[name] for name in pictures if re.search(r"[*$`\\]", texts[name])]
    repeated = [text for text, count in Counter(texts.values()).items() if text and count > 1]
    assert short + marked + repeated == []


def test_links_to_lessons_lead_to_headings_as_jupyterlab_names_them():
    pages = {
        path: "\n".join(cell.source for cell in cells(path) if cell.cell_type == "markdown")
        for path in NOTEBOOKS.glob("*.ipynb")
    }
    places = {
        (path.name, heading.replace(" ", "-"))
        for path, text in pages.items()
        for heading in re.findall(r"^#+ (.+)$", text.replace("`", ""), re.MULTILINE)
    }
    docs = [*NOTEBOOKS.glob("*.md"), *(NOTEBOOKS.parent / "docs").glob("*.md")]
    pages |= {path: path.read_text(encoding="utf-8") for path in docs}
    links = {
        (path.name, lesson, unquote(heading))
        for path, text in pages.items()
        for lesson, heading in re.findall(r"\]\([^):]*?(\w+\.ipynb)#([^)]+)\)", text)
    }
    assert len(links) > 60
    assert [link for link in links if link[1:] not in places] == []
