"""Perturbed physics, compared with Newton's law for the whole robot and with closed forms."""

import copy

import judges
import numpy as np
import pytest
from messages import raises

import floatbase as fb
from floatbase.errors import InputError, UnknownNameError
from floatbase.playground import ModelMismatch, Perturbation, PerturbedSimulation

GO2 = judges.load("go2")
G = 9.81  # m/s²


def standing(sim: PerturbedSimulation, seconds: float = 0.6) -> fb.Rollout:
    controller = fb.WholeBodyController(
        GO2, fb.Contacts.feet(GO2), fb.standing_tasks(GO2.standing())
    )
    return fb.rollout(sim, controller, seconds, control_period=2e-3)


def carried(record: fb.Rollout, rows: int) -> float:
    """Mean vertical force of all contacts over the last rows, N."""
    return float(record.measured[-rows:, 2::3].sum(axis=1).mean())


def in_the_air(sim: PerturbedSimulation, omega: float = 0.0) -> None:
    state = GO2.standing()
    q, v = np.array(state.q), np.zeros(GO2.nv)
    q[2] += 2.0
    v[3] = omega
    sim.reset(state.replace(q=q, v=v))


def test_an_unperturbed_simulation_equals_the_plain_one():
    plain, perturbed = fb.Simulation(GO2, 0.7), PerturbedSimulation(GO2, 0.7)
    controller = judges.controller_of("go2")
    push = [fb.Push([30.0, 10.0, 0.0])]
    a, b = (fb.rollout(sim, controller, 0.3, push, 2e-3) for sim in (plain, perturbed))
    assert np.array_equal(a.q, b.q) and np.array_equal(a.measured, b.measured)


def test_the_robot_falls_with_gravity_and_floats_without_it():
    for gravity in (True, False):
        sim = PerturbedSimulation(GO2, perturbation=Perturbation(gravity=gravity))
        in_the_air(sim)
        for _ in range(200):
            sim.step(np.zeros(12))
        assert sim.state.com_velocity[2] == pytest.approx(-0.2 * G * gravity, abs=1e-3)


def test_the_ground_carries_the_actual_mass():
    sim = PerturbedSimulation(GO2, perturbation=Perturbation(mass=1.2))
    record = standing(sim)
    assert record.outcome == "completed"
    assert carried(record, 50) == pytest.approx(1.2 * GO2.weight, rel=0.02)
    sim.perturbation = Perturbation()
    assert np.isclose(sim.model.body_mass.sum(), GO2.mass)


def test_a_disabled_contact_carries_nothing():
    sim = PerturbedSimulation(GO2, perturbation=Perturbation(disabled_contacts=["FL_foot"]))
    record = standing(sim, seconds=0.1)
    assert not record.measured.reshape(len(record), -1, 3)[:, 0].any()
    assert record.measured.reshape(len(record), -1, 3)[-1, 1:].any()


def test_a_spinning_robot_keeps_its_velocity_without_velocity_forces():
    """Without gravity, torques and velocity forces, all velocities are constant."""
    change = {}
    for kept in (True, False):
        sim = PerturbedSimulation(
            GO2, timestep=5e-4, perturbation=Perturbation(gravity=False, velocity_forces=kept)
        )
        in_the_air(sim, omega=5.0)
        before = sim.data.qvel.copy()
        for _ in range(20):
            sim.step(np.zeros(12))
        change[kept] = float(np.abs(sim.data.qvel - before).max())
    assert change[False] < 1e-9 * 5.0
    assert change[True] > 0.05


def test_a_base_keeps_its_velocity_along_its_own_axes_without_velocity_forces():
    """With M q̈ = 0 in the base's own axes, a rotating base flies along a curve."""
    sim = PerturbedSimulation(
        GO2, timestep=1e-4, perturbation=Perturbation(gravity=False, velocity_forces=False)
    )
    in_the_air(sim)
    v = np.random.default_rng(1).normal(size=GO2.nv)
    v[:6] = 1.0, 0.0, 0.5, 0.2, 0.0, 1.0  # the base rotates about an axis across its path
    sim.reset(sim.state.replace(v=v))
    for _ in range(200):
        sim.step(np.zeros(12))
    turned = 0.02 * float(np.linalg.norm(np.cross(v[3:6], v[:3])))  # m/s
    assert turned > 0.01
    assert np.abs(sim.v - v).max() < 0.02 * turned


