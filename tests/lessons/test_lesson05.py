"""Lesson 05: its helpers do what they say."""

import numpy as np
import pytest
from hints import right

import floatbase as fb
from floatbase.control import AnalyticController
from floatbase.lessons.lesson03 import standing_go2_eom
from floatbase.lessons.lesson05 import (
    ConstantForceController,
    com_in_base,
    friction_ratios,
    inclined_design,
    moving_and_goal_state,
    stretched_arm_state,
)
from floatbase.objectives import com_wrench_map, normal_bias, tangential_bias, wrench_objective

GO2 = fb.load("go2")
EOM = standing_go2_eom()
FORCE = np.array([60.0, 0.0, GO2.weight])  # N, world: of exercise 05.3
ROUNDING = 1e-9  # of forces of 100 N and levers of 1 m


def test_no_weights_solve_exercise_05_3():
    """No α and no weight of (23) keeps both the wrench and the friction ratios, whatever the normal
    force it prefers.
    """
    tangential, no_moment = tangential_bias(EOM.contacts), [0.0, 0.0, 0.0]
    for a in (0.0, 20.0, GO2.weight / 4, 60.0):
        normal = normal_bias(EOM.contacts, a)
        for alpha in (0.0, 0.01, 0.1, 1.0, 10.0):
            for weight in 10.0 ** np.arange(-4.0, 2.0, 0.5):
                preference = weight * (tangential + alpha * normal)

                def design(force, preference=preference):
                    goal = wrench_objective(EOM.state, EOM.contacts, force, no_moment)
                    return goal + preference

                assert not right("05.3", design)


def test_exercise_05_1_has_the_wrench_of_the_controller():
    """Its cost on the forces is zero where they give that wrench, but for (23)."""
    now, goal = moving_and_goal_state()
    controller = AnalyticController(GO2, EOM.contacts, goal, bias_weight=1e-12)
    cost = controller.objective(fb.equations_of_motion(now, EOM.contacts))[2]
    wrench = com_wrench_map(now, EOM.contacts)(cost.minimiser())
    assert right("05.1", lambda *_: np.split(wrench, 2))


@pytest.mark.parametrize("normal", [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]])
def test_a_friction_ratio_is_tangential_over_normal_force(normal):
    contacts = fb.Contacts.points(GO2, normals=normal)
    n, t = np.array(normal), np.array([0.0, 1.0, 0.0])
    forces = [10 * n + 5 * t, 10 * n, -10 * n + t, t]
    np.testing.assert_allclose(
        friction_ratios(contacts, np.ravel(forces)), [0.5, 0.0, np.inf, np.inf], atol=ROUNDING
    )


def test_the_arm_moves_the_centre_of_mass():
    ahead, left, right_hand = (
        com_in_base(stretched_arm_state(turn)) for turn in (0.0, np.pi / 2, -np.pi / 2)
    )
    assert left[1] > 0.04 > 0.005 > abs(ahead[1]) and right_hand[1] < -0.04
    assert ahead[0] > left[0] + 0.04
    state = stretched_arm_state(1.0).replace(v=None)
    turned = com_in_base(state)
    expected = state.frame_pose("base").inverse().act(state.com)
    np.testing.assert_allclose(turned, expected, atol=ROUNDING)


def test_the_engine_measures_the_planned_forces():
    forces = inclined_design()(FORCE).minimiser()
    controller = ConstantForceController(GO2, EOM.contacts, forces)
    record = fb.rollout(fb.Simulation(GO2, 0.5), controller, 0.1)
    # N: the robot has moved by 2 cm
    np.testing.assert_allclose(record.measured[-1], forces, atol=1.0)
    np.testing.assert_allclose(record.planned[-1], forces, atol=ROUNDING)
    assert record.final.com_velocity[0] == pytest.approx(0.1 * 60.0 / GO2.mass, rel=0.03)
