"""The path without a compiler: when it runs, and its parts by themselves; what it answers is for `test_paths.py`."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from threading import Thread

import judges
import numpy as np
import pytest
from scipy.linalg import lapack

import floatbase as fb
from floatbase.control import compiled, programs, reduced
from floatbase.control.controller import MOTION_NOISE, Limits
from floatbase.control.programs import dynamics_of
from floatbase.control.reduced import Reduced
from floatbase.control.reduced_rows import Measured, Rows, Triple
from floatbase.control.reduced_space import Space
from floatbase.dynamics.contacts import PointContact
from floatbase.errors import InputError
from floatbase.robots.robot import Robot


def program(robot: Robot, contacts: fb.Contacts, tasks: list[object] | None = None, **options: object) -> Reduced:
    """The tables of a controller that stands."""
    tasks = list(fb.standing_tasks(robot.standing())) if tasks is None else tasks
    controller = fb.WholeBodyController(robot, contacts, tasks, path="reduced", **options)
    assert isinstance(controller._program, Reduced)
    return controller._program


# when it runs ----------------------------------------------------------------------------------------------------------------


def test_without_numba_auto_takes_it_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "find_spec", lambda name: None)
    robot = judges.load("go2")
    tasks = fb.standing_tasks(robot.standing())
    controller = fb.WholeBodyController(robot, judges.stance(robot), tasks)
    assert controller.path == controller(robot.posture, np.zeros(robot.nv)).path == "reduced"
    assert controller.path_reason.endswith("numba is not installed (pip install numba): numpy alone answers")
    with pytest.raises(InputError, match='path="compiled" is not possible: numba is not installed'):
        fb.WholeBodyController(robot, judges.stance(robot), tasks, path="compiled")
    asked = fb.WholeBodyController(robot, judges.stance(robot), tasks, path="reduced")
    assert asked.path_reason.endswith("it was asked for")


def test_a_numba_that_cannot_be_loaded_leaves_the_reduced_path_and_says_why(tmp_path: Path) -> None:
    """As when numba wants an older numpy than the one that is installed."""
    (tmp_path / "numba").mkdir()
    (tmp_path / "numba" / "__init__.py").write_text("raise ImportError('Numba needs NumPy 2.0 or less')")
    code = (
        "import floatbase as fb; robot = fb.load('go2'); "
        "made = fb.WholeBodyController(robot, fb.Contacts.points(robot), fb.standing_tasks(robot.standing())); "
        "print(made.path, made.path_reason)"
    )
    paths = os.pathsep.join([str(tmp_path), *sys.path])
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=os.environ | {"PYTHONPATH": paths})
    assert said.stdout.startswith("reduced the tasks and contacts are the package's own; numba is installed and"), said.stderr
    assert "Numba needs NumPy 2.0 or less" in said.stdout


def test_importing_floatbase_leaves_scipys_linear_algebra_alone() -> None:
    code = "import sys, floatbase; sys.exit('scipy.linalg' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_another_layout_of_pinocchios_results_leaves_the_readable_path(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = fb.load("go2")  # not the one that other tests share
    dynamics = dynamics_of(robot)
    monkeypatch.setattr(
        programs, "dynamics_of", lambda robot: programs.replace(dynamics, rates=(dynamics.rates[0], np.zeros(84)))
    )
    controller = fb.WholeBodyController(robot, judges.stance(robot), fb.standing_tasks(robot.standing()))
    assert (controller.path, controller.path_reason) == (
        "readable",
        "this Pinocchio lays its results out in another way in memory",
    )


# its parts -------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["go2", "talos", "ur5"])
def test_rows_are_jacobians_velocities_and_drifts_of_points_and_turnings(name: str) -> None:
    robot = judges.load(name)
    dynamics = dynamics_of(robot)
    frame = robot.feet[0].frame if robot.feet else "tool0"
    placed = robot.model.frames[robot.frame_id(frame)]
    joint, at, ball = placed.parentJoint, placed.placement.translation, 0.03 * judges.random_normals(1, 0)[0]
    triples = [Triple(joint, at), Triple(joint), Triple(-1), Triple(joint, at, ball, -1.0)]
    measured = Measured(places=26, moving=24, curved=12)
    rows = Rows(dynamics, triples, measured)
    for state in judges.states(name, 5):
        dynamics.update(state.q, state.v)
        dynamics.update_rates(state.q, state.v)
        rows.update(state.v)
        J, drift = state.frame_jacobian(frame), state.frame_drift(frame)
        found = measured["moving"][1::2] + measured["curved"]
        assert np.allclose(rows.jacobian[:6], J, rtol=0.0, atol=1e-12)
        assert np.allclose(measured["moving"][:12:2], J @ state.v, rtol=0.0, atol=1e-12)
        assert np.allclose(found[:6], drift, rtol=0.0, atol=1e-11)
        assert np.allclose(measured["places"][[0, 1, 2, 6, 7, 8]], [*state.point(frame), *state.com], rtol=0.0, atol=1e-12)
        assert np.allclose(rows.jacobian[6:9], dynamics.mass * state.com_jacobian, rtol=0.0, atol=1e-11)
        foot = PointContact(frame, ball, 0.7, 0.03)
        A, b = foot.constraint(state)
        assert np.allclose(rows.jacobian[9:], -A, rtol=0.0, atol=1e-12)
        assert np.allclose(found[9:], b, rtol=0.0, atol=1e-11)


def test_a_row_that_is_broken_and_does_not_push_is_dropped_again() -> None:
    """DAQP may find that nothing pushes where the first look saw a row broken: then the optimum is that without rows."""
    robot = judges.load("go2")
    tick = program(robot, judges.stance(robot))
    state = robot.standing()
    wanted = tick(np.array(state.q), np.array(state.v), 0.0)
    space = tick._full
    factor, _ = lapack.dpotrf(space.H)
    assert wanted is not None
    for active in ([], [3], [3, 21]):  # none of them pushes while standing
        rows = tick._limits.G[active].dot(space.limited)
        found = tick._settled(space, factor, np.array(active, dtype=np.intp), rows, np.zeros(len(active)))
        assert found is not None and found[1] == 0
        assert np.allclose(found[0][: tick.size], wanted[0][: tick.size], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(("m", "base", "nv", "k"), [(3, 6, 12, 9), (0, 6, 8, 0), (4, 0, 6, 4), (0, 0, 3, 0)])
def test_a_space_is_all_that_satisfies_its_equalities(m: int, base: int, nv: int, k: int) -> None:
    rng = np.random.default_rng(m)
    space = Space(m, base, nv, k, 0, np.zeros(nv + k + 1 - base))
    equalities = rng.standard_normal((m + base, nv + k + 1))
    assert space.solve(equalities, np.inf)
    assert space.nb == nv + k - m - base
    assert np.linalg.matrix_rank(space.V[:, :-1]) == space.nb
    assert np.allclose(equalities @ space.V1, 0.0, rtol=0.0, atol=1e-10)


def test_a_space_refuses_rows_that_depend_on_each_other() -> None:
    space = Space(3, 0, 6, 0, 0, np.zeros(7))
    rows = np.zeros((3, 7))
    rows[:2, :2], rows[2, :3] = np.eye(2), [1.0, 1.0, 1e-3]
    assert not space.solve(rows, 1e5)
    assert space.solve(rows, 1e7)
    rows[2, 2] = 0.0
    assert not space.solve(rows, np.inf)


@pytest.mark.parametrize("seed", [373, 856, 874, 1097, 1222, 1408, 1750])
def test_small_singular_values_that_hide_behind_fair_pivots_are_found(seed: int) -> None:
    """solo8 on three feet: no pivot is below 0.02, and the least singular value is 1e-4 of the largest or less."""
    robot = judges.load("solo8")
    contacts = fb.Contacts.points(robot).without(robot.feet[3].frame)
    tick = program(robot, contacts)
    state = robot.random_state(seed, (0.02, 0.1, 0.3)[seed % 3])
    answer = tick(np.array(state.q), np.array(state.v), 0.0)
    readable = fb.WholeBodyController(robot, contacts, fb.standing_tasks(robot.standing()), path="readable")
    assert 8 in tick._spaces and answer is not None
    assert np.allclose(answer[0][14:22], readable(state.q, state.v).tau, rtol=0.0, atol=1e-6)


def test_a_state_too_wild_for_numbers_is_left_to_the_readable_path() -> None:
    robot = judges.load("go2")
    tick = program(robot, judges.stance(robot))
    for speed in (1e5, 1e100, 1e200):
        assert tick(np.array(robot.posture), np.full(18, speed), 0.0) is None


def test_forces_that_nothing_chooses_and_that_run_away_are_left_to_the_readable_path() -> None:
    """A contact beside the arm's base carries forces that move nothing; with weight 0 they may be anything."""
    robot = judges.load("ur5")
    at = robot.standing()
    tasks = [fb.CoMTask(at.com), fb.FrameTask("shoulder_link", at.point("shoulder_link")), fb.ForceTask(weight=0.0)]
    tick = program(robot, fb.Contacts([PointContact("upper_arm_link")]), tasks, torque_limits=np.inf)
    for state in judges.states("ur5", 40):
        answer = tick(np.array(state.q), np.array(state.v), 0.0)
        assert answer is None or np.max(np.abs(answer[0][: tick.size])) < 1e8


