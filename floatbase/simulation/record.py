"""`Rollout`: what happened under a controller, row by row; `Recorder` collects it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import pinocchio as pin

from floatbase._validation import (
    Array,
    Value,
    as_bool,
    as_integer,
    cached_property,
    frozen,
    read_only,
)
from floatbase.dynamics import Contacts, FrictionContact
from floatbase.errors import FloatbaseError, InputError, unknown_name
from floatbase.robots import Robot, State
from floatbase.simulation.physics import Simulation
from floatbase.simulation.push import Push

Outcome = Literal["completed", "fell", "diverged", "controller failed"]


@dataclass(frozen=True, eq=False)
class Rollout(Value):
    """What happened: one row for each of n control ticks. Read-only.

    contacts: all that the controller had at any time; its stance at row i is `contacts_at(i)`.

    Before the tick:
    time: (n,) s, the simulation's clock.
    q, v: (n, nq) and (n, nv), as in `State`.
    foot_positions: (n, points, 3) m, world, of the contacts' points; NaN for points that the
        physics does not have.

    During the tick:
    tau: (n, d) N·m, the torques applied, within the motors' limits; their mean.
    tau_desired: (n, d) N·m, the controller's.
    planned: (n, k) N, world, the controller's forces at `contacts`: 0 at those that its stance did
        not have, NaN where it gave no forces.
    measured: (n, k) N, world, the physics' forces at `contacts`, whether or not the stance had
        them; their mean. NaN for contacts that the physics does not have.

    pushes: those handed to `rollout`.
    outcome: why the record ends there, or the controller does: "completed", "fell", "diverged" or
        "controller failed".
    error: of a controller that failed: the exception it raised, or one that names the NaN or
        infinite torque it gave.
    stances: the controller's contacts at each row; empty where they were `contacts` throughout.
    controller_off_time: s, from when on the controller is off, since the robot fell or the
        controller failed; None in other cases. A rollout that settles has rows from then on:
        τ_desired is that of the joint damping, planned forces are NaN.
    """

    _example = "fb.rollout(sim, controller, duration=1.0)"
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
    controller_off_time: float | None = None

    def __len__(self) -> int:
        return int(self.time.size)

    def state(self, i: int) -> State:
        """The state at row i."""
        i = as_integer("row", i, -len(self), len(self) - 1)
        return State(self.robot, self.q[i], self.v[i])

    def contacts_at(self, i: int) -> Contacts:
        """The controller's stance at row i."""
        i = as_integer("row", i, -len(self), len(self) - 1)
        return self.stances[i] if self.stances else self.contacts

    def force(self, contact: str, kind: Literal["measured", "planned"] = "measured") -> Array:
        """The force of a contact, such as "FL_foot", through time, shape (n, 3), N, world: of a
        flat foot the resultant.
        """
        if not isinstance(kind, str) or kind not in ("measured", "planned"):
            raise unknown_name("kind of force", kind, ("measured", "planned"))
        return self.contacts.force_of(
            self.measured if kind == "measured" else self.planned, contact
        )

    @property
    def final(self) -> State:
        """The state at the last row."""
        self._check_not_empty()
        return self.state(-1)

    @cached_property
    def com(self) -> Array:
        """Centre of mass at each row, shape (n, 3), m, world."""
        model, data, com = self.robot.model, self.robot.model.createData(), np.empty((len(self), 3))
        for row, q in zip(com, self.q, strict=True):
            row[:] = pin.centerOfMass(model, data, q)
        return read_only(com)

    def slip(self, include_rolling: bool = True) -> Array:
        """How far each contact point strayed, at most, from where it began to stand, shape
        (points,), m.

        It stands while the controller's stance has it; 0 where it never did.

        include_rolling: whether the way that a ball rolls counts, too: its lowest point moves with
            it, and nothing slides.
        """
        self._check_not_empty()
        positions = (
            self.foot_positions
            if as_bool("include_rolling", include_rolling)
            else self.foot_positions - self.rolling_displacement()
        )
        max_distance, first = np.zeros(positions.shape[1]), 0
        for contact in self.contacts.friction_contacts:
            points = slice(first, first := first + len(contact.point_names))
            for begin, end in self._stance_intervals(contact.name):
                distance = np.linalg.norm(
                    positions[begin:end, points] - positions[begin, points], axis=2
                ).max(axis=0)
                max_distance[points] = np.maximum(max_distance[points], distance)
        return read_only(max_distance)

    def _stance_intervals(self, contact: str) -> list[tuple[int, int]]:
        """First row, and the row after the last, of each time that the controller's stance has a
        contact.
        """
        if not self.stances:
            return [(0, len(self))]
        in_stance = {stance: contact in stance.names for stance in dict.fromkeys(self.stances)}
        active = np.array([False, *(in_stance[stance] for stance in self.stances), False])
        edges = np.flatnonzero(active[1:] != active[:-1])
        return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))

    def rolling_displacement(self) -> Array:
        """How far each point's ball has rolled, shape (n, points, 3), m, world: the integral of ω ×
        radius · normal.
        """
        arms = [
            (contact.name, getattr(contact, "radius", 0.0) * contact.normal)
            for contact in self.contacts.friction_contacts
            for _ in contact.point_names
        ]
        rates = np.zeros((len(self), len(arms), 3))
        if any(np.any(arm) for _, arm in arms):
            for rate, q, v in zip(rates, self.q, self.v, strict=True):
                state = State(self.robot, q, v)
                rate[:] = [
                    np.cross(state.frame_velocity(name)[3:], arm) if np.any(arm) else np.zeros(3)
                    for name, arm in arms
                ]
        steps = np.diff(self.time)[:, None, None] * (rates[1:] + rates[:-1]) / 2.0
        return np.concatenate([np.zeros((1, len(arms), 3)), np.cumsum(steps, axis=0)])

    def _check_not_empty(self) -> None:
        if not len(self):
            raise InputError(
                f"this record is empty: "
                f"{self.outcome}{'' if self.error is None else f', {self.error}'}"
            )

    def __repr__(self) -> str:
        span = f"{len(self)} rows to {self.time[-1]:.3f} s" if len(self) else "no row"
        return f"Rollout({self.robot.name}, {span}, {self.outcome})"


