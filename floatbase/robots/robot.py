"""A robot: floating or fixed base, feet, standing posture, torque limits, lengths of (2), S of (3)."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import (
    MAX_MAGNITUDE,
    Array,
    Value,
    as_array,
    as_integer,
    as_positive,
    as_string,
    cached_property,
    numeric_copy,
    read_only,
    short_repr,
)
from floatbase.errors import InputError, unknown_name

if TYPE_CHECKING:
    from floatbase.robots.state import State

# quaternions printed with seven digits pass; normalising what is further off could hide a fault
UNIT_NORM_TOLERANCE = 1e-6
_DATA_POOL_SIZE = 4  # as many results as threads are likely to ask for at once
_LIMIT_TOLERANCE = 1e-6  # rad or m: angles printed with seven digits pass
# least eigenvalue of M scaled to a diagonal of ones: robots have 1e-3 and more, rounding leaves
# 1e-15
_SINGULAR_M = 1e-10
_PARTICIPATION_TOLERANCE = 0.05  # part in a motion without inertia from which a joint is named
# m: corners nearer to one line than this span no area; feet are measured to 0.1 mm
_AREA_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Foot(Value):
    """Where a robot can touch the ground: a ball, or a flat foot with corners.

    frame: name of the frame that carries the foot; a flat foot's z axis points out of the ground
        when it stands.
    radius: of the ball, m; 0 for a flat foot.
    centre: of the ball, shape (3,), m, in the frame.
    corners: of a flat foot, shape (n, 3), m, in the frame; None for a ball.
    """

    frame: str
    radius: float = 0.0
    centre: Array = field(default_factory=lambda: np.zeros(3))
    corners: Array | None = None

    def __post_init__(self) -> None:
        as_string("frame of a foot", self.frame)
        object.__setattr__(
            self,
            "radius",
            as_positive(f"radius of foot {self.frame}", self.radius, "m", allow_zero=True),
        )
        object.__setattr__(
            self, "centre", as_array(f"centre of foot {self.frame}", self.centre, (3,), "m")
        )
        if self.corners is not None:
            object.__setattr__(self, "corners", as_corners(self.frame, self.corners))

    @property
    def is_flat(self) -> bool:
        """Whether the foot stands on its corners rather than on a point."""
        return self.corners is not None

    @property
    def middle(self) -> Array:
        """The ball's centre, or the middle of the corners; shape (3,), m, in the frame."""
        return self.centre if self.corners is None else read_only(self.corners.mean(axis=0))


