"""Lesson B, Torque is an abstraction: how well go2 comes back from a push on slow cylinders."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

import floatbase as fb
from floatbase.actuators import HydraulicActuators, Hydraulics

PUSH = np.array([0.0, 30.0, 0.0])  # N, to the left, for 0.1 s: the lesson's
SETTLE, BEFORE, AFTER = (
    0.5,
    0.1,
    1.4,
)  # s: on perfect torques, on oil before the push, and from its start to the end
JUDGED_TIME = 0.2  # s, at the end, in which it is judged


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
