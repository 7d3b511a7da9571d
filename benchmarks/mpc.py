"""Measure `MPC` beside `Walk`, and `Jump`, on MuJoCo.

    python benchmarks/mpc.py               -> benchmarks/mpc.md
    python benchmarks/mpc.py --pushes 12   fewer pushes

All robots and speeds use the same numbers. Friction is 0.6 in the controller and 1 on the ground.
The control period is 2 ms. Times are processor times of the thread.
"""

import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import harness
import numpy as np
import pinocchio as pin
from harness import tilt, velocity, walker

import floatbase as fb
from floatbase.behaviours import MPC, Gait, HorizonQP, Jump, Walk
from floatbase.simulation import Rollout

SEED, PERIOD = 0, 2e-3
ROBOTS = ("go2", "solo12", "anymal_c")
SPEEDS = (0.3, 1.0, 1.5, 2.0, 2.5)
HORIZONS = (5, 10, 15, 20)
JUMPS = {  # the largest height and distance of ten jumps
    "go2": (0.20, 0.20),
    "solo12": (0.12, 0.10),
    "anymal_kinova": (0.20, 0.20),
}
Make = Callable[[fb.Robot, fb.Contacts, float], Walk]
Rows = Iterator[list[str]]


def quick(robot: fb.Robot) -> Gait:
    return Gait.trot(robot, swing=0.15, start=0.2)


def flying(robot: fb.Robot) -> Gait:
    return Gait.flying_trot(robot, stance=0.1, flight=0.04, start=0.2)


CONTROLLERS: dict[str, Make] = {
    "`Walk`, trot": lambda robot, contacts, v: Walk(robot, contacts, quick(robot), (v, 0.0)),
    "`MPC`, trot": lambda robot, contacts, v: MPC(robot, contacts, quick(robot), (v, 0.0)),
    "`MPC`, flying trot": lambda robot, contacts, v: MPC(robot, contacts, flying(robot), (v, 0.0)),
}


def load(run: Rollout, begin: float) -> tuple[float, float]:
    """Return the root mean square and the largest torque, as fractions of the limits."""
    fraction = np.abs(run.tau[run.time >= begin] / run.robot.torque_limits)
    return float(np.sqrt(np.mean(fraction**2))), float(fraction.max())


def quiet(make: Make, robot: fb.Robot, contacts: fb.Contacts, v: float) -> Walk:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the table shows the speed that the steps allow
        return make(robot, contacts, v)


def speed_rows() -> Rows:
    for name in ROBOTS:
        robot, contacts = walker(name)
        for v in SPEEDS:
            cells = []
            for make in CONTROLLERS.values():
                walk = quiet(make, robot, contacts, v)
                duration = 2.2 + v
                run = fb.rollout(fb.Simulation(robot), walk, duration, control_period=PERIOD)
                if run.outcome != "completed":
                    cells.append(f"{run.outcome} at {run.time[-1]:.1f} s")
                    continue
                reached = velocity(run, duration - 1.0)[0]
                rms, peak = load(run, duration - 1.0)
                limited = walk.speed_fraction < 1.0
                limit = f" ({walk.speed_fraction * v:.2f})" if limited else ""
                cells.append(f"{reached:.2f}{limit} m/s, {tilt(run):.1f}°, {rms:.2f}, {peak:.2f}")
            yield [name, f"{v:g} m/s", *cells]


def push_rows(n: int) -> Rows:
    for name in ROBOTS:
        robot, contacts = walker(name)
        cells = []
        for kind in (Walk, MPC):
            rng, tilts = np.random.default_rng(SEED), []
            walk = kind(robot, contacts, Gait.trot(robot, start=0.2), (0.3, 0.0))
            for _ in range(n):
                angle, begin, change = rng.uniform([0, 0.7, 0.5], [2 * np.pi, 1.2, 1.5])
                force = robot.mass * change / 0.1 * np.array([np.cos(angle), np.sin(angle), 0.0])
                push = fb.Push(force, begin)
                duration = PERIOD * round((begin + 1.4) / PERIOD)
                run = fb.rollout(fb.Simulation(robot), walk, duration, [push], PERIOD)
                if run.outcome == "completed":
                    tilts.append(tilt(run))
            cells.append(f"{len(tilts)} of {n}, {np.mean(tilts):.1f}°" if tilts else f"0 of {n}")
        yield [name, *cells]


class Timed:
    """A controller that measures the processor time of each control step."""

    def __init__(self, walk: Walk):
        self.walk, self.robot, self.times = walk, walk.robot, []

    @property
    def contacts(self) -> fb.Contacts:
        return self.walk.contacts

    def __call__(self, q: Any, v: Any, t: float) -> fb.control.Command:
        begin = time.thread_time()
        command = self.walk(q, v, t)
        self.times.append(time.thread_time() - begin)
        return command


