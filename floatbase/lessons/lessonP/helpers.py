"""Lesson P: the simulations behind its exercises."""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

import floatbase as fb
from floatbase.dynamics import Contacts
from floatbase.playground import Perturbation, PerturbedSimulation
from floatbase.simulation import Rollout

MU, PERIOD = 0.7, 4e-3  # friction coefficient; s: control period
BAG_MASS = 6.0  # kg, of exercise P.1
# of exercise P.3: actual mass as a multiple of the mass that the controller assumes
HIDDEN_MASS = 1.8  # to two digits, the planned forces would give 1.7
_HIDDEN_KP = 250.0  # 1/s², which is not a default anywhere
_SETTLING_TIME = 2.0  # s after which a robot that underestimates its mass is at rest
_LEAN_TIME = 1.0  # s to shift the centre of mass, on four feet
_LIFT_HEIGHT = 0.04  # m


def _run_standing(sim: fb.Simulation, kp: float) -> Rollout:
    """Simulate a standing controller with this kp of the centre of mass for `_SETTLING_TIME`."""
    state = sim.state
    _, level, posture = fb.standing_tasks(state)
    tasks = [fb.CoMTask(state.com, kp=kp), level, posture]
    controller = fb.WholeBodyController(sim.robot, Contacts.feet(sim.robot, MU), tasks)
    return fb.rollout(sim, controller, _SETTLING_TIME, control_period=PERIOD)


def com_sag(kp: float, bag: float = BAG_MASS) -> float:
    """Return how far go2's centre of mass sinks if go2 is heavier than the controller assumes."""
    robot = fb.load("go2")
    sim = PerturbedSimulation(robot, MU, perturbation=Perturbation(mass=1.0 + bag / robot.mass))
    record = _run_standing(sim, kp)
    below = float(robot.standing().com[2] - record.final.com[2])
    return below if record.outcome == "completed" else float("inf")


@cache
def unknown_mass_record() -> Rollout:
    """Return the record of exercise P.3: go2 with a mass that the learner does not know."""
    return _run_standing(
        PerturbedSimulation(fb.load("go2"), MU, perturbation=Perturbation(mass=HIDDEN_MASS)),
        _HIDDEN_KP,
    )


def time_on_two_feet(shift: npt.ArrayLike) -> float:
    """Return how long go2 stays up on FL and RR."""
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
