"""Data that authors of lessons write: metadata of questions, and tables in TOML files."""

import json
from dataclasses import dataclass

import pytest

from floatbase.errors import InputError
from floatbase.lessons import questions
from floatbase.lessons.publish import lesson_notebooks
from floatbase.lessons.records import read_toml, records

SOURCE = 'predict("11.a", ..., unit="N", count=2)'
ABOVE = "## Wheels\n\nA wheel rolls.\n\n**Predict 11.a**: how large are\nthe two forces?"


def read(folder, monkeypatch, **metadata):
    """The questions of a course with one lesson."""
    notebook = {
        "cells": [
            {"cell_type": "markdown", "metadata": {}, "source": [ABOVE]},
            {
                "cell_type": "code",
                "metadata": {"prediction": "11.a", "question": metadata},
                "source": [SOURCE],
            },
        ]
    }
    path = folder / "11_wheels.ipynb"
    path.write_text(json.dumps(notebook))
    monkeypatch.setattr(questions, "lesson_notebooks", lambda: {"11": path})
    return questions.all_questions.__wrapped__()


def test_a_question_is_read_from_the_text_above_its_cell(tmp_path, monkeypatch):
    (found,) = read(tmp_path, monkeypatch, recall=True).values()
    assert found == questions.Question(
        "11.a", "Wheels", "A wheel rolls.", "how large are the two forces?",
        unit="N", count=2, recall=True,
    )  # fmt: skip


def test_metadata_replaces_the_text_of_a_question(tmp_path, monkeypatch):
    (found,) = read(tmp_path, monkeypatch, context="A ball.", text="Which forces?").values()
    assert (found.context, found.text) == ("A ball.", "Which forces?")


@pytest.mark.parametrize("metadata", [{"recal": True}, {"recall": "yes"}, {"reason": 3}])
def test_wrong_metadata_is_named(tmp_path, monkeypatch, metadata):
    with pytest.raises(InputError, match=rf"11\.a.*{next(iter(metadata))}"):
        read(tmp_path, monkeypatch, **metadata)


def test_every_question_with_metadata_is_used_outside_its_lesson():
    cells = [
        cell
        for path in lesson_notebooks().values()
        for cell in json.loads(path.read_bytes())["cells"]
        if "question" in cell["metadata"]
    ]
    assert len(cells) > 60
    for cell in cells:
        question = questions.all_questions()[cell["metadata"]["prediction"]]
        assert question.recall or question.lecture, question.name


@dataclass(frozen=True)
class Row:
    name: str
    text: str = ""


def test_tables_are_read_and_line_breaks_in_texts_are_spaces(tmp_path):
    path = tmp_path / "rows.toml"
    path.write_text("[[row]]\nname = 'a'\ntext = '''\none\ntwo'''\n[[row]]\nname = 'b'\n")
    assert records(read_toml(path)["row"], Row) == [Row("a", "one two"), Row("b")]


@pytest.mark.parametrize("row", ["text = 'x'", "name = 'a'\ntitle = 'b'"])
def test_rows_with_wrong_or_missing_entries_are_named(tmp_path, row):
    path = tmp_path / "rows.toml"
    path.write_text(f"[[row]]\n{row}\n")
    with pytest.raises(InputError, match="name|title"):
        records(read_toml(path)["row"], Row)


def test_a_file_that_is_not_toml_is_named(tmp_path):
    path = tmp_path / "rows.toml"
    path.write_text("[[row\n")
    with pytest.raises(InputError, match=r"rows\.toml"):
        read_toml(path)
