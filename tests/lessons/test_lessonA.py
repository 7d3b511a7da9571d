"""Lesson A: its helpers do what they say."""

import re

import judges
import numpy as np
import pinocchio as pin
import pytest

import floatbase as fb
from floatbase.lessons.lessonA import elliptic_rotation, figure_of_eight, show_tumble, tool_error


def test_the_figure_of_eight_is_closed_and_its_rates_are_its_derivatives():
    path, d = figure_of_eight(fb.load("ur5").standing(), 3.0), 1e-4
    for t in (0.0, 0.7, 2.1):
        (before, v0, _), (now, v, a), (after, v1, _) = path(t - d), path(t), path(t + d)
        assert np.allclose(path(t + 3.0)[0], now, atol=1e-9)
        assert np.allclose((after - before) / (2 * d), v, atol=1e-5)
        assert np.allclose((v1 - v0) / (2 * d), a, atol=1e-5)


def test_the_error_of_the_tool_is_its_distance_from_the_path():
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
def test_a_circling_base_begins_and_ends_at_rest_and_its_rates_are_its_derivatives(phase):
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


def test_a_tumble_has_the_same_acceleration_in_both_frames():
    view, mass = fb.Viewer(judges.load("go2")), judges.load("go2").mass
    try:
        fast, slow, still = (show_tumble(view, *rates) for rates in ((3, 2), (1, 2), (3, 0)))
    finally:
        view.close()
    assert fast.endswith("0.0 m/s² apart") and still.endswith("0.0 m/s² apart")
    force, less = (float(re.findall(r"base's axes \((-?\d+),", text)[0]) for text in (fast, slow))
    assert abs(force + mass * 3.0 * 2.0) < 5  # N: m ω × v, backwards, and a few newtons of the legs
    assert abs(less - force - mass * 2.0 * 2.0) < 1  # N: the text has two digits
