"""`AngularMomentumTask`: the whole robot's angular momentum about its centre of mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy.typing as npt
import pinocchio as pin

from floatbase.affine import Affine
from floatbase.dynamics import Block, EquationsOfMotion
from floatbase.objectives._task import Shapes, Target, TargetTask


@dataclass(frozen=True, eq=False)
class AngularMomentumTask(TargetTask):
    """Bring the angular momentum k_G about the centre of mass to a target; residual in q̈, N·m.

    The residual is d/dt k_G - (d/dt k_desired - kd (k_G - k_desired)), where d/dt k_G is affine in
    q̈. With the default target it damps rotation of the whole robot. In contact it is (21): the
    moment of the contact forces about the centre of mass.

    momentum: shape (3,), kg·m²/s, world; or a function of t that gives it, or (momentum, rate).
    rate: shape (3,), N·m, world, of a target that is no function.
    kd: gain on the momentum, 1/s.
    weight, name: as for `CoMTask`.

    Source: Orin, Goswami, Lee, Centroidal dynamics of a humanoid robot, 2013.
    """

    momentum: Target = (0.0, 0.0, 0.0)
    rate: npt.ArrayLike = (0.0, 0.0, 0.0)
    kd: float = 10.0
    weight: float = 1e-2
    name: str = "angular momentum"
    block: ClassVar[Block] = "qdd"
    target_shapes: ClassVar[Shapes] = {"momentum": (3,), "rate": (3,)}

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """A_k q̈ + Ȧ_k q̇ - (rate - kd (k_G - momentum)), shape (3,), N·m, where k_G = A_k q̇."""
        momentum, rate = self._targets(eom, t)
        robot, state = eom.robot, eom.state
        data = state._data
        # of one joint Pinocchio gives (6,)
        rate_matrix = pin.dccrba(robot.model, data, state.q, state.v).reshape(6, robot.nv)
        drift, matrix = rate_matrix[3:] @ state.v, data.Ag.reshape(6, robot.nv)[3:]
        return Affine(matrix, drift - rate + self.kd * (data.hg.angular - momentum))
