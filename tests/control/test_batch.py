"""A batch gives the commands of single calls to the bit, and threads may share a controller."""

import threading
from concurrent.futures import ThreadPoolExecutor

import judges
import numpy as np
import pytest
from messages import raises

import floatbase as fb
from floatbase.control import LinearInequality
from floatbase.errors import InputError

N = 80  # three chunks of states for three threads


class Height:
    """A user-defined task; its residual may do something else first."""

    block, name, weight = "qdd", "height", 10.0

    def __init__(self, first=lambda t: None):
        self.first = first

    def residual(self, eom, t=0.0):
        self.first(t)
        desired = 100.0 * (0.3 - eom.state.com[2:]) - 20.0 * eom.state.com_velocity[2:]
        return fb.Affine(eom.state.com_jacobian[2:], eom.state.com_drift[2:] - desired)


def drawn(name="go2", spread=0.1):
    """Return N states as two arrays."""
    found = judges.states(name, N, spread)
    return np.array([state.q for state in found]), np.array([state.v for state in found])


def made(terms="", name="go2", **options):
    """Return a controller of a robot on its feet, with a kind of tasks or bounds."""
    robot = judges.load(name)
    state, contacts = robot.standing(), judges.stance(robot)
    com, *others = tasks = fb.standing_tasks(state)
    if terms == "moving target":
        tasks = [fb.CoMTask(lambda t: state.com + [0.0, 0.0, 0.02 * np.sin(t)]), *others]
    elif terms == "user-defined task":
        tasks = [Height(), *others]
    elif terms == "rows of varying number":

        def limits(eom, t):
            return np.eye(12)[: int(t)], np.full(int(t), 2.0)

        options["inequalities"] = [LinearInequality("some torques", "tau", limits, weight=1.0)]
    elif terms == "moving bound":
        options["max_normal_force"] = {contacts.names[0]: lambda t: 20.0 + t}
    elif terms == "priorities":
        tasks = [[com], others]
    return fb.WholeBodyController(robot, contacts, tasks, **options)


def check(controller, Q, V, t=0.0, targets=None, threads=3):
    """Compare a batch with single calls, and return it."""
    batch = controller.batch(Q, V, t, targets, threads)
    times, targets = np.broadcast_to(t, len(Q)), [targets] * len(Q) if targets is None else targets
    for i in range(len(Q)):
        goal = targets if targets[i] is not None and np.ndim(targets) == 1 else targets[i]
        command = controller.attempt(Q[i], V[i], float(times[i]), goal)
        if command is None:
            assert batch.status[i] == "infeasible" and i in batch.unsolved
            assert np.isnan([*batch.tau[i], *batch.qdd[i], *batch.forces[i]]).all()
            continue
        for name in ("tau", "qdd", "forces"):
            assert getattr(batch, name)[i].tobytes() == getattr(command, name).tobytes()
        assert (batch.status[i], batch.softened[i]) == (command.backend, bool(command.softened))
    return batch


@pytest.mark.parametrize(
    "terms", ["", "moving target", "user-defined task", "rows of varying number", "moving bound"]
)
def test_rows_are_the_commands_of_single_calls_at_their_own_times(terms):
    controller, states = made(terms), drawn()
    for threads in (1, 3):
        batch = check(controller, *states, 1.0 + np.arange(N) % 7, threads=threads)
        assert set(batch.status) == {"compiled"}


def test_all_states_or_each_state_may_have_targets():
    controller = made("moving bound")
    for varies in (controller, made()):
        targets = np.tile(varies.targets_at(), (N, 1))
        targets[:, varies.targets["centre of mass"].start] += np.linspace(-0.02, 0.02, N)
        check(varies, *drawn(), 0.5, targets)
        check(varies, *drawn(), 0.5, targets[-1])


@pytest.mark.parametrize("options", [{}, {"on_infeasible": "soften"}])
def test_states_without_a_solution_are_named_or_softened_as_in_single_calls(options):
    limits = 0.1 * judges.load("go2").torque_limits
    controller = made(torque_limits=limits, min_normal_force=40.0, **options)
    batch = check(controller, *drawn(spread=0.3))
    found = batch.softened if options else batch.status == "infeasible"
    assert 0 < np.count_nonzero(found) < N


@pytest.mark.parametrize("options", [{"backend": "reference"}, {"terms": "priorities"}])
def test_problems_without_a_compiled_form_are_solved_too(options):
    Q, V = drawn()
    assert set(check(made(**options), Q[:6], V[:6]).status) == {"reference"}


def test_states_that_the_compiled_step_refuses_go_to_the_reference_backend():
    """A rotation that is not exact to 1e-9 is one reason."""
    controller, (Q, V) = made(), drawn()
    targets = np.tile(controller.targets_at(), (N, 1))
    targets[5, controller.targets["orientation of base"].start] += 1e-8
    batch = check(controller, Q, V, targets=targets)
    assert np.flatnonzero(batch.status == "reference").tolist() == [5]


def test_an_empty_batch_has_rows_of_the_right_length():
    batch = made().batch(np.empty((0, 19)), np.empty((0, 18)))
    assert batch.tau.shape == (0, 12) and batch.unsolved == ()


def changed(array, row, value):
    """Return a copy with another first entry in a row."""
    copy = array.copy()
    copy[row, 0] = value
    return copy


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        (lambda Q, V: {"Q": Q[0]}, "Q"),
        (lambda Q, V: {"V": V[:-1]}, "V"),
        (lambda Q, V: {"Q": changed(Q, 17, np.nan)}, "17"),
        (lambda Q, V: {"V": changed(V, 17, np.inf)}, "17"),
        (lambda Q, V: {"Q": np.delete(Q, 3, axis=1)}, "Q"),
        (lambda Q, V: {"Q": np.where(np.arange(N)[:, None] == 17, 2.0, 1.0) * Q}, "17"),
        (lambda Q, V: {"t": np.zeros(3)}, "t"),
        (lambda Q, V: {"t": [0.0, "now"]}, "t"),
        (lambda Q, V: {"targets": np.zeros(4)}, "targets"),
        (lambda Q, V: {"targets": np.zeros((N, 4))}, "targets"),
        (lambda Q, V: {"threads": 0}, "threads"),
        (lambda Q, V: {"threads": True}, "threads"),
    ],
)
def test_wrong_arguments_are_named_with_their_row(wrong, named):
    Q, V = drawn()
    with raises(InputError, named):
        made().batch(**{"Q": Q, "V": V} | wrong(Q, V))


def test_user_functions_run_in_the_calling_thread_and_their_errors_name_the_row():
    robot, seen = judges.load("go2"), []

    def first(t):
        seen.append(threading.get_ident())
        return t if t < 50.0 else 1.0 / 0.0

    tasks = [Height(first), *fb.standing_tasks(robot.standing())]
    controller = fb.WholeBodyController(robot, judges.stance(robot), tasks)
    with pytest.raises(ZeroDivisionError) as error:
        controller.batch(*drawn(), t=np.arange(N))
    assert "50" in error.value.__notes__[0] and set(seen) == {threading.get_ident()}


@pytest.mark.parametrize("shared", [True, False])
def test_two_threads_get_the_commands_of_one(backend, shared):
    Q, V = (rows[:40] if backend == "compiled" else rows[:8] for rows in drawn())
    first, other = made(backend=backend), made("moving target", backend=backend)
    controllers = [first, first if shared else other]

    def taus(controller):
        return np.array([controller(q, v).tau for q, v in zip(Q, V, strict=True)]).tobytes()

    expected = list(map(taus, controllers))
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(taus, 3 * controllers)) == 3 * expected
