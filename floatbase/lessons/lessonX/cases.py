"""Lesson X: simulations of robots that twist with one fault each, until they fall."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Literal, TypeAlias

import numpy as np

import floatbase as fb
from floatbase._validation import Array, as_integer
from floatbase.actuators import FirstOrderLag
from floatbase.errors import unknown_name
from floatbase.lessons.lesson06 import state_with_feet_at
from floatbase.lessons.lessonA import elliptic_rotation
from floatbase.lessons.lessonX.black_box import BlackBox
from floatbase.objectives import Task
from floatbase.playground import ModelMismatch
from floatbase.simulation import Actuators, Rollout

MU = 1.2  # friction coefficient that controllers assume: rubber on a rough mat
# low gains: they hardly correct what the equations get wrong
KP_COM, KP_BASE, FACETS = 6.0, 30.0, 8
PERIOD, SECONDS = 2e-3, 3.0  # s: control period, and duration of a record
DRIFT_TIME = 0.5  # s, in which a forgotten drift is measured: nothing has slid far yet
LOOPS = 10  # of the twist: more than fit into a record
LARGEST_SEED, TRIES = 10**9, 4

Fault: TypeAlias = Literal["friction", "normal", "mass", "drift", "slow motors", "swapped motors"]
FAULTS: tuple[Fault, ...] = ("friction", "normal", "mass", "drift", "slow motors", "swapped motors")


@dataclass(frozen=True)
class Twist:
    """Motion that a robot was supposed to perform, and the slope on which it stood."""

    pitch: float = 0.22
    yaw: float = 0.45
    rate: float = 2.3
    direction: int = 1
    tilt: float = 0.0
    heading: float = 0.0

    @staticmethod
    def random(rng: np.random.Generator) -> Twist:
        """Return a random motion."""
        pitch, way = rng.uniform(0.2, 0.25), int(rng.choice([-1, 1]))
        # about as fast as friction allows
        yaw, rate = 0.44 + 0.6 * (0.25 - pitch), rng.uniform(2.28, 2.32)
        return Twist(pitch, yaw, rate, way, rng.uniform(0.0, 4.0), rng.uniform(0.0, 2.0 * np.pi))

    @property
    def normal(self) -> Array:
        """Normal of the ground, shape (3,), world frame."""
        return tilted(np.array([0.0, 0.0, 1.0]), self.tilt, self.heading)


def tilted(normal: Array, degrees: float, heading: float) -> Array:
    """Turn a unit vector by an angle [°] towards a horizontal direction [rad]."""
    aside = np.array([np.cos(heading), np.sin(heading), 0.0])
    aside -= (aside @ normal) * normal
    angle = np.deg2rad(degrees)
    return np.asarray(np.cos(angle) * normal + np.sin(angle) * aside / np.linalg.norm(aside))


def twist_controller(
    state: fb.State, contacts: fb.Contacts, twist: Twist, mismatch: ModelMismatch
) -> fb.WholeBodyController:
    """Return a controller that twists the robot and softens contacts if it must."""
    path = elliptic_rotation(twist.pitch, twist.yaw, twist.rate, LOOPS, 90.0 * twist.direction)
    tasks: list[Task] = [
        fb.CoMTask(state.com, kp=KP_COM),
        fb.OrientationTask("base", path, kp=KP_BASE),
        fb.PostureTask(state.q),
    ]
    return fb.WholeBodyController(
        state.robot,
        contacts,
        tasks,
        facets=FACETS,
        modify_qp=None if mismatch.is_exact else mismatch,
        on_infeasible="soften",
        joint_limits=None,  # the record shows what the faults do, down to the joints' stops
    )


class SwappedMotors:
    """Actuators with the cables of two motors swapped, so that each gets the other's command."""

    def __init__(self, d: int, first: int, second: int):
        self.order = np.arange(d)
        self.order[[first, second]] = second, first

    def step(self, tau_desired: Array, q_joints: Array, v_joints: Array, dt: float) -> Array:
        """Return the torques of the next dt, shape (d,) [N·m], for the desired torques."""
        return tau_desired[self.order]


@dataclass(frozen=True)
class InjectedFault:
    """Fault of a robot or its controller; none by default."""

    kind: Fault | None = None
    size: float = 0.0
    heading: float = 0.0
    joints: tuple[str, str] = ("", "")

    @staticmethod
    def random(fault: Fault, rng: np.random.Generator) -> InjectedFault:
        """Return a random fault of this kind."""
        low, high = {
            "friction": (0.4, 0.7),
            "normal": (16.0, 22.0),
            "mass": (0.15, 0.25),
            "slow motors": (30.0, 70.0),
        }.get(fault, (0.0, 0.0))
        size, heading = float(rng.uniform(low, high)), float(rng.uniform(0.0, 2.0 * np.pi))
        if fault == "mass":
            size = 1.0 + size * float(rng.choice([-1.0, 1.0]))
        names = _joint_names()
        first, second = sorted(int(i) for i in rng.choice(len(names), 2, replace=False))
        return InjectedFault(fault, size, heading, (names[first], names[second]))


@cache
def _joint_names() -> Sequence[str]:
    return fb.load("go2").joint_names


