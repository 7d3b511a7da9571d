"""Lesson 08: its helpers do what they say, and wrong answers of each kind get the hint that fits."""

from __future__ import annotations

import re
from collections.abc import Iterator

import judges
import numpy as np
import pytest
from hints import missed, right
from waiting import until

import floatbase as fb
from floatbase.behaviours import Gait, Stand, Walk, support_margin
from floatbase.errors import InputError
from floatbase.friction import wrench_set
from floatbase.lessons.lesson08 import (
    PushTogether,
    crawled,
    footholds,
    least_margin,
    moved_body,
    plot_fall,
    plot_loads,
    rose_controller,
    run_of,
    shortest_shift,
    speed,
    tilt,
    torque_jump,
    triangles,
    uneven_stance,
)
from floatbase.viewer import GREYS, hexadecimal

LENGTHS = 1e-9  # m: what Newton's method leaves, and rounding
EDGE = 1e-6  # m: what a linear program leaves


# exercises ------------------------------------------------------------------------------------------------------------------


def shift() -> np.ndarray:
    return 1e3 * shortest_shift(uneven_stance(), "FR_foot")


def test_08_1_takes_the_shortest_way_to_the_edge() -> None:
    assert right("08.1", shift())
    state = uneven_stance()
    corners = wrench_set(state, fb.Contacts.points(state.robot).without("FR_foot")).support_region()
    assert abs(support_margin(state.com[:2] + 1e-3 * shift(), corners)) < EDGE
    assert support_margin(state.com[:2], corners) < -0.02  # m: it has to move


def test_08_1_knows_sign_unit_stance_foot_start_end_and_detours() -> None:
    way, state = shift(), uneven_stance()
    feet = fb.Contacts.points(state.robot).positions(state)[:, :2]
    wrong: list[tuple[object, str]] = [
        (np.zeros(2), "nothing there yet"),
        (-way, "The sign"),
        (way / 1e3, "In mm"),
        (1e3 * shortest_shift(state.robot.standing(), "FR_foot"), "usual stance"),
        (1e3 * shortest_shift(state.robot.standing(), "FR_foot", lambda _: state.com[:2]), "contacts.positions(uneven)"),
        (way[::-1], "The order"),
        (way * [1, -1], "To the left is positive"),
        (way * [-1, 1], "Forwards is positive"),
        (1e3 * shortest_shift(state, "FL_foot"), "frees FL"),
        (1e3 * shortest_shift(state, "FR_foot", lambda _: feet.mean(axis=0)), "middle of the feet"),
        (1e3 * (feet[[0, 2, 3]].mean(axis=0) - state.com[:2]), "middle of the three"),
        ([way @ way / way[0], 0.0], "Straight back"),
        ([0.0, way @ way / way[1]], "Straight to the left"),
        (np.append(way, 0.0), "heights do not count"),
        (30.0, "Two numbers"),
        (None, "no answer yet"),
        ([1.0, 50.0], "Neither right"),
    ]
    assert missed("08.1", wrong) == []


def test_08_2_takes_the_bump_without_jumps_and_knows_those_with() -> None:
    assert right("08.2", 3.2 * np.array([0, 0, 0, 1, -3, 3, -1]))
    cubes = np.array([0, 0, 0, 1.0, -3, 3, -1])
    wrong = [
        (np.zeros(7), "nothing there yet"),
        ([0, 0.2, -0.2, 0, 0, 0, 0], "A parabola"),
        ([0, 0, 0.8, -1.6, 0.8, 0, 0], "the lesson's own"),
        ([0, 0, 0, 0.5, -0.75, 0.3, 0], "stays there"),
        (0.05 * cubes, "the height is not"),
        (64 * cubes, "its height is 1"),
        (3200 * cubes, "In metres"),
        (3.2 * cubes[::-1], "The order"),
        (-3.2 * cubes, "digs"),
        ([0, 0, 0.8, -1.6, 0.8], "Five numbers"),
        (np.ones(6), "Six numbers"),
        (None, "no answer yet"),
        (np.ones(7), "Neither right"),
    ]
    assert missed("08.2", wrong) == []


