"""Robots and windows for the viewer's tests, and a real browser where there is one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from browsers import launched

from floatbase.dynamics import Contacts
from floatbase.robots import Robot, State, load
from floatbase.viewer import Viewer, Window


@pytest.fixture(scope="session")
def go2() -> Robot:
    return load("go2")


@pytest.fixture(scope="session")
def standing(go2: Robot) -> State:
    return go2.standing()


@pytest.fixture
def contacts(go2: Robot) -> Contacts:
    return Contacts.points(go2, mu=0.6)


@pytest.fixture
def forces(go2: Robot) -> np.ndarray:
    """A quarter of the weight on each foot: one inside its cone, one on it, one outside, one inside."""
    quarter = go2.weight / 4
    tangent = np.array([0.1, 0.6, 0.9, 0.0])
    return quarter * np.stack([tangent, np.zeros(4), np.ones(4)], axis=1)


@pytest.fixture
def window() -> Iterator[Window]:
    with Window() as opened:
        yield opened


@pytest.fixture
def viewer(go2: Robot) -> Iterator[Viewer]:
    view = Viewer(go2)
    yield view
    view.close()


@pytest.fixture(scope="module")
def browser():
    yield from launched()


@pytest.fixture
def page(browser):
    """A page that fails the test when its script fails."""
    opened = browser.new_page(viewport={"width": 900, "height": 600})
    errors: list[str] = []
    opened.on("pageerror", lambda error: errors.append(str(error)))
    opened.on("console", lambda line: errors.append(line.text) if line.text.startswith("floatbase") else None)
    yield opened
    opened.close()
    assert errors == []
