"""Payloads and scaled masses, against MuJoCo and closed forms."""

import pickle

import judges
import numpy as np
import pinocchio as pin
import pytest
from messages import refused

import floatbase as fb
from floatbase.errors import InputError, UnknownNameError
from floatbase.playground import ModelMismatch

CASES = [
    ("go2", "base"), ("go2", "FL_foot"), ("talos", "gripper_left_base_link"),
    ("anymal_kinova", "kinova_link_3"), ("ur5", "wrist_3_link"), ("solo8", "HL_LOWER_LEG"),
]  # fmt: skip
ROUNDING = 1e-12  # relative


@pytest.mark.parametrize(("name", "frame"), CASES)
def test_a_payload_is_a_point_mass_for_pinocchio_and_mujoco(name, frame):
    robot, mass, position = judges.load(name), 2.5, [0.1, -0.05, 0.2]
    if frame not in robot.frames and frame != "base":
        frame = robot.frames[-1]
    loaded = robot.with_payload(frame, mass, position)
    assert loaded.mass == pytest.approx(robot.mass + mass, rel=ROUNDING)
    for state in judges.states(name, 3):
        with_it = fb.State(loaded, state.q, state.v)
        R, J = state.frame_pose(frame).rotation, state.frame_jacobian(frame)
        J = J[:3] - pin.skew(R @ np.array(position)) @ J[3:]
        M = state.M + mass * J.T @ J  # of a point mass, by its kinetic energy
        assert np.allclose(with_it.M, M, rtol=0.0, atol=ROUNDING * np.abs(M).max())
        weight = mass * robot.gravity * J[2]
        still = state.replace(v=np.zeros(robot.nv))
        with_it_still = with_it.replace(v=np.zeros(robot.nv))
        assert np.allclose(with_it_still.h, still.h + weight, atol=1e-9)
        judge = judges.Mujoco(loaded).move_to(with_it)
        assert np.allclose(judge.M, with_it.M, atol=ROUNDING * np.abs(M).max())
        assert np.allclose(judge.h, with_it.h, atol=1e-9 * robot.weight)


@pytest.mark.parametrize("robot", ["go2", "talos", "ur5"], indirect=True)
def test_scaled_masses_scale_inertia_and_forces(robot):
    heavy = robot.with_scaled_mass(1.3)
    for state in judges.states(robot.name, 2):
        scaled = fb.State(heavy, state.q, state.v)
        assert np.allclose(scaled.M, 1.3 * state.M, atol=ROUNDING * np.abs(state.M).max())
        assert np.allclose(scaled.h, 1.3 * state.h, atol=1e-10 * robot.weight)
        judge = judges.Mujoco(heavy).move_to(scaled)
        assert np.allclose(judge.M, scaled.M, atol=ROUNDING * np.abs(scaled.M).max())


def test_a_controller_of_a_heavier_robot_is_compiled_and_has_the_torques_of_the_mismatch(go2):
    tasks, contacts = fb.standing_tasks(go2.standing()), judges.stance(go2)
    compiled = fb.WholeBodyController(
        go2.with_scaled_mass(1.2), contacts, tasks, backend="compiled"
    )
    reference = fb.WholeBodyController(
        go2, contacts, tasks, modify_qp=ModelMismatch(mass=1.2), backend="reference"
    )
    for state in judges.states("go2", 5, 0.05):
        one, other = compiled(state.q, state.v), reference(state.q, state.v)
        assert np.allclose(one.tau, other.tau, atol=1e-6 * go2.torque_limits)


@pytest.mark.parametrize("is_assumed", [True, False])
def test_a_payload_in_the_simulation_may_be_unknown_to_the_controller(is_assumed, go2, standing):
    loaded = go2.with_payload("base", 0.2 * go2.mass, [0.1, 0.0, 0.1])
    sim = fb.Simulation(loaded)
    sim.reset(go2.standing())
    controller = fb.WholeBodyController(
        loaded if is_assumed else go2,
        judges.stance(go2),
        fb.standing_tasks(fb.State(loaded, standing.q) if is_assumed else standing),
    )
    run = fb.rollout(sim, controller, 1.0)
    assert run.outcome == "completed"
    assert run.measured[-1].reshape(-1, 3)[:, 2].sum() == pytest.approx(loaded.weight, rel=0.01)
    sinks = run.q[0, 2] - run.q[-1, 2]
    assert abs(sinks) < 1e-3 if is_assumed else sinks > 5e-3


def test_a_robot_with_a_payload_is_another_robot_with_the_same_joints(go2):
    loaded = go2.with_payload("base", 1.0)
    twice = loaded.with_payload("base", 1.0).with_scaled_mass(2.0)
    assert loaded != go2 and twice.nominal is go2
    assert twice.has_joints_of(go2) and loaded.has_joints_of(twice)
    assert pickle.loads(pickle.dumps(twice)) == twice
    assert not loaded.has_joints_of(judges.load("solo12"))
    with pytest.raises(InputError):
        fb.Simulation(judges.load("solo12")).reset(loaded.standing())


def test_payloads_that_cannot_be_are_refused():
    robot, arm = judges.load("go2"), judges.load("ur5")
    with pytest.raises(UnknownNameError):
        robot.with_payload("back", 1.0)
    refused(lambda: arm.with_payload(arm.base, 1.0), InputError, arm.base)
