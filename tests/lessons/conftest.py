"""A learner who has just begun."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def learner(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The empty folder in which a learner works and keeps progress."""
    monkeypatch.setenv("FLOATBASE_HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    return tmp_path