def test_08_3_takes_the_rule_and_knows_time_mass_rate_height_edge_and_origin() -> None:
    state = judges.load("anymal_kinova").standing()
    robot, h, go2 = state.robot, state.com[2], judges.load("go2").standing()
    x = fb.Contacts.points(robot).positions(state)[:, 0]
    s, omega = state.com[0] - x.min(), np.sqrt(robot.gravity / h)
    rule = robot.mass * omega * s / 0.1
    assert right("08.3", rule)
    wrong = [
        (0.0, "nothing there yet"),
        (0.1 * rule, "Over how long"),
        (rule * robot.gravity, "its weight in place"),
        (rule / omega**2, "not √(h/g)"),
        (rule * omega, "the root is missing"),
        (rule * np.sqrt(h / state.q[2]), "not that of the base"),
        (rule * np.sqrt(h / go2.com[2]), "That ω is go2's"),
        (rule * go2.robot.mass / robot.mass, "That mass is go2's"),
        (rule * go2.robot.mass / robot.mass * np.sqrt(h / go2.com[2]), "Mass and ω are go2's"),
        (rule * (x.max() - state.com[0]) / s, "forwards"),
        (rule * -x.min() / s, "the world's origin"),
        (rule * 0.1 * omega / (1 - np.exp(-0.1 * omega)), "finer than"),
        (-rule, "sign"),
        (None, "no answer yet"),
        (5.0, "Neither right"),
    ]
    assert missed("08.3", wrong) == []


def test_08_4_takes_a_crawl_by_what_it_does() -> None:
    assert right("08.4", [0.3, 0.25, 0.12])


@pytest.mark.parametrize(
    ("design", "hint"),
    [
        ((0.3, 0.1, 0.08), "Too slow, and too near"),
        ((0.3, 0.25, 0.08), "Too slow:"),
        ((0.3, 0.1, 0.13), "Too near to the edge:"),
        ((0.15, 0.1, 0.15), "and a foot stamps"),
        ((0.15, 0.3, 0.13), "A foot stamps:"),
    ],
)
def test_08_4_says_what_a_crawl_lacks(design: tuple[float, ...], hint: str) -> None:
    assert missed("08.4", [(design, hint)]) == []


def test_08_4_knows_what_no_crawl_is() -> None:
    wrong = [
        ((300.0, 250.0, -0.1), "Forwards, please"),
        ((0.01, 0.2, 0.1), "times in seconds"),
        ((0.3, 0.2), "should have shape"),
        (None, "no answer yet"),
    ]
    assert missed("08.4", wrong) == []


# helpers --------------------------------------------------------------------------------------------------------------------


def test_a_moved_body_keeps_its_feet() -> None:
    state = judges.load("go2").standing()
    moved = moved_body(state, [0.02, -0.03, 0.01])
    contacts = fb.Contacts.points(state.robot)
    assert np.allclose(contacts.positions(moved), contacts.positions(state), atol=LENGTHS)
    assert np.allclose(moved.q[:3] - state.q[:3], [0.02, -0.03, 0.01], atol=LENGTHS)
    with pytest.raises(InputError, match="cannot put its feet"):
        moved_body(state, [0.0, 0.0, 1.0])


def test_in_the_uneven_stance_one_foot_stands_further_back() -> None:
    state = uneven_stance()
    contacts = fb.Contacts.points(state.robot)
    away = contacts.positions(state) - contacts.positions(state.robot.standing())
    assert np.allclose(away, np.outer([0, 0, 0, 1], [-0.06, 0, 0]), atol=LENGTHS)


