"""Closed loop: robots stand in MuJoCo under our controller and recover from pushes."""

from functools import cache

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.dynamics import contact_space


@cache
def stood(name: str, duration: float, push: bool = False) -> fb.Rollout:
    """Simulate a standing robot at 1 kHz; if requested, with a push of 30 N for 0.1 s at 0.5 s."""
    robot, controller = judges.load(name), judges.controller_of(name)
    pushes = [fb.Push([15.0, 26.0, 0.0], start=0.5, duration=0.1)] if push else []
    return fb.rollout(fb.Simulation(robot), controller, duration, pushes)


LONG = [("go2", 5.0)]
SHORT = [(name, 1.5) for name in judges.FLOATING if name not in dict(LONG)]


@pytest.fixture(params=[*LONG, *SHORT], ids=lambda p: f"{p[0]} {p[1]:g} s")
def record(request: pytest.FixtureRequest) -> fb.Rollout:
    return stood(*request.param)


def test_it_stands_to_the_end_with_its_centre_of_mass_where_it_was(record):
    assert record.outcome == "completed" and record.error is None
    assert np.linalg.norm(record.final.com - record.robot.standing().com) < 5e-3
    assert np.linalg.norm(record.final.v) < 1e-2


def test_no_foot_slips_more_than_two_millimetres(record):
    assert record.slip().shape == (record.contacts.n_points,)
    assert record.slip(include_rolling=False).max() < 2e-3


def test_planned_and_measured_vertical_forces_agree_at_rest(record):
    planned, measured = (
        rows[-1].reshape(-1, 3)[:, 2] for rows in (record.planned, record.measured)
    )
    assert np.all(planned > 0)
    assert np.allclose(measured, planned, rtol=0.05)


def test_torques_and_forces_settle(record):
    late = slice(-200, None)
    assert np.ptp(record.tau[late], axis=0).max() < 0.01 * np.abs(record.tau[late]).max()
    assert np.ptp(record.measured[late], axis=0).max() < 0.02 * record.robot.weight


def test_after_a_push_of_30_newtons_go2_comes_back():
    record, start = stood("go2", 2.0, push=True), judges.load("go2").standing()
    strayed = np.linalg.norm(record.com - start.com, axis=1)
    assert record.outcome == "completed"
    assert strayed.max() > 3e-3, "the push moved nothing"
    assert strayed[-1] < 1e-3
    assert record.slip(include_rolling=False).max() < 2e-3
    assert np.linalg.norm(record.final.v) < 1e-2


@pytest.mark.parametrize(("backend", "period"), [("compiled", 0.001), ("reference", 0.005)])
def test_solo8_pushed_out_of_its_singular_stance_stands_on(backend, period):
    """Near the symmetric stance, J has small singular values that are useless.

    Noise of q and v makes some of its rows inconsistent there. The robot does not return: once it
    leans, its contacts maintain the lean, because the rank of J is larger by one.
    """
    robot = judges.load("solo8")
    standing = robot.standing()
    controller = fb.WholeBodyController(
        robot, judges.stance(robot), fb.standing_tasks(standing), backend=backend
    )
    push = fb.Push([0.0, 5.0, 0.0], start=0.1, duration=0.1)
    record = fb.rollout(fb.Simulation(robot), controller, 1.5, [push], control_period=period)
    away = np.linalg.norm(record.com - standing.com, axis=1)
    assert record.outcome == "completed"
    assert 5e-3 < away.max() < 15e-3
    assert np.linalg.norm(record.final.v) < 1e-2
    assert record.slip(include_rolling=False).max() < 2e-3
    leaning = fb.equations_of_motion(record.final, judges.stance(robot))
    upright = fb.equations_of_motion(standing, judges.stance(robot))
    assert (contact_space(upright).r, contact_space(leaning).r) == (10, 11)
