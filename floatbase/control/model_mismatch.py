"""What a controller assumes of (7) where that is not the truth, to study what each term is for."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from floatbase._validation import Value, as_bool, as_instance, as_positive, as_strings
from floatbase.dynamics import Contacts, EquationsOfMotion
from floatbase.errors import unknown_name
from floatbase.qp import QP, ConstraintLabel

_SWITCHES = ("gravity", "velocity_forces", "drift", "underactuated", "cones")


@dataclass(frozen=True, eq=False)
class ModelMismatch(Value):
    """What a controller takes (7), M q̈ + h = S τ + Jᵀ λ with A q̈ = b, to be. The defaults are
    exact.

        fb.WholeBodyController(robot, contacts, tasks, mismatch=ModelMismatch(gravity=False))

    The tasks see the truth. Wrong friction and wrong normals need no mismatch: they are those of
    the controller's contacts.

    mass: all masses and inertias as a multiple of the true ones, M and h.
    gravity: whether h contains gravity.
    velocity_forces: whether h contains what grows with the velocity, Coriolis and centrifugal
        forces.
    drift: whether b contains -J̇ q̇; else A q̈ = 0.
    ignored_contacts: names of contacts whose forces are left out of the motion, so that Jᵀ λ lacks
        them.
    underactuated: whether S has its zeros (3); else the controller counts on a motor for each
        motion of the base.
    cones: whether forces lie in friction cones; else feet may pull, nᵀ λ < 0.
    """

    mass: float = 1.0
    gravity: bool = True
    velocity_forces: bool = True
    drift: bool = True
    ignored_contacts: Iterable[str] = ()
    underactuated: bool = True
    cones: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(
            self,
            "mass",
            as_positive("mass of the model, as a multiple of the actual one,", self.mass),
        )
        object.__setattr__(
            self, "ignored_contacts", as_strings("ignored_contacts", self.ignored_contacts)
        )
        for name in _SWITCHES:
            as_bool(name, getattr(self, name))

    @property
    def is_exact(self) -> bool:
        """Whether there is none: the model is exact."""
        return (
            self.mass == 1.0
            and not self.ignored_contacts
            and all(getattr(self, name) for name in _SWITCHES)
        )

    def assumed_equations(self, eom: EquationsOfMotion) -> EquationsOfMotion:
        """The equations of motion as the controller assumes them."""
        if as_instance("eom", eom, EquationsOfMotion) and self.is_exact:
            return eom
        gravity = eom.state.replace(v=np.zeros(eom.nv)).h
        h = self.gravity * gravity + self.velocity_forces * (eom.h - gravity)
        J = np.array(eom.J)
        for name in self.ignored_contacts:
            if name in eom.contacts.names:  # a foot in the air has no force
                J[eom.contacts.force_slice(name)] = 0.0
        return replace(
            eom,
            M=self.mass * eom.M,
            h=self.mass * h,
            J=J,
            b=eom.b if self.drift else np.zeros_like(eom.b),
        )

    def assumed_qp(self, qp: QP, eom: EquationsOfMotion) -> QP:
        """The QP of `build_qp` as the controller assumes it: without the base's rows of (7), or
        without cones, where these are off.
        """
        if not self.cones:
            kinds = {
                label.kind for label in qp.inequality_names if isinstance(label, ConstraintLabel)
            }
            qp = qp.without(*sorted(kinds & {"friction", "normal force"}))
        if self.underactuated:
            return qp
        first = eom.nv - eom.d  # the base's rows of (7) come first
        return replace(qp, A=qp.A[first:], b=qp.b[first:], equality_names=qp.equality_names[first:])

    def check_names(self, contacts: Contacts) -> None:
        """Raise `UnknownNameError` for an ignored contact that does not exist."""
        for name in self.ignored_contacts:
            if name not in contacts.names:
                raise unknown_name("contact", name, contacts.names)


NO_MISMATCH = ModelMismatch()
