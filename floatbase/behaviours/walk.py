"""`Walk`: a controller that steps. It plans footholds and a pendulum at each change of stance, and serves them by (26)(27)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import cos, sin, sqrt
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from floatbase._arrays import Array, Value, checked, function, number, of_kind, positive
from floatbase.affine import Affine
from floatbase.behaviours.footholds import capture_point, neutral_point, step_adjustment
from floatbase.behaviours.gait import SAME_TIME, Gait
from floatbase.behaviours.lipm import LIPM, Piece
from floatbase.behaviours.swing import Swing
from floatbase.control import Command, WholeBodyController
from floatbase.dynamics import Contacts, FlatFootContact
from floatbase.errors import InfeasibleError
from floatbase.objectives import CoMTask, FrameTask, OrientationTask, PostureTask, Task
from floatbase.robots import Robot, State

Foothold: TypeAlias = Callable[[str, float, "Walk"], npt.ArrayLike]
_PHASES = 4  # stances that a plan looks ahead: two steps; eight are no better
_SHIFT = 0.8  # s before the first lift-off and after the last landing in which the ZMP moves
_SPEEDING = 1.0  # m/s² and rad/s²: a jump of the desired velocity makes robots fall
_DEAD_ZONE = 0.02  # m of DCM error that a stance with area bears without moving a step: it would grow by up to e^{ω 1.2 s}
_GIVES_WAY = 0.05  # m by which a step has moved, from which on the path moves along
_OWN_SIDE = 0.25  # part of its distance from the middle that a foot keeps to its own side: legs must not cross
_LOAD = 2.0  # times its even share of the weight: the normal force from which the ramp comes down
_HISTORY = 2000  # changes of stance that are kept: minutes of walking


@dataclass(frozen=True, eq=False)
class Gains(Value):
    """(kp in 1/s², weight) of each kind of task of a `Walk`; all are critically damped."""

    com: tuple[float, float] = (100.0, 10.0)
    base: tuple[float, float] = (100.0, 10.0)
    swing: tuple[float, float] = (900.0, 10.0)
    posture: tuple[float, float] = (100.0, 1e-2)

    @staticmethod
    def of(contacts: Contacts) -> Gains:
        """Gains that go with point feet or with flat feet."""
        flat = any(isinstance(contact, FlatFootContact) for contact in contacts)
        return Gains(com=(25.0, 10.0), base=(100.0, 100.0), swing=(400.0, 10.0)) if flat else Gains()


@dataclass(frozen=True)
class Step:
    """What a `Walk` did at one change of stance.

    time: s. stance: the feet that stand from then on. feet: (3,) m, world, where each foot's frame is. footholds: (3,) m,
    where each coming swing ends, as planned then. plan: of the centre of mass.
    """

    time: float
    stance: tuple[str, ...]
    feet: dict[str, Array]
    footholds: dict[str, Array]
    plan: LIPM


@dataclass
class _Swinging:
    """A foot in the air: where it lifted and where it was planned to land, its yaw at both, and its path now."""

    path: Swing
    planned: Array
    yaws: tuple[float, float]


@dataclass
class _Memory:
    """All that a `Walk` remembers from one tick to the next."""

    time: float  # of the last tick
    place: Array  # (2,) of the path
    yaw: float
    velocity: Array  # (3,) of the path: forwards, to the left, m/s, and yaw, rad/s, on their way to the desired ones
    feet: dict[str, Array]  # (3,) of each foot's frame, where it stands or stood
    landed: dict[str, float] = field(default_factory=dict)
    swinging: dict[str, _Swinging] = field(default_factory=dict)
    footholds: dict[str, Array] = field(default_factory=dict)
    stance: tuple[str, ...] = ()
    phase: tuple[float, float] = (0.0, 0.0)  # begin and end of the present stance
    ground: Affine = field(default_factory=lambda: Affine.linear(np.zeros((1, 2))))  # see `Walk._plane`
    plan: LIPM | None = None


class Walk:
    """Walks by a gait at a velocity: a controller like any other, for `fb.rollout`, `Live`, `fb.sweep` and `fb.push_rose`.

    At each change of stance it takes the feet where they are, plans the next footholds (`neutral_point`) and a linear inverted
    pendulum above them (`LIPM`), from where the centre of mass is. At each tick it moves the ends of the swings by
    `step_adjustment`, as far as the legs reach. One `WholeBodyController` for each stance does the rest. When the clock goes
    back it begins anew from the measured state.

    robot: the robot; its feet are point feet or flat feet.
    contacts: all its contacts; `Contacts.feet(robot)` fits.
    gait: when each foot is in the air; may be set while it walks.
    velocity: (2,) m/s, forwards and to the left, of the body; may be set while it walks, and is approached by 1 m/s².
    yaw_rate: rad/s, to the left; as velocity.
    clearance: m, how high feet are lifted.
    reach: m, how far a foot may land from where it would stand below the body; 0.2 by default, 0.3 for flat feet.
    ramp: s, in which a foot is unloaded before it lifts, and loaded after it landed, as far as all feet stand then.
    foothold: (foot, land in s, walk) -> (2,) m, world: where a foot should land, before adjustments; `neutral_point` below the
        body by default.
    gains: of its tasks; `Gains.of(contacts)` by default.
    options: more arguments of `fb.WholeBodyController`, such as facets.

    `stance`, `footholds`, `plan` and `history` tell what it is doing. Raises `InputError` for arguments that do not fit.
    """

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
        self.robot, self._all = of_kind("robot", robot, Robot), of_kind("contacts", contacts, Contacts)
        self.velocity, self.yaw_rate = velocity, yaw_rate
        self.clearance = positive("clearance", clearance, "m", allow_zero=True)
        self._flat = {contact.name for contact in contacts if isinstance(contact, FlatFootContact)}
        self.reach = positive("reach", (0.3 if self._flat else 0.2) if reach is None else reach, "m")
        self.ramp = positive("ramp", ramp, "s", allow_zero=True)
        self.foothold = below_the_body if foothold is None else function("foothold", foothold, "foothold(foot, land, walk)")
        self.gains = Gains.of(contacts) if gains is None else of_kind("gains", gains, Gains)
        self._options = options
        self.gait = gait
        self._standing = standing = robot.standing()
        origins = {contact.name: standing.point(contact.name) for contact in contacts}
        middle = np.mean([self._centre(name, origin, 0.0) for name, origin in origins.items()], axis=0)
        self._nominal = {name: origin - [*middle, 0.0] for name, origin in origins.items()}
        self.omega = sqrt(robot.gravity / (standing.com[2] - float(contacts.positions(standing)[:, 2].mean())))
        self._controllers: dict[tuple[tuple[str, ...], bool], WholeBodyController] = {}
        self._memory: _Memory | None = None
        self.history: deque[Step] = deque(maxlen=_HISTORY)

    @property
    def gait(self) -> Gait:
        """When each foot is in the air."""
        return self._gait

    @gait.setter
    def gait(self, gait: Gait) -> None:
        of_kind("gait", gait, Gait, "Gait.trot(robot)")
        for foot in gait.feet:
            self._all[foot]  # an UnknownNameError tells what there is
        self._gait = gait

    @property
    def velocity(self) -> Array:
        """(2,) m/s, forwards and to the left, that is desired."""
        return self._velocity

    @velocity.setter
    def velocity(self, velocity: npt.ArrayLike) -> None:
        self._velocity = checked("velocity", velocity, (2,), "m/s")

    @property
    def yaw_rate(self) -> float:
        """rad/s, to the left, that is desired."""
        return self._yaw_rate

    @yaw_rate.setter
    def yaw_rate(self, yaw_rate: float) -> None:
        self._yaw_rate = number("yaw_rate", yaw_rate, "rad/s")

    @property
    def stance(self) -> tuple[str, ...]:
        """The feet that stand now."""
        return self._memory.stance if self._memory else self._all.names

    @property
    def contacts(self) -> Contacts:
        """The contacts of the present stance."""
        key = (self.stance, False)
        return self._controllers[key].contacts if key in self._controllers else self._all

    @property
    def footholds(self) -> dict[str, Array]:
        """Where each foot that is in the air, or lifts next, is to land: (3,) m, world, of its frame."""
        memory = self._memory
        if memory is None:
            return {}
        return {**memory.footholds, **{foot: each.path.end for foot, each in memory.swinging.items()}}

    @property
    def swings(self) -> dict[str, Swing]:
        """The paths of the feet that are in the air."""
        return {} if self._memory is None else {foot: each.path for foot, each in self._memory.swinging.items()}

    @property
    def plan(self) -> LIPM | None:
        """The plan of the centre of mass, horizontally; None before the first tick."""
        return None if self._memory is None else self._memory.plan

    def path(self, t: float) -> tuple[Array, float]:
        """Where the body is to be at time t in s, (2,) m, world, and its yaw, rad, if the desired velocity goes on."""
        m = self._began
        moved, _ = self._moved(t)
        return m.place + _turned(moved[:2], m.yaw + moved[2] / 2.0), m.yaw + moved[2]

    def below(self, foot: str, t: float) -> Array:
        """Where a foot would stand below the body at time t in s, (2,) m, world."""
        place, yaw = self.path(t)
        return place + _turned(self._nominal[foot][:2], yaw)

    def __call__(self, q: npt.ArrayLike, v: npt.ArrayLike, t: float = 0.0) -> Command:
        """The tick: torques for configuration q, shape (nq,), and velocity v, shape (nv,), at time t in s."""
        state = State(self.robot, q, checked("v", v, (self.robot.nv,)))
        t = number("t", t, "s")
        if self._memory is None or t < self._memory.time - SAME_TIME:
            self._begin(state, t)
        self._advance(t)
        stance = self._stance_at(t)
        if stance != self._began.stance:
            self._change(state, t, stance)
        self._aim(state, t)
        try:
            return self._controller()(q, v, t)
        except InfeasibleError:  # torques and friction do not hold the feet
            return self._controller(contact_weight=_GIVES)(q, v, t)

    @property
    def _began(self) -> _Memory:
        assert self._memory is not None  # from the first tick on
        return self._memory

    def _stance_at(self, t: float) -> tuple[str, ...]:
        swinging = {foot for foot in self.gait.feet if self.gait.swing_of(foot, t)}
        return tuple(name for name in self._all.names if name not in swinging)

    def _begin(self, state: State, t: float) -> None:
        """Start from the measured state: the path begins in the middle of the feet."""
        R = state.frame_pose("base").rotation
        yaw = float(np.arctan2(R[1, 0], R[0, 0]))
        feet = {name: state.point(name) for name in self._all.names}
        offsets = [feet[name][:2] - _turned(nominal[:2], yaw) for name, nominal in self._nominal.items()]
        self._memory = _Memory(t, np.mean(offsets, axis=0), yaw, np.zeros(3), feet)
        self.history.clear()

    def _advance(self, t: float) -> None:
        """Move the path on to time t."""
        m = self._began
        place, yaw = self.path(t)
        m.velocity = self._moved(t)[1]
        m.place, m.yaw, m.time = place, yaw, t

    def _moved(self, t: float) -> tuple[Array, Array]:
        """How far the path goes until t, (3,) forwards, to the left, turned, and its velocity then.

        It approaches the desired velocity, which is zero before the first foot lifts and once none does any more.
        """
        m = self._began
        begin = max(m.time, self.gait.start)
        walks = m.swinging or any(self.gait.next_swing(foot, begin) for foot in self.gait.feet)
        desired = np.array([*self.velocity, self.yaw_rate]) if walks else np.zeros(3)
        time = max(0.0, t - begin)
        change = desired - m.velocity
        rising = np.minimum(time, np.abs(change) / _SPEEDING)  # s, of each part
        velocity = m.velocity + np.sign(change) * _SPEEDING * rising
        return (m.velocity + velocity) / 2.0 * rising + velocity * (time - rising), velocity

    def _change(self, state: State, t: float, stance: tuple[str, ...]) -> None:
        """Another stance begins: take the feet where they are, and plan anew."""
        m = self._began
        moved = []
        for foot in m.stance or stance:
            m.feet[foot] = state.point(foot)
        for foot in set(stance) & set(m.swinging):
            path, planned = m.swinging[foot].path, m.swinging[foot].planned
            # how high it stands shows when it has stood for a while: feet that aim where others just touched climb
            m.feet[foot] = np.array([*state.point(foot)[:2], path.end[2]])
            moved.append((m.feet[foot] - planned)[:2])
            m.landed[foot] = t
            del m.swinging[foot]
        aside = np.mean(moved, axis=0) if moved else np.zeros(2)
        if np.linalg.norm(aside) > _GIVES_WAY:  # or the robot runs back to its path, and falls
            m.place = m.place + aside
        phases = self.gait.phases(t, _PHASES)
        m.stance, m.phase, m.footholds = stance, (phases[0][0], phases[0][1]), {}
        m.ground = self._plane()
        m.plan = LIPM(self._pieces(state, t, phases), state.com[:2], self.omega)
        for foot in set(self._all.names) - set(stance) - set(m.swinging):
            lift, land = self.gait.swing_of(foot, t) or (t, t + self.gait.swing)
            start, end = state.point(foot), m.footholds[foot]
            yaws = self._foot_yaw(state, foot), self.path(land)[1]
            m.swinging[foot] = _Swinging(Swing(start, end, lift, land, self.clearance), end, yaws)
        self.history.append(Step(t, stance, dict(m.feet), dict(m.footholds), m.plan))

    def _pieces(self, state: State, t: float, phases: Sequence[tuple[float, float, tuple[str, ...]]]) -> list[Piece]:
        """The ZMP of the coming phases, in the middle of the feet that stand; it shifts while all stand. Finds footholds."""
        m, feet = self._began, dict(self._began.feet)
        middles = []
        for begin, end, names in phases:
            stance = [name for name in self._all.names if name in names or name not in self.gait.feet]
            middles.append(np.mean([self._centre(name, feet[name], m.yaw) for name in stance], axis=0))
            for foot in set(self._all.names) - set(stance):
                swing = self.gait.swing_of(foot, begin)
                if swing and abs(swing[1] - end) < 2.0 * SAME_TIME:
                    feet[foot] = self._foothold(foot, swing[1])
                if swing and foot not in m.footholds:
                    m.footholds[foot] = self._foothold(foot, swing[1])
        zmp = m.plan.zmp(t) if m.plan else middles[0]
        pieces: list[Piece] = []
        for i, (begin, end, names) in enumerate(phases):
            everybody = len(names) == len(self.gait.feet)
            goal = middles[i + 1] if everybody and i + 1 < len(phases) else middles[i]
            if not everybody:
                pieces.append((begin, end, goal, goal))
            elif end - begin <= _SHIFT:
                pieces.append((begin, end, zmp, goal))
            elif i + 1 < len(phases):  # stay, then shift before the foot lifts
                pieces += [(begin, end - _SHIFT, zmp, zmp), (end - _SHIFT, end, zmp, goal)]
            else:  # come to the middle, and stay
                pieces += [(begin, begin + _SHIFT, zmp, goal), (begin + _SHIFT, end, goal, goal)]
            zmp = goal
        return pieces

    def _foothold(self, foot: str, land: float) -> Array:
        """Where a foot is to land, (3,) m, world: on the plane through the feet as they stand or stood."""
        xy = checked(f"the foothold of {foot}", self.foothold(foot, land, self), (2,), "m")
        return self._on_ground(foot, xy)

    def _on_ground(self, foot: str, xy: Array) -> Array:
        """Where a foot's frame is when it stands at (2,) m, (3,) m, world."""
        return np.array([*xy, self._nominal[foot][2] + self._began.ground(xy)[0]])

    def _plane(self) -> Affine:
        """The ground as a plane through the feet as they stand or stood: (2,) m, world, to its height, (1,) m.

        0 is where they stand in the robot's posture. A slope that the feet do not show, as across a line, counts as none.
        """
        m = self._began
        heights = np.array([m.feet[foot][2] - nominal[2] for foot, nominal in self._nominal.items()])
        places = np.array([m.feet[foot][:2] for foot in self._nominal])
        middle = places.mean(axis=0)
        slope = np.linalg.lstsq(places - middle, heights - heights.mean(), rcond=_THIN)[0]
        return Affine(slope[None], [heights.mean() - slope @ middle])

    def _centre(self, foot: str, at: Array, yaw: float) -> Array:
        """Where a foot carries best, (2,) m: the middle of a sole, below the centre of a ball. at: (3,) m, of its frame."""
        offset = self._all[foot].positions(self._standing).mean(axis=0) - self._standing.point(foot)
        return at[:2] + _turned(offset[:2], yaw)

    def _foot_yaw(self, state: State, foot: str) -> float:
        """Yaw of a foot against its yaw in the standing posture, rad."""
        R = state.frame_pose(foot).rotation @ self._standing.frame_pose(foot).rotation.T
        return float(np.arctan2(R[1, 0], R[0, 0]))

    def _aim(self, state: State, t: float) -> None:
        """Shift the ends of the swings by what the DCM misses of the plan, as far as the legs reach."""
        m = self._began
        if not m.swinging:
            return
        assert m.plan is not None
        error = capture_point(state.com, state.com_velocity, self.omega) - m.plan.dcm(t)
        area = len(m.stance) > 2 or bool(self._flat)
        for foot, each in m.swinging.items():
            left = each.path.land - t
            shift = step_adjustment(error, left, self.omega, _DEAD_ZONE if area else 0.0)
            end = self._within_reach(foot, each.planned[:2] + shift, state.com[:2] + state.com_velocity[:2] * left)
            each.path = replace(each.path, end=self._on_ground(foot, end))

    def _within_reach(self, foot: str, end: Array, body: Array) -> Array:
        """The foothold nearest to `end`, (2,) m, that the leg reaches from the body, (2,) m, and that is on the foot's side."""
        nominal, yaw = self._nominal[foot][:2], self._began.yaw
        away = _turned(end - body, -yaw) - nominal
        away = away * min(1.0, self.reach / (float(np.linalg.norm(away)) or 1.0))
        side = np.sign(nominal[1])
        place = nominal + away
        place[1] = side * max(side * place[1], _OWN_SIDE * abs(nominal[1]))
        return body + _turned(place, yaw)

    def _controller(self, **options: Any) -> WholeBodyController:
        """The controller of the present stance, made when it is first needed. options: more of them."""
        stance = self._began.stance
        key = (stance, bool(options))
        if key not in self._controllers:
            self._controllers[key] = WholeBodyController(
                self.robot,
                self._all.only(*stance),
                self._tasks(stance),
                max_normal_force=self._loads(stance),
                **self._options,
                **options,
            )
        return self._controllers[key]

    def _tasks(self, stance: Sequence[str]) -> list[Task]:
        """The tasks of a stance; their targets follow the plan."""
        gains = self.gains
        tasks: list[Task] = [
            CoMTask(self._com_at, kp=gains.com[0], weight=gains.com[1]),
            OrientationTask("base", self._base_at, kp=gains.base[0], weight=gains.base[1]),
            PostureTask(self._standing.q, kp=gains.posture[0], weight=gains.posture[1]),
        ]
        for foot in set(self._all.names) - set(stance):
            tasks.append(FrameTask(foot, self._foot_path(foot), kp=gains.swing[0], weight=gains.swing[1]))
            if foot in self._flat:
                tasks.append(OrientationTask(foot, self._foot_turn(foot), kp=gains.swing[0], weight=gains.swing[1]))
        return tasks

    def _com_at(self, t: float) -> tuple[Array, Array, Array]:
        m = self._began
        assert m.plan is not None
        x, v, a = m.plan(t)
        slope = m.ground.A[0]
        height, rise, bend = self._standing.com[2] + m.ground(x)[0], slope @ v, slope @ a
        return np.array([*x, height]), np.array([*v, rise]), np.array([*a, bend])

    def _base_at(self, t: float) -> tuple[Array, Array, Array]:
        yaw = self.path(t)[1]
        turned = _about_z(yaw) @ self._standing.frame_pose("base").rotation
        return turned, np.array([0.0, 0.0, self._began.velocity[2]]), np.zeros(3)

    def _foot_path(self, foot: str) -> Callable[[float], tuple[Array, Array, Array]]:
        return lambda t: self._began.swinging[foot].path(t)

    def _foot_turn(self, foot: str) -> Callable[[float], tuple[Array, Array, Array]]:
        flat = self._standing.frame_pose(foot).rotation

        def turn(t: float) -> tuple[Array, Array, Array]:
            each = self._began.swinging[foot]
            first, last = each.yaws
            along = Swing(np.zeros(3), np.array([0.0, 0.0, 1.0]), each.path.lift, each.path.land, 0.0)(t)
            (_, _, s), rate, acceleration = along
            return _about_z(first + s * (last - first)) @ flat, (last - first) * rate, (last - first) * acceleration

        return turn

    def _loads(self, stance: Sequence[str]) -> dict[str, Callable[[float], float]] | None:
        """Bounds of normal forces at each point while all feet stand, for a ramp; None where a foot is in the air."""
        if self.ramp == 0.0 or len(stance) < len(self._all) or len(stance) < 2:
            return None
        return {name: self._load_of(name) for name in stance if name in self.gait.feet}

    def _load_of(self, foot: str) -> Callable[[float], float]:
        points = len(self._all[foot].point_names)
        most = _LOAD * self.robot.weight / len(self._all) / points

        def load(t: float) -> float:
            m = self._began
            begin, end = m.phase
            ramp = min(self.ramp, (end - begin) / 2.0)
            lifts = self.gait.swing_of(foot, end + SAME_TIME) is not None
            landed = m.landed.get(foot, -np.inf) >= begin - SAME_TIME
            part = min((end - t) / ramp if lifts else np.inf, (t - begin) / ramp if landed else np.inf)
            return most * max(part, 0.0) if part < 1.0 else _FREE

        return load

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles begin anew: controllers are made again, and nothing is remembered."""
        return {**vars(self), "_controllers": {}, "_memory": None, "history": deque(maxlen=_HISTORY)}

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.robot.name}, {len(self.gait.feet)} feet, {self.velocity[0]:g} m/s)"


def below_the_body(foot: str, land: float, walk: Walk) -> Array:
    """The foothold of a foot that lands at `land` s: `neutral_point` below the body on its path."""
    gait, (_, yaw) = walk.gait, walk.path(land)
    velocity = _turned(walk._moved(land)[1][:2], yaw)
    return neutral_point(walk.below(foot, land), velocity, gait.period - gait.swing)


_THIN = 1e-3  # part of the feet's extent: what is thinner shows no slope
_GIVES = 1e4  # weight of contacts that must give way, beside 10 of the tasks
_FREE = 1e6  # N: a bound that no robot of the catalogue reaches


def _turned(vector: Array, yaw: float) -> Array:
    """A horizontal vector, (2,), turned to the left by yaw, rad."""
    c, s = cos(yaw), sin(yaw)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def _about_z(yaw: float) -> Array:
    c, s = cos(yaw), sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
