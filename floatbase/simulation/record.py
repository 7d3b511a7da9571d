"""`Rollout`: what happened under a controller on the physics, row by row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from floatbase._arrays import Array, read_only
from floatbase.dynamics import Contacts
from floatbase.errors import FloatbaseError, InputError, unknown_name
from floatbase.robots import Robot, State
from floatbase.simulation.physics import Push, Simulation

Outcome = Literal["completed", "fell", "diverged", "controller failed"]


@dataclass(frozen=True, eq=False)
class Rollout:
    """What happened, one row for each control tick, taken before the tick's torques act.

    contacts: all that the controller had at any time; its stance at row i is `contacts_at(i)` (`stances`, one for each row,
    is empty where it never changed). time: (n,) s, the simulation's clock. q: (n, nq). v: (n, nv). tau: (n, d) N·m, the
    torques applied, within the motors' limits, their mean over the tick. tau_desired: (n, d) N·m, what the controller asked
    for. planned: (n, k) N, world, the controller's forces at `contacts`, 0 at those that its stance did not have (NaN where
    it gave no forces). measured: (n, k) N, world, those of the physics during the tick, whether or not the stance had the
    contact (NaN for a constraint that the physics does not know). foot_positions: (n, points, 3) m, world.
    outcome: "completed", "fell", "diverged" or "controller failed" (then `error` holds its exception, which may be that its
    torques were no numbers): the record ends there.
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
        return State(self.robot, self.q[i], self.v[i])

    def contacts_at(self, i: int) -> Contacts:
        """The stance of the controller at row i."""
        return self.stances[i] if self.stances else self.contacts

    def force(self, contact: str, kind: Literal["measured", "planned"] = "measured") -> Array:
        """The force of one contact through time, shape (n, 3), N, world: of a flat foot the resultant of its corners.

        contact: its name, as "FL_foot". kind: "measured" or "planned". Raises `UnknownNameError` for other names.
        """
        if kind not in ("measured", "planned"):
            raise unknown_name("kind of force", kind, ("measured", "planned"))
        return self.contacts.force_of(self.measured if kind == "measured" else self.planned, contact)

    @property
    def final(self) -> State:
        """The last state on record."""
        self._check_not_empty()
        return self.state(-1)

    @property
    def com(self) -> Array:
        """Centre of mass at each row, shape (n, 3), m, world."""
        return read_only(np.reshape([self.state(i).com for i in range(len(self))], (-1, 3)))

    def _check_not_empty(self) -> None:
        if not len(self):
            raise InputError(f"this record is empty: {self.outcome}{'' if self.error is None else f', {self.error}'}")

    def slip(self) -> Array:
        """How far each contact point strayed from where it was first, shape (points,), m."""
        self._check_not_empty()
        return read_only(np.linalg.norm(self.foot_positions - self.foot_positions[0], axis=2).max(axis=0))

    def __repr__(self) -> str:
        span = f"{len(self)} rows to {self.time[-1]:.3f} s" if len(self) else "no row"
        return f"Rollout({self.robot.name}, {span}, {self.outcome})"


class Row(NamedTuple):
    """One tick: clock, state and feet before it, torques and the physics' point forces (points, 3) during it, the plan."""

    time: float
    q: Array
    v: Array
    tau: Array
    tau_desired: Array
    forces: Array
    feet: Array
    stance: Contacts
    planned: Array | None


def joined(contacts: Contacts, stance: Contacts) -> Contacts:
    """The contacts and those of a stance that are not among them yet, by name.

    Raises `InputError` for a contact that has become one of another kind.
    """
    if stance is contacts:
        return contacts
    for contact in stance:
        if contact.name in contacts.names and contact.k != contacts[contact.name].k:
            raise InputError(
                f"contact {contact.name} had {contacts[contact.name].k} force numbers at first and now has {contact.k}; "
                "in one rollout it must stay a point, or a flat foot."
            )
    new = [contact for contact in stance if contact.name not in contacts.names]
    return contacts + Contacts(new) if new else contacts


def recorded(
    sim: Simulation,
    contacts: Contacts,
    rows: Sequence[Row],
    *,
    pushes: tuple[Push, ...],
    outcome: Outcome,
    error: FloatbaseError | None,
) -> Rollout:
    """The record of rows, with the forces of all contacts that the rows' stances have."""
    robot, points = sim.robot, len(sim.point_names)
    sizes = ((), (robot.nq,), (robot.nv,), (robot.d,), (robot.d,), (points, 3), (points, 3))
    time, q, v, tau, tau_desired, forces, feet = (
        read_only([row[i] for row in rows]).reshape((len(rows), *size)) for i, size in enumerate(sizes)
    )
    measured, positions = _measured(contacts, sim.point_names, forces, feet)
    stances = tuple(row.stance for row in rows)
    return Rollout(
        robot,
        contacts,
        time=time,
        q=q,
        v=v,
        tau=tau,
        tau_desired=tau_desired,
        planned=_planned(contacts, rows),
        measured=measured,
        foot_positions=positions,
        pushes=pushes,
        outcome=outcome,
        error=error,
        stances=() if all(stance is contacts for stance in stances) else stances,
    )


def _planned(contacts: Contacts, rows: Sequence[Row]) -> Array:
    """Planned forces in the entries of all contacts, shape (n, k): 0 at contacts that a row's stance does not have."""
    forces = np.full((len(rows), contacts.k), np.nan)
    for i, row in enumerate(rows):
        if row.planned is None:
            continue
        forces[i] = 0.0
        for name in row.stance.names:
            forces[i, contacts.force_slice(name)] = row.planned[row.stance.force_slice(name)]
    return read_only(forces)


def _measured(contacts: Contacts, names: tuple[str, ...], forces: Array, feet: Array) -> tuple[Array, Array]:
    """Forces (n, k) and positions (n, points, 3) of the contacts from those of the physics' points, both (n, names, 3).

    A point contact in the middle of a flat foot takes all its corners. NaN for what the physics does not know.
    """
    columns = _columns(contacts, names)
    known = columns.sum(axis=1) > 0
    measured = np.full((len(forces), contacts.k), np.nan)
    at_points = np.where(known[:, None], columns @ forces, np.nan)
    measured[:, contacts.point_entries] = at_points.reshape(len(forces), 3 * contacts.n_points)
    count = np.maximum(columns.sum(axis=1, keepdims=True), 1.0)
    return read_only(measured), read_only(np.where(known[:, None], columns @ feet / count, np.nan))


def _columns(contacts: Contacts, measured: tuple[str, ...]) -> Array:
    """Which measured points make up each point of the contacts, shape (n, n_measured), of 0 and 1.

    A point contact in the middle of a flat foot takes all its corners.
    """
    match = [
        [float(name == point or name.startswith(f"{point} corner ")) for name in measured] for point in contacts.point_names
    ]
    return np.array(match).reshape(contacts.n_points, len(measured))
