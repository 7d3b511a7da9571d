"""Compare the computing time of `fb.rollout` with that of a bare loop without a record.

    python benchmarks/rollout.py             -> benchmarks/rollout.md
    python benchmarks/rollout.py --turns 10  fewer runs, for a quick look

The bare loop reads the state, calls the controller and advances the physics. It has no checks, no
record and no fall detection. Both loops run alternately on one simulation and one controller, so
that other load on the machine affects both. The ratios are reliable; the microseconds depend on the
machine.
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
    """Run the bare loop."""
    for _ in range(TICKS):
        command = controller(sim.q, sim.v, sim.time)
        sim.advance(command.tau)


def recorded(sim: fb.Simulation, controller: fb.WholeBodyController) -> None:
    """Run the same steps with all checks and records of a rollout."""
    run = fb.rollout(sim, controller, TICKS * sim.timestep)
    if run.outcome != "completed":
        raise SystemExit(f"{sim.robot.name}: {run.outcome}")


def tick_time(
    loop: Callable[[fb.Simulation, fb.WholeBodyController], None],
    sim: fb.Simulation,
    controller: object,
) -> float:
    """Measure processor time per control step [µs] in a run that starts from standing."""
    sim.reset()
    start = time.thread_time()
    loop(sim, controller)
    return 1e6 * (time.thread_time() - start) / TICKS


def row(name: str, turns: int) -> str:
    """Measure one robot: medians over all runs, and the median ratio of paired runs."""
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
    ask.add_argument("--turns", type=int, default=50, help="runs of each loop for each robot")
    turns = ask.parse_args().turns
    lines = [
        "# Computing time of a rollout",
        "",
        f"`python benchmarks/rollout.py` on {tick.machine()}.",
        "",
    ]
    lines += [
        f"A robot stands on all its feet at 1 kHz: {turns} runs of {TICKS} control steps for each "
        f"loop. The table gives the time per control step"
    ]
    lines += [
        "and the speed relative to real time. The ratio is the speed of the rollout divided by "
        "that of the bare loop.",
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
