"""Controllers with a wrong model of the robot: what they assume instead of eq. (7)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from floatbase._validation import Value, as_bool, as_instance, as_positive, as_strings, checked
from floatbase.dynamics import EquationsOfMotion
from floatbase.errors import unknown_name
from floatbase.qp import QP, ConstraintLabel


@dataclass(frozen=True)
class ModelMismatch(Value):
    """Difference between a controller's model and the exact equations of motion, eq. (7).

    Eq. (7) is M q̈ + h = S τ + Jᵀ λ with A q̈ = b. By default, the model is exact. Pass a mismatch
    to a controller as its `modify_qp`. Tasks still use the exact model. For wrong friction or wrong
    normals no mismatch is needed: set them in the controller's contacts.

    Parameters
    ----------
    mass : float
        Assumed masses and inertias as a multiple of the robot's own, dimensionless. It scales M and
        h.
    gravity : bool
        Whether h contains gravity.
    velocity_forces : bool
        Whether h contains the velocity-dependent terms (Coriolis and centrifugal forces).
    drift : bool
        Whether b contains -J̇ q̇. Otherwise A q̈ = 0.
    ignored_contacts : iterable of str
        Names of contacts or feet whose forces are left out of Jᵀ λ.
    underactuated : bool
        Whether S has its zero rows, eq. (3). Otherwise the controller assumes a motor for each
        motion of the base.
    cones : bool
        Whether forces must lie in friction cones. Otherwise feet may pull, nᵀ λ < 0.

    Examples
    --------
    >>> import floatbase as fb
    >>> from floatbase.playground import ModelMismatch
    >>> robot = fb.load("go2")
    >>> tasks = fb.standing_tasks(robot.standing())
    >>> mismatch = ModelMismatch(gravity=False)
    >>> contacts = fb.Contacts.feet(robot)
    >>> controller = fb.WholeBodyController(robot, contacts, tasks, modify_qp=mismatch)
    """

    compiled_as: ClassVar[str] = "assumed model"
    mass: float = field(default=1.0, metadata=checked(as_positive))
    gravity: bool = field(default=True, metadata=checked(as_bool))
    velocity_forces: bool = field(default=True, metadata=checked(as_bool))
    drift: bool = field(default=True, metadata=checked(as_bool))
    ignored_contacts: Iterable[str] = field(default=(), metadata=checked(as_strings))
    underactuated: bool = field(default=True, metadata=checked(as_bool))
    cones: bool = field(default=True, metadata=checked(as_bool))

    @property
    def is_exact(self) -> bool:
        """Whether the controller assumes eq. (7) without changes."""
        return self == ModelMismatch()

    def assumed_equations(self, eom: EquationsOfMotion) -> EquationsOfMotion:
        """Return the equations of motion that the controller assumes.

        Parameters
        ----------
        eom : EquationsOfMotion
            Exact equations of motion.

        Returns
        -------
        EquationsOfMotion
            Equations with the assumed M, h, J and b.

        Raises
        ------
        UnknownNameError
            If an ignored contact is neither a contact nor a foot.
        """
        if as_instance("eom", eom, EquationsOfMotion) and self.is_exact:
            return eom
        gravity = eom.state.replace(v=np.zeros(eom.nv)).h
        h = self.gravity * gravity + self.velocity_forces * (eom.h - gravity)
        J = np.array(eom.J)
        known = {*eom.contacts.names, *(foot.frame for foot in eom.robot.feet)}
        for name in self.ignored_contacts:
            if name in eom.contacts.names:
                J[eom.contacts.force_slice(name)] = 0.0
            elif name not in known:  # a foot in the air has no force
                raise unknown_name("contact", name, known)
        return replace(
            eom,
            M=self.mass * eom.M,
            h=self.mass * h,
            J=J,
            b=eom.b if self.drift else np.zeros_like(eom.b),
        )

    def __call__(self, qp: QP, eom: EquationsOfMotion) -> QP:
        """Replace the rows of eq. (7) in a QP by those that the controller assumes.

        Parameters
        ----------
        qp : QP
            Quadratic program of the whole-body controller.
        eom : EquationsOfMotion
            Exact equations of motion from which `qp` was made.

        Returns
        -------
        QP
            The QP with the assumed model.
        """
        as_instance("eom", eom, EquationsOfMotion)
        if as_instance("qp", qp, QP) and self.is_exact:
            return qp
        assumed, A, b = self.assumed_equations(eom), np.array(qp.A), np.array(qp.b)
        A[: eom.nv] = np.hstack([assumed.M, -assumed.S, -assumed.J.T])
        b[: eom.nv] = -assumed.h
        if not self.drift:
            b[eom.nv :] = 0.0
        first = 0 if self.underactuated else eom.nv - eom.d  # the base's rows come first
        qp = replace(qp, A=A[first:], b=b[first:], equality_names=qp.equality_names[first:])
        if self.cones:
            return qp
        kinds = {label.kind for label in qp.inequality_names if isinstance(label, ConstraintLabel)}
        return qp.without(*sorted(kinds & {"friction", "normal force"}))