@dataclass(frozen=True, eq=False)
class Robot(Value):
    """A robot as the equations need it. Made by `load`; nothing in it changes afterwards.

    name: as it was loaded.
    model: the Pinocchio model; q = (base position [m, world], base quaternion x y z w, joints), or
        joints alone.
    urdf: the text of the URDF; the physics and the pictures are made from it.
    package_dirs: where its meshes named package://… lie.
    feet: where it can touch the ground.
    torque_limits: shape (d,), N·m (N for prismatic joints), +inf where none is known.
    posture: shape (nq,), a configuration to stand in, before the feet are put on the ground; joints
        within their limits.
    description: what it is for.
    sources: where the numbers come from that are not the URDF's.

    Raises `InputError` for what does not fit, for a robot that nothing moves, and for one whose M
    (1) is singular.
    """

    name: str
    model: pin.Model
    urdf: str
    package_dirs: tuple[Path, ...]
    feet: tuple[Foot, ...]
    torque_limits: Array
    posture: Array
    description: str = ""
    sources: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "posture", as_posture(self.name, self.model, self.posture))
        object.__setattr__(self, "torque_limits", as_torque_limits(self.d, self.torque_limits))
        object.__setattr__(self, "sources", MappingProxyType(dict(self.sources)))
        for foot in self.feet:
            if [self.frame_id(other.frame) for other in self.feet].count(
                self.frame_id(foot.frame)
            ) > 1:
                raise InputError(
                    f"foot {foot.frame!r} of {self.name} is given twice; name each foot once."
                )
        self._check_inertia()

    def _check_inertia(self) -> None:
        """Raise `InputError` for a robot that has no mass, or that (1) cannot be solved for q̈ of."""
        if self.nv == 0:
            raise InputError(
                f"nothing of {self.name} moves: its base is fixed, and so are all its joints."
            )
        if not 0.0 < self.mass < np.inf:
            raise InputError(
                f"{self.name} has a mass of {self.mass:g} kg; give its links <inertial> in the "
                f"URDF."
            )
        M = pin.crba(self.model, self.model.createData(), np.array(self.posture))
        if not np.all(np.abs(M) <= MAX_MAGNITUDE):
            raise InputError(
                f"the inertia M (1) of {self.name} is not finite; look for lengths or masses that "
                f"no robot has."
            )
        scale = np.sqrt(np.where(M.diagonal() > 0.0, M.diagonal(), 1.0))
        values, vectors = np.linalg.eigh(M / np.outer(scale, scale))
        participation = np.abs(vectors[:, values < _SINGULAR_M]).max(axis=1, initial=0.0)
        names = [*["its base"] * (self.nv - self.d), *self.joint_names]
        massless = list(
            dict.fromkeys(
                name
                for name, value in zip(names, participation, strict=True)
                if value > _PARTICIPATION_TOLERANCE
            )
        )
        if massless:
            joints = [name for name in massless if name != "its base"]
            lock_hint = f", or hold joints still, as with locked={joints}" if joints else ""
            fix_hint = (
                ", or load it with floating=False where it is bolted to the ground"
                if "its base" in massless
                else ""
            )
            raise InputError(
                f"{self.name} has a singular inertia M (1) in its posture: {', '.join(massless)} "
                f"can accelerate without moving "
                f"any mass. Give the links there mass and inertia{lock_hint}{fix_hint}."
            )

    @cached_property
    def _fingerprint(self) -> bytes:
        """Of all that equations, physics and pictures take from the robot: the same in another
        process.
        """
        shapes = [foot.centre if foot.corners is None else foot.corners for foot in self.feet]
        feet = [
            (foot.frame, foot.radius, shape.shape, shape.tobytes())
            for foot, shape in zip(self.feet, shapes, strict=True)
        ]
        numbers = self.torque_limits.tobytes(), self.posture.tobytes()
        return sha256(
            repr((self.name, self.urdf, self.model.saveToString(), feet, numbers)).encode()
        ).digest()

    def __eq__(self, other: object) -> bool:
        """Whether the other is the same robot: another `load` of it, or one that came out of a
        pickle.
        """
        return self is other or (
            isinstance(other, Robot) and self._fingerprint == other._fingerprint
        )

    def __hash__(self) -> int:
        return hash(self._fingerprint)

    @cached_property
    def is_floating(self) -> bool:
        """Whether the base is free to move: nv = d + 6 rather than d."""
        return has_floating_base(self.model)

    @cached_property
    def nq(self) -> int:
        """(2) Length of q: of q_base, which is 7 for a floating base and 0 for a fixed one, and of
        q_jnt.
        """
        return int(self.model.nq)

    @cached_property
    def nv(self) -> int:
        """(2) Length of v, of q̈ and of each row of J: d + 6 for a floating base, d for a fixed
        one.
        """
        return int(self.model.nv)

    @cached_property
    def d(self) -> int:
        """(2) Number of actuated joints: the length of τ."""
        return self.nv - (6 if self.is_floating else 0)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the actuated joints, in the order of τ."""
        return tuple(self.model.names)[2 if self.is_floating else 1 :]

    @cached_property
    def S(self) -> Array:
        """(3) The actuation matrix, shape (nv, d): S τ puts zeros where no motor acts. Source:
        [FBR], §2.
        """
        return read_only(np.eye(self.nv, self.d, self.d - self.nv))

    @cached_property
    def mass(self) -> float:
        """Total mass, kg. With a fixed base it includes what is bolted down, which `State.com` does
        not.
        """
        return float(sum(inertia.mass for inertia in self.model.inertias))

    @property
    def gravity(self) -> float:
        """Size of the acceleration of gravity, m/s²."""
        return float(np.linalg.norm(self.model.gravity.linear))

    @property
    def weight(self) -> float:
        """Total weight, N."""
        return self.mass * self.gravity

    @cached_property
    def _data_pool(self) -> deque[pin.Data]:
        """Memory of states that are gone, for Pinocchio's results of the next one: making it takes
        longer than filling it.
        """
        return deque(maxlen=_DATA_POOL_SIZE)

    @cached_property
    def base(self) -> str:
        """Name of the base link's frame."""
        root, frames = int(self.is_floating), self.model.frames
        return str(
            next(
                (f for f in frames if f.type == pin.FrameType.BODY and f.parentJoint == root),
                frames[0],
            ).name
        )

    @cached_property
    def frames(self) -> tuple[str, ...]:
        """Names of all frames: bodies, joints and fixed frames."""
        return tuple(str(f.name) for f in self.model.frames if f.name != "universe")

    @cached_property
    def _frame_ids(self) -> dict[str, int]:
        """Pinocchio's number of each frame, the first of several that share a name; "base" is the
        base link.
        """
        numbers = {str(frame.name): i for i, frame in reversed(list(enumerate(self.model.frames)))}
        return {"base": numbers[self.base], **numbers}

    def frame_id(self, frame: str) -> int:
        """Pinocchio's number of a frame; "base" stands for the base link on every robot.

        Raises `UnknownNameError` with the near names.
        """
        if not isinstance(frame, str) or frame not in self._frame_ids:
            raise unknown_name(
                f"frame of {self.name}", frame, self.frames, "robot.frames lists them all."
            )
        return self._frame_ids[frame]

    def foot(self, frame: str) -> Foot:
        """The foot carried by a frame; a frame that is no foot gives a point foot of radius 0 at
        its origin.
        """
        self.frame_id(frame)
        return next((foot for foot in self.feet if foot.frame == frame), Foot(frame))

    def neutral(self) -> State:
        """The state with all joints at zero and the base at the world's origin, at rest."""
        from floatbase.robots.state import State

        return State(self, pin.neutral(self.model))

    def standing(
        self,
        height: float | None = None,
        normal: npt.ArrayLike | None = None,
        offset: npt.ArrayLike | None = None,
    ) -> State:
        """A state at rest with every foot on the ground, and the base turned as the posture has it.

        height: how far above z = 0 the base's origin should be, m; by default as the posture has
            it.
        normal: (3,), world, of the ground, upwards by default; (n, 3) for several planes, all
            solid, as the sides of a valley.
        offset: m, of the points normal · x = offset of a plane: one number for all, or (n,); 0 by
            default.
        Raises `InputError` when the feet cannot get there. A fixed-base robot, or one without feet,
        gets its posture.
        """
        from floatbase.robots.standing import find_standing_state

        return (
            self._standing
            if height is normal is offset is None
            else find_standing_state(self, height, normal, offset)
        )

    @cached_property
    def _standing(self) -> State:
        from floatbase.robots.standing import find_standing_state

        return find_standing_state(self)

    def random_state(self, seed: int | np.random.Generator = 0, spread: float = 0.3) -> State:
        """A random state around standing, the same for the same seed.

        spread: how far joints [rad, m], the base's attitude [rad] and position [m] stray;
            velocities are normal with
        that deviation in rad/s and m/s. Joints stay within their limits.
        """
        if not isinstance(seed, np.random.Generator):
            seed = as_integer("seed", seed, 0, 2**64, "or a numpy.random.Generator")
        rng, standing = np.random.default_rng(seed), self.standing()
        spread = as_positive("spread", spread, allow_zero=True)
        q = np.array(standing.integrate(rng.uniform(-spread, spread, self.nv)))
        _, index, lower, upper = joint_limits(self.model)
        q[index] = np.clip(q[index], lower, upper)
        return standing.replace(q, spread * rng.standard_normal(self.nv))

    def __repr__(self) -> str:
        base = "floating" if self.is_floating else "fixed"
        return (
            f"Robot({self.name!r}, {base} base, d={self.d} joints, {len(self.feet)} feet, "
            f"{self.mass:.1f} kg)"
        )


