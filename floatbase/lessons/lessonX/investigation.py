"""Lesson X: find the fault in a black box, the solution of exercise X.3."""

from itertools import combinations

import numpy as np

from floatbase.lessons.lessonX.black_box import BlackBox
from floatbase.lessons.lessonX.diagnostics import (
    ground_normal,
    lagged,
    required_forces,
    sliding_friction_ratios,
)


def investigate(box: BlackBox) -> str:
    """Return a fault with its evidence, or "nothing"."""
    return plan_fault(box) or motor_fault(box) or ground_fault(box) or "nothing"


def plan_fault(box: BlackBox) -> str:
    """Check whether the controller planned a possible motion."""
    rows = [(i, box.equations(i)) for i in range(0, len(box), 5)]
    left = np.array([e.M @ box.qdd[i] + e.h for i, e in rows])
    right = np.array([e.S @ box.tau[i] + e.J.T @ box.planned[i] for i, e in rows])
    factor = np.sum(left * right) / np.sum(left**2)
    if abs(factor - 1) > 0.05:
        return f"mass {factor:.3f}"
    early = [(i, box.equations(i)) for i in np.flatnonzero(box.time < 0.5)]
    b = max(abs(e.b).max() for _, e in early)
    asked = max(abs(e.A @ box.qdd[i]).max() for i, e in early)
    return f"drift {b:.2f} m/s²" if asked < 0.1 * b else ""


def motor_fault(box: BlackBox) -> str:
    """Check whether the joints got the commanded torques."""
    got, commanded = required_forces(box)[:, 6:], box.tau[:-1]
    off = np.median(abs(commanded - got), axis=0)
    if off.max() < 0.5:  # N·m
        return ""
    constants = range(0, 120, 2)  # ms
    period = box.time[1] - box.time[0]
    late = [np.median(abs(lagged(commanded, period, ms) - got)) for ms in constants]
    if min(late) < 0.3 * late[0]:
        return f"slow motors {constants[np.argmin(late)]} ms"
    return swapped_joints(box, got, commanded, off)


def swapped_joints(
    box: BlackBox,
    got: np.ndarray,
    commanded: np.ndarray,
    off: np.ndarray,
) -> str:
    """Find two joints that got each other's commands, within torque limits."""
    names, limits = box.robot.joint_names, box.robot.torque_limits
    best, found = 0.3, ""
    for i, j in combinations(range(len(names)), 2):
        crossed = np.clip(commanded[:, [j, i]], -limits[[i, j]], limits[[i, j]])
        left = np.median(abs(crossed - got[:, [i, j]]), axis=0)
        share = left.sum() / (off[i] + off[j])
        if share < best:
            best, found = share, f"swapped motors {names[i]} {names[j]}"
    return found


def ground_fault(box: BlackBox) -> str:
    """Check whether the ground is what the controller assumed."""
    normal, assumed = ground_normal(box), box.contacts.normals[0]
    angle = np.rad2deg(np.arccos(min(1.0, normal @ assumed)))
    if angle > 5:
        return f"normal {angle:.1f}°"
    used = sliding_friction_ratios(box, normal)
    if len(used) < 10:
        return ""
    mu = np.percentile(used, 90)
    return f"friction {mu:.2f}" if mu < 0.9 * box.contacts.mus[0] else ""
