"""Compare the computing time of `fb.rollout` with that of a bare loop without a record.

    python benchmarks/rollout.py             -> benchmarks/rollout.md
    python benchmarks/rollout.py --turns 10  fewer runs, for a quick look

The bare loop reads the state, calls the controller and advances the physics. It has no checks, no
record and no fall detection. Both loops run alternately on one simulation and one controller, so
that other load on the machine affects both. The ratios are reliable; the microseconds depend on the
machine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import harness
import numpy as np
import tick

import floatbase as fb

TICKS = 1000  # in a turn: a second
Loop = Callable[[fb.Simulation, fb.WholeBodyController], None]


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


def step_time(loop: Loop, sim: fb.Simulation, controller: fb.WholeBodyController) -> float:
    """Measure processor time per control step [µs] in a run that starts from standing."""
    sim.reset()
    return 1e6 * harness.work(loop, sim, controller) / TICKS


def rows(turns: int) -> Iterator[list[str]]:
    """Measure each robot: medians over all runs, and the median ratio of paired runs."""
    for name in harness.ROBOTS:
        robot = fb.load(name)
        controller, sim = tick.controller(robot), fb.Simulation(robot)
        times = np.array(
            [[step_time(loop, sim, controller) for loop in (bare, recorded)] for _ in range(turns)]
        )
        cells = [name]
        for median in np.median(times, axis=0):
            cells += [f"{median:.1f} µs", f"{1e6 * sim.timestep / median:.1f} ×"]
        yield [*cells, f"**{np.median(times[:, 0] / times[:, 1]):.2f}**"]


def main() -> None:
    parser = harness.command_line(__doc__, turns=(50, "runs of each loop for each robot"))
    turns = parser.parse_args().turns
    header = "robot | bare loop | × real time | `fb.rollout` | × real time | ratio"
    harness.write(
        __file__,
        "Computing time of a rollout",
        f"`python benchmarks/rollout.py` on {harness.machine()}.",
        f"A robot stands on all its feet at 1 kHz: {turns} runs of {TICKS} control steps for each "
        "loop. The table gives the time per control step\nand the speed relative to real time. The "
        "ratio is the speed of the rollout divided by that of the bare loop.",
        harness.table(header, rows(turns)),
    )


if __name__ == "__main__":
    main()
