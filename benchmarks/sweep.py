"""Ten thousand pushes of go2 as one sweep: `python benchmarks/sweep.py`.

Each push acts for 0.1 s on a go2 that stands, from another side and with another force, and is
watched for 0.6 s in all. The sweep runs with one worker, with two, and then again with two after it
was killed (SIGKILL) at a random moment; and on a Dask cluster of two processes on this machine
(left out without Dask). All tables must be equal, to the last bit. Times are of the whole sweep,
with the start of the processes. The points that were computed twice are counted by what the
function leaves in a file at each call, which costs microseconds.

Returns 1 if a table differs, if more is computed twice than the points in flight, or if two workers
are less than 1.8 times as fast as one, which is judged from 2000 points on: fewer are over before
the processes' start stops counting.
"""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import floatbase as fb
from floatbase.simulation import read_sweep

DURATION = 0.6  # s, of each run
LARGEST = 300.0  # N, of a push
RATIO = 1.8  # of the times with one and with two workers
ENOUGH = 2000  # points from which the ratio is judged
IN_FLIGHT = 2  # points for each worker


def grid(points: int) -> list[dict[str, float]]:
    """Directions and forces of the pushes; the same for the same number of points."""
    numbers = np.random.default_rng(0).uniform(size=(points, 2)) * [2 * np.pi, LARGEST]
    return [{"direction": direction, "force": force} for direction, force in numbers.tolist()]


def setup() -> tuple[fb.Simulation, fb.WholeBodyController]:
    """go2 with its controller."""
    robot = fb.load("go2")
    contacts = fb.Contacts.points(robot, mu=0.7)
    return fb.Simulation(robot), fb.WholeBodyController(
        robot, contacts, fb.standing_tasks(robot.standing())
    )


def push(made: Any, direction: float, force: float) -> dict[str, Any]:
    """One push: how it ended, and how far the centre of mass was at most, m."""
    sim, controller = made
    with open(os.environ["CALLS"], "ab", buffering=0) as calls:
        calls.write(b".")
    sim.reset()
    forces = [force * np.cos(direction), force * np.sin(direction), 0.0]
    run = fb.rollout(sim, controller, DURATION, [fb.Push(forces)])
    return {"outcome": run.outcome, "moved": np.linalg.norm(run.com - run.com[0], axis=1).max()}


def timed(points: int, **options: Any) -> tuple[pd.DataFrame, float]:
    """The sweep's table and its time, s."""
    start = time.perf_counter()
    return fb.sweep(push, grid(points), setup=setup, **options), time.perf_counter() - start


def killed(points: int, workers: int, path: Path, rows: int) -> int:
    """Run the sweep in a process of its own, kill it when a number of rows is in the file, and give
    the number found there.
    """
    command = [
        sys.executable,
        __file__,
        "--points",
        str(points),
        "--only",
        str(path),
        "--workers",
        str(workers),
    ]
    running = subprocess.Popen(command)
    while running.poll() is None and (not path.exists() or path.read_bytes().count(b"\n") <= rows):
        time.sleep(random.uniform(0.0, 0.05))
    running.kill()
    running.wait()
    return len(read_sweep(path))


def main(arguments: list[str] | None = None) -> int:
    """Print the times and compare the tables. Returns 1 if something is wrong, else 0."""
    parser = argparse.ArgumentParser(
        description="Ten thousand pushes, in one and in two processes, killed, and on Dask."
    )
    parser.add_argument("--points", type=int, default=10_000, help="how many pushes (10000)")
    parser.add_argument("--workers", type=int, default=2, help="to compare with one (2)")
    parser.add_argument("--only", type=Path, help="only sweep, into this file")
    options = parser.parse_args(arguments)
    n, workers = options.points, options.workers
    if options.only:
        timed(n, file=options.only, workers=workers, progress=False)
        return 0
    with tempfile.TemporaryDirectory() as folder:
        calls = Path(os.environ.setdefault("CALLS", f"{folder}/calls"))
        one, time_one = timed(n, workers=1)
        two, time_two = timed(n, workers=workers)
        per_second = n * DURATION / time_one
        print(f"1 worker   {time_one:8.1f} s, {per_second:.0f} times real time")
        print(f"{workers} workers  {time_two:8.1f} s, {time_one / time_two:.2f} times as fast")
        wrong = [] if two.equals(one) else [f"{workers} workers give another table"]
        if n >= ENOUGH and time_one / time_two < RATIO:
            wrong.append(f"{workers} workers are less than {RATIO} times as fast as one")

        calls.unlink()
        file = Path(folder) / "pushes.jsonl"
        before = killed(n, workers, file, random.randrange(n))
        resumed, took = timed(n, file=file, workers=workers)
        twice = len(calls.read_bytes()) - n
        print(
            f"killed with {before} of {n} rows, went on for {took:.1f} s; {twice} points computed "
            f"twice"
        )
        wrong += [] if resumed.equals(one) else ["the table of the killed sweep is another"]
        wrong += [] if twice <= IN_FLIGHT * workers else [f"{twice} points were computed twice"]

        try:
            from distributed import LocalCluster
        except ImportError:
            print('Dask: left out; pip install "floatbase[cluster]"')
        else:
            with LocalCluster(
                n_workers=workers, threads_per_worker=1, dashboard_address=None
            ) as cluster:
                on_dask, took = timed(n, cluster=cluster.scheduler_address)
            print(f"Dask       {took:8.1f} s")
            wrong += [] if on_dask.equals(one) else ["Dask gives another table"]
    fell, errors = (one["outcome"] == "fell").sum(), one["error"].notna().sum()
    print(f"{n} pushes of up to {LARGEST:g} N: {fell} ended in a fall, {errors} in an error")
    print("\n".join(wrong) or "all tables are equal")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
