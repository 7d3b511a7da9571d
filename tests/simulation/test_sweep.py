"""A sweep gives one table, for any number of workers, anywhere, and however often it was killed."""

import linecache
import os
import subprocess
import sys
import threading
import time
import types
import warnings
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from disk import full_disk
from messages import raises, warns
from pandas.testing import assert_frame_equal

import floatbase as fb
from floatbase.errors import InputError, SimulationError, SimulationWarning
from floatbase.simulation import read_sweep

GRID = {"n": [1, 2, 3, 4, 5], "scale": np.array([0.1, 0.3])}
# every call leaves a mark, so that calls can be counted; a script's function is sent by value
SCRIPT = """
import time
import floatbase as fb

def marked(i):
    with open("calls", "a") as calls:
        calls.write(f"{i}\\n")
    time.sleep(0.02)
    return i / 7

fb.sweep(marked, {"i": list(range(60))}, file="marked.jsonl", workers=2, progress=False)
"""


def square(x: float) -> float:
    """Return the square of x."""
    return x * x


def killer(x: float) -> None:
    """Kill the worker."""
    os.kill(os.getpid(), 9)


def spectrum(factor: float, n: int, scale: float) -> dict[str, Any]:
    """Return floats that depend on the last bits, and an array; raise an error at two points."""
    matrix = factor * scale * np.vander(np.linspace(0.1, 1.7, 40), 40)[:, -20:]
    if n == 3:
        raise ValueError(f"no {n} here")
    values = np.linalg.svd(matrix)[1][:n]
    return {"values": values, "sum": np.float32(matrix.sum()), "process": os.getpid()}


def spectra(**options: Any) -> tuple[pd.DataFrame, set[int]]:
    """Return the table of all spectra, and the processes that computed them."""
    table = fb.sweep(spectrum, GRID, setup=lambda: 1.1, progress=False, **options)
    return table.drop(columns="process"), set(table["process"].dropna())


def test_one_worker_and_two_give_the_same_table() -> None:
    (one, processes), (two, _) = (spectra(workers=w) for w in (1, 2))
    assert_frame_equal(one, two, check_exact=True)
    assert list(one.columns) == ["n", "scale", "values", "sum", "error"]
    assert one["n"].tolist() == [1, 1, 2, 2, 3, 3, 4, 4, 5, 5] and one["scale"][1] == 0.3
    assert one["error"].dropna().tolist() == 2 * ["ValueError: no 3 here"]
    assert np.flatnonzero(one["sum"].isna()).tolist() == [4, 5] and len(one["values"][9]) == 5
    assert len(processes) == 1 and os.getpid() not in processes


@pytest.mark.front_end
def test_a_killed_sweep_resumes_where_it_was(tmp_path: Path) -> None:
    """After a kill at a random time, only the points in progress are computed again."""
    after = np.random.default_rng(0).integers(2, 45)
    (tmp_path / "script.py").write_text(SCRIPT)
    command = [sys.executable, "script.py"]
    rows = tmp_path / "marked.jsonl"
    with subprocess.Popen(command, cwd=tmp_path) as running:
        while running.poll() is None and (
            not rows.exists() or rows.read_bytes().count(b"\n") < after
        ):
            time.sleep(0.005)
        running.kill()
    assert after <= rows.read_bytes().count(b"\n") < 61
    with rows.open("ab") as file:
        file.write(b'{"point": 59, "i"')  # an incomplete line, as after a power failure
    subprocess.run(command, cwd=tmp_path, check=True)
    table = read_sweep(rows)
    assert table["result"].tolist() == [i / 7 for i in range(60)] and table["error"].isna().all()
    assert rows.read_bytes().count(b"\n") == 61, "one line for each point, and the first line"
    calls = (tmp_path / "calls").read_text().split()
    assert set(calls) == {str(i) for i in range(60)}
    assert len(calls) - 60 <= 2 * 2  # for each of two workers, its present point and the next


