"""A learner who has just begun."""

import pytest


@pytest.fixture
def learner(monkeypatch, tmp_path):
    """The empty folder in which a learner works and keeps progress."""
    monkeypatch.setenv("FLOATBASE_HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    return tmp_path
