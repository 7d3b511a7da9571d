"""`Jump`: its plan, its flight and its landing, and jumps that motors cannot do."""

from __future__ import annotations

from functools import cache

import judges
import numpy as np
import pinocchio as pin
import pytest
from messages import raises

import floatbase as fb
from floatbase.behaviours import Jump
from floatbase.errors import InputError
from floatbase.simulation import Rollout

PERIOD = 2e-3  # s


@cache
def jumped(name: str, height: float, distance: float) -> tuple[Rollout, Jump]:
    robot = judges.load(name)
    jump = Jump(robot, fb.Contacts.feet(robot, mu=0.6), height, distance, start=0.05)
    return fb.rollout(fb.Simulation(robot), jump, 1.6, control_period=PERIOD), jump


CASES = [("go2", 0.1, 0.0), ("go2", 0.2, 0.2), ("solo12", 0.1, 0.0), ("anymal_kinova", 0.15, 0.1)]


@pytest.mark.parametrize(("name", "height", "distance"), CASES)
def test_a_jump_reaches_its_height_and_distance(name: str, height: float, distance: float) -> None:
    run, _ = jumped(name, height, distance)
    assert run.outcome == "completed"
    rise = run.com[:, 2].max() - run.robot.standing().com[2]
    assert rise == pytest.approx(height, abs=0.01 + 0.05 * height)
    feet = run.foot_positions
    moved = (feet[-1] - feet[0]).mean(axis=0)
    assert moved[0] == pytest.approx(distance, abs=0.02)
    assert moved[1] == pytest.approx(0.0, abs=0.02)
    assert (feet[:, :, 2] - feet[0, :, 2]).min(axis=1).max() > height / 2.0  # all feet in the air
    tilt = np.arccos(1.0 - 2.0 * (run.q[:, 3] ** 2 + run.q[:, 4] ** 2))
    assert np.rad2deg(tilt.max()) < 30.0
    assert np.rad2deg(tilt[-1]) < 1.0
    assert np.linalg.norm(run.v[-1, :3]) < 0.4  # m/s: it rises slowly
    assert np.all(np.abs(run.tau) <= run.robot.torque_limits * (1.0 + 1e-9))


def test_in_flight_energy_and_momentum_follow_the_closed_form() -> None:
    run, jump = jumped("go2", 0.2, 0.2)
    robot, data = run.robot, run.robot.model.createData()
    begin, end = jump.plan.take_off + 0.02, jump.plan.touchdown - 0.04
    indices = np.flatnonzero((run.time > begin) & (run.time < end))
    assert not run.measured[indices].any()
    h = np.array(
        [
            pin.computeCentroidalMomentum(robot.model, data, run.q[i], run.v[i]).vector.copy()
            for i in indices
        ]
    )
    t = run.time[indices] - run.time[indices[0]]
    scale = 2e-3 * robot.mass  # 2 mm/s
    assert np.allclose(h[:, 2], h[0, 2] - robot.weight * t, atol=scale)
    assert np.allclose(h[:, [0, 1, 3, 4, 5]], h[0, [0, 1, 3, 4, 5]], atol=scale)
    # of the centre of mass: m g z + m ż² / 2
    energy = robot.weight * run.com[indices, 2] + h[:, 2] ** 2 / (2.0 * robot.mass)
    assert np.ptp(energy) < 0.01 * robot.weight * 0.2


def test_the_same_jump_can_be_repeated() -> None:
    run, jump = jumped("go2", 0.1, 0.0)
    again = fb.rollout(fb.Simulation(run.robot), jump, 0.3, control_period=PERIOD)
    assert np.array_equal(again.tau, run.tau[: len(again)])
    assert jump.phase == "crouch"


@pytest.mark.parametrize(
    ("name", "height", "distance", "words"),
    [
        ("go2", 0.6, 0.0, ("speed", 15.7)),
        ("solo12", 0.3, 0.0, ("torque", 2.7)),
        ("talos", 0.05, 0.0, ("speed", 7)),
        ("go2", 0.1, 2.0, ("friction", 0.42)),
        ("go2", -0.1, 0.0, ("height", -0.1)),
    ],
)
def test_a_jump_that_motors_or_friction_cannot_do_is_refused(
    name: str, height: float, distance: float, words: tuple[str, ...]
) -> None:
    robot = judges.load(name)
    with raises(InputError, *words):
        Jump(robot, fb.Contacts.feet(robot, mu=0.6), height, distance)
