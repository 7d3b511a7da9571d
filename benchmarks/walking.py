"""Measure how well robots walk on MuJoCo, and compare with the requirements.

    python benchmarks/walking.py             -> benchmarks/walking.md
    python benchmarks/walking.py --pushes 6  fewer pushes, for a quick look

Friction is 0.6 in the controller and 1 on the ground; pushes last 0.1 s. The control period is
1 ms, or 2 ms where noted.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import harness
import numpy as np
from harness import tilt, velocity

import floatbase as fb
from floatbase.behaviours import Gait, Stand, Walk
from floatbase.simulation import Rollout

SEED = 0
Check = tuple[str, str, bool]  # what was found, what is required, whether it holds
Row = tuple[str, str, str, bool]  # the same of several checks, after what was done


def most(found: str, value: float, limit: float, unit: str = " mm") -> Check:
    return found.format(value), f"≤ {limit:g}{unit}", bool(value <= limit)


def near(found: str, value: float, target: float, share: float, named: str = "") -> Check:
    """Check that a value differs from a target by at most a share of it."""
    holds = abs(value / target - 1.0) <= share
    return found.format(value), f"{named}± {100 * share:g} %", bool(holds)


def judged(what: str, run: Rollout, *checks: Check) -> Row:
    """Return the row of a run that has to be completed and to pass checks."""
    found, required, holds = zip(*checks, strict=True)
    done = run.outcome == "completed"
    limits = ", ".join(filter(None, required))
    return what, ", ".join([run.outcome, *found]), limits or "completed", done and all(holds)


def walked(
    name: str,
    gait: Callable[[fb.Robot], Gait],
    speed: float,
    duration: float,
    *pushes: fb.Push,
    period: float = 1e-3,
    **options: object,
) -> tuple[Rollout, Walk]:
    robot, contacts = harness.walker(name)
    walk = Walk(robot, contacts, gait(robot), (speed, 0.0), **options)
    return fb.rollout(fb.Simulation(robot), walk, duration, pushes, period), walk


def horizontal(force: float, angle: float, start: float) -> fb.Push:
    return fb.Push(force * np.array([np.cos(angle), np.sin(angle), 0.0]), start)


def jump(run: Rollout) -> float:
    """Return the median over changes of stance of the largest jump of a torque [N·m]."""
    changes = [i for i in range(1, len(run)) if run.contacts_at(i) is not run.contacts_at(i - 1)]
    return float(
        np.median([np.abs(run.tau_desired[i] - run.tau_desired[i - 1]).max() for i in changes])
    )


def foot_drift(run: Rollout) -> float:
    """Return how far a foot is from its first position at the end [mm]."""
    return 1e3 * np.linalg.norm(run.foot_positions[-1] - run.foot_positions[0], axis=1).max()


def peak(run: Rollout) -> float:
    """Return the largest normal force at a point, as a fraction of the weight."""
    return run.measured[:, 2::3].max() / run.robot.weight


def lifted(name: str, period: float) -> Row:
    def gait(robot: fb.Robot) -> Gait:
        return replace(Gait.crawl(robot, 1.2, 1.0), stop=9.0)

    run, walk = walked(name, gait, 0.0, 11.0, period=period)
    rise = 1e3 * (run.foot_positions[:, :, 2].max(axis=0) - run.foot_positions[0, :, 2]).min()
    # feet roll by millimetres while it comes there
    com = 1e3 * np.linalg.norm(run.com[-1, :2] - walk.plan(run.time[-1])[0])
    return judged(
        f"{name}: each foot raised 5 cm{at(period)}",
        run,
        (f"{rise:.1f} mm", "≥ 48 mm", bool(rise >= 48.0)),
        most("CoM {:.1f} mm from its target", com, 1.0),
        most("tilt {:.2f}°", tilt(run), 0.3, "°"),
        most("drift {:.1f} mm", foot_drift(run), 10.0),
    )


def crawled(name: str, largest_jump: float, period: float) -> Row:
    step = 8.0 if name == "go2" else 6.0
    run, _ = walked(name, Gait.crawl, step / 100.0, 11.0, period=period)
    return judged(
        f"{name}: crawl{at(period)}",
        run,
        near("{:.1f} cm/s", 100.0 * velocity(run, 3.0, 11.0)[0], step, 0.05, f"{step:g} cm/s "),
        most("tilt {:.2f}°", tilt(run), 0.5, "°"),
        most("torque jump {:.2f} N·m", jump(run), largest_jump, " N·m"),
    )


def in_place(period: float) -> Row:
    run, _ = walked("go2", Gait.trot, 0.0, 11.0, period=period)
    drift = 1e3 * np.linalg.norm(run.com[-1, :2] - run.com[round(1.0 / period), :2])
    return judged(
        f"go2: trot in place 10 s{at(period)}",
        run,
        most("drift {:.1f} mm", drift, 20.0),
        most("tilt {:.2f}°", tilt(run), 0.5, "°"),
    )


def trotted(period: float) -> Row:
    run, _ = walked("go2", Gait.trot, 0.3, 11.0, period=period)
    return judged(
        f"go2: trot 0.3 m/s 10 s{at(period)}",
        run,
        near("{:.3f} m/s", velocity(run, 2.0, 11.0)[0], 0.3, 0.03),
        most("y {:.0f} mm", 1e3 * abs(run.com[-1, 1]), 30.0),
        most("tilt {:.2f}°", tilt(run), 0.5, "°"),
        most("foot peak {:.2f} weights", peak(run), 1.2, ""),
    )


def pushed(force: float, period: float) -> Row:
    push = fb.Push([0.0, force, 0.0], 4.0)
    run, _ = walked("go2", Gait.trot, 0.3, 8.0, push, period=period)
    aside = most("{:.0f} mm to the side", 1e3 * abs(run.com[-1, 1]), 150.0)
    angle = most("tilt {:.1f}°", tilt(run), 2.0, "°")
    if force > 60.0:  # it only has to stay on its feet
        aside, angle = (aside[0], "", True), (angle[0], "", True)
    return judged(f"go2: the same, {force:g} N to the side{at(period)}", run, aside, angle)


def one_leg(period: float) -> Row:
    run, _ = walked("talos", lambda robot: Gait.walk(robot, 2.6, 1.0), 0.0, 8.2, period=period)
    return judged(
        f"talos: one foot up 2.6 s each{at(period)}",
        run,
        most("tilt {:.2f}°", tilt(run), 0.2, "°"),
        most("feet back within {:.2f} mm", foot_drift(run), 2.0),
        most("torque jump {:.1f} N·m", jump(run), 20.0, " N·m"),
    )


def talos_walks(period: float) -> Row:
    run, walk = walked("talos", Gait.walk, 0.2, 11.0, period=period)
    steps, rows = list(walk.history), np.arange(round(2.0 / period), len(run), 10)
    plans = np.searchsorted([step.time for step in steps], run.time[rows], side="right") - 1
    errors = [
        np.linalg.norm(steps[p].plan(run.time[i])[0] - run.com[i, :2])
        for p, i in zip(plans, rows, strict=True)
    ]
    return judged(
        f"talos: 0.2 m/s 10 s{at(period)}",
        run,
        near("{:.3f} m/s", velocity(run, 2.4, 10.8)[0], 0.2, 0.03),
        most("CoM {:.1f} mm error", 1e3 * max(errors), 8.0),
        most("tilt {:.2f}°", tilt(run), 0.5, "°"),
        most("corner peak {:.2f} weights", peak(run), 0.9, ""),
    )


def talos_pushed(n: int) -> Row:
    rng, done, required = np.random.default_rng(SEED), 0, 10 * n // 12
    for _ in range(n):
        angle, phase = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.0, 1.4)
        push = horizontal(300.0, angle, 3.0 + phase)
        run, _ = walked("talos", Gait.walk, 0.2, 7.5, push, period=2e-3)
        done += run.outcome == "completed"
    what = f"talos: 0.2 m/s and 300 N, {n} random directions (2 ms)"
    return what, f"{done} of {n}", f"≥ {required}", done >= required


def recovered(name: str, low: float, high: float, gait: Callable[[fb.Robot], Gait], n: int) -> Row:
    robot, contacts = harness.walker(name)
    rng = np.random.default_rng(SEED)
    survived: dict[bool, list[bool]] = {False: [], True: []}
    for force, angle in rng.uniform([low, 0.0], [high, 2.0 * np.pi], (n, 2)):
        push = horizontal(force, angle, 0.5)
        for steps, outcomes in survived.items():
            stand = Stand(robot, contacts, gait(robot) if steps else None)
            run = fb.rollout(fb.Simulation(robot), stand, 4.0, [push], 2e-3)
            outcomes.append(run.outcome == "completed")
    stood, stepped = sum(survived[False]), sum(survived[True])
    lost = sum(a and not b for a, b in zip(survived[False], survived[True], strict=True))
    if name == "talos":
        enough = max(26 * n // 30, stood + 8 * n // 30)
    else:
        enough = max(27 * n // 30, 2 * stood)
    what = f"{name}: {n} pushes of {low:g} to {high:g} N (2 ms)"
    found = f"standing {stood}, with steps {stepped} of {n}; {lost or 'none'} lost by stepping"
    return what, found, f"steps ≥ {enough}, none lost", stepped >= enough and lost == 0


def gait_walked(name: str, gait: str, mu: float) -> Row:
    robot = fb.load(name)
    made, what = getattr(Gait, gait)(robot), f"{name}: {gait} 0.2 m/s, friction {mu:g} (2 ms)"
    try:
        walk = Walk(robot, fb.Contacts.feet(robot, mu=mu), made, (0.2, 0.0))
    except fb.FloatbaseError as error:
        return what, f"refused: {str(error).split(',')[0]}", "refused", gait in ("bound", "pronk")
    run = fb.rollout(fb.Simulation(robot), walk, 5.0, control_period=2e-3)
    whole_periods = made.period * np.floor(2.0 / made.period)
    speed = near("{:.3f} m/s", velocity(run, 4.99 - whole_periods, 4.99)[0], 0.2, 0.1)
    return judged(what, run, speed, most("tilt {:.1f}°", tilt(run), 2.0, "°"))


def step_time(name: str, gait: Callable[[fb.Robot], Gait], impulse: float) -> Row:
    """Time the control steps of a walk beside those of a bare controller, in turns.

    At 2.4 s, a push of `impulse` [N s] makes some steps infeasible.
    """
    robot, contacts = harness.walker(name)
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
        softened += bool(command.softened)
        backends.add(command.backend)
        sim._advance(command.tau, (push,))
    walks, bares = np.array(times["walk"]), np.array(times["bare"])
    calm = np.array(swinging) & (np.arange(len(walks)) < 2400)
    ratio, p99 = np.median(walks[calm]) / np.median(bares[calm]), np.percentile(walks, 99)
    found = (
        f"{np.median(walks[calm]):.0f} µs with swings, bare {np.median(bares[calm]):.0f} µs: "
        f"{ratio:.2f} times; 99 % ≤ {p99:.0f} µs, slowest {walks[1:].max() / 1e3:.1f} ms; "
        f"{softened} steps softened, {' and '.join(sorted(backends))}"
    )
    what = f"{name}: a control step of `Walk`, {impulse:g} N s at 2.4 s"
    return what, found, "≤ 2 times, 99 % ≤ 1000 µs", ratio <= 2.0 and p99 <= 1000.0


def first_infeasible() -> Row:
    robot = fb.load("talos")
    state, contacts = robot.standing(), fb.Contacts.feet(robot, mu=0.6)
    weak = {"torque_limits": 0.2 * robot.torque_limits, "min_normal_force": 200.0}
    controller = fb.WholeBodyController(
        robot, contacts, fb.standing_tasks(state), on_infeasible="soften", **weak
    )
    v = np.r_[0.0, 3.0, 0.0, 3.0, np.zeros(robot.nv - 4)]
    times = [1e3 * harness.work(controller, state.q, v) for _ in range(20)]
    found = f"first {times[0]:.1f} ms, then {np.median(times):.1f} ms"
    holds = controller(state.q, v).softened and times[0] <= 5.0
    return "talos: infeasible control step, softened", found, "first ≤ 5 ms", holds


def at(period: float) -> str:
    return "" if period == 1e-3 else f" ({1e3 * period:g} ms)"


def rows(n: int) -> Iterator[Row]:
    for period in (1e-3, 2e-3):
        for name, largest_jump in (("go2", 1.5), ("solo12", 0.3)):
            yield lifted(name, period)
            yield crawled(name, largest_jump, period)
        for measure in (in_place, trotted, one_leg, talos_walks):
            yield measure(period)
        for force in (60.0, 200.0):
            yield pushed(force, period)
    yield talos_pushed(max(1, 12 * n // 30))
    yield recovered("go2", 100.0, 400.0, lambda robot: Gait.trot(robot, swing=0.2), n)
    yield recovered("talos", 300.0, 600.0, lambda robot: Gait.walk(robot, swing=0.4), n)
    for gait, mu in (("walk", 0.6), ("pace", 0.8), ("bound", 0.6), ("bound", 1.0), ("pronk", 0.6)):
        yield gait_walked("go2", gait, mu)
    yield first_infeasible()
    yield step_time("go2", Gait.trot, 30.0)
    yield step_time("talos", Gait.walk, 90.0)
    yield step_time("g1", Gait.walk, 20.0)


def main() -> None:
    parser = harness.command_line(__doc__, pushes=(30, "pushes of each series"))
    pushes = parser.parse_args().pushes
    table = harness.table(
        "test | measured | required | ",
        ((*row, "met" if holds else "**missed**") for *row, holds in rows(pushes)),
    )
    if pushes == 30:
        harness.write(
            __file__,
            "Walking: measured results",
            f"Made by `python benchmarks/walking.py` with floatbase {fb.__version__}. Friction is "
            "0.6 in the controller and 1 on the ground; pushes last 0.1 s. The control period is "
            "1 ms, or 2 ms where noted.",
            table,
        )


if __name__ == "__main__":
    main()
