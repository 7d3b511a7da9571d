"""Residuals of tasks by finite differences of Pinocchio's kinematics."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

import floatbase as fb
from floatbase.objectives import (
    AngularMomentumTask,
    AxisTask,
    CentreOfPressureTask,
    RelativePoseTask,
)

STEP = 2e-3  # s
Array = np.ndarray


class Kinematics:
    """Pinocchio's kinematics along q(t) = q ⊕ (v t + q̈ t² / 2)."""

    def __init__(self, state: fb.State):
        self.robot, self.model = state.robot, state.robot.model
        self.data, self.q, self.v = self.model.createData(), np.array(state.q), np.array(state.v)

    def at(self, t: float, qdd: Array) -> tuple[Array, Array]:
        """Return q and the velocity at t."""
        q = pin.integrate(self.model, self.q, t * self.v + 0.5 * t * t * qdd)
        return q, self.v + t * qdd

    def pose(self, frame: str, q: Array) -> pin.SE3:
        """Return the pose of a frame."""
        pin.framesForwardKinematics(self.model, self.data, q)
        return self.data.oMf[self.robot.frame_id(frame)].copy()

    def com(self, q: Array) -> Array:
        """Return the centre of mass."""
        return pin.centerOfMass(self.model, self.data, q).copy()

    def angular_momentum(self, q: Array, v: Array) -> Array:
        """Return the angular momentum about the centre of mass, world axes."""
        return pin.computeCentroidalMomentum(self.model, self.data, q, v).angular.copy()

    def derivatives(self, moved: Callable[[Array], Array], qdd: Array) -> tuple[Array, Array]:
        """Return first and second derivative of a displacement along the path, extrapolated."""
        found = []
        for h in (STEP, 0.5 * STEP):
            ahead, behind = (moved(self.at(t, qdd)[0]) for t in (h, -h))
            found.append(((ahead - behind) / (2.0 * h), (ahead + behind) / h**2))
        return tuple((4.0 * fine - coarse) / 3.0 for coarse, fine in zip(*found, strict=True))

    def rate(self, value: Callable[[Array, Array], Array], qdd: Array) -> Array:
        """Return the derivative of a function of q and v along the path, extrapolated."""
        coarse, fine = (
            (value(*self.at(h, qdd)) - value(*self.at(-h, qdd))) / (2.0 * h)
            for h in (STEP, 0.5 * STEP)
        )
        return (4.0 * fine - coarse) / 3.0


def angle_between(R: Array, target: Array) -> Array:
    """Return the rotation vector from one orientation to another."""
    return pin.log3(R @ target.T)


def acceleration(at: Kinematics, task: Any, qdd: Array) -> Array:
    """Return the residual of a task on q̈, by finite differences."""
    if isinstance(task, AngularMomentumTask):
        momentum = at.angular_momentum(at.q, at.v)
        return at.rate(at.angular_momentum, qdd) + task.kd * (momentum - task.momentum)
    if isinstance(task, AxisTask):
        axis, d = np.array(task.axis), np.array(task.direction)
        axis, d = axis / np.linalg.norm(axis), d / np.linalg.norm(d)
        n = at.pose(task.frame, at.q).rotation @ axis
        speed, change = at.derivatives(lambda q: at.pose(task.frame, q).rotation @ axis - n, qdd)
        e = np.cross(d, n)
        e *= np.arctan2(np.linalg.norm(e), d @ n) / np.linalg.norm(e)
        feedback = task.kp * e + task.kd * np.cross(n, speed)
        return np.cross(n, change) + feedback - n * (n @ feedback)
    if isinstance(task, fb.PostureTask):
        error = pin.difference(at.model, np.array(task.q), at.q)[6:]
        return qdd[6:] + task.kp * error + task.kd * at.v[6:]
    moved, error = displacement(at, task)
    speed, change = at.derivatives(moved, qdd)
    return change + task.kp * error + task.kd * speed


def displacement(at: Kinematics, task: Any) -> tuple[Callable[[Array], Array], Array]:
    """Return the displacement from the state as a function of q, and the error in the state."""
    if isinstance(task, fb.CoMTask):
        start = at.com(at.q)
        return lambda q: at.com(q) - start, start - task.position
    if isinstance(task, RelativePoseTask):

        def pose(q: Array) -> pin.SE3:
            return at.pose(task.reference, q).actInv(at.pose(task.frame, q))

        first, goal = pose(at.q), np.array(task.pose)
        error = np.r_[first.translation - goal[:3, 3], angle_between(first.rotation, goal[:3, :3])]

        def moved(q: Array) -> Array:
            now = pose(q)
            return np.r_[
                now.translation - first.translation, angle_between(now.rotation, first.rotation)
            ]

        return moved, error
    first = at.pose(task.frame, at.q)
    if isinstance(task, fb.OrientationTask):
        error = angle_between(first.rotation, np.array(task.rotation))
        return lambda q: angle_between(at.pose(task.frame, q).rotation, first.rotation), error
    start = first.translation
    return lambda q: at.pose(task.frame, q).translation - start, start - task.position


def residual(state: fb.State, eom: Any, task: Any) -> tuple[Array, Array]:
    """Return A and b of the residual A y + b of a task on its block y of (q̈, τ, λ)."""
    if task.block == "tau":
        return np.eye(state.robot.d), np.zeros(state.robot.d)
    if isinstance(task, CentreOfPressureTask):
        arms = eom.contacts.positions(state) - task.position
        moment = np.hstack([pin.skew(arm)[:2] for arm in arms])
        return moment, np.zeros(2)
    if task.block == "forces":
        return np.eye(eom.k), np.zeros(eom.k)
    at, zero = Kinematics(state), np.zeros(state.robot.nv)
    b = acceleration(at, task, zero)
    columns = [acceleration(at, task, unit) - b for unit in np.eye(state.robot.nv)]
    return np.column_stack(columns), b
