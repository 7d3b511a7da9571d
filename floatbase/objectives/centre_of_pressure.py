"""Task for the centre of pressure of the contact forces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from floatbase.affine import Affine
from floatbase.dynamics import Block, EquationsOfMotion, grasp_matrix
from floatbase.objectives._task import Shapes, Target, TargetTask


@dataclass(frozen=True, eq=False)
class CentreOfPressureTask(TargetTask):
    """A task that brings the centre of pressure of the contact forces to a position.

    The residual is the horizontal moment of the contact forces about the target, which is linear in
    λ. On level ground this moment is zero exactly if the target is the centre of pressure, that is
    the zero-moment point (ZMP).

    Parameters
    ----------
    position : array_like, shape (3,), or callable
        Target in the world frame, at the height of the ground [m], or a function of the time t [s]
        that returns it.
    weight : float, optional
        Weight of ½‖residual‖² in the objective [1/(N·m)²].
    name : str, optional
        Name in messages and tables.

    Notes
    -----
    The residual is the horizontal part of Σ (x_i - position) × f_i, [FBR]_, eq. (21) about
    another point. All forces that act at points count, but those of a `LinearConstraint` do not.
    The ZMP is described in [Vukobratovic2004]_. `floatbase.friction.centre_of_pressure` computes
    it.

    The centre of pressure p and the centre of mass c are not independent: without a change of the
    angular momentum, c̈ = ω² (c - p), with ω = √(g / height). The robot falls if the target
    is fixed. Tasks for both conflict unless their targets satisfy this equation, as those of
    `floatbase.behaviours.LIPM` do.

    The task leaves most of λ open. A flat foot, for example, has 12 force components at its four
    corners, which produce only 6 components of a wrench. A controller therefore adds a small
    `ForceTask` to this task.
    """

    position: Target
    weight: float = 1e-2
    name: str = "centre of pressure"
    block: ClassVar[Block] = "forces"
    target_shapes: ClassVar[Shapes] = {"position": (3,)}
    compiled_as = "centre of pressure"

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """Compute the horizontal moment of the contact forces about the target.

        Parameters
        ----------
        eom : EquationsOfMotion
            Equations of motion at the current state.
        t : float, optional
            Time at which the target is evaluated [s].

        Returns
        -------
        Affine
            Map from λ to the residual, shape (2,), in the world's x and y [N·m].
        """
        (position,) = self._targets(eom, t)
        moment = np.zeros((2, eom.k))
        moment[:, eom.contacts.point_force_indices] = grasp_matrix(
            eom.contacts.positions(eom.state), position
        )[3:5]
        return Affine.linear(moment)
