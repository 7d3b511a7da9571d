"""Joint limits: bounds on q̈ that keep positions, velocities and accelerations within limits."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_instance,
    as_positive,
    cached_property,
    checked,
    numeric_copy,
    read_only,
    short_repr,
)
from floatbase.errors import InputError
from floatbase.qp import ConstraintLabel
from floatbase.robots import Robot, State
from floatbase.robots._checks import as_torque_limits
from floatbase.robots._checks import joint_limits as position_limits

# per rad/s² or m/s²: outweighs a task of weight 10 with a residual below 10 m/s². With a much
# larger weight, a supporting leg lets the robot fall rather than touch a joint's stop
_WEIGHT = 100.0
# fraction of a motor's acceleration in the standing posture that a joint can rely on for braking:
# gravity, other joints and other postures need the rest
_BRAKING_FRACTION = 0.5
# rad/s² or m/s²: a supporting leg brakes its joints no faster than this
_MAX_BRAKING = 300.0
# multiple of `braking` that a bound may demand: without a reserve, a joint that moves faster than
# planned would not stop in time
_RESERVE = 2.0
# fraction of a speed limit: torques are constant in a control period, so a joint gets faster than
# planned (go2's thigh by 0.3 % at 30 rad/s and 4 ms)
_SPEED_MARGIN = 3e-3
# s: bounds for a longer control period also hold for shorter ones, and the slowest loops run at
# 250 Hz
_CONTROL_PERIOD = 4e-3
# difference between an acceleration and its bound, as a fraction of 1 rad/s² plus the acceleration:
# rounding errors of the QP are smaller
_REACHED_TOLERANCE = 1e-6
_MIN_PERIOD = 1e-6  # s: shorter periods are in another unit
# of soft constraints: beside larger weights, those of tasks and regularization lose their digits
_MAX_WEIGHT = 1e8
_KINDS = ("position", "velocity", "acceleration")


def _as_bounds(name: str, value: Any) -> Array:
    """Return a vector of numbers or infinities, checked."""
    bounds = numeric_copy(value)
    if bounds is None or bounds.ndim != 1 or np.any(np.isnan(bounds)):
        raise InputError(
            f"{name} must have one number per joint, or inf, but it is {short_repr(value)}."
        )
    return read_only(bounds)


def _as_magnitudes(name: str, value: Any) -> Array:
    """Return a vector of positive numbers or inf, checked."""
    bounds = _as_bounds(name, value)
    if not np.all(bounds > 0.0):
        raise InputError(f"{name} must be positive, but its smallest entry is {bounds.min():g}.")
    return bounds


def _as_period(name: str, value: Any) -> float:
    """Return a control period [s], checked."""
    period = as_positive(name, value, "s")
    if period < _MIN_PERIOD:
        raise InputError(f"{name} is {period:g} s. It must be at least {_MIN_PERIOD:g} s.")
    return period


def as_weight(name: str, value: Any) -> float | None:
    """Check and return the weight of a soft constraint, or None for a hard constraint."""
    return None if value is None else as_positive(name, value, maximum=_MAX_WEIGHT)


@dataclass(frozen=True, eq=False)
class JointLimits(Value):
    """Position, velocity and acceleration limits of the actuated joints.

    `of` makes the limits of a robot, and `dataclasses.replace` changes some of them.

    Parameters
    ----------
    lower, upper : array_like, shape (d,)
        Position limits [rad or m]; -inf and inf for none.
    velocity : array_like, shape (d,)
        Largest speeds [rad/s or m/s]; inf for none.
    acceleration : array_like, shape (d,)
        Largest accelerations in both directions [rad/s² or m/s²]; inf for none.
    braking : array_like, shape (d,)
        Decelerations with which the joints stop [rad/s² or m/s²]. If a joint moves faster than
        planned, the bounds demand at most twice as much.
    period : float, optional
        Control period [s]. The limits also hold for shorter periods.
    weight : float, optional
        Weight of a violation in the objective [units of the objective per rad/s² or m/s²]. The
        penalty is linear: violation · weight. The cost of a task is quadratic, ½ weight ·
        residual². A limit can therefore yield to a task whose weight · residual exceeds the limit's
        weight, such as a task of weight 10 with a residual of more than 10 m/s². A limit also
        yields to torques and contacts that oppose it. None makes the limits hard: if they cannot
        hold, the QP has no solution.

    Raises
    ------
    InputError
        If shapes do not match, if a lower limit is above its upper limit, or if a value is not
        positive.

    Notes
    -----
    A position limit is useless in a controller unless the joint can stop before the limit. `bounds`
    therefore limits q̈ so that, after one control period, the joint is in a state from which it can
    stop in time with the acceleration `braking`. Such states are called viable [DelPrete2018]_.
    """

    _example = "floatbase.control.JointLimits.of(robot)"
    lower: Array = field(metadata=checked(_as_bounds))
    upper: Array = field(metadata=checked(_as_bounds))
    velocity: Array = field(metadata=checked(_as_magnitudes))
    acceleration: Array = field(metadata=checked(_as_magnitudes))
    braking: Array = field(metadata=checked(_as_magnitudes))
    period: float = field(default=_CONTROL_PERIOD, metadata=checked(_as_period))
    weight: float | None = field(default=_WEIGHT, metadata=checked(as_weight))

    def __post_init__(self) -> None:
        super().__post_init__()
        names = ("lower", "upper", "velocity", "acceleration", "braking")
        sizes = {name: len(getattr(self, name)) for name in names}
        if len(set(sizes.values())) > 1:
            raise InputError(f"Joint limits need one number per joint, but the sizes are {sizes}.")
        if np.any(self.lower > self.upper):
            joint = int(np.argmax(self.lower > self.upper))
            raise InputError(
                f"The lower limit of joint {joint}, {self.lower[joint]:g}, is above its upper "
                f"limit, {self.upper[joint]:g}."
            )
        if np.any(self.lower == np.inf) or np.any(self.upper == -np.inf):
            raise InputError("lower must be below inf, and upper above -inf.")
        if not np.all(np.isfinite(self.braking)):
            raise InputError("braking must be finite.")

    @classmethod
    def of(
        cls, robot: Robot, *, torque_limits: npt.ArrayLike | None = None, **changes: Any
    ) -> JointLimits:
        """Return the limits in a robot's URDF.

        Parameters
        ----------
        robot : Robot
            The robot. Joints without position or velocity limits in the URDF have none, and neither
            have joints whose lower and upper limits are equal there.
        torque_limits : float or array_like, shape (d,), optional
            Torque limits that determine `braking` [N·m]. The default is those of the robot. Give
            the controller's torque limits if they are different.
        **changes
            Parameters of the class to change, such as velocity=... or weight=1e4.

        Returns
        -------
        JointLimits
            The limits. The URDF has no acceleration limits. `braking` is half of the acceleration
            that the torque limit gives each joint in the standing posture with the base fixed, but
            at most 300 rad/s².

        Raises
        ------
        InputError
            If an argument has a wrong type, shape or value.
        """
        limits = _limits_of(as_instance("robot", robot, Robot, 'fb.load("go2")'))
        if torque_limits is not None:
            torques = as_torque_limits(robot.d, torque_limits)
            changes = {"braking": _braking(robot, torques), **changes}
        limits = replace(limits, **changes)
        limits.check_size(robot)
        return limits

    def check_size(self, robot: Robot) -> None:
        """Check that the limits have one number per joint of a robot.

        Parameters
        ----------
        robot : Robot
            The robot.

        Raises
        ------
        InputError
            If they do not.
        """
        if len(self.lower) != robot.d:
            raise InputError(
                f"The joint limits are for {len(self.lower)} joints, but {robot.name} has "
                f"{robot.d}."
            )

    @cached_property
    def decelerations(self) -> tuple[Array, Array]:
        """Planned and largest deceleration in front of a limit, (d,) each [rad/s² or m/s²]."""
        planned = np.minimum(self.braking, self.acceleration)
        largest = np.minimum(_RESERVE * self.braking, self.acceleration)
        return read_only(planned), read_only(largest)

    @cached_property
    def speeds(self) -> Array:
        """Speeds that the bounds on q̈ use, a little below the limits, (d,) [rad/s or m/s]."""
        return read_only((1.0 - _SPEED_MARGIN) * self.velocity)

    @cached_property
    def bounded(self) -> npt.NDArray[np.bool_]:
        """Whether q̈ has an upper and a lower bound, shape (2, d)."""
        other = np.isfinite(self.velocity) | np.isfinite(self.acceleration)
        found = np.array([np.isfinite(self.upper) | other, np.isfinite(self.lower) | other])
        found.setflags(write=False)
        return found

    def bounds(self, q: npt.ArrayLike, v: npt.ArrayLike) -> tuple[Array, Array]:
        """Return the least and the largest joint acceleration that keep the joints viable.

        Parameters
        ----------
        q : array_like, shape (d,)
            Joint positions [rad or m].
        v : array_like, shape (d,)
            Joint velocities [rad/s or m/s].

        Returns
        -------
        least, largest : ndarray, shape (d,)
            Bounds of the joint accelerations [rad/s² or m/s²]; -inf and inf for none.
        """
        size = self.lower.shape
        q, v = as_array("q", q, size), as_array("v", v, size)
        return self._bounds_and_kinds(q, v)[:2]

    def _bounds_and_kinds(self, q: Array, v: Array) -> tuple[Array, Array, npt.NDArray[np.intp]]:
        """Return the bounds of `bounds`, and the kinds of the upper and the lower ones, (2, d)."""
        (largest, opposite), kinds = self._upper_bounds(
            np.array([self.upper - q, q - self.lower]), np.array([v, -v])
        )
        least = -opposite
        if (conflict := least > largest).any():  # as in a locked joint
            least[conflict] = largest[conflict] = 0.5 * (least[conflict] + largest[conflict])
        return least, largest, kinds

    def near(self, state: State, fraction: float) -> npt.NDArray[np.bool_]:
        """Return which joints are near a position limit, or beyond it.

        Parameters
        ----------
        state : State
            State of a robot with d joints.
        fraction : float
            Fraction of its range within which a joint is near a limit [-]. A joint without a lower
            or an upper limit has no range and is never near a limit.

        Returns
        -------
        ndarray of bool, shape (d,)
            The joints.
        """
        q, _ = self._joints_of(state)
        with np.errstate(invalid="ignore"):  # inf - inf
            margin = as_positive("fraction", fraction) * (self.upper - self.lower)
            below, above = q < self.lower + margin, q > self.upper - margin
        near: npt.NDArray[np.bool_] = (below | above) & np.isfinite(margin)
        return near

    def reached(self, state: State, qdd: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Return which joints have an acceleration at one of their bounds, or beyond it.

        The limits of these joints are active if a controller with these limits planned the
        accelerations.

        Parameters
        ----------
        state : State
            State of a robot with d joints.
        qdd : array_like, shape (nv,)
            Generalized acceleration [m/s² or rad/s²].

        Returns
        -------
        ndarray of bool, shape (d,)
            The joints.
        """
        q, v = self._joints_of(state)
        robot = state.robot
        planned = as_array("qdd", qdd, (robot.nv,), "m/s² or rad/s²")[robot.nv - robot.d :]
        least, largest = self.bounds(q, v)
        tolerance = _REACHED_TOLERANCE * (1.0 + np.abs(planned))
        reached: npt.NDArray[np.bool_] = planned >= largest - tolerance
        return reached | (planned <= least + tolerance)

    def _joints_of(self, state: State) -> tuple[Array, Array]:
        """Return positions [rad or m] and velocities [rad/s or m/s] of the joints, (d,) each."""
        robot = as_instance("state", state, State).robot
        self.check_size(robot)
        index = _position_indices(robot)  # 0 for joints that turn without limits
        return np.where(index >= 0, state.q[index], 0.0), state.v[robot.nv - robot.d :]

    def _upper_bounds(self, gap: Array, v: Array) -> tuple[Array, npt.NDArray[np.intp]]:
        """Return the largest accelerations towards limits, (2, d), and the index of their kind.

        gap: distance to the limits [rad or m], (2, d). v: velocity towards them [rad/s or m/s],
        (2, d).
        """
        dt, (brake, most) = self.period, self.decelerations
        stop, step = v / -dt, v * dt  # at rest after one period; distance in one period
        each = np.empty((len(_KINDS), *v.shape))
        with np.errstate(invalid="ignore", divide="ignore"):
            # the position after one period, or at the turning point if the joint turns before that
            reach = 2.0 * (gap - step) / dt**2
            turns = (v > 0.0) & (gap > 0.0) & (reach <= stop)
            position = np.where(turns, np.minimum(stop, -(v**2) / (2.0 * gap)), reach)
            # the position at which the joint stops if it brakes after one period; NaN if it cannot
            square = brake * (8.0 * gap - 4.0 * step + brake * dt**2)
            viable = (np.sqrt(square) - 2.0 * v - brake * dt) / (2.0 * dt)
        each[0] = np.minimum(position, np.fmax(viable, stop))
        each[1], each[2] = (self.speeds - v) / dt, self.acceleration
        return np.maximum(each.min(axis=0), -most), each.argmin(axis=0)

    def rows(self, state: State) -> tuple[Array, Array, tuple[ConstraintLabel, ...]]:
        """Return G, h and names of the inequalities G q̈ ≤ h at a state.

        Parameters
        ----------
        state : State
            State of a robot with d joints.

        Returns
        -------
        G : ndarray, shape (m, nv)
            Coefficients.
        h : ndarray, shape (m,)
            Right-hand side [rad/s² or m/s²].
        names : tuple of ConstraintLabel
            Names such as "FL_calf_joint position upper". The second word names the strictest limit
            in this state.
        """
        q, v = self._joints_of(state)
        robot = state.robot
        least, largest, kinds = self._bounds_and_kinds(q, v)
        upper, lower = self.bounded
        h = np.concatenate([largest[upper], -least[lower]])
        labels = _labels(robot, self)[np.arange(len(h)), kinds[self.bounded]]
        return _selection(robot, self), h, tuple(labels)


