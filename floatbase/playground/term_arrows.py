"""Terms of eq. (7) drawn as arrows, at the last instant of a record."""

from __future__ import annotations

import numpy as np

import floatbase as fb
from floatbase._validation import Array, as_instance, as_positive, as_string, as_strings
from floatbase.dynamics import Contacts, equations_of_motion
from floatbase.playground.equation import EQUATION
from floatbase.viewer import Picture, markers, prefixed, shapes
from floatbase.viewer.scene.colours import COM, MEASURED

_ACCELERATION_SCALE = 0.03  # m of arrow per m/s², for the drift acceleration of the feet
_TEXT_SIZE = 0.06  # height of letters, as a fraction of the size of the robot
_TORQUE_LEVER = 0.3  # m, lever arm of the force that represents a torque
_MIN_LENGTH = 5e-3  # m: shorter arrows are not drawn

_COLOURS = {"zeros": MEASURED}  # of the arrows of a term, if they differ from COM
TERM_LEGEND = {  # term: (colour of its arrows, what they are)
    term.name: (_COLOURS.get(term.name, COM), term.arrow) for term in EQUATION if term.arrow
}
_WORD_HEIGHTS = {
    "inertia": 0.25,
    "velocity": 0.37,
    "gravity": 0.49,
    "zeros": 0.61,
    "drift": 0.73,
}  # heights of the texts, as fractions of the robot's size
_PROPORTIONAL_TO_MASS = ("inertia", "velocity", "gravity")
_WORD_DISTANCE = 1.1  # times the robot's size behind its centre of mass, where there are no arrows


def term_arrows(
    term: str,
    record: fb.Rollout,
    scale: float,
    size: float,
    off: tuple[str, ...] = (),
    mass: float = 1.0,
) -> Picture:
    """Draw a term of `EQUATION` at the last row of a record.

    Forces and cones are drawn by the viewer itself. Text behind the robot replaces a term that is
    too small to be seen or that is switched off in the simulation.

    Parameters
    ----------
    term : str
        Name of the term.
    record : Rollout
        Record with the state to draw.
    scale : float
        Length of a drawn force, as in the viewer [m/N].
    size : float
        Size of the robot [m].
    off : tuple of str, optional
        Names of terms that are switched off in the simulation. Gravity and C q̇ have no arrow then.
    mass : float, optional
        Actual masses as a multiple of the nominal ones, dimensionless. M q̈, C q̇ and g are scaled
        by it.

    Returns
    -------
    dict
        Picture, path -> item; empty for a term that has no arrows.
    """
    if as_string("term", term) not in TERM_LEGEND:
        return {}
    as_instance("record", record, fb.Rollout)
    scale, size = as_positive("scale", scale, "m/N"), as_positive("size", size, "m")
    mass, off = as_positive("mass", mass), as_strings("off", off)
    made = {
        "inertia": _inertia,
        "velocity": _velocity,
        "gravity": _gravity,
        "zeros": _torques,
        "drift": _drift,
    }
    lacking = term in off and term in ("gravity", "velocity")
    drawn = (
        {}
        if lacking
        else made[term](record, scale * (mass if term in _PROPORTIONAL_TO_MASS else 1.0), size)
    )
    if drawn:
        return prefixed(f"term {term}", drawn)
    words = TERM_LEGEND[term][1].split(",")[0] + (": switched off" if lacking else " ≈ 0")
    at = np.array(record.final.com) + [-_WORD_DISTANCE * size, 0.0, _WORD_HEIGHTS[term] * size]
    return {f"word {term}": shapes.label(at, words, _TEXT_SIZE * size)}


def _arrow(name: str, at: Array, vector: Array, words: str, size: float) -> Picture:
    """Return an arrow with a label at its tip; nothing if it is too short."""
    if not np.isfinite(vector).all() or np.linalg.norm(vector) < _MIN_LENGTH:
        return {}
    tip = at + vector * (1.0 + 0.1 * size / np.linalg.norm(vector))
    return {
        f"/{name}": shapes.arrow(at, vector, COM, size),
        f"/{name} label": shapes.label(tip, words, _TEXT_SIZE * size),
    }


def _inertia(record: fb.Rollout, scale: float, size: float) -> Picture:
    """Draw mass times the acceleration of the centre of mass, from differences over the record."""
    state = record.final
    if len(record) < 2:
        return {}
    first = record.state(0)
    rate = (state.com_velocity - first.com_velocity) / float(record.time[-1] - record.time[0])
    return _arrow("m a", np.array(state.com), scale * record.robot.mass * rate, "actual m a", size)


def _gravity(record: fb.Rollout, scale: float, size: float) -> Picture:
    """Draw the weight as an arrow that ends at the centre of mass, since the ground is below it."""
    at, weight = np.array(record.final.com), np.array([0.0, 0.0, -scale * record.robot.weight])
    words = shapes.label(
        at + [0.0, 0.25 * size, 0.5 * min(at[2], float(np.linalg.norm(weight)))],
        "actual m g",
        _TEXT_SIZE * size,
    )
    return {"/m g": shapes.arrow(at - weight, weight, COM, size), "/m g label": words}


def _velocity(record: fb.Rollout, scale: float, size: float) -> Picture:
    """Draw the force of C q̇ on the base."""
    state = record.final
    force = (state.h - state.replace(v=np.zeros(state.robot.nv)).h)[:3]
    pose = state.frame_pose("base")
    return _arrow(
        "C v", np.array(pose.translation), scale * pose.rotation @ force, "actual C q̇", size
    )


def _torques(record: fb.Rollout, scale: float, size: float) -> Picture:
    """Draw each joint torque as a curled arrow around the joint's axis."""
    state, first = record.final, record.robot.nv - record.robot.d
    picture: Picture = {}
    for i, (joint, tau) in enumerate(
        zip(record.robot.joint_names, record.tau[-1].tolist(), strict=True)
    ):
        axis = state.frame_jacobian(joint)[3:, first + i]
        moment = scale / _TORQUE_LEVER * tau * axis
        if np.linalg.norm(moment) > _MIN_LENGTH:
            at = state.joint_transforms[record.robot.model.getJointId(joint)][:3, 3]
            picture[f"/{joint}"] = markers.curled_arrow(at, moment, MEASURED, on_top=True)
    return picture


def _drift(record: fb.Rollout, scale: float, size: float) -> Picture:
    """Draw the acceleration of the feet that the velocities alone cause."""
    contacts: Contacts = record.contacts_at(-1)
    eom = equations_of_motion(record.final, contacts)
    picture: Picture = {}
    for name in contacts.names:
        if contacts[name].k == 3:
            at = contacts.only(name).positions(record.final)[0]
            picture |= _arrow(
                name, at, -_ACCELERATION_SCALE * eom.b[contacts.force_slice(name)], "J̇ q̇", size
            )
    return picture
