"""Regularisation tasks, which keep contact forces and joint torques near a target."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from floatbase._validation import Array, as_forces
from floatbase.affine import Affine
from floatbase.dynamics import Block, EquationsOfMotion
from floatbase.objectives._task import Shape, Shapes, Target, TargetTask


@dataclass(frozen=True, eq=False)
class _BlockTask(TargetTask):
    """Base of tasks that keep a block x of (q̈, τ, λ) near a target, zero by default."""

    target: Target | None = None
    weight: float = 1e-5

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """Compute the residual x - target."""
        (target,) = self._targets(eom, t)
        return Affine.identity(target.size) - target


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

    name: str = "force regularisation"
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

    name: str = "torque regularisation"
    block: ClassVar[Block] = "tau"
    target_shapes: ClassVar[Shapes] = {"target": ("d",)}
    compiled_as = "torque"
