"""Speeds that the feet of a robot can follow with a given gait."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
import pinocchio as pin

from floatbase._geometry import minimum_jerk
from floatbase._validation import Array
from floatbase.behaviours.gait import Gait
from floatbase.robots import State
from floatbase.robots._checks import joint_limits

# with four feet or fewer, the middle of all feet is at the edge of each smaller stance
MAX_FEET_WITH_SWAY = 4
# fraction of a straight leg's length that a walk uses: a straight leg cannot lift or press its foot
_MAX_EXTENSION = 0.9
_GRID = np.linspace(0.0, 1.0, 33)  # positions of a joint in its range; phases of a swing
_SWEEPS = 2  # over the joints of a leg: the second one finds no longer leg for any robot here


def speed_fractions(
    gait: Gait,
    state: State,
    nominal_feet: dict[str, Array],
    leg_lengths: dict[str, float],
    reach: float,
    motion: Array,
) -> tuple[float, float]:
    """Return the largest fractions of a desired motion that the feet can follow, at most 1.

    The first fraction holds for the first period, and the second one afterwards.

    During its stance, a foot moves from half a step in front of its nominal position to half a step
    behind it. Half a step must be at most `reach`. A ball foot must also stay within the length of
    its leg, while the body shifts to the middle of the standing feet. The leg is longest soon after
    lift-off, because the foot starts slowly. In the first period, a foot stays in its nominal
    position until its first lift-off, while the body accelerates.

    Parameters
    ----------
    gait : Gait
        The gait.
    state : State
        State whose posture the robot keeps.
    nominal_feet : dict of str to ndarray, shape (3,)
        Position of each foot's frame in the standing posture, relative to the middle of the feet
        [m].
    leg_lengths : dict of str to float
        Largest length of the leg of each ball foot, from `leg_length` [m].
    reach : float
        Largest distance of a foothold from the nominal one [m].
    motion : ndarray, shape (3,)
        Desired velocity, forwards and to the left [m/s], and yaw rate [rad/s].
    """
    if not motion.any():
        return 1.0, 1.0
    first_fraction, fraction = 1.0, 1.0
    lag, shifts = _swing_lag(gait), _weight_shifts(gait, nominal_feet)
    wait = max(gait.offsets.values()) * gait.period + lag
    for foot in gait.feet:
        x, y = nominal_feet[foot][:2]
        velocity = motion[:2] + motion[2] * np.array([-y, x])
        speed, half_stance = float(np.linalg.norm(velocity)), (gait.period - gait.swing) / 2.0
        if speed == 0.0:
            continue
        fraction = min(fraction, reach / (half_stance * speed))
        if foot in leg_lengths:
            direction = velocity / speed
            shift = float(np.abs(shifts @ direction).max())
            limit = max(_leg_reach(state, foot, leg_lengths[foot], direction) - shift, 0.0)
            fraction = min(fraction, limit / ((half_stance + lag) * speed))
            # at 1 m/s², the distance after `wait` is speed wait - speed² / 2
            if wait**2 > 2.0 * limit:
                first_fraction = min(first_fraction, (wait - sqrt(wait**2 - 2.0 * limit)) / speed)
    return min(first_fraction, fraction), fraction


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
    """Return how long after half a stance the body moves away from a foot that lifts off [s].

    The body moves by speed t, and the foot by minimum jerk to the end of a step speed period.
    """
    return float(max(u * gait.swing - minimum_jerk(u)[0] * gait.period for u in _GRID))


def leg_length(state: State, foot: str) -> float:
    """Return the largest distance of a foot from the first joint of its leg in a walk [m].

    The leg is not straight, and its joints are within their limits.
    """
    joints, _, lower, upper = joint_limits(state.robot.model)
    limits = dict(zip(joints.tolist(), zip(lower, upper, strict=True), strict=True))
    return min(_MAX_EXTENSION * _longest_leg(state, foot, {}), _longest_leg(state, foot, limits))


def _longest_leg(state: State, foot: str, limits: dict[int, tuple[float, float]]) -> float:
    """Return the largest distance of a foot from the first joint of its leg [m].

    Parameters
    ----------
    state : State
        State from which the search starts.
    foot : str
        Name of the foot.
    limits : dict of int to (float, float)
        Lower and upper limit of joints by their index [rad or m]; other joints can turn fully.
    """
    model, frame = state.robot.model, state.robot.model.frames[state.robot.frame_id(foot)]
    data, leg, joint = model.createData(), [], frame.parentJoint
    while joint > 0 and model.names[joint] in state.robot.joint_names:
        leg.append(joint)
        joint = model.parents[joint]
    best, longest = np.array(state.q), 0.0
    for joint in leg * _SWEEPS:
        start = best
        position = start[model.idx_qs[joint]]
        lower, upper = limits.get(joint, (position - pi, position + pi))
        for target in lower + (upper - lower) * _GRID:
            step = np.zeros(model.nv)
            step[model.idx_vs[joint]] = target - position
            q = pin.integrate(model, start, step)
            pin.forwardKinematics(model, data, q)
            tip = data.oMi[frame.parentJoint].act(frame.placement.translation)
            length = float(np.linalg.norm(tip - data.oMi[leg[-1]].translation))
            if length > longest:
                best, longest = q, length
    return longest


def _leg_reach(state: State, foot: str, length: float, direction: Array) -> float:
    """Return how far a foot can move horizontally in a direction, and in the opposite one [m].

    The result is the smaller of the two distances from the foot's place in the standing posture.

    Parameters
    ----------
    state : State
        The standing state.
    foot : str
        Name of the foot.
    length : float
        Largest length of the leg [m].
    direction : ndarray, shape (2,)
        Horizontal unit vector in the world frame.
    """
    model = state.robot.model
    joint = model.frames[state.robot.frame_id(foot)].parentJoint
    leg = state.point(foot)
    hip = leg
    while joint > 0 and model.names[joint] in state.robot.joint_names:
        hip = state.joint_transforms[joint][:3, 3]
        joint = model.parents[joint]
    leg = leg - hip
    along = abs(float(leg[:2] @ direction))
    square = length**2 - float(leg @ leg) + along**2
    return sqrt(max(square, 0.0)) - along
