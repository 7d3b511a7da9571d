"""What the README shows works as printed."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, flags=re.MULTILINE | re.DOTALL)


def test_the_twelve_lines_work_as_printed(capsys: pytest.CaptureFixture[str]) -> None:
    code, walks = blocks("python")
    (printed,) = blocks("text")
    assert len([line for line in code.splitlines() if line]) == 12
    names: dict[str, Any] = {}
    exec(compile(code, "README.md", "exec"), names)
    assert capsys.readouterr().out == printed

    run, state = names["run"], names["state"]
    strayed = np.linalg.norm(run.com - state.com, axis=1)
    assert strayed[-1] < 1e-3 < strayed.max()
    assert run.slip().max() < 1e-3
    weight = run.measured[-1].reshape(-1, 3)[:, 2].sum()
    assert weight == pytest.approx(state.robot.weight, rel=0.01)

    exec(compile(walks, "README.md", "exec"), names)  # it goes on where the first ends
    walked = names["run"]
    assert walked.outcome == "completed" and walked.final.com[0] - state.com[0] > 1.0