def horizon_rows() -> Rows:
    robot, contacts = walker("go2")
    gait = Gait.trot(robot, start=0.2)
    walks = {"`Walk`": Walk(robot, contacts, gait, (0.5, 0.0))}
    for n in HORIZONS:
        walks[f"`MPC`, n = {n}"] = MPC(robot, contacts, gait, (0.5, 0.0), n=n)
    for label, walk in walks.items():
        timed = Timed(walk)
        run = fb.rollout(fb.Simulation(robot), timed, 3.0, control_period=PERIOD)
        times = 1e6 * np.array(timed.times[100:])
        numbers = np.median(times), times.mean(), np.quantile(times, 0.99)
        cells = [f"{number:.0f} µs" for number in numbers]
        yield [label, *cells, f"{velocity(run, 2.0)[0]:.2f} m/s", f"{tilt(run):.1f}°"]


def recorded(n: int) -> list[Any]:
    """Return the problems of a flying trot, (horizon, arguments) each."""
    found: list[Any] = []
    robot, contacts = walker("go2")
    walk = MPC(robot, contacts, Gait.flying_trot(robot, start=0.2), (0.5, 0.0), n=n)
    solve = HorizonQP.solve

    def record(self: HorizonQP, *arguments: Any) -> Any:
        found.append((self, arguments))
        return solve(self, *arguments)

    HorizonQP.solve = record  # type: ignore[method-assign]
    try:
        fb.rollout(fb.Simulation(robot), walk, 1.0, control_period=PERIOD)
    finally:
        HorizonQP.solve = solve  # type: ignore[method-assign]
    return found


def difference_rows() -> Rows:
    problems, rng, worst = recorded(10), np.random.default_rng(SEED), 0.0
    for i in range(200):
        horizon, (x, *rest) = problems[i % len(problems)]
        x = x + rng.normal(size=12) * np.repeat([0.1, 0.05, 0.5, 0.3], 3)
        found = horizon.solve(x, *rest).forces[rest[2]].ravel()
        difference = np.abs(found - fb.solve(horizon.qp(x, *rest), "cvxpy").x).max()
        worst = max(worst, float(difference) / (horizon.mass * horizon.gravity))
    yield ["200", f"{worst:.0e}"]


def jump_rows() -> Rows:
    for name, (height, distance) in JUMPS.items():
        robot, contacts = walker(name)
        errors, tilts, completed = [], [], 0
        for h in np.linspace(0.05, height, 5):
            for d in (0.0, distance):
                jump = Jump(robot, contacts, h, d, start=0.1)
                run = fb.rollout(fb.Simulation(robot), jump, 2.0, control_period=PERIOD)
                completed += run.outcome == "completed"
                feet = run.foot_positions[:, :, 0].mean(axis=1)
                rise = run.com[:, 2].max() - robot.standing().com[2]
                errors.append((rise - h, feet[-1] - feet[0] - d))
                tilts.append(tilt(run))
        up, ahead = 1e3 * np.abs(errors).max(axis=0)
        commanded = [f"0.05 to {height:g}", f"0 and {distance:g}", f"{completed} of 10"]
        yield [name, *commanded, f"≤ {up:.0f} mm", f"≤ {ahead:.0f} mm", f"≤ {max(tilts):.0f}°"]


def momentum_errors(run: Rollout, rows: list[int]) -> tuple[float, float, float]:
    """Return the largest departures of a flight from the closed form.

    They are those of the momentum divided by the mass [m/s], of the angular momentum [kg·m²/s], and
    of the energy of the centre of mass divided by the weight [m].
    """
    robot, data = run.robot, run.robot.model.createData()
    h = [
        pin.computeCentroidalMomentum(robot.model, data, run.q[i], run.v[i]).vector.copy()
        for i in rows
    ]
    linear, angular = np.array(h)[:, :3] / robot.mass, np.array(h)[:, 3:]
    fall = robot.gravity * (run.time[rows] - run.time[rows[0]])[:, None] * [0.0, 0.0, 1.0]
    energy = run.com[rows, 2] + (linear**2).sum(axis=1) / 2.0 / robot.gravity
    return (
        float(np.abs(linear + fall - linear[0]).max()),
        float(np.abs(angular - angular[0]).max()),
        float(np.ptp(energy)),
    )


def flight_rows() -> Rows:
    for name in ("go2", "solo12", "anymal_kinova"):
        robot, contacts = walker(name)
        jump = Jump(robot, contacts, 0.1, start=0.1)
        trot = MPC(robot, contacts, flying(robot), (0.5, 0.0))
        for label, controller, begin in (
            ("`Jump` of 0.1 m", jump, 0.5),
            ("flying trot", trot, 1.0),
        ):
            run = fb.rollout(fb.Simulation(robot), controller, 1.4, control_period=PERIOD)
            free = [
                bool(t > begin and len(run.contacts_at(i)) == 0 and not run.measured[i].any())
                for i, t in enumerate(run.time)
            ]
            first = free.index(True)
            last = first + free[first:].index(False)
            v, L, h = momentum_errors(run, list(range(first, last)))
            flight = f"{label}, {1e3 * (run.time[last] - run.time[first]):.0f} ms"
            yield [name, flight, f"{1e3 * v:.1f} mm/s", f"{L:.4f} kg·m²/s", f"{1e3 * h:.2f} mm"]


