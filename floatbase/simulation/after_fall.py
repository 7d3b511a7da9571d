"""Motion after a fall or a controller failure, until the robot lies on its links."""

from __future__ import annotations

import numpy as np

from floatbase._validation import read_only
from floatbase.dynamics import Contacts
from floatbase.simulation.damping import joint_damping
from floatbase.simulation.physics import Simulation
from floatbase.simulation.push import Push
from floatbase.simulation.record import Recorder, Rollout

_REST_SPEED = 0.05  # m/s and rad/s: a robot that is slower counts as at rest


def record_settling(
    sim: Simulation,
    record: Recorder,
    stance: Contacts,
    ticks: int,
    substeps: int,
    pushes: tuple[Push, ...],
) -> None:
    """Add control steps with the controller off, under `joint_damping` and link collisions."""
    if not ticks:
        return
    record.enable_link_collisions()
    damping = joint_damping(sim.state, substeps * sim.timestep)
    for _ in range(ticks):
        record.before_tick(sim.time, sim.q, sim.v)
        tau = read_only(-damping * sim.joint_state[1])
        for _ in range(substeps):
            sim._advance(tau, pushes)
            record.after_step()
        record.complete_tick(tau, stance, None)
        if sim.diverged:
            return


def settling_rollout(
    sim: Simulation, previous: Rollout, ticks: int, substeps: int, pushes: tuple[Push, ...]
) -> Rollout:
    """Record the next control steps after a record at whose end the controller is off."""
    stance = previous.contacts_at(-1) if len(previous) else previous.contacts
    record = Recorder(sim, stance, ticks, substeps)
    with sim._exclusive():
        record_settling(sim, record, stance, ticks, substeps, pushes)
    return record.to_rollout(pushes, previous.outcome, previous.error, previous.controller_off_time)


def is_at_rest(sim: Simulation) -> bool:
    """Return whether every velocity is below 0.05 m/s or rad/s, or the simulation has diverged."""
    return sim.diverged or bool(np.all(np.abs(sim.v) < _REST_SPEED))
