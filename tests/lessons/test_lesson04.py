"""Lesson 04: its helpers do what they say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import floatbase as fb
from floatbase.lessons import ConstantTorques
from floatbase.lessons.lesson03 import standing_go2_eom, standing_still_beta
from floatbase.lessons.lesson04 import (
    DESIRED_ACCELERATION,
    MinimumCostController,
    cost_slices,
    effort_picture,
    level_curves,
    measured_acceleration,
    show_torques,
)
from floatbase.linear_algebra import null_space, rank

GO2 = fb.load("go2")
EFFORT = fb.Quadratic.from_residual(np.eye(12), np.zeros(12))


def com_cost(eom: Any, desired: Any = DESIRED_ACCELERATION) -> fb.Quadratic:
    return fb.Quadratic.from_residual(
        eom.state.com_jacobian, np.asarray(desired) - eom.state.com_drift
    )


def turn_cost(eom: Any) -> fb.Quadratic:
    return fb.Quadratic.from_residual(
        eom.state.frame_jacobian("base")[3:], -eom.state.frame_drift("base")[3:]
    )


@pytest.mark.parametrize(
    "feet", [("FL_foot", "FR_foot", "RL_foot"), ("FL_foot", "FR_foot", "RL_foot", "RR_foot")]
)
def test_04_2_counts_the_flat_directions_that_accelerate_the_free_foot(
    feet: tuple[str, ...],
) -> None:
    contacts = fb.Contacts.points(GO2, mu=0.7).only(*feet)
    space = fb.feasible_space(fb.equations_of_motion(GO2.standing(), contacts))
    eom = space.eom
    flat = null_space((com_cost(eom) + turn_cost(eom)).pullback(space.qdd).H)
    moving = rank(eom.state.frame_jacobian("RR_foot")[:3] @ space.qdd.A @ flat, absolute=True)
    assert flat.shape[1] == 6 and moving == (3 if len(feet) == 3 else 0)


@pytest.mark.parametrize("desired", [[0, 0.5, 0], [0.5, 0, 0], [0, 0, 1.0]])
def test_the_engine_measures_what_is_desired(desired: list[float]) -> None:
    contacts = fb.Contacts.points(GO2)

    def cost(eom: Any) -> fb.Quadratic:
        return (com_cost(eom, desired) + turn_cost(eom)).pullback(
            fb.accelerations_from_torques(eom)
        ) + 1e-4 * EFFORT

    record = fb.rollout(
        fb.Simulation(GO2), MinimumCostController(GO2, contacts, cost), 0.1, control_period=0.005
    )
    np.testing.assert_allclose(measured_acceleration(record), desired, atol=0.01)


def test_a_falling_robot_is_measured_to_fall() -> None:
    sim = fb.Simulation(GO2)
    q = GO2.standing().q.copy()
    q[2] += 1.0
    sim.reset(fb.State(GO2, q))
    record = fb.rollout(sim, ConstantTorques(np.zeros(12)), 0.1)
    np.testing.assert_allclose(measured_acceleration(record), [0, 0, -9.81], atol=0.01)


def test_the_pictures_are_drawn() -> None:
    bowl = fb.Quadratic.from_residual([[2.0, 0.0], [0.0, 1.0]], [2.0, 1.0])
    valley = fb.Quadratic.from_residual([[1.0, 1.0]], [1.0])
    assert len(cost_slices(one=(bowl, "x", "y", 2.0), two=(valley, "x", "y", 2.0)).axes) == 2
    dots = [
        len(axis.lines)
        for axis in cost_slices(one=(bowl, "x", "y", 2.0), two=(valley, "x", "y", 2.0)).axes
    ]
    assert dots == [1, 0]  # a valley has no least point
    drawn = level_curves(bowl, [1.0, 1.0], 2.0, "x", "y")
    assert (
        "translate(195.0 65.0)" in drawn and 'cx="195.0" cy="65.0"' in drawn
    )  # both at (1, 1): right of and above the middle
    assert "nan" not in level_curves(valley, [0.0, 0.0], 2.0, "x", "y")
    assert len(effort_picture({"a": ([0, 1], [0, 1])}).axes) == 1
    space = fb.feasible_space(standing_go2_eom())
    view = fb.Viewer(GO2)
    try:
        np.testing.assert_allclose(
            show_torques(view, space.eom, space(standing_still_beta(space))[1]), 0.0, atol=1e-9
        )
    finally:
        view.close()
