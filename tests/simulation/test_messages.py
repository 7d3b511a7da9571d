"""Errors of simulations and rollouts: their types, and the names and numbers in their messages."""

from __future__ import annotations

import copy
import pickle
import warnings
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import judges
import numpy as np
import pytest
from judges import limp
from messages import raises, refused, warns

import floatbase as fb
from floatbase.errors import InputError, SimulationError, SimulationWarning, UnknownNameError
from floatbase.simulation import Ground

GO2, SOLO = judges.load("go2"), judges.load("solo12")
SIM, ARM = fb.Simulation(GO2), fb.Simulation(judges.load("ur5"))
UP = [0.0, 0.0, 1.0]


def answering(**parts: np.ndarray) -> Callable[..., SimpleNamespace]:
    return lambda q, v, t: SimpleNamespace(**parts)


@pytest.mark.parametrize(
    "case",
    [
        (lambda: fb.Simulation("go2"), InputError, "robot", "Robot", "go2"),
        (
            lambda: fb.Simulation(fb.load("go2", feet=["FL_foot_joint"])),
            SimulationError,
            "FL_foot_joint",
        ),
        (lambda: fb.Simulation(GO2, ground=0.0), InputError, "mu", 0),
        (lambda: fb.Simulation(GO2, ground="ice"), InputError, "mu", "ice"),
        (lambda: fb.Simulation(GO2, timestep=0.0), InputError, "timestep", 0),
        (lambda: Ground(normal=[0.0, 0.0, 0.0]), InputError, "normal"),
        (lambda: Ground(normal=[UP, [0.0, 0.0, 0.0]]), InputError, "normal", 1),
        (lambda: Ground(normal=[UP, UP], offset=[0.1]), InputError, "offset", 1, 2),
        (lambda: Ground(offset="deep"), InputError, "offset", "deep"),
        (lambda: SIM.reset(3), InputError, "state", "State", 3),
        (lambda: SIM.reset(SOLO.standing()), InputError, "go2"),
        (lambda: SIM.step(np.zeros(3)), InputError, "torques", 3, 12),
        (lambda: SIM.step("full"), InputError, "torques", "full"),
        (lambda: SIM.step(np.full(12, np.nan)), InputError, "torques", np.nan),
        (
            lambda: SIM.step(np.zeros(12), (fb.Push(UP, frame="bse"),)),
            UnknownNameError,
            "bse",
            "base",
        ),
        (lambda: fb.Push([1.0, 0.0]), InputError, "force", 2, 3),
        (lambda: fb.Push(UP, start=-1.0), InputError, "start", -1),
        (lambda: fb.Push(UP, duration=0.0), InputError, "duration", 0),
        (lambda: fb.rollout(3, limp, 1.0), InputError, "sim", "Simulation", 3),
        (lambda: fb.rollout(SIM, limp, -1.0), InputError, "duration", -1),
        (
            lambda: fb.rollout(SIM, limp, 1.0, control_period=0.0015),
            InputError,
            "control_period",
            0.0015,
            "timestep",
            0.001,
        ),
        (
            lambda: fb.rollout(SIM, limp, 1.0, control_period=0.0001),
            InputError,
            "control_period",
            0.0001,
            "timestep",
            0.001,
        ),
        (lambda: fb.rollout(SIM, limp, 0.0105), InputError, "duration", 0.0105, 0.001, 0.01),
        (
            lambda: fb.rollout(SIM, limp, 0.001, control_period=0.002),
            InputError,
            "duration",
            0.001,
            0.002,
        ),
        (
            lambda: fb.rollout(ARM, limp, 1.0, [fb.Push(UP, start=0.9)]),
            InputError,
            "base",
            "ur5",
            "shoulder_link",
        ),
        (lambda: fb.rollout(SIM, limp, 1.0, [3]), InputError, "pushes", "Push", 3),
        (lambda: fb.rollout(SIM, limp, 1.0, fb.Push(UP)), InputError, "pushes", "Push"),
        (
            lambda: fb.rollout(SIM, limp, 1.0, [fb.Push(UP, frame="bse")]),
            UnknownNameError,
            "bse",
            "base",
        ),
        (lambda: fb.rollout(SIM, 3, 1.0), InputError, "controller", 3),
        (
            lambda: fb.rollout(SIM, lambda q, v, t: None, 1.0),
            InputError,
            "controller",
            "tau",
            12,
            "None",
        ),
        (
            lambda: fb.rollout(SIM, answering(tau=np.full(3, np.nan)), 0.1),
            InputError,
            "controller",
            3,
            12,
        ),
        (
            lambda: fb.rollout(SIM, answering(tau=np.zeros(12), forces=np.zeros(9)), 0.01),
            InputError,
            "forces",
            9,
            12,
        ),
        (lambda: fb.rollout(SIM, lambda q, v: None, 1.0), InputError, "controller", "q", "v", "t"),
        (
            lambda: fb.rollout(SIM, lambda q, v, t, gain: None, 1.0),
            InputError,
            "controller",
            "gain",
        ),
        # go2 and solo12 have the same number of joints: only the robots themselves differ
        (
            lambda: fb.rollout(fb.Simulation(SOLO), judges.controller_of("go2"), 0.01),
            InputError,
            "controller",
            "go2",
            "solo12",
        ),
    ],
)
def test_bad_input_is_refused_by_name(case: tuple[Any, ...]) -> None:
    refused(*case)


@pytest.mark.parametrize("name", ["timestep", "ground", "robot", "model", "data", "q", "time"])
def test_what_a_simulation_was_made_with_cannot_be_set(name: str) -> None:
    for sim in (SIM, copy.deepcopy(SIM), pickle.loads(pickle.dumps(SIM))):
        with raises(AttributeError, name):
            setattr(sim, name, getattr(sim, name))


@pytest.mark.parametrize("name", ["mu", "link_colisions"])
def test_a_simulation_takes_no_attribute_that_it_would_not_read(name: str) -> None:
    for sim in (SIM, copy.deepcopy(SIM)):
        with raises(AttributeError, name):
            setattr(sim, name, True)


def test_a_timestep_changed_in_mujocos_model_is_refused() -> None:
    sim = fb.Simulation(GO2)
    sim.model.opt.timestep = 0.002
    refused(lambda: fb.rollout(sim, limp, 0.01), InputError, "timestep", 0.002, 0.001)


@pytest.mark.parametrize(
    ("start", "numbers"), [(0.0, (0, 0.01, 0.02, 0.03)), (0.03, (0.01, 0.02, 0.03, 0.04))]
)
def test_a_push_that_does_not_act_in_a_rollout_is_said(
    start: float, numbers: tuple[float, ...]
) -> None:
    sim = fb.Simulation(GO2)
    idle, near = (fb.Push(UP, start=start, duration=0.01), fb.Push(UP, start=0.02, duration=0.01))
    with warnings.catch_warnings(action="error"):
        fb.rollout(sim, limp, 0.02)
        fb.rollout(
            copy.copy(sim), limp, 0.01, [idle, near]
        )  # a copy, so that sim itself does not move
    with warns(SimulationWarning, *numbers):
        fb.rollout(sim, limp, 0.01, [idle])
