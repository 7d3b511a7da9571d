"""Judges that share no code with the package: MuJoCo's dynamics in our coordinates, finite
differences, brute force.

Lists of robots are collected from the package, so a robot that joins the catalogue joins the tests.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from typing import ClassVar, Self

import mujoco
import numpy as np
import numpy.typing as npt
import pinocchio as pin
import pytest
from scipy.optimize import linprog

import floatbase as fb
from floatbase.dynamics import EquationsOfMotion
from floatbase.simulation._conversion import Conversion

Array = npt.NDArray[np.float64]

ROBOTS = tuple(fb.catalogue())
AGREEMENT = 1e-8  # part of the strongest motor's limit between two ways to the same torques


@cache
def load(name: str) -> fb.Robot:
    """A catalogue robot, loaded once."""
    return fb.load(name)


FLOATING = tuple(name for name in ROBOTS if load(name).is_floating)
FLAT = tuple(
    name for name in ROBOTS if load(name).feet and all(foot.is_flat for foot in load(name).feet)
)
# `robot = judges.every_robot` runs a file on each
every_robot = pytest.fixture(params=ROBOTS)(lambda request: load(request.param))
every_floating_robot = pytest.fixture(params=FLOATING)(lambda request: load(request.param))
# one of each kind: point feet with enough torques and with too few, flat feet, bolted down
KINDS = ("go2", "solo8", "talos", "ur5")
BALLS = tuple(name for name in FLOATING if name not in FLAT)


def sampled(names: Iterable[str], *kept: str) -> list[object]:
    """Return names as parameters of a test; names not in `kept` run in `make test-all` only."""
    later = pytest.mark.front_end
    return [name if name in kept else pytest.param(name, marks=later) for name in names]


def states(name: str, n: int, spread: float = 0.3) -> list[fb.State]:
    """n random states of a robot, the same ones every time."""
    return [load(name).random_state(seed, spread) for seed in range(n)]


def stance(robot: fb.Robot, mu: float = 0.7) -> fb.Contacts:
    """The contacts a robot stands on: flat feet by their corners, balls by their lowest points,
    none for a fixed base.
    """
    if not robot.feet:
        return fb.Contacts.none()
    flat = all(foot.is_flat for foot in robot.feet)
    return fb.Contacts.flat_feet(robot, mu) if flat else fb.Contacts.points(robot, mu)


def controller_of(name: str, **options: object) -> fb.WholeBodyController:
    """A controller that keeps a robot standing on all its feet."""
    robot = load(name)
    return fb.WholeBodyController(
        robot, stance(robot), fb.standing_tasks(robot.standing()), **options
    )


def pair(
    robot: fb.Robot, contacts: fb.Contacts, tasks: list[object] | None = None, **options: object
) -> tuple[fb.WholeBodyController, fb.WholeBodyController]:
    """The compiled and the reference controller of one problem; without tasks, of standing."""
    tasks = list(fb.standing_tasks(robot.standing())) if tasks is None else tasks
    compiled, reference = (
        fb.WholeBodyController(robot, contacts, tasks, backend=backend, **options)
        for backend in ("compiled", "reference")
    )
    return compiled, reference


def near_and_far(name: str, n: int) -> list[fb.State]:
    """n states near standing, n farther and n far away, where friction and torque limits hold most
    of them.
    """
    return [state for spread in (0.02, 0.1, 0.3) for state in states(name, n, spread)]


def difference(
    one: fb.WholeBodyController, other: fb.WholeBodyController, state: fb.State, t: float = 0.0
) -> float:
    """Largest torque between two controllers, N·m; where there is no answer, both must say so with
    the same rows.
    """
    try:
        expected = other(state.q, state.v, t)
    except fb.InfeasibleError as error:
        with pytest.raises(fb.InfeasibleError) as caught:
            one(state.q, state.v, t)
        assert caught.value.constraints == error.constraints
        return 0.0
    found = one(state.q, state.v, t)
    assert found.backend == one.backend, (
        "the compiled tick left this state to the reference backend"
    )
    return float(np.max(np.abs(found.tau - expected.tau)))


def largest_difference(
    both: tuple[fb.WholeBodyController, fb.WholeBodyController], at: list[fb.State], t: float = 0.0
) -> float:
    """Largest `difference` [N·m] at these states."""
    return max(difference(*both, state, t) for state in at)


def agreement(robot: fb.Robot) -> float:
    """N·m that may lie between two ways to the same torques."""
    return AGREEMENT * float(np.max(robot.torque_limits[np.isfinite(robot.torque_limits)]))


def at_rest(name: str, seed: int | None = None, feet: int | None = None) -> EquationsOfMotion:
    """A robot at rest on its first feet, or on all, standing or at random."""
    robot, contacts = load(name), stance(load(name))
    state = (
        robot.standing() if seed is None else robot.random_state(seed).replace(v=np.zeros(robot.nv))
    )
    return fb.equations_of_motion(state, contacts.only(*contacts.names[:feet]))


@dataclass
class Torques:
    """The simplest command: torques, with or without planned forces."""

    tau: object
    forces: object = None


def limp(q: Array, v: Array, t: float) -> Torques:
    """A controller of go2 that gives no torques at all."""
    return Torques(np.zeros(12))


class KeepStill:
    """A user-defined task: no joint accelerates."""

    block: ClassVar[str] = "qdd"
    name, weight = "keep still", 5.0

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> fb.Affine:
        return fb.Affine.linear(eom.S.T)


def random_normals(n: int, seed: int, tilt: float = 0.6) -> Array:
    """n unit normals within about `tilt` rad of the vertical."""
    rng = np.random.default_rng(seed)
    raw = np.hstack([tilt * rng.uniform(-1.0, 1.0, (n, 2)), np.ones((n, 1))])
    return raw / np.linalg.norm(raw, axis=1, keepdims=True)


def rotation(axis_angle: npt.ArrayLike) -> Array:
    """Rotation matrix of a rotation vector, by Rodrigues' formula written out."""
    w = np.asarray(axis_angle, dtype=np.float64)
    angle = float(np.linalg.norm(w))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = w / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def quaternion_rotation(xyzw: npt.ArrayLike) -> Array:
    """Rotation matrix of a unit quaternion x y z w, written out."""
    x, y, z, w = np.asarray(xyzw, dtype=np.float64)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def turn_between(R_to: Array, R_from: Array) -> Array:
    """The world rotation vector that turns R_from into R_to, for small turns: log(R_to R_fromᵀ) to
    third order.
    """
    R = R_to @ R_from.T
    sine = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return sine * (1.0 + float(sine @ sine) / 6.0)


