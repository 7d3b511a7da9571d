"""Measure the controller's control step, and check that its backends agree.

    python benchmarks/tick.py                    times, growth -> benchmarks/tick.md, tick.png
    python benchmarks/tick.py --agreement 2000   compares the backends on that many random states
                                                 for each robot and stance
    python benchmarks/tick.py --joint-limits     control steps with inactive joint limits
                                                 relative to control steps without joint limits

Both backends run alternately on the same states. The ratios are reliable; the microseconds depend
on the machine.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import platform
import time
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np

import floatbase as fb
from floatbase.control import JointLimits, LinearInequality
from floatbase.dynamics import EquationsOfMotion, LinearConstraint
from floatbase.errors import InfeasibleError

HERE = Path(__file__).parent
ROBOTS = ("go2", "solo12", "talos")
BACKENDS = ("compiled", "reference")
SPREADS = {"easy": 0.02, "medium": 0.1, "saturated": 0.3}
JOINT_LIMITS = ("position limit", "velocity limit", "acceleration limit")  # kinds of constraints


def two_points(robot: fb.Robot) -> fb.Contacts:
    """Return point contacts at the first two feet."""
    return fb.Contacts.points(robot, frames=[foot.frame for foot in robot.feet[:2]])


def controller(
    robot: fb.Robot, backend: str = "compiled", **options: object
) -> fb.WholeBodyController:
    """Make a controller that stands on all feet."""
    contacts = options.pop("contacts") if "contacts" in options else fb.Contacts.feet(robot)
    return fb.WholeBodyController(
        robot, contacts, fb.standing_tasks(robot.standing()), backend=backend, **options
    )


def states(robot: fb.Robot, n: int, spread: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the same random configurations and velocities every time."""
    found = [robot.random_state(seed, spread) for seed in range(n)]
    return [(np.array(s.q), np.array(s.v)) for s in found]


def clock(call: Callable[..., object], arguments: Sequence[tuple[object, ...]]) -> np.ndarray:
    """Measure each call [µs]."""
    times = np.empty(len(arguments))
    for i, args in enumerate(arguments):
        start = time.perf_counter_ns()
        call(*args)
        times[i] = 1e-3 * (time.perf_counter_ns() - start)
    return times


def interleaved(
    calls: Sequence[Callable[..., object]], arguments: Sequence[tuple[object, ...]], rounds: int
) -> list[np.ndarray]:
    """Measure several functions alternately, so that other load affects all of them."""
    blocks = [[clock(call, arguments) for call in calls] for _ in range(rounds)]
    return [np.concatenate([block[i] for block in blocks]) for i in range(len(calls))]


# tick time ----------------------------------------------------------------------------------------


def tick_times(n: int) -> Iterator[str]:
    """Measure both backends by robot and difficulty."""
    yield (
        "| robot | states | active rows | compiled median | compiled p99 | reference median | "
        "reference p99 | speed-up |"
    )
    yield "|---" * 8 + "|"
    for name in ROBOTS:
        robot = fb.load(name)
        controllers = [controller(robot, backend) for backend in BACKENDS]
        for label, spread in SPREADS.items():
            at = states(robot, n, spread)
            active = np.mean([len(controllers[0](q, v).active) for q, v in at[:50]])
            numbers = np.concatenate(
                [np.percentile(times, [50, 99]) for times in interleaved(controllers, at, 3)]
            )
            text = " | ".join(f"{number:.1f} µs" for number in numbers)
            yield f"| {name} | {label} | {active:.1f} | {text} | {numbers[2] / numbers[0]:.0f} × |"


def parts(n: int) -> Iterator[str]:
    """The compiled tick taken apart: it is stopped after one part, two, ..., and the times are
    taken from each other.
    """
    from floatbase.control.tick import tick

    yield ("| robot | states | dynamics | rows | elimination | objective | optimum | Python them |")
    yield "|---" * 8 + "|"
    for name in ROBOTS:
        robot = fb.load(name)
        command = controller(robot)
        compiled = command.compiled
        numbers = compiled.empty_result(compiled.default_inputs)
        for label, spread in SPREADS.items():
            spent = []
            for q, v in states(robot, n, spread):
                update = clock(compiled.dynamics.update, [(q, v)] * 5)
                given = (q, v, compiled.default_inputs.packed, *compiled.arguments, numbers)
                ticks = [
                    clock(tick.tick, [(*given, last)] * 5) for last in range(1, tick.N_STAGES + 1)
                ]
                ends = [np.min(times) for times in (update, *ticks, clock(command, [(q, v)] * 5))]
                spent.append([ends[0], *np.diff([0.0, *ends[1:-1]]), ends[-1] - ends[0] - ends[-2]])
            yield (
                f"| {name} | {label} | "
                + " | ".join(f"{number:.1f} µs" for number in np.median(spent, axis=0))
                + " |"
            )