@lru_cache(maxsize=64)
def _labels(robot: Robot, limits: JointLimits) -> npt.NDArray[np.object_]:
    """Return the names of the m rows for each kind of the strictest limit, shape (m, 3)."""
    labels = [
        ConstraintLabel(f"{joint} {kind} {side}", f"{side} {kind} limit", joint)
        for side, is_bounded in zip(("upper", "lower"), limits.bounded, strict=True)
        for joint in np.array(robot.joint_names)[is_bounded].tolist()
        for kind in _KINDS
    ]
    return np.array(labels, dtype=np.object_).reshape(-1, len(_KINDS))


@lru_cache(maxsize=64)
def _position_indices(robot: Robot) -> npt.NDArray[np.intp]:
    """Return where each joint's position is in q, -1 if q has its cosine and sine instead."""
    model = robot.model
    first = model.njoints - robot.d
    sizes, starts = np.array(model.nqs)[first:], np.array(model.idx_qs)[first:]
    return np.where(sizes == 1, starts, -1)


@lru_cache(maxsize=64)
def _selection(robot: Robot, limits: JointLimits) -> Array:
    """Return G of the bounded joints' upper, then lower bounds, shape (m, nv)."""
    rows = np.eye(robot.nv)[robot.nv - robot.d :]
    upper, lower = limits.bounded
    return read_only(np.vstack([rows[upper], -rows[lower]]))


