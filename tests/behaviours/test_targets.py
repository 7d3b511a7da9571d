"""The compiled targets of a walk against the functions that define them, at random states.

A walk on the reference backend evaluates the functions. Both walks see the same states and times,
with pushes, turns, changes of stance, known slopes, and a body that is lowered and pitched.
"""

from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from typing import Any

import judges
import numpy as np
import pinocchio as pin
import pytest

import floatbase as fb
from floatbase.behaviours import Gait, Walk
from floatbase.control import Command

ROBOTS = {"go2": Gait.trot, "hyq": Gait.crawl, "talos": Gait.walk}


def walks(name: str, backends: tuple[str, ...], **options: Any) -> list[Walk]:
    robot = judges.load(name)
    gait, contacts = ROBOTS[name](robot, start=0.05), fb.Contacts.feet(robot, mu=0.6)
    make = partial(Walk, robot, contacts, gait, (0.2, 0.05), 0.3, **options)
    return [make(backend=backend) for backend in backends]


def random_steps(
    name: str, n: int, rng: np.random.Generator
) -> Iterator[tuple[np.ndarray, np.ndarray, float]]:
    """Yield states near standing, with random velocities, at times that differ by up to 60 ms."""
    t = 0.0
    for state in judges.states(name, n, 0.02):
        yield state.q, rng.normal(0.0, 0.2, state.robot.nv), t
        t += float(rng.uniform(0.001, 0.06))


# a crawl of hyq is slower than asked
@pytest.mark.filterwarnings("ignore::floatbase.errors.SimulationWarning")
@pytest.mark.parametrize("known_ground", [False, True])
@pytest.mark.parametrize("name", ROBOTS)
def test_one_compiled_function_writes_what_the_definitions_say(name, known_ground):
    rng = np.random.default_rng(2)
    gradient = rng.normal(0.0, 0.15, 2)
    ground = fb.Ground(normal=[*-gradient, 1.0], offset=0.01) if known_ground else None
    fast, slow = walks(name, ("compiled", "reference"), ground=ground, pitch=0.05)
    swinging = 0
    for i, (q, v, t) in enumerate(random_steps(name, 40, rng)):
        if i == 20:
            for walk in (fast, slow):
                walk.velocity, walk.yaw_rate, walk.height = (-0.1, 0.1), -0.2, -0.02
        commands = [walk(q, v, t) for walk in (fast, slow)]
        assert [command.backend for command in commands] == ["compiled", "reference"]
        targets = [command.targets for command in commands]
        assert targets[0].keys() == targets[1].keys() and fast.stance == slow.stance
        for task, values in targets[1].items():
            assert np.allclose(targets[0][task], values, rtol=0.0, atol=1e-9), task
        assert np.allclose(fast.path.position, slow.path.position, rtol=0.0, atol=1e-9)
        for foot, swing in slow.swings.items():
            assert np.allclose(fast.swings[foot].end, swing.end, rtol=0.0, atol=1e-9)
            swinging += 1
    assert swinging > 10


def angular_velocity(before: np.ndarray, R: np.ndarray, after: np.ndarray, dt: float) -> np.ndarray:
    spin = (after - before).reshape(3, 3) / dt @ R.reshape(3, 3).T
    return np.array([spin[2, 1], spin[0, 2], spin[1, 0]])


@pytest.mark.parametrize("name", ["go2", "talos"])
def test_velocities_and_accelerations_are_the_derivatives_of_the_targets(name):
    """By central differences, on a slope, while the robot turns."""
    (walk,) = walks(name, ("compiled",), ground=fb.Ground(normal=[-0.1, 0.05, 1.0]))
    state, step, t = judges.load(name).standing(), 1e-5, 0.0
    while t < 0.15:
        walk(state.q, state.v, t)
        t += 0.01
    before, now, after = (
        walk(state.q, state.v, time).targets for time in (t, t + step, t + 2.0 * step)
    )
    for task, values in now.items():
        if task == "centre of mass":
            rates = (after[task] - before[task]) / (2.0 * step)
            assert np.allclose(rates[:3], values[3:6], atol=1e-5)
            assert np.allclose(rates[3:6], values[6:9], atol=1e-4)
        elif task.startswith("orientation"):
            parts = [each[task][:9] for each in (before, now, after)]
            omega = angular_velocity(*parts, 2.0 * step)
            assert np.allclose(omega, values[9:12], atol=1e-3)


