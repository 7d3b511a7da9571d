"""A learner who has just begun."""

from collections import deque

import pytest

from floatbase.lessons import progress


@pytest.fixture
def learner(monkeypatch, tmp_path):
    """The empty folder in which a learner works and keeps progress."""
    monkeypatch.setenv("FLOATBASE_HOME", str(tmp_path))
    monkeypatch.setattr(progress, "unsaved", deque())  # lines of other tests
    monkeypatch.chdir(tmp_path)
    return tmp_path
