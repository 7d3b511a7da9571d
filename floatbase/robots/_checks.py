"""Checks of what robots and states are made of, shared between packages."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import Array, as_array, numeric_copy, read_only, short_repr
from floatbase.errors import InputError

# quaternions printed with seven digits pass; normalising what is further off could hide a fault
UNIT_NORM_TOLERANCE = 1e-6
_LIMIT_TOLERANCE = 1e-6  # rad or m: angles printed with seven digits pass
# m: corners nearer to one line than this span no area; feet are measured to 0.1 mm
_AREA_TOLERANCE = 1e-6


def has_floating_base(model: pin.Model) -> bool:
    """Whether a model's base is free to move."""
    return model.njoints > 1 and bool(model.joints[1].shortname() == "JointModelFreeFlyer")


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
