"""The compiled path: when it runs, what it compiles, what it does with memory; what it answers is for `test_paths.py`."""

from __future__ import annotations

import subprocess
import sys
import time

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.__main__ import main
from floatbase.control.tick import compiled
from floatbase.dynamics import MOTION_NOISE, MOTION_TOLERANCE
from floatbase.qp import FEASIBILITY_TOLERANCE
from floatbase.robots import Robot

pytest.importorskip("numba")


def compiled_one(robot: Robot, **options: object) -> fb.WholeBodyController:
    """A controller that stands, by the kernel."""
    tasks = fb.standing_tasks(robot.standing())
    return fb.WholeBodyController(robot, judges.stance(robot), tasks, path="compiled", **options)


def test_a_replaced_controller_compiles_nothing() -> None:
    from floatbase.control.tick import kernel

    robot = judges.load("go2")
    controller = compiled_one(robot, facets=6)
    before = len(kernel.tick.signatures)  # one: no array of any kind makes it compile again
    for frames in (["FL_foot"], ["FR_foot", "RL_foot"], ["FL_foot", "FR_foot", "RR_foot"]):
        controller.replace(contacts=fb.Contacts.points(robot, frames=frames))(robot.posture, np.zeros(robot.nv))
    assert len(kernel.tick.signatures) == before == 1


@pytest.mark.parametrize("name", ["go2", "talos", "ur5"])
def test_a_tick_reads_nothing_of_its_room_that_it_did_not_write(name: str) -> None:
    robot = judges.load(name)
    fast = compiled_one(robot)
    room, whole = fast.compiled.arrays[-2:]  # type: ignore[union-attr]
    for seed in range(20):
        state = robot.random_state(seed, 0.3)
        answers = []
        for rest in (0.0, np.nan, 1e300):
            room[:], whole[:] = rest, 10**15
            answers.append(fast(state.q, state.v))
        assert all(np.array_equal(answer.tau, answers[0].tau) for answer in answers)


def test_a_tick_makes_no_array_and_says_when_its_room_is_too_small() -> None:
    """Real-time code must not ask for memory; only near-singular contacts do, for an SVD."""
    from numba.core.runtime import _nrt_python as counts
    from numba.core.runtime import rtsys

    robot = judges.load("go2")
    program = compiled_one(robot).compiled
    assert program is not None
    state = robot.random_state(5, 0.3)
    q, v = np.array(state.q), np.array(state.v)
    program.dynamics.update(q, v)
    *arrays, room, whole = program.arrays
    answer = np.empty(program.size + 2 * program.entries)
    counts.memsys_enable_stats()
    before = rtsys.get_allocation_stats()
    assert program.kernel(q, v, program.targets, *arrays, room, whole, answer, program.parts) > 0
    assert rtsys.get_allocation_stats() == before
    counts.memsys_disable_stats()
    with pytest.raises(MemoryError, match="room of the controller"):
        program.kernel(q, v, program.targets, *arrays, room[:2000], whole, answer, program.parts)


def test_all_paths_keep_the_same_tolerances() -> None:
    from floatbase.control.tick import kernel

    assert MOTION_TOLERANCE == kernel._MOTION
    assert MOTION_NOISE == kernel._NOISE
    assert FEASIBILITY_TOLERANCE == kernel._VIOLATED


def test_importing_floatbase_leaves_numba_alone() -> None:
    code = "import sys, floatbase; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_kernel_compiles_where_no_cache_can_be_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    import numba

    from floatbase.control.tick import kernel

    def njit(*, cache: bool = False, **options: object) -> object:
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return lambda function: ("compiled without a cache", options["error_model"])

    monkeypatch.setattr(numba, "njit", njit)
    monkeypatch.setattr(kernel, "kept", True)
    assert kernel._compiled(lambda: None) == ("compiled without a cache", "numpy")
    assert not kernel.kept


