"""Push recovery: the bisection, its symmetry, and the theoretical bounds by other methods."""

from dataclasses import replace
from typing import Any

import judges
import matplotlib.pyplot as plt
import numpy as np
import pytest
from messages import raises, refused
from scipy.linalg import expm
from scipy.spatial import ConvexHull

import floatbase as fb
from floatbase.errors import InfeasibleError, InputError, SimulationError, UnknownNameError
from floatbase.simulation import PushRecovery
from floatbase.viewer.plots import push_recovery_plots

STEP, WATCH = 25.0, 1.2
QUICK = {"resolution": STEP, "observation_time": WATCH, "start": 0.1, "progress": False}


@pytest.fixture(scope="module")
def standing() -> fb.WholeBodyController:
    return judges.controller_of("go2")


@pytest.fixture(scope="module")
def recovery(standing: fb.WholeBodyController) -> PushRecovery:
    return fb.push_recovery(standing, directions=6, workers=2, **QUICK)


def survives(controller: fb.WholeBodyController, angle: float, force: float) -> bool:
    sim = fb.Simulation(controller.robot)
    push = fb.Push([force * np.cos(angle), force * np.sin(angle), 0.0], start=0.1, duration=0.1)
    return fb.rollout(sim, controller, 0.1 + 0.1 + WATCH, [push]).outcome == "completed"


def test_the_push_recovery_map_separates_survival_from_falls_and_is_symmetric(recovery, standing):
    assert np.allclose(recovery.directions, np.deg2rad([0, 60, 120, 180, 240, 300]))
    left, right = recovery.pushes[1:3], recovery.pushes[:3:-1]
    assert np.all(np.abs(left - right) <= STEP)  # go2 is symmetric
    assert survives(standing, recovery.directions[1], recovery.pushes[1])
    assert not survives(standing, recovery.directions[1], recovery.pushes[1] + STEP)
    assert survives(standing, np.pi / 2, 170.0)
    assert "6 directions" in repr(recovery)


def test_theory_agrees_with_the_hull_of_the_feet_and_with_the_torque_that_tips(recovery):
    state, robot = recovery.state, recovery.state.robot
    feet, com = recovery.contacts.positions(state), state.com
    ground, hull = feet[:, 2].mean(), ConvexHull(feet[:, :2])
    height, normals, offsets = com[2] - ground, hull.equations[:, :2], hull.equations[:, 2]
    omega, directions = np.sqrt(robot.gravity / height), recovery.unit_vectors[:, :2]
    # an impulse moves the capture point to the edge; a constant push tips the robot over the edge
    for duration, farther in ((1e-6, 1e-6 / (robot.mass * omega)), (1e2, height / robot.weight)):
        shift = replace(recovery, duration=duration).capture_point_bound * farther
        moved = com[:2] + shift[:, None] * directions
        assert np.allclose((moved @ normals.T + offsets).max(axis=1), 0.0, atol=1e-5)  # m
    # in between: a pendulum with its centre of pressure at the edge, at distance s, has its capture
    # point there at the end of the push
    border = replace(recovery, duration=1e2).capture_point_bound * height / robot.weight
    rates = np.array([[0.0, 1.0, 0.0], [omega**2, 0.0, 1.0], [0.0, 0.0, 0.0]])
    excess = recovery.capture_point_bound / robot.mass - omega**2 * border
    x = expm(recovery.duration * rates)[:, 2:] * excess
    assert np.allclose(x[0] + x[1] / omega, border, rtol=1e-9)
    # one foot alone cannot support the robot; two front feet can only with a push of the right size
    for few in (recovery.contacts.only("FL_foot"), recovery.contacts.only("FL_foot", "FR_foot")):
        falling = replace(recovery, contacts=few)
        assert not falling.capture_point_bound.any() and not falling.static_bound.any()

    # (20), (21): a constant push F at height z tips the robot over an edge at a distance l if F z >
    # m g l and it does not slide
    slack = -(com[:2] @ normals.T + offsets)
    lever = (state.frame_pose("base").translation[2] - ground) * directions @ normals.T
    forces = np.full(lever.shape, np.inf)
    np.divide(robot.weight * slack, lever, out=forces, where=lever > 0.0)
    tips = forces.min(axis=1)
    assert np.all(tips < 0.7 * np.cos(np.pi / 16) * robot.weight)
    # the feet are level to a fraction of a millimetre
    assert np.allclose(recovery.static_bound, tips, rtol=1e-3)
    assert np.all(recovery.static_bound < recovery.pushes)  # a short push can be larger


def test_the_push_recovery_map_is_plotted_and_drawn_to_scale(recovery):
    before = replace(recovery, pushes=recovery.pushes / 2)
    axis = push_recovery_plots.plot(recovery, theory=False, previous=before)
    for line, shown in zip(axis.get_lines(), (recovery, before), strict=True):
        assert np.allclose(line.get_ydata(), [*shown.pushes, shown.pushes[0]])
    with raises(InputError, "polar"):
        push_recovery_plots.plot(recovery, plt.figure().add_subplot())
    plt.close("all")
    other = replace(recovery, directions=recovery.directions[:-1], pushes=recovery.pushes[:-1])
    refused(lambda: push_recovery_plots.plot(recovery, previous=other), InputError, 6, 5)
    near, far = (push_recovery_plots.picture(recovery, scale) for scale in (0.001, 0.002))
    expected = {"push_recovery", "capture_point_bound", "static_bound"}
    assert {path.split("/")[0] for path in near} == expected
    for drawn, radius in ((near, 0.1), (far, 0.2)):
        label, ring = (drawn[f"push_recovery/{kind} 100 N"].matrix for kind in ("label", "ring"))
        assert np.allclose(ring[:2, 3], recovery.state.q[:2])
        assert np.linalg.norm(label[:2, 3] - ring[:2, 3]) == pytest.approx(radius)


def test_push_recovery_refuses_invalid_arguments_and_factories(standing):
    for make, options, error, *named in (
        (standing, {"directions": 2}, InputError, "directions", 2, 3),
        (standing, {"resolution": 0.0}, InputError, "resolution", 0),
        (standing, {"frame": "bass"}, UnknownNameError, "bass", "base"),
        (3, {}, InputError, "push_recovery", 3),
        (lambda: 3, {}, InputError, 3),
        (judges.limp, {}, InputError, "push_recovery", "limp", "q"),
        (lambda: (fb.Simulation(fb.load("ur5")), judges.limp), {}, InputError, "ur5"),
    ):
        with raises(error, *named):
            fb.push_recovery(make, **QUICK | options)


@pytest.mark.front_end
def test_push_recovery_needs_a_robot_that_stands_without_a_push(standing):
    def fails(q: np.ndarray, v: np.ndarray, t: float) -> Any:
        raise InfeasibleError("no torque")

    vars(fails)["robot"] = standing.robot
    limp = (fb.Simulation(standing.robot), judges.limp)
    for make, reason in ((lambda: fails, "no torque"), (lambda: limp, 0)):
        with raises(SimulationError, reason):
            fb.push_recovery(make, directions=3, workers=1, **QUICK)