def test_an_arm_that_touches() -> None:
    """Contacts and a base that is bolted down: motion rows, and none of a base."""
    robot = judges.load("ur5")
    contacts = fb.Contacts([PointContact("tool0", normal=[0.3, 0.0, 1.0])])
    tasks = [fb.PostureTask(robot.posture), fb.ForceTask([0.0, 0.0, 20.0], weight=1e-2)]
    both = [fb.WholeBodyController(robot, contacts, tasks, path=path) for path in ("reduced", "readable")]
    for state in judges.states("ur5", 10):
        found, wanted = (controller(state.q, state.v) for controller in both)
        assert found.path == "reduced"
        assert np.allclose(found.tau, wanted.tau, rtol=0.0, atol=1e-8)


def test_it_keeps_the_tolerances_of_the_readable_path() -> None:
    assert reduced.MOTION_NOISE == MOTION_NOISE


def test_dependent_contact_rows_are_resolved_and_not_left_to_the_readable_path() -> None:
    robot = judges.load("solo8")
    tick = program(robot, judges.stance(robot))
    state = robot.standing()
    assert tick(np.array(state.q), np.array(state.v), 0.0) is not None
    assert sorted(tick._spaces) == [10, 12]


def test_contradicting_contact_rows_are_left_to_the_readable_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """At rest contacts of one body never do: here a drift is made up."""
    robot = judges.load("solo8")
    tick = program(robot, judges.stance(robot))
    state, update = robot.standing(), Rows.update

    def drifting(self: Rows, v: np.ndarray) -> None:
        update(self, v)
        tick._measured["curved"][:12] += drift

    monkeypatch.setattr(Rows, "update", drifting)
    q, v = np.array(state.q), np.array(state.v)
    drift = np.zeros(12)
    assert tick(q, v, 0.0) is not None
    drift = np.random.default_rng(0).standard_normal(12)
    assert tick(q, v, 0.0) is None


