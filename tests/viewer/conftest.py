"""Robots and windows for the viewer's tests, and a page of a real browser if there is one."""

import numpy as np
import pytest
from browsers import launched

from floatbase.dynamics import Contacts
from floatbase.playground import Playground
from floatbase.viewer import Viewer
from floatbase.viewer.transport.window import Window

from .looks import CONTEXTS, SIZE


@pytest.fixture
def contacts(go2):
    return Contacts.points(go2, mu=0.6)


@pytest.fixture
def forces(go2):
    """A quarter of the weight on each foot: inside its cone, on it, outside, inside."""
    quarter = go2.weight / 4
    tangent = np.array([0.1, 0.6, 0.9, 0.0])
    return quarter * np.stack([tangent, np.zeros(4), np.ones(4)], axis=1)


@pytest.fixture
def window():
    with Window() as opened:
        yield opened


@pytest.fixture
def viewer(go2):
    view = Viewer(go2)
    yield view
    view.close()


@pytest.fixture
def field(go2):
    """A playground that runs."""
    started = Playground(go2)
    started.start()
    yield started
    started.close()


@pytest.fixture(scope="package")
def browser():
    yield from launched(f"--max-active-webgl-contexts={CONTEXTS}")


@pytest.fixture(scope="package")
def tab(browser):
    """Open one page for all tests: a new page takes three times as long as a new address in it."""
    opened = browser.new_page()
    yield opened
    opened.close()


@pytest.fixture
def page(tab):
    """Return the page, which fails the test if its script fails."""
    errors = []
    hears = {
        "pageerror": lambda error: errors.append(str(error)),
        "console": lambda line: (
            errors.append(line.text) if line.text.startswith("floatbase") else None
        ),
    }
    tab.set_viewport_size(SIZE)
    for event, hear in hears.items():
        tab.on(event, hear)
    yield tab
    for event, hear in hears.items():
        tab.remove_listener(event, hear)
    tab.goto("about:blank")
    assert errors == []
