"""`Rollout`: the record of a simulation run; `Recorder` collects it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

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
from floatbase.control import JointLimits
from floatbase.dynamics import Contacts, FrictionContact
from floatbase.errors import FloatbaseError, InputError, unknown_name
from floatbase.robots import Robot, State
from floatbase.simulation.ground import Ground
from floatbase.simulation.physics import Simulation
from floatbase.simulation.push import Push
from floatbase.simulation.record_files import read_record, write_record
from floatbase.simulation.record_table import as_table

if TYPE_CHECKING:
    from pandas import DataFrame

Outcome = Literal["completed", "fell", "diverged", "controller failed"]


@dataclass(frozen=True, eq=False)
class Rollout(Value):
    """Read-only record of a simulation run, with one row for each of n control steps.

    Times and states are those at the beginning of each control step. Torques and measured forces
    are means over the control step.

    Parameters
    ----------
    robot : Robot
        The robot.
    contacts : Contacts
        All contacts that the controller used at any time; `contacts_at(i)` returns its stance at
        row i.
    time : ndarray, shape (n,)
        Time on the simulation's clock before the control step [s].
    q : ndarray, shape (n, nq)
        Configuration before the control step, as in `State`.
    v : ndarray, shape (n, nv)
        Velocity before the control step, as in `State`.
    tau : ndarray, shape (n, d)
        Mean applied torques, within the motors' limits [N·m].
    tau_desired : ndarray, shape (n, d)
        Torques that the controller requested [N·m].
    planned : ndarray, shape (n, k)
        The controller's planned forces at `contacts`, in the world frame [N]. Contacts outside its
        stance have 0; rows without planned forces have NaN.
    measured : ndarray, shape (n, k)
        Mean forces in the simulation at `contacts`, in the world frame, whether or not they were in
        the stance [N]. Contacts that the simulation does not have are NaN.
    foot_positions : ndarray, shape (n, points, 3)
        Positions of the contact points before the control step, in the world frame [m]. Points that
        the simulation does not have are NaN.
    pushes : tuple of Push
        All pushes given to `rollout`.
    outcome : {"completed", "fell", "diverged", "controller failed"}
        Why the run ended, or why the controller was switched off.
    error : FloatbaseError or None
        Exception of a controller that failed, or an exception that names the NaN or infinite
        torque.
    stances : tuple of Contacts
        The controller's contacts at each row; empty if they were always `contacts`.
    controller_off_time : float or None
        Time at which the controller was switched off after a fall or a failure [s], otherwise None.
        With a settling time, the rollout has rows from then on: `tau_desired` is the joint damping
        and `planned` is NaN.
    planned_qdd : ndarray, shape (n, nv), or None
        Accelerations that the controller planned, as in `Command.qdd` [m/s² or rad/s²]; rows
        without a plan have NaN.
    targets : mapping of str to ndarray, shape (n, m)
        The controller's targets, as in `Command.targets`: for each task, its target and the
        derivatives of it. Rows in which the controller had no such task have NaN, as does the end
        of rows with fewer contact forces.
    joint_limits : JointLimits or None
        Joint limits in the last plan, as in `Command.joint_limits`.
    ground : Ground or None
        The ground of the simulation; None if it is not known.
    ground_position : ndarray, shape (n, 3), or None
        How far a ground with an acceleration has moved before the control step, in the world frame
        [m]; None if it is not known.
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
    planned_qdd: Array | None = None
    targets: Mapping[str, Array] = field(default_factory=lambda: MappingProxyType({}))
    joint_limits: JointLimits | None = None
    ground: Ground | None = None
    ground_position: Array | None = None

    def __len__(self) -> int:
        return int(self.time.size)

    def state(self, i: int) -> State:
        """Return the state at row `i`.

        Parameters
        ----------
        i : int
            Number of the row; negative numbers count from the end.

        Returns
        -------
        State
            State before that control step.
        """
        i = as_integer("row", i, -len(self), len(self) - 1)
        return State(self.robot, self.q[i], self.v[i])

    def contacts_at(self, i: int) -> Contacts:
        """Return the controller's stance at row `i`.

        Parameters
        ----------
        i : int
            Number of the row; negative numbers count from the end.

        Returns
        -------
        Contacts
            The contacts that the controller used.
        """
        i = as_integer("row", i, -len(self), len(self) - 1)
        return self.stances[i] if self.stances else self.contacts

    def force(self, contact: str, kind: Literal["measured", "planned"] = "measured") -> Array:
        """Return the force at a contact over time; for a flat foot, the resultant force.

        Parameters
        ----------
        contact : str
            Name of the contact, such as "FL_foot".
        kind : {"measured", "planned"}, optional
            Whether to return the force in the simulation or the controller's planned force.

        Returns
        -------
        ndarray, shape (n, 3)
            Force in the world frame [N].
        """
        if not isinstance(kind, str) or kind not in ("measured", "planned"):
            raise unknown_name("kind of force", kind, ("measured", "planned"))
        return self.contacts.force_of(
            self.measured if kind == "measured" else self.planned, contact
        )

    @property
    def final(self) -> State:
        """State at the last row."""
        self._check_not_empty()
        return self.state(-1)

    @cached_property
    def com(self) -> Array:
        """Centre of mass at each row, shape (n, 3), world frame [m]."""
        model = self.robot.model
        data = self.robot.model.createData()
        com = np.empty((len(self), 3))
        for row, q in zip(com, self.q, strict=True):
            row[:] = pin.centerOfMass(model, data, q)
        return read_only(com)

    def table(self) -> DataFrame:
        """Return the record as a table, with one row for each control step.

        A column is named by its subject, its quantity, its component and its unit, as in "time
        [s]", "base position x [m]", "FL_hip_joint torque [N·m]" and "FL_foot measured force z [N]".
        Frames are those of `q`, `v` and the contact forces. Targets are in `targets` alone.

        Returns
        -------
        pandas.DataFrame
            The table; unknown values are NaN.

        Raises
        ------
        MissingDependencyError
            If pandas is not installed.
        """
        return as_table(self)

    def save(self, path: str | Path) -> None:
        """Save the record as an npz file, which `load` reads.

        The file holds the robot, too. `numpy.load` reads its arrays without floatbase.

        Parameters
        ----------
        path : str or Path
            Path of the file; an existing file is replaced.

        Raises
        ------
        InputError
            If the file cannot be written.

        Warns
        -----
        SimulationWarning
            If a contact is user-defined or has functions of time, which files cannot hold.
        """
        write_record(path, self)

    @staticmethod
    def load(path: str | Path, robot: Robot | None = None) -> Rollout:
        """Load a record that `save` has written.

        Parameters
        ----------
        path : str or Path
            Path of the file.
        robot : Robot, optional
            Robot with the joints of the recorded one, for example if its meshes have moved. By
            default, the robot in the file.

        Returns
        -------
        Rollout
            The record. Linear constraints have no rows, since files hold no functions.

        Raises
        ------
        InputError
            If the file cannot be read, is not a record, or has another version, or if the robot has
            other joints.
        """
        return Rollout(**read_record(path, robot))

    def slip(self, include_rolling: bool = True) -> Array:
        """Compute the largest distance of each contact point from where its stance began.

        A point is in stance while the controller's contacts include it. Points that were never in
        stance have 0. Distances are relative to the ground, which may move.

        Parameters
        ----------
        include_rolling : bool, optional
            Whether to count the distance that a ball or a wheel rolls, too: rolling moves its
            lowest point without any sliding.

        Returns
        -------
        ndarray, shape (points,)
            Largest distance of each point in any of its stances [m].
        """
        self._check_not_empty()
        positions = self.foot_positions
        if self.ground_position is not None:
            positions = positions - self.ground_position[:, None]
        if not as_bool("include_rolling", include_rolling):
            positions = positions - self.rolling_displacement()
        max_distance, first = np.zeros(positions.shape[1]), 0
        for contact in self.contacts.friction_contacts:
            points = slice(first, first := first + len(contact.point_names))
            for begin, end in self._stance_intervals(contact.name):
                moved = positions[begin:end, points] - positions[begin, points]
                distance = np.linalg.norm(moved, axis=2).max(axis=0)
                max_distance[points] = np.maximum(max_distance[points], distance)
        return read_only(max_distance)

    def _stance_intervals(self, contact: str) -> list[tuple[int, int]]:
        """Return the first row of each stance of a contact, and the row after its last one."""
        if not self.stances:
            return [(0, len(self))]
        in_stance = {stance: contact in stance.names for stance in dict.fromkeys(self.stances)}
        active = np.array([False, *(in_stance[stance] for stance in self.stances), False])
        edges = np.flatnonzero(active[1:] != active[:-1])
        return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))

    def rolling_displacement(self) -> Array:
        """Compute how far the ball or the wheel at each contact point has rolled.

        The displacement is the integral of `rolling_velocity` of the contact.

        Returns
        -------
        ndarray, shape (n, points, 3)
            Displacement in the world frame since the first row [m].
        """
        rolling = [
            getattr(contact, "radius", 0.0) > 0.0 and getattr(contact, "rolling_velocity", None)
            for contact in self.contacts.friction_contacts
            for _ in contact.point_names
        ]
        rates = np.zeros((len(self), len(rolling), 3))
        if any(rolling):
            for rate, q, v in zip(rates, self.q, self.v, strict=True):
                state = State(self.robot, q, v)
                rate[:] = [velocity(state) if velocity else np.zeros(3) for velocity in rolling]
        steps = np.diff(self.time)[:, None, None] * (rates[1:] + rates[:-1]) / 2.0
        return np.concatenate([np.zeros((1, len(rolling), 3)), np.cumsum(steps, axis=0)])

    def _check_not_empty(self) -> None:
        """Raise `InputError` if the record has no rows."""
        if not len(self):
            raise InputError(
                f"This record has no rows. Its outcome is {self.outcome!r}"
                f"{'.' if self.error is None else f': {self.error}'}"
            )

    def __repr__(self) -> str:
        span = f"{len(self)} rows to {self.time[-1]:.3f} s" if len(self) else "no rows"
        return f"Rollout({self.robot.name}, {span}, {self.outcome})"