class Recorder:
    """Collects the rows of a rollout that begins in a stance: `before_tick`, `after_step` and
    `complete_tick` in each tick.

    ticks: at most so many rows. substeps: timesteps in each.
    """

    def __init__(self, sim: Simulation, stance: Contacts, ticks: int, substeps: int):
        self._sim, self._initial_stance, self._substeps, self._n = sim, stance, substeps, 0
        d, points = sim.robot.d, len(sim.point_names)
        self._time, self._q, self._v = (
            np.empty(ticks),
            np.empty((ticks, sim.robot.nq)),
            np.empty((ticks, sim.robot.nv)),
        )
        self._tau_desired = np.empty((ticks, d))
        # MuJoCo's own numbers, which `to_rollout` turns into ours, all rows at once
        self._geom_positions, self._actuator_forces = sim.data.geom_xpos, sim.data.actuator_force
        self._foot_centres, self._n_steps = np.empty((ticks, points, 3)), 0
        self._step_actuator_forces = np.empty((ticks * substeps, sim.model.nu))
        max_contacts = sim.foot_contacts.max_contacts
        self._step_contact_geoms = np.zeros((ticks * substeps, max_contacts, 2), dtype=np.int32)
        self._step_contact_forces = np.zeros((ticks * substeps, 3 * max_contacts))
        self._stances: list[Contacts] = []
        self._planned_forces = np.empty((ticks, stance.k))
        self._rows_with_plan: list[int] = []  # the rows of those

    def enable_link_collisions(self) -> None:
        """Go on with links that touch. Timesteps of a tick that was begun and is not completed are
        forgotten.
        """
        self._sim.link_collisions = True
        first = self._n * self._substeps
        self._step_contact_geoms[first : self._n_steps] = 0
        self._step_contact_forces[first : self._n_steps] = 0.0
        self._n_steps = first

    def before_tick(self, t: float, q: Array, v: Array) -> None:
        """Keep clock, state and feet before a tick. They count when `complete_tick` does."""
        n = self._n
        self._time[n], self._q[n], self._v[n] = t, q, v
        geoms = self._sim.foot_contacts.geoms
        self._geom_positions.take(geoms, 0, self._foot_centres[n], "clip")  # "clip": the fastest

    def after_step(self) -> None:
        """Keep what motors and ground did in a timestep of the tick."""
        i, (geoms, forces) = self._n_steps, self._sim.read_contacts()
        self._step_actuator_forces[i] = self._actuator_forces
        self._step_contact_geoms[i, : len(geoms)], self._step_contact_forces[i, : forces.size] = (
            geoms,
            forces,
        )
        self._n_steps += 1

    def complete_tick(self, tau_desired: Array, stance: Contacts, planned: Array | None) -> None:
        """Complete the row: the controller's torques (d,), N·m, its stance, and the forces (k,), N,
        it planned there.
        """
        n = self._n
        self._tau_desired[n] = tau_desired
        self._stances.append(stance)
        if planned is not None:
            more = planned.size - self._planned_forces.shape[1]
            if more > 0:  # a larger stance than any before
                self._planned_forces = np.pad(self._planned_forces, ((0, 0), (0, more)))
            self._planned_forces[n, : planned.size] = planned
            self._rows_with_plan.append(n)
        self._n += 1

    def to_rollout(
        self,
        pushes: tuple[Push, ...],
        outcome: Outcome,
        error: FloatbaseError | None = None,
        controller_off_time: float | None = None,
    ) -> Rollout:
        """The record. Raises `InputError` where a contact was of one kind in one stance and of
        another in a later one.
        """
        contacts = self._initial_stance
        for contact in (contact for stance in dict.fromkeys(self._stances) for contact in stance):
            if contact.name not in contacts.names:
                contacts += Contacts([contact])
            elif contact.k != contacts[contact.name].k:
                raise InputError(
                    f"contact {contact.name} had {contacts[contact.name].k} force numbers at first "
                    f"and now has {contact.k}; "
                    "in one rollout it must stay a point, or a flat foot."
                )
        measured, positions = self._measured_at(contacts)
        return Rollout(
            self._sim.robot,
            contacts,
            time=self._complete_rows(self._time),
            q=self._complete_rows(self._q),
            v=self._complete_rows(self._v),
            tau=self._mean_over_substeps(
                self._sim.torques_of(self._step_actuator_forces[: self._n * self._substeps])
            ),
            tau_desired=self._complete_rows(self._tau_desired),
            planned=self._planned_at(contacts),
            measured=measured,
            foot_positions=positions,
            pushes=pushes,
            outcome=outcome,
            error=error,
            stances=()
            if all(stance is contacts for stance in self._stances)
            else tuple(self._stances),
            controller_off_time=controller_off_time,
        )

    def _complete_rows(self, rows: Array) -> Array:
        """The rows that are complete, without a copy."""
        return frozen(rows)[: self._n]

    def _mean_over_substeps(self, steps: Array) -> Array:
        """The means over the timesteps of each row, shape (n, …), of numbers at all timesteps."""
        if self._substeps > 1:
            steps = (
                steps.reshape(self._n, self._substeps, *steps.shape[1:]).sum(axis=1)
                / self._substeps
            )
        return read_only(steps)

    def _planned_at(self, contacts: Contacts) -> Array:
        """Planned forces at the contacts, shape (n, k)."""
        forces, entries_of_all = np.full((self._n, contacts.k), np.nan), np.arange(contacts.k)
        rows: dict[Contacts, list[int]] = {stance: [] for stance in self._stances}
        for i in self._rows_with_plan:
            rows[self._stances[i]].append(i)
        for stance, stance_rows in rows.items():
            entries = [
                i for name in stance.names for i in entries_of_all[contacts.force_slice(name)]
            ]
            forces[stance_rows] = 0.0
            forces[np.ix_(stance_rows, entries)] = self._planned_forces[stance_rows, : stance.k]
        return read_only(forces)

    def _measured_at(self, contacts: Contacts) -> tuple[Array, Array]:
        """Forces (n, k) and positions (n, points, 3) of the contacts from those of the physics'
        feet; NaN where it has none.

        A point contact in the middle of a flat foot takes the sum of its corners' forces and the
        mean of their positions.
        """
        sim, n, feet = self._sim, self._n, self._sim.feet
        steps = slice(n * self._substeps)
        measured = self._mean_over_substeps(
            sim.contact_forces_of(self._step_contact_geoms[steps], self._step_contact_forces[steps])
        )
        lowest = sim.foot_contacts.positions(self._foot_centres[:n])
        all_forces, all_positions = [np.zeros((n, 0))], [np.zeros((n, 0, 3))]
        for contact in contacts:
            point_names = contact.point_names if isinstance(contact, FrictionContact) else ()
            forces, positions = (
                np.full((n, contact.k), np.nan),
                np.full((n, len(point_names), 3), np.nan),
            )
            if contact.name in feet.names:
                part = feet.force_slice(contact.name)
                points = slice(part.start // 3, part.stop // 3)
                if point_names == feet.only(contact.name).point_names:
                    forces, positions = measured[:, points].reshape(n, contact.k), lowest[:, points]
                elif len(point_names) == 1:
                    forces = measured[:, points].sum(axis=1)
                    positions = lowest[:, points].mean(axis=1, keepdims=True)
            all_forces.append(forces)
            all_positions.append(positions)
        return read_only(np.concatenate(all_forces, axis=1)), read_only(
            np.concatenate(all_positions, axis=1)
        )
