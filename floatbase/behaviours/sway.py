"""Friction that a gait needs because the body sways from one stance to the next."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from floatbase.behaviours.gait import Gait
from floatbase.behaviours.posture import WalkingPosture
from floatbase.behaviours.speed import MAX_FEET_WITH_SWAY
from floatbase.dynamics import Contacts
from floatbase.errors import InputError


def required_friction(gait: Gait, posture: WalkingPosture) -> float:
    """Return the coefficient of friction that a gait needs on the spot [-].

    Between two stances whose centres of pressure are 2 d apart, the body sways through the middle,
    at a distance d from each of them. A force from the centre of pressure to the centre of mass at
    the height h then has the slope d / h. A pause on all feet lets the centre of pressure move in
    between, so such changes of stance do not count. With more than four feet, the body hardly
    sways.
    """
    if len(posture.contacts) > MAX_FEET_WITH_SWAY or set(gait.feet) != set(posture.contacts.names):
        return 0.0
    lift_offs = sorted(gait.offsets.values())
    times = sorted(
        {
            round((offset + fraction) % 1.0, 9)
            for offset in lift_offs
            for fraction in (0.0, gait.swing / gait.period)
        }
    )
    begin = gait.start + 2.0 * gait.period
    stances = [gait.stance(begin + time * gait.period) for time in (*times, 1.0 + times[0])]
    centres = [
        np.mean(
            [posture.foot_centre(foot, posture.state.point(foot), 0.0) for foot in stance], axis=0
        )
        for stance in stances
    ]
    distances = [
        float(np.linalg.norm(b - a)) / 2.0
        for (a, b), (first, second) in zip(pairwise(centres), pairwise(stances), strict=True)
        if max(len(first), len(second)) < len(gait.feet)
    ]
    height = float(posture.state.com[2]) - posture.ground_height
    return max(distances, default=0.0) / height


def check_friction(
    gait: Gait, posture: WalkingPosture, contacts: Contacts, facets: int, inner: bool
) -> None:
    """Raise `InputError` if a gait needs more friction than the contacts have."""
    scale = float(np.cos(np.pi / facets)) if inner else 1.0
    available = scale * min((contact.mu for contact in contacts.friction_contacts), default=0.0)
    needed = required_friction(gait, posture)
    if needed > available:
        limit = f"{available:.2f} in every direction with {facets} facets" if inner else "less"
        raise InputError(
            f"This gait needs a coefficient of friction of {needed:.2f}, because the body sways "
            f"far from one stance to the next, but the contacts allow {limit}. Use a gait whose "
            f"feet land around the centre of mass, such as Gait.trot or Gait.walk, or contacts "
            f"with more friction if the ground has it."
        )
