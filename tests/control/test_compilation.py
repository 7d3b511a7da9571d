"""The compiled tick: when it runs, what it compiles and keeps on disk, what it does with memory."""

from __future__ import annotations

import inspect
import os
import pickle
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import judges
import numba
import numpy as np
import pytest
from numba.core import event
from numba.core.runtime import _nrt_python as counts
from numba.core.runtime import rtsys

import floatbase as fb
from floatbase.__main__ import main
from floatbase.control.tick import Compiled, announce_if_slow, jit, tick
from floatbase.robots import Robot

TICK = Path(tick.__file__).parent


def tick_of(robot: Robot) -> Compiled:
    """The compiled tick of a controller that stands."""
    compiled = judges.controller_of(robot.name).compiled
    assert compiled is not None
    return compiled


# when it runs --------------------------------------------------------------------------------------------------------------


WITHOUT_NUMBA = """
import sys
sys.modules["numba"] = None
import floatbase as fb
robot = fb.load("go2")
state, contacts = robot.standing(), fb.Contacts.points(robot)
controller = fb.WholeBodyController(robot, contacts, fb.standing_tasks(state))
print(controller.path, controller(state.q, state.v).path, controller.path_reason)
try:
    fb.WholeBodyController(robot, contacts, fb.standing_tasks(state), path="compiled")
except fb.FloatbaseError as error:
    print(error)
"""


def test_without_numba_the_readable_path_answers_and_says_why() -> None:
    said = subprocess.run([sys.executable, "-c", WITHOUT_NUMBA], capture_output=True, text=True, check=True).stdout.splitlines()
    assert said[0].startswith("readable readable numba cannot be loaded (") and "pip install numba" in said[0]
    assert said[1].startswith('path="compiled" is not possible: numba cannot be loaded (')


