"""Measure how well robots walk on MuJoCo, and compare with the requirements.

    python benchmarks/walking.py             -> benchmarks/walking.md
    python benchmarks/walking.py --pushes 6  fewer pushes, for a quick look

Friction is 0.6 in the controller and 1 on the ground; pushes last 0.1 s. The control period is
1 ms, or 2 ms where noted.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

import floatbase as fb
from floatbase.behaviours import Gait, Stand, Walk
from floatbase.simulation import Rollout

SEED = 0
Row = tuple[str, str, str, bool]  # what, found, required, whether it holds


def robot_of(name: str) -> tuple[fb.Robot, fb.Contacts]:
    robot = fb.load(name)
    return robot, fb.Contacts.feet(robot, mu=0.6)


def walked(
    name: str, gait: Callable[[fb.Robot], Gait], velocity: tuple[float, float], duration: float,
    *pushes: fb.Push,
    period: float = 1e-3, **options: object,
) -> tuple[Rollout, Walk]:  # fmt: skip
    robot, contacts = robot_of(name)
    walk = Walk(robot, contacts, gait(robot), velocity, **options)
    return fb.rollout(fb.Simulation(robot), walk, duration, pushes, period), walk


def tilt(run: Rollout) -> float:
    return float(np.rad2deg(np.arccos(1.0 - 2.0 * (run.q[:, 3] ** 2 + run.q[:, 4] ** 2)).max()))


def speed(run: Rollout, begin: float, end: float) -> np.ndarray:
    first, last = np.searchsorted(run.time, [begin, end]).clip(max=len(run) - 1)
    return (run.com[last, :2] - run.com[first, :2]) / (run.time[last] - run.time[first])


def jump(run: Rollout) -> float:
    """Return the median over changes of stance of the largest jump of a torque [N·m]."""
    changes = [i for i in range(1, len(run)) if run.contacts_at(i) is not run.contacts_at(i - 1)]
    return float(
        np.median([np.abs(run.tau_desired[i] - run.tau_desired[i - 1]).max() for i in changes])
    )


def lifted(name: str, period: float) -> Row:
    run, walk = walked(
        name,
        lambda robot: replace(Gait.crawl(robot, 1.2, 1.0), stop=9.0),
        (0.0, 0.0),
        11.0,
        period=period,
    )
    rise = 1e3 * (run.foot_positions[:, :, 2].max(axis=0) - run.foot_positions[0, :, 2]).min()
    drift = 1e3 * np.linalg.norm(run.foot_positions[-1] - run.foot_positions[0], axis=1).max()
    com = 1e3 * np.linalg.norm(
        run.com[-1, :2] - walk.plan(run.time[-1])[0]
    )  # feet roll by millimetres while it comes there
    found = (
        f"{rise:.1f} mm, CoM {com:.1f} mm from its target, tilt {tilt(run):.2f}°, drift "
        f"{drift:.1f} mm"
    )
    holds = (
        run.outcome == "completed"
        and rise >= 48.0
        and tilt(run) <= 0.3
        and drift <= 10.0
        and com <= 1.0
    )
    return (
        f"{name}: each foot raised 5 cm{at(period)}",
        found,
        "≥ 48 mm, ≤ 1 mm, ≤ 0.3°, ≤ 10 mm",
        holds,
    )


def crawled(name: str, most: float, period: float) -> Row:
    step = 0.08 if name == "go2" else 0.06
    run, _ = walked(name, Gait.crawl, (step, 0.0), 11.0, period=period)
    v = speed(run, 3.0, 11.0)[0]
    found = f"{100 * v:.1f} cm/s, tilt {tilt(run):.2f}°, torque jump {jump(run):.2f} N·m"
    holds = (
        run.outcome == "completed"
        and abs(v / step - 1.0) <= 0.05
        and tilt(run) <= 0.5
        and jump(run) <= most
    )
    return (
        f"{name}: crawl{at(period)}",
        found,
        f"{100 * step:g} cm/s ± 5 %, ≤ 0.5°, ≤ {most:g} N·m",
        holds,
    )


def in_place(period: float) -> Row:
    run, _ = walked("go2", Gait.trot, (0.0, 0.0), 11.0, period=period)
    drift = 1e3 * np.linalg.norm(run.com[-1, :2] - run.com[round(1.0 / period), :2])
    holds = run.outcome == "completed" and drift <= 20.0 and tilt(run) <= 0.5
    return (
        f"go2: trot in place 10 s{at(period)}",
        f"drift {drift:.1f} mm, tilt {tilt(run):.2f}°",
        "≤ 20 mm, ≤ 0.5°",
        holds,
    )


def trotted(period: float) -> Row:
    run, walk = walked("go2", Gait.trot, (0.3, 0.0), 11.0, period=period)
    v, peak = speed(run, 2.0, 11.0)[0], run.measured[:, 2::3].max() / walk.robot.weight
    aside = 1e3 * abs(run.com[-1, 1])
    found = f"{v:.3f} m/s, y {aside:.0f} mm, tilt {tilt(run):.2f}°, foot peak {peak:.2f} weights"
    holds = (
        run.outcome == "completed"
        and abs(v / 0.3 - 1.0) <= 0.03
        and aside <= 30
        and tilt(run) <= 0.5
        and peak <= 1.2
    )
    return f"go2: trot 0.3 m/s 10 s{at(period)}", found, "± 3 %, ≤ 30 mm, ≤ 0.5°, ≤ 1.2", holds


def pushed(force: float, period: float) -> Row:
    run, _ = walked(
        "go2", Gait.trot, (0.3, 0.0), 8.0, fb.Push(np.array([0.0, force, 0.0]), 4.0), period=period
    )
    aside, small = 1e3 * abs(run.com[-1, 1]), force <= 60.0
    found = f"{run.outcome}, {aside:.0f} mm to the side, tilt {tilt(run):.1f}°"
    holds = run.outcome == "completed" and (not small or (aside <= 150.0 and tilt(run) <= 2.0))
    return (
        f"go2: the same, {force:g} N to the side{at(period)}",
        found,
        "≤ 150 mm, ≤ 2°" if small else "completed",
        holds,
    )


def one_leg(period: float) -> Row:
    run, _ = walked(
        "talos", lambda robot: Gait.walk(robot, 2.6, 1.0), (0.0, 0.0), 8.2, period=period
    )
    feet = 1e3 * np.linalg.norm(run.foot_positions[-1] - run.foot_positions[0], axis=1).max()
    found = (
        f"{run.outcome}, tilt {tilt(run):.2f}°, feet back within {feet:.2f} mm, torque jump "
        f"{jump(run):.1f} N·m"
    )
    holds = run.outcome == "completed" and tilt(run) <= 0.2 and feet <= 2.0 and jump(run) <= 20.0
    return f"talos: one foot up 2.6 s each{at(period)}", found, "≤ 0.2°, ≤ 2 mm, ≤ 20 N·m", holds


def talos_walks(period: float) -> Row:
    run, walk = walked("talos", Gait.walk, (0.2, 0.0), 11.0, period=period)
    v, peak = speed(run, 2.4, 10.8)[0], run.measured[:, 2::3].max() / walk.robot.weight
    steps, rows = list(walk.history), np.arange(round(2.0 / period), len(run), 10)
    plans = np.searchsorted([step.time for step in steps], run.time[rows], side="right") - 1
    error = [
        np.linalg.norm(steps[p].plan(run.time[i])[0] - run.com[i, :2])
        for p, i in zip(plans, rows, strict=True)
    ]
    found = (
        f"{v:.3f} m/s, CoM {1e3 * max(error):.1f} mm error, tilt {tilt(run):.2f}°, corner peak "
        f"{peak:.2f} weights"
    )
    holds = (
        abs(v / 0.2 - 1.0) <= 0.03 and 1e3 * max(error) <= 8.0 and tilt(run) <= 0.5 and peak <= 0.9
    )
    return (
        f"talos: 0.2 m/s 10 s{at(period)}",
        found,
        "± 3 %, ≤ 8 mm, ≤ 0.5°, ≤ 0.9",
        run.outcome == "completed" and holds,
    )


def directions(n: int) -> Iterator[np.ndarray]:
    rng = np.random.default_rng(SEED)
    for _ in range(n):
        angle = rng.uniform(0.0, 2.0 * np.pi)
        yield np.array([np.cos(angle), np.sin(angle), rng.uniform(0.0, 1.4)])


def talos_pushed(n: int) -> Row:
    done = 0
    for x, y, phase in directions(n):
        push = fb.Push(300.0 * np.array([x, y, 0.0]), 3.0 + phase)
        done += (
            walked("talos", Gait.walk, (0.2, 0.0), 7.5, push, period=2e-3)[0].outcome == "completed"
        )
    return (
        f"talos: 0.2 m/s and 300 N, {n} random directions (2 ms)",
        f"{done} of {n}",
        f"≥ {10 * n // 12}",
        done >= 10 * n // 12,
    )


def recovered(name: str, low: float, high: float, gait: Callable[[fb.Robot], Gait], n: int) -> Row:
    robot, contacts = robot_of(name)
    rng = np.random.default_rng(SEED)
    survived: dict[bool, list[bool]] = {False: [], True: []}
    for force, angle in rng.uniform([low, 0.0], [high, 2.0 * np.pi], (n, 2)):
        push = fb.Push(force * np.array([np.cos(angle), np.sin(angle), 0.0]), 0.5)
        for steps, outcomes in survived.items():
            stand = Stand(robot, contacts, gait(robot) if steps else None)
            outcomes.append(
                fb.rollout(fb.Simulation(robot), stand, 4.0, [push], 2e-3).outcome == "completed"
            )
    stood, stepped = (sum(survived[steps]) for steps in (False, True))
    lost = sum(a and not b for a, b in zip(survived[False], survived[True], strict=True))
    enough = 26 * n // 30 if name == "talos" else 27 * n // 30
    more = stood + 8 * n // 30 if name == "talos" else 2 * stood
    found = f"standing {stood}, with steps {stepped} of {n}; {lost or 'none'} lost by stepping"
    what = f"{name}: {n} pushes of {low:g} to {high:g} N (2 ms)"
    return (
        what,
        found,
        f"steps ≥ {max(enough, more)}, none lost",
        stepped >= max(enough, more) and lost == 0,
    )


def turned(yaw_rate: float) -> Row:
    run, _ = walked("go2", Gait.trot, (0.2, 0.0), 7.0, period=2e-3, yaw_rate=yaw_rate)
    rows = run.time > 4.0
    x, y = run.com[rows, :2].T
    A = np.column_stack([2.0 * x, 2.0 * y, np.ones(rows.sum())])
    *centre, c = np.linalg.lstsq(A, x**2 + y**2, rcond=None)[0]
    v = yaw_rate * np.sqrt(c + np.square(centre).sum())
    holds = run.outcome == "completed" and abs(v / 0.2 - 1.0) <= 0.03
    return f"go2: 0.2 m/s and {yaw_rate:g} rad/s (2 ms)", f"{v:.4f} m/s", "± 3 %", holds


def gait_walked(name: str, gait: str, mu: float) -> Row:
    robot = fb.load(name)
    made, what = getattr(Gait, gait)(robot), f"{name}: {gait} 0.2 m/s, friction {mu:g} (2 ms)"
    try:
        walk = Walk(robot, fb.Contacts.feet(robot, mu=mu), made, (0.2, 0.0))
    except fb.FloatbaseError as error:
        return what, f"refused: {str(error).split(',')[0]}", "refused", gait in ("bound", "pronk")
    run = fb.rollout(fb.Simulation(robot), walk, 5.0, control_period=2e-3)
    whole_periods = made.period * np.floor(2.0 / made.period)
    v = speed(run, 4.99 - whole_periods, 4.99)[0]
    holds = run.outcome == "completed" and abs(v / 0.2 - 1.0) <= 0.1 and tilt(run) <= 2.0
    return what, f"{run.outcome}, {v:.3f} m/s, tilt {tilt(run):.1f}°", "± 10 %, ≤ 2°", holds


def bolt_walked() -> Row:
    robot = fb.load("bolt", feet=["FL_FOOT", "FR_FOOT"])
    walk = Walk(robot, fb.Contacts.feet(robot, mu=0.6), Gait.walk(robot))
    run = fb.rollout(fb.Simulation(robot), walk, 4.0, control_period=2e-3)
    drift = 1e3 * np.linalg.norm(run.com[-1, :2])
    holds = run.outcome == "completed" and drift <= 200.0
    return "bolt: on the spot 4 s (2 ms)", f"{run.outcome}, {drift:.0f} mm", "≤ 200 mm", holds


class Slope:
    """A plane through the origin that a walk knows."""

    def __init__(self, normal: np.ndarray):
        self._normal = normal

    def height(self, xy: np.ndarray) -> float:
        return float(-self._normal[:2] @ xy / self._normal[2])

    def normal(self, xy: np.ndarray) -> np.ndarray:
        return self._normal


def sloped(degrees: float, known: bool) -> Row:
    robot, angle = fb.load("talos"), np.deg2rad(degrees)
    normal = np.array([-np.sin(angle), 0.0, np.cos(angle)])
    contacts = fb.Contacts.feet(robot, mu=0.6, normals=normal)
    ground = Slope(normal) if known else None
    walk = Walk(robot, contacts, Gait.walk(robot), (0.2, 0.0), ground=ground)
    run = fb.rollout(fb.Simulation(robot, ground=fb.Ground(normal=normal)), walk, 5.0, (), 2e-3)
    slide = 1e3 * run.slip(include_rolling=False).max()
    limit = 2.0 if known else 40.0
    return (
        f"talos: slope of {degrees:g}°, {'known' if known else 'blind'} (2 ms)",
        f"{run.outcome}, slides {slide:.1f} mm a stance",
        f"≤ {limit:g} mm",
        run.outcome == "completed" and slide <= limit,
    )


def hand_held() -> Row:
    robot, frame, rate = fb.load("anymal_kinova"), "j2s6s200_end_effector", 2.0
    start = robot.standing().point(frame)

    def circle(t: float) -> tuple[np.ndarray, ...]:
        c, s = 0.1 * np.cos(rate * t), 0.1 * np.sin(rate * t)
        return (
            start + [0.0, s, c - 0.1],
            rate * np.array([0.0, c, -s]),
            -(rate**2) * np.array([0.0, s, c]),
        )

    contacts = fb.Contacts.feet(robot, mu=0.6)
    walk = Walk(robot, contacts, Gait.trot(robot), tasks=[fb.FrameTask(frame, circle)])
    push = fb.Push([0.0, 150.0, 0.0], start=3.0)
    run = fb.rollout(fb.Simulation(robot), walk, 6.0, [push], 2e-3)
    error = 1e3 * max(
        np.linalg.norm(run.state(i).point(frame) - circle(run.time[i])[0])
        for i in range(0, len(run), 5)
    )
    return (
        "anymal_kinova: hand on a circle in the world, trot, push of 150 N (2 ms)",
        f"{run.outcome}, hand within {error:.1f} mm",
        "≤ 5 mm",
        run.outcome == "completed" and error <= 5.0,
    )


def step_time(name: str, gait: Callable[[fb.Robot], Gait], impulse: float) -> Row:
    """Time the control steps of a walk beside those of a bare controller, in turns.

    At 2.4 s, a push of `impulse` [N s] makes some steps infeasible.
    """
    robot, contacts = robot_of(name)
    walk, sim = Walk(robot, contacts, gait(robot), (0.2, 0.0)), fb.Simulation(robot)
    swinging_feet = walk.gait.stance(walk.gait.start + walk.gait.swing / 2.0)
    tasks = fb.standing_tasks(robot.standing())
    bare = fb.WholeBodyController(robot, contacts.only(*swinging_feet), tasks)
    push = fb.Push(np.array([0.0, impulse / 0.1, 0.0]), 2.4)
    times: dict[str, list[float]] = {"walk": [], "bare": []}
    swinging, softened, backends = [], 0, set()
    while sim.time < 4.0 and not sim.fallen:
        q, v, t = sim.q, sim.v, sim.time
        begin = time.thread_time_ns()
        command = walk(q, v, t)
        middle = time.thread_time_ns()
        bare.attempt(q, v, t)
        times["walk"].append((middle - begin) / 1e3)
        times["bare"].append((time.thread_time_ns() - middle) / 1e3)
        swinging.append(bool(walk.swings))
        softened += command.softened
        backends.add(command.backend)
        sim.advance(command.tau, (push,))
    walks, bares = np.array(times["walk"]), np.array(times["bare"])
    calm = np.array(swinging) & (np.arange(len(walks)) < 2400)
    ratio, p99 = np.median(walks[calm]) / np.median(bares[calm]), np.percentile(walks, 99)
    found = (
        f"{np.median(walks[calm]):.0f} µs with swings, bare {np.median(bares[calm]):.0f} µs: "
        f"{ratio:.2f} times; 99 % ≤ {p99:.0f} µs, slowest {walks[1:].max() / 1e3:.1f} ms; "
        f"{softened} steps softened, {' and '.join(sorted(backends))}"
    )
    return (
        f"{name}: a control step of `Walk`, {impulse:g} N s at 2.4 s",
        found,
        "≤ 2 times, 99 % ≤ 1000 µs",
        ratio <= 2.0 and p99 <= 1000.0,
    )


def first_infeasible() -> Row:
    robot = fb.load("talos")
    state, contacts = robot.standing(), fb.Contacts.feet(robot, mu=0.6)
    weak = {"torque_limits": 0.2 * robot.torque_limits, "min_normal_force": 200.0}
    controller = fb.WholeBodyController(
        robot, contacts, fb.standing_tasks(state), on_infeasible="soften", **weak
    )
    v = np.r_[0.0, 3.0, 0.0, 3.0, np.zeros(robot.nv - 4)]
    times = []
    for _ in range(20):
        begin = time.thread_time_ns()
        command = controller(state.q, v)
        times.append((time.thread_time_ns() - begin) / 1e6)
    return (
        "talos: infeasible control step, softened",
        f"first {times[0]:.1f} ms, then {np.median(times):.1f} ms",
        "first ≤ 5 ms",
        command.softened and times[0] <= 5.0,
    )


def at(period: float) -> str:
    return "" if period == 1e-3 else f" ({1e3 * period:g} ms)"


def rows(n: int) -> Iterator[Callable[[], Row]]:
    for period in (1e-3, 2e-3):
        for name, most in (("go2", 1.5), ("solo12", 0.3)):
            yield lambda name=name, period=period: lifted(name, period)
            yield lambda name=name, most=most, period=period: crawled(name, most, period)
        for one in (in_place, trotted, one_leg, talos_walks):
            yield lambda one=one, period=period: one(period)
        for force in (60.0, 200.0):
            yield lambda force=force, period=period: pushed(force, period)
    yield lambda: talos_pushed(max(1, 12 * n // 30))
    yield lambda: recovered("go2", 100.0, 400.0, lambda robot: Gait.trot(robot, swing=0.2), n)
    yield lambda: recovered("talos", 300.0, 600.0, lambda robot: Gait.walk(robot, swing=0.4), n)
    for yaw_rate in (0.5, 1.5):
        yield lambda yaw_rate=yaw_rate: turned(yaw_rate)
    for gait, mu in (("walk", 0.6), ("pace", 0.8), ("bound", 0.6), ("bound", 1.0), ("pronk", 0.6)):
        yield lambda gait=gait, mu=mu: gait_walked("go2", gait, mu)
    yield bolt_walked
    for degrees, known in ((5.0, False), (5.0, True), (-5.0, True)):
        yield lambda degrees=degrees, known=known: sloped(degrees, known)
    yield hand_held
    yield first_infeasible
    yield lambda: step_time("go2", Gait.trot, 30.0)
    yield lambda: step_time("talos", Gait.walk, 90.0)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--pushes", type=int, default=30, help="pushes per series, 30 by default")
    given = parser.parse_args()
    lines = ["| test | measured | required | |", "|---|---|---|---|"]
    for row in rows(given.pushes):
        what, found, required, holds = row()
        lines.append(f"| {what} | {found} | {required} | {'met' if holds else '**missed**'} |")
        print(lines[-1], flush=True)
    if given.pushes == 30:
        text = (
            f"# Walking: measured results\n\nMade by `python benchmarks/walking.py` with floatbase "
            f"{fb.__version__}. Friction is 0.6 in the controller and 1 on the ground; pushes last "
            f"0.1 s. The control period is 1 ms, or 2 ms where noted.\n\n" + "\n".join(lines) + "\n"
        )
        Path(__file__).with_suffix(".md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