class Mujoco:
    """MuJoCo's M, h and Jacobians of a robot's state, in our coordinates: qvel = T v.

    The model is that of the simulation, unless another one is given.
    """

    def __init__(self, robot: fb.Robot, model: mujoco.MjModel | None = None):
        self.robot = robot
        self.model = fb.Simulation(robot).model if model is None else model
        self.data = mujoco.MjData(self.model)
        self.convert = Conversion(robot, self.model)

    def move_to(self, state: fb.State) -> Self:
        """Move MuJoCo's model to a state."""
        self.data.qpos[:], self.data.qvel[:] = self.convert.to_mujoco(state.q, state.v)
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_fwdVelocity(self.model, self.data)
        self.state = state
        self.T = np.column_stack(
            [self.convert.to_mujoco(state.q, e)[1] for e in np.eye(self.model.nv)]
        )
        return self

    @property
    def M(self) -> Array:
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, full)
        return self.T.T @ full @ self.T

    @property
    def h(self) -> Array:
        # a base velocity constant in the base frame turns in the world: Ṫ v = R (ω × v)
        turning = np.zeros(self.model.nv)
        if self.robot.is_floating:
            turning[:3] = quaternion_rotation(self.state.q[3:7]) @ np.cross(
                self.state.v[3:6], self.state.v[:3]
            )
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, full)
        return self.T.T @ (self.data.qfrc_bias + full @ turning)

    def body(self, frame: str) -> int:
        """The MuJoCo body that carries a frame."""
        joint = self.robot.model.frames[self.robot.frame_id(frame)].parentJoint
        name = self.robot.model.names[joint]
        if name in self.robot.joint_names:
            return int(self.model.joint(name).bodyid[0])
        return int(self.model.body(self.robot.base).id) if self.robot.is_floating else 0

    def jacobian(self, frame: str, point: npt.ArrayLike) -> tuple[Array, Array]:
        """Linear and angular Jacobian, each (3, nv), of a world point carried by a frame's body."""
        linear, angular = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        mujoco.mj_jac(
            self.model,
            self.data,
            linear,
            angular,
            np.asarray(point, dtype=np.float64),
            self.body(frame),
        )
        return linear @ self.T, angular @ self.T


@cache
def mujoco_of(name: str) -> Mujoco:
    """One judge for each catalogue robot."""
    return Mujoco(load(name))


def along(state: fb.State, direction: npt.ArrayLike, step: float) -> fb.State:
    """The state moved along a velocity direction for a time `step`; v stays as it is."""
    return state.replace(q=state.integrate(step * np.asarray(direction, dtype=np.float64)))


