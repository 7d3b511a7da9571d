"""A sweep gives one table, for any number of workers, anywhere, and however often it was killed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from messages import missing, raises
from pandas.testing import assert_frame_equal

import floatbase as fb
from floatbase.errors import InputError, SimulationError
from floatbase.simulation import read_sweep

GRID = {"n": [1, 2, 3, 4, 5], "scale": np.array([0.1, 0.3])}
# leaves a mark for every call, so that calls can be counted; it is run as a script, so its function
# is sent by value
SCRIPT = """
import os, sys, time
import floatbase as fb

def marked(i):
    with open("calls", "a") as calls:
        calls.write(f"{i}\\n")
    time.sleep(0.02)
    return i / 7

table = fb.sweep(marked, {"i": list(range(60))}, file="marked.jsonl", workers=2, progress=False)
print(table.shape, *table.columns)
"""


def spectrum(n: int, scale: float) -> dict[str, Any]:
    """Return floats that depend on the last bits, and an array; raise an error at two points."""
    matrix = scale * np.vander(np.linspace(0.1, 1.7, 40), 40)[:, -20:]
    if n == 3:
        raise ValueError(f"no {n} here")
    return {
        "values": np.linalg.svd(matrix)[1][:n],
        "sum": np.float32(matrix.sum()),
        "process": os.getpid(),
    }


def assert_same_results(*tables: pd.DataFrame) -> None:
    """Check that tables are equal to the last bit, except for their process ids."""
    for table in tables[1:]:
        first, other = (each.drop(columns="process") for each in (tables[0], table))
        assert_frame_equal(first, other, check_exact=True)


def assert_marked(table: pd.DataFrame) -> None:
    """Check the complete table of `SCRIPT`."""
    assert list(table.columns) == ["i", "result", "error"] and table["error"].isna().all()
    assert (
        table["result"].tolist() == [i / 7 for i in range(60)] and (table["i"] == table.index).all()
    )


def test_the_table_is_the_same_for_one_worker_and_for_two() -> None:
    one, two = (fb.sweep(spectrum, GRID, workers=w, progress=False) for w in (1, 2))
    assert_same_results(one, two)
    assert list(one.columns) == ["n", "scale", "values", "sum", "process", "error"]
    assert one["n"].tolist() == [1, 1, 2, 2, 3, 3, 4, 4, 5, 5] and one["scale"][1] == 0.3
    assert one["error"].dropna().tolist() == 2 * ["ValueError: no 3 here"]
    assert np.flatnonzero(one["sum"].isna()).tolist() == [4, 5] and len(one["values"][9]) == 5
    assert one["process"].nunique() == 1 and os.getpid() not in one["process"].tolist()


@pytest.mark.front_end
def test_a_killed_sweep_goes_on_where_it_was(tmp_path: Path) -> None:
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
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert said == "(60, 3) i result error\n"
    assert_marked(read_sweep(rows))
    assert (
        rows.read_bytes().count(b"\n") == 61
    )  # no point has two lines, and the incomplete line is gone
    calls = (tmp_path / "calls").read_text().split()
    assert set(calls) == {str(i) for i in range(60)}
    assert len(calls) - 60 <= 2 * 2  # for each of two workers, its present point and the next


def test_a_sweep_that_resumes_computes_failed_points_again(tmp_path: Path) -> None:
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
    second = fb.sweep(root, grid, file=file, workers=1, progress=False)
    assert second["result"].tolist() == [0.0, 1.0, 2.0] and second["error"].isna().all()
    assert (tmp_path / "calls").read_text() == "0141"
    assert_frame_equal(read_sweep(file), second)


def test_a_file_that_takes_no_more_is_told_and_the_sweep_goes_on_when_it_does(
    tmp_path: Path,
) -> None:
    script = tmp_path / "script.py"
    limit = (
        "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (400, -1))  # bytes, of a "
        "file: a disc that is full"
    )
    script.write_text(f"{limit}\n{SCRIPT}")
    command = [sys.executable, "script.py"]
    full = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    kept = read_sweep(tmp_path / "marked.jsonl")
    assert full.returncode == 1 and 0 < len(kept) < 60
    assert not missing(full.stderr.splitlines()[-1], "InputError", "marked.jsonl", "File too large")
    assert (tmp_path / "marked.jsonl").stat().st_size == 400, "the last row was written in part"
    script.write_text(SCRIPT)
    before = len((tmp_path / "calls").read_text().split())
    subprocess.run(command, cwd=tmp_path, capture_output=True, check=True)
    assert_marked(read_sweep(tmp_path / "marked.jsonl"))
    assert len((tmp_path / "calls").read_text().split()) - before == 60 - len(kept)


def test_a_sweep_that_fails_in_one_thread_leaves_that_of_another_alone(tmp_path: Path) -> None:
    def patient(made: None, i: int) -> int:
        (tmp_path / "begun").touch()
        until = time.monotonic() + 60.0
        while not (tmp_path / "failed").exists() and time.monotonic() < until:
            time.sleep(0.02)
        return i

    def setup() -> None:
        with (tmp_path / "setups").open("a") as setups:
            setups.write("x")

    with ThreadPoolExecutor(1) as thread:
        running = thread.submit(
            fb.sweep, patient, {"i": [0, 1, 2, 3]}, setup=setup, workers=1, progress=False
        )
        while not (tmp_path / "begun").exists() and not running.done():
            time.sleep(0.02)
        with raises(InputError, "result", "object"):
            fb.sweep(lambda i: object(), {"i": [0, 1]}, workers=1, progress=False)
        (tmp_path / "failed").touch()
        assert list(running.result()["result"]) == [0, 1, 2, 3]
    assert (tmp_path / "setups").read_text() == "x"


@pytest.mark.front_end
def test_workers_of_a_dask_cluster_give_the_same_table() -> None:
    distributed = pytest.importorskip(
        "distributed", reason="Dask is not installed: pip install floatbase[cluster]"
    )

    def power(made: float, n: int, scale: float) -> dict[str, Any]:
        if n == 2:
            raise ArithmeticError("two")
        return {"value": (made * scale) ** n, "process": os.getpid()}

    def setup() -> float:
        return 1.1

    here = fb.sweep(power, GRID, setup=setup, workers=1, progress=False)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None
    ) as cluster:
        workers = {worker.pid for worker in cluster.workers.values()}
        by_address = fb.sweep(
            power, GRID, setup=setup, cluster=cluster.scheduler_address, progress=False
        )
        with distributed.Client(cluster) as client:
            by_client = fb.sweep(power, GRID, setup=setup, cluster=client, progress=False)
            with raises(InputError, "result", "object"):
                fb.sweep(lambda n: object(), {"n": [1, 2]}, cluster=client, progress=False)
            cluster.scheduler.allowed_failures = 0  # otherwise it retries three times
            with raises(SimulationError, "KilledWorker"):
                fb.sweep(
                    lambda n: os.kill(os.getpid(), 9), {"n": [1]}, cluster=client, progress=False
                )
        with raises(InputError, "Dask"):
            fb.sweep(power, GRID, setup=setup, cluster=client, progress=False)
    assert_same_results(here, by_address, by_client)
    assert here["error"].notna().sum() == 2
    found = set(by_address["process"].dropna())
    assert found <= workers and os.getpid() not in found


def test_a_file_of_something_else_is_refused_and_left_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"

    def square(x: float) -> float:
        return x * x

    def cube(x: float) -> float:
        return x**3

    first = fb.sweep(square, {"x": [1, 2.5]}, file=path, workers=1, progress=False)
    kept = path.read_bytes()
    for function, grid, named in (
        (cube, {"x": [1, 2.5]}, ("square", "cube")),
        (square, {"x": [1, 2.5, 3]}, (2, 3)),
        (square, {"x": [1, 2.6]}, ()),
    ):
        with raises(InputError, "rows.jsonl", *named):
            fb.sweep(function, grid, file=path, progress=False)
    for again in (
        fb.sweep(square, {"x": [1, 2.5]}, file=path, progress=False),
        read_sweep(path),
    ):
        assert_frame_equal(first, again, check_exact=True)
    assert path.read_bytes() == kept
    for content in ("a diary", "a diary\nof two lines\n", json.dumps({"point": 0}) + "\n"):
        path.write_text(content)
        with raises(InputError, "rows.jsonl"):
            fb.sweep(square, {"x": [1, 2.5]}, file=path, progress=False)
        assert path.read_text() == content
    os.mkfifo(tmp_path / "pipe")  # reading it would never end
    for odd in (str(tmp_path / "pipe"), str(tmp_path), "/dev/zero", "a\0b"):
        with raises(InputError, odd):
            fb.sweep(square, {"x": [1]}, file=odd, progress=False)
        with raises(InputError, odd):
            read_sweep(odd)
    with raises(InputError, "nowhere/rows.jsonl"):
        fb.sweep(square, {"x": [1]}, file=tmp_path / "nowhere" / "rows.jsonl", progress=False)
    with raises(InputError, "lambda"):
        fb.sweep(lambda x: x, {"x": [1]}, file=path, progress=False)
    with raises(InputError, "file", 3):
        fb.sweep(square, {"x": [1]}, file=3, progress=False)


def test_what_does_not_fit_is_told_before_any_process_is_started(
    capfd: pytest.CaptureFixture[str],
) -> None:
    def square(x: float) -> float:
        return x * x

    for function, grid, options, *named in (
        (3, {"x": [1]}, {}, "sweep", 3),
        (square, {}, {}, "grid"),
        (square, [], {}, "grid"),
        (square, {"x": []}, {}, "grid", "x"),
        (square, {"x": 1.0}, {}, "grid", "x", 1.0),
        (square, [{"x": 1}, 2], {}, "grid", 2),
        (square, {"error": [1]}, {}, "error"),
        (square, {"y": [1]}, {}, "grid", "y", "square", "x"),
        (square, [{"x": 1}, {"x": 1, "y": 1}], {}, "grid", "x", "y", "square"),
        (square, {"x": [square]}, {}, "x", "function"),
        (square, {"x": [1]}, {"file": 3.5}, "file", 3.5),
        (square, {"x": [1]}, {"workers": 0}, "workers", 0),
        (square, {"x": [1]}, {"workers": 1.5}, "workers", 1.5),
        (square, {"x": [1]}, {"workers": 1, "cluster": "tcp://127.0.0.1:1"}, "workers", "cluster"),
        (square, {"x": [1]}, {"setup": 3}, "setup", 3),
    ):
        with raises(InputError, *named):
            fb.sweep(function, grid, **options)
    assert capfd.readouterr().err == ""


def test_a_function_that_ends_its_program_ends_its_point_only() -> None:
    table = fb.sweep(
        lambda x: sys.exit(f"no {x}") if x == 1 else x, {"x": [0, 1, 2]}, workers=1, progress=False
    )
    assert table["error"][1] == "SystemExit: no 1" and table["error"].isna().tolist() == [1, 0, 1]


def test_the_bar_counts_points_and_failures_and_can_be_switched_off(
    capfd: pytest.CaptureFixture[str],
) -> None:
    fb.sweep(lambda x: 1 / x, {"x": [0, 1]}, workers=1)
    bar = capfd.readouterr().err
    assert "2/2" in bar and "failed=1" in bar
    with raises(InputError, "result", "x"):
        fb.sweep(lambda x: {"x": x}, {"x": [0, 1]}, workers=1, progress=False)
    with pytest.raises(ZeroDivisionError):
        fb.sweep(lambda made, x: x, {"x": [0]}, setup=lambda: 1 / 0, workers=1, progress=False)
    with raises(SimulationError):
        fb.sweep(lambda x: os.kill(os.getpid(), 9), {"x": [0]}, workers=1, progress=False)
    assert capfd.readouterr().err == ""
