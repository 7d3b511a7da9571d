"""The compiled tick: when it runs, what it compiles and keeps on disk, and its memory."""

import fcntl
import inspect
import multiprocessing
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import judges
import numba
import numpy as np
import pytest
from disk import full_disk
from messages import missing, raises
from numba.core.caching import CacheImpl
from numba.core.runtime import _nrt_python as counts
from numba.core.runtime import rtsys
from waiting import PATIENCE, until

import floatbase as fb
from floatbase.__main__ import main
from floatbase.control.tick import CompiledTick, announce_if_slow, jit, tick
from floatbase.errors import InputError

TICK = Path(tick.__file__).parent


def tick_of(robot: fb.Robot) -> CompiledTick:
    """Return the compiled tick of a standing controller."""
    return judges.controller_of(robot.name).compiled


def test_the_tick_numbers_its_rows_in_the_order_of_the_reference_qp(go2) -> None:
    """Both have the same rows if all normal forces, torques and joints are bounded."""
    made = judges.controller_of("go2", max_normal_force=100.0)
    q, v = go2.standing().q, np.zeros(go2.nv)
    inputs = made.compiled.inputs_at(q, v, 0.0)
    labels = made.compiled.qp(q, v, 0.0, inputs).inequality_names
    rows = [(label.kind, label.owner, label.number or 0) for label in labels]
    owners, n_hard = made.compiled.row_owners, len(rows) - 2 * go2.d
    assert owners[:n_hard] == rows[:n_hard]
    # the reference QP says which of the limits of a joint is the strictest, such as its velocity
    sides = [(kind.split()[0], owner) for kind, owner, _ in rows[n_hard:]]
    assert owners[n_hard:] == [(f"{side} joint limit", owner, 0) for side, owner in sides]


# when it runs -------------------------------------------------------------------------------------


WITHOUT_NUMBA = """
import sys
{obstacle}
import floatbase as fb
robot = fb.load("go2")
state, contacts = robot.standing(), fb.Contacts.points(robot)
controller = fb.WholeBodyController(robot, contacts, fb.standing_tasks(state))
print(controller.backend, controller(state.q, state.v).backend, controller.backend_reason)
try:
    fb.WholeBodyController(robot, contacts, fb.standing_tasks(state), backend="compiled")
except fb.FloatbaseError as error:
    print(error)
"""


@pytest.mark.parametrize(
    ("obstacle", "environment", "reason"),
    [
        ('sys.modules["numba"] = None', {},
            "numba cannot be loaded (.*); reinstall it with pip install numba"),
        ("", {"NUMBA_DISABLE_JIT": "1"}, "NUMBA_DISABLE_JIT is set, so numba does not compile"),
    ],
)  # fmt: skip
def test_without_numba_the_reference_backend_answers_and_says_why(obstacle, environment, reason):
    command = [sys.executable, "-c", WITHOUT_NUMBA.format(obstacle=obstacle)]
    said = subprocess.check_output(command, text=True, env=os.environ | environment).splitlines()
    reason = reason.replace("(.*)", r"\(.*\)")
    assert re.fullmatch(f"reference reference {reason}", said[0])
    assert re.match(f'backend="compiled" is not possible: {reason}. backend="auto"', said[1])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:.*fork")  # Python 3.12 warns of just this
def test_a_forked_process_can_tick_while_threads_of_its_parent_tick(backend):
    """Other threads and the locks that they hold do not exist in the forked process."""
    controller = judges.controller_of("go2", backend=backend)
    state = judges.load("go2").random_state(3, 0.1)
    expected, ended, answers = controller(state.q, state.v).tau.tobytes(), threading.Event(), []

    def answer(out: Any) -> None:
        out.send(controller(state.q, state.v).tau.tobytes())

    def spin() -> None:
        while not ended.is_set():
            controller(state.q, 0.5 * state.v)

    threads = [threading.Thread(target=spin) for _ in range(2)]
    for thread in threads:
        thread.start()
    into, out = multiprocessing.Pipe(duplex=False)
    for _ in range(5):
        child = multiprocessing.get_context("fork").Process(target=answer, args=(out,))
        child.start()
        # s: a tick takes at most a few milliseconds
        answers.append(into.recv() if into.poll(10.0) else "nothing")
        child.kill()
        child.join()
        if answers[-1] == "nothing":
            break
    ended.set()
    for thread in threads:
        thread.join()
    assert answers == 5 * [expected]


def test_the_tick_can_be_compiled_before_it_is_needed(capsys):
    assert main(["compile"]) == 0
    assert "compiled" in capsys.readouterr().out


def test_a_long_compilation_is_announced_and_a_short_one_is_not(capsys):
    with announce_if_slow("this takes long", after=0.0):
        time.sleep(0.2)
    assert capsys.readouterr().err == "this takes long\n"
    with announce_if_slow("this takes long", after=60.0):
        pass
    assert capsys.readouterr().err == ""


