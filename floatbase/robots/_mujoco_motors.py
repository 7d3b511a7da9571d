"""Motors of a MuJoCo model: which actuators drive a joint, and with which torques."""

from __future__ import annotations

import mujoco
import numpy as np
import numpy.typing as npt

from floatbase._validation import Array

_JOINT_TRANSMISSIONS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))


def motors_of(model: mujoco.MjModel, joint: int) -> list[int]:
    """Return the actuators of a joint."""
    is_of_joint = model.actuator_trnid[:, 0] == joint
    is_at_joints = np.isin(model.actuator_trntype, _JOINT_TRANSMISSIONS)
    return list(map(int, np.flatnonzero(is_of_joint & is_at_joints)))


def gear(model: mujoco.MjModel, motors: npt.ArrayLike) -> Array:
    """Return the gear ratios of actuators of joints."""
    ratios: Array = model.actuator_gear[model.actuator_outadr[motors], 0]
    return ratios


def is_torque_motor(model: mujoco.MjModel, motor: int) -> bool:
    """Return whether the force of an actuator is proportional to its control."""
    return bool(
        model.actuator_gaintype[motor] == mujoco.mjtGain.mjGAIN_FIXED
        and model.actuator_biastype[motor] == mujoco.mjtBias.mjBIAS_NONE
        and model.actuator_dyntype[motor] != mujoco.mjtDyn.mjDYN_INTEGRATOR
        and model.actuator_gainprm[motor, 0] * gear(model, motor) != 0.0
    )


def largest_torque(model: mujoco.MjModel, joint: int) -> float:
    """Return the torque or force that all actuators of a joint can apply, or infinity."""
    motors = motors_of(model, joint)
    torque = sum(_largest_force(model, motor) for motor in motors) if motors else np.inf
    if model.jnt_actfrclimited[joint]:
        torque = min(torque, _magnitude(model.jnt_actfrcrange[joint]))
    return torque


def _largest_force(model: mujoco.MjModel, motor: int) -> float:
    """Return the torque or force that an actuator can apply to its joint."""
    force, control = np.inf, model.actuator_ctrladr[motor]
    if is_torque_motor(model, motor) and model.actuator_ctrllimited[control]:
        force = _magnitude(model.actuator_gainprm[motor, 0] * model.actuator_ctrlrange[control])
    if model.actuator_forcelimited[motor]:
        force = min(force, _magnitude(model.actuator_forcerange[motor]))
    return float(force * abs(gear(model, motor)))


def _magnitude(limits: Array) -> float:
    """Return the largest magnitude that both directions of a range allow."""
    smallest, largest = sorted(map(float, np.abs(limits)))
    return smallest if min(limits) < 0.0 < max(limits) else largest
