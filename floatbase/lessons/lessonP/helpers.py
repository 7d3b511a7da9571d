"""Lesson P, Playground: runs on physics that its exercises are about."""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

import floatbase as fb
from floatbase.dynamics import Contacts
from floatbase.simulation import Perturbation, PerturbedSimulation, Rollout

MU, PERIOD = 0.7, 4e-3  # friction; s between ticks
BAG_MASS = 6.0  # kg, of exercise P.1
# of exercise P.3: the mass in that world, as a multiple of what the controller believes
HIDDEN_MASS = 1.37
_HIDDEN_KP = 250.0  # 1/s², which is nobody's default
_SETTLING_TIME = 2.0  # s after which a robot that is heavier than it believes has come to rest
_LEAN_TIME = 1.0  # s to shift the centre of mass, on four feet
_LIFT_HEIGHT = 0.04  # m


def _run_standing(sim: fb.Simulation, kp: float) -> Rollout:
    """`_SETTLING_TIME` s of a controller that stands, with this kp of the centre of mass."""
    state = sim.state
    _, level, posture = fb.standing_tasks(state)
    tasks = [fb.CoMTask(state.com, kp=kp), level, posture]
    controller = fb.WholeBodyController(sim.robot, Contacts.feet(sim.robot, MU), tasks)
    return fb.rollout(sim, controller, _SETTLING_TIME, control_period=PERIOD)


def com_sag(kp: float, bag: float = BAG_MASS) -> float:
    """How far go2's centre of mass comes down, m, when all its parts together are `bag` kg heavier
    than it believes.

    kp: 1/s², of the task for the centre of mass. It is infinite when the robot does not stand.
    """
    robot = fb.load("go2")
    sim = PerturbedSimulation(robot, MU, perturbation=Perturbation(mass=1.0 + bag / robot.mass))
    record = _run_standing(sim, kp)
    below = float(robot.standing().com[2] - record.final.com[2])
    return below if record.outcome == "completed" else float("inf")


@cache
def unknown_mass_record() -> Rollout:
    """Of exercise P.3: go2 in a world whose mass nobody tells."""
    return _run_standing(
        PerturbedSimulation(fb.load("go2"), MU, perturbation=Perturbation(mass=HIDDEN_MASS)),
        _HIDDEN_KP,
    )


def time_on_two_feet(shift: npt.ArrayLike) -> float:
    """For how long go2 stays up, s and at most 3, on FL and RR after a second with its centre of
    mass moved on four feet.

    shift: (3,) m, world.
    """
    robot = fb.load("go2")
    sim = fb.Simulation(robot, MU)
    state, contacts, lifted = sim.state, Contacts.feet(robot, MU), ("FR_foot", "RL_foot")
    _, level, posture = fb.standing_tasks(state)
    tasks = [fb.CoMTask(state.com + np.asarray(shift)), level, posture]
    fb.rollout(
        sim, fb.WholeBodyController(robot, contacts, tasks), _LEAN_TIME, control_period=PERIOD
    )
    up = [fb.FrameTask(name, state.point(name) + [0.0, 0.0, _LIFT_HEIGHT]) for name in lifted]
    controller = fb.WholeBodyController(robot, contacts.without(*lifted), [*tasks, *up])
    return float(fb.rollout(sim, controller, 3.0, control_period=PERIOD).time[-1]) - _LEAN_TIME