class OwnCoM:
    """`fb.CoMTask` as a user would write it."""

    name, weight, block = "my centre of mass", 10.0, "qdd"

    def __init__(self, target: np.ndarray):
        self.target = target

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> fb.Affine:
        s = eom.state
        desired = -100.0 * (s.com - self.target) - 20.0 * s.com_velocity
        return fb.Affine(s.com_jacobian, s.com_drift - desired)


def own(n: int) -> Iterator[str]:
    """The same problem with the package's task for the centre of mass, with a user's, and with rows
    and a constraint beside.
    """
    yield (
        "| robot | states | built-in tasks | user-defined task | user-defined task and 2 "
        "inequalities | user-defined constraint | user-defined task, reference |"
    )
    yield "|---" * 7 + "|"
    for name in ROBOTS:
        robot = fb.load(name)
        at, feet = robot.standing(), fb.Contacts.feet(robot)
        joint = np.eye(robot.nv)[-1:]
        tasks = fb.standing_tasks(at)
        mine = [OwnCoM(at.com), *tasks[1:]]
        inequality = LinearInequality(
            "acceleration", "qdd", (np.vstack([joint, -joint]), np.full(2, 50.0))
        )
        held = feet + fb.Contacts(
            [LinearConstraint("held", 1, lambda state, t, joint=joint: (joint, np.zeros(1)))]
        )
        ways = [
            fb.WholeBodyController(robot, feet, tasks, backend="compiled"),
            fb.WholeBodyController(robot, feet, mine, backend="compiled"),
            fb.WholeBodyController(
                robot, feet, mine, inequalities=[inequality], backend="compiled"
            ),
            fb.WholeBodyController(robot, held, tasks, backend="compiled"),
            fb.WholeBodyController(robot, feet, mine, backend="reference"),
        ]
        for label in ("easy", "saturated"):
            medians = [
                np.median(times) for times in interleaved(ways, states(robot, n, SPREADS[label]), 3)
            ]
            yield (
                f"| {name} | {label} | "
                + " | ".join(f"{median:.1f} µs" for median in medians)
                + " |"
            )


# joint limits -------------------------------------------------------------------------------------


def joint_limits(n: int, rounds: int = 40) -> Iterator[str]:
    """Measure the cost of joint limits in states in which none is active."""
    yield "| robot | states | without, median | hard, ratio | soft, ratio |"
    yield "|---" * 5 + "|"
    for name in ROBOTS:
        robot = fb.load(name)
        off, hard, soft = (
            controller(robot, joint_limits=limits)
            for limits in (None, JointLimits.of(robot, weight=None), "robot")
        )
        at = [
            (q, v)
            for q, v in states(robot, n, SPREADS["easy"])
            if not any(row.kind.endswith(JOINT_LIMITS) for row in hard(q, v).active)
        ]
        times = np.reshape(interleaved((off, hard, soft), at, rounds), (3, rounds, -1))
        medians = np.median(times, axis=2)
        ratios = np.median(medians[1:] / medians[0], axis=1)
        yield (
            f"| {name} | {len(at)} | {np.median(times[0]):.1f} µs | {ratios[0]:.3f} | "
            f"{ratios[1]:.3f} |"
        )


# growth -------------------------------------------------------------------------------------------


def growth(n: int) -> dict[str, list[tuple[float, ...]]]:
    """Measure medians [µs] by facets, contacts and degrees of freedom; easy and saturated."""
    go2, talos = fb.load("go2"), fb.load("talos")
    frames = [foot.frame for foot in go2.feet]
    families = {
        "facets (go2)": [
            (n_facets, controller(go2, facets=n_facets)) for n_facets in (4, 8, 16, 32, 64)
        ],
        "contacts (go2)": [
            (i, controller(go2, contacts=fb.Contacts.points(go2, frames=frames[:i])))
            for i in (1, 2, 3, 4)
        ],
        "joints (two points)": [
            (r.d, controller(r, contacts=two_points(r)))
            for r in (go2, fb.load("anymal_kinova"), talos)
        ],
    }
    found: dict[str, list[tuple[float, ...]]] = {}
    for family, members in families.items():
        times = {}
        for spread in (0.02, 0.3):
            at = [states(member.robot, n, spread) for _, member in members]
            for _ in range(8):
                for i, (_, member) in enumerate(members):
                    times.setdefault((i, spread), []).append(clock(member, at[i]))
        found[family] = [
            (x, *(float(np.median(np.concatenate(times[i, spread]))) for spread in (0.02, 0.3)))
            for i, (x, _) in enumerate(members)
        ]
    return found


def plot(curves: dict[str, list[tuple[float, ...]]]) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(
        1, len(curves), figsize=(11, 3.4), constrained_layout=True, sharey=True
    )
    figure.suptitle("Control step of the compiled backend")
    top = 1.1 * max(max(row[1:]) for rows in curves.values() for row in rows)
    for ax, (family, rows) in zip(axes, curves.items(), strict=True):
        x, easy, saturated = np.array(rows).T
        ax.plot(x, easy, "o-", label="easy")
        ax.plot(x, saturated, "s-", label="saturated")
        ax.set(xlabel=family, ylim=(0, top), xticks=x)
        ax.grid(alpha=0.3)
    axes[0].set(ylabel="median control step [µs]", xticks=[4, 16, 32, 64])
    axes[0].legend()
    figure.savefig(HERE / "tick.png", dpi=120)


