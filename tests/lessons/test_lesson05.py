"""Lesson 05: its helpers do what they say."""

import numpy as np
import pytest
from hints import right

import floatbase as fb
from floatbase.control import AnalyticController
from floatbase.lessons.lesson03 import standing_go2_eom
from floatbase.lessons.lesson05 import (
    com_in_base,
    friction_ratios,
    moving_and_goal_state,
    stretched_arm_state,
)
from floatbase.lessons.lesson08 import state_with_moved_body
from floatbase.objectives import com_wrench_map

GO2 = fb.load("go2")
EOM = standing_go2_eom()
ROUNDING = 1e-9  # of forces of 100 N and levers of 1 m


def test_exercise_05_1_has_the_wrench_of_the_controller():
    """Its cost on the forces is zero where they give that wrench, but for (23)."""
    now, goal = moving_and_goal_state()
    controller = AnalyticController(GO2, EOM.contacts, goal, bias_weight=1e-12)
    cost = controller.objective(fb.equations_of_motion(now, EOM.contacts))[2]
    wrench = com_wrench_map(now, EOM.contacts)(cost.minimizer())
    assert right("05.1", lambda *_: np.split(wrench, 2))


@pytest.mark.parametrize("normal", [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]])
def test_a_friction_ratio_is_tangential_over_normal_force(normal):
    contacts = fb.Contacts.points(GO2, normals=normal)
    n, t = np.array(normal), np.array([0.0, 1.0, 0.0])
    forces = [10 * n + 5 * t, 10 * n, -10 * n + t, t]
    np.testing.assert_allclose(
        friction_ratios(contacts, np.ravel(forces)), [0.5, 0.0, np.inf, np.inf], atol=ROUNDING
    )


def test_the_centre_of_mass_is_that_of_the_state_in_the_frame_of_the_base():
    state = stretched_arm_state(1.0)
    expected = state.frame_pose("base").inverse().act(state.com)
    np.testing.assert_allclose(com_in_base(state), expected, atol=ROUNDING)


@pytest.mark.front_end
def test_go2_is_weakest_forwards_and_aside_also_with_equal_loads():
    goal = state_with_moved_body(GO2.standing(), [-0.019, 0.0, 0.0])  # m
    ways = {"forwards, aside": (1.0, 1.0), "aside": (0.0, 1.0), "backwards, aside": (-1.0, 1.0)}
    outcomes = {}
    for name, way in ways.items():
        sim = fb.Simulation(GO2)
        sim.reset(goal)
        push = fb.Push(52.0 * np.array([*way, 0.0]) / np.linalg.norm(way), 0.05, 0.1)
        costs = AnalyticController(GO2, EOM.contacts, goal)
        outcomes[name] = fb.rollout(sim, costs, 0.6, [push], control_period=0.004).outcome
    assert outcomes.pop("forwards, aside") == "fell"
    assert set(outcomes.values()) == {"completed"}