def prediction_rows() -> Rows:
    for name in ("go2", "solo12", "anymal_kinova"):
        robot, contacts = walker(name)
        for label, gait in (("trot", Gait.trot(robot, start=0.2)), ("flying trot", flying(robot))):
            walk = Predicting(robot, contacts, gait, (0.5, 0.0), n=15, dt=0.02)
            run = fb.rollout(fb.Simulation(robot), walk, 2.0, control_period=PERIOD)
            velocities = np.gradient(run.com, run.time, axis=0)
            errors = [
                [x[3:6] - run.com[i], x[9:12] - velocities[i]]
                for t, x in walk.predictions.items()
                if t > 0.8 and (i := round((t + 0.1) / PERIOD)) < len(run)
            ]
            sizes = 1e3 * np.linalg.norm(errors, axis=2)
            (far, fast), (far_rms, fast_rms) = sizes.max(axis=0), np.sqrt((sizes**2).mean(axis=0))
            position, speed = f"{far:.1f} mm, {far_rms:.1f} mm", f"{fast:.0f} mm/s, {fast_rms:.0f}"
            yield [name, label, position, f"{speed} mm/s"]


class Predicting(MPC):
    """`MPC` that keeps the state predicted 100 ms ahead, by the time of the solution."""

    def __init__(self, *arguments: Any, **options: Any):
        self.predictions: dict[float, Any] = {}
        super().__init__(*arguments, **options)

    def __call__(self, q: Any, v: Any, t: float = 0.0) -> fb.control.Command:
        before, command = self.motion, super().__call__(q, v, t)
        if self.motion is not None and self.motion is not before:
            self.predictions[t] = self.motion.states[4]
        return command


def sections(n: int) -> list[tuple[str, str, Rows]]:
    """Return texts, headers and rows of all tables."""
    return [
        (
            "## Speed, tilt and torque\n\n"
            "Speed of the last second, largest tilt, and torque as a fraction of the limits (rms\n"
            "and largest) in the last second. (x) is the speed to which the steps are limited.",
            "robot | desired | " + " | ".join(CONTROLLERS),
            speed_rows(),
        ),
        (
            "## Jumps\n\nTen jumps of each robot: commanded against reached height and distance.",
            "robot | height, m | distance, m | completed | height error | distance error | tilt",
            jump_rows(),
        ),
        (
            f"## Pushes\n\n{n} pushes of 0.1 s on the base, in random directions and at random\n"
            "times of a trot (swing 0.25 s) at 0.3 m/s. Each changes the velocity by 0.5 to\n"
            "1.5 m/s. The same pushes for both controllers; survived, and mean of the largest\n"
            "tilts of the survivors.",
            "robot | `Walk` | `MPC`",
            push_rows(n),
        ),
        (
            "## Time per control step and length of the horizon\n\n"
            "go2 trots at 0.5 m/s. The horizon has n intervals of 30 ms and is solved every\n"
            "20 ms. Median, mean and 99 % quantile of a control step.",
            " | median | mean | 99 % | speed | tilt",
            horizon_rows(),
        ),
        (
            "## Solver\n\nForces of go2 at random states beside those of Clarabel:",
            "horizons | largest difference, fraction of the weight",
            difference_rows(),
        ),
        (
            "## Flight and prediction\n\n"
            "MuJoCo against the closed form while no foot touches the ground: largest\n"
            "differences. The velocity of the centre of mass is compared with free fall, and the\n"
            "angular momentum with a constant. The energy of the centre of mass is given as a\n"
            "height. Its error is that of the integration: in a time t, a step of 1 ms lowers the\n"
            "centre of mass by g t · 0.5 ms, which is 1.4 mm in 286 ms.",
            "robot | flight | velocity | angular momentum | energy",
            flight_rows(),
        ),
        (
            "Error of the horizon's prediction 100 ms ahead (5 intervals of 20 ms), against\n"
            "MuJoCo: largest and root mean square, of the position of the centre of mass and of\n"
            "its velocity.",
            "robot | gait, 0.5 m/s | position | velocity",
            prediction_rows(),
        ),
    ]  # fmt: skip


def main() -> None:
    parser = harness.command_line(__doc__, pushes=(30, "pushes of each robot"))
    parts = [
        f"{text}\n\n{harness.table(header, rows)}"
        for text, header, rows in sections(parser.parse_args().pushes)
    ]
    harness.write(
        __file__,
        "Model predictive control and jumps: measured results",
        f"Made by `python benchmarks/mpc.py` with floatbase {fb.__version__}. All robots and\n"
        "speeds use the same numbers. Friction is 0.6 in the controller and 1 on the ground.\n"
        "The control period is 2 ms. `Walk` and `MPC` trot with a swing of 0.15 s. The flying\n"
        "trot has stances of 0.1 s and flights of 0.04 s. Times are processor times of the\n"
        "thread.",
        *parts,
    )


if __name__ == "__main__":
    main()