def test_a_slow_start_that_only_loads_is_not_announced_as_a_compilation(capsys, monkeypatch):
    module = "floatbase.control.tick.compiled"
    monkeypatch.setattr(f"{module}.announce_if_slow", partial(announce_if_slow, after=0.0))
    monkeypatch.setattr(f"{module}._RECHECK_INTERVAL", 0.01)
    made = tick_of(judges.load("go2"))
    misses = tick.tick.stats.cache_misses

    def slowly(begins_compiling: bool) -> None:
        if begins_compiling:
            misses["a signature"] += 1
        time.sleep(0.2)

    for begins, said in ((False, ""), (True, "floatbase is compiling its controller")):
        monkeypatch.setattr(made, "_tick_standing", partial(slowly, begins))
        assert made.warm_up() == "" and capsys.readouterr().err.startswith(said)
        assert bool(said) == begins
    misses.pop("a signature")


# what is kept on disk -----------------------------------------------------------------------------


def test_an_edit_in_any_file_of_the_tick_changes_the_key_of_its_cache(tmp_path, monkeypatch):
    copy = shutil.copytree(TICK, tmp_path / "tick", ignore=shutil.ignore_patterns("__pycache__"))
    key, files = jit.source_digest(copy), sorted(copy.glob("*.py"))
    assert len(files) == len(list(TICK.glob("*.py"))) and key == jit.source_digest()
    # numba's key holds the closure
    assert inspect.getclosurevars(tick.tick.py_func).nonlocals == {"digest": key}
    for file in files:
        text = file.read_text(encoding="utf-8")
        edited = text.replace("0", "1", 1) if "0" in text else text + "x = 1\n"
        file.write_text(edited, encoding="utf-8")
        assert jit.source_digest(copy) != key, file.name
        file.write_text(text, encoding="utf-8")
    assert jit.source_digest(copy) == key
    kinds = ("INCONSISTENCY", "CONSTRAINT_RANK", "FEASIBILITY", "UNIT_NORM")
    for name in ("CONSTRAINT_NOISE", *(f"{kind}_TOLERANCE" for kind in kinds)):
        with monkeypatch.context() as patch:
            patch.setattr(jit, name, 2.0 * getattr(jit, name))
            assert jit.source_digest() != key, name


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


HITS = """
from floatbase.control.tick.tick import tick
print(tick(2.0), len(tick.stats.cache_hits))"""
NO_WRITABLE_FOLDER = """
from numba.core import caching

def refuse(locator):
    raise PermissionError(locator.get_cache_path())

caching._CacheLocator.ensure_cache_path = refuse
"""


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    """Return the folder of a copy of the package with a small entry point."""
    package = TICK.parents[1]
    ignored = shutil.ignore_patterns("__pycache__", "_assets")
    copy = shutil.copytree(package, tmp_path / "floatbase", ignore=ignored)
    (copy / TICK.relative_to(package) / "tick.py").write_text(ENTRY, encoding="utf-8")
    return copy


def run_copied(
    copy: Path, cache: Path | str = "", processor: str = "", obstacle: str = ""
) -> list[str]:
    """Run a process on that copy; return what it computes and how often it loaded code.

    cache: numba's folder, "" for its default, which is beside the source.
    processor: for which numba compiles, "" for this one.
    """
    environment = os.environ | {"PYTHONPATH": str(copy.parent), "NUMBA_CACHE_DIR": str(cache)}
    environment |= {"NUMBA_CPU_NAME": processor} if processor else {}
    command = [sys.executable, "-c", obstacle + HITS]
    return subprocess.check_output(command, text=True, cwd=copy.parent, env=environment).split()


def edit_copied(copy: Path) -> None:
    """Change a function that the small entry point calls, in another file."""
    vectors = copy / TICK.relative_to(TICK.parents[1]) / "vectors.py"
    text = vectors.read_text(encoding="utf-8")
    edited = text.replace("return a[0] * b[0] +", "return 10.0 * a[0] * b[0] +")
    vectors.write_text(edited, encoding="utf-8")


@pytest.mark.front_end
def test_edited_code_is_recompiled_and_installed_code_is_loaded(copied, tmp_path):
    """The installation compiles beside the source; the users' caches are elsewhere."""
    user = tmp_path / "user"
    assert run_copied(copied) == ["6.0", "0"] and run_copied(copied) == ["6.0", "1"]
    assert run_copied(copied, user) == ["6.0", "1"]
    assert run_copied(copied, obstacle=NO_WRITABLE_FOLDER) == ["6.0", "1"]
    edit_copied(copied)
    assert run_copied(copied, user) == ["24.0", "0"] and run_copied(copied, user) == ["24.0", "1"]
    assert run_copied(copied) == ["24.0", "0"]


@pytest.mark.front_end
def test_code_for_the_generic_processor_that_a_wheel_brings_is_loaded(copied, tmp_path):
    user = tmp_path / "user"
    assert run_copied(copied, copied / "_compiled", "generic") == ["6.0", "0"]
    assert run_copied(copied, user) == ["6.0", "1"]
    assert not list(user.rglob("*.nbc"))  # nothing was compiled
    edit_copied(copied)
    assert run_copied(copied, user) == ["24.0", "0"]