@lru_cache(maxsize=64)
def _limits_of(robot: Robot) -> JointLimits:
    """Return the limits in a robot's URDF."""
    model, d = robot.model, robot.d
    lower, upper = np.full(robot.nq, -np.inf), np.full(robot.nq, np.inf)
    _, index, least, largest = position_limits(model)
    lower[index], upper[index] = least, largest
    at = _position_indices(robot)
    velocity = np.array(model.velocityLimit[robot.nv - d :])
    lower, upper = np.where(at >= 0, lower[at], -np.inf), np.where(at >= 0, upper[at], np.inf)
    velocity = np.where(velocity > 0.0, velocity, np.inf)  # 0: not in the URDF
    braking = _braking(robot, robot.torque_limits)
    return JointLimits(lower, upper, velocity, np.full(d, np.inf), braking)


def _braking(robot: Robot, torque_limits: Array) -> Array:
    """Return decelerations that torque limits (d,) allow in the standing posture, (d,)."""
    reachable = _BRAKING_FRACTION * torque_limits / _joint_inertias(robot)
    return np.minimum(reachable, _MAX_BRAKING)


@lru_cache(maxsize=64)
def _joint_inertias(robot: Robot) -> Array:
    """Return the inertia of each joint with the base fixed, standing, (d,) [kg·m² or kg]."""
    model = robot.model
    inertia = pin.crba(model, model.createData(), np.array(robot.posture)).diagonal()
    return read_only(inertia[robot.nv - robot.d :].copy())
