"""What the physics and the loop answer to what they cannot use."""

from __future__ import annotations

import copy
import pickle
import warnings
from collections.abc import Callable

import judges
import numpy as np
import pytest
from judges import limp

import floatbase as fb
from floatbase.errors import FloatbaseError, InputError, SimulationError, SimulationWarning, UnknownNameError
from floatbase.simulation import Ground

GO2 = judges.load("go2")
SIM = fb.Simulation(GO2)
UP = [0.0, 0.0, 1.0]


@pytest.mark.parametrize(
    ("make", "kind", "text"),
    [
        (
            lambda: fb.Simulation(fb.load("go2", feet=["FL_foot_joint"])),
            SimulationError,
            "the foot FL_foot_joint is no link of the URDF; give feet by the names of their links",
        ),
        (lambda: fb.Simulation(GO2, ground=0.0), InputError, "friction coefficient mu of the ground is 0; it must be > 0"),
        (lambda: fb.Simulation(GO2, ground="ice"), InputError, "mu of the ground must be a number, not 'ice'"),
        (lambda: fb.Simulation(GO2, timestep=0.0), InputError, "timestep is 0; it must be > 0 s"),
        (lambda: Ground(normal=[0.0, 0.0, 0.0]), InputError, "normal of the ground is the zero vector"),
        (lambda: Ground(normal=[UP, [0.0, 0.0, 0.0]]), InputError, "normal 1 of the ground is the zero vector"),
        (lambda: Ground(normal=[UP, UP], offset=[0.1]), InputError, r"offset of the ground has shape \(1,\); .*\(2,\) \(m\)"),
        (lambda: Ground(offset="deep"), InputError, "offset of the ground must be a number"),
        (lambda: SIM.reset(judges.load("solo12").standing()), InputError, "holds go2; the state belongs to another robot"),
        (lambda: SIM.step(np.zeros(3)), InputError, r"torques has shape \(3,\); it must have shape \(12,\) \(N·m\)"),
        (lambda: SIM.step(np.full(12, np.nan)), InputError, r"torques holds nan at index \[0\]"),
        (lambda: SIM.step(np.zeros(12), (fb.Push(UP, frame="bse"),)), UnknownNameError, "'bse'; near names: base"),
        (lambda: fb.Push([1.0, 0.0]), InputError, r"force of the push has shape \(2,\); .*\(3,\) \(N\)"),
        (lambda: fb.Push(UP, start=-1.0), InputError, "start of the push is -1; it must be ≥ 0 s"),
        (lambda: fb.Push(UP, duration=0.0), InputError, "duration of the push is 0; it must be > 0 s"),
        (lambda: fb.rollout(SIM, limp, -1.0), InputError, "duration is -1; it must be > 0 s"),
        (
            lambda: fb.rollout(SIM, limp, 1.0, control_period=0.0015),
            InputError,
            r"control_period 0.0015 s is not a whole multiple of the simulation's timestep 0.001 s",
        ),
        (lambda: fb.rollout(SIM, limp, 1.0, control_period=0.0001), InputError, "is not a whole multiple"),
        (
            lambda: fb.rollout(SIM, limp, 0.0105),
            InputError,
            r"duration 0.0105 s is not a whole multiple of the control period 0.001 s; 0.01 s would be",
        ),
        (
            lambda: fb.rollout(SIM, limp, 0.001, control_period=0.002),
            InputError,
            r"duration 0.001 s is not a whole multiple of the control period 0.002 s; 0.002 s would be",
        ),
        (
            lambda: fb.rollout(fb.Simulation(judges.load("ur5")), limp, 1.0, [fb.Push(UP, start=0.9)]),
            InputError,
            "a push at 'base' moves nothing: ur5 is bolted to the ground there. Push a link that moves: shoulder_link, ",
        ),
        (lambda: fb.rollout(SIM, limp, 1.0, [3]), InputError, r"each of the pushes must be a Push, as fb\.Push.*, not 3"),
        (
            lambda: fb.rollout(SIM, lambda q, v, t: None, 1.0),
            InputError,
            r"must answer with \.tau, shape \(12,\), N·m, .* got None\. .* will do: types\.SimpleNamespace\(tau=…\)",
        ),
        (
            lambda: fb.rollout(SIM, lambda q, v: None, 1.0),
            InputError,
            r"called as controller\(q, v, t\); <lambda> takes \(q, v\): too many positional arguments",
        ),
        (lambda: fb.rollout(SIM, lambda q, v, t, gain: None, 1.0), InputError, "missing a required argument: 'gain'"),
        (lambda: fb.rollout(SIM, limp, 1.0, [fb.Push(UP, frame="bse")]), UnknownNameError, "'bse'; near names: base"),
    ],
)
def test_bad_input_is_told_what_would_be_right(make: Callable[[], object], kind: type[FloatbaseError], text: str) -> None:
    with pytest.raises(kind, match=text):
        make()


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: fb.Simulation("go2"), "Robot"),
        (lambda: SIM.reset(3), "State"),
        (lambda: SIM.step("full"), "torques"),
        (lambda: fb.rollout(3, limp, 1.0), "Simulation"),
        (lambda: fb.rollout(SIM, limp, 1.0, fb.Push(UP)), "pushes"),
        (lambda: fb.rollout(SIM, 3, 1.0), "controller"),
    ],
)
def test_values_of_another_kind_are_refused_by_an_error_of_the_package(make: Callable[[], object], text: str) -> None:
    with pytest.raises(InputError, match=text):
        make()


