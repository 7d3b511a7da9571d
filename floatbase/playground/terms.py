"""The terms of (7) as arrows in the picture: what each of them is, at the last instant of a record."""

from __future__ import annotations

import numpy as np

import floatbase as fb
from floatbase._arrays import Array
from floatbase.dynamics import Contacts, equations_of_motion
from floatbase.viewer import COM, MEASURED, Picture, below, marks, shapes

_PER_ACCELERATION = 0.03  # m of arrow per m/s², of the feet's drift
_TEXT = 0.05  # m, height of letters
_LEVER = 0.3  # m, of the force that a torque is drawn as
_SHORTEST = 5e-3  # m: shorter arrows are not drawn


def arrows(
    term: str,
    record: fb.Rollout,
    scale: float,
    off: tuple[str, ...] = (),
    mass: float = 1.0,
) -> Picture:
    """The arrows of a term of `EQUATION` at the last row of a record; forces and cones are drawn by the viewer itself.

    scale: m/N, as the viewer draws forces.
    off: terms that the world does not have: gravity and C q̇ have no arrow then.
    mass: all masses of the world as a multiple of the data sheet's. M q̈, C q̇ and g are drawn with it, as they truly are.
    """
    if term in off and term in ("gravity", "velocity"):
        return {}
    of_mass = {"inertia": _inertia, "velocity": _velocity, "gravity": _gravity}
    others = {"zeros": _torques, "drift": _drift}
    if term in of_mass:
        return below(f"term {term}", of_mass[term](record, scale * mass))
    return below(f"term {term}", others[term](record, scale)) if term in others else {}


def _arrow(name: str, at: Array, vector: Array, words: str, colour: tuple[float, float, float] = COM) -> Picture:
    if not np.isfinite(vector).all() or np.linalg.norm(vector) < _SHORTEST:
        return {}
    tip = at + vector * (1.0 + 0.05 / np.linalg.norm(vector))
    return {f"/{name}": shapes.arrow(at, vector, colour, 0.5), f"/{name} label": shapes.label(tip, words, _TEXT)}


def _inertia(record: fb.Rollout, scale: float) -> Picture:
    """Mass times the acceleration of the centre of mass, by differences over the record."""
    state = record.final
    if len(record) < 2:
        return {}
    first = record.state(0)
    rate = (state.com_velocity - first.com_velocity) / float(record.time[-1] - record.time[0])
    return _arrow("m a", np.array(state.com), scale * record.robot.mass * rate, "true m a")


def _gravity(record: fb.Rollout, scale: float) -> Picture:
    """The weight, as an arrow that ends at the centre of mass: below it there is the ground."""
    at, weight = np.array(record.final.com), np.array([0.0, 0.0, -scale * record.robot.weight])
    words = shapes.label(at + [0.0, 0.08, 0.5 * min(at[2], float(np.linalg.norm(weight)))], "true m g", _TEXT)
    return {"/m g": shapes.arrow(at - weight, weight, COM, 0.5), "/m g label": words}


def _velocity(record: fb.Rollout, scale: float) -> Picture:
    """The force of C q̇ on the base."""
    state = record.final
    force = (state.h - state.replace(v=np.zeros(state.robot.nv)).h)[:3]
    pose = state.frame_pose("base")
    return _arrow("C v", np.array(pose.translation), scale * pose.rotation @ force, "true C q̇")


def _torques(record: fb.Rollout, scale: float) -> Picture:
    """A curled arrow around the axis of each joint, whose radius is that of the force with this torque at a lever of 0.3 m."""
    state, first = record.final, record.robot.nv - record.robot.d
    picture: Picture = {}
    for i, (joint, tau) in enumerate(zip(record.robot.joint_names, record.tau[-1].tolist(), strict=True)):
        axis = state.frame_jacobian(joint)[3:, first + i]
        moment = scale / _LEVER * tau * axis
        if np.linalg.norm(moment) > _SHORTEST:
            at = state.joint_transforms[record.robot.model.getJointId(joint)][:3, 3]
            picture[f"/{joint}"] = marks.curled_arrow(at, moment, MEASURED, on_top=True)
    return picture


def _drift(record: fb.Rollout, scale: float) -> Picture:
    """What the velocities alone accelerate the feet by."""
    contacts: Contacts = record.contacts_at(-1)
    eom = equations_of_motion(record.final, contacts)
    picture: Picture = {}
    for name in contacts.names:
        if contacts[name].k == 3:
            at = contacts.only(name).positions(record.final)[0]
            picture |= _arrow(name, at, -_PER_ACCELERATION * eom.b[contacts.force_slice(name)], "J̇ q̇")
    return picture
