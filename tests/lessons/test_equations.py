"""The map equation -> function -> test -> lesson is whole and as it was made."""

from __future__ import annotations

import pytest

from floatbase.lessons.publish import FOLDER, equations

ENTRIES = equations.entries()


@pytest.mark.parametrize("equation", equations.TITLES)
def test_every_equation_has_a_function_that_is_tested(equation: str) -> None:
    here = [entry for entry in ENTRIES if equation in entry.equations]
    assert here, f"no public docstring starts with {equation}"
    untested = [entry.path for entry in here if not entry.tests]
    assert not untested, f"no test names {untested}"


def test_no_docstring_names_an_equation_that_does_not_exist() -> None:
    for entry in ENTRIES:
        assert set(entry.equations) <= set(equations.TITLES), entry.path


def test_the_page_is_the_one_that_the_code_makes() -> None:
    """`python -m floatbase.lessons.publish.equations` writes it."""
    assert (FOLDER / "equations.md").read_text(encoding="utf-8") == equations.table()


def test_a_test_counts_only_where_it_names_the_function() -> None:
    entry = next(entry for entry in ENTRIES if entry.name == "forces_from_torques")
    assert any(test.startswith("dynamics/test_subspace.py") for test in entry.tests)
    assert not any(test.startswith("control/test_active_set.py") for test in entry.tests)
