"""Task for the angular momentum of the whole robot about its centre of mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy.typing as npt

from floatbase.affine import Affine
from floatbase.dynamics import Block, EquationsOfMotion
from floatbase.objectives._task import Shapes, Target, TargetTask


@dataclass(frozen=True, eq=False)
class AngularMomentumTask(TargetTask):
    """A task that brings the angular momentum k_G about the centre of mass to a target.

    The residual is d/dt k_G - (d/dt k_desired - kd (k_G - k_desired)), where d/dt k_G is affine in
    q̈. With the default target, the task damps rotation of the whole robot. In contact, d/dt k_G is
    the moment of the contact forces about the centre of mass, eq. (21).

    Parameters
    ----------
    momentum : array_like, shape (3,), or callable, optional
        Target in the world frame [kg·m²/s], or a function of the time t [s] that returns
        `momentum` or `(momentum, rate)`. The default is zero.
    rate : array_like, shape (3,), optional
        Time derivative of the target in the world frame [N·m], if `momentum` is not a function.
    kd : float, optional
        Gain on the momentum error [1/s].
    weight : float, optional
        Weight of ½‖residual‖² in the objective [1/(N·m)²].
    name : str, optional
        Name in messages and tables.

    Notes
    -----
    Centroidal dynamics are described in [Orin2013]_.
    """

    momentum: Target = (0.0, 0.0, 0.0)
    rate: npt.ArrayLike = (0.0, 0.0, 0.0)
    kd: float = 10.0
    weight: float = 1e-2
    name: str = "angular momentum"
    block: ClassVar[Block] = "qdd"
    target_shapes: ClassVar[Shapes] = {"momentum": (3,), "rate": (3,)}
    compiled_as = "angular momentum"

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """Compute the residual A_k q̈ + Ȧ_k q̇ - (rate - kd (k_G - momentum)), with k_G = A_k q̇.

        Parameters
        ----------
        eom : EquationsOfMotion
            Equations of motion at the current state.
        t : float, optional
            Time at which the targets are evaluated [s].

        Returns
        -------
        Affine
            Map from q̈ to the residual, shape (3,), in the world frame [N·m].
        """
        momentum, rate = self._targets(eom, t)
        state = eom.state
        matrix, drift = state.centroidal_matrix[3:], state.centroidal_drift[3:]
        return Affine(matrix, drift - rate + self.kd * (matrix @ state.v - momentum))
