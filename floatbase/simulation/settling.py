"""What comes after a fall, or after a controller has failed: the motors brake, and the robot lies down on its links."""

from __future__ import annotations

import numpy as np

from floatbase._validation import Array, read_only
from floatbase.dynamics import Contacts
from floatbase.simulation.physics import Push, Simulation
from floatbase.simulation.record import Recorder, Rollout

_BRAKING_TIME = 0.05  # s, time constant with which the brake stops a joint that nothing else moves
_STILL = 0.05  # m/s and rad/s: slower than this a robot lies still


def brake(sim: Simulation, period: float) -> Array:
    """N·m·s/rad of each motor as a brake, shape (d,): its joint's effective inertia now, 1 / (M⁻¹)ᵢᵢ, over 0.05 s.

    period: s, for which a torque is held; the brake takes twice as long at least, or it would shake the joint.
    """
    freely = np.diag(np.linalg.inv(sim.state.M))[sim.robot.nv - sim.robot.d :]
    return np.array(1.0 / (max(_BRAKING_TIME, 2.0 * period) * freely))


def settle(sim: Simulation, record: Recorder, stance: Contacts, ticks: int, substeps: int, pushes: tuple[Push, ...]) -> None:
    """Add ticks to a record in which the controller is off, τ = -d q̇ with `brake`, and links touch the ground."""
    if not ticks:
        return
    record.fall()
    damping = brake(sim, substeps * sim.timestep)
    for _ in range(ticks):
        record.before(sim.time, sim.q, sim.v)
        tau = read_only(-damping * sim.joints[1])
        for _ in range(substeps):
            sim.advance(tau, pushes)
            record.after_step()
        record.complete(tau, stance, None)
        if sim.diverged:
            return


def settled(sim: Simulation, before: Rollout, ticks: int, substeps: int, pushes: tuple[Push, ...]) -> Rollout:
    """The next ticks after a record at whose end the controller is off, as a record of their own."""
    stance = before.contacts_at(-1) if len(before) else before.contacts
    record = Recorder(sim, stance, ticks, substeps)
    settle(sim, record, stance, ticks, substeps, pushes)
    return record.finished(pushes, before.outcome, before.error, before.off_at)


def lies_still(sim: Simulation) -> bool:
    """Whether hardly anything moves, or nothing can be said any more."""
    return sim.diverged or bool(np.all(np.abs(sim.v) < _STILL))