def make_small(digest: int) -> Callable[..., int]:
    """Return a function that is compiled and cached like the tick, but in no time."""

    def small(*arguments: object) -> int:
        _ = digest
        return 0

    return small


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[], str]:
    """Make a controller with `make_small` as its tick, and return its `backend_reason`.

    The tick is cached in tmp_path.
    """
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))

    def reason() -> str:
        monkeypatch.setattr(jit, "cache_error", "")
        monkeypatch.setattr(tick, "tick", jit.jit_cached(make_small))
        robot = judges.load("go2")
        controller = fb.WholeBodyController(robot, judges.stance(robot), [])
        assert controller.backend == "compiled"
        return controller.backend_reason

    return reason


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("damaged", [b"", b"not what numba wrote"])
def test_damaged_files_leave_a_compiled_tick_and_a_warning(suffix, damaged, small, tmp_path):
    assert "disk" not in small() and "disk" not in small() and tick.tick.stats.cache_hits
    (file,) = tmp_path.rglob("*" + suffix)
    file.write_bytes(damaged)
    assert not missing(small(), "NUMBA_CACHE_DIR")


def test_a_full_disk_leaves_a_compiled_tick_and_a_warning(small):
    with full_disk(0):
        assert not missing(small(), "OSError", "File too large", "NUMBA_CACHE_DIR")
    assert "disk" not in small()


def test_a_controller_waits_for_another_process_that_compiles_until_the_user_interrupts(
    small, request
):
    def interrupt() -> None:
        until(lambda: jit.waiting)
        time.sleep(0.1)  # s until the lock is requested
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    # some test runners ignore interrupts
    former = signal.signal(signal.SIGINT, signal.default_int_handler)
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, former))
    small()
    with ThreadPoolExecutor(1) as other:
        with open(Path(tick.tick.stats.cache_path) / "compiling.lock", "a") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            sent = other.submit(interrupt)
            with pytest.raises(KeyboardInterrupt):
                small()
            sent.result()
            assert not jit.waiting
            made = other.submit(small)
            until(lambda: jit.waiting)
            assert not made.done()
        assert made.result(PATIENCE) and not jit.waiting


def test_the_tick_compiles_where_no_folder_can_be_written(small, monkeypatch):
    monkeypatch.setattr(CacheImpl, "_locator_classes", [])
    assert not missing(small(), "no folder", "NUMBA_CACHE_DIR")


def test_where_numba_fails_the_reference_backend_is_the_last_resort(monkeypatch):
    fails = Mock(side_effect=NotImplementedError("no such target"), stats=None)
    monkeypatch.setattr(tick, "tick", fails)
    controller = judges.controller_of("go2")
    command = controller(judges.load("go2").posture, np.zeros(18))
    assert controller.backend == command.backend == "reference"
    assert not missing(controller.backend_reason, "numba", "NotImplementedError: no such target")
    with raises(InputError, "backend", "NotImplementedError: no such target"):
        judges.controller_of("go2", backend="compiled")


# memory -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("robot", ["go2", "talos", "ur5"], indirect=True)
def test_a_tick_reads_nothing_of_its_workspace_that_it_did_not_write(robot):
    compiled = tick_of(robot)
    floats, ints = compiled.workspace()
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


def test_a_tick_allocates_nothing_and_raises_an_error_if_its_workspace_is_too_small(go2):
    """Real-time code must not allocate memory; only near-singular contacts do, for an SVD."""
    compiled = tick_of(go2)
    state = go2.random_state(5, 0.3)
    q, v = np.array(state.q), np.array(state.v)
    counts.memsys_enable_stats()
    before = rtsys.get_allocation_stats()
    assert compiled(q, v, 0.0) is not None
    assert rtsys.get_allocation_stats() == before
    counts.memsys_disable_stats()
    inputs, ints = compiled.default_inputs, compiled.workspace()[1]
    small, result = np.empty(2000), compiled.empty_result(inputs)
    with raises(MemoryError, "workspace"):
        tick.tick(q, v, inputs.packed, *compiled.tables, small, ints, result, tick.N_STAGES)


@pytest.mark.parametrize("weight", [1e-10, 1e-15, 1e-20, 1e-25, 1e-30, 0.0])
def test_an_answer_that_is_hardly_determined_is_left_to_the_reference_backend(weight, talos):
    """Internal forces cost almost nothing, so rounding may make them huge.

    Such answers are rejected.
    """
    light = [fb.ForceTask(weight=weight), fb.TorqueTask(weight=0.0)]
    tasks = [*fb.standing_tasks(talos.standing()), *light]
    compiled = judges.pair(talos, fb.Contacts.flat_feet(talos), tasks)[0].compiled
    for state in judges.states("talos", 5, 0.1):
        answer = compiled(np.array(state.q), np.array(state.v), 0.0)
        if answer is not None:
            assert weight > 0.0 and np.max(np.abs(answer[0][: compiled.forces.stop])) <= 1e8
