"""What comes after a fall, or after a controller has failed: the motors damp the joints, and the
robot lies down on its links.
"""

from __future__ import annotations

import numpy as np

from floatbase._validation import Array, read_only
from floatbase.dynamics import Contacts
from floatbase.simulation.physics import Push, Simulation
from floatbase.simulation.record import Recorder, Rollout

# s, time constant with which the damping stops a joint that nothing else moves
_DAMPING_TIME_CONSTANT = 0.05
_REST_SPEED = 0.05  # m/s and rad/s: slower than this a robot is at rest


def joint_damping(sim: Simulation, period: float) -> Array:
    """N·m·s/rad that each motor applies as a damper, shape (d,): its joint's effective inertia now,
    1 / (M⁻¹)ᵢᵢ, over 0.05 s.

    period: s, for which a torque is held; the time constant is twice as long at least, or it would
        shake the joint.
    """
    inverse_inertia = np.diag(np.linalg.inv(sim.state.M))[sim.robot.nv - sim.robot.d :]
    return np.array(1.0 / (max(_DAMPING_TIME_CONSTANT, 2.0 * period) * inverse_inertia))


def record_settling(
    sim: Simulation,
    record: Recorder,
    stance: Contacts,
    ticks: int,
    substeps: int,
    pushes: tuple[Push, ...],
) -> None:
    """Add ticks to a record in which the controller is off, τ = -d q̇ with `joint_damping`, and
    links touch the ground.
    """
    if not ticks:
        return
    record.enable_link_collisions()
    damping = joint_damping(sim, substeps * sim.timestep)
    for _ in range(ticks):
        record.before_tick(sim.time, sim.q, sim.v)
        tau = read_only(-damping * sim.joint_state[1])
        for _ in range(substeps):
            sim.advance(tau, pushes)
            record.after_step()
        record.complete_tick(tau, stance, None)
        if sim.diverged:
            return


def settling_rollout(
    sim: Simulation, previous: Rollout, ticks: int, substeps: int, pushes: tuple[Push, ...]
) -> Rollout:
    """The next ticks after a record at whose end the controller is off, as a record of their own."""
    stance = previous.contacts_at(-1) if len(previous) else previous.contacts
    record = Recorder(sim, stance, ticks, substeps)
    record_settling(sim, record, stance, ticks, substeps, pushes)
    return record.to_rollout(pushes, previous.outcome, previous.error, previous.controller_off_time)


def is_at_rest(sim: Simulation) -> bool:
    """Whether hardly anything moves, or nothing can be said any more."""
    return sim.diverged or bool(np.all(np.abs(sim.v) < _REST_SPEED))
