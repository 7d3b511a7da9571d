"""Targets as an array, and attempts that say no without reasons."""

import time
from contextlib import suppress

import judges
import numpy as np
import pytest
from messages import refused

import floatbase as fb
from floatbase.errors import InfeasibleError, InputError

GO2, TALOS = (judges.load(name) for name in ("go2", "talos"))


def moving_controller(backend: str, **options: object) -> fb.WholeBodyController:
    state = GO2.standing()
    foot = state.point("FL_foot")
    tasks = [
        fb.CoMTask(lambda t: (state.com + [t, 0.0, 0.0], [1.0, 0.0, 0.0], np.zeros(3))),
        fb.OrientationTask("base", state.frame_pose("base").rotation),
        fb.FrameTask("FL_foot", lambda t: foot + [0.0, 0.0, t]),
        fb.PostureTask(state.q),
    ]
    contacts = judges.stance(GO2).without("FL_foot")
    return fb.WholeBodyController(GO2, contacts, tasks, backend=backend, **options)


def test_an_array_of_targets_replaces_the_targets_of_the_tasks(backend):
    controller, rng = moving_controller(backend), np.random.default_rng(0)
    for state in judges.states("go2", 5, 0.05):
        t = float(rng.uniform(0.0, 0.1))
        unchanged = controller(state.q, state.v, t)
        command = controller(state.q, state.v, 7.0, controller.targets_at(t))
        assert command.backend == backend and np.array_equal(command.tau, unchanged.tau)
        targets = controller.targets_at(0.0)
        com = targets[controller.targets["centre of mass"]]
        com[:3] += rng.normal(0.0, 0.02, 3)
        com[3:] = rng.normal(0.0, 0.1, 6)
        goal = fb.CoMTask(*com.reshape(3, 3))
        fixed = controller.replace(tasks=[goal, *controller.tasks[1:]])
        command, expected = controller(state.q, state.v, 0.0, targets), fixed(state.q, state.v)
        assert np.allclose(command.tau, expected.tau, rtol=0.0, atol=1e-9)
        assert np.allclose(command.solution.x, expected.solution.x, rtol=0.0, atol=1e-9)
        assert max(vars(command.solution.residuals).values()) < 1e-6
        assert np.array_equal(controller(state.q, state.v, t).tau, unchanged.tau)


def test_targets_are_checked(backend):
    controller, state = moving_controller(backend), GO2.standing()
    good = controller.targets_at(0.0)
    refused(lambda: controller(state.q, state.v, 0.0, good[1:]), InputError, good.size)
    refused(lambda: controller(state.q, state.v, 0.0, "none"), InputError, "targets")
    for entry, value in (("centre of mass", np.nan), ("orientation of base", 2.0)):
        bad = good.copy()
        bad[controller.targets[entry]] = value
        refused(lambda bad=bad: controller(state.q, state.v, 0.0, bad), InputError)


def infeasible(**options: object) -> tuple[fb.WholeBodyController, fb.State]:
    """Return talos with weak motors, and a state in which no forces hold its feet."""
    state = TALOS.standing()
    weak = {"torque_limits": 0.2 * TALOS.torque_limits, "min_normal_force": 200.0}
    controller = judges.controller_of("talos", **weak, **options)
    v = np.r_[0.0, 3.0, 0.0, 3.0, np.zeros(TALOS.nv - 4)]
    return controller, state.replace(v=v)


def test_an_attempt_returns_none_where_a_call_raises_an_error(backend):
    controller, state = infeasible(backend=backend)
    rest = TALOS.standing()
    assert controller.attempt(state.q, state.v) is None
    with pytest.raises(InfeasibleError) as error:
        controller(state.q, state.v)
    assert len(error.value.constraints) > 1
    strong = judges.controller_of("talos")
    assert np.array_equal(strong.attempt(rest.q, rest.v).tau, strong(rest.q, rest.v).tau)
    for bad in (None, np.full(TALOS.nv, np.nan), np.zeros(3)):
        refused(lambda bad=bad: controller.attempt(rest.q, bad), InputError)


@pytest.mark.parametrize(("offset", "weight"), [(1.0, 1e7), (100.0, 2e6), (100.0, 1e8)])
def test_with_weights_far_apart_an_attempt_denies_nothing_that_a_call_finds(offset, weight):
    """Rounding can make an independent row look like a contradiction of the active ones."""
    state = GO2.standing()
    far = fb.FrameTask("FL_foot", state.point("FL_foot") + offset, weight=weight)
    tasks = [*fb.standing_tasks(state), far]
    controller = fb.WholeBodyController(GO2, fb.Contacts.feet(GO2, mu=0.6), tasks)
    found = []
    for v in np.random.default_rng(0).normal(0.0, 5.0, (10, GO2.nv)):
        with suppress(InfeasibleError):
            controller(state.q, v)
            found.append(controller.attempt(state.q, v))
    assert found
    assert None not in found


def test_an_attempt_softens_as_a_call_does():
    controller, state = infeasible(on_infeasible="soften")
    attempt, command = controller.attempt(state.q, state.v), controller(state.q, state.v)
    assert attempt.softened and attempt.backend == "compiled"
    assert np.array_equal(attempt.tau, command.tau)


def test_a_no_takes_no_longer_than_a_few_answers():
    controller, state = infeasible()
    rest, times = TALOS.standing(), {}
    for name, each in (("yes", rest), ("no", state)):
        taken = []
        for _ in range(20):
            begin = time.thread_time()
            controller.attempt(each.q, each.v)
            taken.append(time.thread_time() - begin)
        times[name] = np.median(taken)
    assert times["no"] < 20.0 * times["yes"]  # the search for reasons takes 50 times as long
