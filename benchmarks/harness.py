"""What benchmarks share: command lines, the machine, times, tables, pages, and walking robots.

It is imported before numpy, because a benchmark uses one thread.
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import platform
import time
from collections.abc import Callable, Iterable, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np

import floatbase as fb
from floatbase.simulation import Rollout

ROBOTS = ("go2", "solo12", "talos")
SPREADS = {"easy": 0.02, "medium": 0.1, "saturated": 0.3}  # of random states


def command_line(text: str | None, **numbers: tuple[int, str]) -> argparse.ArgumentParser:
    """Return a parser with an option for each number, of which a default and a help are given."""
    parser = argparse.ArgumentParser(
        description=text, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name, (default, meaning) in numbers.items():
        parser.add_argument(f"--{name}", type=int, default=default, help=f"{meaning} ({default})")
    return parser


def versions(*names: str) -> str:
    """Return names and versions of packages."""
    return ", ".join(f"{name} {version(name)}" for name in names)


def machine() -> str:
    """Describe the machine and the versions."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    models = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    cpu = models[0] if models else platform.processor() or platform.machine()
    packages = versions("numpy", "pin", "numba", "daqp", "mujoco")
    return (
        f"{cpu}, {os.cpu_count()} cores, one used; Python {platform.python_version()}, floatbase "
        f"{fb.__version__}, {packages}"
    )


# times --------------------------------------------------------------------------------------------


def clock(
    call: Callable[..., object],
    arguments: Sequence[tuple[object, ...]],
    now: Callable[[], int] = time.perf_counter_ns,
) -> np.ndarray:
    """Measure each call [µs]; now: a clock [ns]."""
    times = np.empty(len(arguments))
    for i, args in enumerate(arguments):
        start = now()
        call(*args)
        times[i] = 1e-3 * (now() - start)
    return times


def interleaved(
    calls: Sequence[Callable[..., object]], arguments: Sequence[tuple[object, ...]], rounds: int
) -> list[np.ndarray]:
    """Measure several functions alternately, so that other load affects all of them."""
    blocks = [[clock(call, arguments) for call in calls] for _ in range(rounds)]
    return [np.concatenate([block[i] for block in blocks]) for i in range(len(calls))]


def work(call: Callable[..., object], *arguments: object) -> float:
    """Measure the processor time of this thread in a call [s]."""
    start = time.thread_time()
    call(*arguments)
    return time.thread_time() - start


def microseconds(times: Iterable[float]) -> list[str]:
    """Return times [µs] as cells of a table."""
    return [f"{one:.1f} µs" for one in times]


# results ------------------------------------------------------------------------------------------


def table(header: str, rows: Iterable[Iterable[object]]) -> str:
    """Return a Markdown table, and print each row as soon as it is measured."""
    lines = [f"| {header} |", "|---" * len(header.split(" | ")) + "|"]
    print(*lines, sep="\n", flush=True)
    for row in rows:
        lines.append("| " + " | ".join(map(str, row)) + " |")
        print(lines[-1], flush=True)
    return "\n".join(lines)


def write(program: str, title: str, *parts: str) -> None:
    """Write paragraphs and tables into the Markdown file of a program."""
    path = Path(program).with_suffix(".md")
    path.write_text("\n\n".join([f"# {title}", *parts]) + "\n", encoding="utf-8")
    print(path)


# robots -------------------------------------------------------------------------------------------


def states(robot: fb.Robot, n: int, spread: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the same random configurations and velocities every time."""
    found = [robot.random_state(seed, spread) for seed in range(n)]
    return [(np.array(s.q), np.array(s.v)) for s in found]


def walker(name: str) -> tuple[fb.Robot, fb.Contacts]:
    """Return a robot that can walk, with friction 0.6 at its feet."""
    if name == "anymal_c":
        feet = ["LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT"]
        robot = fb.load(name, feet=feet, foot_radius=0.02)
    else:
        robot = fb.load(name)
    return robot, fb.Contacts.feet(robot, mu=0.6)


def tilt(run: Rollout) -> float:
    """Return the largest angle between the base and the vertical [°]."""
    return float(np.rad2deg(np.arccos(1.0 - 2.0 * (run.q[:, 3] ** 2 + run.q[:, 4] ** 2)).max()))


def velocity(run: Rollout, begin: float, end: float = np.inf) -> np.ndarray:
    """Return the mean horizontal velocity of the centre of mass between two times."""
    first, last = np.searchsorted(run.time, [begin, end]).clip(max=len(run) - 1)
    return (run.com[last, :2] - run.com[first, :2]) / (run.time[last] - run.time[first])
