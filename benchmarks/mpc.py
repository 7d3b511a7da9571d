"""Measure `MPC` beside `Walk`, and `Jump`, on MuJoCo.

    python benchmarks/mpc.py               -> benchmarks/mpc.md
    python benchmarks/mpc.py pushes jumps  measure only these sections again
    python benchmarks/mpc.py --pushes 12   fewer pushes

All robots and speeds use the same numbers. Friction is 0.6 in the controller and 1 on the ground.
The control period is 2 ms. Times are processor times of the thread.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import clarabel
import daqp
import numpy as np
import pinocchio as pin
from scipy import sparse

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


def robot_of(name: str) -> tuple[fb.Robot, fb.Contacts]:
    options: dict[str, Any] = {}
    if name == "anymal_c":
        feet = ["LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT"]
        options = {"feet": feet, "foot_radius": 0.02}
    robot = fb.load(name, **options)
    return robot, fb.Contacts.feet(robot, mu=0.6)


def quick(robot: fb.Robot) -> Gait:
    return Gait.trot(robot, swing=0.15, start=0.2)


def flying(robot: fb.Robot) -> Gait:
    return Gait.flying_trot(robot, stance=0.1, flight=0.04, start=0.2)


CONTROLLERS: dict[str, Make] = {
    "`Walk`, trot": lambda robot, contacts, v: Walk(robot, contacts, quick(robot), (v, 0.0)),
    "`MPC`, trot": lambda robot, contacts, v: MPC(robot, contacts, quick(robot), (v, 0.0)),
    "`MPC`, flying trot": lambda robot, contacts, v: MPC(robot, contacts, flying(robot), (v, 0.0)),
}


def tilt(run: Rollout) -> float:
    return float(np.rad2deg(np.arccos(1.0 - 2.0 * (run.q[:, 3] ** 2 + run.q[:, 4] ** 2)).max()))


def load(run: Rollout, begin: float) -> tuple[float, float]:
    """Return the root mean square and the largest torque, as fractions of the limits."""
    fraction = np.abs(run.tau[run.time >= begin] / run.robot.torque_limits)
    return float(np.sqrt(np.mean(fraction**2))), float(fraction.max())


def quiet(make: Make, robot: fb.Robot, contacts: fb.Contacts, v: float) -> Walk:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the table shows the speed that the steps allow
        return make(robot, contacts, v)


def speeds() -> Iterator[str]:
    yield "## Speed, tilt and torque"
    yield ""
    yield "Speed of the last second, largest tilt, and torque as a fraction of the limits (rms and"
    yield "largest) in the last second. (x) is the speed to which the steps are limited."
    yield ""
    yield "| robot | desired | " + " | ".join(CONTROLLERS) + " |"
    yield "|---|---|" + "---|" * len(CONTROLLERS)
    for name in ROBOTS:
        robot, contacts = robot_of(name)
        for v in SPEEDS:
            cells = []
            for make in CONTROLLERS.values():
                walk = quiet(make, robot, contacts, v)
                duration = 2.2 + v
                run = fb.rollout(fb.Simulation(robot), walk, duration, control_period=PERIOD)
                if run.outcome != "completed":
                    cells.append(f"{run.outcome} at {run.time[-1]:.1f} s")
                    continue
                last = np.searchsorted(run.time, duration - 1.0)
                reached = (run.com[-1, 0] - run.com[last, 0]) / (run.time[-1] - run.time[last])
                rms, peak = load(run, run.time[last])
                limited = walk.speed_fraction < 1.0
                limit = f" ({walk.speed_fraction * v:.2f})" if limited else ""
                cells.append(f"{reached:.2f}{limit} m/s, {tilt(run):.1f}°, {rms:.2f}, {peak:.2f}")
            print(name, v, *cells, sep=" | ", flush=True)
            yield f"| {name} | {v:g} m/s | " + " | ".join(cells) + " |"


def pushes(n: int) -> Iterator[str]:
    yield "## Pushes"
    yield ""
    yield f"{n} pushes of 0.1 s on the base, in random directions and at random times of a trot"
    yield "(swing 0.25 s) at 0.3 m/s. Each changes the velocity by 0.5 to 1.5 m/s. The same pushes"
    yield "for both controllers; survived, and mean of the largest tilts of the survivors."
    yield ""
    yield "| robot | `Walk` | `MPC` |"
    yield "|---|---|---|"
    for name in ROBOTS:
        robot, contacts = robot_of(name)
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
        print(name, *cells, sep=" | ", flush=True)
        yield f"| {name} | " + " | ".join(cells) + " |"


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


def horizons() -> Iterator[str]:
    yield "## Time per control step and length of the horizon"
    yield ""
    yield "go2 trots at 0.5 m/s. The horizon has n intervals of 30 ms and is solved every 20 ms."
    yield "Median, mean and 99 % quantile of a control step."
    yield ""
    yield "| | median | mean | 99 % | speed | tilt |"
    yield "|---|---|---|---|---|---|"
    robot, contacts = robot_of("go2")
    makes: dict[str, Callable[[], Walk]] = {
        "`Walk`": lambda: Walk(robot, contacts, Gait.trot(robot, start=0.2), (0.5, 0.0))
    }
    for n in HORIZONS:
        makes[f"`MPC`, n = {n}"] = lambda n=n: MPC(
            robot, contacts, Gait.trot(robot, start=0.2), (0.5, 0.0), n=n
        )
    for label, make in makes.items():
        timed = Timed(make())
        run = fb.rollout(fb.Simulation(robot), timed, 3.0, control_period=PERIOD)
        times = 1e6 * np.array(timed.times[100:])
        last = np.searchsorted(run.time, 2.0)
        reached = (run.com[-1, 0] - run.com[last, 0]) / (run.time[-1] - run.time[last])
        numbers = f"{np.median(times):.0f} | {times.mean():.0f} | {np.quantile(times, 0.99):.0f} µs"
        yield (
            f"| {label} | {numbers.replace(' |', ' µs |')} | {reached:.2f} m/s | {tilt(run):.1f}° |"
        )


def recorded(n: int) -> list[Any]:
    """Return the problems of a flying trot, (horizon, arguments) each."""
    found: list[Any] = []
    robot, contacts = robot_of("go2")
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


def solvers() -> Iterator[str]:
    yield "## Solvers"
    yield ""
    problems = recorded(10)
    rng = np.random.default_rng(SEED)
    worst = 0.0
    for i in range(200):
        horizon, (x, *rest) = problems[i % len(problems)]
        x = x + rng.normal(size=12) * np.repeat([0.1, 0.05, 0.5, 0.3], 3)
        difference = (
            horizon.solve(x, *rest).forces[rest[2]].ravel()
            - fb.solve(horizon.qp(x, *rest), "cvxpy").x
        )
        worst = max(worst, float(np.abs(difference).max()) / (horizon.mass * horizon.gravity))
    yield "Over 200 horizons of go2 at random states, the forces differ from those of Clarabel by"
    yield f"at most {worst:.0e} of the weight. Times to solve the quadratic program of a flying"
    yield "trot, without assembling it:"
    yield ""
    yield "| n | variables | DAQP | Clarabel |"
    yield "|---|---|---|---|"
    for n in HORIZONS:
        times: dict[str, list[float]] = {"daqp": [], "clarabel": []}
        for horizon, arguments in recorded(n)[10:60]:
            qp = horizon.qp(*arguments)
            H, g, G, h = (np.array(a) for a in (qp.H, qp.g, qp.G, qp.h))
            P, C = sparse.csc_matrix(np.triu(H)), sparse.csc_matrix(G)
            senses, none = np.zeros(len(h), dtype=np.int32), np.full(len(h), -1e30)

            def by_daqp(H=H, g=g, G=G, h=h, none=none, senses=senses) -> None:
                daqp.solve(H, g, G, h, none, senses)

            def by_clarabel(P=P, g=g, C=C, h=h) -> None:
                settings = clarabel.DefaultSettings()
                settings.verbose = False
                cones = [clarabel.NonnegativeConeT(len(h))]
                clarabel.DefaultSolver(P, g, C, h, cones, settings).solve()

            for label, solve in zip(times, (by_daqp, by_clarabel), strict=True):
                begin = time.thread_time()
                solve()
                times[label].append(time.thread_time() - begin)
        medians = " | ".join(f"{1e3 * np.median(each):.2f} ms" for each in times.values())
        yield f"| {n} | {len(g)} | {medians} |"


def jumps() -> Iterator[str]:
    yield "## Jumps"
    yield ""
    yield "Ten jumps of each robot: commanded against reached height and distance."
    yield ""
    yield "| robot | height, m | distance, m | completed | height error | distance error | tilt |"
    yield "|---|---|---|---|---|---|---|"
    for name, (height, distance) in JUMPS.items():
        robot, contacts = robot_of(name)
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
        yield (
            f"| {name} | 0.05 to {height:g} | 0 and {distance:g} | {completed} of 10 | "
            f"≤ {up:.0f} mm | ≤ {ahead:.0f} mm | ≤ {max(tilts):.0f}° |"
        )


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


def flights() -> Iterator[str]:
    yield "## Flight and prediction"
    yield ""
    yield "MuJoCo against the closed form while no foot touches the ground: largest differences."
    yield "The velocity of the centre of mass is compared with free fall, and the angular"
    yield "momentum with a constant. The energy of the centre of mass is given as a height. Its"
    yield "error is that of the integration: in a time t, a step of 1 ms lowers the centre of mass"
    yield "by g t · 0.5 ms, which is 1.4 mm in 286 ms."
    yield ""
    yield "| robot | flight | velocity | angular momentum | energy |"
    yield "|---|---|---|---|---|"
    for name in ("go2", "solo12", "anymal_kinova"):
        robot, contacts = robot_of(name)
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
            yield (
                f"| {name} | {label}, {1e3 * (run.time[last] - run.time[first]):.0f} ms | "
                f"{1e3 * v:.1f} mm/s | {L:.4f} kg·m²/s | {1e3 * h:.2f} mm |"
            )
    yield ""
    yield "Error of the horizon's prediction 100 ms ahead (5 intervals of 20 ms), against MuJoCo:"
    yield "largest and root mean square, of the position of the centre of mass and of its velocity."
    yield ""
    yield "| robot | gait, 0.5 m/s | position | velocity |"
    yield "|---|---|---|---|"
    for name in ("go2", "solo12", "anymal_kinova"):
        robot, contacts = robot_of(name)
        for label, gait in (("trot", Gait.trot(robot, start=0.2)), ("flying trot", flying(robot))):
            walk = Predicting(robot, contacts, gait, (0.5, 0.0), n=15, dt=0.02)
            run = fb.rollout(fb.Simulation(robot), walk, 2.0, control_period=PERIOD)
            velocity = np.gradient(run.com, run.time, axis=0)
            errors = [
                [x[3:6] - run.com[i], x[9:12] - velocity[i]]
                for t, x in walk.predictions.items()
                if t > 0.8 and (i := round((t + 0.1) / PERIOD)) < len(run)
            ]
            sizes = 1e3 * np.linalg.norm(errors, axis=2)
            largest, rms = sizes.max(axis=0), np.sqrt((sizes**2).mean(axis=0))
            yield (
                f"| {name} | {label} | {largest[0]:.1f} mm, {rms[0]:.1f} mm | "
                f"{largest[1]:.0f} mm/s, {rms[1]:.0f} mm/s |"
            )


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


def main() -> None:
    sections: dict[str, Callable[[], Iterator[str]]] = {
        "speed": speeds,  # by the first word of the heading
        "jumps": jumps,
        "pushes": lambda: pushes(arguments.pushes),
        "time": horizons,
        "solvers": solvers,
        "flight": flights,
    }
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sections", nargs="*", choices=[*sections, []], help="all by default")
    parser.add_argument("--pushes", type=int, default=30)
    arguments = parser.parse_args()
    path = Path(__file__).with_suffix(".md")
    parts = dict.fromkeys(sections, "")
    for part in path.read_text(encoding="utf-8").split("## ")[1:] if path.exists() else ():
        parts[part.replace(",", " ").split()[0].lower()] = part
    intro = [
        "# Model predictive control and jumps: measured results",
        "",
        f"Made by `python benchmarks/mpc.py` with floatbase {fb.__version__}. All robots and",
        "speeds use the same numbers. Friction is 0.6 in the controller and 1 on the ground. The",
        "control period is 2 ms. `Walk` and `MPC` trot with a swing of 0.15 s. The flying trot has",
        "stances of 0.1 s and flights of 0.04 s. Times are processor times of the thread.",
        "",
    ]
    for name in arguments.sections or sections:
        parts[name] = "\n".join([*sections[name](), "", ""]).removeprefix("## ")
        written = "".join(f"## {part}" for part in parts.values() if part)
        path.write_text("\n".join(intro) + "\n" + written.rstrip() + "\n", encoding="utf-8")
    print(path)


if __name__ == "__main__":
    main()
