"""Find what leaks or breaks after many repetitions: a table, and exit code 1 if something does.

    python benchmarks/soak.py                       all soaks: about 10 minutes
    python benchmarks/soak.py rollouts walking      some of them
    python benchmarks/soak.py rollouts --times 20   so many times

Each soak runs in its own process. A straight line is fitted through its memory, threads and open
file descriptors after the warm-up. The rise of this line is what counts.
"""

import gc
import multiprocessing
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing, contextmanager, suppress
from itertools import cycle
from typing import NamedTuple

import harness
import numpy as np
import psutil
import tick

import floatbase as fb
from floatbase.behaviours import Gait, Walk
from floatbase.errors import InfeasibleError
from floatbase.simulation import LiveSimulation

# largest rises: the allocator keeps freed memory for later, and a connection takes time to close
LIMITS = {"memory, MB": 8.0, "threads": 1.0, "descriptors": 2.0}
SAMPLES = 40  # of the three, after the warm-up
PACE = 0.97  # fraction of real time that a live picture keeps
Soak = Iterator[Callable[[], object]]  # yields a function that does it once


def steps(controller: fb.WholeBodyController, spread: float) -> Soak:
    """Control steps at random states."""
    at = cycle(harness.states(controller.robot, 1000, spread))
    yield lambda: controller(*next(at))


def ticks() -> Soak:
    return steps(tick.controller(fb.load("go2")), 0.1)


def own() -> Soak:
    """Control steps with a user-defined task and a user-defined bound."""
    robot = fb.load("go2")
    at, feet = robot.standing(), fb.Contacts.feet(robot)
    tasks = [tick.OwnCoM(at.com), *fb.standing_tasks(at)]
    bound = {"max_normal_force": {"FL_foot": lambda t: 40.0}}
    return steps(fb.WholeBodyController(robot, feet, tasks, backend="compiled", **bound), 0.05)


def infeasible() -> Soak:
    """Control steps with limits that no motion can meet."""
    controller = tick.controller(fb.load("go2"), min_normal_force=500.0)
    at = cycle(harness.states(controller.robot, 100, 0.02))

    def step() -> None:
        with suppress(InfeasibleError):
            controller(*next(at))
            raise AssertionError("500 N at every foot were found possible")

    yield step


def rollouts() -> Soak:
    """A new simulation, and 50 ms in it."""
    robot = fb.load("go2")
    controller = tick.controller(robot)

    def step() -> None:
        run = fb.rollout(fb.Simulation(robot), controller, duration=0.05)
        assert run.outcome == "completed", f"a rollout ended with: {run.outcome}"

    yield step


def walking() -> Soak:
    """A second of go2's trot in a live picture, each at another velocity."""
    robot = fb.load("go2")
    walk = Walk(robot, fb.Contacts.feet(robot, mu=0.6), Gait.trot(robot))
    rng, paces = np.random.default_rng(0), list[float]()
    with closing(fb.Viewer(robot)) as view:
        run = LiveSimulation(
            fb.Simulation(robot),
            walk,
            lambda record: view.show(record.final, record.contacts, record.measured[-1]),
        )

        def step() -> None:
            walk.velocity = rng.uniform([-0.1, -0.1], [0.4, 0.1])
            begin, clock = run.sim.time, time.monotonic()
            run.start()
            time.sleep(1.0)
            paces.append((run.sim.time - begin) / (time.monotonic() - clock))
            assert run.status == "running", f"the walk ended: {run.status} {run.reason}"

        yield step
        run.close()
    assert np.median(paces) >= PACE, f"it reaches {np.median(paces):.0%} of real time"


def viewers() -> Soak:
    """A viewer that is opened, draws, and is closed."""
    robot = fb.load("go2")

    def step() -> None:
        with closing(fb.Viewer(robot)) as view:
            view.show(robot.standing())

    yield step


SOAKS: dict[str, tuple[Callable[[], Soak], int]] = {  # and how many times
    "ticks": (ticks, 1_000_000),
    "own": (own, 1_000_000),
    "infeasible": (infeasible, 2_000),
    "rollouts": (rollouts, 2_000),
    "walking": (walking, 300),
    "viewers": (viewers, 200),
}


class Row(NamedTuple):
    """One soak; `rises` are those of memory, threads and descriptors."""

    name: str
    times: int
    seconds: float
    rises: tuple[float, ...]
    broken: str


def measure() -> tuple[float, ...]:
    gc.collect()
    process = psutil.Process()
    return process.memory_info().rss / 1e6, process.num_threads(), process.num_fds()


def run(name: str, times: int) -> Row:
    """Do a soak so many times; the first tenth is the warm-up."""
    start, faults, samples = time.perf_counter(), list[str](), {0: measure()}
    ends = set(np.linspace(max(1, times // 10), times, SAMPLES + 1).astype(int).tolist())
    try:
        with contextmanager(SOAKS[name][0])() as step:
            for done in range(1, times + 1):
                step()
                if done in ends:
                    samples.pop(0, None)
                    samples[done] = measure()
    except AssertionError as error:
        faults.append(str(error))
    done = np.array([*samples])
    slopes = np.polyfit(done, [*samples.values()], 1)[0] if len(done) > 1 else np.zeros(3)
    rises = tuple(float(slope * np.ptp(done)) for slope in slopes)
    for (what, limit), rise in zip(LIMITS.items(), rises, strict=True):
        if rise > limit:
            faults.append(f"{what}: +{rise:.1f}")
    return Row(name, times, time.perf_counter() - start, rises, "; ".join(faults))


def main() -> int:
    """Run soaks and print the table. Return 1 if anything leaks or breaks."""
    parser = harness.command_line(__doc__, times=(0, "repetitions; 0 for those of each soak"))
    parser.add_argument("soaks", nargs="*", choices=[*SOAKS, []], help="all by default")
    options = parser.parse_args()
    names = options.soaks or list(SOAKS)
    times = [options.times or SOAKS[name][1] for name in names]
    context, rows = multiprocessing.get_context("spawn"), list[Row]()

    def cells() -> Iterator[list[object]]:
        with ProcessPoolExecutor(1, context, max_tasks_per_child=1) as processes:
            for row in processes.map(run, names, times):
                rows.append(row)
                rises = [f"{rise:+.1f}" for rise in row.rises]
                yield [row.name, row.times, f"{row.seconds:.0f}", *rises, row.broken or "holds"]

    limits = " | ".join(f"{what}: rise (≤ {limit:g})" for what, limit in LIMITS.items())
    harness.table(f"soak | times | s | {limits} | ", cells())
    return int(any(row.broken for row in rows))


if __name__ == "__main__":
    sys.exit(main())
