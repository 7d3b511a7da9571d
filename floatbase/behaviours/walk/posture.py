"""`WalkingPosture`: what a walk needs to know of a robot in its standing posture."""

from __future__ import annotations

from math import copysign, hypot, sqrt

import numpy as np

from floatbase._validation import Array
from floatbase.behaviours.terrain import Plane
from floatbase.behaviours.walk.options import flat_foot_names
from floatbase.behaviours.walk.path import rotated_by_yaw
from floatbase.dynamics import Contacts
from floatbase.errors import InputError
from floatbase.robots import State

# fraction of its nominal distance from the middle that a foot keeps on its side: legs must not
# cross
MIN_SIDE_FRACTION = 0.25


class WalkingPosture:
    """Feet and centre of mass of a robot in its standing posture."""

    def __init__(self, contacts: Contacts, state: State):
        self.contacts = contacts
        self.state = state
        self.flat_feet = flat_foot_names(contacts)
        self._centre_offsets = {name: self._centre_offset(name) for name in contacts.names}
        positions = {name: state.point(name) for name in contacts.names}
        centres = [self.foot_centre(name, position, 0.0) for name, position in positions.items()]
        middle = [*np.mean(centres, axis=0), 0.0]
        self.nominal_feet = {name: position - middle for name, position in positions.items()}
        self.ground_height = float(contacts.positions(state)[:, 2].mean())
        height = state.com[2] - self.ground_height
        if height <= 0.0:
            raise InputError(
                f"The centre of mass of {state.robot.name} is {-height:.3g} m below its feet. Turn "
                f"the robot upright in its posture, or name other feet."
            )
        self.omega = sqrt(state.robot.gravity / height)

    def _centre_offset(self, foot: str) -> tuple[Array, Array]:
        """Return the centre of pressure relative to a foot's frame, in two parts of shape (2,) [m].

        The first part turns with the foot's yaw, and the second one is in the world frame.
        """
        contact = self.contacts.friction_contact(foot)
        # a ball touches the ground there in any orientation
        to_ground = getattr(contact, "radius", 0.0) * contact.normal
        middle = contact.positions(self.state).mean(axis=0) - self.state.point(foot) + to_ground
        return middle[:2], -to_ground[:2]

    def foot_centre(self, foot: str, position: Array, yaw: float) -> Array:
        """Return the best centre of pressure of a foot whose frame is at `position`, (2,) [m].

        The best point is the middle of a sole, or the point below the centre of a ball.
        """
        in_foot, in_world = self._centre_offsets[foot]
        return position[:2] + rotated_by_yaw(in_foot, yaw) + in_world

    def rotation(self, frame: str) -> Array:
        """Return the rotation of a frame in the standing posture."""
        rotation: Array = self.state.frame_pose(frame).rotation
        return rotation

    def on_ground(self, foot: str, xy: Array, ground: Plane) -> Array:
        """Return the position of a foot's frame, (3,), if it stands at a place (2,) [m].

        Heights of the ground are relative to the ground below the standing posture.
        """
        return np.array([*xy, self.nominal_feet[foot][2] + ground.height(xy)])

    def clamp_to_reach(self, foot: str, end: Array, body: Array, yaw: float, reach: float) -> Array:
        """Return the foothold nearest to `end`, (2,) [m], in reach and on the foot's own side."""
        nominal = self.nominal_feet[foot][:2]
        offset = rotated_by_yaw(end - body, -yaw) - nominal
        position = nominal + offset * min(1.0, reach / (hypot(*offset) or 1.0))
        side = copysign(1.0, nominal[1])
        position[1] = side * max(side * position[1], MIN_SIDE_FRACTION * abs(nominal[1]))
        return body + rotated_by_yaw(position, yaw)