def test_a_cache_that_a_power_cut_left_half_written_is_compiled_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    import pickle

    from floatbase.control.tick import kernel

    robot, tick = judges.load("go2"), kernel.tick
    wanted = compiled_one(robot)(robot.posture, np.zeros(robot.nv)).tau
    for error in (EOFError("Ran out of input"), pickle.UnpicklingError("pickle data was truncated")):
        forgotten: list[bool] = []

        def half(*given: object, error: Exception = error, forgotten: list[bool] = forgotten) -> int:
            if not forgotten:
                raise error
            return tick(*given)

        with monkeypatch.context() as patch:
            patch.setattr(kernel, "tick", half)
            patch.setattr(kernel, "compile_anew", lambda forgotten=forgotten: forgotten.append(True))
            controller = compiled_one(robot)
        assert forgotten == [True]
        assert np.array_equal(controller(robot.posture, np.zeros(robot.nv)).tau, wanted)


def test_compiling_anew_forgets_every_function(monkeypatch: pytest.MonkeyPatch) -> None:
    from numba.core.dispatcher import Dispatcher

    from floatbase.control.tick import kernel

    forgotten: list[Dispatcher] = []
    monkeypatch.setattr(Dispatcher, "recompile", lambda self: forgotten.append(self))
    kernel.compile_anew()
    assert kernel.tick in forgotten and kernel.sweep in forgotten and kernel.independent_rows in forgotten


def test_an_answer_out_of_reach_is_none() -> None:
    """Where next to nothing chooses an entry, as with weights of 0, it may be anything: then the readable path decides."""
    from floatbase.control.tick import kernel

    V, T, active = np.zeros((3, 2)), np.zeros((1, 2)), np.zeros(3, np.int64)
    V[0, 0] = T[0, 0] = 1.0
    for beta, good in ((1e6, True), (-1e6, True), (1e18, False), (-1e18, False), (np.nan, False), (np.inf, False)):
        assert kernel.write_answer(V, T, np.array([beta]), active, 0, 2, np.empty(10)) is good


def test_the_compiled_path_is_the_default_where_it_fits() -> None:
    robot = judges.load("go2")
    controller = fb.WholeBodyController(robot, judges.stance(robot), fb.standing_tasks(robot.standing()))
    assert controller.path == "compiled"
    assert controller(robot.posture, np.zeros(robot.nv)).path == "compiled"


def test_a_long_compilation_is_announced_and_a_short_one_is_not(capsys: pytest.CaptureFixture[str]) -> None:
    with compiled.told_when_slow("this takes long", after=0.02):
        time.sleep(0.2)
    assert capsys.readouterr().err == "this takes long\n"
    with compiled.told_when_slow("this takes long", after=5.0):
        pass
    assert capsys.readouterr().err == ""


def test_the_tick_can_be_compiled_before_it_is_needed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compile"]) == 0
    assert "compiled path" in capsys.readouterr().out


def test_polish_is_newtons_step_it_reaches_the_optimum_from_anywhere() -> None:
    """A small problem with two active rows: after one step point and multipliers are those of the KKT system."""
    from floatbase.control.tick import kernel

    rng = np.random.default_rng(0)
    root, rows, (bounds, g) = rng.standard_normal((4, 4)), rng.standard_normal((2, 4)), (rng.standard_normal(n) for n in (2, 4))
    H = root @ root.T + np.eye(4)
    L = np.linalg.cholesky(H)
    turn, upper = np.linalg.qr(np.linalg.solve(L, rows.T), mode="complete")
    W, U = turn.T @ np.linalg.inv(L), np.zeros((4, 4))
    U[:2, :2] = upper[:2]
    beta, mu = rng.standard_normal(4), rng.standard_normal(2)
    kernel.polish(beta, mu, 2, H @ beta + g, L, W, U, rows, bounds, *np.empty((3, 4)))
    K = np.block([[H, rows.T], [rows, np.zeros((2, 2))]])
    assert np.allclose(np.concatenate([beta, mu]), np.linalg.solve(K, np.concatenate([-g, bounds])), rtol=0.0, atol=1e-12)


def test_a_place_where_nothing_can_be_kept_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    from floatbase.control.tick import kernel

    robot = judges.load("go2")
    assert "cannot be kept" not in fb.WholeBodyController(robot, judges.stance(robot), []).path_reason
    monkeypatch.setattr(kernel, "kept", False)
    assert "set NUMBA_CACHE_DIR" in fb.WholeBodyController(robot, judges.stance(robot), []).path_reason