def has_floating_base(model: pin.Model) -> bool:
    """Whether a model's base is free to move."""
    return model.njoints > 1 and model.joints[1].shortname() == "JointModelFreeFlyer"


def joint_limits(model: pin.Model) -> tuple[Array, Array, Array, Array]:
    """The joints that have limits: Pinocchio's numbers, places in q, lower and upper limits, rad or
    m, shape (n,) each.

    Equal limits, such as the 0 and 0 of a URDF that does not say, are none, as for MuJoCo.
    """
    joints = np.array([i for i in range(1, model.njoints) if model.nqs[i] == 1], dtype=int)
    index = np.array(model.idx_qs)[joints]
    lower, upper = model.lowerPositionLimit[index], model.upperPositionLimit[index]
    limited = lower < upper
    return joints[limited], index[limited], lower[limited], upper[limited]


def clamp_to_limits(model: pin.Model, q: Array) -> Array:
    """A configuration with its joints within their limits: by whole turns where that will do, else
    at the nearest limit.
    """
    joints, index, lower, upper = joint_limits(model)
    clamped, nearest = np.array(q), np.clip(q[index], lower, upper)
    excess = q[index] - nearest
    unwrapped = q[index] - 2.0 * np.pi * np.sign(excess) * np.ceil(
        np.abs(excess) / (2.0 * np.pi)
    )  # as few turns as will do
    is_revolute = np.array(
        [model.joints[joint].shortname().startswith("JointModelR") for joint in joints.tolist()],
        dtype=bool,
    )
    use_unwrapped = (
        is_revolute
        & (np.abs(excess) > _LIMIT_TOLERANCE)
        & (lower <= unwrapped)
        & (unwrapped <= upper)
    )
    clamped[index] = np.where(use_unwrapped, unwrapped, nearest)
    return read_only(clamped)


