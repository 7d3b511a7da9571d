"""Regularization tasks, which keep contact forces and joint torques near a target."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from floatbase._validation import Array, as_forces, as_instance
from floatbase.affine import Affine
from floatbase.dynamics import Block, EquationsOfMotion
from floatbase.objectives._task import Shape, Shapes, Target, TargetTask
from floatbase.robots import Robot

_WEIGHT = 1e-5  # 1/N² and 1/(N·m)²
# N: with the weight 1e-5, heavier robots sag when they stand, since forces cost more than motion
_MAX_LOAD = 400.0


def effort_weight(robot: Robot) -> float:
    """Return the weight of the force and torque tasks that a controller adds by itself.

    The cost of the forces that carry a robot grows with the square of the robot's weight, but the
    cost of an acceleration does not grow. Above a robot's weight of 400 N, about 40 kg, the weight
    of the tasks therefore falls with its square. A standing robot of any mass then plans forces
    that carry it, to 1 part in 1000.

    Parameters
    ----------
    robot : Robot
        The robot.

    Returns
    -------
    float
        1e-5, or less for a heavy robot [1/N² and 1/(N·m)²].
    """
    weight = as_instance("robot", robot, Robot, 'fb.load("go2")').weight
    return _WEIGHT * (_MAX_LOAD / max(weight, _MAX_LOAD)) ** 2


@dataclass(frozen=True, eq=False)
class _BlockTask(TargetTask):
    """Base of tasks that keep a block x of (q̈, τ, λ) near a target, zero by default."""

    target: Target | None = None
    weight: float = _WEIGHT

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """Compute the residual x - target."""
        (target,) = self._targets(eom, t)
        return Affine(Affine.identity(target.size).A, -target)


@dataclass(frozen=True, eq=False)
class ForceTask(_BlockTask):
    """A task that keeps contact forces near a target, with residual λ - target.

    With a small weight, the task chooses among forces with the same wrench.

    Parameters
    ----------
    target : array_like, shape (k,) or (k / 3, 3), or callable, optional
        Target forces in world axes [N], or a function of the time t [s] that returns shape (k,).
        The default is zero.
    weight : float, optional
        Weight of ½‖residual‖² in the objective [1/N²].
    name : str, optional
        Name in messages and tables.
    """

    name: str = "force regularization"
    block: ClassVar[Block] = "forces"
    target_shapes: ClassVar[Shapes] = {"target": ("k",)}
    compiled_as = "force"

    def _as_target(self, label: str, target: Any, shape: Shape) -> Array:
        return as_forces(target, None, label)


@dataclass(frozen=True, eq=False)
class TorqueTask(_BlockTask):
    """A task that keeps joint torques near a target, with residual τ - target.

    Parameters
    ----------
    target : array_like, shape (d,), or callable, optional
        Target torques [N·m], or a function of the time t [s] that returns them. The default is
        zero.
    weight : float, optional
        Weight of ½‖residual‖² in the objective [1/(N·m)²].
    name : str, optional
        Name in messages and tables.
    """

    name: str = "torque regularization"
    block: ClassVar[Block] = "tau"
    target_shapes: ClassVar[Shapes] = {"target": ("d",)}
    compiled_as = "torque"
