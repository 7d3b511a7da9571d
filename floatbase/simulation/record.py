"""`Rollout`: what happened under a controller on the physics, row by row; `Recorder` collects it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import pinocchio as pin

from floatbase._arrays import Array, Value, read_only, whole
from floatbase.dynamics import Contacts
from floatbase.errors import FloatbaseError, InputError, unknown_name
from floatbase.robots import Robot, State
from floatbase.simulation.physics import Push, Simulation

Outcome = Literal["completed", "fell", "diverged", "controller failed"]


@dataclass(frozen=True, eq=False)
class Rollout(Value):
    """What happened: one row for each of n control ticks. Read-only.

    contacts: all that the controller had at any time; its stance at row i is `contacts_at(i)`.

    Before the tick:
    time: (n,) s, the simulation's clock.
    q, v: (n, nq) and (n, nv), as in `State`.
    foot_positions: (n, points, 3) m, world, of the contacts' points; NaN for points that the physics does not have.

    During the tick:
    tau: (n, d) N·m, the torques applied, within the motors' limits; their mean.
    tau_desired: (n, d) N·m, the controller's.
    planned: (n, k) N, world, the controller's forces at `contacts`: 0 at those that its stance did not have, NaN where it
        gave no forces.
    measured: (n, k) N, world, the physics' forces at `contacts`, whether or not the stance had them; their mean. NaN for
        contacts that the physics does not have.

    pushes: those handed to `rollout`.
    outcome: why the record ends there: "completed", "fell", "diverged" or "controller failed".
    error: of a controller that failed: the exception it raised, or one that names the NaN or infinite torque it gave.
    stances: the controller's contacts at each row; empty where they were `contacts` throughout.
    """

    robot: Robot
    contacts: Contacts
    time: Array
    q: Array
    v: Array
    tau: Array
    tau_desired: Array
    planned: Array
    measured: Array
    foot_positions: Array
    pushes: tuple[Push, ...]
    outcome: Outcome
    error: FloatbaseError | None = None
    stances: tuple[Contacts, ...] = ()

    def __len__(self) -> int:
        return int(self.time.size)

    def state(self, i: int) -> State:
        """The state at row i."""
        i = whole("row", i, -len(self), len(self) - 1)
        return State(self.robot, self.q[i], self.v[i])

    def contacts_at(self, i: int) -> Contacts:
        """The controller's stance at row i."""
        i = whole("row", i, -len(self), len(self) - 1)
        return self.stances[i] if self.stances else self.contacts

    def force(self, contact: str, kind: Literal["measured", "planned"] = "measured") -> Array:
        """The force of a contact, such as "FL_foot", through time, shape (n, 3), N, world: of a flat foot the resultant."""
        if not isinstance(kind, str) or kind not in ("measured", "planned"):
            raise unknown_name("kind of force", kind, ("measured", "planned"))
        return self.contacts.force_of(self.measured if kind == "measured" else self.planned, contact)

    @property
    def final(self) -> State:
        """The state at the last row."""
        self._check_not_empty()
        return self.state(-1)

    @cached_property
    def com(self) -> Array:
        """Centre of mass at each row, shape (n, 3), m, world."""
        model, data = self.robot.model, self.robot.model.createData()
        return read_only(np.reshape([pin.centerOfMass(model, data, q).copy() for q in self.q], (-1, 3)))

    def slip(self) -> Array:
        """How far each contact point strayed from where it was first, shape (points,), m."""
        self._check_not_empty()
        return read_only(np.linalg.norm(self.foot_positions - self.foot_positions[0], axis=2).max(axis=0))

    def _check_not_empty(self) -> None:
        if not len(self):
            raise InputError(f"this record is empty: {self.outcome}{'' if self.error is None else f', {self.error}'}")

    def __repr__(self) -> str:
        span = f"{len(self)} rows to {self.time[-1]:.3f} s" if len(self) else "no row"
        return f"Rollout({self.robot.name}, {span}, {self.outcome})"


