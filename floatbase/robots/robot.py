"""A robot: floating or fixed base, feet, standing posture, torque limits, S of (3)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from threading import local
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
    checked,
    read_only,
)
from floatbase.errors import InputError, unknown_name
from floatbase.robots._checks import (
    as_corners,
    as_posture,
    as_torque_limits,
    has_floating_base,
    joint_limits,
)

if TYPE_CHECKING:
    from floatbase.robots.state import State

# least eigenvalue of M scaled to a diagonal of ones: robots have 1e-3 and more, rounding leaves
# 1e-15
_SINGULAR_M = 1e-10
_PARTICIPATION_TOLERANCE = 0.05  # part in a motion without inertia from which a joint is named


@dataclass(frozen=True, eq=False)
class Foot(Value):
    """Where a robot can touch the ground: a ball, or a flat foot with corners.

    frame: name of the frame that carries the foot; a flat foot's z axis points out of the ground
        when it stands.
    radius: of the ball, m; 0 for a flat foot.
    centre: of the ball, shape (3,), m, in the frame.
    corners: of a flat foot, shape (n, 3), m, in the frame; None for a ball.
    """

    frame: str = field(metadata=checked(as_string))
    radius: float = field(default=0.0, metadata=checked(as_positive, "m", allow_zero=True))
    centre: Array = field(
        default_factory=lambda: np.zeros(3), metadata=checked(as_array, (3,), "m")
    )
    corners: Array | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.corners is not None:
            object.__setattr__(self, "corners", as_corners(self.frame, self.corners))

    def _label(self) -> str:
        return f"foot {self.frame}" if isinstance(self.frame, str) else "a foot"

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

    _example = 'fb.load("go2")'
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
        """Raise `InputError` for a robot without mass, or for which (1) cannot be solved for q̈."""
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
    def _workspace(self) -> Workspace:
        """Memory for Pinocchio's results at a state."""
        return Workspace(self.model)

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


class Workspace(local):
    """Memory for Pinocchio's results, one for each thread: making it takes longer than filling it.

    data: the results.
    state: whose they are, a weak reference.
    has_jacobians: whether the Jacobians of the joints are among them.
    """

    def __init__(self, model: pin.Model):
        self.data = model.createData()
        self.state: Callable[[], State | None] = lambda: None
        self.has_jacobians = False
