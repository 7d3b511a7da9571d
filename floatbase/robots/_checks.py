"""Checks of robots and states that several packages share."""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import Array, as_array, numeric_copy, read_only, short_repr
from floatbase.errors import InputError, UnknownNameError

# accepts quaternions printed with seven digits; normalizing a larger error could hide a fault
UNIT_NORM_TOLERANCE = 1e-6
_LIMIT_TOLERANCE = 1e-6  # rad or m: accepts angles printed with seven digits
# m: corners closer than this to one line span no area; feet are measured to 0.1 mm
_AREA_TOLERANCE = 1e-6


def has_floating_base(model: pin.Model) -> bool:
    """Return whether the base of a model can move freely."""
    return model.njoints > 1 and bool(model.joints[1].shortname() == "JointModelFreeFlyer")


def joint_limits(model: pin.Model) -> tuple[Array, Array, Array, Array]:
    """Return the joints with limits: Pinocchio's indices, indices in q, lower and upper limits.

    Each has shape (n,). The limits are in rad or m. Joints whose lower and upper limits are equal,
    such as the 0 and 0 of a URDF without limits, count as unlimited, as in MuJoCo.
    """
    joints = np.array([i for i in range(1, model.njoints) if model.nqs[i] == 1], dtype=int)
    index = np.array(model.idx_qs)[joints]
    lower, upper = model.lowerPositionLimit[index], model.upperPositionLimit[index]
    limited = lower < upper
    return joints[limited], index[limited], lower[limited], upper[limited]


def clamp_to_limits(model: pin.Model, q: Array) -> Array:
    """Return a configuration with its joints within their limits.

    An angle outside its limits changes by whole turns if that is enough. Otherwise it becomes the
    nearest limit.
    """
    joints, index, lower, upper = joint_limits(model)
    clamped, nearest = np.array(q), np.clip(q[index], lower, upper)
    excess = q[index] - nearest
    # the least number of turns
    unwrapped = q[index] - 2.0 * np.pi * np.sign(excess) * np.ceil(np.abs(excess) / (2.0 * np.pi))
    types = [model.joints[joint].shortname() for joint in joints.tolist()]
    use_unwrapped = np.char.startswith(np.array(types, dtype=str), "JointModelR")
    use_unwrapped &= np.abs(excess) > _LIMIT_TOLERANCE
    use_unwrapped &= (lower <= unwrapped) & (unwrapped <= upper)
    clamped[index] = np.where(use_unwrapped, unwrapped, nearest)
    return read_only(clamped)


def as_posture(name: str, model: pin.Model, posture: npt.ArrayLike) -> Array:
    """Return a standing configuration, shape (nq,), after checking that it is valid.

    The quaternions of a valid configuration have length 1, and its joints are within their limits.
    """
    layout = "the joint positions"
    if has_floating_base(model):
        layout = f"{model.nq - 7} joint positions, or 7 numbers for the base and then the joints"
        joints_alone = numeric_copy(posture)
        if joints_alone is not None and joints_alone.shape == (model.nq - 7,):
            posture = np.concatenate([pin.neutral(model)[:7], joints_alone])
    q = as_array("posture", posture, (model.nq,), layout)
    check_unit_norms(model, "posture", q)
    joints, index, lower, upper = joint_limits(model)
    for joint, x, minimum, maximum in zip(joints, q[index], lower, upper, strict=True):
        if not minimum - _LIMIT_TOLERANCE <= x <= maximum + _LIMIT_TOLERANCE:
            raise InputError(
                f"The posture of {name} has joint {model.names[int(joint)]} at {x:.6g}. It must "
                f"lie between its limits {minimum:.6g} and {maximum:.6g} [rad or m]."
            )
    return q


def with_angles(
    name: str, model: pin.Model, q: Array, angles: npt.ArrayLike | Mapping[str, float] | None
) -> npt.ArrayLike:
    """Return a configuration with other positions of some joints [rad or m], or the one given.

    A * in the name of a joint stands for any characters. Later entries take precedence.
    """
    if not isinstance(angles, Mapping):
        return q if angles is None else angles
    changed, joints = np.array(q), list(model.names)[2 if has_floating_base(model) else 1 :]
    for pattern, angle in angles.items():
        matching = [j for j in joints if j == pattern or fnmatchcase(j, str(pattern))]
        if not matching:
            raise UnknownNameError(
                f"No joint of {name} has the name {short_repr(pattern)}. A * stands for any "
                f"characters. The joints are {', '.join(joints) or 'all fixed'}."
            )
        x = float(as_array(f"posture[{pattern!r}]", angle, (), "rad or m"))
        for joint in map(model.getJointId, matching):
            # a joint without limits has the entries (cos, sin)
            entries = [np.cos(x), np.sin(x)] if model.nqs[joint] == 2 else x
            changed[model.idx_qs[joint] :][: model.nqs[joint]] = entries
    return changed


def check_unit_norms(
    model: pin.Model, name: str, q: Array, hint: str = "", first_joint: int = 1
) -> None:
    """Raise `InputError` if a quaternion or a (cos, sin) pair is not of length 1.

    A (cos, sin) pair describes a joint without limits.
    """
    if pin.isNormalized(model, q, UNIT_NORM_TOLERANCE):
        return  # faster than the loop below
    for i in range(first_joint, model.njoints):
        translations = {"JointModelFreeFlyer": 3, "JointModelPlanar": 2}.get(
            model.joints[i].shortname(), 0
        )  # they precede the quaternion
        part = slice(model.idx_qs[i] + translations, model.idx_qs[i] + model.nqs[i])
        length = float(np.linalg.norm(q[part]))
        if model.nqs[i] != model.nvs[i] and abs(length - 1.0) > UNIT_NORM_TOLERANCE:
            numbers = "pair (cos, sin)" if len(q[part]) == 2 else "quaternion (x y z w)"
            owner = "the base" if i == 1 and translations == 3 else f"joint {model.names[i]!r}"
            raise InputError(
                f"The {numbers} {name}[{part.start}:{part.stop}] of {owner} has length "
                f"{length:.8g}; the length must be 1. Divide by this length{hint}."
            )


def as_corners(frame: str, value: npt.ArrayLike) -> Array:
    """Return the corners of a foot, shape (n, 3) [m], in its frame, after checking their area.

    Corners on one line cannot constrain six directions of motion.
    """
    corners = as_array(f"corners of {frame}", value, (None, 3), "m")
    if (
        len(corners) < 3
        or np.linalg.matrix_rank(corners - corners.mean(axis=0), tol=_AREA_TOLERANCE) < 2
    ):
        raise InputError(
            f"The corners of {frame} span no area. A flat foot needs at least 3 corners that are "
            f"not on one line."
        )
    return corners


def as_torque_limits(d: int, value: npt.ArrayLike) -> Array:
    """Return torque limits, given as one number or shape (d,), as an array of shape (d,) [N·m].

    +inf means that a joint has no limit.
    """
    limits = numeric_copy(value)
    if (
        limits is None or limits.shape not in ((), (d,)) or not np.all(limits > 0)
    ):  # NaN is not > 0 either
        got = short_repr(value) if limits is None else f"shape {limits.shape}: {short_repr(value)}"
        raise InputError(
            f"torque_limits must be one number > 0, or {d} such numbers [N·m], not {got}."
        )
    return read_only(np.broadcast_to(limits, (d,)))