def test_weights_count_in_parts_of_the_largest() -> None:
    robot = judges.load("go2")
    at = robot.random_state(2, 0.3)
    commands = []
    for scale in (1e-9, 1.0, 1e6):
        tasks = [fb.CoMTask(at.com, weight=10.0 * scale), fb.PostureTask(at.q, weight=0.1 * scale)]
        tasks += [fb.ForceTask(weight=1e-5 * scale), fb.TorqueTask(weight=1e-5 * scale)]
        controller = fb.WholeBodyController(robot, judges.stance(robot), tasks, path="reduced")
        commands.append(controller(at.q, at.v))
        assert commands[-1].path == "reduced"
        assert np.allclose(commands[-1].tau, commands[0].tau, rtol=0.0, atol=1e-8)
    small, one, large = (np.array(list(command.multipliers.values())) for command in commands)
    assert one.size and np.allclose(1e9 * small, one, rtol=1e-6) and np.allclose(1e-6 * large, one, rtol=1e-6)


def test_rows_that_daqp_did_not_find_are_added_and_those_that_pull_are_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = judges.load("go2")
    tick = program(robot, judges.stance(robot))
    readable = fb.WholeBodyController(robot, judges.stance(robot), fb.standing_tasks(robot.standing()), path="readable")
    settled, changed = Reduced._settled, 0

    def spoiled(self: Reduced, space: Space, factor: object, active: np.ndarray, rows: object, mu: np.ndarray) -> object:
        active, mu = np.append(active[1:], 7), np.append(mu[1:], 0.0)  # one too few, and one that should not push
        return settled(self, space, factor, active, self._limits.G.take(active, 0).dot(space.limited), mu)

    monkeypatch.setattr(Reduced, "_settled", spoiled)
    for state in judges.states("go2", 12, 0.1):
        answer = tick(np.array(state.q), np.array(state.v), 0.0)
        if answer is not None and answer[1]:
            changed += 1
            assert np.allclose(answer[0][18:30], readable(state.q, state.v).tau, rtol=0.0, atol=1e-8)
    assert changed > 3