def test_the_base_leans_and_turns_without_jumps_on_ground_that_a_walk_knows(backend, go2):
    """The derivatives of the target add up to its changes, also across changes of stance."""
    contacts, gait = fb.Contacts.feet(go2, mu=0.6), Gait.trot(go2, start=0.05)
    walk = Walk(go2, contacts, gait, (0.2, 0.0), 0.4, ground=fb.Ground(), backend=backend)
    step, rows, stances = 2e-3, [], set()
    for t in step * np.arange(500):  # the feet are on a plane that tilts, as on stairs
        q = go2.standing().q.copy()
        q[4], q[6] = np.sin(0.1 * np.sin(3.0 * t)), np.cos(0.1 * np.sin(3.0 * t))
        rows.append(walk(q, np.zeros(go2.nv), t).targets["orientation of base"])
        stances.add(walk.stance)
    R, omega, alpha = np.split(np.array(rows), [9, 12], axis=1)
    assert np.abs(R[:, 6]).max() > 0.05 and len(stances) > 1
    turns = [pin.log3(b.reshape(3, 3) @ a.reshape(3, 3).T) for a, b in pairwise(R)]
    assert np.allclose(turns, step * (omega[1:] + omega[:-1]) / 2.0, rtol=0.0, atol=2e-6)
    level = step * (alpha[1:] + alpha[:-1])[:, :2] / 2.0  # the path's acceleration is no target
    assert np.allclose(np.diff(omega, axis=0)[:, :2], level, rtol=0.0, atol=2e-4)


def test_a_rollout_records_the_targets_of_each_step():
    (walk,) = walks("go2", ("compiled",))
    robot, commands = judges.load("go2"), []

    class Kept:
        contacts = property(lambda self: walk.contacts)

        def __call__(self, q: np.ndarray, v: np.ndarray, t: float) -> Command:
            commands.append(walk(q, v, t))
            return commands[-1]

    run = fb.rollout(fb.Simulation(robot), Kept(), 0.5, control_period=2e-3)
    assert np.abs(run.targets["centre of mass"][:, :3] - run.com).max() < 0.02
    for i in (0, 40, 249):
        targets = commands[i].targets
        for task, rows in run.targets.items():
            if task in targets:
                assert np.array_equal(rows[i][: targets[task].size], targets[task])
            else:
                assert np.isnan(rows[i]).all()
    assert {"position of FL_foot", "posture"} <= set(run.targets)


def test_a_sole_turns_the_short_way_where_yaw_angles_jump_by_a_whole_turn(talos):
    """The measured yaw jumps from π to -π, and the yaw of the path does not."""
    gait = Gait.walk(talos, start=0.0)
    walk = Walk(talos, fb.Contacts.feet(talos, mu=0.6), gait, yaw_rate=0.3)
    state, turns = talos.standing(), []
    for t in np.arange(0.0, 3.0, 0.05):
        yaw = np.pi - 0.01 if t < 1.5 else -np.pi + 0.01
        q = state.q.copy()
        c, s = np.cos(yaw), np.sin(yaw)
        q[:2] = [c * q[0] - s * q[1], s * q[0] + c * q[1]]
        q[3:7] = [0.0, 0.0, np.sin(yaw / 2.0), np.cos(yaw / 2.0)]
        walk(q, state.v, float(t))
    for plan in walk.history:
        turns += [last - first for first, last in (s.yaws for s in plan.planned_swings.values())]
    assert len(turns) > 3 and max(np.abs(turns)) < 2.0  # 0.3 rad/s in 3 s
