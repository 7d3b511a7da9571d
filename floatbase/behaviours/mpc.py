"""`MPC`: a walk whose contact forces come from a horizon, so that it may also fly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import cos, inf, pi, remainder, sin
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import Array, as_array, as_bool, as_instance, as_integer, as_positive
from floatbase.behaviours.horizon import (
    COM,
    OMEGA,
    STATE_WEIGHTS,
    THETA,
    VELOCITY,
    HorizonMotion,
    HorizonQP,
)
from floatbase.behaviours.walk.active_plan import ActivePlan
from floatbase.behaviours.walk.gait import TIME_TOLERANCE, Gait, flight_offset
from floatbase.behaviours.walk.lipm import LIPM
from floatbase.behaviours.walk.options import Gains, flat_foot_names
from floatbase.behaviours.walk.plan import StepPlan
from floatbase.behaviours.walk.swing import SwingPath
from floatbase.behaviours.walk.targets import com_target
from floatbase.behaviours.walk.walk import Entries, Walk
from floatbase.dynamics import Contacts
from floatbase.errors import InputError
from floatbase.friction import FrictionPolyhedron
from floatbase.robots import Robot, State

# of a force beside the acceleration that it gives the centre of mass: the horizon's forces decide
# how the feet share the load, but its accelerations matter more
_FORCE_FRACTION = 0.02
_UP = np.array([0.0, 0.0, 1.0])
_CORNERS = np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]])
_GAIT_PHASES = 20  # in which a gait with flight has at least two flights
_PATH_STEP, _PATH_STEPS = 0.1, 20  # s, of the path that the pendulum follows


class MPC(Walk):
    """A walk with model predictive control: contact forces are planned over a horizon.

    Gait, footholds, swings and options are those of `Walk`. The difference is the motion of the
    body. Every `solve_period`, a `HorizonQP` computes the contact forces of the next `n` intervals
    from the measured state. The whole-body controller follows the accelerations and the forces of
    the first interval. All feet may be in the air at the same time, as in `Gait.flying_trot` and
    `Gait.pronk`.

    Parameters
    ----------
    robot : Robot
        The robot; its feet are points or balls.
    contacts : Contacts
        All contacts of the robot, such as `Contacts.feet(robot)`.
    gait : Gait
        The contact schedule, possibly with flight.
    velocity : array_like, shape (2,), optional
        Desired velocity of the body, forwards and to the left [m/s], as for `Walk`.
    yaw_rate : float, optional
        Desired yaw rate, to the left [rad/s], as for `Walk`.
    n : int, optional
        Number of intervals of the horizon.
    dt : float, optional
        Length of an interval [s].
    solve_period : float, optional
        Time between two solutions, at most `dt` [s]. A change of stance also needs a new solution.
    state_weights : array_like, shape (12,), optional
        Weights of `HorizonQP`.
    bounce : bool, optional
        Whether the reference of a gait with flight bounces; otherwise it is level.
    ramp : float, optional
        As for `Walk` [s]; 0 by default, because the horizon loads the feet.
    **options : object
        Options of `Walk`.

    Raises
    ------
    InputError
        If an argument is out of range or if a contact is a flat foot.
    UnknownArgumentError
        If an option is unknown.

    Notes
    -----
    The horizon is that of [DiCarlo2018]_. As in [Kim2019]_, a whole-body controller follows its
    forces. The horizon tracks the pendulum of `Walk`, which also adjusts the footholds. In a gait
    with flight, the pendulum's zero-moment point moves along the path, because a robot in the air
    has none. The reference of its height is given in closed form: a parabola in each flight, and a
    constant vertical acceleration in each stance. With ``bounce=False``, only the horizon knows
    that the robot will be in the air.

    Examples
    --------
    >>> import floatbase as fb
    >>> from floatbase.behaviours import MPC, Gait
    >>> robot = fb.load("go2")
    >>> run = MPC(robot, fb.Contacts.feet(robot), Gait.flying_trot(robot), velocity=(1.0, 0.0))
    >>> run
    MPC(go2, 4 feet, 1 and 0 m/s)
    """

    may_fly = True
    _made_anew = Walk._made_anew | {
        "_horizon", "_contact_offsets", "_motion", "_solved", "_measured", "_flight",
    }  # fmt: skip

    def __init__(
        self,
        robot: Robot,
        contacts: Contacts,
        gait: Gait,
        velocity: npt.ArrayLike = (0.0, 0.0),
        yaw_rate: float = 0.0,
        *,
        n: int = 10,
        dt: float = 0.03,
        solve_period: float = 0.02,
        state_weights: npt.ArrayLike = STATE_WEIGHTS,
        bounce: bool = True,
        ramp: float = 0.0,
        **options: Any,
    ):
        robot = as_instance("robot", robot, Robot)
        flat = sorted(flat_foot_names(as_instance("contacts", contacts, Contacts)))
        if flat:
            raise InputError(
                f"MPC needs feet that are points or balls, but {', '.join(flat)} is a flat foot. "
                f"Use Walk for a robot with soles."
            )
        self._n = as_integer("n", n, 1, 100)
        self._dt = as_positive("dt", dt, "s", maximum=1.0)
        self._solve_period = as_positive("solve_period", solve_period, "s", maximum=self._dt)
        self._state_weights = as_array("state_weights", state_weights, (12,))
        self._bounces = as_bool("bounce", bounce)
        gains = options.get("gains")
        gains = Gains() if gains is None else as_instance("gains", gains, Gains)
        self._force_weight = _FORCE_FRACTION * gains.com[1] / robot.mass**2
        super().__init__(robot, contacts, gait, velocity, yaw_rate, ramp=ramp, **options)

    @property
    def horizon(self) -> HorizonQP:
        """Quadratic program of the horizon."""
        return self._horizon

    @property
    def motion(self) -> HorizonMotion | None:
        """The last solution: forces and predicted states; None before the first control step."""
        return self._motion

    def _clear(self) -> None:
        super()._clear()
        robot, posture, limits = self.robot, self._posture, self._controllers.limits
        data = robot.model.createData()
        pin.ccrba(robot.model, data, posture.state.q, np.zeros(robot.nv))
        mu = min(
            _square_pyramid_mu(FrictionPolyhedron(_UP, contact.mu, *limits.polyhedron_options))
            for contact in posture.contacts.friction_contacts
        )
        inertia, weights = np.array(data.Ig.inertia), self._state_weights
        self._horizon = HorizonQP(
            robot.mass, inertia, self._dt, mu, gravity=robot.gravity, state_weights=weights
        )
        self._contact_offsets = {
            name: posture.contacts.only(name).positions(posture.state)[0]
            - posture.state.point(name)
            for name in posture.contacts.names
        }

    def _forget_plan(self) -> None:
        super()._forget_plan()
        self._motion: HorizonMotion | None = None
        self._solved: tuple[float, StepPlan | None] = -inf, None  # time, and the plan then

    def _modified(self, plan: StepPlan, state: State) -> StepPlan:
        """Let the pendulum of a gait with flight follow the path, without a sway."""
        self._flight = self._first_flight()
        if self._flight is not None:
            times = plan.time + _PATH_STEP * np.arange(_PATH_STEPS + 1)
            points = [plan.path.moved(self._progress.desired, time).position for time in times]
            segments = list(zip(times[:-1], times[1:], points[:-1], points[1:], strict=True))
            plan = replace(plan, plan=LIPM(segments, state.com[:2], self.omega))
        return super()._modified(plan, state)

    def _first_flight(self) -> tuple[float, float, float] | None:
        """Return begin and duration of the gait's first flight, and the time to the next one [s].

        None if a foot always stands. All flights are assumed to be like the first one.
        """
        gait = replace(self._progress.clock.gait, stop=None)
        if len(gait.feet) < len(self._all_contacts) or flight_offset(gait) is None:
            return None
        phases = gait.phases(gait.start, _GAIT_PHASES, gait.period)
        flights = [(begin, end) for begin, end, stance in phases if not stance]
        begin, end = flights[0]
        return begin, end - begin, flights[1][0] - begin

    def _adjust_targets(
        self, q: Array, v: Array, t: float, active: ActivePlan, entries: Entries, targets: Array
    ) -> None:
        """Write the predicted motion of the body, and the forces of the standing feet."""
        solved, plan = self._solved
        if plan is not active.plan or t >= solved + self._solve_period - TIME_TOLERANCE:
            self._solve(State(self.robot, q, v), t, active)
        s, motion = t - self._solved[0], self._motion
        assert motion is not None
        x, (R, c, turning, velocity) = motion.states[0], self._measured
        a, alpha = (x[VELOCITY] - velocity) / self._dt, (x[OMEGA] - turning) / self._dt
        R = pin.exp3(turning * s + alpha * s * s / 2.0) @ R
        com = c + velocity * s + a * s * s / 2.0, velocity + a * s, a
        targets[entries["centre of mass"]] = np.concatenate(com)
        base = R.ravel(), turning + alpha * s, alpha
        targets[entries["orientation of base"]] = np.concatenate(base)
        stands = [name in active.plan.stance for name in self._all_contacts.names]
        targets[entries["force regularization"]] = motion.forces[0, stands].ravel()

    def _solve(self, state: State, t: float, active: ActivePlan) -> None:
        """Solve the horizon from a measured state at t [s]."""
        R = state.frame_pose("base").rotation
        turning = R @ state.v[3:6]
        self._measured = R, state.com, turning, state.com_velocity
        reference = self._reference(t, active)
        theta = pin.rpy.matrixToRpy(R @ self._posture.rotation("base").T)
        theta[2] = reference[0, 2] + remainder(theta[2] - reference[0, 2], 2.0 * pi)
        feet, stance = self._schedule(state, t, active)
        feet -= np.concatenate([[state.com], reference[:-1, COM]])[:, None]
        x = np.concatenate([theta, state.com, turning, state.com_velocity])
        self._motion = self._horizon.solve(x, reference, feet, stance)
        self._solved = t, active.plan

    def _reference(self, t: float, active: ActivePlan) -> Array:
        """Return the desired state at the end of each interval, shape (n, 12)."""
        reference = np.zeros((self._n, 12))
        pose = self._leaning_pose
        now = active.path
        for k, row in enumerate(reference):
            time = t + (k + 1) * self._dt
            path = now.moved(self._progress.desired, time)
            lean, rate, _ = pose.lean(time)
            row[THETA] = [0.0, pose.pitch + lean, path.yaw]
            row[OMEGA] = [-rate * sin(path.yaw), rate * cos(path.yaw), path.velocity[2]]
            row[COM], row[VELOCITY], _ = com_target(self._posture, pose, active.plan, time)
            rise, speed = self._bounce(time)
            row[COM.stop - 1] += rise
            row[VELOCITY.stop - 1] += speed
        return reference

    def _bounce(self, t: float) -> tuple[float, float]:
        """Return height [m] and vertical velocity [m/s] of the reference at t, for a flying gait.

        Flights of the duration T follow a parabola, from g T / 2 to -g T / 2. In the stance between
        them, the velocity changes back at a constant rate. Before the first flight and after the
        last one, the reference is level.
        """
        flight, gravity = self._flight, self.robot.gravity
        if not self._bounces or flight is None or self._progress.clock.gait.stop is not None:
            return 0.0, 0.0
        begin, T, interval = flight
        stance = interval - T
        if t < begin - stance:
            return 0.0, 0.0
        s = (t - begin) % interval
        if s < T:
            return gravity / 2.0 * s * (T - s), gravity * (T / 2.0 - s)
        s, scale = s - T, gravity * T / stance
        return -scale / 2.0 * s * (stance - s), scale * (s - stance / 2.0)

    def _schedule(
        self, state: State, t: float, active: ActivePlan
    ) -> tuple[Array, npt.NDArray[np.bool_]]:
        """Return contact points, (n, m, 3) [m], and which feet stand, (n, m), in each interval.

        A foot stands in an interval if it stands in its middle, or in the first one, if it stands
        now.
        """
        gait, names = self._progress.clock.gait, self._all_contacts.names
        swings = active.swings
        points, stance = np.zeros((self._n, len(names), 3)), np.zeros((self._n, len(names)), bool)
        for i, foot in enumerate(names):
            offset = self._contact_offsets[foot]
            point, touchdown = state.point(foot), None
            for k in range(self._n):
                time = t + (k + 0.5) * self._dt if k else t
                times = gait.swing_at(foot, time) if foot in gait.feet else None
                if times is not None:
                    touchdown = times[1]
                elif touchdown is not None:  # it has landed
                    point, touchdown = self._landing(foot, touchdown, point, swings), None
                points[k, i], stance[k, i] = point + offset, times is None
        return points, stance

    def _landing(
        self, foot: str, touchdown: float, before: Array, swings: Mapping[str, SwingPath]
    ) -> Array:
        """Return where a foot will stand after a touchdown [s]; before: where it stood before."""
        swing = swings.get(foot)
        if swing is not None and abs(swing.touchdown - touchdown) < TIME_TOLERANCE:
            return np.array(swing.end)
        foothold = np.asarray(self._options.foothold(foot, touchdown, self), float)
        return np.array([*foothold[:2], before[2]])


def _square_pyramid_mu(polyhedron: FrictionPolyhedron) -> float:
    """Return the friction coefficient of the largest pyramid (M7) inside a friction polyhedron.

    The forces at the edges of the pyramid must be inside, too, so that the feet do not slip.
    """
    directions = polyhedron.face_matrix + polyhedron.mu_facet * polyhedron.normal
    return float(polyhedron.mu_facet / (directions @ _CORNERS.T).max())
