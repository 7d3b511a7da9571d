"""(1)(4)(7): inertia, bias force and acceleration, judged by MuJoCo and by Pinocchio's recursive algorithm."""

from __future__ import annotations

import judges
import numpy as np
import pinocchio as pin
import pytest

import floatbase as fb
from floatbase.robots import Foot

N = 10


@pytest.fixture(params=judges.ROBOTS)
def name(request: pytest.FixtureRequest) -> str:
    return request.param


def test_inertia_agrees_with_mujoco(name: str) -> None:
    for state in judges.states(name, N):
        assert judges.relative(state.M, judges.mujoco_of(name).at(state).M) < 1e-9


def test_bias_force_agrees_with_mujoco(name: str) -> None:
    for state in judges.states(name, N, spread=1.0):
        assert judges.relative(state.h, judges.mujoco_of(name).at(state).h) < 1e-9


def test_inertia_is_symmetric_and_positive_definite(name: str) -> None:
    for state in judges.states(name, N):
        assert np.array_equal(state.M, state.M.T)
        assert np.linalg.eigvalsh(state.M)[0] > 0


def test_acceleration_agrees_with_the_articulated_body_algorithm(name: str) -> None:
    rng = np.random.default_rng(0)
    for state in judges.states(name, N):
        eom = fb.equations_of_motion(state, judges.stance(state.robot))
        tau, forces = 20.0 * rng.normal(size=eom.d), 50.0 * rng.normal(size=eom.k)
        assert judges.relative(eom.acceleration(tau, forces), judges.aba(eom, tau, forces)) < 1e-8


def test_the_residual_of_the_equations_is_zero_at_what_the_articulated_body_algorithm_gives(name: str) -> None:
    rng = np.random.default_rng(1)
    state = judges.load(name).random_state(2)
    eom = fb.equations_of_motion(state, judges.stance(state.robot))
    tau, forces = rng.normal(size=eom.d), rng.normal(size=eom.k)
    qdd = judges.aba(eom, tau, forces)
    dynamics, motion = eom.residual(qdd, tau, forces)
    assert np.allclose(dynamics, 0.0, atol=1e-7)
    assert np.allclose(motion, eom.A @ qdd - eom.b)
    assert np.allclose(eom.residual(qdd, tau + 1.0, forces)[0], dynamics - eom.S @ np.ones(eom.d), atol=1e-9)
    if eom.k:
        pushed = eom.residual(qdd, tau, forces + 1.0)[0]
        assert np.allclose(pushed, dynamics - eom.J.T @ np.ones(eom.k), atol=1e-9)


@pytest.mark.parametrize("name", judges.FLOATING)
def test_torques_cannot_move_the_centre_of_mass_in_free_fall(name: str) -> None:
    rng = np.random.default_rng(0)
    for state in judges.states(name, 3):
        eom = fb.equations_of_motion(state, fb.Contacts.none())
        qdd = eom.acceleration(1e-3 * state.robot.weight * rng.normal(size=eom.d), [])
        fall = judges.acceleration_of(lambda s: s.com, state, qdd)
        assert np.allclose(fall, [0.0, 0.0, -9.81], atol=1e-5)


@pytest.mark.parametrize("name", judges.FLOATING)
def test_torques_cannot_change_the_angular_momentum_in_free_fall(name: str) -> None:
    rng = np.random.default_rng(0)
    for state in judges.states(name, 3):
        eom = fb.equations_of_motion(state, fb.Contacts.none())
        qdd = eom.acceleration(10.0 * rng.normal(size=eom.d), [])
        model, data = state.robot.model, state.robot.model.createData()
        rate = pin.computeCentroidalMomentumTimeVariation(model, data, state.q, state.v, qdd)
        assert np.allclose(rate.angular, 0.0, atol=1e-7)


@pytest.mark.parametrize("name", judges.BALLS)
def test_accelerations_under_contact_agree_with_pinocchios_constrained_dynamics(name: str) -> None:
    """q̈ of [M -Jᵀ; J 0] with point feet, against pin.constraintDynamics with the feet's centres pinned."""
    robot = judges.load(name)
    rng = np.random.default_rng(0)
    feet = [Foot(foot.frame, 0.0, foot.centre) for foot in robot.feet]
    pinned = fb.load(name, feet=feet)
    contacts = fb.Contacts.points(pinned).only(*[foot.frame for foot in feet[:2]])  # J of full rank on every robot
    models = pin.StdVec_RigidConstraintModel()
    for contact in contacts:
        frame = robot.model.frames[robot.frame_id(contact.name)]
        placement = frame.placement * pin.SE3(np.eye(3), np.array(contact.centre))
        models.append(
            pin.RigidConstraintModel(
                pin.ContactType.CONTACT_3D, robot.model, frame.parentJoint, placement, pin.LOCAL_WORLD_ALIGNED
            )
        )
    for state in judges.states(name, 3):
        eom = fb.equations_of_motion(fb.State(pinned, state.q, state.v), contacts)
        tau = rng.normal(size=eom.d)
        kkt = np.block([[eom.M, -eom.J.T], [eom.A, np.zeros((eom.k, eom.k))]])
        qdd = np.linalg.solve(kkt, np.concatenate([eom.S @ tau - eom.h, eom.b]))[: eom.nv]
        datas = pin.StdVec_RigidConstraintData([model.createData() for model in models])
        data = robot.model.createData()
        pin.initConstraintDynamics(robot.model, data, models, datas)
        settings = pin.ProximalSettings(1e-14, 1e-12, 100)
        wanted = pin.constraintDynamics(robot.model, data, state.q, state.v, eom.S @ tau, models, datas, settings)
        assert judges.relative(qdd, wanted) < 1e-6


def test_a_fixed_base_has_the_equations_of_a_manipulator() -> None:
    robot = judges.load("ur5")
    eom = fb.equations_of_motion(robot.random_state(0), fb.Contacts.none())
    assert np.array_equal(eom.S, np.eye(6))
    assert eom.J.shape == (0, 6)
    tau = np.arange(6.0)
    wanted = pin.aba(robot.model, robot.model.createData(), eom.state.q, eom.state.v, tau)
    assert np.allclose(eom.acceleration(tau, []), wanted, atol=1e-9)


def test_rotor_inertia_counts() -> None:
    robot = judges.load("talos")
    assert np.any(robot.model.armature > 0)
    state = robot.standing()
    bare = robot.model.copy()
    bare.armature = np.zeros(bare.nv)
    light = pin.crba(bare, bare.createData(), state.q)
    light = np.triu(light) + np.triu(light, 1).T
    assert np.allclose(state.M - light, np.diag(robot.model.armature), atol=1e-12)


@pytest.mark.parametrize("name", fb.catalogue())
def test_contact_accelerations_answer_to_contact_forces_by_j_minv_jt(name: str) -> None:
    """(8): pushing with unit forces one by one, the contact points accelerate by the columns of J M⁻¹ Jᵀ."""
    from floatbase.dynamics import contact_inertia_inverse

    state = judges.states(name, 1)[0]
    contacts = judges.stance(state.robot) if state.robot.is_floating else fb.Contacts.points(state.robot, frames=["tool0"])
    eom = fb.equations_of_motion(state, contacts)
    rest = judges.aba(eom, np.zeros(eom.d), np.zeros(eom.k))
    columns = [eom.A @ (judges.aba(eom, np.zeros(eom.d), unit) - rest) for unit in np.eye(eom.k)]
    assert judges.relative(contact_inertia_inverse(eom), np.column_stack(columns)) < 1e-9