def test_an_answer_does_not_depend_on_the_one_before() -> None:
    """Though the search comes first where rows held the last answer."""
    robot = judges.load("go2")
    tick = program(robot, judges.stance(robot))
    held = []
    for state in judges.states("go2", 12, 0.05):
        answers = []
        for before in (False, True):
            tick._held_before = before
            answers.append(tick(np.array(state.q), np.array(state.v), 0.0))
        assert answers[0] is not None and answers[1] is not None
        held.append(answers[0][1])
        assert np.array_equal(answers[0][0][: tick.size], answers[1][0][: tick.size])
    assert 0 < np.count_nonzero(held) < len(held), "these states do not try both"


def test_threads_may_share_a_controller() -> None:
    robot = judges.load("go2")
    controller = fb.WholeBodyController(robot, judges.stance(robot), fb.standing_tasks(robot.standing()), path="reduced")
    states = judges.states("go2", 40, 0.3)
    wanted = [controller(state.q, state.v).tau for state in states]
    wrong: list[int] = []

    def run(shift: int) -> None:
        for i in (np.arange(400) + shift) % len(states):
            if not np.array_equal(controller(states[i].q, states[i].v).tau, wanted[i]):
                wrong.append(i)

    threads = [Thread(target=run, args=(shift,)) for shift in (0, 13, 27)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_kinds_are_numbered_as_in_the_kernel() -> None:
    pytest.importorskip("numba")
    from floatbase.control import kernel

    for name in ("COM", "ORIENTATION", "FRAME", "POSTURE", "FORCE", "TORQUE", "POINT", "FLAT"):
        assert getattr(kernel, name) == getattr(programs, name)


def test_limits_are_rows_of_unit_length() -> None:
    robot = judges.load("go2")
    tick = program(robot, judges.stance(robot), min_normal_force=3.0, torque_limits=np.where(np.arange(12) == 2, np.inf, 20.0))
    limits = tick._limits
    assert np.allclose(np.linalg.norm(np.delete(limits.G, 12, axis=1), axis=1), 1.0)
    qp = fb.WholeBodyController(
        robot, judges.stance(robot), fb.standing_tasks(robot.standing()), path="readable", min_normal_force=3.0,
        torque_limits=np.where(np.arange(12) == 2, np.inf, 20.0),
    ).qp(robot.standing())  # fmt: skip
    x = np.random.default_rng(0).standard_normal(42) * 20.0
    slack = (qp.G @ x - qp.h) / qp.row_sizes
    found = limits.G @ np.concatenate([x[30:], [1.0], x[18:30]])
    finite = np.delete(np.arange(len(found)), [20 + 2, 32 + 2])
    assert np.allclose(found[finite], slack)
    assert Limits(np.full(12, 20.0)).facets == 4