def test_a_sweep_resumes_after_a_full_disk_and_computes_failed_points_again(tmp_path: Path) -> None:
    def root(i: int, folder: str) -> float:
        with open(f"{folder}/calls", "a") as calls:
            calls.write(f"{i}")
        if i == 1 and not os.path.exists(f"{folder}/repaired"):
            raise MemoryError
        return float(i**0.5)

    grid, file = {"i": [0, 1, 4], "folder": [str(tmp_path)]}, tmp_path / "rows.jsonl"
    first = fb.sweep(root, grid, file=file, workers=1, progress=False)
    assert first["error"].isna().tolist() == [True, False, True]
    (tmp_path / "repaired").touch()
    size = file.stat().st_size
    with full_disk(size + 20), raises(InputError, "rows.jsonl", "File too large"):
        fb.sweep(root, grid, file=file, workers=1, progress=False)
    assert file.stat().st_size == size + 20, "the last row was written in part"
    second = fb.sweep(root, grid, file=file, workers=1, progress=False)
    assert second["result"].tolist() == [0.0, 1.0, 2.0] and second["error"].isna().all()
    assert (tmp_path / "calls").read_text() == "01411", "the lost point and no other is repeated"
    assert_frame_equal(read_sweep(file), second)


def test_a_sweep_that_fails_in_one_thread_does_not_stop_another(tmp_path: Path) -> None:
    def patient(made: None, i: int) -> int:
        (tmp_path / "begun").touch()
        until = time.monotonic() + 60.0
        while not (tmp_path / "failed").exists() and time.monotonic() < until:
            time.sleep(0.02)
        return i

    options = {"setup": (tmp_path / "made").mkdir, "workers": 1, "progress": False}
    with ThreadPoolExecutor(1) as thread:
        running = thread.submit(fb.sweep, patient, {"i": [0, 1, 2, 3]}, **options)
        while not (tmp_path / "begun").exists() and not running.done():
            time.sleep(0.02)
        with raises(InputError, "result", "x"):
            fb.sweep(lambda x: {"x": x}, {"x": [0, 1]}, workers=1, progress=False)
        (tmp_path / "failed").touch()
        assert list(running.result()["result"]) == [0, 1, 2, 3]


@pytest.mark.front_end
def test_a_dask_cluster_gives_the_same_table() -> None:
    distributed = pytest.importorskip(
        "distributed", reason="Dask is not installed: pip install floatbase[cluster]"
    )

    here, _ = spectra(workers=1)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None
    ) as cluster:
        workers = {worker.pid for worker in cluster.workers.values()}
        by_address, processes = spectra(cluster=cluster.scheduler_address)
        with distributed.Client(cluster) as client:
            by_client, _ = spectra(cluster=client)
            with raises(InputError, "result", "object"):
                fb.sweep(lambda x: object(), {"x": [1, 2]}, cluster=client, progress=False)
            cluster.scheduler.allowed_failures = 0  # otherwise it retries three times
            with raises(SimulationError, "KilledWorker"):
                fb.sweep(killer, {"x": [1]}, cluster=client, progress=False)
        with raises(InputError, "Dask"):
            spectra(cluster=client)
    for table in (by_address, by_client):
        assert_frame_equal(here, table, check_exact=True)
    assert processes <= workers


def test_a_file_that_is_removed_while_the_sweep_runs_is_told_and_the_table_is_whole(
    tmp_path: Path,
) -> None:
    file = tmp_path / "rows.jsonl"

    def remove(x: int) -> int:
        file.unlink(missing_ok=True)
        return x

    with warns(SimulationWarning, "rows.jsonl"):
        table = fb.sweep(remove, {"x": [1, 2]}, file=file, workers=1, progress=False)
    assert table["result"].tolist() == [1, 2]


# a script whose parts are edited between two sweeps into the same file
EDITED = """
import floatbase as fb

FACTOR = 2
LIST = [1, 2]

def helper(x):
    return x + 1

def setup():
    return 5

def study(made, x):
    return FACTOR * helper(x) + made + len(LIST)

table = fb.sweep(study, GRID, setup=setup, file="rows.jsonl", workers=1, progress=False)
"""


def run_edited(monkeypatch: pytest.MonkeyPatch, *edits: str, xs: tuple[int, ...] = (1, 2)) -> Any:
    """Run the script in this process after edits, as from a file."""
    source = EDITED
    for edit in edits:
        old, new = edit.split(" -> ")
        assert old in source
        source = source.replace(old, new)
    name = f"study{len(sys.modules)}.py"
    linecache.cache[name] = (len(source), None, source.splitlines(keepends=True), name)
    module = types.ModuleType("__main__")
    monkeypatch.setitem(sys.modules, "__main__", module)
    vars(module)["GRID"] = {"x": list(xs)}
    exec(compile(source, name, "exec"), vars(module))
    return vars(module)["table"]["result"].tolist()