class Recorder:
    """Collects the rows of a rollout of at most `ticks` ticks that begins in a stance: `before` and `during` each tick."""

    def __init__(self, sim: Simulation, stance: Contacts, ticks: int):
        self._sim, self._first, self._n = sim, stance, 0
        d, points = sim.robot.d, len(sim.point_names)
        sizes = {"time": (), "q": (sim.robot.nq,), "v": (sim.robot.nv,), "tau": (d,), "tau_desired": (d,)}
        self._rows = {name: np.empty((ticks, *size)) for name, size in sizes.items()}
        self._forces, self._positions = np.empty((ticks, points, 3)), np.empty((ticks, points, 3))  # of the physics' points
        self._stances: list[Contacts] = []
        self._plans: list[Array | None] = []

    def before(self, q: Array, v: Array) -> None:
        """Keep clock, state and feet before a tick. They count when `during` completes the row."""
        n = self._n
        self._rows["time"][n], self._rows["q"][n], self._rows["v"][n] = self._sim.time, q, v
        self._positions[n] = self._sim.contact_positions()

    def during(self, tau: Array, tau_desired: Array, forces: Array, stance: Contacts, planned: Array | None) -> None:
        """Complete the row: torques as in `Rollout`, the physics' forces (points, 3), planned ones (k,) at the stance."""
        n = self._n
        self._rows["tau"][n], self._rows["tau_desired"][n], self._forces[n] = tau, tau_desired, forces
        self._stances.append(stance)
        self._plans.append(planned)
        self._n += 1

    def finished(self, pushes: tuple[Push, ...], outcome: Outcome, error: FloatbaseError | None = None) -> Rollout:
        """The record. Raises `InputError` where a contact was of one kind in one stance and of another in a later one."""
        contacts = self._first
        for contact in (contact for stance in dict.fromkeys(self._stances) for contact in stance):
            if contact.name not in contacts.names:
                contacts += Contacts([contact])
            elif contact.k != contacts[contact.name].k:
                raise InputError(
                    f"contact {contact.name} had {contacts[contact.name].k} force numbers at first and now has {contact.k}; "
                    "in one rollout it must stay a point, or a flat foot."
                )
        measured, positions = self._at_contacts(contacts)
        return Rollout(
            self._sim.robot,
            contacts,
            **{name: read_only(rows[: self._n]) for name, rows in self._rows.items()},
            planned=self._planned(contacts),
            measured=measured,
            foot_positions=positions,
            pushes=pushes,
            outcome=outcome,
            error=error,
            stances=() if all(stance is contacts for stance in self._stances) else tuple(self._stances),
        )

    def _planned(self, contacts: Contacts) -> Array:
        """Planned forces at the contacts, shape (n, k)."""
        forces, numbers = np.full((self._n, contacts.k), np.nan), np.arange(contacts.k)
        stances = dict.fromkeys(self._stances)
        entries = {stance: [i for name in stance.names for i in numbers[contacts.force_slice(name)]] for stance in stances}
        for row, stance, planned in zip(forces, self._stances, self._plans, strict=True):
            if planned is not None:
                row[:] = 0.0
                row[entries[stance]] = planned
        return read_only(forces)

    def _at_contacts(self, contacts: Contacts) -> tuple[Array, Array]:
        """Forces (n, k) and positions (n, points, 3) of the contacts from those of the physics' feet; NaN where it has none.

        A point contact in the middle of a flat foot takes the sum of its corners' forces and the mean of their positions.
        """
        n, feet = self._n, self._sim.feet
        all_forces, all_positions = [np.zeros((n, 0))], [np.zeros((n, 0, 3))]
        for contact in contacts:
            forces, positions = np.full((n, contact.k), np.nan), np.full((n, len(contact.point_names), 3), np.nan)
            if contact.name in feet.names:
                part = feet.force_slice(contact.name)
                points = slice(part.start // 3, part.stop // 3)
                if contact.point_names == feet[contact.name].point_names:
                    forces, positions = self._forces[:n, points].reshape(n, contact.k), self._positions[:n, points]
                elif len(contact.point_names) == 1:
                    forces = self._forces[:n, points].sum(axis=1)
                    positions = self._positions[:n, points].mean(axis=1, keepdims=True)
            all_forces.append(forces)
            all_positions.append(positions)
        return read_only(np.concatenate(all_forces, axis=1)), read_only(np.concatenate(all_positions, axis=1))