# agreement, long run ------------------------------------------------------------------------------


def agreement(n: int, names: Sequence[str] = ()) -> Iterator[str]:
    """Find the largest torque difference of the backends over n random states per stance."""
    yield (
        "| robot | feet | states | infeasible | left to the reference backend | largest "
        "difference |"
    )
    yield "|---" * 6 + "|"
    for name in names or fb.catalogue():
        robot = fb.load(name)
        feet = fb.Contacts.feet(robot)
        for count in range(min(1, len(feet)), len(feet) + 1):
            contacts = feet.only(*feet.names[:count]) if count else feet
            compiled, reference = (
                controller(robot, backend, contacts=contacts) for backend in BACKENDS
            )
            worst, left, infeasible = 0.0, 0, 0
            for seed in range(n):
                state = robot.random_state(seed, tuple(SPREADS.values())[seed % 3])
                try:
                    expected = reference(state.q, state.v)
                except InfeasibleError as error:
                    infeasible += 1
                    check_verdict(compiled, state, error.constraints, f"{name}, state {seed}")
                    continue
                found = compiled(state.q, state.v)
                left += found.backend == "reference"
                worst = max(worst, float(np.max(np.abs(found.tau - expected.tau))))
            yield f"| {name} | {count} | {n} | {infeasible} | {left} | {worst:.1e} N·m |"


def check_verdict(
    compiled: fb.WholeBodyController, state: fb.State, rows: Sequence[str], where: str
) -> None:
    """Exit unless the controller reports the state as infeasible, with the same constraints."""
    try:
        compiled(state.q, state.v)
    except InfeasibleError as error:
        if error.constraints != rows:
            raise SystemExit(f"{where}: other constraints on the compiled backend") from None
        return
    raise SystemExit(f"{where}: not infeasible on the compiled backend")


def long_run(ticks: int) -> Iterator[str]:
    """Measure memory and time per control step over a long run."""
    import resource

    robot = fb.load("go2")
    compiled, at = controller(robot), states(robot, 1000, 0.1)
    for share in range(5):
        spent = np.concatenate([clock(compiled, at) for _ in range(max(1, ticks // 5000))])
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        yield f"| {(share + 1) * len(spent)} | {np.median(spent):.2f} µs | {memory:.1f} MB |"


def machine() -> str:
    """Describe the machine and the versions."""
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        cpu = next(
            line.split(":")[1].strip()
            for line in info.read_text().splitlines()
            if line.startswith("model name")
        )
    names = ("numpy", "pin", "numba", "daqp", "mujoco")
    packages = ", ".join(
        [f"floatbase {fb.__version__}", *(f"{name} {version(name)}" for name in names)]
    )
    return (
        f"{cpu}, {os.cpu_count()} cores, one used; Python {platform.python_version()}, {packages}"
    )


def main() -> None:
    ask = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    ask.add_argument(
        "--states", type=int, default=400, help="random states for each row of the table"
    )
    ask.add_argument(
        "--agreement",
        type=int,
        default=0,
        help="compare the backends on so many states, and measure no times",
    )
    ask.add_argument(
        "--long", type=int, default=0, help="run so many ticks, and measure nothing else"
    )
    ask.add_argument(
        "--joint-limits", action="store_true", help="measure the cost of joint limits, nothing else"
    )
    options = ask.parse_args()
    only = None
    if options.agreement:
        only = agreement(options.agreement)
    elif options.long:
        only = long_run(options.long)
    elif options.joint_limits:
        only = joint_limits(options.states)
    if only:
        for line in only:
            print(line, flush=True)
        return
    curves = growth(options.states // 4)
    plot(curves)
    lines = [
        "# Computing time of a control step",
        "",
        f"`python benchmarks/tick.py` on {machine()}.",
        "",
    ]
    lines += [
        "States are random around standing. Joint angles and attitude vary by 0.02 rad (easy), "
        "0.1 rad (medium) and 0.3 rad (saturated: friction"
    ]
    lines += [
        "or torque limits are active in most of them), velocities by as much per second.",
        "",
    ]
    lines += [*tick_times(options.states), ""]
    lines += [
        "Parts of the compiled control step (stopped after each part, best of 5, median over "
        "states):",
        "",
        *parts(options.states // 4),
        "",
    ]
    lines += [
        "User-defined terms, called at every control step beside the compiled code (median):",
        "",
        *own(options.states // 4),
        "",
    ]
    lines += [
        "Growth of the median control step (tick.png):",
        "",
        "| what | number | easy | saturated |",
        "|---|---|---|---|",
    ]
    lines += [
        f"| {what} | {x} | {a:.1f} µs | {b:.1f} µs |"
        for what, rows in curves.items()
        for x, a, b in rows
    ]
    lines.append("")
    (HERE / "tick.md").write_text("\n".join(lines), encoding="utf-8")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
