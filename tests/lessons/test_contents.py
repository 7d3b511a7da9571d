"""What the map of equations and the page of conventions are made of; `.ci/lint.py` checks that they
are up to date.
"""

from importlib import import_module

import pytest

from floatbase.dynamics import CONSTRAINT_NOISE
from floatbase.lessons.publish import conventions, equations
from floatbase.linear_algebra import RANK_TOLERANCE
from floatbase.qp import FEASIBILITY_TOLERANCE


@pytest.fixture(scope="module")
def entries():
    return equations.entries()


def test_every_function_stands_in_the_map_once_by_the_path_that_users_import(entries):
    paths = [entry.path for entry in entries]
    assert len(set(paths)) == len(paths)
    for path in paths:
        package, name, *member = path.split(".")
        value = getattr(import_module(f"floatbase.{package}"), name)
        assert hasattr(value, member[0]) if member else callable(value)
    assert {"dynamics.forces_from_torques", "affine.Quadratic.pullback"} <= set(paths)


def test_a_test_counts_only_where_it_names_the_function(entries):
    (entry,) = (entry for entry in entries if entry.path == "dynamics.forces_from_torques")
    assert any(test.startswith("dynamics/test_subspace.py") for test in entry.tests)
    assert not any(test.startswith("qp/") for test in entry.tests)


def test_the_page_of_conventions_has_a_value_and_a_reason_for_every_tolerance():
    shown = {(file, name): value for file, name, value, _ in conventions.tolerances()}
    assert float(shown["linear_algebra", "RANK_TOLERANCE"]) == RANK_TOLERANCE
    assert float(shown["dynamics/constraint_rank", "CONSTRAINT_NOISE"]) == CONSTRAINT_NOISE
    assert float(shown["qp/conflicts", "FEASIBILITY_TOLERANCE"]) == FEASIBILITY_TOLERANCE
    assert shown["qp/solve", "CLARABEL_TOLERANCES"] == "(1e-12, 1e-10, 1e-8)"
    assert all(len(reason) > 15 for *_, reason in conventions.tolerances())
