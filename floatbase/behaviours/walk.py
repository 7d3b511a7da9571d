"""`Walk`: a controller that steps. It plans footholds and a pendulum at each change of stance, and serves them by (26)(27)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import copysign, hypot, inf, sqrt
from typing import Any, ClassVar, TypeAlias

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array, FixedAttributes, as_array, as_callable, as_instance, as_number, as_positive
from floatbase.behaviours.footholds import capture_point, neutral_point, step_adjustment
from floatbase.behaviours.gait import SAME_TIME, Gait, check_that_one_stands
from floatbase.behaviours.lipm import LIPM, Piece
from floatbase.behaviours.options import Gains, check_feet, check_options, flat_among
from floatbase.behaviours.reference import Motion, Reference, Swinging, turned, yaw_of
from floatbase.behaviours.swing import Swing
from floatbase.control import Command, WholeBodyController
from floatbase.dynamics import Contacts
from floatbase.errors import InfeasibleError, InputError
from floatbase.objectives import CoMTask, FrameTask, OrientationTask, PostureTask, Task
from floatbase.robots import Robot, State

Foothold: TypeAlias = Callable[[str, float, "Walk"], npt.ArrayLike]
Phase: TypeAlias = tuple[float, float, tuple[str, ...]]
_PHASES = 4  # stances that a plan looks ahead: two steps; eight are no better
_LONGEST = 5.0  # s of standing that a plan looks ahead
_AWAY = 0.2  # s without a tick, after which another controller may have moved the robot
_SETTLED = 0.05  # s after which the height of a foot shows that of the ground: feet that aim where others just touched climb
_SHIFT = 0.8  # s before the first lift-off and after the last landing in which the ZMP moves
_DEAD_ZONE = 0.02  # m of DCM error that a stance with area bears without moving a step: it would grow by up to e^{ω 1.2 s}
_GIVES_WAY = 0.05  # m by which steps have moved, from which on the path moves along, or the robot runs back to it and falls
_OWN_SIDE = 0.25  # part of its distance from the middle that a foot keeps to its own side: legs must not cross
_REACH, _REACH_FLAT = 0.2, 0.3  # m
_LOAD = 2.0  # times its even share of the weight: the normal force from which a ramp comes down
_SOFT = 1e4  # weight of contacts that must give way, beside 10 of the tasks
_FASTEST = 10.0  # m/s and rad/s: more is a slip of units
_HISTORY = 500  # changes of stance that are kept: two minutes of a trot, 4 MB


@dataclass(frozen=True)
class Step:
    """What a `Walk` planned at one change of stance, or where it stood on and the plan came to its end.

    time: s.
    stance: the feet that stand from then on.
    feet: (3,) m, world, where each foot's frame stands or stood.
    footholds: (3,) m, world, where each foot that is in the air, or lifts next, is to land, as planned then.
    plan: of the centre of mass.
    swings: the paths of the feet that are in the air, as planned then.
    """

    time: float
    stance: tuple[str, ...]
    feet: dict[str, Array]
    footholds: dict[str, Array]
    plan: LIPM
    swings: dict[str, Swing]


class Walk(FixedAttributes):
    """Walks by a gait at a velocity: a controller like any other, for `fb.rollout`, `Live`, `fb.sweep` and `fb.push_rose`.

    At each change of stance it takes the feet where they are, plans the next footholds (`neutral_point`) and a linear inverted
    pendulum above them (`LIPM`), from where the centre of mass is. At each tick it moves the ends of the swings by
    `step_adjustment`, as far as the legs reach. One `WholeBodyController` for each stance does the rest; where no forces hold
    the feet, they give way. When the clock goes back, or 0.2 s ahead at once, it begins anew from the measured state.

    robot: the robot; its feet are point feet or flat feet.
    contacts: all its contacts; `Contacts.feet(robot)` fits.
    gait: when each foot is in the air; may be set while it walks: no foot lifts by the former one any more, and the new one
        takes over when all stand. Lift-offs that were over before are left out. At least one foot must stand at any time.
    velocity: (2,) m/s, forwards and to the left, of the body; may be set while it walks, and is approached by 1 m/s².
    yaw_rate: rad/s, to the left; as velocity.
    clearance: m, how high feet are lifted.
    reach: m, how far a foot may land from where it would stand below the body; 0.2 by default, 0.3 for flat feet.
    ramp: s, in which a foot is unloaded before it lifts, and loaded after it landed, as far as all feet stand then; a
        max_normal_force among the options takes its place.
    foothold: (foot, land in s, walk) -> (2,) m, world: where a foot should land, before adjustments; `neutral_point` below the
        body by default.
    gains: of its tasks; `Gains.of(contacts)` by default.
    options: more arguments of `fb.WholeBodyController`, such as facets.

    At velocity (0, 0) it marches on the spot; `walk.gait = dataclasses.replace(walk.gait, stop=walk.time)` makes it stand.
    `stance`, `footholds`, `swings`, `plan` and `history` tell what it is doing. A controller of your own around it needs its
    `contacts`, as they are at each tick. Raises `InputError` for arguments that do not fit.
    """

    _hints: ClassVar[dict[str, str]] = {
        **dict.fromkeys(("robot", "clearance", "reach", "ramp", "foothold", "gains", "omega"), "make another one"),
        **dict.fromkeys(("time", "stance", "contacts", "footholds", "swings", "plan", "history"), "it tells what it is doing"),
    }

    history: deque[Step]

    def __init__(
        self,
        robot: Robot,
        contacts: Contacts,
        gait: Gait,
        velocity: npt.ArrayLike = (0.0, 0.0),
        yaw_rate: float = 0.0,
        *,
        clearance: float = 0.05,
        reach: float | None = None,
        ramp: float = 0.1,
        foothold: Foothold | None = None,
        gains: Gains | None = None,
        **options: Any,
    ):
        self.robot, self._all = as_instance("robot", robot, Robot), as_instance("contacts", contacts, Contacts)
        self._flat = flat_among(contacts)
        self._reference: Reference | None = None
        self.gait, self.velocity, self.yaw_rate = gait, velocity, yaw_rate
        self.clearance = as_positive("clearance", clearance, "m", allow_zero=True, maximum=1.0)
        self.reach = as_positive("reach", (_REACH_FLAT if self._flat else _REACH) if reach is None else reach, "m", maximum=1.0)
        self.ramp = as_positive("ramp", ramp, "s", allow_zero=True, maximum=1.0)
        self.foothold = below_the_body if foothold is None else as_callable("foothold", foothold, "foothold(foot, land, walk)")
        self.gains = Gains.of(contacts) if gains is None else as_instance("gains", gains, Gains)
        check_options(type(self).__name__, options)
        self._limits = WholeBodyController(robot, contacts, (), **options).limits  # what does not fit is told now
        self._options, self._standing = options, robot.standing()
        self._alone = {contact.name: Contacts([contact]) for contact in contacts}
        origins = {contact.name: self._standing.point(contact.name) for contact in contacts}
        middle = np.mean([self._centre(name, origin, 0.0) for name, origin in origins.items()], axis=0)
        self._nominal = {name: origin - [*middle, 0.0] for name, origin in origins.items()}
        ground = float(contacts.positions(self._standing)[:, 2].mean())
        self.omega = sqrt(robot.gravity / (self._standing.com[2] - ground))
        self._forget()
        self._initialised = True

    @property
    def gait(self) -> Gait:
        """When each foot is in the air, as it was set last."""
        return self._gait

    @gait.setter
    def gait(self, gait: Gait) -> None:
        check_feet(as_instance("gait", gait, Gait, "Gait.trot(robot)"), self._all)
        if len(gait.feet) == len(self._all):
            check_that_one_stands(gait)
        self._gait = gait

    @property
    def velocity(self) -> Array:
        """(2,) m/s, forwards and to the left, that is desired."""
        return self._velocity

    @velocity.setter
    def velocity(self, velocity: npt.ArrayLike) -> None:
        self._velocity = as_array("velocity", velocity, (2,), "m/s")
        as_number("speed", float(np.linalg.norm(self._velocity)), "m/s", maximum=_FASTEST)

    @property
    def yaw_rate(self) -> float:
        """rad/s, to the left, that is desired."""
        return self._yaw_rate

    @yaw_rate.setter
    def yaw_rate(self, yaw_rate: float) -> None:
        self._yaw_rate = as_number("yaw_rate", yaw_rate, "rad/s", -_FASTEST, _FASTEST)

    @property
    def time(self) -> float | None:
        """s, of the last tick; None before the first."""
        return self._now.time if self._reference else None

    @property
    def stance(self) -> tuple[str, ...]:
        """The feet that stand now."""
        return self._now.stance if self._reference else self._all.names

    @property
    def contacts(self) -> Contacts:
        """The contacts of the present stance."""
        key = (self.stance, False)
        return self._controllers[key].contacts if key in self._controllers else self._all

    @property
    def footholds(self) -> dict[str, Array]:
        """Where each foot that is in the air, or lifts next, is to land: (3,) m, world, of its frame."""
        return {**self._now.footholds, **{foot: path.end for foot, path in self.swings.items()}} if self._reference else {}

    @property
    def swings(self) -> dict[str, Swing]:
        """The paths of the feet that are in the air."""
        return {foot: each.path for foot, each in self._now.swinging.items()} if self._reference else {}

    @property
    def plan(self) -> LIPM | None:
        """The plan of the centre of mass, horizontally; None before the first tick."""
        return self._now.plan if self._reference else None

    def below(self, foot: str, t: float) -> Array:
        """Where a foot would stand below the body at time t in s, (2,) m, world, if the desired velocity goes on."""
        foot = self._all[foot].name  # an `UnknownNameError` tells what there is
        place, yaw, _ = self._path(as_number("t", t, "s"))
        return place + turned(self._nominal[foot][:2], yaw)

    def velocity_at(self, t: float) -> Array:
        """The body's velocity at time t in s, (2,) m/s, world, if the desired one goes on."""
        _, yaw, velocity = self._path(as_number("t", t, "s"))
        return turned(velocity[:2], yaw)

    def __call__(self, q: npt.ArrayLike, v: npt.ArrayLike, t: float = 0.0) -> Command:
        """The tick: torques for configuration q, shape (nq,), and velocity v, shape (nv,), at time t in s."""
        state, t = State(self.robot, q, as_array("v", v, (self.robot.nv,))), as_number("t", t, "s")
        if not self._goes_on(t):
            self._begin(state, t)
        now = self._now
        self._take_gait(t)
        (now.place, now.yaw, now.velocity), now.time = self._path(t), t
        stance = self._stance_at(t)
        if stance != now.stance or t >= now.renew:
            self._change(state, stance)
        self._aim(state)
        try:
            return self._controller()(q, v, t)
        except InfeasibleError:  # torques and friction do not hold the feet
            return self._controller(contact_weight=_SOFT)(q, v, t)

    @property
    def _now(self) -> Reference:
        if self._reference is None:
            raise InputError("a Walk has no path before its first tick: call it as walk(q, v, t), or run a rollout.")
        return self._reference

    def _goes_on(self, t: float) -> bool:
        """Whether time t, s, follows the last tick; else it begins anew."""
        now = self._reference
        return now is not None and t > now.began and now.time - SAME_TIME <= t <= now.time + _AWAY

    def _forget(self) -> None:
        self._controllers: dict[tuple[tuple[str, ...], bool], WholeBodyController] = {}
        self._reference = None
        vars(self)["history"] = deque(maxlen=_HISTORY)

    def _path(self, t: float) -> tuple[Array, float, Array]:
        """Place, yaw and velocity of the path at t; it stands before the first foot lifts, and once none does any more."""
        now, begin = self._now, max(self._now.time, self._now.gait.start)
        walks = now.swinging or any(now.gait.next_swing(foot, begin) for foot in now.gait.feet)
        return now.moved(np.array([*self.velocity, self.yaw_rate]) if walks else np.zeros(3), begin, t)

    def _take_gait(self, t: float) -> None:
        """Where another gait is asked for, walk by that once all feet stand; those in the air come down as they were to."""
        now = self._now
        if now.asked is not None and vars(self._gait) == vars(now.asked):
            return
        if not now.swinging:
            now.asked, now.gait, now.renew = self._gait, self._gait.after(t), t
        elif now.gait.stop is None or now.gait.stop > t:
            now.asked, now.gait = None, replace(now.gait, stop=t)

    def _stance_at(self, t: float) -> tuple[str, ...]:
        gait = self._now.gait
        swinging = {foot for foot in gait.feet if gait.swing_of(foot, t)}
        return tuple(name for name in self._all.names if name not in swinging)

    def _begin(self, state: State, t: float) -> None:
        """Start from the measured state: the path begins in the middle of the feet."""
        yaw = yaw_of(state.frame_pose("base").rotation)
        feet = {name: state.point(name) for name in self._all.names}
        places = [feet[name][:2] - turned(nominal[:2], yaw) for name, nominal in self._nominal.items()]
        gait, place = self._gait, np.mean(places, axis=0)
        self._reference = Reference(self._standing, self._nominal, gait, gait.after(t), t, t, place, yaw, feet)
        self.history.clear()

    def _change(self, state: State, stance: tuple[str, ...]) -> None:
        """Another stance begins, or its plan ends: take the feet where they are, and plan anew."""
        now = self._now
        for foot in now.stance or stance:
            if now.time > now.landed.get(foot, -inf) + _SETTLED:
                now.feet[foot] = state.point(foot)
        self._land(state, [foot for foot in stance if foot in now.swinging])
        phases = now.gait.phases(now.time, _PHASES, _LONGEST)
        begin, until = now.phase[0] if stance == now.stance else now.time, phases[0][1]
        now.phase, now.renew, now.stance, now.footholds = (begin, until), inf, stance, {}
        if len(phases) == 1:  # it stands, and no end is in sight
            now.phase, now.renew = (begin, inf), until - _SHIFT
        now.find_ground()
        now.plan = LIPM(self._pieces(phases), state.com[:2], self.omega)
        for foot in self._all.names:
            times = now.gait.swing_of(foot, now.time) if foot in now.gait.feet else None
            if times and foot not in now.swinging:
                end, yaw = now.footholds[foot], yaw_of(state.frame_pose(foot).rotation @ self._flat_rotation(foot).T)
                path = Swing(state.point(foot), end, *times, self.clearance)
                now.swinging[foot] = Swinging(path, end, (yaw, self._path(times[1])[1]))
        self.history.append(Step(now.time, stance, dict(now.feet), dict(now.footholds), now.plan, self.swings))

    def _land(self, state: State, feet: Sequence[str]) -> None:
        """These feet have landed; the path moves along where they were moved far."""
        now, moved = self._now, []
        for foot in feet:
            each = now.swinging.pop(foot)
            now.feet[foot] = np.array([*state.point(foot)[:2], each.path.end[2]])
            moved.append((now.feet[foot] - each.planned)[:2])
            now.landed[foot] = now.time
        if not moved:
            return
        before, now.aside = now.aside, np.mean(moved, axis=0)
        aside = (before + now.aside) / 2.0  # swinging legs sway the body to one side and to the other
        if np.linalg.norm(aside) > _GIVES_WAY:
            now.place = now.place + aside

    def _pieces(self, phases: Sequence[Phase]) -> list[Piece]:
        """The ZMP of the coming phases: in the middle of the feet that stand, and shifting while all stand."""
        now, middles = self._now, self._middles(phases)
        zmp = now.plan.zmp(now.time) if now.plan else middles[0]
        pieces: list[Piece] = []
        for i, (begin, end, names) in enumerate(phases):
            everybody, last = len(names) == len(now.gait.feet), i + 1 == len(phases)
            goal = middles[i] if last or not everybody else middles[i + 1]
            if not everybody:
                pieces.append((begin, end, goal, goal))
            elif end - begin <= _SHIFT:
                pieces.append((begin, end, zmp, goal))
            elif last:  # come to the middle, and stay
                pieces += [(begin, begin + _SHIFT, zmp, goal), (begin + _SHIFT, end, goal, goal)]
            else:  # stay, then shift before the foot lifts
                pieces += [(begin, end - _SHIFT, zmp, zmp), (end - _SHIFT, end, zmp, goal)]
            zmp = goal
        return pieces

    def _middles(self, phases: Sequence[Phase]) -> list[Array]:
        """The middle of the feet that stand in each phase, (2,) m; finds the footholds of those that swing."""
        now, feet, middles = self._now, dict(self._now.feet), []
        for begin, end, names in phases:
            stance = [name for name in self._all.names if name in names or name not in now.gait.feet]
            middles.append(np.mean([self._centre(name, feet[name], now.yaw) for name in stance], axis=0))
            for foot in now.gait.feet:
                times = now.gait.swing_of(foot, begin)
                if times is not None:
                    place = as_array(f"the foothold of {foot}", self.foothold(foot, times[1], self), (2,), "m")
                    now.footholds.setdefault(foot, now.on_ground(foot, place))
                    if abs(times[1] - end) < 2.0 * SAME_TIME:
                        feet[foot] = now.on_ground(foot, place)
        return middles

    def _centre(self, foot: str, at: Array, yaw: float) -> Array:
        """Where a foot carries best, (2,) m: the middle of a sole, below the centre of a ball. at: (3,) m, of its frame."""
        contact = self._all[foot]
        below = getattr(contact, "radius", 0.0) * contact.normal  # a ball touches there however it is turned
        offset = contact.positions(self._standing).mean(axis=0) - self._standing.point(foot) + below
        return at[:2] + turned(offset[:2], yaw) - below[:2]

    def _aim(self, state: State) -> None:
        """Shift the ends of the swings by what the DCM misses of the plan, as far as the legs reach."""
        now = self._now
        if not now.swinging:
            return
        assert now.plan is not None
        error = capture_point(state.com, state.com_velocity, self.omega) - now.plan.dcm(now.time)
        dead_zone = _DEAD_ZONE if len(now.stance) > 2 or self._flat else 0.0
        for land in {each.path.land for each in now.swinging.values()}:  # feet of a trot land together
            shift = step_adjustment(error, land - now.time, self.omega, dead_zone)
            body = state.com[:2] + state.com_velocity[:2] * (land - now.time)
            for foot, each in now.swinging.items():
                if each.path.land == land:
                    end = self._within_reach(foot, each.planned[:2] + shift, body)
                    each.path = each.path.towards(now.on_ground(foot, end))

    def _within_reach(self, foot: str, end: Array, body: Array) -> Array:
        """The foothold nearest to `end`, (2,) m, that the leg reaches from the body, (2,) m, and that is on the foot's side."""
        nominal, yaw = self._nominal[foot][:2], self._now.yaw
        away = turned(end - body, -yaw) - nominal
        place = nominal + away * min(1.0, self.reach / (hypot(*away) or 1.0))
        side = copysign(1.0, nominal[1])
        place[1] = side * max(side * place[1], _OWN_SIDE * abs(nominal[1]))
        return body + turned(place, yaw)

    def _controller(self, **options: Any) -> WholeBodyController:
        """The controller of the present stance, made when it is first needed. options: more of them."""
        stance = self._now.stance
        key = (stance, bool(options))
        if key not in self._controllers:
            given = {"max_normal_force": self._loads(stance), **self._options, **options}
            self._controllers[key] = WholeBodyController(self.robot, self._all.only(*stance), self._tasks(stance), **given)
        return self._controllers[key]

    def _tasks(self, stance: Sequence[str]) -> list[Task]:
        """The tasks of a stance; their targets follow the reference."""
        (com, com_weight), (base, base_weight) = self.gains.com, self.gains.base
        (swing, swing_weight), (posture, posture_weight) = self.gains.swing, self.gains.posture
        tasks: list[Task] = [
            CoMTask(lambda t: self._now.com(t), kp=com, weight=com_weight),
            OrientationTask("base", lambda t: self._now.base(t), kp=base, weight=base_weight),
            PostureTask(self._standing.q, kp=posture, weight=posture_weight),
        ]
        for foot in set(self._all.names) - set(stance):
            tasks.append(FrameTask(foot, partial(self._foot, foot), kp=swing, weight=swing_weight))
            if foot in self._flat:
                tasks.append(OrientationTask(foot, partial(self._foot_rotation, foot), kp=swing, weight=swing_weight))
        return tasks

    def _foot(self, foot: str, t: float) -> Motion:
        return self._now.foot(foot, t)

    def _foot_rotation(self, foot: str, t: float) -> Motion:
        return self._now.foot_rotation(foot, t)

    def _flat_rotation(self, foot: str) -> Array:
        rotation: Array = self._standing.frame_pose(foot).rotation
        return rotation

    def _loads(self, stance: Sequence[str]) -> dict[str, Callable[[float], float]] | None:
        """Bounds of the normal force of each point while all feet stand, for ramps; None where a foot is in the air."""
        if self.ramp == 0.0 or len(stance) < len(self._all) or len(stance) < 2:
            return None
        return {foot: partial(self._load, foot) for foot in self._all.names}

    def _load(self, foot: str, t: float) -> float:
        most = _LOAD * self.robot.weight / len(self._all) / len(self._all[foot].point_names)
        least = float(self._limits.normal_forces(self._alone[foot], t)[0].max())
        return max(least, self._now.load(foot, t, self.ramp, most))

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles begin anew: controllers are made again, and nothing is remembered."""
        return {key: value for key, value in vars(self).items() if key not in ("_controllers", "_reference", "history")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._forget()

    def __repr__(self) -> str:
        forwards, left = self.velocity
        return f"{type(self).__name__}({self.robot.name}, {len(self.gait.feet)} feet, {forwards:g} and {left:g} m/s)"


def below_the_body(foot: str, land: float, walk: Walk) -> Array:
    """The foothold, (2,) m, of a foot that lands at `land` s: `neutral_point` below the body on its path."""
    gait = walk.gait
    return neutral_point(walk.below(foot, land), walk.velocity_at(land), gait.period - gait.swing)
