"""Compare controllers with QPs that are written from Pinocchio's quantities.

    python benchmarks/constraints.py                      500 problems of each kind on five robots
                                                          -> benchmarks/constraints.md
    python benchmarks/constraints.py --problems 20 --kinds "joint limits" priorities
                                                          fewer problems or kinds, printed only

Each problem has a random state, random targets and, if its kind is not a task, random limits. Both
backends solve it. An independent QP decides whether their torques and verdicts are right: M and h
come from Pinocchio, the rows of tasks from finite differences of Pinocchio's kinematics, bounds of
joint accelerations from a bisection, the support polygon from Qhull. Clarabel solves the QP, and
linear equations of its active rows give the last digits. Strict priorities are a sequence of such
QPs. Only the contact Jacobians are those of the package, which the tests compare with MuJoCo.
"""

import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import harness
import clarabel
import numpy as np
import pinocchio as pin
from scipy.sparse import csc_matrix
from scipy.spatial import ConvexHull

import floatbase as fb
from floatbase.control import JointLimits, LinearInequality, capture_point_inequality
from floatbase.errors import InfeasibleError
from floatbase.objectives import (
    AngularMomentumTask,
    AxisTask,
    CentreOfPressureTask,
    RelativePoseTask,
)

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from finite_differences import residual

ROBOTS = ("go2", "solo12", "hyq", "anymal_kinova", "talos")
MU = 0.7
TIGHT, TOLERANCE = 1e-11, 1e-9  # Clarabel's; of rows that levels of priorities share
STRICT = 1e-7  # fraction of the slope: smaller multipliers may be rounding
REQUIRED = 1e-6  # fraction of the strongest motor's limit
Array = np.ndarray
Row = tuple[Array, Array]  # A and b of A x - b, or G and h of G x <= h


# the independent QP -------------------------------------------------------------------------------