def test_a_record_tells_its_speed_tilt_margin_and_jumps() -> None:
    robot = judges.load("go2")
    stands = run_of(judges.controller_of("go2"), 0.3)
    assert np.allclose(speed(stands, 0.2), 0.0, atol=1e-3) and tilt(stands) < 0.1
    margin = support_margin(stands.com[-1, :2], stands.foot_positions[-1, :, :2])
    assert np.isclose(least_margin(stands), margin, atol=1e-3)
    crawls = crawled(0.3, 0.25, 0.12)
    assert np.isclose(speed(crawls, 2.2)[0], 0.12, atol=0.01)  # of one period
    assert 1e3 * (crawls.com[-1, 0] - crawls.com[0, 0]) > 600.0
    assert 1e3 * least_margin(crawls) > 32.0 and crawls.measured[:, 2::3].max() < 80.0
    steep = Walk(robot, fb.Contacts.points(robot), Gait.crawl(robot, 0.3, 0.25, start=0.5), (0.12, 0.0), ramp=0.0)
    assert torque_jump(run_of(steep, 2.0)) > 2 * torque_jump(crawls)


def test_a_push_of_a_run_acts_when_it_is_asked_to() -> None:
    robot = judges.load("go2")
    pushed = run_of(rose_controller(), 0.4, [0.0, 60.0, 0.0], start=0.1)
    (push,) = pushed.pushes
    assert (push.start, push.duration, pushed.outcome) == (0.1, 0.1, "completed")
    assert np.isclose(pushed.time[1], 2e-3) and pushed.robot == robot


# pictures -------------------------------------------------------------------------------------------------------------------


def test_plots_have_greys_and_the_colours_of_forces_alone() -> None:
    robot = judges.load("go2")
    state, contacts = robot.standing(), fb.Contacts.points(robot)
    drawn = triangles(state, contacts, "FL_foot", "RR_foot").data
    assert drawn.count("<polygon") == 4 and "without RR_foot" in drawn
    assert set(re.findall(r"#[0-9A-F]{6}", drawn)) <= {hexadecimal(grey) for grey in GREYS}
    record = run_of(Stand(robot, contacts), 0.2)
    assert len(plot_loads({"a": record, "b": record}, "FR_foot", 0.0, 0.2).axes) == 2
    falls = plot_fall([0.0, 0.1], [0.01, 0.02], 5.0).axes[0].lines
    assert np.allclose(falls[1].get_ydata(), [10.0, 10.0 * np.cosh(0.5)])


def test_footholds_lie_on_the_ground_and_others_have_a_label() -> None:
    view = fb.Viewer(judges.load("go2"))
    try:
        marks = footholds(view, {"FL_foot": [0.1, 0.2], "here": [0.0, 0.0]})
        two = footholds(view, {"FL_foot": [0.1, 0.2], "RR_foot": [-0.2, -0.2]})
    finally:
        view.close()
    assert set(two) == {"place/FL_foot", "place/RR_foot", "line"}
    assert np.allclose(two["line"].matrix[:2, 2], [-0.3, -0.4])
    assert set(marks) == {"place/FL_foot", "place/here", "label/here"}
    assert np.allclose(marks["place/FL_foot"].matrix[:2, 3], [0.1, 0.2])


@pytest.fixture
def together() -> Iterator[PushTogether]:
    robot = judges.load("go2")
    contacts = fb.Contacts.points(robot)
    made = PushTogether({"stands": Stand(robot, contacts), "steps": Stand(robot, contacts, Gait.trot(robot))})
    yield made
    made.close()


def test_both_are_pushed_alike_and_one_falls(together: PushTogether) -> None:
    assert [run.status for run in together.runs.values()] == ["paused", "paused"]
    together.force.value = 300.0
    together.button.click()
    until(lambda: together.runs["stands"].status == "fell")
    assert together.runs["steps"].status == "running"
    until(lambda: "fell" in together.lines["stands"].value)
    together.reset.click()
    until(lambda: together.runs["stands"].status == "running")
