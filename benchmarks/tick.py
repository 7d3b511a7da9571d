"""Measure the control step of both backends.

    python benchmarks/tick.py                    times, growth -> benchmarks/tick.md, tick.png
    python benchmarks/tick.py --joint-limits     control steps with inactive joint limits
                                                 relative to control steps without joint limits

Both backends run alternately on the same states. The ratios are reliable; the microseconds depend
on the machine.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import harness
import numpy as np
from harness import ROBOTS, SPREADS, clock, interleaved, microseconds, states

import floatbase as fb
from floatbase.control import JointLimits, LinearInequality, capture_point_inequality
from floatbase.control.tick import tick
from floatbase.dynamics import (
    EquationsOfMotion,
    LinearConstraint,
    RollingWheel,
    fixed_frame,
    moving_frame,
)
from floatbase.objectives import (
    AngularMomentumTask,
    AxisTask,
    CentreOfPressureTask,
    RelativePoseTask,
    Task,
)

BACKENDS = ("compiled", "reference")
JOINT_LIMITS = ("position limit", "velocity limit", "acceleration limit")  # kinds of constraints
Rows = Iterator[list[object]]


def controller(
    robot: fb.Robot, backend: str = "compiled", contacts: fb.Contacts | None = None, **options: Any
) -> fb.WholeBodyController:
    """Make a controller that stands, by default on all feet."""
    contacts = fb.Contacts.feet(robot) if contacts is None else contacts
    tasks = fb.standing_tasks(robot.standing())
    return fb.WholeBodyController(robot, contacts, tasks, backend=backend, **options)


# tick time ----------------------------------------------------------------------------------------


def tick_times(n: int) -> Rows:
    """Measure both backends by robot and difficulty."""
    for name in ROBOTS:
        robot = fb.load(name)
        controllers = [controller(robot, backend) for backend in BACKENDS]
        for label, spread in SPREADS.items():
            at = states(robot, n, spread)
            active = np.mean([len(controllers[0](q, v).active) for q, v in at[:50]])
            compiled, reference = (
                np.percentile(times, [50, 99]) for times in interleaved(controllers, at, 3)
            )
            times = microseconds([*compiled, *reference])
            yield [name, label, f"{active:.1f}", *times, f"{reference[0] / compiled[0]:.0f} ×"]


def parts(n: int) -> Rows:
    """Take the compiled step apart: stop it after each part, and subtract the times."""
    for name in ROBOTS:
        robot = fb.load(name)
        command = controller(robot)
        compiled = command.compiled
        for label, spread in SPREADS.items():
            spent = []
            for q, v in states(robot, n, spread):
                given = (q, v, compiled.default_inputs)
                ticks = [
                    clock(compiled.run, [(*given, last)] * 5)
                    for last in range(1, tick.N_STAGES + 1)
                ]
                ends = [np.min(times) for times in (*ticks, clock(command, [(q, v)] * 5))]
                spent.append(np.diff([0.0, *ends]))
            yield [name, label, *microseconds(np.median(spent, axis=0))]


class OwnCoM:
    """`fb.CoMTask` as a user would write it."""

    name, weight, block = "my centre of mass", 10.0, "qdd"

    def __init__(self, target: np.ndarray):
        self.target = target

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> fb.Affine:
        s = eom.state
        desired = -100.0 * (s.com - self.target) - 20.0 * s.com_velocity
        return fb.Affine(s.com_jacobian, s.com_drift - desired)


def own(n: int) -> Rows:
    """Measure user-defined tasks, inequalities and constraints on one problem."""
    for name in ROBOTS:
        robot = fb.load(name)
        at, feet = robot.standing(), fb.Contacts.feet(robot)
        joint = np.eye(robot.nv)[-1:]
        tasks = fb.standing_tasks(at)
        mine = [OwnCoM(at.com), *tasks[1:]]
        bounds = np.vstack([joint, -joint]), np.full(2, 50.0)
        limited = {"inequalities": [LinearInequality("acceleration", "qdd", bounds)]}
        held = feet + fb.Contacts(
            [LinearConstraint("held", 1, lambda state, t, joint=joint: (joint, np.zeros(1)))]
        )
        controllers = [
            fb.WholeBodyController(robot, feet, tasks, backend="compiled"),
            fb.WholeBodyController(robot, feet, mine, backend="compiled"),
            fb.WholeBodyController(robot, feet, mine, backend="compiled", **limited),
            fb.WholeBodyController(robot, held, tasks, backend="compiled"),
            fb.WholeBodyController(robot, feet, mine, backend="reference"),
        ]
        for label in ("easy", "saturated"):
            times = interleaved(controllers, states(robot, n, SPREADS[label]), 3)
            yield [name, label, *microseconds(np.median(times, axis=1))]


# tasks --------------------------------------------------------------------------------------------


def added_tasks(robot: fb.Robot) -> list[Task]:
    """Return one task of each class of the package."""
    at, (first, *_, last) = robot.standing(), [foot.frame for foot in robot.feet]
    pose = at.frame_pose(first).actInv(at.frame_pose(last))
    return [
        *fb.standing_tasks(at),
        fb.FrameTask(first, at.point(first)),
        AxisTask("base", [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]),
        RelativePoseTask(last, first, pose),
        AngularMomentumTask(),
        CentreOfPressureTask([*at.com[:2], 0.0]),
        fb.ForceTask(),
        fb.TorqueTask(),
    ]


def added_inequalities(robot: fb.Robot) -> dict[str, LinearInequality]:
    """Return inequalities that hold, of each kind of the package."""
    k = fb.Contacts.feet(robot).k
    rows = {
        f"LinearInequality on {block}": LinearInequality(block, block, (np.eye(n), np.full(n, 1e4)))
        for block, n in (("qdd", robot.nv), ("tau", robot.d), ("forces", k))
    }
    return rows | {"capture_point_inequality": capture_point_inequality()}


def added_contacts(robot: fb.Robot) -> dict[str, fb.Contacts]:
    """Return contacts with each kind of constraint; wheels replace the feet."""
    feet, frame = fb.Contacts.feet(robot), "base"
    wheels = [RollingWheel(foot.frame, [0.0, 1.0, 0.0], 0.02) for foot in robot.feet]
    return {
        "fixed_frame": feet + fb.Contacts([fixed_frame(frame)]),
        "moving_frame": feet + fb.Contacts([moving_frame(frame, lambda t: np.zeros(3))]),
        "RollingWheel": fb.Contacts(wheels),
    }


def one_more_task(n: int) -> Rows:
    """Measure the control step with each task, inequality or constraint, relative to without."""
    for name in ("go2", "g1", "talos"):
        robot = fb.load(name)
        feet, standing = fb.Contacts.feet(robot), fb.standing_tasks(robot.standing())
        added = {
            "": controller(robot),
            **{
                type(task).__name__: fb.WholeBodyController(robot, feet, [*standing, task])
                for task in added_tasks(robot)
            },
            **{
                label: controller(robot, inequalities=[each])
                for label, each in added_inequalities(robot).items()
            },
            **{
                label: controller(robot, contacts=contacts)
                for label, contacts in added_contacts(robot).items()
            },
            "contact_weight": controller(robot, contact_weight=1e4),
        }
        at = states(robot, n, SPREADS["easy"])
        without, *times = np.median(interleaved(list(added.values()), at, 3), axis=1)
        for label, after in zip(list(added)[1:], times, strict=True):
            yield [name, label, *microseconds([without, after]), f"{after / without:.2f}"]


# joint limits -------------------------------------------------------------------------------------


def joint_limits(n: int, rounds: int = 40) -> Rows:
    """Measure the cost of joint limits in states in which none is active."""
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
        yield [name, len(at), f"{np.median(times[0]):.1f} µs", *(f"{x:.3f}" for x in ratios)]


# growth -------------------------------------------------------------------------------------------


def growth(n: int) -> dict[str, list[tuple[float, ...]]]:
    """Measure medians [µs] by facets, contacts and degrees of freedom; easy and saturated."""
    go2, kinova, talos = map(fb.load, ("go2", "anymal_kinova", "talos"))

    def points(robot: fb.Robot, count: int) -> fb.Contacts:
        """Return point contacts at the first feet."""
        return fb.Contacts.points(robot, frames=[foot.frame for foot in robot.feet[:count]])

    families = {
        "facets (go2)": [(m, controller(go2, facets=m)) for m in (4, 8, 16, 32, 64)],
        "contacts (go2)": [(i, controller(go2, contacts=points(go2, i))) for i in (1, 2, 3, 4)],
        "joints (two points)": [
            (robot.d, controller(robot, contacts=points(robot, 2)))
            for robot in (go2, kinova, talos)
        ],
    }
    found: dict[str, list[tuple[float, ...]]] = {}
    for family, members in families.items():
        medians = []
        for spread in (SPREADS["easy"], SPREADS["saturated"]):
            at = [states(member.robot, n, spread) for _, member in members]
            times = [
                [clock(member, at[i]) for i, (_, member) in enumerate(members)] for _ in range(8)
            ]
            medians.append([np.median([turn[i] for turn in times]) for i in range(len(members))])
        found[family] = [
            (x, easy, saturated) for (x, _), easy, saturated in zip(members, *medians, strict=True)
        ]
    return found


def plot(curves: dict[str, list[tuple[float, ...]]]) -> None:
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
    figure.savefig(Path(__file__).with_suffix(".png"), dpi=120)


def main() -> None:
    parser = harness.command_line(__doc__, states=(400, "random states for each row of a table"))
    parser.add_argument(
        "--joint-limits", action="store_true", help="only measure the cost of joint limits"
    )
    options = parser.parse_args()
    if options.joint_limits:
        harness.table(
            "robot | states | without, median | hard, ratio | soft, ratio",
            joint_limits(options.states),
        )
        return
    few = options.states // 4
    curves = growth(few)
    plot(curves)
    harness.write(
        __file__,
        "Computing time of a control step",
        f"`python benchmarks/tick.py` on {harness.machine()}.",
        "States are random around standing. Joint angles and attitude vary by 0.02 rad (easy), "
        "0.1 rad (medium) and 0.3 rad (saturated: friction\nor torque limits are active in most of "
        "them), velocities by as much per second.",
        harness.table(
            "robot | states | active rows | compiled median | compiled p99 | reference median | "
            "reference p99 | speed-up",
            tick_times(options.states),
        ),
        "Parts of the compiled control step (stopped after each part, best of 5, median over "
        "states):",
        harness.table(
            "robot | states | dynamics | rows | elimination | objective | optimum | "
            "Python overhead",
            parts(few),
        ),
        "User-defined terms, called at every control step beside the compiled code (median):",
        harness.table(
            "robot | states | built-in tasks | user-defined task | user-defined task and 2 "
            "inequalities | user-defined constraint | user-defined task, reference",
            own(few),
        ),
        "Each task, inequality or constraint added to `standing_tasks` (median):",
        harness.table("robot | added | without | with | ratio", one_more_task(few)),
        "Growth of the median control step (tick.png):",
        harness.table(
            "what | number | easy | saturated",
            ([what, x, *microseconds(row)] for what, rows in curves.items() for x, *row in rows),
        ),
    )


if __name__ == "__main__":
    main()