def test_a_controller_of_one_robot_is_not_run_on_another() -> None:
    """go2 and solo12 have equally many joints: nothing but the robot itself tells them apart."""
    controller = fb.WholeBodyController(GO2, fb.Contacts.points(GO2), fb.standing_tasks(GO2.standing()))
    with pytest.raises(InputError, match="solo12"):
        fb.rollout(fb.Simulation(judges.load("solo12")), controller, 0.01)


@pytest.mark.parametrize(
    ("name", "value", "advice"),
    [
        ("timestep", 0.002, "make another, fb.Simulation"),
        ("ground", 0.5, "make another, fb.Simulation"),
        ("q", GO2.standing().q, "sim.reset"),
        ("timestap", 0.002, "no 'timestap' to set; timestep"),
        ("anything", 1, "no 'anything' to set"),
    ],
)
def test_what_a_simulation_was_made_with_is_not_set_afterwards(name: str, value: object, advice: str) -> None:
    for sim in (SIM, copy.deepcopy(SIM), pickle.loads(pickle.dumps(SIM))):
        with pytest.raises(InputError, match=advice):
            setattr(sim, name, value)


def test_a_timestep_changed_in_mujocos_model_is_refused() -> None:
    sim = fb.Simulation(GO2)
    sim.model.opt.timestep = 0.002
    with pytest.raises(InputError, match=r"fb\.Simulation\(robot, timestep=0.002\)"):
        fb.rollout(sim, limp, 0.01)


@pytest.mark.parametrize(
    ("start", "says"),
    [
        (0.0, r"it goes from 0 to 0.01 s, this rollout from 0.02 to 0.03 s; .* start=sim.time \+ 0\."),
        (0.03, "a duration of more than 0.01 s reaches it"),
    ],
)
def test_a_push_that_does_not_act_in_a_rollout_is_said(start: float, says: str) -> None:
    sim = fb.Simulation(GO2)
    idle, near = (fb.Push(UP, start=start, duration=0.01), fb.Push(UP, start=0.02, duration=0.01))
    with warnings.catch_warnings(action="error"):
        fb.rollout(sim, limp, 0.02)
        fb.rollout(copy.copy(sim), limp, 0.01, [idle, near])  # of a copy: sim itself stays where it is
    with pytest.warns(SimulationWarning, match=says):
        fb.rollout(sim, limp, 0.01, [idle])
