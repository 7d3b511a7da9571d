"""Lesson 08: its helpers do what they say."""

from __future__ import annotations

import re
from collections.abc import Iterator

import judges
import numpy as np
import pytest
from waiting import until

import floatbase as fb
from floatbase.behaviours import Gait, Stand, Walk, support_margin
from floatbase.errors import InputError
from floatbase.lessons.lesson08 import (
    PushComparison,
    foothold_marks,
    largest_tilt,
    make_controller,
    mean_velocity,
    plot_foot_loads,
    plot_pendulum_fall,
    plot_support_triangles,
    run_crawl,
    run_go2,
    smallest_support_margin,
    state_with_moved_body,
    torque_jump,
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


def test_a_record_tells_its_speed_tilt_margin_and_jumps() -> None:
    robot = judges.load("go2")
    stands = run_go2(judges.controller_of("go2"), 0.3)
    assert np.allclose(mean_velocity(stands, 0.2), 0.0, atol=1e-3) and largest_tilt(stands) < 0.1
    margin = support_margin(stands.com[-1, :2], stands.foot_positions[-1, :, :2])
    assert np.isclose(smallest_support_margin(stands), margin, atol=1e-3)
    crawls = run_crawl(0.25, 0.22, 0.14)
    assert np.isclose(mean_velocity(crawls, 1.88)[0], 0.14, atol=0.01)  # of one period
    assert 1e3 * (crawls.com[-1, 0] - crawls.com[0, 0]) > 600.0
    assert 1e3 * smallest_support_margin(crawls) > 32.0 and crawls.measured[:, 2::3].max() < 80.0
    steep = Walk(
        robot,
        fb.Contacts.points(robot),
        Gait.crawl(robot, 0.25, 0.22, start=0.5),
        (0.14, 0.0),
        ramp=0.0,
    )
    assert torque_jump(run_go2(steep, 2.0)) > 2 * torque_jump(crawls)


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
    record = run_go2(Stand(robot, contacts), 0.2)
    assert len(plot_foot_loads({"a": record, "b": record}, "FR_foot", 0.0, 0.2).axes) == 2
    falls = plot_pendulum_fall([0.0, 0.1], [0.01, 0.02], 5.0).axes[0].lines
    assert np.allclose(falls[1].get_ydata(), [10.0, 10.0 * np.cosh(0.5)])


def test_footholds_lie_on_the_ground_and_others_have_a_label() -> None:
    view = fb.Viewer(judges.load("go2"))
    try:
        marks = foothold_marks(view, {"FL_foot": [0.1, 0.2], "here": [0.0, 0.0]})
        two = foothold_marks(view, {"FL_foot": [0.1, 0.2], "RR_foot": [-0.2, -0.2]})
    finally:
        view.close()
    assert set(two) == {"place/FL_foot", "place/RR_foot", "line"}
    assert np.allclose(two["line"].matrix[:2, 2], [-0.3, -0.4])
    assert set(marks) == {"place/FL_foot", "place/here", "label/here"}
    assert np.allclose(marks["place/FL_foot"].matrix[:2, 3], [0.1, 0.2])


@pytest.fixture
def together() -> Iterator[PushComparison]:
    robot = judges.load("go2")
    contacts = fb.Contacts.points(robot)
    made = PushComparison(
        {"stands": Stand(robot, contacts), "steps": Stand(robot, contacts, Gait.trot(robot))}
    )
    yield made
    made.close()


def test_both_are_pushed_alike_and_one_falls(together: PushComparison) -> None:
    assert [run.status for run in together.runs.values()] == ["paused", "paused"]
    together.force.value = 300.0
    together.push_button.click()
    until(lambda: together.runs["stands"].status == "fell")
    assert together.runs["steps"].status == "running"
    until(lambda: "fell" in together.lines["stands"].value)
    together.reset_button.click()
    until(lambda: together.runs["stands"].status == "running")
    until(lambda: together.lines["stands"].value == "")
