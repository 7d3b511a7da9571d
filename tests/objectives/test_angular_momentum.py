"""The angular momentum task, against finite differences of Pinocchio's centroidal momentum."""

from __future__ import annotations

import judges
import numpy as np
import pinocchio as pin
from messages import refused

import floatbase as fb
from floatbase.errors import InputError
from floatbase.objectives import AngularMomentumTask

STEP = 1e-5  # s
name = judges.every_robot


def angular_momentum(state: fb.State) -> np.ndarray:
    model = state.robot.model
    momentum = pin.computeCentroidalMomentum(model, model.createData(), state.q, state.v)
    return np.array(momentum.angular)


def test_the_residual_is_the_rate_of_the_angular_momentum_less_the_desired_one(name: str) -> None:
    for seed, state in enumerate(judges.states(name, 3)):
        rng = np.random.default_rng(seed)
        eom = fb.equations_of_motion(state, judges.stance(state.robot))
        qdd, (target, rate) = rng.normal(size=eom.nv), rng.normal(size=(2, 3))
        after, before = (
            angular_momentum(judges.moved(state, qdd, t).replace(v=state.v + t * qdd))
            for t in (STEP, -STEP)
        )
        actual = (after - before) / (2.0 * STEP)
        desired = rate - 3.0 * (angular_momentum(state) - target)
        expected = actual - desired
        for task in (
            AngularMomentumTask(target, rate, kd=3.0),
            AngularMomentumTask(lambda t, both=(target, rate): both, kd=3.0),
        ):
            found = task.residual(eom)(qdd)
            assert np.max(np.abs(found - expected)) < 1e-5 * (1.0 + np.max(np.abs(expected)))


def test_both_backends_agree_on_it() -> None:
    robot = judges.load("go2")
    tasks = [*fb.standing_tasks(robot.standing()), AngularMomentumTask(weight=1.0)]
    compiled, reference = judges.pair(robot, judges.stance(robot), tasks)
    for state in judges.states("go2", 3, 0.1):
        assert judges.difference(compiled, reference, state) < 1e-8 * robot.torque_limits.max()


def test_in_the_air_no_torque_changes_the_angular_momentum() -> None:
    state = judges.load("go2").random_state(0)
    eom = fb.equations_of_motion(state, fb.Contacts.none())
    residual = AngularMomentumTask(kd=2.0).residual(eom)
    qdd = eom.acceleration(np.ones(eom.d), np.zeros(0))
    assert np.allclose(residual(qdd), 2.0 * angular_momentum(state), atol=1e-9)


def test_bad_targets_are_refused_by_name() -> None:
    refused(lambda: AngularMomentumTask(np.zeros(2)), InputError, "momentum", 2, 3)
    refused(lambda: AngularMomentumTask(kd=-1.0), InputError, "kd", -1)
    both = {"momentum": lambda t: np.zeros(3), "rate": np.ones(3)}
    refused(lambda: AngularMomentumTask(**both), InputError, "momentum", "rate")
