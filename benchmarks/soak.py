"""What leaks, slows down or breaks after many times: one command, a table, and exit code 1 when
something does.

    python benchmarks/soak.py                       all of `SOAKS`: 10 to 20 minutes
    python benchmarks/soak.py ticks kills           some of them
    python benchmarks/soak.py viewers --times 20    so many times

Each runs in a process of its own. What counts is by how much a straight line through its memory,
threads and open descriptors rises after the warm-up, and whether what it looks at holds.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import gc
import multiprocessing
import socket
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing, contextmanager, suppress
from itertools import count, cycle
from typing import Any, NamedTuple

import numpy as np
import psutil
from soak_kills import kills, sweeps

import floatbase as fb
from floatbase.behaviours import Gait, Walk
from floatbase.control import LinearInequality
from floatbase.dynamics import EquationsOfMotion
from floatbase.simulation import LiveSimulation

# how much may stay in all: MB, because the allocator keeps freed memory for later; and a connection
# that is being closed
LIMITS = {"memory, MB": 8.0, "threads": 1.0, "descriptors": 2.0}
SAMPLES = 40  # of the three, after the warm-up
# times as long as without pages; a call that waits for a page takes a thousand times as long
SLOWED = 3.0
# of real time that a live picture keeps, but for the slice under way when the clock is read
PACE = 0.97
PATIENCE = 60.0  # s for what takes a moment

Soak = Iterator[
    Callable[[], object]
]  # yields a function that does it once; what does not hold is an AssertionError


# controller and simulation ------------------------------------------------------------------------


def stander(robot: fb.Robot, **options: Any) -> fb.WholeBodyController:
    return fb.WholeBodyController(
        robot, fb.Contacts.feet(robot), fb.standing_tasks(robot.standing()), **options
    )


def ticks() -> Soak:
    """The controller at states around standing."""
    robot = fb.load("go2")
    controller, states = (
        stander(robot),
        cycle([robot.random_state(seed, 0.1) for seed in range(1000)]),
    )

    def step() -> None:
        state = next(states)
        controller(state.q, state.v)

    yield step


class Height:
    """A user-defined task: the height of the centre of mass."""

    name, weight, block = "height", 10.0, "qdd"

    def __init__(self, height: float) -> None:
        self.height = height

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> fb.Affine:
        s = eom.state
        desired = 100.0 * (self.height - s.com[2:]) - 20.0 * s.com_velocity[2:]
        return fb.Affine(s.com_jacobian[2:], s.com_drift[2:] - desired)


def own() -> Soak:
    """The controller with a task, rows and a user-defined bound."""
    robot = fb.load("go2")
    at, contacts = robot.standing(), fb.Contacts.feet(robot)
    inequality = LinearInequality(
        "acceleration", "qdd", lambda eom, t: (np.eye(eom.nv)[6:], np.full(eom.d, 50.0))
    )
    options: dict[str, Any] = {
        "inequalities": [inequality],
        "max_normal_force": {"FL_foot": lambda t: 40.0},
        "backend": "compiled",
    }
    controller = fb.WholeBodyController(
        robot, contacts, [Height(at.com[2]), *fb.standing_tasks(at)], **options
    )
    states = cycle([robot.random_state(seed, 0.05) for seed in range(1000)])

    def step() -> None:
        state = next(states)
        controller(state.q, state.v)

    yield step


def infeasible() -> Soak:
    """The controller with limits that no motion can meet: it answers with an error that names the
    rows in conflict.
    """
    robot = fb.load("go2")
    controller = stander(robot, min_normal_force=500.0)
    states = cycle([robot.random_state(seed, 0.02) for seed in range(100)])

    def step() -> None:
        state = next(states)
        with suppress(fb.InfeasibleError):
            controller(state.q, state.v)
            raise AssertionError("500 N at every foot were found possible")

    yield step


def rollouts() -> Soak:
    """A new simulation, and 50 ms in it."""
    robot = fb.load("go2")
    controller = stander(robot)

    def step() -> None:
        outcome = fb.rollout(fb.Simulation(robot), controller, duration=0.05).outcome
        if outcome != "completed":
            raise AssertionError(f"a rollout ended with: {outcome}")

    yield step


def walking() -> Soak:
    """A second of go2's trot in a live picture, another velocity in each, and now and then a push;
    it must keep real time.
    """
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
            walk.velocity, walk.yaw_rate = (
                rng.uniform([-0.1, -0.1], [0.4, 0.1]),
                rng.uniform(-0.3, 0.3),
            )
            if rng.uniform() < 0.2:
                angle = rng.uniform(0.0, 2.0 * np.pi)
                run.push(60.0 * np.array([np.cos(angle), np.sin(angle), 0.0]))
            begin, clock = run.sim.time, time.monotonic()
            run.start()
            time.sleep(1.0)
            paces.append((run.sim.time - begin) / (time.monotonic() - clock))
            if run.status != "running":
                raise AssertionError(f"the walk ended: {run.status} {run.reason}")

        yield step
        run.close()
    if np.median(paces) < PACE:
        raise AssertionError(f"it reaches {np.median(paces):.0%} of real time")


# viewer -------------------------------------------------------------------------------------------


def viewer() -> Soak:
    """A picture that changes, while two pages never read. When the viewer has dropped them, others
    come.
    """
    robot = fb.load("go2")
    home, contacts, numbers = robot.standing(), fb.Contacts.points(robot), count()
    forces = 0.25 * robot.weight * np.tile([0.1, 0.0, 1.0], (4, 1))
    spent: deque[float] = deque(maxlen=10_000)
    pages: list[socket.socket] = []

    def draw() -> None:
        start = time.perf_counter()
        view.show(home, contacts, (1.0 + 0.1 * np.sin(next(numbers))) * forces)
        spent.append(time.perf_counter() - start)

    def step() -> None:
        if view.window.n_pages < 2:
            close(pages)
            wait_for(lambda: view.window.n_pages == 0, "a page that was closed stays connected")
            pages.extend(sleeper(view.window.port) for _ in range(2))
            wait_for(lambda: view.window.n_pages == 2, "a page cannot connect")
        draw()

    with closing(fb.Viewer(robot)) as view:
        for _ in range(300):
            draw()
        alone = 1e6 * np.median(list(spent)[100:])
        spent.clear()
        yield step
        slow = 1e6 * np.median(spent)
        if slow > SLOWED * alone:
            raise AssertionError(
                f"pages that never read slow a picture down from {alone:.0f} to {slow:.0f} µs"
            )
        close(pages)


def viewers() -> Soak:
    """A viewer that is opened, seen by a page, and closed."""
    robot = fb.load("go2")
    home = robot.standing()

    def step() -> None:
        with closing(fb.Viewer(robot)) as view:
            page = sleeper(view.window.port)
            view.show(home)
            wait_for(lambda: view.window.n_pages == 1, "a page cannot connect")
        page.close()
        with suppress(OSError):
            socket.create_connection(("127.0.0.1", view.window.port), timeout=2).close()
            raise AssertionError(f"port {view.window.port} answers after its viewer was closed")

    yield step


def sleeper(port: int) -> socket.socket:
    """A page that connects and never reads."""
    page = socket.create_connection(("127.0.0.1", port))
    page.sendall(
        f"GET /socket HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: "
        f"Upgrade\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
    )
    return page


def close(pages: list[socket.socket]) -> None:
    while pages:
        pages.pop().close()


def wait_for(condition: Callable[[], bool], otherwise: str) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError(otherwise)
        time.sleep(0.001)


# all of them --------------------------------------------------------------------------------------

# what is done, and how many times
SOAKS: dict[str, tuple[Callable[[], Soak], int]] = {
    "ticks": (ticks, 1_000_000),
    "own": (own, 1_000_000),
    "infeasible": (infeasible, 2_000),
    "rollouts": (rollouts, 2_000),
    "walking": (walking, 300),
    "viewer": (viewer, 100_000),
    "viewers": (viewers, 200),
    "kills": (kills, 200),
    "sweeps": (sweeps, 200),
}


class Row(NamedTuple):
    """One soak. values: of memory, threads and descriptors at the end. growth: of each. broken:
    what does not hold.
    """

    name: str
    times: int
    seconds: float
    values: tuple[float, ...]
    growth: tuple[float, ...]
    broken: str


def measure(done: int) -> tuple[float, ...]:
    gc.collect()
    process = psutil.Process()
    return done, process.memory_info().rss / 1e6, process.num_threads(), process.num_fds()


def run(name: str, times: int) -> Row:
    """Do a soak so many times; the first tenth is the warm-up."""
    start, broken, samples = time.perf_counter(), "", list[tuple[float, ...]]()
    try:
        with contextmanager(SOAKS[name][0])() as step:
            ends = set(np.linspace(max(1, times // 10), times, SAMPLES + 1).astype(int).tolist())
            for done in range(1, times + 1):
                step()
                if done in ends:
                    samples.append(measure(done))
    except AssertionError as error:
        broken = str(error)
    done, *values = np.array(samples or [measure(0)]).T
    span = max(float(done[-1] - done[0]), 1.0)
    slopes = [np.polyfit(done, value, 1)[0] if len(done) > 1 else 0.0 for value in values]
    growth = tuple(float(span * slope) for slope in slopes)
    for (what, limit), much in zip(LIMITS.items(), growth, strict=True):
        if much > limit:
            broken = "; ".join(filter(None, [broken, f"{what}: +{much:.1f}"]))
    return Row(
        name,
        times,
        time.perf_counter() - start,
        tuple(float(value[-1]) for value in values),
        growth,
        broken,
    )


def table(rows: list[Row]) -> Iterator[str]:
    yield (
        "| soak | times | s | "
        + " | ".join(f"{what}: end, rise (≤ {limit:g})" for what, limit in LIMITS.items())
        + " | |"
    )
    yield "|---" * (4 + len(LIMITS)) + "|"
    for row in rows:
        numbers = " | ".join(
            f"{end:.0f}, {much:+.1f}" for end, much in zip(row.values, row.growth, strict=True)
        )
        yield (
            f"| {row.name} | {row.times} | {row.seconds:.0f} | {numbers} | "
            f"{row.broken or 'holds'} |"
        )


def main(arguments: list[str] | None = None) -> int:
    """Run what is asked for and print the table. Returns 1 if anything leaks or breaks, else 0."""
    ask = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    ask.add_argument(
        "soaks", nargs="*", metavar="soak", help=f"of {', '.join(SOAKS)}; all without any"
    )
    ask.add_argument("--times", type=int, help="do each so many times")
    options = ask.parse_args(arguments)
    if unknown := set(options.soaks) - set(SOAKS):
        ask.error(f"there is no soak {', '.join(unknown)}; there are {', '.join(SOAKS)}")
    names = options.soaks or list(SOAKS)
    rows = []
    with ProcessPoolExecutor(
        1, multiprocessing.get_context("spawn"), max_tasks_per_child=1
    ) as processes:
        for row in processes.map(run, names, [options.times or SOAKS[name][1] for name in names]):
            print(f"{row.name}: {row.broken or 'holds'}, {row.seconds:.0f} s", flush=True)
            rows.append(row)
    print("\n".join(["", *table(rows)]))
    return int(any(row.broken for row in rows))


if __name__ == "__main__":
    sys.exit(main())
