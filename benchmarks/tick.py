"""Measure the control step of both backends, and rollouts -> benchmarks/tick.md.

Functions that are compared run alternately on the same states. The ratios are reliable; the
microseconds depend on the machine.
"""

import gc
import time
from collections.abc import Iterator
from typing import Any

import harness
import numpy as np
from harness import ROBOTS, SPREADS, clock, interleaved, microseconds, states, work

import floatbase as fb
from floatbase.control import JointLimits, LinearInequality, capture_point_inequality
from floatbase.control.tick import tick
from floatbase.dynamics import (
    EquationsOfMotion,
    LinearConstraint,
    RollingWheel,
    fixed_frame,
    moving_frame,
    rigid_between,
)
from floatbase.objectives import (
    AngularMomentumTask,
    AxisTask,
    CentreOfPressureTask,
    RelativePoseTask,
    Task,
)
from floatbase.playground import ModelMismatch

BACKENDS = ("compiled", "reference")
COMPARED = ("go2", "g1", "talos")
Rows = Iterator[list[object]]


def controller(
    robot: fb.Robot, backend: str = "compiled", contacts: fb.Contacts | None = None, **options: Any
) -> fb.WholeBodyController:
    """Make a controller that stands, by default on all feet."""
    contacts = contacts or fb.Contacts.feet(robot)
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
    """Measure user-defined tasks and constraints on one problem."""
    for name in ROBOTS:
        robot = fb.load(name)
        at, feet = robot.standing(), fb.Contacts.feet(robot)
        tasks = fb.standing_tasks(at)
        mine = [OwnCoM(at.com), *tasks[1:]]
        held = feet + fb.Contacts(
            [LinearConstraint("held", 1, lambda s, t: (np.eye(s.robot.nv)[-1:], np.zeros(1)))]
        )
        controllers = [
            fb.WholeBodyController(robot, feet, tasks, backend="compiled"),
            fb.WholeBodyController(robot, feet, mine, backend="compiled"),
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
    return {
        "fixed_frame": feet + fb.Contacts([fixed_frame(frame)]),
        "moving_frame": feet + fb.Contacts([moving_frame(frame, lambda t: np.zeros(3))]),
        "rigid_between": feet + fb.Contacts([rigid_between(robot.feet[0].frame, frame)]),
        "RollingWheel": fb.Contacts([RollingWheel(f.frame, [0, 1, 0], 0.02) for f in robot.feet]),
    }


def one_more_task(n: int) -> Rows:
    """Measure the control step with each task, inequality or constraint, relative to without."""
    for name in COMPARED:
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


# other problems -----------------------------------------------------------------------------------


def other_problems(n: int) -> Rows:
    """Measure joint limits, other models and levels beside the weighted step on their backend."""
    for name in COMPARED:
        robot = fb.load(name)
        com, base, *rest = tasks = fb.standing_tasks(robot.standing())
        options: dict[str, dict[str, Any]] = {
            "hard joint limits": {"joint_limits": JointLimits.of(robot, weight=None)},
            "soft joint limits": {"joint_limits": "robot"},
            "mismatched model": {"modify_qp": ModelMismatch(mass=1.2)},
            "two levels": {"tasks": [[com, base], rest]},
            "three levels": {"tasks": [[com], [base], rest]},
        }
        for what, changed in options.items():
            given = {"tasks": tasks, "joint_limits": None} | changed
            other = fb.WholeBodyController(robot, fb.Contacts.feet(robot), **given)
            plain = controller(robot, other.backend, joint_limits=None)
            at = states(robot, n if other.backend == "compiled" else n // 10, SPREADS["easy"])
            without, after = np.median(interleaved((plain, other), at, 3), axis=1)
            times = microseconds([without, after])
            yield [name, what, other.backend, *times, f"{after / without:.2f}"]


def worst_steps(n: int) -> Rows:
    """Measure many steps and as many empty calls, with garbage collection, in processor time."""
    assert gc.isenabled()
    for name in COMPARED:
        robot = fb.load(name)
        at = [state for state in states(robot, 100, SPREADS["easy"]) for _ in range(n // 100)]
        for what, call in (("control step", controller(robot)), ("empty", lambda q, v: None)):
            times = clock(call, at, time.thread_time_ns)
            yield [name, what, *microseconds([*np.percentile(times, [50, 99]), times.max()])]


# rollouts -----------------------------------------------------------------------------------------


def bare(sim: fb.Simulation, control: fb.WholeBodyController, duration: float) -> None:
    """Run a loop without checks, record and fall detection."""
    for _ in range(round(duration / sim.timestep)):
        sim._advance(control(sim.q, sim.v, sim.time).tau)


def rollouts(turns: int) -> Rows:
    """Measure `fb.rollout` beside a bare loop, a second each [µs per step]."""
    for name in ROBOTS:
        robot = fb.load(name)
        control, sim = controller(robot), fb.Simulation(robot)
        times = np.empty((turns, 2))
        for turn in times:
            for i, loop in enumerate((bare, fb.rollout)):
                sim.reset()
                turn[i] = 1e6 * sim.timestep * work(loop, sim, control, 1.0)
        ratio = np.median(times[:, 0] / times[:, 1])
        yield [name, *microseconds(np.median(times, axis=0)), f"{ratio:.2f}"]


def main() -> None:
    parser = harness.command_line(__doc__, states=(400, "random states for each row of a table"))
    few = parser.parse_args().states // 4
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
            tick_times(4 * few),
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
            "robot | states | built-in tasks | user-defined task | user-defined constraint | "
            "user-defined task, reference",
            own(few),
        ),
        "Each task, inequality or constraint added to `standing_tasks` (median):",
        harness.table("robot | added | without | with | ratio", one_more_task(few)),
        "Other problems, relative to the weighted control step without joint limits on the same "
        "backend (median):",
        harness.table("robot | problem | backend | without | with | ratio", other_problems(few)),
        "20,000 control steps and as many calls of an empty function, with garbage collection. The "
        "times are processor times, because\nthe system interrupts a process for up to 8 ms:",
        harness.table("robot | what | median | p99 | worst", worst_steps(20_000)),
        "Rollouts: a robot stands at 1 kHz. `fb.rollout` has checks, a record and fall detection. "
        "The bare loop only reads the state,\ncalls the controller and advances MuJoCo. The ratio "
        "is the speed of `fb.rollout` divided by that of the bare loop.",
        harness.table("robot | bare loop | `fb.rollout` | ratio", rollouts(few // 4)),
    )


if __name__ == "__main__":
    main()
