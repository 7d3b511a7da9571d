"""`ModelMismatch`: what a controller assumes of (7) where that is not the truth, to study what each
term is for.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from floatbase._validation import Value, as_bool, as_instance, as_positive, as_strings, checked
from floatbase.dynamics import EquationsOfMotion
from floatbase.errors import unknown_name
from floatbase.qp import QP, ConstraintLabel


@dataclass(frozen=True)
class ModelMismatch(Value):
    """What a controller assumes instead of (7), M q̈ + h = S τ + Jᵀ λ with A q̈ = b. The defaults
    are exact.

        fb.WholeBodyController(robot, contacts, tasks, modify_qp=ModelMismatch(gravity=False))

    The tasks use the exact model. Wrong friction and wrong normals need no mismatch: they are those
    of the controller's contacts.

    mass: all masses and inertias as a multiple of the true ones, M and h.
    gravity: whether h contains gravity.
    velocity_forces: whether h contains what grows with the velocity, Coriolis and centrifugal
        forces.
    drift: whether b contains -J̇ q̇; else A q̈ = 0.
    ignored_contacts: names of contacts or feet whose forces are left out of the motion, so that
        Jᵀ λ lacks them.
    underactuated: whether S has its zeros (3); else the controller counts on a motor for each
        motion of the base.
    cones: whether forces lie in friction cones; else feet may pull, nᵀ λ < 0.
    """

    mass: float = field(default=1.0, metadata=checked(as_positive))
    gravity: bool = field(default=True, metadata=checked(as_bool))
    velocity_forces: bool = field(default=True, metadata=checked(as_bool))
    drift: bool = field(default=True, metadata=checked(as_bool))
    ignored_contacts: Iterable[str] = field(default=(), metadata=checked(as_strings))
    underactuated: bool = field(default=True, metadata=checked(as_bool))
    cones: bool = field(default=True, metadata=checked(as_bool))

    @property
    def is_exact(self) -> bool:
        """Whether the controller assumes (7) as it is."""
        return self == ModelMismatch()

    def assumed_equations(self, eom: EquationsOfMotion) -> EquationsOfMotion:
        """The equations of motion as the controller assumes them.

        Raises `UnknownNameError` for an ignored contact that is neither a contact nor a foot.
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
        """The QP as the controller assumes it, with other rows of (7) than `qp` has at `eom`, as
        `modify_qp` of `fb.WholeBodyController`.
        """
        if self.is_exact:
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
