"""Regularisation: contact forces and joint torques kept near a target."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from floatbase._validation import Array, as_forces
from floatbase.affine import Affine
from floatbase.dynamics import Block, EquationsOfMotion
from floatbase.objectives._task import Shape, Shapes, Target, TargetTask


@dataclass(frozen=True, eq=False)
class _BlockTask(TargetTask):
    """Keep a block x of (q̈, τ, λ) near a target, zero by default."""

    target: Target | None = None
    weight: float = 1e-5

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """x - target, N or N·m."""
        (target,) = self._targets(eom, t)
        return Affine.identity(target.size) - target


@dataclass(frozen=True, eq=False)
class ForceTask(_BlockTask):
    """Keep contact forces near a target, shape (k,), N, world, zero by default; residual in λ, N.

    With a small weight it chooses among forces of equal wrench: the force regularisation.
    """

    name: str = "force regularisation"
    block: ClassVar[Block] = "forces"
    target_shapes: ClassVar[Shapes] = {"target": ("k",)}
    compiled_as = "force"

    def _as_target(self, label: str, target: Any, shape: Shape) -> Array:
        return as_forces(target, None, label)


@dataclass(frozen=True, eq=False)
class TorqueTask(_BlockTask):
    """Keep joint torques near a target, shape (d,), N·m, zero by default; residual in τ, N·m."""

    name: str = "torque regularisation"
    block: ClassVar[Block] = "tau"
    target_shapes: ClassVar[Shapes] = {"target": ("d",)}
    compiled_as = "torque"
