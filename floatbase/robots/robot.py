"""Robots: base, feet, standing posture, torque limits and actuation matrix."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
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
    as_instance,
    as_integer,
    as_positive,
    as_string,
    cached_property,
    checked,
    read_only,
    unit_vector,
)
from floatbase.errors import InputError, unknown_name
from floatbase.robots._checks import (
    as_corners,
    as_posture,
    as_torque_limits,
    has_floating_base,
    joint_limits,
)
from floatbase.robots.inertia import add_point_mass, scale_masses

if TYPE_CHECKING:
    from floatbase.robots.state import State

# smallest eigenvalue of M scaled to a diagonal of ones: robots have at least 1e-3, and rounding
# leaves 1e-15
_SINGULAR_M = 1e-10
_PARTICIPATION_TOLERANCE = 0.05  # share in a motion without inertia above which a joint is named


@dataclass(frozen=True, eq=False)
class Foot(Value):
    """A part of a robot that can touch the ground: a ball, a wheel, or a flat foot with corners.

    Parameters
    ----------
    frame : str
        Name of the frame that carries the foot. The z axis of a flat foot points out of the ground
        when the robot stands.
    radius : float
        Radius of the ball or the wheel [m]; 0 for a flat foot.
    centre : array_like, shape (3,)
        Centre of the ball or the wheel in the frame [m].
    corners : array_like, shape (n, 3), or None
        Corners of a flat foot in the frame [m]; None for a ball or a wheel.
    axis : array_like, shape (3,), or None
        Direction of a wheel's axle in the frame, dimensionless; it is scaled to unit length. None
        for a ball or a flat foot.
    """

    frame: str = field(metadata=checked(as_string))
    radius: float = field(default=0.0, metadata=checked(as_positive, "m", allow_zero=True))
    centre: Array = field(
        default_factory=lambda: np.zeros(3), metadata=checked(as_array, (3,), "m")
    )
    corners: Array | None = None
    axis: Array | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.corners is not None:
            object.__setattr__(self, "corners", as_corners(self.frame, self.corners))
        if self.axis is not None:
            axis = unit_vector(f"axis of {self._label()}", self.axis)
            object.__setattr__(self, "axis", axis)
            as_positive(f"radius of {self._label()}, a wheel,", self.radius, "m")
            if self.is_flat:
                raise InputError(
                    f"The foot {self.frame} has both corners and an axis. Pass corners for a flat "
                    f"foot, or an axis for a wheel."
                )

    def _label(self) -> str:
        """Return the name that messages use for the foot."""
        return f"foot {self.frame}" if isinstance(self.frame, str) else "a foot"

    @property
    def is_flat(self) -> bool:
        """Whether the foot stands on its corners rather than on one point."""
        return self.corners is not None

    def depth(self, rotation: Array, normal: Array) -> float:
        """Compute the distance from the middle of the foot down to the ground that it touches.

        A wheel that leans over is less deep than its radius. A flat foot has depth 0.

        Parameters
        ----------
        rotation : ndarray, shape (3, 3)
            Rotation matrix from the foot's frame to the world, dimensionless.
        normal : ndarray, shape (3,)
            Unit normal of the ground in the world frame.

        Returns
        -------
        float
            Distance along the normal [m].
        """
        lean = 0.0 if self.axis is None else float(normal @ rotation @ self.axis)
        return float(self.radius * max(0.0, 1.0 - lean**2) ** 0.5)

    @cached_property
    def points(self) -> Array:
        """Centre of the ball or the wheel, or the corners, shape (n, 3), in the frame [m]."""
        return self.centre[None] if self.corners is None else self.corners

    @cached_property
    def middle(self) -> Array:
        """Centre of the ball or the wheel, or mean of the corners, shape (3,), in the frame [m]."""
        return read_only(self.points.mean(axis=0))


@dataclass(frozen=True, eq=False)
class Robot(Value):
    """A robot model with feet, torque limits and a standing posture.

    Use `load`, `load_urdf` or `load_mjcf` to make one. A robot is immutable.

    Parameters
    ----------
    name : str
        Name under which the robot was loaded.
    model : pinocchio.Model
        Pinocchio model with q = (base position [m, world frame], base quaternion x y z w, joints),
        or q = joints if the base is fixed.
    urdf : str
        Checked text of the URDF, from which the simulation and the viewer are built.
    package_dirs : tuple of Path
        Folders that contain meshes named package://….
    feet : tuple of Foot
        Places where the robot can touch the ground.
    torque_limits : array_like, shape (d,)
        Torque limits [N·m], or force limits of prismatic joints [N]; +inf if unknown.
    posture : array_like, shape (nq,)
        Standing configuration, before the feet are placed on the ground. Joints are within their
        limits.
    description : str
        Purpose of the robot.
    sources : mapping of str to str
        Sources of the numbers that do not come from the URDF.
    nominal : Robot or None
        For a robot with a payload or scaled masses, the robot without them; otherwise None.

    Raises
    ------
    InputError
        If the arguments do not fit together, if no part of the robot can move, or if its inertia
        matrix M of eq. (1) is singular.

    Notes
    -----
    Pinocchio computes kinematics and dynamics [Carpentier2019]_.
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
    nominal: Robot | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "posture", as_posture(self.name, self.model, self.posture))
        object.__setattr__(self, "torque_limits", as_torque_limits(self.d, self.torque_limits))
        object.__setattr__(self, "sources", MappingProxyType(dict(self.sources)))
        frames = [self.frame_id(foot.frame) for foot in self.feet]
        for foot, frame in zip(self.feet, frames, strict=True):
            if frames.count(frame) > 1:
                raise InputError(
                    f"Duplicate foot {foot.frame!r} of {self.name}. Name each foot once."
                )
        self._check_inertia()

    def _check_inertia(self) -> None:
        """Raise `InputError` if the robot has no mass, or if eq. (1) cannot be solved for q̈."""
        if self.nv == 0:
            raise InputError(
                f"{self.name} cannot move: its base and all its joints are fixed. Free the base or "
                f"a joint."
            )
        if not 0.0 < self.mass < np.inf:
            raise InputError(
                f"{self.name} has a mass of {self.mass:g} kg. Give its links <inertial> in the "
                f"URDF."
            )
        M = pin.crba(self.model, self.model.createData(), np.array(self.posture))
        if not np.all(np.abs(M) <= MAX_MAGNITUDE):
            raise InputError(
                f"The inertia matrix M of {self.name} is not finite. Check the URDF for "
                f"unrealistic lengths or masses."
            )
        scale = np.sqrt(np.where(M.diagonal() > 0.0, M.diagonal(), 1.0))
        values, vectors = np.linalg.eigh(M / np.outer(scale, scale))
        participation = np.abs(vectors[:, values < _SINGULAR_M]).max(axis=1, initial=0.0)
        massless, n_base = participation > _PARTICIPATION_TOLERANCE, self.nv - self.d
        joints = np.array(self.joint_names)[massless[n_base:]].tolist()
        parts, hint = list(joints), f", or lock joints, as with locked={joints}" if joints else ""
        if massless[:n_base].any():
            parts.insert(0, "its base")
            hint += ", or load the robot with floating=False if it is bolted to the ground"
        if parts:
            raise InputError(
                f"{self.name} has a singular inertia matrix M in its posture: "
                f"{', '.join(parts)} can accelerate without moving any mass. Give these links "
                f"mass and inertia{hint}."
            )

    @cached_property
    def _fingerprint(self) -> bytes:
        """Digest of the data for equations, simulation and viewer, the same in every process."""
        feet = [
            (foot.frame, foot.radius, foot.is_flat, foot.points.tobytes(), str(foot.axis))
            for foot in self.feet
        ]
        numbers = self.torque_limits.tobytes(), self.posture.tobytes()
        return sha256(
            repr((self.name, self.urdf, self.model.saveToString(), feet, numbers)).encode()
        ).digest()

    def __eq__(self, other: object) -> bool:
        """Return whether `other` is the same robot, even if loaded again or unpickled."""
        return self is other or (
            isinstance(other, Robot) and self._fingerprint == other._fingerprint
        )

    def __hash__(self) -> int:
        return hash(self._fingerprint)

    @cached_property
    def is_floating(self) -> bool:
        """Whether the base can move freely: nv = d + 6 rather than nv = d."""
        return has_floating_base(self.model)

    @cached_property
    def nq(self) -> int:
        """Length of the configuration q, which consists of q_base and q_jnt.

        q_base has 7 entries for a floating base and none for a fixed base.

        Notes
        -----
        [FBR]_, eq. (2).
        """
        return int(self.model.nq)

    @cached_property
    def nv(self) -> int:
        """Length of v, of q̈ and of each row of J.

        The length is d + 6 for a floating base and d for a fixed base.

        Notes
        -----
        [FBR]_, eq. (2).
        """
        return int(self.model.nv)

    @cached_property
    def d(self) -> int:
        """Length of τ: the number of actuated joints.

        Notes
        -----
        [FBR]_, eq. (2).
        """
        return self.nv - (6 if self.is_floating else 0)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the actuated joints, in the order of τ."""
        return tuple(self.model.names)[2 if self.is_floating else 1 :]

    @cached_property
    def S(self) -> Array:
        """Actuation matrix, shape (nv, d): the rows of S τ without a motor are zero.

        Notes
        -----
        [FBR]_, eq. (3).
        """
        return read_only(np.eye(self.nv, self.d, self.d - self.nv))

    @cached_property
    def mass(self) -> float:
        """Total mass [kg].

        With a fixed base it includes the fixed links, which `State.com` does not.
        """
        return float(sum(inertia.mass for inertia in self.model.inertias))

    @property
    def gravity(self) -> float:
        """Magnitude of the gravitational acceleration [m/s²]."""
        return float(np.linalg.norm(self.model.gravity.linear))

    @property
    def weight(self) -> float:
        """Total weight [N]."""
        return self.mass * self.gravity

    @cached_property
    def _workspace(self) -> Workspace:
        """Memory for Pinocchio's results at a state."""
        return Workspace(self.model)

    @cached_property
    def base(self) -> str:
        """Name of the frame of the base link."""
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
        """Index of each frame in Pinocchio.

        A link and a joint may share a name, which then stands for the link. Of other frames with
        the same name, the first counts. "base" is the base link.
        """
        frames = list(enumerate(self.model.frames))[::-1]  # of equal names, the last entry counts
        links = {str(frame.name): i for i, frame in frames if frame.type == pin.FrameType.BODY}
        numbers = {str(frame.name): i for i, frame in frames} | links
        return {"base": numbers[self.base]} | numbers

    def frame_id(self, frame: str) -> int:
        """Return the index of a frame in Pinocchio.

        Parameters
        ----------
        frame : str
            Name of the frame; "base" is the base link of every robot.

        Returns
        -------
        int
            Index of the frame in `model.frames`.

        Raises
        ------
        UnknownNameError
            If the robot has no such frame; the message lists similar names.
        """
        if not isinstance(frame, str) or frame not in self._frame_ids:
            raise unknown_name(
                f"frame of {self.name}", frame, self.frames, "robot.frames lists all of them."
            )
        return self._frame_ids[frame]

    def foot(self, frame: str) -> Foot:
        """Return the foot that a frame carries.

        Parameters
        ----------
        frame : str
            Name of the frame.

        Returns
        -------
        Foot
            The foot of the robot, or a point foot of radius 0 at the frame's origin if the frame is
            not a foot.

        Raises
        ------
        UnknownNameError
            If the robot has no such frame.
        """
        self.frame_id(frame)
        return next((foot for foot in self.feet if foot.frame == frame), Foot(frame))

    def neutral(self) -> State:
        """Return the state at rest with all joints at zero and the base at the world origin."""
        from floatbase.robots.state import State

        return State(self, pin.neutral(self.model))

    def standing(
        self,
        height: float | None = None,
        normal: npt.ArrayLike | None = None,
        offset: npt.ArrayLike | None = None,
        surface: Callable[[Array], float] | None = None,
        balanced: bool = False,
    ) -> State:
        """Return a state at rest with every foot on the ground.

        The base is oriented as in the posture.

        Parameters
        ----------
        height : float, optional
            Height of the base's origin above z = 0 in the world frame [m]. By default it follows
            from the feet.
        normal : array_like, shape (3,) or (n, 3), optional
            Normals of the ground planes in the world frame; up by default. Every plane is solid, so
            several planes can form a valley.
        offset : float or array_like, shape (n,), optional
            Offsets of the planes normal · x = offset [m]; 0 by default.
        surface : callable, optional
            Height of the ground as a function of x and y, shape (2,), such as `Ground.height` [m].
            Where it is above the planes, feet stand on it as on a level surface.
        balanced : bool, optional
            Whether the CoM keeps its horizontal distance from the middle of the feet, as on level
            ground. Otherwise the base keeps its horizontal position, which moves the CoM on a
            slope.

        Returns
        -------
        State
            The standing state. A fixed-base robot and a robot without feet get their posture.

        Raises
        ------
        InputError
            If the feet cannot all reach the ground.
        """
        from floatbase.robots.standing import find_standing_state

        if height is normal is offset is None and surface is None and balanced is False:
            return self._standing
        return find_standing_state(self, height, normal, offset, surface, balanced)

    @cached_property
    def _standing(self) -> State:
        """Standing state on level ground with the default height."""
        from floatbase.robots.standing import find_standing_state

        return find_standing_state(self)

    def with_payload(
        self, frame: str, mass: float, position: npt.ArrayLike = (0.0, 0.0, 0.0)
    ) -> Robot:
        """Return the robot with a point mass fixed to one of its links.

        Give the robot with the payload to the simulation, to the controller or to both: a
        controller made with the robot without it does not know about the payload.

        Parameters
        ----------
        frame : str
            Name of the frame that carries the payload; "base" is the base link.
        mass : float
            Mass of the payload [kg].
        position : array_like, shape (3,), optional
            Position of the payload in the frame [m]. By default, the frame's origin.

        Returns
        -------
        Robot
            A robot with the same joints, feet and limits.

        Raises
        ------
        UnknownNameError
            If the robot has no such frame.
        InputError
            If the mass is not positive, or if the frame is fixed to the ground.

        Examples
        --------
        >>> import floatbase as fb
        >>> robot = fb.load("go2")
        >>> round(robot.with_payload("base", 3.0).mass - robot.mass, 6)
        3.0
        """
        i, mass = self.frame_id(frame), as_positive("mass of the payload", mass, "kg")
        point = as_array("position of the payload", position, (3,), "m")
        if self.model.frames[i].parentJoint == 0:
            raise InputError(
                f"A payload at {frame!r} has no effect, because {self.name} is fixed to the ground "
                f"there. Name a frame that moves."
            )
        return self._with_model(*add_point_mass(self.model, self.urdf, i, mass, point))

    def with_scaled_mass(self, factor: float) -> Robot:
        """Return the robot with all its masses and moments of inertia multiplied by a factor.

        M and h of eq. (1) are then multiplied by the factor, because rotor inertias are scaled,
        too. A controller made with such a robot overestimates or underestimates the actual mass.

        Parameters
        ----------
        factor : float
            The factor, positive [-].

        Returns
        -------
        Robot
            A robot with the same joints, feet and limits.

        Raises
        ------
        InputError
            If the factor is not positive.
        """
        return self._with_model(*scale_masses(self.model, self.urdf, as_positive("factor", factor)))

    def _with_model(self, model: pin.Model, urdf: str) -> Robot:
        """Return the robot with other masses."""
        nominal = self if self.nominal is None else self.nominal
        return replace(self, model=model, urdf=urdf, nominal=nominal)

    def has_joints_of(self, other: Robot) -> bool:
        """Return whether this robot and another one differ in their masses at most.

        Parameters
        ----------
        other : Robot
            The other robot.

        Returns
        -------
        bool
            Whether states and torques of one robot also fit the other one.
        """
        pair = self, as_instance("other", other, Robot, 'fb.load("go2")')
        first, second = (robot if robot.nominal is None else robot.nominal for robot in pair)
        return first == second

    def random_state(self, seed: int | np.random.Generator = 0, spread: float = 0.3) -> State:
        """Return a random state near the standing state; equal seeds give equal states.

        Parameters
        ----------
        seed : int or numpy.random.Generator, optional
            Seed of the random numbers.
        spread : float, optional
            Largest deviation of joints [rad or m], base orientation [rad] and base position [m]. It
            is also the standard deviation of the normally distributed velocities [rad/s and m/s].

        Returns
        -------
        State
            The state. Its joints are within their limits.
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
    """Memory for Pinocchio's results, one per thread; allocation takes longer than filling."""

    def __init__(self, model: pin.Model):
        self.data = model.createData()
        self.state: Callable[[], State | None] = lambda: None
        self.has_jacobians = False
