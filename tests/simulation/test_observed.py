"""Controllers with a noisy, late or user-defined observation of the state."""

import copy
import pickle
import re
from pathlib import Path
from types import SimpleNamespace

import judges
import numpy as np
import pinocchio as pin
import pytest
from messages import refused

import floatbase as fb
from floatbase.behaviours import Gait, Walk
from floatbase.errors import InputError
from floatbase.simulation import Latency, Observed, SensorNoise


class Recording:
    """A controller without torques that keeps what it observes."""

    def __init__(self, d: int):
        self.d, self.seen = d, []

    def __call__(self, q: np.ndarray, v: np.ndarray, t: float) -> SimpleNamespace:
        self.seen.append((q, v, t))
        return SimpleNamespace(tau=np.zeros(self.d))


def test_a_controller_gets_what_the_observers_return_one_after_the_other(go2):
    controller, calls = Recording(go2.d), []

    def first(q: np.ndarray, v: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        calls.append("first")
        return q, v + 1.0

    def second(q: np.ndarray, v: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        calls.append("second")
        return q, 2.0 * v

    run = fb.rollout(fb.Simulation(go2), Observed(controller, first, second), 0.01)
    assert calls == ["first", "second"] * 10
    q, v, t = (np.array(rows) for rows in zip(*controller.seen, strict=True))
    assert np.array_equal(q, run.q) and np.array_equal(t, run.time)
    assert np.allclose(v, 2.0 * (run.v + 1.0))


class Scales:
    """An observer that keeps what is measured."""

    def __init__(self) -> None:
        self.tau, self.forces, self.accelerations = [], [], []

    def measure(self, tau: np.ndarray, forces: np.ndarray, acceleration: np.ndarray) -> None:
        self.tau.append(tau)
        self.forces.append(forces)
        self.accelerations.append(acceleration)

    def __call__(self, q: np.ndarray, v: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        return q, v


def test_observers_get_the_torques_and_the_contact_forces_of_the_last_timestep():
    outer, inner = Scales(), Scales()
    observed = Observed(Observed(judges.controller_of("go2"), inner), outer)
    run = fb.rollout(fb.Simulation(judges.load("go2")), observed, 0.2)
    assert np.allclose(outer.tau[1:], run.tau[:-1])
    assert np.allclose(np.reshape(outer.forces, (200, 12))[1:], run.measured[:-1])
    weight = judges.load("go2").weight
    assert np.allclose(np.sum(outer.forces, axis=1)[-20:], [0.0, 0.0, weight], atol=0.05 * weight)
    assert np.array_equal(outer.tau, inner.tau)


@pytest.mark.parametrize("acceleration", [None, [2.0, -1.0, 3.0]], ids=["at rest", "moving"])
def test_the_accelerometer_measures_the_change_of_velocity_and_gravity(acceleration):
    robot, scales = judges.load("go2"), Scales()
    walk = Walk(robot, judges.stance(robot), Gait.trot(robot, start=0.0), velocity=[0.5, 0.1])
    sim = fb.Simulation(robot, fb.Ground(acceleration=acceleration), timestep=5e-4)
    run = fb.rollout(sim, Observed(walk, scales), 0.2)
    R = np.array([run.state(i).frame_pose("base").rotation for i in range(len(run))])
    rates = np.diff(np.einsum("nij,nj->ni", R, run.v[:, :3]), axis=0) / sim.timestep
    expected = np.einsum("nji,nj->ni", R[:-1], rates + [0.0, 0.0, robot.gravity])
    assert np.allclose(scales.accelerations[1:], expected, atol=1e-6)


def test_an_accelerometer_measures_gravity_in_a_fixed_base_and_nothing_in_free_fall():
    arm, dog = judges.load("ur5"), judges.load("go2")
    R = arm.standing().frame_pose(arm.base).rotation
    assert np.allclose(fb.Simulation(arm).accelerometer(), R.T @ [0.0, 0.0, arm.gravity])
    sim, state = fb.Simulation(dog), dog.standing()
    sim.reset(state.replace(q=np.r_[0.0, 0.0, 1.0, 0.5, 0.5, 0.5, 0.5, state.q[7:]]))
    assert np.allclose(sim.accelerometer(), 0.0, atol=1e-9)


@pytest.mark.front_end  # three seconds
def test_the_documented_leg_odometry_drifts_over_ten_metres_as_its_page_says(go2):
    page = (Path(__file__).parents[2] / "docs" / "simulation.md").read_text(encoding="utf-8")
    source = re.search(r"^class LegOdometry.*?(?=\n\n\n)", page, re.M | re.S)
    assert source
    exec(source[0], names := {"fb": fb, "np": np})
    for noise, drift in (([], 0.04), ([SensorNoise(go2)], 0.06)):
        walk = Walk(go2, judges.stance(go2), Gait.trot(go2, start=0.2), velocity=[0.5, 0.0])
        odometry = names["LegOdometry"](go2, judges.stance(go2))
        observed = Observed(walk, *noise, odometry)
        run = fb.rollout(fb.Simulation(go2), observed, 20.5, control_period=0.002)
        assert run.q[-1, 0] > 9.5 + run.q[0, 0]
        error = np.linalg.norm(odometry.position - run.q[-1, :3])
        assert error == pytest.approx(drift, abs=0.02)


@pytest.mark.parametrize("name", ["go2", "anymal_kinova", "ur5"])
def test_sensor_noise_has_the_given_standard_deviations(name):
    robot, seed = judges.load(name), int(np.random.default_rng(0).integers(2**32))
    state = judges.states(name, 1)[0]
    noise, n = SensorNoise(robot, seed).scaled(2.0), 2000
    errors = []
    for i in range(n):
        q, v = noise(state.q, state.v, i * 1e-3)
        errors.append([*pin.difference(robot.model, state.q, q), *(v - state.v)])
    base = 3 if robot.is_floating else 0
    of_q = [2e-3] * base + [4e-3] * base + [2.2e-4] * robot.d
    of_v = [0.04] * base + [4e-3] * base + [0.1] * robot.d
    found, expected = np.std(errors, axis=0), np.array([*of_q, *of_v])
    assert np.allclose(found, expected, rtol=6.0 / np.sqrt(2 * n))
    assert np.all(np.abs(np.mean(errors, axis=0)) < 6.0 * expected / np.sqrt(n))


def test_noise_depends_on_seed_and_time_alone(go2):
    state, noise, again = go2.standing(), SensorNoise(go2, 5), SensorNoise(go2, 5)
    late = [noise(state.q, state.v, t)[1] for t in (0.3, 0.1, 0.2)]
    early = [again(state.q, state.v, t)[1] for t in (0.1, 0.2, 0.3)]
    assert np.array_equal(late, [early[2], early[0], early[1]])
    assert not np.any(early[0] == early[1])
    assert not np.any(SensorNoise(go2, 6)(state.q, state.v, 0.1)[1] == early[0])
    none = SensorNoise(go2, 5).scaled(0.0)(state.q, state.v, 0.1)
    assert np.array_equal(none[0], state.q) and np.array_equal(none[1], state.v)


def test_measurements_arrive_after_their_latency_and_a_reset_begins_anew(go2):
    controller, sim = Recording(go2.d), fb.Simulation(go2)
    observed = Observed(controller, Latency(q=0.003, v=0.0045))
    run = fb.rollout(sim, observed, 0.02)
    rows = np.arange(20)
    assert np.array_equal([q for q, _, _ in controller.seen], run.q[np.maximum(rows - 3, 0)])
    assert np.array_equal([v for _, v, _ in controller.seen], run.v[np.maximum(rows - 5, 0)])
    before = list(controller.seen)
    controller.seen.clear()
    sim.reset()
    fb.rollout(sim, observed, 0.02)
    for old, new in zip(before, controller.seen, strict=True):
        assert np.array_equal(old[0], new[0]) and np.array_equal(old[1], new[1])


def test_a_walk_with_noise_and_latency_walks_and_repeats_itself(go2):
    contacts = fb.Contacts.feet(go2, mu=0.6)
    walk = Walk(go2, contacts, Gait.trot(go2, start=0.2), velocity=[0.2, 0.0])
    observed = Observed(walk, Latency(q=0.002, v=0.002), SensorNoise(go2, seed=2))
    runs = []
    for _ in range(2):
        runs.append(fb.rollout(fb.Simulation(go2), observed, 0.8, control_period=0.002))
    assert runs[0].outcome == "completed"
    assert len({stance.names for stance in runs[0].stances}) > 1  # feet left the ground
    assert np.array_equal(runs[0].q, runs[1].q)


def test_the_wrapper_has_the_attributes_of_the_controller_but_not_its_methods():
    robot, controller = judges.load("go2"), judges.controller_of("go2")
    observed = Observed(controller, SensorNoise(robot))
    assert observed.contacts is controller.contacts and observed.robot is robot
    assert not hasattr(Observed(judges.limp), "contacts")
    for copied in (copy.deepcopy(observed), pickle.loads(pickle.dumps(observed))):
        assert copied.robot == robot
    with pytest.raises(AttributeError, match="qp"):
        observed.qp(robot.standing())
    with pytest.raises(AttributeError):
        observed.velocity = [1.0, 0.0]


def test_observers_that_cannot_be_are_refused(go2):
    for make, number in (
        (lambda: Observed(judges.limp, lambda q, v: (q, v)), "observer 0"),
        (lambda: Latency(v=20.0), "20"),
        (lambda: Observed(judges.limp, lambda q, v, t: q)(np.zeros(19), np.zeros(18)), "(q, v)"),
    ):
        refused(make, InputError, number)
