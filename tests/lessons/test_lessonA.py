"""Lesson A: its helpers do what they say."""

from __future__ import annotations

import re
from functools import cache

import judges
import numpy as np
import pinocchio as pin
import pytest

import floatbase as fb
from floatbase.lessons.lessonA import (
    elliptic_rotation,
    figure_of_eight,
    play_travelling_feet,
    plot_errors,
    show_tumble,
    show_turntable,
    tool_error,
)
from floatbase.simulation import Rollout
from floatbase.viewer.scene.colours import GREYS, hex_code

FEET = ("FL_foot", "FR_foot", "RL_foot", "RR_foot")


def test_the_figure_of_eight_is_closed_and_its_rates_are_its_derivatives() -> None:
    path, d = figure_of_eight(fb.load("ur5").standing(), 3.0), 1e-4
    for t in (0.0, 0.7, 2.1):
        (before, v0, _), (now, v, a), (after, v1, _) = path(t - d), path(t), path(t + d)
        assert np.allclose(path(t + 3.0)[0], now, atol=1e-9)
        assert np.allclose((after - before) / (2 * d), v, atol=1e-5)
        assert np.allclose((v1 - v0) / (2 * d), a, atol=1e-5)


def test_the_tools_error_is_its_distance_from_the_path() -> None:
    robot = fb.load("ur5")
    start = robot.standing()
    sim = fb.Simulation(robot)
    sim.reset(start)
    record = fb.rollout(sim, judges.controller_of("ur5"), 0.06)
    still = np.zeros(6)
    assert tool_error(record, lambda t: (start.q, still, still)) < 1.0
    turned = start.q + 0.1 * np.eye(6)[0]
    away = 1000 * np.linalg.norm(fb.State(robot, turned).point("tool0") - start.point("tool0"))
    assert tool_error(record, lambda t: (turned, still, still)) == pytest.approx(away, abs=1.0)


@pytest.mark.parametrize("phase", [90.0, -90.0, 0.0])
def test_a_circling_base_begins_and_ends_at_rest_and_its_rates_are_its_derivatives(
    phase: float,
) -> None:
    path, d = elliptic_rotation(0.3, 0.35, 0.6, 6, phase), 1e-4
    for t in (0.0, 10.0, 12.0):
        R, omega, alpha = path(t)
        assert np.allclose(R, np.eye(3), atol=1e-9)
        assert np.allclose(np.concatenate([omega, alpha]), 0.0, atol=1e-4)
    for t in (0.6, 3.3, 7.9):
        R, omega, alpha = path(t)
        before, after = path(t - d), path(t + d)
        assert np.allclose(pin.log3(after[0] @ before[0].T) / (2 * d), omega, atol=1e-4)
        assert np.allclose((after[1] - before[1]) / (2 * d), alpha, atol=1e-3)
    angles = np.array([pin.rpy.matrixToRpy(path(t)[0])[1:] for t in np.linspace(2.0, 8.0, 200)])
    assert np.allclose(abs(angles).max(axis=0), [0.3, 0.35], atol=1e-3)


@cache
def circled(yaw: float, phase: float) -> tuple[Rollout, np.ndarray]:
    """On MuJoCo: the record, and how far each foot has gone, (4, 3), mm."""
    robot = fb.load("go2")
    state, contacts = robot.standing(), fb.Contacts.points(robot)
    com, _, _ = fb.standing_tasks(state)
    tasks = [
        com,
        fb.OrientationTask("base", elliptic_rotation(0.3, yaw, 0.6, 6, phase)),
        fb.PostureTask(state.q, weight=1e-3),
    ]
    controller = fb.WholeBodyController(robot, contacts, tasks)
    record = fb.rollout(fb.Simulation(robot), controller, 10.2, control_period=0.002)
    return record, 1000 * np.array([record.final.point(f) - state.point(f) for f in contacts.names])


def test_feet_travel_about_in_proportion_to_the_area_of_the_ellipse() -> None:
    half = circled(0.175, 90.0)[1][:, 1] / circled(0.35, 90.0)[1][:, 1]
    assert np.allclose(half, 0.5, atol=0.1)


def test_the_rider_sees_what_the_particle_does_and_the_table_has_turned() -> None:
    view = fb.Viewer(judges.load("go2"))
    try:
        drawn = show_turntable(view, 2.0, 0.0, 0.5)
        picture = view.renderer.picture
        rest = show_turntable(view, 0.0, 0.5, 1.0)
    finally:
        view.close()
    r = np.hypot(0.7, 0.3)
    assert f"centrifugal, {4 * r:.1f} m/s²" in drawn and f"Coriolis, {8 * r:.1f} m/s²" in drawn
    assert "centrifugal, 0.0" in rest and "<polygon" not in rest
    table = picture["table"].matrix
    assert np.allclose(table[:2, 0], [np.cos(1.0), np.sin(1.0)])
    puck = picture["puck"].matrix[:3, 3]
    assert np.allclose(puck[:2], [-0.7, 0.3])
    assert not [path for path in picture if path.startswith("way/")]  # at rest in the world
    assert len([path for path in picture if path.startswith("chalk/")]) == 24
    assert set(re.findall(r"#[0-9A-F]{6}", drawn)) <= {hex_code(grey) for grey in GREYS}
    assert re.findall(r"<text[^>]*\sfill=", drawn) == []


def test_both_ways_to_write_a_tumble_give_one_acceleration() -> None:
    view = fb.Viewer(judges.load("go2"))
    try:
        told = show_tumble(view, 3.0, 2.0)
        called = [path for path in view.renderer.picture if path.startswith("called/")]
        slower = show_tumble(view, 1.0, 2.0)
        still = show_tumble(view, 3.0, 0.0)
        none = [path for path in view.renderer.picture if path.startswith("called/")]
    finally:
        view.close()
    assert told.endswith("0.0 m/s² apart") and still.endswith("0.0 m/s² apart")
    pushed, less = (
        float(re.findall(r"base's axes \((-?\d+),", text)[0]) for text in (told, slower)
    )
    assert (
        abs(pushed + judges.load("go2").mass * 3.0 * 2.0) < 5
    )  # N: m ω × v, backwards, and the legs' own few newtons
    assert (
        abs(less - pushed - judges.load("go2").mass * 2.0 * 2.0) < 1
    )  # 1 m/s for 3; the text has two digits
    assert (
        called == ["called/base"] and none == []
    )  # about the vertical, in the world's axes hardly anything is left


def test_errors_are_plotted_with_their_slopes() -> None:
    axis = plot_errors([1, 2, 4], {"one": [1, 4, 16], "two": [5, 5, 5]})
    legend = axis.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["one: slope 2.0", "two: slope 0.0"]


def test_the_travelling_feet_are_played_with_marks_where_they_began() -> None:
    robot = judges.load("go2")
    controller = fb.WholeBodyController(
        robot, fb.Contacts.points(robot), fb.standing_tasks(robot.standing())
    )
    view = fb.Viewer(robot)
    try:
        play_travelling_feet(view, fb.rollout(fb.Simulation(robot), controller, 0.3))
        picture = view.renderer.picture
    finally:
        view.close()
    pins = np.array([picture[f"pin/{i}"].matrix[:3, 3] for i in range(4)])
    feet = fb.Contacts.points(robot).positions(robot.standing())
    assert np.allclose(pins[:, 1], feet[:, 1], atol=1e-3) and np.all(
        abs(pins[:, 0]) > abs(feet[:, 0]) + 0.04
    )