def test_adhesion_lets_the_ground_pull():
    """Feet with adhesion stay on the ground although the robot is pulled up with 1.5 weights."""
    up = 1.5 * GO2.weight
    nets = {}
    for adhesion_force in (0.0, GO2.weight):
        sim = PerturbedSimulation(GO2, perturbation=Perturbation(adhesion_force=adhesion_force))
        tasks, mismatch = fb.standing_tasks(GO2.standing()), ModelMismatch(cones=False)
        controller = fb.WholeBodyController(
            GO2, fb.Contacts.feet(GO2), tasks, modify_qp=mismatch, joint_limits=None
        )
        record = fb.rollout(sim, controller, 0.2, [fb.Push([0.0, 0.0, up], 0.0, 0.2)], 2e-3)
        nets[adhesion_force] = carried(record, 20)
        stuck = sim.contact_positions()[:, 2].max() < 5e-3
        assert stuck == bool(adhesion_force)
    assert nets[0.0] == 0.0
    assert nets[GO2.weight] < -0.2 * GO2.weight


def test_adhesion_acts_from_the_first_touch():
    """Newton's law holds at each timestep of a landing; measured forces include adhesion."""
    sim = PerturbedSimulation(GO2, perturbation=Perturbation(adhesion_force=GO2.weight))
    state = GO2.standing()
    q, v = np.array(state.q), np.zeros(GO2.nv)
    q[2], v[2] = q[2] + 5e-3, -0.3
    sim.reset(state.replace(q=q, v=v))
    record = fb.rollout(sim, judges.controller_of("go2"), 0.03)
    momentum = GO2.mass * np.array([record.state(i).com_velocity[2] for i in range(len(record))])
    force = record.measured[:, 2::3].sum(axis=1) - GO2.weight
    assert np.any(record.measured[0] == 0.0) and np.any(record.measured[-1] != 0.0)
    # the adhesion of one foot is a whole weight
    assert np.abs(np.diff(momentum) / sim.timestep - force[:-1]).max() < 0.2 * GO2.weight


def test_motors_of_the_base_lift_it():
    sim = PerturbedSimulation(GO2)
    in_the_air(sim)
    R = sim.state.frame_pose("base").rotation
    sim.base_wrench = np.concatenate([R.T @ [0.0, 0.0, GO2.weight + 2.0 * GO2.mass], np.zeros(3)])
    for _ in range(10):
        sim.step(np.zeros(12))
    assert sim.state.com_velocity[2] == pytest.approx(0.01 * 2.0, rel=0.05)
    sim.reset()
    assert not sim.base_wrench.any()


def test_friction_can_change_during_a_run():
    sim = PerturbedSimulation(GO2, 0.8)
    assert standing(sim, seconds=0.2).outcome == "completed"
    sim.perturbation = Perturbation(friction=0.05)
    push = fb.Push([60.0, 0.0, 0.0], 0.2, 0.1)
    record = fb.rollout(sim, judges.controller_of("go2"), 0.3, [push], 2e-3)
    forces = record.measured.reshape(len(record), -1, 3)
    assert np.all(np.hypot(*forces[:, :, :2].transpose(2, 0, 1)) <= 0.05 * forces[:, :, 2] + 0.1)


def test_links_of_a_fallen_robot_have_the_friction_of_the_perturbation():
    sim = PerturbedSimulation(GO2, 0.8)
    sim.link_collisions = True
    sim.perturbation = Perturbation(friction=0.05)
    touching = set()
    for _ in range(600):  # without torques it falls onto its links
        sim.step(np.zeros(12))
        touching |= set(sim.data.contact.geom2.tolist())
        assert np.all(sim.data.contact.friction[:, 0] == 0.05)
    assert touching - set(sim.foot_contacts.geoms.tolist())


def test_copies_are_independent_and_wrong_input_is_refused():
    sim = PerturbedSimulation(GO2, perturbation=Perturbation(velocity_forces=False))
    other = copy.copy(sim)
    other.perturbation = Perturbation(mass=2.0)
    assert np.isclose(sim.model.body_mass.sum(), GO2.mass) and sim.perturbation.mass == 1.0
    with raises(UnknownNameError, "FL_fot", "FL_foot"):
        sim.perturbation = Perturbation(disabled_contacts=["FL_fot"])
    with raises(InputError, "base_wrench", 2, 6):
        sim.base_wrench = [1.0, 2.0]