def record_box(
    name: str,
    twist: Twist,
    injected_fault: InjectedFault,
    pushes: tuple[fb.Push, ...] = (),
    seconds: float = SECONDS,
) -> BlackBox:
    """Simulate a twisting go2 with a fault, until it falls or the time [s] is over."""
    robot, fault = fb.load("go2"), injected_fault.kind
    mu = injected_fault.size if fault == "friction" else MU
    assumed = (
        tilted(twist.normal, injected_fault.size, injected_fault.heading)
        if fault == "normal"
        else twist.normal
    )
    contacts = fb.Contacts.points(robot, MU, normals=assumed)
    state = standing_on(robot, twist.normal)
    mismatch = ModelMismatch(
        mass=injected_fault.size if fault == "mass" else 1.0, drift=fault != "drift"
    )
    pilot = twist_controller(state, contacts, twist, mismatch)
    actuators = faulty_motors(robot, injected_fault, pilot(state.q, state.v, 0.0).tau)
    sim = fb.Simulation(robot, fb.Ground(mu, normal=twist.normal))
    sim.reset(state)
    record = fb.rollout(sim, pilot, seconds, pushes, PERIOD, actuators)
    return black_box_of(name, record)


def faulty_motors(robot: fb.Robot, injected_fault: InjectedFault, tau: Array) -> Actuators | None:
    """Return actuators with the fault or None; tau: first torques, shape (d,) [N·m]."""
    if injected_fault.kind == "slow motors":
        lag = FirstOrderLag(robot, 1e3 / (2.0 * np.pi * injected_fault.size))
        lag.reset(tau)
        return lag
    if injected_fault.kind == "swapped motors":
        first, second = (robot.joint_names.index(joint) for joint in injected_fault.joints)
        return SwappedMotors(robot.d, first, second)
    return None


def standing_on(robot: fb.Robot, normal: Array) -> fb.State:
    """Return a level robot on tilted ground, each foot vertically above or below its place."""
    home, centres = robot.standing(), {}
    for foot in robot.feet:
        touch = np.array(home.point(foot.frame))
        touch[2] = -(normal[:2] @ touch[:2]) / normal[2]
        centres[foot.frame] = touch + foot.radius * normal
    return state_with_feet_at(robot, home.q[:3], centres)


def black_box_of(name: str, record: Rollout) -> BlackBox:
    """Return the part of a record that an investigation may use."""
    return BlackBox(
        name, record.robot, record.contacts, record.time, record.q, record.v, record.measured,
        record.tau_desired,
        record.planned, np.array(record.planned_qdd),
    )  # fmt: skip


@dataclass(frozen=True)
class Case:
    """Randomly drawn case, whose fault the investigation does not know."""

    name: str
    twists: tuple[Twist, ...]
    injected_fault: InjectedFault
    pushes: tuple[fb.Push, ...] = ()

    @property
    def falls(self) -> bool:
        """Whether the robot should fall."""
        return bool(self.injected_fault.kind or self.pushes)

    def record(self) -> BlackBox:
        """Return the black box of this case."""
        for twist in self.twists:
            box = record_box(self.name, twist, self.injected_fault, self.pushes)
            if box.fell == self.falls:
                break
        return box


def random_cases(seed: int) -> tuple[Case, ...]:
    """Return six random cases, one of each fault, in random order."""
    rng = np.random.default_rng([as_integer("seed", seed, 0, LARGEST_SEED), 6])
    order = [FAULTS[i] for i in rng.permutation(len(FAULTS))]
    return tuple(
        Case(name, random_twists(rng), InjectedFault.random(fault, rng))
        for name, fault in zip("ABCDEF", order, strict=True)
    )


def faultless_cases(seed: int) -> tuple[Case, ...]:
    """Return two random cases without a fault; in the second, a kick fells the robot."""
    rng = np.random.default_rng([as_integer("seed", seed, 0, LARGEST_SEED), 2])
    return Case("N", random_twists(rng), InjectedFault()), Case(
        "K", random_twists(rng), InjectedFault(), (random_kick(rng),)
    )


def random_twists(rng: np.random.Generator) -> tuple[Twist, ...]:
    """Return some random motions."""
    return tuple(Twist.random(rng) for _ in range(TRIES))


def random_kick(rng: np.random.Generator) -> fb.Push:
    """Return a random kick, hard enough to fell go2."""
    angle, force = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(260.0, 320.0)
    return fb.Push(
        force * np.array([np.cos(angle), np.sin(angle), 0.0]), start=float(rng.uniform(0.4, 0.8))
    )


@lru_cache(maxsize=8)
def black_boxes(seed: int) -> tuple[BlackBox, ...]:
    """Return the black boxes of six falls, A to F, each with one fault of `FAULTS`.

    Parameters
    ----------
    seed : int
        Seed; other seeds give other boxes.

    Returns
    -------
    tuple of BlackBox
        The boxes.
    """
    return tuple(case.record() for case in random_cases(seed))


@lru_cache(maxsize=8)
def faultless_boxes(seed: int) -> tuple[BlackBox, ...]:
    """Return black boxes of two robots without a fault: N twists to the end, K is kicked over."""
    return tuple(case.record() for case in faultless_cases(seed))


def crash_test(
    fault: Fault | None = None,
    size: float = 0.0,
    joints: tuple[str, str] = ("", ""),
    seconds: float = SECONDS,
) -> BlackBox:
    """Return the black box of a crash whose fault we know, to test diagnostic methods.

    Parameters
    ----------
    fault : str, optional
        One of `FAULTS`; None for a robot without a fault.
    size, joints : optional
        Size and joints of the fault, as for `InjectedFault`.
    seconds : float, optional
        Duration of the record, unless it ends in a fall before [s].

    Returns
    -------
    BlackBox
        The record.

    Raises
    ------
    UnknownNameError
        If the fault is unknown.
    """
    if fault is not None and fault not in FAULTS:
        raise unknown_name("fault", fault, FAULTS)
    return record_box("our own", Twist(), InjectedFault(fault, size, 0.0, joints), seconds=seconds)


def case_zero() -> BlackBox:
    """Return the black box of the case that the lesson solves."""
    return record_box("0", Twist(), InjectedFault("slow motors", 45.0))
