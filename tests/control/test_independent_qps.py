"""A sample of the problems of benchmarks/constraints.py, against its independent QPs."""

import sys
from pathlib import Path

import judges
import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("benchmarks are not part of this copy", allow_module_level=True)
sys.path.append(str(BENCHMARKS))

import constraints  # noqa: E402


@pytest.mark.parametrize("kind", constraints.KINDS)
def test_torques_and_verdicts_are_those_of_an_independent_qp(kind):
    solved, size = 0, 2 if kind in constraints.TASKS else 12
    for name in ("go2", "solo12"):
        seeds = np.random.default_rng(5).integers(1_000_000, size=size).tolist()
        result = constraints.compare(kind, judges.load(name), seeds)
        assert result.verdicts == 0 and result.residual < 1e-7
        assert max(result.differences, default=0.0) < constraints.REQUIRED
        solved += len(result.differences)
    assert solved


def test_later_levels_always_have_a_solution():
    """Rows that earlier levels keep depend nearly on each other in these problems."""
    result = constraints.compare("priorities", judges.load("talos"), [3, 8, 18])
    assert result.verdicts == 0 and max(result.differences) < constraints.REQUIRED
