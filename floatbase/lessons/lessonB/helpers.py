"""Lesson B: a hydraulic cylinder on a test bench, and pushes on go2 with slow cylinders."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

import floatbase as fb
from floatbase.actuators import Cylinders, HydraulicActuators, Hydraulics, HydraulicState
from floatbase.lessons.lesson03 import standing_go2_eom

# N·m: torque limit of go2's knee: what its cylinder exerts in the weaker direction where the lever
# is longest
KNEE_TORQUE = 45.43
SUBSTEPS = 5  # per millisecond
ROUNDING = 1e-9  # rad
PUSH = np.array([0.0, 30.0, 0.0])  # N, to the left, for 0.1 s: the push of the lesson
# s: with ideal torques, with cylinders before the push, and from the start of the push to the end
SETTLE, BEFORE, AFTER = 0.5, 0.1, 1.4
JUDGED_TIME = 0.2  # s at the end in which the response is judged

JointMotion = Callable[[float], tuple[float, float]]


class BenchSample(NamedTuple):
    """State of the bench at one time."""

    time: float
    torque: float
    u: float
    pressure_a: float
    pressure_b: float
    angle: float


def hold_then_turn(speed: float, start: float = 0.15, end: float = 0.6) -> JointMotion:
    """Return a joint motion: the joint is held at its centre, turned evenly, and held again.

    Parameters
    ----------
    speed : float
        Angular velocity, at least 0 [rad/s]; the rod moves out.
    start : float, optional
        Time at which the joint starts to turn [s].
    end : float, optional
        Angle at which it stops [rad].

    Returns
    -------
    callable
        Function of time [s] that returns angle [rad] and velocity [rad/s].
    """

    def motion(t: float) -> tuple[float, float]:
        angle = speed * (t - start)
        return (0.0, 0.0) if t < start else (angle, speed) if angle < end - ROUNDING else (end, 0.0)

    return motion


class Bench:
    """Test bench with the hydraulic cylinder of a knee of go2.

    The bench holds or turns the joint, whatever its torque. You control the valve: `step(u)` sends
    the command u, from -1 to 1, to the valve and advances time by 1 ms. `torque` [N·m] is the
    torque at the joint, `desired_torque` the desired one, and `samples` is the record. Equations,
    spool and time steps are those of `Cylinders` and `HydraulicActuators`.

    Parameters
    ----------
    motion : callable, optional
        Function of time [s] that returns the angle of the joint from the centre [rad] and its
        velocity [rad/s]; by default the joint is held.
    desired_torque : float, optional
        Desired torque from t = 0 on [N·m]. The bench starts at zero torque.
    hydraulics : Hydraulics, optional
        The cylinder that is scaled to the knee.
    """

    dt = 1e-3  # s: duration of a step

    def __init__(
        self,
        motion: JointMotion | None = None,
        desired_torque: float = 12.0,
        hydraulics: Hydraulics | None = None,
    ):
        self.hydraulics = hydraulics or Hydraulics()
        self.motion, self.desired_torque = motion or hold_then_turn(0.0), desired_torque
        self.actuators = _knee_actuators(self.hydraulics)
        self.cylinder = self.actuators.cylinders
        self.crank, self.base = float(self.cylinder.crank[0]), float(self.cylinder.base[0])
        self.piston_area, self.ring_area = self.cylinder.areas[:, 0].tolist()
        self.time = 0.0
        self._update_geometry()
        self.samples = [self._sample(0.0)]

    def _update_geometry(self) -> None:
        self.angle, self.velocity = self.motion(self.time)
        self._geometry = self.cylinder.geometry([self.angle])
        self.lever = float(self._geometry.lever[0])

    @property
    def torque(self) -> float:
        """Torque at the joint [N·m]."""
        return self.lever * float(self.cylinder.force(self.actuators.state.pressures)[0])

    @property
    def volumes(self) -> tuple[float, float]:
        """Volumes of the oil in the chambers A and B [m³]."""
        a, b = self._geometry.volumes[:, 0].tolist()
        return a, b

    @property
    def stiffness(self) -> float:
        """Stiffness of the joint with closed chambers [N·m/rad]: L² k."""
        return self.lever**2 * float(self._geometry.stiffness[0])

    def torque_rate(self, side: float = 1.0) -> float:
        """Return the rate of the torque with the valve fully open to one side, 1 or -1 [N·m/s]."""
        drop = self.cylinder.line_pressures(np.array([side])) - self.actuators.state.pressures
        rates = self.cylinder.orifice_flow(drop) / self._geometry.compliance
        return side * self.lever * float(self.cylinder.force(rates)[0])

    def torque_range(self) -> tuple[float, float]:
        """Return the smallest and largest torque at this angle that supply and tank allow [N·m]."""
        least, most = sorted((self.lever * self.cylinder.force_limits()[:, 0]).tolist())
        return least, most

    def step(self, u: float) -> None:
        """Send the command u to the valve and advance time by 1 ms."""
        u = min(1.0, max(-1.0, u))
        opening, pressures = self.actuators.state.opening, self.actuators.state.pressures
        for _ in range(SUBSTEPS):
            opening, pressures = self.cylinder.advance(
                opening,
                pressures,
                np.array([u]),
                self._geometry,
                np.array([self.velocity]),
                self.dt / SUBSTEPS,
            )
        self.actuators.state = HydraulicState(opening, pressures, np.zeros(1))
        self.record_sample(u)

    def record_sample(self, u: float) -> None:
        """Advance time by 1 ms and record a sample."""
        self.time = self.dt * len(self.samples)
        self._update_geometry()
        self.samples.append(self._sample(u))

    def _sample(self, u: float) -> BenchSample:
        a, b = self.actuators.state.pressures[:, 0].tolist()
        return BenchSample(self.time, self.torque, u, a, b, self.angle)


def _knee_actuators(hydraulics: Hydraulics) -> HydraulicActuators:
    """Return one cylinder with its force loop, at zero torque."""
    actuators = HydraulicActuators(standing_go2_eom().robot, hydraulics)
    size = KNEE_TORQUE / Hydraulics().weakest_torque
    actuators.cylinders = Cylinders(hydraulics, [size], [0.0])
    actuators.reset()
    return actuators


def run_force_loop(bench: Bench, bandwidth: float, time: float) -> list[BenchSample]:
    """Run the force loop of floatbase on a new bench."""
    bench.actuators = _knee_actuators(replace(bench.hydraulics, loop_bandwidth=bandwidth))
    for _ in range(round(time / bench.dt)):
        bench.actuators.step([bench.desired_torque], [bench.angle], [bench.velocity], bench.dt)
        bench.record_sample(float(bench.actuators.state.opening[0]))
    return bench.samples


class PushResponse(NamedTuple):
    """Response to a push."""

    outcome: str
    offset: float
    oscillation: float


@cache
def push_response(kp: float, kd: float, bandwidth: float = 5.0) -> PushResponse:
    """Push go2 on the default cylinders, as in the lesson."""
    robot = fb.load("go2")
    state = robot.standing()
    tasks = [replace(task, kp=kp, kd=kd) for task in fb.standing_tasks(state)]  # type: ignore[type-var]
    controller = fb.WholeBodyController(robot, fb.Contacts.points(robot), tasks)
    sim = fb.Simulation(robot)
    fb.rollout(sim, controller, SETTLE)
    oil = HydraulicActuators(robot, Hydraulics(loop_bandwidth=bandwidth))
    oil.reset(controller(sim.q, sim.v).tau, sim.q[7:])
    push = fb.Push(PUSH, start=sim.time + BEFORE)
    record = fb.rollout(sim, controller, BEFORE + AFTER, [push], actuators=oil)
    end = 1000.0 * (record.com - state.com)[record.time > record.time[-1] - JUDGED_TIME]
    return PushResponse(
        record.outcome, float(np.linalg.norm(end, axis=1).max()), float(np.ptp(end, axis=0).max())
    )
