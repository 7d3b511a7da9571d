"""The map equation -> function -> test -> lesson and the table of lessons are whole and as they were made."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import nbformat
import pytest
from nbformat.v4 import new_markdown_cell, new_notebook

from floatbase.dynamics import MOTION_NOISE
from floatbase.lessons.publish import FOLDER, README, conventions, equations, lesson_table, read, readme_with_table
from floatbase.linear_algebra import RANK_TOLERANCE
from floatbase.qp import FEASIBILITY_TOLERANCE


@pytest.fixture(scope="module")
def entries() -> list[equations.Entry]:
    return equations.entries()


def test_every_equation_has_a_function_that_is_tested(entries: list[equations.Entry]) -> None:
    missing = [f"no public docstring starts with {e}" for e in equations.TITLES if not any(e in x.equations for x in entries)]
    missing += [f"no test names {entry.path}" for entry in entries if not entry.tests]
    unknown = {(entry.path, e) for entry in entries for e in entry.equations if e not in equations.TITLES}
    assert (missing, unknown) == ([], set())


def test_every_function_stands_in_the_map_once_by_the_path_that_users_import(entries: list[equations.Entry]) -> None:
    paths = [entry.path for entry in entries]
    assert len(set(paths)) == len(paths)
    for path in paths:
        room, name, *member = path.split(".")
        value = getattr(import_module(f"floatbase.{room}"), name)
        assert hasattr(value, member[0]) if member else callable(value)
    assert {"dynamics.forces_from_torques", "affine.Quadratic.pullback"} <= set(paths)


def test_a_test_counts_only_where_it_names_the_function(entries: list[equations.Entry]) -> None:
    (entry,) = (entry for entry in entries if entry.path == "dynamics.forces_from_torques")
    assert any(test.startswith("dynamics/test_subspace.py") for test in entry.tests)
    assert not any(test.startswith("qp/") for test in entry.tests)


MADE = "run `python -m floatbase.lessons.publish map`"


def test_the_map_is_the_one_that_the_code_makes() -> None:
    assert (FOLDER / "equations.md").read_text(encoding="utf-8") == equations.table(), MADE


def test_the_page_of_conventions_is_the_one_that_the_code_makes() -> None:
    assert (FOLDER / "conventions.md").read_text(encoding="utf-8") == conventions.page(), MADE


def test_the_page_of_conventions_shows_values_of_three_rooms_and_a_reason_for_every_tolerance() -> None:
    shown = {(file, name): value for file, name, value, _ in conventions.tolerances()}
    assert float(shown["linear_algebra", "RANK_TOLERANCE"]) == RANK_TOLERANCE
    assert float(shown["dynamics/resolve", "MOTION_NOISE"]) == MOTION_NOISE
    assert float(shown["qp/conflicts", "FEASIBILITY_TOLERANCE"]) == FEASIBILITY_TOLERANCE
    assert shown["qp/solve", "CLARABEL"] == "(1e-12, 1e-10, 1e-8)"
    assert all(len(reason) > 15 for *_, reason in conventions.tolerances())


def test_the_table_of_lessons_in_the_readme_is_the_one_that_the_lessons_make() -> None:
    text = README.read_text(encoding="utf-8")
    assert readme_with_table(text) == text, MADE
    assert readme_with_table(text.replace("| ready |", "| soon |")) == text


def spelt_out(ranges: str) -> set[str]:
    """The equations of a text such as "(1)-(3), (5), App. A"."""
    numbers = re.findall(r"\((\d+)\)(?:-\((\d+)\))?", ranges)
    taught = {f"({n})" for first, last in numbers for n in range(int(first), int(last or first) + 1)}
    return taught | set(re.findall(r"App\. [ABC]", ranges))


def test_every_equation_is_taught_in_a_lesson_or_planned_for_one() -> None:
    assert set(equations.TITLES) - set().union(*map(spelt_out, lesson_table().splitlines())) == set()


def test_the_source_of_a_lesson_names_every_equation_that_it_teaches() -> None:
    wrong = {}
    for row in lesson_table().splitlines():
        if name := re.search(r"notebooks/(\w+\.ipynb)", row):
            texts = [cell.source for cell in read(FOLDER / name[1]).cells if cell.cell_type == "markdown"]
            (source,) = (line for text in texts for line in text.splitlines() if line.startswith("**Source**"))
            wrong[name[1]] = spelt_out(row) - spelt_out(source)
    assert {name: missing for name, missing in wrong.items() if missing} == {}


def test_a_planned_lesson_is_ready_once_its_notebook_is_there(tmp_path: Path) -> None:
    lessons = {
        "06_friction_cones": ["# 06 · Cones of friction", ["(28)"], ["(7)", "(1)"], ["(6)", "(5)", "(2)"]],
        "A_turning": ["# A · Turning", ["App. A"]],
    }
    for name, (title, *taught) in lessons.items():
        cells = [new_markdown_cell(title), *(new_markdown_cell("…", metadata={"teaches": some}) for some in taught)]
        nbformat.write(new_notebook(cells=cells), tmp_path / f"{name}.ipynb")
    rows = lesson_table(tmp_path).splitlines()[2:]
    assert rows[1] == "| 06 | [Cones of friction](notebooks/06_friction_cones.ipynb) | (1), (2), (5)-(7), (28) | ready |"
    assert rows[5] == "| A | [Turning](notebooks/A_turning.ipynb) | App. A | ready |"
    assert [row.endswith("| planned |") for row in rows].count(False) == 2