def derivative(
    f: Callable[[fb.State], Array], state: fb.State, direction: npt.ArrayLike, step: float = 1e-5
) -> Array:
    """d/dt f along a velocity direction, by central differences."""
    return (f(along(state, direction, step)) - f(along(state, direction, -step))) / (2.0 * step)


def jacobian_of(f: Callable[[fb.State], Array], state: fb.State, step: float = 1e-6) -> Array:
    """The derivative of f in v's directions, column by column, by central differences."""
    return np.column_stack([derivative(f, state, e, step) for e in np.eye(state.robot.nv)])


def drift_of(J: Callable[[fb.State], Array], state: fb.State) -> Array:
    """J̇ v: the derivative of J(q) v along v with v constant, by central differences."""
    return derivative(lambda s: J(s) @ state.v, state, state.v)


def moved(state: fb.State, qdd: Array, t: float) -> fb.State:
    """The configuration a short time t away (either way) when the robot accelerates with q̈: right
    to third order in t.
    """
    return state.replace(q=state.integrate(t * state.v + 0.5 * t * t * qdd))


def acceleration_of(
    f: Callable[[fb.State], Array], state: fb.State, qdd: Array, step: float = 2e-4
) -> Array:
    """d²/dt² f under the acceleration q̈, by central differences."""
    return (f(moved(state, qdd, step)) - 2.0 * f(state) + f(moved(state, qdd, -step))) / step**2


def turning_acceleration_of(
    R: Callable[[fb.State], Array], state: fb.State, qdd: Array, step: float = 2e-4
) -> Array:
    """The angular acceleration in the world of a rotation matrix under q̈, by differences of small
    turns.
    """
    before, now, after = R(moved(state, qdd, -step)), R(state), R(moved(state, qdd, step))
    return (turn_between(after, now) - turn_between(now, before)) / step**2


def aba(eom: EquationsOfMotion, tau: Array, forces: Array) -> Array:
    """q̈ by Pinocchio's articulated-body algorithm, with contact forces as wrenches on the links
    that carry the points.
    """
    state, robot = eom.state, eom.robot
    model, data = robot.model, robot.model.createData()
    pin.forwardKinematics(model, data, state.q)
    wrenches = [pin.Force.Zero() for _ in range(model.njoints)]
    owners = [
        contact.name for contact in eom.contacts.friction_contacts for _ in contact.point_names
    ]
    for frame, point, force in zip(
        owners, eom.contacts.positions(state), np.reshape(forces, (-1, 3)), strict=True
    ):
        joint = model.frames[model.getFrameId(frame)].parentJoint
        wrenches[joint] += data.oMi[joint].actInv(pin.Force(force, np.cross(point, force)))
    return np.asarray(pin.aba(model, data, state.q, state.v, robot.S @ tau, wrenches))


def constrained(eom: EquationsOfMotion, tau: Array, b: Array | None = None) -> tuple[Array, Array]:
    """q̈ and the smallest λ of (7) for given τ by least squares of the whole system: no ζ, no η. b:
    of (5), eom.b by default.
    """
    kkt = np.block([[eom.M, -eom.J.T], [eom.A, np.zeros((len(eom.A), eom.k))]])
    x = np.linalg.lstsq(
        kkt, np.concatenate([eom.S @ tau - eom.h, eom.b if b is None else b]), rcond=1e-11
    )[0]
    return x[: eom.nv], x[eom.nv :]


def relative(found: npt.ArrayLike, expected: npt.ArrayLike) -> float:
    """Largest difference, relative to the largest expected entry."""
    found, expected = np.asarray(found, dtype=np.float64), np.asarray(expected, dtype=np.float64)
    return float(
        np.max(np.abs(found - expected), initial=0.0)
        / max(float(np.max(np.abs(expected), initial=0.0)), 1e-12)
    )


def is_feasible(qp: fb.QP, rows: list[int]) -> bool:
    """Whether a point satisfies the equalities and the hard ones of these inequality rows, by a
    linear program on the whole problem.
    """
    rows = [row for row in rows if row not in set(qp.soft)]
    found = linprog(
        np.zeros(qp.n), qp.G[rows], qp.h[rows], qp.A, qp.b, bounds=(None, None), method="highs"
    )
    return bool(found.status == 0)


def is_smallest_conflict(qp: fb.QP, names: Iterable[str]) -> bool:
    """Whether these inequality rows are infeasible together but feasible without any one."""
    rows = [qp.inequality_names.index(name) for name in names]
    return not is_feasible(qp, rows) and all(
        is_feasible(qp, [i for i in rows if i != row]) for row in rows
    )