def as_posture(name: str, model: pin.Model, posture: npt.ArrayLike) -> Array:
    """A configuration to stand in, shape (nq,), checked: its quaternions, and that joint limits
    allow it.
    """
    layout = (
        f"7 for the base, then {model.nq - 7} of the joints"
        if has_floating_base(model)
        else "those of the joints"
    )
    q = as_array("posture", posture, (model.nq,), layout)
    check_unit_norms(model, "posture", q)
    joints, index, lower, upper = joint_limits(model)
    for joint, x, minimum, maximum in zip(joints, q[index], lower, upper, strict=True):
        if not minimum - _LIMIT_TOLERANCE <= x <= maximum + _LIMIT_TOLERANCE:
            limits = f"its limits are {minimum:.6g} and {maximum:.6g}"
            raise InputError(
                f"the posture of {name} has {model.names[int(joint)]} at {x:.6g}; {limits} (rad, "
                f"or m)."
            )
    return q


def check_unit_norms(
    model: pin.Model, name: str, q: Array, hint: str = "", first_joint: int = 1
) -> None:
    """Check that quaternions, and (cos, sin) of joints without limits, have length 1 in a
    configuration, else `InputError`.

    model: the Pinocchio model.
    name: of the configuration, for the message.
    q: shape (nq,), the configuration.
    hint: put behind the message's last word.
    first_joint: the first of Pinocchio's joints that counts: 2 leaves the base of a floating robot
        out.
    """
    if pin.isNormalized(model, q, UNIT_NORM_TOLERANCE):
        return  # it is faster than this loop
    for i in range(first_joint, model.njoints):
        translations = {"JointModelFreeFlyer": 3, "JointModelPlanar": 2}.get(
            model.joints[i].shortname(), 0
        )  # they come first
        part = slice(model.idx_qs[i] + translations, model.idx_qs[i] + model.nqs[i])
        length = float(np.linalg.norm(q[part]))
        if model.nqs[i] != model.nvs[i] and abs(length - 1.0) > UNIT_NORM_TOLERANCE:
            entries, numbers = (
                f"{name}[{part.start}:{part.stop}]",
                "cosine and sine" if len(q[part]) == 2 else "the quaternion",
            )
            floating = i == 1 and translations == 3
            entries = (
                f"the base quaternion {entries} (x y z w)"
                if floating
                else f"{entries}, {numbers} of {model.names[i]!r},"
            )
            raise InputError(
                f"{entries} has length {length:.8g}; it must be 1. Divide it by its length{hint}."
            )


def as_corners(frame: str, value: npt.ArrayLike) -> Array:
    """The corners of a foot, (n, 3), m, in its frame, checked: on one line they hold no six
    motions. Raises `InputError`.
    """
    corners = as_array(f"corners of {frame}", value, (None, 3), "m")
    if (
        len(corners) < 3
        or np.linalg.matrix_rank(corners - corners.mean(axis=0), tol=_AREA_TOLERANCE) < 2
    ):
        raise InputError(
            f"the corners of {frame} span no area; a flat foot needs at least 3 that are not on "
            f"one line."
        )
    return corners


def as_torque_limits(d: int, value: npt.ArrayLike) -> Array:
    """Requested torque limits, one number or (d,), N·m, +inf for none, as shape (d,). Raises
    `InputError`.
    """
    limits = numeric_copy(value)
    if (
        limits is None or limits.shape not in ((), (d,)) or not np.all(limits > 0)
    ):  # NaN is not > 0 either
        got = short_repr(value) if limits is None else f"shape {limits.shape}: {short_repr(value)}"
        raise InputError(f"torque_limits must be one number > 0 or {d} of them (N·m); got {got}.")
    return read_only(np.broadcast_to(limits, (d,)))
