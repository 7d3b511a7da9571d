"""Lesson 06: its helpers do what they say."""

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.errors import InputError
from floatbase.friction import FrictionPolyhedron
from floatbase.lessons.lesson04 import measured_acceleration
from floatbase.lessons.lesson05 import friction_ratios
from floatbase.lessons.lesson06 import (
    ConeController,
    accelerate,
    constrained_minimiser,
    make_controller,
    state_with_feet_at,
)
from floatbase.objectives import com_wrench_map

UP = np.array([0.0, 0.0, 1.0])
LENGTHS = 1e-9  # m: what Newton's method leaves, and rounding
SOLVED = 1e-5  # N: what the QP solver leaves in rows of forces up to 200 N


def test_the_constrained_minimum_is_the_projection_onto_the_polyhedron():
    cost = fb.Quadratic.from_residual(np.eye(3), [3.0, 0.0, 1.0])
    rows = FrictionPolyhedron(UP, 0.5, 4).face_matrix
    found = constrained_minimiser(cost, rows)
    assert np.allclose(found, FrictionPolyhedron(UP, 0.5, 4).project([3.0, 0.0, 1.0]), atol=SOLVED)
    wide = FrictionPolyhedron(UP, 5.0, 4).face_matrix
    assert np.allclose(constrained_minimiser(cost, wide), [3.0, 0.0, 1.0], atol=SOLVED)


def test_a_pushed_controller_plans_forces_inside_the_cones():
    controller = make_controller()
    still = fb.rollout(fb.Simulation(controller.robot), controller, 0.1)
    assert still.outcome == "completed"
    assert np.allclose(still.planned[-1], still.measured[-1], atol=1.0)
    push = fb.Push(np.array([0.0, 90.0, 0.0]), start=0.0, duration=0.1)
    pushed = fb.rollout(fb.Simulation(controller.robot), controller, 0.3, [push])
    foot, contacts = pushed.planned.reshape(len(pushed), 4, 3), controller.contacts
    cones = [FrictionPolyhedron(contacts.normals[i], contacts.mus[i], 4) for i in range(4)]
    margins = [[cones[i].margin(forces[i]) for i in range(4)] for forces in foot]
    assert np.min(margins) > -SOLVED  # always inside
    assert np.min(margins) < SOLVED  # and at some time at a limit
    assert pushed.outcome == "completed"


def test_a_larger_weight_reduces_the_error_of_the_moment():
    state = make_controller().state
    # 1.5 m/s to the left: more than the cones can stop at once
    aside, contacts = state.replace(v=np.eye(18)[1] * 1.5), make_controller().contacts
    gaps = []
    for weight in (1.0, 100.0):
        controller = ConeController(state.robot, contacts, state, moment_weight=weight)
        wrench = com_wrench_map(aside, contacts).A @ controller(aside.q, aside.v).forces
        gaps.append(abs(wrench - np.concatenate(controller.wrench_goal(aside))))
    (force, moment), (force_then, moment_then) = ((each[:3].max(), each[3:].max()) for each in gaps)
    assert moment_then < 0.5 * moment and force_then > force > 1.0


def test_feet_reach_their_positions_or_an_error_is_raised():
    robot = judges.load("go2")
    home = robot.standing()
    shift = [0.02, 0.01, 0.03]
    places = {foot.frame: home.point(foot.frame) + shift for foot in robot.feet}
    reached = state_with_feet_at(robot, home.q[:3], places)
    for name, place in places.items():
        assert np.allclose(reached.point(name), place, atol=LENGTHS)
    with pytest.raises(InputError, match="cannot put its feet"):
        state_with_feet_at(robot, home.q[:3] + [0.0, 0.0, 1.0], places)


def test_the_constrained_minimum_accepts_any_limits():
    cost = fb.Quadratic.from_residual(np.eye(2), [3.0, 4.0])
    found = constrained_minimiser(cost, np.eye(2), [-1.0, 5.0])
    assert np.allclose(found, [-1.0, 4.0], atol=SOLVED)
    assert np.allclose(constrained_minimiser(cost, np.eye(2), 2.0), [2.0, 2.0], atol=SOLVED)


def test_the_engine_measures_the_requested_acceleration_if_friction_suffices():
    record = accelerate([1.0, 0.0, 0.0])
    assert measured_acceleration(record)[0] == pytest.approx(1.0, rel=0.05)
    # the controller believes in more friction than the floor has
    wet = accelerate([4.0, 0.0, 0.0], mu=0.7, floor=0.2, facets=8)
    planned = friction_ratios(fb.Contacts.points(wet.robot), wet.planned[0])
    assert planned.max() > 0.3 and wet.slip().max() > 0.01
