"""Errors of simulations and rollouts: their types, and the names and numbers in their messages."""

import copy
import pickle
import warnings
from collections.abc import Callable
from types import SimpleNamespace

import judges
import numpy as np
import pytest
from judges import limp
from messages import raises, refused, warns

import floatbase as fb
from floatbase.errors import InputError, SimulationWarning, UnknownNameError

GO2, SOLO = judges.load("go2"), judges.load("solo12")
SIM, ARM = fb.Simulation(GO2), fb.Simulation(judges.load("ur5"))
UP = [0.0, 0.0, 1.0]


def answering(**parts: np.ndarray) -> Callable[..., SimpleNamespace]:
    return lambda q, v, t: SimpleNamespace(**parts)


@pytest.mark.parametrize(
    "case",
    [
        (lambda: fb.Simulation(GO2, ground=0.0), "mu", 0),
        (lambda: fb.Ground(normal=[0.0, 0.0, 0.0]), "normal"),
        (lambda: fb.Ground(normal=[UP, [0.0, 0.0, 0.0]]), "normal", 1),
        (lambda: fb.Ground(normal=[UP, UP], offset=[0.1]), "offset", 1, 2),
        (lambda: fb.Ground([0.5, 0.6]), "mu", 2, 1),
        (lambda: fb.Ground([0.5, -0.6], normal=[UP, UP]), "mu", 1, -0.6),
        (lambda: SIM.reset(3), "state", "State", 3),
        (lambda: SIM.reset(SOLO.standing()), "go2"),
        (lambda: SIM.step(np.zeros(3)), "torques", 3, 12),
        (lambda: SIM.step("full"), "torques", "full"),
        (lambda: fb.rollout(SIM, limp, 1.0, control_period=0.0015), "control_period", 0.0015,
            "timestep", 0.001),
        (lambda: fb.rollout(SIM, limp, 1.0, control_period=0.0001), "control_period", 0.0001,
            "timestep", 0.001),
        (lambda: fb.rollout(SIM, limp, 0.0105), "duration", 0.0105, 0.001, 0.01),
        (lambda: fb.rollout(SIM, limp, 0.001, control_period=0.002), "duration", 0.001, 0.002),
        (lambda: fb.rollout(ARM, limp, 1.0, [fb.Push(UP, start=0.9)]), "base", "ur5",
            "shoulder_link"),
        (lambda: fb.rollout(SIM, limp, 1.0, [3]), "pushes", "Push", 3),
        (lambda: fb.rollout(SIM, limp, 1.0, fb.Push(UP)), "pushes", "Push"),
        (lambda: fb.rollout(SIM, lambda q, v, t: None, 1.0), "controller", "tau", 12, "None"),
        (lambda: fb.rollout(SIM, answering(tau=np.full(3, np.nan)), 0.1), "controller", 3, 12),
        (lambda: fb.rollout(SIM, answering(tau=np.zeros(12), forces=np.zeros(9)), 0.01), "forces",
            9, 12),
        (lambda: fb.rollout(SIM, lambda q, v: None, 1.0), "controller", "q", "v", "t"),
        (lambda: fb.rollout(SIM, lambda q, v, t, gain: None, 1.0), "controller", "gain"),
        (lambda: fb.rollout(fb.Simulation(SOLO), judges.controller_of("go2"), 0.01), "controller",
            "go2", "solo12"),
    ],
)  # fmt: skip
def test_bad_input_is_refused_by_name(case):
    call, *wanted = case
    refused(call, InputError, *wanted)


@pytest.mark.parametrize(
    "case",
    [
        (lambda: SIM.step(np.zeros(12), (fb.Push(UP, frame="bse"),)), "bse", "base"),
        (lambda: fb.rollout(SIM, limp, 1.0, [fb.Push(UP, frame="bse")]), "bse", "base"),
    ],
)  # fmt: skip
def test_an_unknown_name_is_refused_with_similar_names(case):
    call, *wanted = case
    refused(call, UnknownNameError, *wanted)


@pytest.mark.parametrize("name", ["timestep", "ground", "robot", "model", "data", "q", "time"])
def test_the_arguments_of_a_simulation_cannot_be_set(name):
    for sim in (SIM, copy.deepcopy(SIM), pickle.loads(pickle.dumps(SIM))):
        with raises(AttributeError, name):
            setattr(sim, name, getattr(sim, name))


@pytest.mark.parametrize("name", ["mu", "link_colisions"])
def test_a_simulation_takes_no_attribute_that_it_would_not_read(name):
    for sim in (SIM, copy.deepcopy(SIM)):
        with raises(AttributeError, name):
            setattr(sim, name, True)


def test_a_timestep_changed_in_mujocos_model_is_refused():
    sim = fb.Simulation(GO2)
    sim.model.opt.timestep = 0.002
    refused(lambda: fb.rollout(sim, limp, 0.01), InputError, "timestep", 0.002, 0.001)


@pytest.mark.parametrize(
    ("start", "numbers"), [(0.0, (0, 0.01, 0.02, 0.03)), (0.03, (0.01, 0.02, 0.03, 0.04))]
)
def test_a_push_that_does_not_act_in_a_rollout_causes_a_warning(start, numbers):
    sim = fb.Simulation(GO2)
    idle, near = (fb.Push(UP, start=start, duration=0.01), fb.Push(UP, start=0.02, duration=0.01))
    with warnings.catch_warnings(action="error"):
        fb.rollout(sim, limp, 0.02)
        # a copy, so that sim itself does not move
        fb.rollout(copy.copy(sim), limp, 0.01, [idle, near])
    with warns(SimulationWarning, *numbers):
        fb.rollout(sim, limp, 0.01, [idle])