@dataclass
class Independent:
    """The QP of one problem in x = (q̈, τ, λ, violations)."""

    state: fb.State
    contacts: fb.Contacts
    torque_limits: Array
    inequalities: list[tuple[Array, Array, Array]] = field(default_factory=list)

    def __post_init__(self) -> None:
        robot, k = self.state.robot, self.contacts.k
        nv, d = robot.nv, robot.d
        self.n = nv + d + k
        self.blocks = {"qdd": slice(0, nv), "tau": slice(nv, nv + d)}
        self.blocks["forces"] = slice(nv + d, self.n)
        self.eom = fb.equations_of_motion(self.state, self.contacts)
        model, data = robot.model, robot.model.createData()
        q, v = np.array(self.state.q), np.array(self.state.v)
        M = np.triu(pin.crba(model, data, q))
        M += np.triu(M, 1).T
        h = pin.nonLinearEffects(model, data, q, v)
        S = np.vstack([np.zeros((nv - d, d)), np.eye(d)])
        A, b = self.eom.A, self.eom.b
        self.A = np.block([[M, -S, -self.eom.J.T], [A, np.zeros((len(A), d + k))]])
        self.b = np.r_[-h, b]
        at = MU / np.sqrt(2.0)
        cone = [[1, 0, -at], [0, 1, -at], [-1, 0, -at], [0, -1, -at]]
        self.add("forces", np.kron(np.eye(k // 3), cone), np.zeros(4 * k // 3))
        self.add("tau", np.vstack([np.eye(d), -np.eye(d)]), np.tile(self.torque_limits, 2))

    def add(self, block: str, G: Array, h: Array, weight: float = np.inf) -> None:
        """Add inequalities on a block, hard or with the weight of their violation."""
        self.inequalities.append((self.placed(block, G), h, np.full(len(h), weight)))

    def placed(self, block: str, part: Array) -> Array:
        """Return rows on a block as rows on x."""
        rows = np.zeros((len(part), self.n))
        rows[:, self.blocks[block]] = part
        return rows

    def cost(self, tasks: Iterable[Any]) -> tuple[Array, Array, Array]:
        """Return H and g of a sum of tasks, and the rows of the tasks in x."""
        H, g, rows = np.zeros((self.n, self.n)), np.zeros(self.n), []
        for task in tasks:
            A, b = residual(self.state, self.eom, task)
            rows.append(self.placed(task.block, A))
            H += task.weight * rows[-1].T @ rows[-1]
            g += task.weight * rows[-1].T @ b
        return H, g, np.vstack(rows)

    def solve(self, levels: Sequence[Sequence[Any]]) -> Array | None:
        """Return x of the last of several levels, or None if there is none."""
        parts, bounds, all_weights = zip(*self.inequalities, strict=True)
        G, h, weights = np.vstack(parts), np.concatenate(bounds), np.concatenate(all_weights)
        soft = np.flatnonzero(np.isfinite(weights))
        E = np.zeros((len(G), len(soft)))
        E[soft, np.arange(len(soft))] = -1.0
        G = np.block([[G, E], [np.zeros((len(soft), self.n)), -np.eye(len(soft))]])
        h = np.r_[h, np.zeros(len(soft))]
        A, b = np.pad(self.A, ((0, 0), (0, len(soft)))), self.b
        x = np.zeros(self.n + len(soft))
        for i, level in enumerate(levels):
            H, g, rows = self.cost(level)
            H, g = np.pad(H, (0, len(soft))), np.r_[g, weights[soft] if i == 0 else 0.0 * soft]
            # later levels in the change from an optimum of the earlier ones, which is feasible
            found = minimum(H, g + H @ x, A, b if i == 0 else np.zeros(len(A)), G, h - G @ x)
            if found is None:
                return None
            x, strict = x + found[0], found[1]
            # later levels keep what this one reached; an inequality with a positive multiplier is
            # active at every optimum of the level
            A = np.vstack([A, np.pad(rows, ((0, 0), (0, len(soft)))), G[strict]])
            G, h = G[~strict], np.maximum(h, G @ x + TOLERANCE)[~strict]
        return x[: self.n]


def minimum(
    H: Array, g: Array, A: Array, b: Array, G: Array, h: Array
) -> tuple[Array, Array] | None:
    """Solve a QP with Clarabel and recover the last digits from its active rows.

    Returns x and which rows have a positive multiplier, or None if there is no solution.
    """
    U, s, Vt = np.linalg.svd(A, full_matrices=True)
    rank = int(np.sum(s > 1e-9 * s[0]))
    base, Z = Vt[:rank].T @ ((U[:, :rank].T @ b) / s[:rank]), Vt[rank:].T
    P, slope, rows, bounds = Z.T @ H @ Z, Z.T @ (H @ base + g), G @ Z, h - G @ base
    lengths = np.maximum(np.linalg.norm(rows, axis=1), 1e-12)
    rows, bounds = rows / lengths[:, None], bounds / lengths
    if not len(P):  # the equalities leave no freedom
        return base, np.zeros(len(rows), dtype=bool)
    scale = np.max(np.abs(P))
    P, slope = P / scale, slope / scale
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_iter = False, 200
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TIGHT
    if np.min(bounds, initial=0.0) >= 0.0:  # 0 is feasible, and small bounds would mislead Clarabel
        settings.tol_infeas_abs = settings.tol_infeas_rel = 1e-30
    cone = [clarabel.NonnegativeConeT(len(bounds))]
    program = csc_matrix(np.triu(P)), slope, csc_matrix(rows), bounds, cone, settings
    found = clarabel.DefaultSolver(*program).solve()
    if "Infeasible" in str(found.status):
        return None
    active = np.array(found.z) > np.array(found.s)
    for _ in range(50):  # at most one row leaves or joins at a time
        K = np.block([[P, rows[active].T], [rows[active], np.zeros((active.sum(),) * 2)]])
        exact = np.linalg.lstsq(K, np.r_[-slope, bounds[active]], rcond=1e-14)[0]
        y, mu = exact[: len(P)], exact[len(P) :]
        excess = np.where(active, 0.0, rows @ y - bounds)
        if np.min(mu, initial=0.0) < -1e-10 * (1.0 + np.max(mu, initial=0.0)):
            active[np.flatnonzero(active)[np.argmin(mu)]] = False
        elif np.max(excess, initial=0.0) > 1e-9 * (1.0 + np.max(np.abs(y))):
            active[np.argmax(excess)] = True
        else:
            z = np.zeros(len(rows))
            z[active] = mu
            return base + Z @ y, z > STRICT * np.max(np.abs(slope))
    return base + Z @ np.array(found.x), np.array(found.z) > STRICT * np.max(np.abs(slope))


# problems -----------------------------------------------------------------------------------------


@dataclass
class Problem:
    """A random problem: what a controller is given, and the independent QP."""

    state: fb.State
    contacts: fb.Contacts
    levels: list[list[Any]]
    options: dict[str, Any]
    independent: Independent

    def controller(self, backend: str) -> fb.WholeBodyController:
        """Return a controller of the problem."""
        tasks = self.levels if len(self.levels) > 1 else self.levels[0]
        return fb.WholeBodyController(
            self.state.robot, self.contacts, tasks, backend=backend, **self.options
        )


def standing_tasks(robot: fb.Robot, rng: np.random.Generator) -> list[Any]:
    """Return the tasks of a standing robot with random targets and regularization."""
    standing = robot.standing()
    return [
        fb.CoMTask(standing.com + rng.normal(0.0, 0.1, 3)),
        fb.OrientationTask("base", pin.exp3(rng.normal(0.0, 0.2, 3))),
        fb.PostureTask(standing.q, weight=0.1),
        fb.ForceTask(weight=1e-4),
        fb.TorqueTask(weight=1e-4),
    ]


def task_of(kind: str, state: fb.State, rng: np.random.Generator) -> Any:
    """Return a random task of a kind."""
    robot = state.robot
    one, other = rng.choice(robot.frames, 2, replace=False)
    rotation = pin.exp3(rng.normal(0.0, 0.3, 3))
    gains = {"kp": rng.uniform(1.0, 100.0), "kd": rng.uniform(1.0, 20.0)}
    if kind == "orientation":
        return fb.OrientationTask(one, rotation @ state.frame_pose(one).rotation, **gains)
    if kind == "frame":
        target = state.frame_pose(one).translation + rng.normal(0.0, 0.1, 3)
        return fb.FrameTask(one, target, **gains)
    if kind == "posture":
        away = np.r_[np.zeros(6), rng.normal(0.0, 0.2, robot.d)]
        return fb.PostureTask(state.integrate(away), **gains)
    if kind == "relative pose":
        pose = state.frame_pose(other).actInv(state.frame_pose(one))
        goal = pin.SE3(rotation @ pose.rotation, pose.translation + rng.normal(0.0, 0.1, 3))
        return RelativePoseTask(one, other, goal.homogeneous, **gains)
    if kind == "axis":
        axis = rng.normal(size=3)
        direction = rotation @ state.frame_pose(one).rotation @ axis
        return AxisTask(one, axis, direction, **gains)
    if kind == "angular momentum":
        return AngularMomentumTask(rng.normal(0.0, 1.0, 3), kd=gains["kd"])
    if kind == "centre of pressure":
        at = state.com * [1.0, 1.0, 0.0] + [*rng.normal(0.0, 0.02, 2), 0.0]
        return CentreOfPressureTask(at)
    return fb.CoMTask(state.com + rng.normal(0.0, 0.1, 3), **gains)


TASKS = (
    "centre of mass", "orientation", "frame", "posture", "relative pose", "axis",
    "angular momentum", "centre of pressure",
)  # fmt: skip


def near_limits(robot: fb.Robot, rng: np.random.Generator) -> fb.State:
    """Return a state in which some joints move towards limits that are near."""
    limits, standing = JointLimits.of(robot), robot.standing()
    q, v = np.array(standing.q), 0.05 * rng.choice([1.0, 10.0]) * rng.normal(size=robot.nv)
    for j in rng.choice(np.flatnonzero(np.isfinite(limits.upper)), 3):
        side, gap = rng.choice([-1.0, 1.0]), 0.02 * abs(rng.normal())
        q[7 + j] = (limits.upper if side > 0.0 else limits.lower)[j] - side * gap
        v[6 + j] = side * 2.0 * abs(rng.normal())
    return fb.State(robot, q, v)


def bisected(limits: JointLimits, q: float, v: float, j: int) -> tuple[float, float]:
    """Return the bounds of a joint's acceleration, by bisection on what happens afterwards."""
    dt, brake, bounds = limits.period, limits.braking[j], []
    for side in (-1.0, 1.0):
        x, speed = side * q, side * v
        limit = limits.upper[j] if side > 0.0 else -limits.lower[j]

        def stays(a: float, x: float = x, speed: float = speed, limit: float = limit) -> bool:
            """Whether the joint stays below the limit if it brakes after one period."""
            end, after = x + speed * dt + 0.5 * a * dt**2, speed + a * dt
            turning = x - speed**2 / (2.0 * a) if a < 0.0 < speed and after < 0.0 else end
            turning = turning if x < limit else end
            return max(turning, end, end + max(after, 0.0) ** 2 / (2.0 * brake)) <= limit

        beyond, within = 1e5, -2.0 * brake
        for _ in range(80 if stays(within) else 0):
            middle = 0.5 * (beyond + within)
            beyond, within = (beyond, middle) if stays(middle) else (middle, within)
        speed_bound = (limits.speeds[j] - speed) / dt
        bounds.append(max(min(within, speed_bound), -2.0 * brake))
    least, largest = -bounds[0], bounds[1]
    middle = 0.5 * (least + largest)
    return (middle, middle) if least > largest else (least, largest)


def add_joint_limits(qp: Independent, limits: JointLimits) -> None:
    """Add the bounds of all joints' accelerations to an independent QP."""
    robot, state = qp.state.robot, qp.state
    joints = np.flatnonzero(np.isfinite(limits.upper))
    pairs = [bisected(limits, state.q[7 + j], state.v[6 + j], j) for j in joints]
    least, largest = np.array(pairs).T
    rows = np.eye(robot.nv)[6 + joints]
    weight = np.inf if limits.weight is None else limits.weight
    qp.add("qdd", np.vstack([rows, -rows]), np.r_[largest, -least], weight)


def capture_point_rows(state: fb.State, contacts: fb.Contacts, horizon: float) -> Row:
    """Return G and h of the capture point inside the support polygon after a horizon."""
    model, data = state.robot.model, state.robot.model.createData()
    q, v = np.array(state.q), np.array(state.v)
    J = pin.jacobianCenterOfMass(model, data, q)[:2]
    pin.centerOfMass(model, data, q, v, np.zeros(model.nv))
    com, speed, drift = data.com[0], data.vcom[0][:2], data.acom[0][:2]
    points = contacts.positions(state)
    omega = np.sqrt(9.81 / (com[2] - points[:, 2].mean()))
    gain = 0.5 * horizon**2 + horizon / omega
    still = com[:2] + (horizon + 1.0 / omega) * speed
    edges = ConvexHull(points[:, :2]).equations
    normals, offsets = edges[:, :2], edges[:, 2]
    return normals @ J, (-offsets - normals @ still) / gain - normals @ drift


def problem_of(kind: str, robot: fb.Robot, seed: int) -> Problem:
    """Return a random problem of a kind."""
    rng = np.random.default_rng([seed, sum(map(ord, kind + robot.name))])
    state = robot.random_state(seed, rng.choice([0.02, 0.1, 0.3]))
    contacts = fb.Contacts.feet(robot, MU)
    levels, options = [standing_tasks(robot, rng)], {}
    options["joint_limits"] = limits = None
    if kind == "joint limits":
        state = near_limits(robot, rng)
    if kind in ("joint limits", "priorities"):
        options["joint_limits"] = limits = JointLimits.of(robot, weight=None)
    if kind == "soft rows":
        state = near_limits(robot, rng)
        options["joint_limits"] = limits = JointLimits.of(robot, weight=10 ** rng.uniform(0, 3))
    options["torque_limits"] = torques = rng.uniform(0.5, 1.0) * robot.torque_limits
    qp = Independent(state, contacts, torques)
    if limits is not None:
        add_joint_limits(qp, limits)
    if kind == "soft rows":
        G, weight = rng.normal(size=(3, robot.nv)), 10 ** rng.uniform(-1, 3)
        h = rng.normal(0.0, 10.0, 3)
        options["inequalities"] = [LinearInequality("soft", "qdd", (G, h), weight=weight)]
        qp.add("qdd", G, h, weight)
    if kind == "capture point":
        v = np.array(state.v)
        v[:2] += rng.normal(0.0, 0.3, 2)
        state = state.replace(v=v)
        qp, horizon = Independent(state, contacts, torques), rng.uniform(0.01, 0.3)
        options["inequalities"] = [capture_point_inequality(horizon=horizon)]
        qp.add("qdd", *capture_point_rows(state, contacts, horizon))
    if kind == "priorities":
        com, base, *others = levels[0]
        levels = [[base], [com], others]
    if kind in TASKS:
        levels[0].insert(0, task_of(kind, state, rng))
    return Problem(state, contacts, levels, options, qp)


KINDS = (*TASKS, "joint limits", "soft rows", "priorities", "capture point")


@dataclass
class Result:
    """What the problems of one kind on one robot showed."""

    problems: int = 0
    active: int = 0  # with an active inequality
    infeasible: int = 0
    verdicts: int = 0  # that differ
    residual: float = 0.0  # largest relative difference of a task from finite differences
    differences: list[float] = field(default_factory=list)  # of torques, fraction of the limit


def compare(kind: str, robot: fb.Robot, seeds: Iterable[int]) -> Result:
    """Solve random problems with both backends and independently."""
    result = Result()
    backends = ("reference",) if kind == "priorities" else ("compiled", "reference")
    largest = float(np.max(robot.torque_limits[np.isfinite(robot.torque_limits)]))
    for seed in seeds:
        problem = problem_of(kind, robot, seed)
        x = problem.independent.solve(problem.levels)
        result.problems += 1
        result.infeasible += x is None
        for i, backend in enumerate(backends):
            try:
                command = problem.controller(backend)(problem.state.q, problem.state.v)
            except InfeasibleError:
                result.verdicts += x is not None
                continue
            if x is None:
                result.verdicts += 1
                continue
            result.active += i == 0 and bool(command.active)
            tau = x[problem.independent.blocks["tau"]]
            result.differences.append(float(np.max(np.abs(command.tau - tau))) / largest)
        if kind in TASKS:
            task, eom = problem.levels[0][0], problem.independent.eom
            ours, expected = task.residual(eom), residual(problem.state, eom, task)
            for mine, theirs in zip((ours.A, ours.b), expected, strict=True):
                gap = np.max(np.abs(mine - theirs)) / (1.0 + np.max(np.abs(theirs)))
                result.residual = max(result.residual, float(gap))
    return result


def rows(kinds: Iterable[str], seeds: Sequence[int]) -> Iterator[list[object]]:
    """Compare every robot, and return the rows of the table."""
    for kind in kinds:
        for name in ROBOTS:
            found = compare(kind, fb.load(name), seeds)
            counts = [found.problems, found.active, found.infeasible, found.verdicts]
            task = f"{found.residual:.0e}" if kind in TASKS else "–"
            worst = f"{max(found.differences, default=0.0):.0e}"
            yield [kind, name, *counts, task, worst, sum(x > REQUIRED for x in found.differences)]


def main() -> None:
    """Parse the command line, compare, and write the page."""
    parser = harness.command_line(
        __doc__, problems=(500, "problems of each kind"), seed=(0, "first seed")
    )
    parser.add_argument("--kinds", nargs="+", default=KINDS, choices=KINDS)
    arguments = parser.parse_args()
    each = -(-arguments.problems // len(ROBOTS))
    table = harness.table(
        "kind | robot | problems | with active limits | infeasible | different verdicts | task, "
        "largest difference | torques, largest difference | above 1e-6",
        rows(arguments.kinds, range(arguments.seed, arguments.seed + each)),
    )
    if arguments.problems >= 500 and tuple(arguments.kinds) == KINDS:
        packages = harness.versions("pin", "clarabel", "numpy")
        harness.write(
            __file__,
            "Constraints and tasks against independent QPs",
            f"`python benchmarks/constraints.py`, with {packages}.",
            "Each problem has a random state and random targets. Both backends solve it (strict\n"
            "priorities: the reference backend). The QP for comparison is written from\n"
            "Pinocchio's quantities, with rows of tasks from finite differences, and solved by\n"
            "Clarabel. "
            "Differences of torques are fractions of the strongest motor's limit.",
            table,
        )


if __name__ == "__main__":
    main()
