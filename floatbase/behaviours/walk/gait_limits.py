"""What a gait demands: speeds that the feet can follow, and friction for the sway of the body."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from itertools import pairwise
from math import atan2, cos, pi, sin, sqrt
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from floatbase._geometry import minimum_jerk
from floatbase._validation import Array
from floatbase.behaviours.walk.gait import Gait
from floatbase.behaviours.walk.posture import WalkingPosture
from floatbase.dynamics import Contacts
from floatbase.errors import InputError
from floatbase.robots import Robot, State
from floatbase.robots._checks import joint_limits

if TYPE_CHECKING:
    from floatbase.behaviours.walk.walk import Walk

# with four feet or fewer, the middle of all feet is at the edge of each smaller stance
MAX_FEET_WITH_SWAY = 4
# fraction of a straight leg's length that a walk uses: a straight leg cannot lift or press its foot
_MAX_EXTENSION = 0.9
# sine of the angle between the desired velocity and the directions in which a leg moves its foot
_MAX_SIDEWAYS = 0.5
_GRID_SIZE = 25  # positions of a joint that the search for the longest leg tries
_SWEEPS = 2  # over the joints of a leg: more find no longer leg for any robot in the catalogue


def speed_fractions(
    gait: Gait, posture: WalkingPosture, reach: float, motion: Array, acceleration: float
) -> tuple[float, float]:
    """Return the largest fractions of a desired motion that the feet can follow, at most 1.

    The first fraction holds for the first period, and the second one afterwards.

    During its stance, a foot moves from half a step in front of its nominal position to half a step
    behind it. Half a step must be at most `reach`. A ball foot must also stay within the length of
    its leg, while the body shifts to the middle of the standing feet. The leg is longest soon after
    lift-off, because the foot starts slowly. In the first period, a foot stays in its nominal
    position until its first lift-off, while the body accelerates.
    """
    if not motion.any():
        return 1.0, 1.0
    first_fraction, fraction = 1.0, 1.0
    state, nominal_feet, flat_feet = posture.state, posture.nominal_feet, posture.flat_feet
    wait, shifts = max(gait.offsets.values()) * gait.period, _weight_shifts(gait, nominal_feet)
    half_stance = (gait.period - gait.swing) / 2.0
    longest = half_stance + _swing_lag(gait)
    for foot in gait.feet:
        x, y = nominal_feet[foot][:2]
        velocity = motion[:2] + motion[2] * np.array([-y, x])
        speed = float(np.linalg.norm(velocity))
        if speed == 0.0:
            continue
        fraction = min(fraction, reach / (half_stance * speed))
        if foot not in flat_feet:
            direction = velocity / speed
            shift = float(np.abs(shifts @ direction).max())
            leg_limit = max(_leg_reach(state, foot, direction) - shift, 0.0)
            fraction = min(fraction, leg_limit / (longest * speed))
            # at the largest acceleration, the distance after `wait` is
            # speed wait - speed² / (2 acceleration)
            square = wait**2 - 2.0 * leg_limit / acceleration
            if square > 0.0:
                first_fraction = min(first_fraction, acceleration * (wait - sqrt(square)) / speed)
    return min(first_fraction, fraction), fraction


def motion_message(walk: Walk, gait: Gait, state: State, fraction: float) -> str:
    """Return the warning for a walk that does not move as desired, else "".

    Either its legs cannot move the feet along the desired velocity, as solo8's to the side, or it
    is limited to a fraction of the desired motion. state: the standing state.
    """
    direction = np.append(walk.velocity, 0.0) / (np.linalg.norm(walk.velocity) or 1.0)
    jacobians = {foot: state.frame_jacobian(foot)[:3, 6:] for foot in gait.feet}
    sideways = {f: direction - J @ (np.linalg.pinv(J) @ direction) for f, J in jacobians.items()}
    stuck = [foot for foot, part in sideways.items() if np.linalg.norm(part) > _MAX_SIDEWAYS]
    if stuck:
        return (
            f"{walk!r} hardly moves in this direction, because the legs of {', '.join(stuck)} "
            f"cannot move their feet along it. Choose another velocity."
        )
    if fraction == 1.0:
        return ""
    x, y = fraction * walk.velocity
    return (
        f"{walk.robot.name} cannot make steps that are long enough for {walk!r}. It walks at "
        f"{x:.3g} and {y:.3g} m/s, and turns at {fraction * walk.yaw_rate:.3g} rad/s. Use a gait "
        f"with a shorter period than {gait.period:g} s."
    )


def _weight_shifts(gait: Gait, nominal_feet: dict[str, Array]) -> Array:
    """Return how far the middle of the standing feet is from that of all feet, shape (n, 2) [m].

    There is one row for each stance on three or more feet. On two feet, and for robots with more
    than four feet, the body hardly shifts.
    """
    if len(nominal_feet) > MAX_FEET_WITH_SWAY:
        return np.zeros((1, 2))
    middle = np.mean([position[:2] for position in nominal_feet.values()], axis=0)
    shifts = [np.zeros(2)]
    for offset in gait.offsets.values():
        lift_off = gait.start + (1.0 + offset) * gait.period
        standing = [
            position[:2]
            for foot, position in nominal_feet.items()
            if foot not in gait.feet or gait.swing_at(foot, lift_off) is None
        ]
        if len(standing) > 2:
            shifts.append(np.mean(standing, axis=0) - middle)
    return np.array(shifts)


def _swing_lag(gait: Gait) -> float:
    """Return the effective time after lift-off for which the body-to-foot distance grows [s].

    Times the speed, this is the distance beyond half a step. The body moves by speed t, and the
    foot by minimum jerk to the end of a step of length speed period.
    """
    phases = np.linspace(0.0, 1.0, 33)
    return float(max(u * gait.swing - minimum_jerk(u)[0] * gait.period for u in phases))


def _leg_reach(state: State, foot: str, direction: Array) -> float:
    """Return how far a foot can move horizontally in a direction, and in the opposite one [m].

    The result is the smaller of the two distances from the foot's place in the standing posture.
    """
    root = leg_joints(state.robot, foot)[-1]
    centre = state.point(foot, state.robot.foot(foot).centre)
    leg = centre - state.joint_transforms[root][:3, 3]
    along = abs(float(leg[:2] @ direction))
    square = _leg_length(state.robot, foot) ** 2 - float(leg @ leg) + along**2
    return sqrt(max(square, 0.0)) - along


def leg_joints(robot: Robot, foot: str) -> list[int]:
    """Return the joints of a leg, from the foot to the hip."""
    model, joints = robot.model, []
    joint = model.frames[robot.frame_id(foot)].parentJoint
    while joint > 0 and model.names[joint] in robot.joint_names:
        joints.append(joint)
        joint = model.parents[joint]
    return joints


@lru_cache(maxsize=64)
def _leg_length(robot: Robot, foot: str) -> float:
    """Return the largest distance of a foot from its hip in a walk [m].

    The leg is bent a little, and its joints are within their limits.
    """
    joints, _, lower, upper = joint_limits(robot.model)
    limits = dict(zip(joints.tolist(), zip(lower, upper, strict=True), strict=True))
    return min(_MAX_EXTENSION * _longest_leg(robot, foot, {}), _longest_leg(robot, foot, limits))


def _longest_leg(robot: Robot, foot: str, limits: Mapping[int, tuple[float, float]]) -> float:
    """Return the largest distance of a foot from its hip [m], by a search joint by joint.

    limits: lower and upper limit of joints by their index [rad or m]; other joints turn fully.
    """
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id(foot)
    leg, q = leg_joints(robot, foot), np.array(robot.standing().q)
    centre = np.array(robot.foot(foot).centre)

    def distance(joint: int, position: float) -> float:
        place(joint, position)
        pin.forwardKinematics(model, data, q)
        end = pin.updateFramePlacement(model, data, frame).act(centre)
        return float(np.linalg.norm(end - data.oMi[leg[-1]].translation))

    def place(joint: int, position: float) -> None:
        is_unlimited = model.nqs[joint] == 2  # stored as (cos, sin)
        values = (cos(position), sin(position)) if is_unlimited else position
        q[model.idx_qs[joint] :][: model.nqs[joint]] = values

    longest = 0.0
    for joint in leg * _SWEEPS:
        now = q[model.idx_qs[joint] :][: model.nqs[joint]]
        x = float(now[0]) if len(now) == 1 else atan2(now[1], now[0])
        lower, upper = limits.get(joint, (x - pi, x + pi))
        positions = [x, *np.linspace(max(lower, x - pi), min(upper, x + pi), _GRID_SIZE)]
        longest, best = max((distance(joint, position), position) for position in positions)
        place(joint, best)
    return longest


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
    lift_offs = list(gait.offsets.values())
    touchdowns = [offset + gait.swing / gait.period for offset in lift_offs]
    times = sorted({round(time % 1.0, 9) for time in lift_offs + touchdowns})
    begin = gait.start + 2.0 * gait.period
    stances = [gait.stance(begin + time * gait.period) for time in (*times, 1.0 + times[0])]
    at = {foot: posture.foot_centre(foot, posture.state.point(foot), 0.0) for foot in gait.feet}
    centres = [np.mean([at[foot] for foot in stance], axis=0) for stance in stances]
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
