"""Measure how robots walk over terrain on MuJoCo, with and without knowing the ground.

    python benchmarks/terrain.py             -> benchmarks/terrain.md
    python benchmarks/terrain.py --runs 2    fewer runs, for a quick look

Each case is repeated with other seeds. The seed chooses how far away the terrain begins, the
heights of tiles, and the speed within 10 %, so that feet meet edges at other times. A run has
succeeded if the robot does not fall and its base has passed the terrain. Friction is 0.6 in the
controller and 1 on the ground, and the control period is 2 ms.

The tilt is the largest angle between the base and the vertical in runs that passed. A body that
knows the ground leans with its slope on purpose: 18° on these stairs.
"""

import warnings
from collections.abc import Callable
from typing import NamedTuple

import harness
import numpy as np

import floatbase as fb
from floatbase.behaviours import Gait, Walk

PERIOD = 0.002  # s
BEHIND = 0.3  # m that the base walks past the terrain
MAX_TIME = 40.0  # s
SLOPE_LENGTH = 1.0  # m that a robot walks on a slope


class Case(NamedTuple):
    """A terrain; `make(start, seed)` returns the ground and the x coordinate where it ends [m]."""

    name: str
    make: Callable[[float, int], tuple[fb.Ground, float]]
    seen: bool


class Walker(NamedTuple):
    """A robot, its gait, its speed [m/s], and the clearance of its swings [m]."""

    name: str
    gait: Callable[[fb.Robot], Gait]
    speed: float
    clearance: float


def slope(degrees: float, axis: int = 0) -> Callable[[float, int], tuple[fb.Ground, float]]:
    angle = np.deg2rad(degrees)
    normal = np.array([0.0, 0.0, np.cos(angle)])
    normal[axis] = -np.sin(angle)  # positive: uphill
    return lambda start, seed: (fb.Ground(normal=normal), SLOPE_LENGTH - BEHIND)


def stairs(steps: int, rise: float, run: float = 0.3) -> Callable[..., tuple[fb.Ground, float]]:
    return lambda start, seed: (
        fb.Ground.stairs(steps, rise, run, start, width=4.0),
        start + run * (steps - 1),
    )


def tiles(height: float) -> Callable[[float, int], tuple[fb.Ground, float]]:
    return lambda start, seed: (
        fb.Ground.tiles(height, start=start, size=(1.6, 1.6), seed=seed),
        start + 1.6,
    )


def gap(length: float) -> Callable[[float, int], tuple[fb.Ground, float]]:
    return lambda start, seed: (fb.Ground.gap(length, 0.3, start, width=4.0), start + length)


QUADRUPEDS = [
    Walker("go2", Gait.trot, 0.25, 0.08),
    Walker("anymal_c", Gait.trot, 0.3, 0.1),
    Walker("hyq", Gait.trot, 0.3, 0.1),
]
TALOS = Walker("talos", Gait.walk, 0.2, 0.08)
POINT_FEET = [
    *(Case(f"step {100 * h:+.0f} cm", stairs(1, h), seen) for h in (0.05, -0.05)
        for seen in (False, True)),
    Case("tiles 0 to 5 cm", tiles(0.05), False), Case("tiles 0 to 5 cm", tiles(0.05), True),
    Case("gap 10 cm", gap(0.1), True),
    Case("4 stairs +10 cm", stairs(4, 0.1), True), Case("4 stairs -10 cm", stairs(4, -0.1), True),
]  # fmt: skip
FLAT_FEET = [
    *(Case(f"slope {a:+.0f}°", slope(a), True) for a in (10.0, -10.0)),
    Case("side slope 10°", slope(10.0, 1), True),
    *(Case(f"step {100 * h:+.0f} cm", stairs(1, h), False) for h in (0.03, -0.03)),
    Case("4 stairs +8 cm", stairs(4, 0.08), True), Case("4 stairs -8 cm", stairs(4, -0.08), True),
]  # fmt: skip


def attempt(
    robot: fb.Robot, contacts: fb.Contacts, walker: Walker, case: Case, seed: int
) -> tuple[bool, float, float]:
    """Return whether a robot passed, its largest tilt [°], and where it ended [m]."""
    rng = np.random.default_rng(seed)
    length = float(np.ptp(contacts.positions(robot.standing())[:, 0]))
    start = 0.5 * length + rng.uniform(0.15, 0.45)
    speed = walker.speed * rng.uniform(0.9, 1.1)
    ground, end = case.make(start, seed)
    options = {"clearance": walker.clearance, "ground": ground if case.seen else None}
    walk = Walk(robot, contacts, walker.gait(robot), (speed, 0.0), **options)
    sim = fb.Simulation(robot, ground)
    goal, largest = sim.q[0] + end + 0.5 * length + BEHIND, 0.0
    while sim.time < MAX_TIME and sim.q[0] < goal:
        run = fb.rollout(sim, walk, 0.5, control_period=PERIOD)
        largest = max(largest, harness.tilt(run))
        if run.outcome != "completed":
            return False, largest, float(sim.q[0])
    return sim.q[0] >= goal, largest, float(sim.q[0])


def row(walker: Walker, case: Case, runs: int) -> list[str]:
    robot, contacts = harness.walker(walker.name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the speed that a robot can reach is in the result
        found = [attempt(robot, contacts, walker, case, seed) for seed in range(runs)]
    tilts = [angle for done, angle, _ in found if done]
    tilt = f"{np.median(tilts):.1f}°, {max(tilts):.1f}°" if tilts else ""
    failed = [f"{x:.2f}" for done, _, x in found if not done]
    seen = "seen" if case.seen else "blind"
    return [walker.name, case.name, seen, f"{len(tilts)} of {runs}", tilt, ", ".join(failed)]


def main() -> None:
    parser = harness.command_line(__doc__, runs=(10, "runs of each case"))
    runs = parser.parse_args().runs
    pairs = [(walker, case) for walker in QUADRUPEDS for case in POINT_FEET]
    pairs += [(TALOS, case) for case in FLAT_FEET]
    rows = (row(walker, case, runs) for walker, case in pairs)
    table = harness.table(
        "robot | terrain | ground | passed | tilt, median and largest | falls at x [m]", rows
    )
    harness.write(__file__, "Walking over terrain", __doc__.split("\n\n", 2)[2].strip(), table)


if __name__ == "__main__":
    main()
