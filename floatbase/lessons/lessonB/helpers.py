"""Lesson B, Torque is an abstraction: one cylinder of the package on a test bench, and how well
go2 comes back from a push on slow cylinders.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

import floatbase as fb
from floatbase.actuators import Cylinders, HydraulicActuators, Hydraulics, HydraulicState
from floatbase.lessons.lesson03 import standing_go2_eom

# N·m: go2's torque limit at the knee, which its cylinder gives where the lever is longest, in the
# weaker direction
KNEE_TORQUE = 45.43
SUBSTEPS = 5  # of a millisecond
ROUNDING = 1e-9  # rad
PUSH = np.array([0.0, 30.0, 0.0])  # N, to the left, for 0.1 s: the lesson's
SETTLE, BEFORE, AFTER = (
    0.5,
    0.1,
    1.4,
)  # s: on perfect torques, on oil before the push, and from its start to the end
JUDGED_TIME = 0.2  # s, at the end, in which it is judged

JointMotion = Callable[[float], tuple[float, float]]


class BenchSample(NamedTuple):
    """The bench at one time: s; N·m; what the valve was told, -1 to 1, or in a force loop its
    opening; Pa of chambers A and B; angle, rad from the centre.
    """

    time: float
    torque: float
    u: float
    pressure_a: float
    pressure_b: float
    angle: float


def hold_then_turn(speed: float, start: float = 0.15, end: float = 0.6) -> JointMotion:
    """The joint is held at its centre until `start`, s, then turned evenly, rad/s, and from `end`,
    rad, on held again.

    speed: ≥ 0; the rod goes out.
    """

    def motion(t: float) -> tuple[float, float]:
        angle = speed * (t - start)
        return (0.0, 0.0) if t < start else (angle, speed) if angle < end - ROUNDING else (end, 0.0)

    return motion


class Bench:
    """The hydraulic cylinder of a knee of go2. The bench holds or turns the joint, whatever its
    torque; the valve is yours.

    `step(u)` tells the valve u, from -1 to 1, and lets a millisecond pass. `torque`, N·m, is what
    the joint gets, `desired_torque` what it should; `samples` is the record. Equations, spool and
    steps are those of `Cylinders` and `HydraulicActuators`.

    motion: t -> angle and velocity of the joint, rad from the centre and rad/s; held, by default.
    desired_torque: N·m, at t ≥ 0. The bench begins at zero torque.
    hydraulics: the cylinder that is scaled to the knee.
    """

    dt = 1e-3  # s, of a step

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
        """What the joint gets, N·m."""
        return self.lever * float(self.cylinder.force(self.actuators.state.pressures)[0])

    @property
    def volumes(self) -> tuple[float, float]:
        """Of the oil in the chambers A and B, m³."""
        a, b = self._geometry.volumes[:, 0].tolist()
        return a, b

    @property
    def stiffness(self) -> float:
        """What closed chambers are for the joint, N·m/rad: L² k."""
        return self.lever**2 * float(self._geometry.stiffness[0])

    def torque_rate(self, side: float = 1.0) -> float:
        """How fast the torque changes with the valve all open, N·m/s: the way that `side` says, 1
        or -1.
        """
        drop = self.cylinder.line_pressures(np.array([side])) - self.actuators.state.pressures
        rates = self.cylinder.orifice_flow(drop) / self._geometry.compliance
        return side * self.lever * float(self.cylinder.force(rates)[0])

    def torque_range(self) -> tuple[float, float]:
        """The least and the largest torque that supply and tank allow at this angle, N·m."""
        least, most = sorted((self.lever * self.cylinder.force_limits()[:, 0]).tolist())
        return least, most

    def step(self, u: float) -> None:
        """Tell the valve u and let a millisecond pass."""
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
        """Move on by a millisecond, and keep a row."""
        self.time = self.dt * len(self.samples)
        self._update_geometry()
        self.samples.append(self._sample(u))

    def _sample(self, u: float) -> BenchSample:
        a, b = self.actuators.state.pressures[:, 0].tolist()
        return BenchSample(self.time, self.torque, u, a, b, self.angle)


def _knee_actuators(hydraulics: Hydraulics) -> HydraulicActuators:
    """One cylinder with its force loop, at zero torque: the supply may change, its size does
    not.
    """
    actuators = HydraulicActuators(standing_go2_eom().robot, hydraulics)
    size = KNEE_TORQUE / Hydraulics().weakest_torque
    actuators.cylinders = Cylinders(hydraulics, [size], [0.0])
    actuators.reset()
    return actuators


def run_force_loop(bench: Bench, bandwidth: float, time: float) -> list[BenchSample]:
    """The package's force loop of so many Hz on a new bench for `time` s: its rows."""
    bench.actuators = _knee_actuators(replace(bench.hydraulics, loop_bandwidth=bandwidth))
    for _ in range(round(time / bench.dt)):
        bench.actuators.step([bench.desired_torque], [bench.angle], [bench.velocity], bench.dt)
        bench.record_sample(float(bench.actuators.state.opening[0]))
    return bench.samples


class PushResponse(NamedTuple):
    """How a push ended: outcome; mm by which go2 is off its place at worst in the end, and by which
    it then still swings.
    """

    outcome: str
    offset: float
    oscillation: float


@cache
def push_response(kp: float, kd: float, bandwidth: float = 5.0) -> PushResponse:
    """Push go2 as in the lesson, on the default cylinders.

    kp, kd: gains of all its tasks, 1/s² and 1/s. bandwidth: Hz, of the force loops.
    """
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