class Recorder:
    """Collector of the rows of a rollout.

    Call `before_tick`, `after_step` for each timestep, and `complete_tick` in each control step.
    """

    def __init__(self, sim: Simulation, stance: Contacts, ticks: int, substeps: int):
        self._sim = sim
        self._initial_stance = stance
        self._substeps = substeps
        self._n = 0
        d, points = sim.robot.d, len(sim.point_names)
        self._time = np.empty(ticks)
        self._q = np.empty((ticks, sim.robot.nq))
        self._v = np.empty((ticks, sim.robot.nv))
        self._tau_desired = np.empty((ticks, d))
        self._planned_qdd = np.full((ticks, sim.robot.nv), np.nan)
        self._joint_limits: JointLimits | None = None
        # values in MuJoCo's convention, which `to_rollout` converts for all rows at once
        self._geom_positions, self._actuator_forces = sim.data.geom_xpos, sim.data.actuator_force
        self._geom_rotations = sim.data.geom_xmat
        self._foot_centres, self._n_steps = np.empty((ticks, points, 3)), 0
        self._foot_rotations = np.empty((ticks, points, 9))
        self._step_actuator_forces = np.empty((ticks * substeps, sim.model.nu))
        max_contacts = sim.foot_contacts.max_contacts
        self._step_contact_geoms = np.zeros((ticks * substeps, max_contacts, 2), dtype=np.int32)
        self._step_contact_forces = np.zeros((ticks * substeps, 3 * max_contacts))
        self._step_connection_forces = np.zeros((ticks * substeps, sim.connections.k))
        self._ground_position = np.empty((ticks, 3))
        self._stances: list[Contacts] = []
        self._planned: list[Array | None] = []  # forces of each row
        # row, values and entries of each task of the controllers' targets
        self._targets: list[tuple[int, Array, Mapping[str, slice]]] = []

    def enable_link_collisions(self) -> None:
        """Switch link collisions on, and discard the timesteps of an unfinished control step."""
        self._sim.link_collisions = True
        first = self._n * self._substeps
        self._step_contact_geoms[first : self._n_steps] = 0
        self._step_contact_forces[first : self._n_steps] = 0.0
        self._n_steps = first

    def before_tick(self, t: float, q: Array, v: Array) -> None:
        """Record time, state and feet before a control step; `complete_tick` makes them a row."""
        n = self._n
        self._time[n], self._q[n], self._v[n] = t, q, v
        geoms = self._sim.foot_contacts.geoms
        self._geom_positions.take(geoms, 0, self._foot_centres[n], "clip")  # "clip": the fastest
        self._geom_rotations.take(geoms, 0, self._foot_rotations[n], "clip")
        self._ground_position[n] = self._sim.ground_position

    def after_step(self) -> None:
        """Record motor forces and contacts of a timestep within the control step."""
        i, (geoms, forces) = self._n_steps, self._sim._read_contacts()
        missing = len(geoms) - self._step_contact_geoms.shape[1]
        if missing > 0:  # a foot touches many boxes
            more_geoms, more_forces = ((0, 0), (0, missing), (0, 0)), ((0, 0), (0, 3 * missing))
            self._step_contact_geoms = np.pad(self._step_contact_geoms, more_geoms)
            self._step_contact_forces = np.pad(self._step_contact_forces, more_forces)
        self._step_actuator_forces[i] = self._actuator_forces
        self._step_contact_geoms[i, : len(geoms)] = geoms
        self._step_contact_forces[i, : forces.size] = forces
        if self._step_connection_forces.size:
            self._step_connection_forces[i] = self._sim.connection_forces()
        self._n_steps += 1

    def complete_tick(
        self, tau_desired: Array, stance: Contacts, planned: Array | None, command: Any = None
    ) -> None:
        """Complete the row of a control step."""
        n = self._n
        # what only a `Command` has, or an answer like it
        targets, entries, qdd, limits = (
            getattr(command, name, None)
            for name in ("target_values", "target_entries", "qdd", "joint_limits")
        )
        if type(targets) is np.ndarray and isinstance(entries, Mapping):
            self._targets.append((n, targets, entries))
        if type(qdd) is np.ndarray and qdd.dtype.char == "d" and qdd.shape == self._v.shape[1:]:
            self._planned_qdd[n] = qdd
            self._joint_limits = limits if isinstance(limits, JointLimits) else None
        self._tau_desired[n] = tau_desired
        self._stances.append(stance)
        self._planned.append(None if planned is None else planned.copy())
        self._n += 1

    def to_rollout(
        self,
        pushes: tuple[Push, ...],
        outcome: Outcome,
        error: FloatbaseError | None = None,
        controller_off_time: float | None = None,
    ) -> Rollout:
        """Return the record as a `Rollout`."""
        # the stance before the first row is a walk's last one of the run before: it must not count
        contacts = self._stances[0] if self._stances else self._initial_stance
        for contact in (contact for stance in dict.fromkeys(self._stances) for contact in stance):
            if contact.name not in contacts.names:
                contacts += Contacts([contact])
            elif contact.k != contacts[contact.name].k:
                raise InputError(
                    f"Contact {contact.name} had {contacts[contact.name].k} force components at "
                    f"first and now has {contact.k}. During one rollout it must remain a point or "
                    f"remain a flat foot."
                )
        measured, positions = self._measured_at(contacts)
        actuator_forces = self._step_actuator_forces[: self._n * self._substeps]
        return Rollout(
            self._sim.robot,
            contacts,
            time=self._complete_rows(self._time),
            q=self._complete_rows(self._q),
            v=self._complete_rows(self._v),
            tau=self._mean_over_substeps(actuator_forces[:, self._sim._actuator_ids]),
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
            planned_qdd=self._complete_rows(self._planned_qdd),
            targets=MappingProxyType(self._targets_by_name()),
            joint_limits=self._joint_limits,
            ground=self._sim.ground,
            ground_position=self._complete_rows(self._ground_position),
        )

    def _targets_by_name(self) -> dict[str, Array]:
        """Return the targets of each task, shape (n, m), with NaN in rows without that task."""
        widths: dict[str, int] = {}
        for entries in {id(entries): entries for _, _, entries in self._targets}.values():
            for name, part in entries.items():
                widths[name] = max(part.stop - part.start, widths.get(name, 0))
        targets = {name: np.full((self._n, width), np.nan) for name, width in widths.items()}
        for row, values, entries in self._targets:
            for name, part in entries.items():
                targets[name][row, : part.stop - part.start] = values[part]
        return {name: frozen(array) for name, array in targets.items()}

    def _complete_rows(self, rows: Array) -> Array:
        """Return the completed rows, without a copy."""
        return frozen(rows)[: self._n]

    def _mean_over_substeps(self, steps: Array) -> Array:
        """Return the mean over the timesteps of each row, shape (n, ...)."""
        if self._substeps > 1:
            of_each_tick = steps.reshape(self._n, self._substeps, *steps.shape[1:])
            steps = of_each_tick.sum(axis=1) / self._substeps
        return read_only(steps)

    def _planned_at(self, contacts: Contacts) -> Array:
        """Return the planned forces at the contacts, shape (n, k) [N]."""
        forces, entries_of_all = np.full((self._n, contacts.k), np.nan), np.arange(contacts.k)
        rows: dict[Contacts, list[int]] = {}
        for i, planned in enumerate(self._planned):
            if planned is not None:
                rows.setdefault(self._stances[i], []).append(i)
        for stance, stance_rows in rows.items():
            parts = [entries_of_all[contacts.force_slice(name)] for name in stance.names]
            entries = np.concatenate([entries_of_all[:0], *parts]).tolist()
            forces[stance_rows] = 0.0
            forces[np.ix_(stance_rows, entries)] = [self._planned[i] for i in stance_rows]
        return read_only(forces)

    def _measured_at(self, contacts: Contacts) -> tuple[Array, Array]:
        """Return measured forces (n, k) and positions (n, points, 3) of contacts, NaN if unknown.

        A point contact in the middle of a flat foot has the sum of the corners' forces and the mean
        of their positions.
        """
        sim, n, connections = self._sim, self._n, self._sim.connections
        touching = sim.contacts.without(*connections.names)
        steps = slice(n * self._substeps)
        measured = self._mean_over_substeps(
            sim._contact_forces_of(
                self._step_contact_geoms[steps], self._step_contact_forces[steps]
            )
        )
        lowest = sim.foot_contacts.positions(self._foot_centres[:n], self._foot_rotations[:n])
        lowest = lowest + self._ground_position[:n, None]
        of_connections = self._mean_over_substeps(self._step_connection_forces[steps])
        all_forces, all_positions = [np.zeros((n, 0))], [np.zeros((n, 0, 3))]
        for contact in contacts:
            point_names = contact.point_names if isinstance(contact, FrictionContact) else ()
            forces = np.full((n, contact.k), np.nan)
            positions = np.full((n, len(point_names), 3), np.nan)
            if contact.name in connections.names and contact.k == 6:
                forces = of_connections[:, connections.force_slice(contact.name)]
            elif contact.name in touching.names:
                part = touching.force_slice(contact.name)
                points = slice(part.start // 3, part.stop // 3)
                if point_names == touching.only(contact.name).point_names:
                    forces, positions = measured[:, points].reshape(n, contact.k), lowest[:, points]
                elif len(point_names) == 1:
                    forces = measured[:, points].sum(axis=1)
                    positions = lowest[:, points].mean(axis=1, keepdims=True)
            all_forces.append(forces)
            all_positions.append(positions)
        return read_only(np.concatenate(all_forces, 1)), read_only(np.concatenate(all_positions, 1))
