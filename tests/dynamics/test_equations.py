"""Eqs. (1), (4), (7): inertia, bias force and acceleration.

MuJoCo and Pinocchio's recursive algorithm give the expected results.
"""

from dataclasses import replace

import judges
import numpy as np
import pinocchio as pin
import pytest
from messages import raises

import floatbase as fb
from floatbase import objectives
from floatbase.dynamics import delassus_matrix

N = 10


robot = judges.every_robot


def test_inertia_agrees_with_mujoco(robot):
    for state in judges.states(robot.name, N):
        assert judges.relative(state.M, judges.mujoco_of(robot.name).move_to(state).M) < 1e-9


def test_bias_force_agrees_with_mujoco(robot):
    for state in judges.states(robot.name, N, spread=1.0):
        assert judges.relative(state.h, judges.mujoco_of(robot.name).move_to(state).h) < 1e-9


def test_acceleration_agrees_with_the_articulated_body_algorithm(robot):
    rng = np.random.default_rng(0)
    for state in judges.states(robot.name, N):
        eom = fb.equations_of_motion(state, judges.stance(state.robot))
        tau, forces = 20.0 * rng.normal(size=eom.d), 50.0 * rng.normal(size=eom.k)
        assert judges.relative(eom.acceleration(tau, forces), judges.aba(eom, tau, forces)) < 1e-8


def test_the_residual_of_the_equations_is_zero_at_what_the_articulated_body_algorithm_gives(robot):
    rng = np.random.default_rng(1)
    state = robot.random_state(2)
    eom = fb.equations_of_motion(state, judges.stance(state.robot))
    tau, forces = rng.normal(size=eom.d), rng.normal(size=eom.k)
    qdd = judges.aba(eom, tau, forces)
    dynamics, motion = eom.residual(qdd, tau, forces)
    assert np.allclose(dynamics, 0.0, atol=1e-7)
    assert np.allclose(motion, eom.A @ qdd - eom.b)
    expected = dynamics - eom.S @ np.ones(eom.d)
    assert np.allclose(eom.residual(qdd, tau + 1.0, forces)[0], expected, atol=1e-9)
    if eom.k:
        pushed = eom.residual(qdd, tau, forces + 1.0)[0]
        assert np.allclose(pushed, dynamics - eom.J.T @ np.ones(eom.k), atol=1e-9)


@pytest.mark.parametrize("name", judges.FLOATING)
def test_torques_cannot_move_the_centre_of_mass_or_turn_the_robot_in_free_fall(name):
    """For any joint motion, ẍ_c = g by differences, and the angular momentum stays zero."""
    rng = np.random.default_rng(0)
    for state in judges.states(name, 3):
        eom = fb.equations_of_motion(state, fb.Contacts.none())
        qdd = eom.acceleration(1e-3 * state.robot.weight * rng.normal(size=eom.d), [])
        fall = judges.acceleration_of(lambda s: s.com, state, qdd)
        # the differences round by about 1e-8 of the largest acceleration
        rounding = 1e-5 + 1e-8 * np.max(np.abs(qdd))
        assert np.allclose(fall, [0.0, 0.0, -9.81], atol=rounding)
        assert np.allclose(objectives.centroidal_momentum_rate(state, qdd)[3:], 0.0, atol=1e-7)


def test_a_fixed_base_has_the_equations_of_a_manipulator():
    robot = judges.load("ur5")
    eom = fb.equations_of_motion(robot.random_state(0), fb.Contacts.none())
    assert np.array_equal(eom.S, np.eye(6))
    assert eom.J.shape == (0, 6)
    tau = np.arange(6.0)
    expected = pin.aba(robot.model, robot.model.createData(), eom.state.q, eom.state.v, tau)
    assert np.allclose(eom.acceleration(tau, []), expected, atol=1e-9)


def test_rotor_inertia_counts(talos):
    assert np.any(talos.model.armature > 0)
    state = talos.standing()
    bare = talos.model.copy()
    bare.armature = np.zeros(bare.nv)
    light = pin.crba(bare, bare.createData(), state.q)
    light = np.triu(light) + np.triu(light, 1).T
    assert np.allclose(state.M - light, np.diag(talos.model.armature), atol=1e-12)


@pytest.mark.parametrize("name", fb.catalogue())
def test_contact_accelerations_answer_to_contact_forces_by_j_minv_jt(name):
    """Eq. (8): unit forces, one at a time, accelerate the contact points by the columns of J M⁻¹
    Jᵀ.
    """
    state = judges.states(name, 1)[0]
    contacts = judges.stance(state.robot)
    if not state.robot.is_floating:
        contacts = fb.Contacts.points(state.robot, frames=["tool0"])
    eom = fb.equations_of_motion(state, contacts)
    rest = judges.aba(eom, np.zeros(eom.d), np.zeros(eom.k))
    columns = [eom.A @ (judges.aba(eom, np.zeros(eom.d), unit) - rest) for unit in np.eye(eom.k)]
    assert judges.relative(delassus_matrix(eom), np.column_stack(columns)) < 1e-9


def test_matrices_are_computed_on_first_use_and_can_be_replaced(standing):
    eom = fb.equations_of_motion(standing, fb.Contacts.points(standing.robot))
    assert "M" not in vars(eom) and "h" not in vars(eom)
    heavy = replace(replace(eom, M=2.0 * eom.M), h=2.0 * eom.h)
    assert np.array_equal(heavy.M, 2.0 * eom.M) and np.array_equal(heavy.h, 2.0 * eom.h)
    assert heavy.J is eom.J and heavy.b is eom.b
    with raises(TypeError, "mass"):
        replace(eom, mass=2.0)


def test_tau_and_forces_have_the_size_of_the_matrices_that_were_given(standing):
    eom = fb.equations_of_motion(standing, fb.Contacts.points(standing.robot))
    other = replace(eom, S=np.eye(eom.nv), J=eom.J[:3])
    assert (other.d, other.k) == (eom.nv, 3)
    assert other.acceleration(np.ones(eom.nv), np.zeros(3)).shape == (eom.nv,)
