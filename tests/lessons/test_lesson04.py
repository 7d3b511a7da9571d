"""Lesson 04: its helpers do what they say."""

import numpy as np
import pytest

import floatbase as fb
from floatbase.lessons import ConstantTorques
from floatbase.lessons.lesson04 import (
    DESIRED_ACCELERATION,
    MinimumCostController,
    measured_acceleration,
)

GO2 = fb.load("go2")
EFFORT = fb.Quadratic.from_residual(np.eye(12), np.zeros(12))


def com_cost(eom, desired=DESIRED_ACCELERATION):
    return fb.Quadratic.from_residual(
        eom.state.com_jacobian, np.asarray(desired) - eom.state.com_drift
    )


def turn_cost(eom):
    return fb.Quadratic.from_residual(
        eom.state.frame_jacobian("base")[3:], -eom.state.frame_drift("base")[3:]
    )


@pytest.mark.parametrize("desired", [[0, 0.5, 0], [0.5, 0, 0], [0, 0, 1.0]])
def test_the_engine_measures_the_desired_acceleration(desired):
    contacts = fb.Contacts.points(GO2)

    def cost(eom):
        return (com_cost(eom, desired) + turn_cost(eom)).pullback(
            fb.accelerations_from_torques(eom)
        ) + 1e-4 * EFFORT

    record = fb.rollout(
        fb.Simulation(GO2), MinimumCostController(GO2, contacts, cost), 0.1, control_period=0.005
    )
    np.testing.assert_allclose(measured_acceleration(record), desired, atol=0.01)


def test_a_falling_robot_accelerates_with_gravity():
    sim = fb.Simulation(GO2)
    q = GO2.standing().q.copy()
    q[2] += 1.0
    sim.reset(fb.State(GO2, q))
    record = fb.rollout(sim, ConstantTorques(np.zeros(12)), 0.1)
    np.testing.assert_allclose(measured_acceleration(record), [0, 0, -9.81], atol=0.01)
