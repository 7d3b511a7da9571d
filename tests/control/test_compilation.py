"""The compiled tick: when it runs, what it compiles and keeps on disk, what it does with memory."""

from __future__ import annotations

import inspect
import multiprocessing
import os
import pickle
import re
import resource
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import judges
import numba
import numpy as np
import pytest
from messages import missing, raises
from numba.core import event
from numba.core.runtime import _nrt_python as counts
from numba.core.runtime import rtsys

import floatbase as fb
from floatbase.__main__ import main
from floatbase.control.tick import CompiledTick, announce_if_slow, jit, tick
from floatbase.errors import InputError
from floatbase.robots import Robot

TICK = Path(tick.__file__).parent


def tick_of(robot: Robot) -> CompiledTick:
    """The compiled tick of a controller that stands."""
    compiled = judges.controller_of(robot.name).compiled
    assert compiled is not None
    return compiled


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
        (
            'sys.modules["numba"] = None',
            {},
            "numba cannot be loaded (.*); pip install numba may mend it",
        ),
        ("", {"NUMBA_DISABLE_JIT": "1"}, "NUMBA_DISABLE_JIT is set, and numba compiles nothing"),
    ],
)
def test_without_numba_the_reference_backend_answers_and_says_why(
    obstacle: str, environment: dict[str, str], reason: str
) -> None:
    command = [sys.executable, "-c", WITHOUT_NUMBA.format(obstacle=obstacle)]
    done = subprocess.run(
        command, capture_output=True, text=True, check=True, env=os.environ | environment
    )
    said = done.stdout.splitlines()
    reason = reason.replace("(.*)", r"\(.*\)")
    assert re.fullmatch(f"reference reference {reason}", said[0])
    assert re.match(f'backend="compiled" is not possible: {reason}. backend="auto"', said[1])


