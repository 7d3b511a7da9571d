"""Lesson X, The crash investigation: robots that twist with one fault each, on the physics, until
they fall.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, TypeAlias

import numpy as np

import floatbase as fb
from floatbase._validation import Array, as_integer
from floatbase.actuators import FirstOrderLag
from floatbase.control import Command, ModelMismatch
from floatbase.errors import unknown_name
from floatbase.lessons.lesson06 import state_with_feet_at
from floatbase.lessons.lessonA import elliptic_rotation
from floatbase.lessons.lessonX.black_box import BlackBox
from floatbase.objectives import Task
from floatbase.simulation import Actuators, Rollout

MU = 1.2  # friction that controllers are told: rubber on a rough mat
KP_COM, KP_BASE, FACETS = (
    6.0,
    30.0,
    8,
)  # a gentle robot: what the equations get wrong, gains hardly mend
PERIOD, SECONDS = 2e-3, 3.0  # s: of a tick, and of a record
DRIFT_TIME = 0.5  # s, in which forgotten drift is measured: nothing has slid far yet
LOOPS = 10  # of the twist: more than a record has
LARGEST_SEED, TRIES = 10**9, 4

Fault: TypeAlias = Literal["friction", "normal", "mass", "drift", "slow motors", "swapped motors"]
FAULTS: tuple[Fault, ...] = ("friction", "normal", "mass", "drift", "slow motors", "swapped motors")


@dataclass(frozen=True)
class Twist:
    """What a robot was to do and where.

    pitch, yaw: rad, half the widths of the ellipse that its base describes. rate: loops for each
        second. direction: 1 or -1.
    tilt: degrees of the ground. heading: rad, where it rises least: the horizontal direction of its
        normal.
    """

    pitch: float = 0.22
    yaw: float = 0.45
    rate: float = 2.3
    direction: int = 1
    tilt: float = 0.0
    heading: float = 0.0

    @staticmethod
    def random(rng: np.random.Generator) -> Twist:
        """One by chance."""
        pitch, way = rng.uniform(0.2, 0.25), int(rng.choice([-1, 1]))
        yaw, rate = (
            0.44 + 0.6 * (0.25 - pitch),
            rng.uniform(2.28, 2.32),
        )  # about as fast as friction allows
        return Twist(pitch, yaw, rate, way, rng.uniform(0.0, 4.0), rng.uniform(0.0, 2.0 * np.pi))

    @property
    def normal(self) -> Array:
        """Of the ground, world."""
        return tilted(np.array([0.0, 0.0, 1.0]), self.tilt, self.heading)


def tilted(normal: Array, degrees: float, heading: float) -> Array:
    """A unit vector turned by so many degrees towards a horizontal direction, rad."""
    aside = np.array([np.cos(heading), np.sin(heading), 0.0])
    aside -= (aside @ normal) * normal
    angle = np.deg2rad(degrees)
    return np.asarray(np.cos(angle) * normal + np.sin(angle) * aside / np.linalg.norm(aside))


class TwistController:
    """A controller that remembers the accelerations it planned, and lets feet give way where
    nothing holds them.
    """

    def __init__(
        self, state: fb.State, contacts: fb.Contacts, twist: Twist, mismatch: ModelMismatch
    ):
        path = elliptic_rotation(twist.pitch, twist.yaw, twist.rate, LOOPS, 90.0 * twist.direction)
        tasks: list[Task] = [
            fb.CoMTask(state.com, kp=KP_COM),
            fb.OrientationTask("base", path, kp=KP_BASE),
            fb.PostureTask(state.q),
        ]
        self.contacts, self.planned = contacts, list[Array]()
        self._controller = fb.WholeBodyController(
            state.robot, contacts, tasks, facets=FACETS, mismatch=mismatch, on_infeasible="soften"
        )

    def __call__(self, q: Array, v: Array, t: float) -> Command:
        command = self._controller(q, v, t)
        self.planned.append(command.qdd)
        return command


class SwappedMotors:
    """Two motors whose cables were swapped: each does what the other is told. `first`, `second`:
    their numbers.
    """

    def __init__(self, d: int, first: int, second: int):
        self.order = np.arange(d)
        self.order[[first, second]] = second, first

    def step(self, tau_desired: Array, q_joints: Array, v_joints: Array, dt: float) -> Array:
        """The torques of the next dt s, (d,) N·m, for those desired."""
        return tau_desired[self.order]


@dataclass(frozen=True)
class InjectedFault:
    """What was wrong; by default nothing.

    kind: its name.
    size: of "friction" the true coefficient, of "normal" degrees between the one told and the true
        one, of "mass" the believed one as a multiple of the true one, of "slow motors" their time
        constant, ms.
    heading: rad, of "normal": to where the one told is turned.
    joints: of "swapped motors", two names.
    """

    kind: Fault | None = None
    size: float = 0.0
    heading: float = 0.0
    joints: tuple[str, str] = ("", "")

    @staticmethod
    def random(fault: Fault, rng: np.random.Generator) -> InjectedFault:
        """One of this kind by chance."""
        low, high = {
            "friction": (0.4, 0.7),
            "normal": (16.0, 22.0),
            "mass": (0.15, 0.25),
            "slow motors": (30.0, 70.0),
        }.get(fault, (0.0, 0.0))
        size, heading = float(rng.uniform(low, high)), float(rng.uniform(0.0, 2.0 * np.pi))
        if fault == "mass":
            size = 1.0 + size * float(rng.choice([-1.0, 1.0]))
        names = fb.load("go2").joint_names
        first, second = sorted(int(i) for i in rng.choice(len(names), 2, replace=False))
        return InjectedFault(fault, size, heading, (names[first], names[second]))


def record_box(
    name: str,
    twist: Twist,
    injected_fault: InjectedFault,
    pushes: tuple[fb.Push, ...] = (),
    seconds: float = SECONDS,
) -> BlackBox:
    """The record of go2 that twists while something is wrong, until it falls or so many seconds are
    over.
    """
    robot, fault = fb.load("go2"), injected_fault.kind
    mu = injected_fault.size if fault == "friction" else MU
    told = (
        tilted(twist.normal, injected_fault.size, injected_fault.heading)
        if fault == "normal"
        else twist.normal
    )
    contacts = fb.Contacts.points(robot, MU, normals=told)
    state = standing_on(robot, twist.normal)
    mismatch = ModelMismatch(
        mass=injected_fault.size if fault == "mass" else 1.0, drift=fault != "drift"
    )
    pilot = TwistController(state, contacts, twist, mismatch)
    actuators = faulty_motors(robot, injected_fault, pilot(state.q, state.v, 0.0).tau)
    pilot.planned.clear()
    sim = fb.Simulation(robot, fb.Ground(mu, normal=twist.normal))
    sim.reset(state)
    record = fb.rollout(sim, pilot, seconds, pushes, PERIOD, actuators)
    return black_box_of(name, record, np.array(pilot.planned[: len(record)]))


def faulty_motors(robot: fb.Robot, injected_fault: InjectedFault, tau: Array) -> Actuators | None:
    """What stands between orders and joints; None where nothing does. tau: (d,) N·m, with which the
    robot stands at first.
    """
    if injected_fault.kind == "slow motors":
        lag = FirstOrderLag(robot, 1e3 / (2.0 * np.pi * injected_fault.size))
        lag.reset(tau)
        return lag
    if injected_fault.kind == "swapped motors":
        first, second = (robot.joint_names.index(joint) for joint in injected_fault.joints)
        return SwappedMotors(robot.d, first, second)
    return None


def standing_on(robot: fb.Robot, normal: Array) -> fb.State:
    """A level robot above a tilted ground, with each foot on it straight below or above where it
    stands usually.
    """
    home, centres = robot.standing(), {}
    for foot in robot.feet:
        touch = np.array(home.point(foot.frame))
        touch[2] = -(normal[:2] @ touch[:2]) / normal[2]
        centres[foot.frame] = touch + foot.radius * normal
    return state_with_feet_at(robot, home.q[:3], centres)


def black_box_of(name: str, record: Rollout, qdd: Array) -> BlackBox:
    """What a record leaves to an investigation. qdd: (n, nv), as the controller planned."""
    return BlackBox(
        name, record.robot, record.contacts, record.time, record.q, record.v, record.measured,
        record.tau_desired,
        record.planned, qdd,
    )  # fmt: skip


@dataclass(frozen=True)
class Case:
    """One case as it was drawn: what the investigation does not know.

    name: of the box. twists: by chance; the first that ends as it `falls` counts. injected_fault:
        what was wrong. pushes: kicks.
    """

    name: str
    twists: tuple[Twist, ...]
    injected_fault: InjectedFault
    pushes: tuple[fb.Push, ...] = ()

    @property
    def falls(self) -> bool:
        """Whether the robot is to fall."""
        return bool(self.injected_fault.kind or self.pushes)

    def record(self) -> BlackBox:
        """What it leaves to the investigation. One forgotten drift in twenty is survived by good
        luck, and is tried again.
        """
        for twist in self.twists:
            box = record_box(self.name, twist, self.injected_fault, self.pushes)
            if box.fell == self.falls:
                break
        return box


def random_cases(seed: int) -> tuple[Case, ...]:
    """Six cases by chance, one of each fault, in an order by chance. The same for the same seed, a
    whole number.
    """
    rng = np.random.default_rng([as_integer("seed", seed, 0, LARGEST_SEED), 6])
    order = [FAULTS[i] for i in rng.permutation(len(FAULTS))]
    return tuple(
        Case(name, random_twists(rng), InjectedFault.random(fault, rng))
        for name, fault in zip("ABCDEF", order, strict=True)
    )


def faultless_cases(seed: int) -> tuple[Case, ...]:
    """Two cases by chance without a fault: in the second somebody kicks the robot over."""
    rng = np.random.default_rng([as_integer("seed", seed, 0, LARGEST_SEED), 2])
    return Case("N", random_twists(rng), InjectedFault()), Case(
        "K", random_twists(rng), InjectedFault(), (random_kick(rng),)
    )


def random_twists(rng: np.random.Generator) -> tuple[Twist, ...]:
    """Some by chance."""
    return tuple(Twist.random(rng) for _ in range(TRIES))


def random_kick(rng: np.random.Generator) -> fb.Push:
    """A kick by chance, hard enough to fell go2."""
    angle, force = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(260.0, 320.0)
    return fb.Push(
        force * np.array([np.cos(angle), np.sin(angle), 0.0]), start=float(rng.uniform(0.4, 0.8))
    )


@lru_cache(maxsize=8)
def black_boxes(seed: int) -> tuple[BlackBox, ...]:
    """The black boxes of six falls, A to F, each with one fault of `FAULTS`; other seeds, other
    boxes.

    seed: a whole number.
    """
    return tuple(case.record() for case in random_cases(seed))


@lru_cache(maxsize=8)
def faultless_boxes(seed: int) -> tuple[BlackBox, ...]:
    """The black boxes of two robots without a fault: N twists to the end, K is kicked over. seed: a
    whole number.
    """
    return tuple(case.record() for case in faultless_cases(seed))


def crash_test(
    fault: Fault | None = None,
    size: float = 0.0,
    joints: tuple[str, str] = ("", ""),
    seconds: float = SECONDS,
) -> BlackBox:
    """A crash of our own, whose fault we know, to try instruments on.

    fault: one of `FAULTS`; None for a robot without.
    size, joints: of the fault, see `InjectedFault`.
    seconds: of the record, unless it ends in a fall before.
    """
    if fault is not None and fault not in FAULTS:
        raise unknown_name("fault", fault, FAULTS)
    return record_box("our own", Twist(), InjectedFault(fault, size, 0.0, joints), seconds=seconds)


def case_zero() -> BlackBox:
    """The case that the lesson solves."""
    return record_box("0", Twist(), InjectedFault("slow motors", 45.0))
