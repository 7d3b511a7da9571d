"""Rollouts through actuators: their records, the actuators' state, and falls with slow force loops.

The actuators are those of App. B.
"""

from dataclasses import dataclass, field
from functools import cache
from types import SimpleNamespace

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.actuators import HydraulicActuators, Hydraulics

# N: a fifth of go2's weight for 0.2 s
PUSH = (fb.Push(np.array([30.0, 0.0, 0.0]), start=0.1, duration=0.2),)


@cache
def controller() -> fb.WholeBodyController:
    return judges.controller_of("go2", joint_limits=None)


@dataclass
class Lag:
    """Actuators that pass on a fraction of the torques and record their calls."""

    part: float = 0.5
    calls: list[tuple[np.ndarray, np.ndarray, np.ndarray, float]] = field(default_factory=list)

    def step(
        self, tau_desired: np.ndarray, q_joints: np.ndarray, v_joints: np.ndarray, dt: float
    ) -> np.ndarray:
        self.calls.append((tau_desired, q_joints, v_joints, dt))
        return self.part * len(self.calls) * tau_desired


@pytest.fixture(scope="module")
def sim() -> fb.Simulation:
    return fb.Simulation(judges.load("go2"))


def stand(
    sim: fb.Simulation, bandwidth: float, pushes: tuple[fb.Push, ...] = (), duration: float = 3.0
) -> fb.Rollout:
    """Let go2 stand with force loops of a bandwidth [Hz], which start at the standing torques."""
    sim.reset()
    q, v = sim.q, sim.v
    actuators = HydraulicActuators(sim.robot, Hydraulics(loop_bandwidth=bandwidth))
    actuators.reset(controller()(q, v).tau, q[7:])
    return fb.rollout(sim, controller(), duration, pushes, actuators=actuators)


def sway(rollout: fb.Rollout) -> float:
    """Return the largest distance of the centre of mass from its initial position [m]."""
    return float(np.max(np.linalg.norm(rollout.com - rollout.com[0], axis=1)))


# what the loop and the record do


def test_without_actuators_applied_torques_are_desired_ones(sim):
    sim.reset()
    rollout = fb.rollout(sim, controller(), 0.02, control_period=4e-3)
    assert rollout.tau.shape == rollout.tau_desired.shape == (5, 12)
    assert np.array_equal(rollout.tau, rollout.tau_desired)


def test_torques_pass_the_actuators_in_every_step_and_the_record_keeps_their_mean(sim):
    sim.reset()
    lag = Lag(0.1)
    rollout = fb.rollout(sim, controller(), 0.012, control_period=4e-3, actuators=lag)
    assert len(lag.calls) == 12 and {dt for *_, dt in lag.calls} == {1e-3}
    for tick in range(3):
        calls = lag.calls[4 * tick : 4 * tick + 4]
        assert all(np.array_equal(tau, rollout.tau_desired[tick]) for tau, *_ in calls)
        assert np.array_equal(calls[0][1], rollout.q[tick][7:])
        assert np.array_equal(calls[0][2], rollout.v[tick][6:])
        mean = 0.1 * (4 * tick + 2.5) * rollout.tau_desired[tick]
        assert np.allclose(rollout.tau[tick], mean, rtol=1e-12)


def test_the_physics_gets_what_the_actuators_give(sim):
    """With actuators that give no torque, the robot falls like a limp one."""

    def limp(q: np.ndarray, v: np.ndarray, t: float) -> SimpleNamespace:
        return SimpleNamespace(tau=np.zeros(12))

    sim.reset()
    held_back = fb.rollout(sim, controller(), 0.1, actuators=Lag(0.0))
    sim.reset()
    assert np.array_equal(held_back.q, fb.rollout(sim, limp, 0.1).q)
    assert held_back.q[-1, 2] < held_back.q[0, 2] - 0.01


def test_joints_without_limits_reach_the_actuators_as_angles():
    robot = fb.load("kinova")
    assert robot.nq > robot.nv
    sim, lag = fb.Simulation(robot), Lag(0.0)
    start = robot.standing().replace(v=np.full(robot.d, 2.0))
    sim.reset(start)
    controller = fb.WholeBodyController(robot, fb.Contacts.none(), (fb.PostureTask(start.q),))
    fb.rollout(sim, controller, 0.05, actuators=lag)
    angles = np.array([q for _, q, *_ in lag.calls])
    assert angles.shape == (50, robot.d)
    rates = np.diff(np.unwrap(angles, axis=0), axis=0) / 1e-3
    assert np.allclose(rates, [v for *_, v, _ in lag.calls][1:], atol=1e-6)


def test_a_rollout_leaves_the_actuators_memory_alone(sim):
    """Two rollouts of 0.05 s equal one of 0.1 s."""
    records = []
    for parts in ((0.1,), (0.05, 0.05)):
        sim.reset()
        actuators = HydraulicActuators(sim.robot)
        rows = [
            fb.rollout(sim, controller(), duration, actuators=actuators).tau for duration in parts
        ]
        records.append(np.vstack(rows))
    assert np.array_equal(records[0], records[1])


# the URDF of g1 has no rotors: oil on an ankle of 3e-4 kg m² is a spring of 3400 rad/s, which no
# step of 1 ms resolves
@pytest.mark.parametrize("name", [name for name in judges.ROBOTS if name != "g1"])
def test_every_robot_holds_itself_up_with_cylinders(name):
    """Every joint is within 5 % of its torque limit of the desired torque from 10 ms on.

    At the end, after 0.5 s, it is within 0.1 %. (In the first millisecond the contacts give way,
    and the desired motion of anymal_kinova's arm begins: 15 %.) On every joint by itself, the oil
    spring's phase advances by less than 1.75 rad in a step of 1 ms.
    """
    robot = judges.load(name)
    state = robot.standing()
    controller, sim = judges.controller_of(name), fb.Simulation(robot)
    actuators = HydraulicActuators(robot)
    geometry = actuators.cylinders.geometry(actuators.cylinders.max_lever_angle)
    inertia = 1.0 / np.diag(np.linalg.inv(state.M))[-robot.d :]
    assert np.max(np.sqrt(geometry.lever**2 * geometry.stiffness / inertia)) * sim.timestep < 1.75
    actuators.reset(controller(state.q, state.v).tau)
    rollout = fb.rollout(sim, controller, 0.5, actuators=actuators)
    assert rollout.outcome == "completed"
    error = np.abs(rollout.tau - rollout.tau_desired) / robot.torque_limits
    assert np.max(error[10:]) < 0.05
    assert np.max(error[-50:]) < 1e-3
    assert sway(rollout) < 2e-3


# go2 on slower and slower force loops


def test_a_push_moves_go2_no_further_on_a_fast_force_loop_than_with_ideal_torques(sim):
    """A push of 30 N for 0.2 s moves both by 12 mm, with a difference of at most 0.1 mm."""
    sim.reset()
    ideal = fb.rollout(sim, controller(), 0.6, PUSH)
    hydraulic = stand(sim, 50.0, PUSH, 0.6)
    assert ideal.outcome == hydraulic.outcome == "completed"
    assert sway(ideal) == pytest.approx(0.012, abs=1e-3)
    assert sway(hydraulic) == pytest.approx(sway(ideal), abs=1e-4)