def test_another_layout_of_pinocchios_results_leaves_the_reference_backend(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    robot = fb.load(
        "go2", torque_limits=20.0
    )  # one that no other test has: what fits is remembered for each robot
    monkeypatch.setattr(type(tick_of(judges.load("go2")).dynamics), "layout_supported", False)
    controller = fb.WholeBodyController(
        robot, judges.stance(robot), fb.standing_tasks(robot.standing())
    )
    assert controller.backend == "reference"
    assert "Pinocchio" in controller.backend_reason


def test_threads_may_share_a_controller() -> None:
    controller, states = (
        judges.controller_of("go2", backend="compiled"),
        judges.states("go2", 40, 0.3),
    )
    expected, interval = (
        [controller(state.q, state.v).tau for state in states],
        sys.getswitchinterval(),
    )

    def wrong(shift: int) -> list[int]:
        order = (np.arange(400) + shift) % len(states)
        return [
            i
            for i in order
            if not np.array_equal(controller(states[i].q, states[i].v).tau, expected[i])
        ]

    sys.setswitchinterval(1e-6)  # s: threads take turns in the middle of a tick
    try:
        with ThreadPoolExecutor(3) as pool:
            assert list(pool.map(wrong, (0, 13, 27))) == [[], [], []]
    finally:
        sys.setswitchinterval(interval)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:.*fork")  # Python 3.12 warns of just this
@pytest.mark.parametrize("backend", ["compiled", "reference"])
def test_a_process_forked_while_threads_tick_ticks_on(backend: str) -> None:
    """The other threads, and the locks that they hold, stay behind in the middle of a tick."""
    controller, state = (
        judges.controller_of("go2", backend=backend),
        judges.load("go2").random_state(3, 0.1),
    )
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
    for _ in range(20):
        child = multiprocessing.get_context("fork").Process(target=answer, args=(out,))
        child.start()
        answers.append(
            into.recv() if into.poll(10.0) else "nothing"
        )  # s: a tick takes some milliseconds at most
        child.kill()
        child.join()
        if answers[-1] == "nothing":
            break
    ended.set()
    for thread in threads:
        thread.join()
    assert answers == 20 * [expected]


def test_a_replaced_controller_compiles_nothing() -> None:
    robot = judges.load("go2")
    controller = judges.controller_of(robot.name, facets=6)
    with event.install_recorder("numba:compile") as recorder:
        for frames in (["FL_foot"], ["FR_foot", "RL_foot"], ["FL_foot", "FR_foot", "RR_foot"]):
            controller.replace(contacts=fb.Contacts.points(robot, frames=frames))(
                robot.posture, np.zeros(robot.nv)
            )
    assert not recorder.buffer


def test_the_tick_can_be_compiled_before_it_is_needed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compile"]) == 0
    assert "compiled" in capsys.readouterr().out


def test_a_long_compilation_is_announced_and_a_short_one_is_not(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with announce_if_slow("this takes long", after=0.0):
        time.sleep(0.2)
    assert capsys.readouterr().err == "this takes long\n"
    with announce_if_slow("this takes long", after=60.0):
        pass
    assert capsys.readouterr().err == ""


# what is kept on disk -----------------------------------------------------------------------------


def test_an_edit_in_any_file_of_the_tick_changes_the_key_of_its_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy = shutil.copytree(TICK, tmp_path / "tick", ignore=shutil.ignore_patterns("__pycache__"))
    key, files = jit.source_digest(copy), sorted(copy.glob("*.py"))
    assert len(files) == len(list(TICK.glob("*.py"))) and key == jit.source_digest()
    assert inspect.getclosurevars(tick.tick.py_func).nonlocals == {
        "digest": key
    }  # numba's key holds the closure
    for file in files:
        text = file.read_text(encoding="utf-8")
        file.write_text(
            text.replace("0", "1", 1) if "0" in text else text + "x = 1\n", encoding="utf-8"
        )
        assert jit.source_digest(copy) != key, file.name
        file.write_text(text, encoding="utf-8")
    assert jit.source_digest(copy) == key
    for name in (
        "INCONSISTENCY_TOLERANCE",
        "CONSTRAINT_RANK_TOLERANCE",
        "CONSTRAINT_NOISE",
        "FEASIBILITY_TOLERANCE",
        "UNIT_NORM_TOLERANCE",
    ):
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
print(tick(2.0), len(tick.stats.cache_hits), jit.cache_error)"""
NOWHERE = """
def nowhere(function):
    raise RuntimeError("cannot cache function: no locator available")
jit.WritableCache = nowhere"""


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    """The folder of a copy of the package with a small entry point."""
    package = TICK.parents[1]
    copy = shutil.copytree(
        package, tmp_path / "floatbase", ignore=shutil.ignore_patterns("__pycache__", "_assets")
    )
    (copy / TICK.relative_to(package) / "tick.py").write_text(ENTRY, encoding="utf-8")
    return copy


def run_copied(copy: Path, cache: Path | str = "", before: str = "") -> list[str]:
    """A process on that copy: what it computes, how often it loaded code, what prevented it from
    keeping that.

    cache: numba's folder, "" where numba looks for one, and that is beside the source. before:
        code.
    """
    environment = os.environ | {"PYTHONPATH": str(copy.parent), "NUMBA_CACHE_DIR": str(cache)}
    command = [sys.executable, "-c", f"from floatbase.control.tick import jit{before}{HITS}"]
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=copy.parent, env=environment, check=True
    )
    return done.stdout.split(maxsplit=2)


def edit_copied(copy: Path) -> None:
    """Change a function that the small entry point calls, in another file."""
    vectors = copy / TICK.relative_to(TICK.parents[1]) / "vectors.py"
    text = vectors.read_text(encoding="utf-8")
    vectors.write_text(
        text.replace("return a[0] * b[0] +", "return 10.0 * a[0] * b[0] +"), encoding="utf-8"
    )


def test_an_edited_function_is_compiled_anew_and_an_old_one_is_loaded(
    copied: Path, tmp_path: Path
) -> None:
    run = partial(run_copied, copied, tmp_path / "cache")
    assert run() == ["6.0", "0"] and run() == ["6.0", "1"]
    edit_copied(copied)
    assert run() == ["24.0", "0"] and run() == ["24.0", "1"]


def test_what_was_compiled_beside_the_source_is_loaded_by_those_who_may_not_write_there(
    copied: Path, tmp_path: Path
) -> None:
    assert run_copied(copied) == ["6.0", "0"]  # who installs it
    own = tmp_path / "own"
    assert run_copied(copied, own) == ["6.0", "1"]
    assert list(own.rglob("*.nb?")) == []
    assert run_copied(copied, before=NOWHERE) == ["6.0", "1"]
    edit_copied(copied)
    assert run_copied(copied, own) == ["24.0", "0"] and run_copied(copied, own) == ["24.0", "1"]
    assert len(list(own.rglob("*.nbc"))) == 1
    assert run_copied(copied, before=NOWHERE) == ["24.0", "0", "no folder can be written to\n"]


def make_small(digest: int) -> Callable[[float], float]:
    """A function that is compiled and kept like the tick, in no time."""

    def small(x: float) -> float:
        _ = digest
        return 3.0 * x

    return small


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[], bool]:
    """Makes `make_small` ready in a folder of its own, checks its answer, and says whether it was
    loaded from disk.
    """
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(jit, "cache_error", "")

    def loaded() -> bool:
        function = jit.jit_cached(make_small)
        assert function(2.0) == 6.0
        return bool(function.stats.cache_hits)

    return loaded


def flipped(at: float) -> Callable[[bytes], bytes]:
    """One bit, at a part of the file."""
    return lambda data: (
        data[: int(at * len(data))]
        + bytes([data[int(at * len(data))] ^ 16])
        + data[int(at * len(data)) + 1 :]
    )


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda data: b"",
    "half": lambda data: data[: len(data) // 2],
    "text": lambda data: b"not what numba wrote",
    "zeros": lambda data: bytes(len(data)),
    "another value": lambda data: pickle.dumps(42),
    "a module that is not there": lambda data: b"cno_such_module\nname\n.",
    **{f"bit at {at}": flipped(at) for at in np.linspace(0.0, 0.99, 12).round(2)},
}


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
def test_damaged_files_are_compiled_anew_and_replaced(
    suffix: str, small: Callable[[], bool], tmp_path: Path
) -> None:
    assert not small() and small()
    (file,) = tmp_path.rglob("*" + suffix)
    for name, damage in DAMAGES.items():
        file.write_bytes(damage(file.read_bytes()))
        assert not small() or suffix == ".nbi", (
            name
        )  # a bit of the index may say nothing; of code, every bit counts
        assert small() and not jit.cache_error, name
    file.unlink()
    assert not small() and small()
    file.unlink()
    (file / "inside").mkdir(parents=True)
    assert not small() and "Is a directory" in jit.cache_error


def test_a_full_disk_leaves_a_compiled_tick_and_the_words(small: Callable[[], bool]) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, before[1]))  # bytes: no file may grow
    try:
        assert not small()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert "File too large" in jit.cache_error
    robot = judges.load("go2")
    reason = fb.WholeBodyController(robot, judges.stance(robot), []).backend_reason
    assert not missing(reason, "OSError", "File too large", "NUMBA_CACHE_DIR")
    assert not small() and small()  # there is room again


def test_the_tick_compiles_where_no_folder_can_be_written(
    small: Callable[[], bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    def nowhere(function: object) -> None:
        raise RuntimeError("cannot cache function: no locator available")

    monkeypatch.setattr(jit, "WritableCache", nowhere)
    assert not small() and not small()
    robot = judges.load("go2")
    reason = fb.WholeBodyController(robot, judges.stance(robot), []).backend_reason
    assert "NUMBA_CACHE_DIR" in reason
    monkeypatch.setattr(jit, "cache_error", "")
    assert (
        "NUMBA_CACHE_DIR"
        not in fb.WholeBodyController(robot, judges.stance(robot), []).backend_reason
    )


def test_where_numba_fails_the_reference_backend_is_the_last_resort(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fails(*given: object) -> int:
        raise NotImplementedError("no such target")

    monkeypatch.setattr(tick, "tick", fails)
    controller = judges.controller_of("go2")
    assert (
        controller.backend
        == controller(judges.load("go2").posture, np.zeros(18)).backend
        == "reference"
    )
    assert not missing(controller.backend_reason, "numba", "NotImplementedError: no such target")
    with raises(InputError, "backend", "NotImplementedError: no such target"):
        judges.controller_of("go2", backend="compiled")


# memory -------------------------------------------------------------------------------------------


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
    with raises(MemoryError, "workspace"):
        compiled(q, v, 0.0)


@pytest.mark.parametrize("weight", [1e-10, 1e-15, 1e-20, 1e-25, 1e-30, 0.0])
def test_an_answer_that_is_hardly_determined_is_left_to_the_reference_backend(
    weight: float,
) -> None:
    """Forces inside the robot cost hardly anything: rounding may drive them anywhere, but no such
    answer comes out.
    """
    robot = judges.load("talos")
    tasks = [
        *fb.standing_tasks(robot.standing()),
        fb.ForceTask(weight=weight),
        fb.TorqueTask(weight=0.0),
    ]
    controller = fb.WholeBodyController(
        robot, fb.Contacts.flat_feet(robot), tasks, backend="compiled"
    )
    assert controller.compiled is not None
    for state in judges.states("talos", 5, 0.1):
        answer = controller.compiled(np.array(state.q), np.array(state.v), 0.0)
        assert answer is None or (
            weight > 0.0 and np.max(np.abs(answer[0][: controller.compiled.forces.stop])) <= 1e8
        )