@pytest.mark.parametrize(
    "edit",
    ["FACTOR * helper -> 3 * helper", "x + 1 -> x + 2", "return 5 -> return 6", "= 2 -> = 3",
     "[1, 2] -> [1, 2, 3]"],
)  # fmt: skip
def test_an_edit_of_a_function_or_of_what_it_uses_is_noticed(
    edit: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    first = run_edited(monkeypatch)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # comments and formatting are not edits
        assert run_edited(monkeypatch, "return 5 -> return (5)  # five") == first
    for _ in range(2):  # as long as the file has old rows
        with warns(SimulationWarning, "study", "rows.jsonl", 2):
            assert run_edited(monkeypatch, edit, xs=(1, 2, 3))[:2] == first
    (tmp_path / "rows.jsonl").unlink()
    assert run_edited(monkeypatch, edit) != first


def test_a_larger_grid_runs_the_points_that_are_missing(tmp_path: Path) -> None:
    def counted(x: float, name: str, folder: str) -> float:
        with open(f"{folder}/calls", "a") as calls:
            calls.write(f"{x}{name} ")
        return 2 * x

    file, folder = tmp_path / "rows.jsonl", [str(tmp_path)]
    sweep = partial(fb.sweep, counted, file=file, workers=1, progress=False)
    sweep({"x": [1, 3], "name": ["a"], "folder": folder})
    table = sweep({"name": ["a", "b"], "folder": folder, "x": [1, 2, 3]})
    assert (tmp_path / "calls").read_text().split() == ["1a", "3a", "2a", "1b", "2b", "3b"]
    assert table["result"].tolist() == [2, 4, 6] * 2 and table.index.tolist() == [*range(6)]
    smaller = sweep([{"x": 3, "name": "a", "folder": folder[0]}] * 2)  # each row is used once
    assert smaller["result"].tolist() == [6, 6] and smaller.columns[0] == "x"
    assert (tmp_path / "calls").read_text().split()[6:] == ["3a"]
    assert len(read_sweep(file)) == 7 and set(read_sweep(file)["x"]) == {1, 2, 3}


def test_other_files_are_refused_and_left_unchanged(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"

    def cube(x: float) -> float:
        return x**3

    first = fb.sweep(square, {"x": [1, 2.5]}, file=path, workers=1, progress=False)
    kept = path.read_bytes()
    for function, grid, named in (
        (cube, {"x": [1, 2.5]}, ("square", "cube")),
        (lambda x, y: x, {"x": [1], "y": [2]}, ("x", "y")),
    ):
        function.__qualname__ = function.__qualname__.replace("<lambda>", "square")
        with raises(InputError, "rows.jsonl", *named):
            fb.sweep(function, grid, file=path, progress=False)
    again = fb.sweep(square, {"x": [1, 2.5]}, file=path, progress=False)
    for table in (again, read_sweep(path)):
        assert_frame_equal(first, table, check_exact=True)
    assert path.read_bytes() == kept
    header, *lines = kept.splitlines(keepends=True)
    for content in (b"a diary", b"a diary\nof two\n", lines[0], header + b"[]\n"):
        path.write_bytes(content)
        with raises(InputError, "rows.jsonl"):
            fb.sweep(square, {"x": [1, 2.5]}, file=path, progress=False)
        assert path.read_bytes() == content
    os.mkfifo(tmp_path / "pipe")  # reading it would never end
    for odd in (str(tmp_path / "pipe"), str(tmp_path), "/dev/zero", "a\0b", 3):
        with raises(InputError, odd):
            fb.sweep(square, {"x": [1]}, file=odd, progress=False)
        with raises(InputError, odd):
            read_sweep(odd)
    with raises(InputError, "nowhere/rows.jsonl"):
        fb.sweep(square, {"x": [1]}, file=tmp_path / "nowhere" / "rows.jsonl", progress=False)
    with raises(InputError, "lambda"):
        fb.sweep(lambda x: x, {"x": [1]}, file=path, progress=False)


# fmt: off
WRONG_ARGUMENTS = [
    (3, {"x": [1]}, {}, ["sweep", 3]),
    (square, {}, {}, ["grid"]),
    (square, [], {}, ["grid"]),
    (square, {"x": []}, {}, ["grid", "x"]),
    (square, {"x": 1.0}, {}, ["grid", "x", 1.0]),
    (square, [{"x": 1}, 2], {}, ["grid", 2]),
    (square, {"error": [1]}, {}, ["error"]),
    (square, {"y": [1]}, {}, ["grid", "y", "square", "x"]),
    (square, [{"x": 1}, {"x": 1, "y": 1}], {}, ["grid", "x", "y", "square"]),
    (square, {"x": [square]}, {}, ["x", "function"]),
    (square, {"x": [1]}, {"workers": 0}, ["workers", 0]),
    (square, {"x": [1]}, {"workers": 1.5}, ["workers", 1.5]),
    (square, {"x": [1]}, {"workers": 1, "cluster": "tcp://127.0.0.1:1"}, ["workers", "cluster"]),
    (square, {"x": [1]}, {"cluster": "nowhere", "progress": False}, ["scheduler", "nowhere"]),
    (square, {"x": [1]}, {"setup": 3}, ["setup", 3]),
]
# fmt: on


@pytest.mark.parametrize("function, grid, options, named", WRONG_ARGUMENTS)
def test_wrong_arguments_are_reported_before_a_process_starts(
    function: Any, grid: Any, options: Any, named: list[Any], capfd: pytest.CaptureFixture[str]
) -> None:
    with raises(InputError, *named):
        fb.sweep(function, grid, **options)
    assert capfd.readouterr().err == ""


class WithoutText(Exception):
    def __str__(self) -> str:
        sys.exit("no text")


class OfTwo(Exception):  # cannot be pickled in Python's way, which passes its text alone
    def __init__(self, first: int, second: int):
        super().__init__(f"{first} {second}")


class Locked(BaseException):
    def __init__(self) -> None:
        super().__init__("locked")
        self.lock = threading.Lock()  # cannot be pickled


# what raises; type and text that arrive
RAISED = {
    "without text": (WithoutText, WithoutText, None),
    "two arguments": (partial(OfTwo, 1, 2), SimulationError, "OfTwo: 1 2"),
    "no exception of a program": (Locked, SimulationError, "Locked: locked"),
    "of the system": (partial(OSError, 2, "nope", "a.txt"), FileNotFoundError, "a.txt"),
    "ends a loop": (partial(StopIteration, 3), StopIteration, "3"),
}


def test_an_exception_of_user_code_arrives_whatever_it_is() -> None:
    def raising(name: str) -> None:
        raise RAISED[name][0]()

    table = fb.sweep(raising, {"name": list(RAISED)}, workers=1, progress=False)
    for name, text in zip(table["name"], table["error"], strict=True):
        make, kind, wanted = RAISED[name]
        assert text.startswith(type(make()).__name__)
        assert (wanted or "text").rpartition(": ")[2] in text
        with pytest.raises(kind, match=wanted) as caught:
            setup = partial(raising, name)
            fb.sweep(lambda made, x: x, {"x": [0]}, setup=setup, workers=1, progress=False)
        assert caught.type is kind and "in raising" in caught.value.__notes__[-1]


def test_the_bar_counts_points_and_failures_and_can_be_switched_off(
    capfd: pytest.CaptureFixture[str],
) -> None:
    table = fb.sweep(lambda x: sys.exit(f"no {x}") if x == 1 else x, {"x": [0, 1, 2]}, workers=1)
    bar = capfd.readouterr().err
    assert "3/3" in bar and "failed=1" in bar
    assert table["error"][1] == "SystemExit: no 1" and table["error"].isna().tolist() == [1, 0, 1]
    with pytest.raises(ZeroDivisionError):
        fb.sweep(lambda made, x: x, {"x": [0]}, setup=lambda: 1 / 0, workers=1, progress=False)
    with raises(SimulationError):
        fb.sweep(killer, {"x": [0]}, workers=1, progress=False)
    assert capfd.readouterr().err == ""
