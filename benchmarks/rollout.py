"""What `fb.rollout` costs beside the bare loop that keeps no record: one command, one table.

    python benchmarks/rollout.py             -> benchmarks/rollout.md
    python benchmarks/rollout.py --turns 10  fewer turns, for a quick look

The bare loop reads the state, asks the controller and advances the physics, and nothing else: no
check, no record, no look at whether the robot fell. Both take turns on one simulation and one
controller, so that a busy moment of the machine meets both. Ratios are to be trusted, microseconds
to be taken with salt.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import tick

import floatbase as fb

ROBOTS = ("go2", "solo12", "talos")
TICKS = 1000  # in a turn: a second


def bare(sim: fb.Simulation, controller: fb.WholeBodyController) -> None:
    """The loop alone."""
    for _ in range(TICKS):
        command = controller(sim.q, sim.v, sim.time)
        sim.advance(command.tau)


def recorded(sim: fb.Simulation, controller: fb.WholeBodyController) -> None:
    """The same with everything that a rollout checks and records."""
    run = fb.rollout(sim, controller, TICKS * sim.timestep)
    if run.outcome != "completed":
        raise SystemExit(f"{sim.robot.name}: {run.outcome}")


def tick_time(
    loop: Callable[[fb.Simulation, fb.WholeBodyController], None],
    sim: fb.Simulation,
    controller: object,
) -> float:
    """µs of the processor for each tick of a turn that starts from standing."""
    sim.reset()
    start = time.thread_time()
    loop(sim, controller)
    return 1e6 * (time.thread_time() - start) / TICKS


def row(name: str, turns: int) -> str:
    """One robot: medians over all turns, and the median of the ratios turn by turn."""
    robot = fb.load(name)
    controller, sim = tick.controller(robot), fb.Simulation(robot)
    times = np.array(
        [[tick_time(loop, sim, controller) for loop in (bare, recorded)] for _ in range(turns)]
    )
    each = " | ".join(
        f"{t:.1f} µs | {1e6 * sim.timestep / t:.1f} ×" for t in np.median(times, axis=0)
    )
    return f"| {name} | {each} | **{np.median(times[:, 0] / times[:, 1]):.2f}** |"


def main() -> None:
    ask = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    ask.add_argument("--turns", type=int, default=50, help="of each loop, for each robot")
    turns = ask.parse_args().turns
    lines = [
        "# The rollout, measured",
        "",
        f"`python benchmarks/rollout.py` on {tick.machine()}.",
        "",
    ]
    lines += [
        f"A robot stands on all its feet at 1 kHz, {TICKS} ticks a turn, {turns} turns of each "
        f"loop: time for each tick,"
    ]
    lines += [
        "and times real time. The ratio is the rollout's speed as a part of the bare loop's.",
        "",
    ]
    lines += [
        "| robot | bare loop | × real time | `fb.rollout` | × real time | ratio |",
        "|---" * 6 + "|",
    ]
    print("\n".join(lines), flush=True)
    for name in ROBOTS:
        lines.append(row(name, turns))
        print(lines[-1], flush=True)
    (Path(__file__).parent / "rollout.md").write_text("\n".join([*lines, ""]), encoding="utf-8")


if __name__ == "__main__":
    main()
