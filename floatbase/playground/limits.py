"""Sentences about a running robot: what limits it now, as the live page says it."""

from __future__ import annotations

import re

import numpy as np

from floatbase._validation import as_instance
from floatbase.dynamics import Contacts
from floatbase.friction import FrictionPolyhedron
from floatbase.live.settings import LIMIT_TABLE
from floatbase.playground.settings import Settings
from floatbase.simulation import Rollout

_SLIPPING, _BEYOND = 0.97, 1.02  # fractions of the actual friction limit
_UNLOADED = 0.01  # fraction of the weight: a point with less does not stand
_LOAD_TOLERANCE = 0.01  # N: a planned force this close to the smallest one is at it
_TORQUE_TOLERANCE = 1e-4  # fraction of a torque limit
_FACET_TOLERANCE = 1e-4  # fraction of the normal force
_ENDS, _SIDES = LIMIT_TABLE["ends"], LIMIT_TABLE["sides"]  # of a leg, by the letters in its name


def foot_name(contact: str) -> str:
    """Return the name of a contact's foot for a reader, such as "front left foot"."""
    if found := re.match(r"([FRH])([LR])_", contact, re.IGNORECASE):
        return f"{_ENDS[found[1].upper()]} {_SIDES[found[2].upper()]} foot"
    human = re.search("left|right", contact)
    return f"{human[0]} foot" if human else contact


def joint_name(joint: str) -> str:
    """Return the name of a joint for a reader, such as "front left calf joint"."""
    if found := re.fullmatch(r"([FRH])([LR])_(.+?)(?:_joint)?", joint):
        return f"{_ENDS[found[1]]} {_SIDES[found[2]]} {found[3].lower()} joint"
    return joint.replace("_", " ")


def limit_text(record: Rollout, settings: Settings) -> str:
    """Say what limits the robot in the last row of a record.

    Parameters
    ----------
    record : Rollout
        Record of a run.
    settings : Settings
        Settings of the run.

    Returns
    -------
    str
        A sentence, such as "The front left foot is at its friction limit."

    Raises
    ------
    InputError
        If an argument has the wrong type.
    """
    as_instance("record", record, Rollout)
    as_instance("settings", settings, Settings)
    robot, contacts = record.robot, record.contacts
    measured, planned = (forces[-1].reshape(-1, 3) for forces in (record.measured, record.planned))
    if (
        robot.is_floating
        and contacts.n_points
        and not (np.abs(measured) > _UNLOADED * robot.weight).any()
    ):
        return str(LIMIT_TABLE["air"])
    largest = settings.torque_fraction * robot.torque_limits * (1.0 - _TORQUE_TOLERANCE)
    at_limit = np.flatnonzero(np.abs(record.tau_desired[-1]) >= largest)
    gripping, unloaded = _friction_limits(record, settings)
    found = {
        "slipping": _slipping(contacts, measured, planned, settings, robot.weight),
        "torque": [joint_name(robot.joint_names[i]) for i in at_limit],
        "friction": gripping,
        "unloaded": unloaded,
    }
    for limit, one, several in LIMIT_TABLE["limits"]:
        if names := found.get(limit):
            return f"{_subject(names)} {several if len(names) > 1 else one}"
    if not robot.is_floating:
        return "No motor is at a limit."
    wanted = robot.standing().q[2] + settings.com_shift[2]
    x, y, z = record.q[-1, :3]
    ground = record.ground.height([x, y]) if record.ground else 0.0
    if z - ground < LIMIT_TABLE["low_height"] * wanted:
        return str(LIMIT_TABLE["low"])
    return str(LIMIT_TABLE["walks" if settings.gait else "stands"])


def _slipping(
    contacts: Contacts,
    measured: np.ndarray,
    planned: np.ndarray,
    settings: Settings,
    weight: float,
) -> list[str]:
    """Return the feet at the actual friction limit whose planned force is beyond it."""
    normal = np.array(settings.normals[1])
    limits = []
    for forces in (measured, planned):
        load = forces @ normal
        across = np.linalg.norm(forces - load[:, None] * normal, axis=1)
        limits.append((load, across / np.maximum(settings.friction[1] * load, 1e-9)))
    (load, actual), (planned_load, wanted) = limits
    least = _UNLOADED * weight
    slips = (np.minimum(load, planned_load) > least) & (actual > _SLIPPING) & (wanted > _BEYOND)
    return _feet(contacts, slips)


def _friction_limits(record: Rollout, settings: Settings) -> tuple[list[str], list[str]]:
    """Return the feet whose planned force is on its polyhedron, and those that plan no force."""
    contacts = record.contacts_at(-1)
    names = dict.fromkeys(foot_name(name) for name in contacts.point_names)
    gripping, unloaded = dict.fromkeys(names, False), dict.fromkeys(names, False)
    for i, name in enumerate(contacts.names):
        for force in record.force(name, "planned")[-1].reshape(-1, 3):
            load = float(force @ contacts.normals[i])
            if not np.isfinite(load):
                continue
            cone = FrictionPolyhedron(contacts.normals[i], contacts.mus[i], settings.facets)
            if load <= settings.min_normal_force + _LOAD_TOLERANCE:
                unloaded[foot_name(name)] = True
            elif np.max(cone.face_matrix @ force) > -_FACET_TOLERANCE * load:
                gripping[foot_name(name)] = True
    return [n for n in names if gripping[n]], [n for n in names if unloaded[n]]


def _feet(contacts: Contacts, chosen: np.ndarray) -> list[str]:
    """Return the feet of the chosen contact points."""
    points = zip(contacts.point_names, chosen, strict=True)
    return list(dict.fromkeys(foot_name(name) for name, is_chosen in points if is_chosen))


def _subject(names: list[str]) -> str:
    """Return the subject of a sentence, such as "The front left foot"."""
    most = LIMIT_TABLE["most_names"]
    shown, more = names[:most], len(names) - most
    return "The " + (
        f"{', the '.join(shown)} and {more} more" if more > 0 else " and the ".join(shown)
    )