def test_another_layout_of_pinocchios_results_leaves_the_readable_path(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = fb.load("go2", torque_limits=20.0)  # one that no other test has: what fits is remembered for each robot
    monkeypatch.setattr(type(tick_of(judges.load("go2")).dynamics), "fits", False)
    controller = fb.WholeBodyController(robot, judges.stance(robot), fb.standing_tasks(robot.standing()))
    assert controller.path == "readable"
    assert controller.path_reason == "this Pinocchio lays its results out in another way in memory"


def test_threads_may_share_a_controller() -> None:
    controller, states = judges.controller_of("go2", path="compiled"), judges.states("go2", 40, 0.3)
    expected, interval = [controller(state.q, state.v).tau for state in states], sys.getswitchinterval()

    def wrong(shift: int) -> list[int]:
        order = (np.arange(400) + shift) % len(states)
        return [i for i in order if not np.array_equal(controller(states[i].q, states[i].v).tau, expected[i])]

    sys.setswitchinterval(1e-6)  # s: threads take turns in the middle of a tick
    try:
        with ThreadPoolExecutor(3) as pool:
            assert list(pool.map(wrong, (0, 13, 27))) == [[], [], []]
    finally:
        sys.setswitchinterval(interval)


def test_a_replaced_controller_compiles_nothing() -> None:
    robot = judges.load("go2")
    controller = judges.controller_of(robot.name, facets=6)
    with event.install_recorder("numba:compile") as recorder:
        for frames in (["FL_foot"], ["FR_foot", "RL_foot"], ["FL_foot", "FR_foot", "RR_foot"]):
            controller.replace(contacts=fb.Contacts.points(robot, frames=frames))(robot.posture, np.zeros(robot.nv))
    assert not recorder.buffer


def test_the_tick_can_be_compiled_before_it_is_needed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compile"]) == 0
    assert "compiled path" in capsys.readouterr().out


def test_a_long_compilation_is_announced_and_a_short_one_is_not(capsys: pytest.CaptureFixture[str]) -> None:
    with announce_if_slow("this takes long", after=0.0):
        time.sleep(0.2)
    assert capsys.readouterr().err == "this takes long\n"
    with announce_if_slow("this takes long", after=60.0):
        pass
    assert capsys.readouterr().err == ""


# what is kept on disk ------------------------------------------------------------------------------------------------------


def test_an_edit_in_any_file_of_the_tick_changes_the_key_of_its_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    copy = shutil.copytree(TICK, tmp_path / "tick", ignore=shutil.ignore_patterns("__pycache__"))
    key, files = jit.digest(copy), sorted(copy.glob("*.py"))
    assert len(files) == len(list(TICK.glob("*.py"))) and key == jit.digest()
    assert inspect.getclosurevars(tick.tick.py_func).nonlocals == {"digest": key}  # numba's key holds the closure
    for file in files:
        text = file.read_text(encoding="utf-8")
        file.write_text(text.replace("0", "1", 1) if "0" in text else text + "x = 1\n", encoding="utf-8")
        assert jit.digest(copy) != key, file.name
        file.write_text(text, encoding="utf-8")
    assert jit.digest(copy) == key
    for name in ("INCONSISTENT", "MOTION_TOLERANCE", "MOTION_NOISE", "FEASIBILITY_TOLERANCE", "UNIT_LENGTH_TOLERANCE"):
        with monkeypatch.context() as patch:
            patch.setattr(jit, name, 2.0 * getattr(jit, name))
            assert jit.digest() != key, name


ENTRY = '''
"""A small entry point instead of the tick."""

from floatbase.control.tick.jit import jit_cached
from floatbase.control.tick.vectors import dot


def make_tick(digest):
    def tick(x):
        _ = digest
        return dot((x, x, x), (1.0, 1.0, 1.0))

    return tick


tick = jit_cached(make_tick)
'''


def test_an_edited_function_is_compiled_anew_and_an_old_one_is_loaded(tmp_path: Path) -> None:
    """Processes on a copy of the package with a small entry point, whose callee in another file is edited between them."""
    package = TICK.parents[1]
    copy = shutil.copytree(package, tmp_path / "floatbase", ignore=shutil.ignore_patterns("__pycache__", "_assets"))
    folder = copy / TICK.relative_to(package)
    (folder / "tick.py").write_text(ENTRY, encoding="utf-8")
    code = "from floatbase.control.tick.tick import tick; print(tick(2.0), len(tick.stats.cache_hits))"
    environment = os.environ | {"PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}

    def run() -> list[str]:
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, env=environment, check=True
        )
        return done.stdout.split()

    assert run() == ["6.0", "0"] and run() == ["6.0", "1"]
    vectors = folder / "vectors.py"
    text = vectors.read_text(encoding="utf-8")
    vectors.write_text(text.replace("return a[0] * b[0] +", "return 10.0 * a[0] * b[0] +"), encoding="utf-8")
    assert run() == ["24.0", "0"] and run() == ["24.0", "1"]


def test_the_tick_compiles_where_no_folder_can_be_written_to(monkeypatch: pytest.MonkeyPatch) -> None:
    def njit(function: object = None, *, cache: bool = False, **options: object) -> object:
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return "compiled without a cache"

    monkeypatch.setattr(numba, "njit", njit)
    monkeypatch.setattr(jit, "jit", njit)
    monkeypatch.setattr(jit, "cache_on_disk", True)
    assert jit.jit_cached(lambda digest: lambda: digest) == "compiled without a cache"
    robot = judges.load("go2")
    assert "set NUMBA_CACHE_DIR" in fb.WholeBodyController(robot, judges.stance(robot), []).path_reason
    monkeypatch.undo()
    assert "NUMBA_CACHE_DIR" not in fb.WholeBodyController(robot, judges.stance(robot), []).path_reason


@pytest.mark.parametrize("error", [EOFError("Ran out of input"), pickle.UnpicklingError("pickle data was truncated")])
def test_a_cache_that_a_power_cut_left_half_written_is_compiled_anew(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    class Half:
        """The tick, as numba finds half a file."""

        forgotten, stats = False, tick.tick.stats

        def __call__(self, *given: object) -> int:
            if not self.forgotten:
                raise error
            return tick_now(*given)

        def recompile(self) -> None:
            self.forgotten = True

    robot, tick_now, half = judges.load("go2"), tick.tick, Half()
    expected = judges.controller_of(robot.name)(robot.posture, np.zeros(robot.nv)).tau
    monkeypatch.setattr(tick, "tick", half)
    controller = judges.controller_of(robot.name)
    assert half.forgotten
    assert np.array_equal(controller(robot.posture, np.zeros(robot.nv)).tau, expected)


# memory --------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["go2", "talos", "ur5"])
def test_a_tick_reads_nothing_of_its_workspace_that_it_did_not_write(name: str) -> None:
    robot = judges.load(name)
    compiled = tick_of(robot)
    floats, ints = compiled.workspace
    answered = 0
    for seed in range(20):
        state = robot.random_state(seed, 0.3)
        answers = []
        for rest in (0.0, np.nan, 1e300):
            floats[:], ints[:] = rest, 10**15
            answer = compiled(np.array(state.q), np.array(state.v), 0.0)
            answers.append(None if answer is None else answer[0][: compiled.forces.stop])
        assert all(np.array_equal(answer, answers[0]) for answer in answers)
        answered += answers[0] is not None
    assert answered >= 10


def test_a_tick_allocates_nothing_and_says_when_its_workspace_is_too_small() -> None:
    """Real-time code must not ask for memory; only near-singular contacts do, for an SVD."""
    robot = judges.load("go2")
    compiled = tick_of(robot)
    state = robot.random_state(5, 0.3)
    q, v = np.array(state.q), np.array(state.v)
    counts.memsys_enable_stats()
    before = rtsys.get_allocation_stats()
    assert compiled(q, v, 0.0) is not None
    assert rtsys.get_allocation_stats() == before
    counts.memsys_disable_stats()
    compiled.workspace[0].resize(2000, refcheck=False)
    with pytest.raises(MemoryError, match="workspace of the controller"):
        compiled(q, v, 0.0)


@pytest.mark.parametrize("weight", [1e-10, 1e-15, 1e-20, 1e-25, 1e-30, 0.0])
def test_an_answer_that_is_hardly_determined_is_left_to_the_readable_path(weight: float) -> None:
    """Forces inside the robot cost hardly anything: rounding may drive them anywhere, but no such answer comes out."""
    robot = judges.load("talos")
    tasks = [*fb.standing_tasks(robot.standing()), fb.ForceTask(weight=weight), fb.TorqueTask(weight=0.0)]
    controller = fb.WholeBodyController(robot, fb.Contacts.flat_feet(robot), tasks, path="compiled")
    assert controller.compiled is not None
    for state in judges.states("talos", 5, 0.1):
        answer = controller.compiled(np.array(state.q), np.array(state.v), 0.0)
        assert answer is None or (weight > 0.0 and np.max(np.abs(answer[0][: controller.compiled.forces.stop])) <= 1e8)
