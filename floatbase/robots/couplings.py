"""Coupled joints: positions of followers, and which joints to lock for eqs. (1)-(7)."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
import pinocchio as pin

from floatbase._validation import Array
from floatbase.errors import InputError, RobotWarning, warn
from floatbase.robots._checks import with_angles

# leader of each follower, multiplier and offset [rad or m]: x = multiplier × x of leader + offset
Couplings: TypeAlias = Mapping[str, tuple[str, float, float]]


def read_couplings(urdf: str) -> Couplings:
    """Return the joints that follow another joint by <mimic>."""
    return {
        joint.get("name", ""): (
            mimic.get("joint", ""),
            float(mimic.get("multiplier", "1")),
            float(mimic.get("offset", "0")),
        )
        for joint in ElementTree.fromstring(urdf).findall("joint")
        for mimic in joint.findall("mimic")
    }


def with_followers_placed(name: str, model: pin.Model, q: Array, couplings: Couplings) -> Array:
    """Return a configuration with each follower where its leader puts it.

    A leader that does not move or does not exist is at zero.
    """

    def position(joint: str, followers: tuple[str, ...] = ()) -> float:
        if joint in followers:
            raise InputError(
                f"Coupled joints of {name} follow each other: {', '.join(followers)}. Remove "
                f"<mimic>, or the equality constraint of an MJCF, from one of them."
            )
        if joint in couplings:
            leader, multiplier, offset = couplings[joint]
            return multiplier * position(leader, (*followers, joint)) + offset
        if not model.existJointName(joint):
            return 0.0
        entry = model.idx_qs[model.getJointId(joint)]
        has_limits = model.nqs[model.getJointId(joint)] == 1
        return float(q[entry] if has_limits else np.arctan2(q[entry + 1], q[entry]))

    angles = {joint: position(joint) for joint in couplings}
    return np.asarray(with_angles(name, model, q, angles))


def lock_coupled_joints(
    name: str, joints: Sequence[str], couplings: Couplings, locked: Sequence[str]
) -> list[str]:
    """Return further joints to lock, with a warning: unlocked followers and their leaders."""
    leaders = {joint: leader for joint, (leader, *_) in couplings.items() if joint not in locked}
    coupled = [joint for joint in joints if joint in {*leaders, *leaders.values()} - {*locked}]
    if coupled:
        follower, leader = next(iter(leaders.items()))
        still = sorted({*leaders.values()} - {*joints})
        message = (
            f"Joints of {name} are coupled, such as {follower} to {leader}. Eqs. (1)-(7) need a "
            f"separate motor for every joint, so these are locked in the posture, with followers "
            f"where their leaders put them: {', '.join(coupled)}. "
            + (f"Some leaders are fixed or do not exist: {', '.join(still)}. " if still else "")
            + f"To lock only the followers, pass locked={list(leaders)}. If every joint has a "
            f"motor, remove the couplings from the file."
        )
        warn(message, RobotWarning)
    return coupled
