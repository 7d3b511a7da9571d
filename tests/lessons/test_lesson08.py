"""Lesson 08: its helpers do what they say."""

from __future__ import annotations

import re

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.behaviours import support_margin
from floatbase.errors import InputError
from floatbase.lessons.lesson08 import (
    largest_tilt,
    make_controller,
    mean_velocity,
    plot_pendulum_fall,
    plot_support_triangles,
    run_crawl,
    run_go2,
    show_foothold,
    show_shifted_loads,
    smallest_support_margin,
    state_with_moved_body,
    uneven_stance,
)
from floatbase.viewer.scene.colours import GREYS, hex_code

LENGTHS = 1e-9  # m: what Newton's method leaves, and rounding


# helpers ------------------------------------------------------------------------------------------


def test_a_moved_body_keeps_its_feet() -> None:
    state = judges.load("go2").standing()
    moved = state_with_moved_body(state, [0.02, -0.03, 0.01])
    contacts = fb.Contacts.points(state.robot)
    assert np.allclose(contacts.positions(moved), contacts.positions(state), atol=LENGTHS)
    assert np.allclose(moved.q[:3] - state.q[:3], [0.02, -0.03, 0.01], atol=LENGTHS)
    with pytest.raises(InputError, match="cannot put its feet"):
        state_with_moved_body(state, [0.0, 0.0, 1.0])


def test_in_the_uneven_stance_one_foot_stands_further_back() -> None:
    state = uneven_stance()
    contacts = fb.Contacts.points(state.robot)
    away = contacts.positions(state) - contacts.positions(state.robot.standing())
    assert np.allclose(away, np.outer([0, 0, 0, 1], [-0.06, 0, 0]), atol=LENGTHS)


def test_a_record_tells_its_speed_tilt_and_margin() -> None:
    stands = run_go2(judges.controller_of("go2"), 0.3)
    assert np.allclose(mean_velocity(stands, 0.2), 0.0, atol=1e-3) and largest_tilt(stands) < 0.1
    margin = support_margin(stands.com[-1, :2], stands.foot_positions[-1, :, :2])
    assert np.isclose(smallest_support_margin(stands), margin, atol=1e-3)
    crawls = run_crawl(0.25, 0.22, 0.14)
    assert np.isclose(mean_velocity(crawls, 1.88)[0], 0.14, atol=0.01)  # of one period
    assert 1e3 * (crawls.com[-1, 0] - crawls.com[0, 0]) > 600.0
    assert 1e3 * smallest_support_margin(crawls) > 32.0 and crawls.measured[:, 2::3].max() < 80.0


def test_a_push_of_a_run_acts_when_it_is_asked_to() -> None:
    robot = judges.load("go2")
    pushed = run_go2(make_controller(), 0.4, [0.0, 60.0, 0.0], start=0.1)
    (push,) = pushed.pushes
    assert (push.start, push.duration, pushed.outcome) == (0.1, 0.1, "completed")
    assert np.isclose(pushed.time[1], 2e-3) and pushed.robot == robot


# pictures -----------------------------------------------------------------------------------------


def test_plots_have_greys_and_the_colours_of_forces_alone() -> None:
    robot = judges.load("go2")
    state, contacts = robot.standing(), fb.Contacts.points(robot)
    drawn = plot_support_triangles(state, contacts, "FL_foot", "RR_foot").data
    assert drawn.count("<polygon") == 4 and "without RR_foot" in drawn
    assert set(re.findall(r"#[0-9A-F]{6}", drawn)) <= {hex_code(grey) for grey in GREYS}
    falls = plot_pendulum_fall([0.0, 0.1], [0.01, 0.02], 5.0).axes[0].lines
    assert np.allclose(falls[1].get_ydata(), [10.0, 10.0 * np.cosh(0.5)])


def test_panels_tell_loads_and_distances() -> None:
    robot = judges.load("go2")
    view = fb.Viewer(robot)
    try:
        loads = show_shifted_loads(view, robot.standing(), "FL_foot", 0.0, 0.0)
        far = show_foothold(view, robot.standing(), 0.3, 0.25, 0.061)
    finally:
        view.close()
    numbers = [float(text) for text in re.findall(r"(-?[\d.]+) (?:N|mm)", loads)]
    assert np.isclose(sum(numbers[:3]), robot.weight, atol=1.5) and numbers[2:] == [-8.0, 12.5]
    assert [float(text) for text in re.findall(r"(-?[\d.]+) mm", far)] == [61.0, 54.0, 38.0]
