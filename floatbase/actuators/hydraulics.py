"""What makes a torque (App. B): a hydraulic cylinder with its valve, the lever to the joint, and the loop that drives it.

The commands of a whole-body controller are torques; a piston has only oil that flows in and out. A lower loop measures the
force and opens the valve a little more or less, so that one layer up the torque can be taken for granted, as long as it
changes more slowly than the loop's bandwidth and stays within what the supply pressure gives.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from floatbase._arrays import Array, checked, positive, read_only
from floatbase.errors import InputError
from floatbase.robots import Robot

LONGEST_STEP = 2e-4  # s, of the oil's integration; see `HydraulicActuators.step`
VACUUM = -101325.0  # Pa over the air outside: oil at this pressure boils and pulls no more
_LAMINAR = 1e5  # Pa: below about this drop an orifice's flow grows with the drop rather than with its root
_INTEGRAL_PART = 0.05  # the integral's corner frequency as part of the loop's bandwidth
_SIGN = np.array([[1.0], [-1.0]])  # chamber A pushes the rod out, chamber B pulls it in


@dataclass(frozen=True)
class Hydraulics:
    """One joint of HyQ, the hydraulic quadruped: cylinder, lever, oil, valve and force loop. SI units, pressures over air.

    bore, rod: diameters, m. crank: m, from the joint's axis to the rod's end. base: m, from the joint's axis to the
    cylinder's foot. dead_volume: m³, oil in the hose to each chamber. supply_pressure, tank_pressure: Pa.
    bulk_modulus: β_e, Pa. leakage: m³/(s Pa), past the piston. rated_flow: m³/s through the valve, all open, when both of
    its edges together take rated_drop, Pa. valve_bandwidth: Hz, where the spool's amplitude has fallen by 3 dB.
    loop_bandwidth: Hz, of the force loop: turn it down to make the actuator slow.

    Sources: bore 16 mm, rod 10 mm, 160 bar, 145 N·m and the Moog E024 valve of 250 Hz: Semini et al., Design of HyQ, a
    hydraulically and electrically actuated quadruped robot, Proc. IMechE Part I 225, 2011. The crank follows from them:
    160 bar on the bore gives 3217 N, and 145 N·m need 45 mm. Nominal, not measured on HyQ: base (along a link of 0.35 m),
    dead volume (0.4 m of hose of 5 mm), β_e of oil with a little air, leakage (0.02 l/min at 160 bar), flow (7.5 l/min at
    70 bar), return pressure, and the loop's 50 Hz, a fifth of the valve's.
    Raises `InputError` for values that make no cylinder.
    """

    bore: float = 0.016
    rod: float = 0.010
    crank: float = 0.045
    base: float = 0.32
    dead_volume: float = 8e-6
    supply_pressure: float = 160e5
    tank_pressure: float = 2e5
    bulk_modulus: float = 1.3e9
    leakage: float = 2e-14
    rated_flow: float = 1.25e-4
    rated_drop: float = 70e5
    valve_bandwidth: float = 250.0
    loop_bandwidth: float = 50.0

    def __post_init__(self) -> None:
        may_be_zero = ("tank_pressure", "leakage")
        for field in fields(self):
            name = field.name.replace("_", " ")
            positive(f"{name} of the cylinder", getattr(self, field.name), allow_zero=field.name in may_be_zero)
        for small, large in (("rod", "bore"), ("crank", "base"), ("tank_pressure", "supply_pressure")):
            if getattr(self, small) >= getattr(self, large):
                raise InputError(
                    f"{small} of the cylinder is {getattr(self, small):g}; it must be less than {large}, "
                    f"{getattr(self, large):g}.".replace("_", " ")
                )
        if self.weakest_torque <= 0.0:
            raise InputError("the tank pressure on the bore holds off the supply on the ring: it must be lower.")

    @property
    def areas(self) -> Array:
        """Piston areas of chamber A (bore) and B (bore less rod), shape (2,), m²."""
        return read_only(0.25 * np.pi * np.array([self.bore**2, self.bore**2 - self.rod**2]))

    @property
    def valve_gain(self) -> float:
        """C_d w x_max √(2/ρ), m³/(s √Pa): flow per root of drop through one edge, all open; it takes half the rated drop."""
        return self.rated_flow / float(np.sqrt(0.5 * self.rated_drop))

    @property
    def weakest_torque(self) -> float:
        """N·m that the supply gives at the best angle when the rod is pulled in, the weaker way: only the ring pulls."""
        bore, ring = self.areas
        return float(ring * self.supply_pressure - bore * self.tank_pressure) * self.crank


@dataclass(frozen=True, eq=False)
class OilState:
    """What a cylinder remembers. opening: (d,) of the valve, -1 to 1. pressures: (2, d) Pa over air, chambers A and B.

    integral: (d,) N·s, the force loop's sum of errors.
    """

    opening: Array
    pressures: Array
    integral: Array

    def __post_init__(self) -> None:
        for field in fields(self):
            object.__setattr__(self, field.name, read_only(getattr(self, field.name)))


@dataclass(frozen=True, eq=False)
class Pose:
    """Where d cylinders stand at given joint angles.

    length: (d,) m, ℓ, from foot to rod end. lever: (d,) m, L = dℓ/dq. volumes: (2, d) m³, V of the chambers A and B.
    compliance: (2, d) m³/Pa, V / β_e. stiffness: (d,) N/m, k = β_e (A_A²/V_A + A_B²/V_B), the spring that closed
    chambers make.
    """

    length: Array
    lever: Array
    volumes: Array
    compliance: Array
    stiffness: Array


@dataclass(frozen=True, eq=False)
class Power:
    """Where the power goes, each of shape (d,), W: pump = joint + valve + leakage + stored.

    pump: from supply line less what the tank line takes. joint: torque times velocity. valve, leakage: heat, never
    negative. stored: into the compression of the oil, V p ṗ / β_e of both chambers.
    """

    pump: Array
    joint: Array
    valve: Array
    leakage: Array
    stored: Array


class Cylinders:
    """App. B: d double-acting cylinders, each on a crank, as equations without memory.

    For a joint angle q, with γ the angle at the joint between the crank b and the cylinder's foot at distance a:

        ℓ² = a² + b² - 2 a b cos γ                       the triangle: length of the cylinder
        L = dℓ/dq = a b sin γ / ℓ,   τ = L F             the same power on both sides: τ q̇ = F ℓ̇
        F = p_A A_A - p_B A_B                            force of the oil, N, pushing the rod out
        ṗ = (β_e / V) (Q ∓ A ℓ̇ - c (p - p_other))        each chamber; its volume V grows or shrinks with ℓ
        Q = C_d w x √(2 Δp / ρ)                          one edge of the valve, from or to the line it opens to
        ẋ = 2π f_valve (u - x)                           the spool; u in [-1, 1] is what the valve is told

    x > 0 joins A to the supply and B to the tank, x < 0 the other way. Where Δp turns round, flow turns round.
    Source: Merritt, Hydraulic Control Systems, 1967; the triangle is HyQ's.

    size: (d,), each cylinder's torque in terms of the one in `hydraulics`. All its lengths are those times size^(1/3),
    hence volumes, flow, leakage and torque times size, so that all joints behave alike in units of their strength.
    centre: (d,) rad, the joint angle at which the lever is longest, L = b, and crank and cylinder stand square. L is a
    cosine near it, and is zero, and no torque to be had, where they line up. The stroke 2 b lets a joint turn full circle.
    """

    def __init__(self, hydraulics: Hydraulics, size: npt.ArrayLike, centre: npt.ArrayLike):
        self.hydraulics = hydraulics
        size = checked("size", size, (None,))
        if np.any(size <= 0.0):
            raise InputError(f"size of a cylinder is {size.min():g}; it must be > 0.")
        self.centre = checked("centre", centre, size.shape, "rad")
        self.areas = read_only(np.outer(hydraulics.areas, size ** (2.0 / 3.0)))
        self.crank = read_only(hydraulics.crank * size ** (1.0 / 3.0))
        self.base = read_only(hydraulics.base * size ** (1.0 / 3.0))
        self._dead = hydraulics.dead_volume * size
        self._flow = hydraulics.valve_gain * size
        self._leakage = hydraulics.leakage * size
        self._best = float(np.arccos(hydraulics.crank / hydraulics.base))  # γ with crank and cylinder square

    @property
    def d(self) -> int:
        """Number of cylinders."""
        return int(self.crank.size)

    def at(self, q: npt.ArrayLike) -> Pose:
        """The cylinders at joint angles q, shape (d,), rad."""
        gamma = self._best + checked("q", q, (self.d,), "rad") - self.centre
        length = np.sqrt(self.base**2 + self.crank**2 - 2.0 * self.base * self.crank * np.cos(gamma))
        out = length - (self.base - self.crank)  # how far the rod is out, from 0 to 2 b
        volumes = self._dead + self.areas * np.array([out, 2.0 * self.crank - out])
        compliance = volumes / self.hydraulics.bulk_modulus
        return Pose(
            length=read_only(length),
            lever=read_only(self.base * self.crank * np.sin(gamma) / length),
            volumes=read_only(volumes),
            compliance=read_only(compliance),
            stiffness=read_only(np.sum(self.areas**2 / compliance, axis=0)),
        )

    def force(self, pressures: Array) -> Array:
        """F = p_A A_A - p_B A_B, shape (d,), N."""
        return self.areas[0] * pressures[0] - self.areas[1] * pressures[1]

    def force_limits(self) -> Array:
        """The least and the largest F that supply and tank allow, shape (2, d), N."""
        supply, tank = self.hydraulics.supply_pressure, self.hydraulics.tank_pressure
        return np.array([self.force(np.array([[tank], [supply]])), self.force(np.array([[supply], [tank]]))])

    def line(self, x: Array) -> Array:
        """Pressure of the line that each chamber is open to, shape (2, d), Pa, when the valve opens towards x."""
        return np.where(_SIGN * x >= 0.0, self.hydraulics.supply_pressure, self.hydraulics.tank_pressure)

    def edge_flow(self, drop: Array) -> Array:
        """Flow through an edge, all open, for a drop of pressure, shape (2, d), m³/s: √Δp, but smooth through zero."""
        return self._flow * drop / np.sqrt(np.hypot(drop, _LAMINAR))

    def flows(self, x: Array, pressures: Array) -> Array:
        """Q into the chambers A and B, shape (2, d), m³/s, at opening x, shape (d,)."""
        return np.abs(x) * self.edge_flow(self.line(x) - pressures)

    def leak(self, pressures: Array) -> Array:
        """Flow past the piston out of the chambers A and B, shape (2, d), m³/s."""
        return self._leakage * (pressures - pressures[::-1])

    def pressure_rates(self, x: Array, pressures: Array, pose: Pose, v: Array) -> Array:
        """ṗ of the chambers A and B, shape (2, d), Pa/s, at opening x and joint velocities v, each of shape (d,)."""
        into = self.flows(x, pressures) - self.leak(pressures) - _SIGN * self.areas * (pose.lever * v)
        return into / pose.compliance

    def pressure_decay(self, x: Array, pressures: Array, pose: Pose) -> Array:
        """-∂ṗ/∂p of each chamber by itself, shape (2, d), 1/s, never negative: how stiff the oil's equations are."""
        drop = self.line(x) - pressures
        size = np.hypot(drop, _LAMINAR)
        slope = self._flow * (0.5 * drop**2 + _LAMINAR**2) / (size**2 * np.sqrt(size))
        return (np.abs(x) * slope + self._leakage) / pose.compliance

    def opening_for(self, force_rate: Array, pressures: Array, pose: Pose, v: Array) -> Array:
        """The opening, shape (d,), that makes the force change by force_rate, N/s, while the joints move with v, rad/s.

        Ḟ = x g - k ℓ̇ with k the oil's stiffness, so the piston's velocity is fed forward and the curved valve is
        divided out: x = (Ḟ + k ℓ̇) / g. Leakage is left to the loop's integral. A valve has only -1 to 1 to give.
        """
        wanted = force_rate + pose.stiffness * pose.lever * v
        full = self.edge_flow(self.line(wanted) - pressures) / pose.compliance
        # chambers at line pressure let the force grow no more; the tiny bound then asks for all the valve has
        return wanted / np.maximum(np.sign(wanted) * self.force(full), 1e-9)

    def power(self, x: Array, pressures: Array, pose: Pose, v: Array) -> Power:
        """Where the power goes at an instant, at opening x and joint velocities v: see `Power`."""
        flows, line = self.flows(x, pressures), self.line(x)
        rates = self.pressure_rates(x, pressures, pose, v)
        stored = pose.compliance * pressures * rates
        return Power(
            pump=read_only(np.sum(line * flows, axis=0)),
            joint=read_only(self.force(pressures) * pose.lever * v),
            valve=read_only(np.sum((line - pressures) * flows, axis=0)),
            leakage=read_only(np.sum(pressures * self.leak(pressures), axis=0)),
            stored=read_only(np.sum(stored, axis=0)),
        )


class HydraulicActuators:
    """App. B: a hydraulic cylinder on every joint of a robot, each with a loop that makes the torque asked for.

    Usable as `actuators` in `rollout`. The loop asks for Ḟ = ω (e + ω_i ∫e dt) with e = F_desired - F, ω = 2π times the
    loop's bandwidth and ω_i a twentieth of it, and tells the valve the opening for it (`Cylinders.opening_for`); the
    integral rests while the valve is all open. The torque's amplitude follows to at least the stated bandwidth, as long as
    that lies below the valve's.

    Sizes: each cylinder is HyQ's, scaled until the supply pressure gives the robot's torque limit at the lever's best angle
    and in the weaker direction, rod going in. Going out it gives 1.7 times as much. centre: (d,) rad, those best
    angles, by default the joints of `robot.standing()`. Friction of the pistons is left out, as joint friction is in
    (1)-(7). A load that pulls the rod out fast starves chamber A, as the valve's edges are alike and the areas are not:
    its oil boils, and torque is missing until the chamber is full again.
    Source of the loop: Boaventura et al., Model-based hydraulic impedance control for dynamic robots, IEEE T-RO 31, 2015.
    Raises `InputError` for a joint without a torque limit and for joints that slide.
    """

    def __init__(self, robot: Robot, hydraulics: Hydraulics | None = None, centre: npt.ArrayLike | None = None):
        hydraulics = Hydraulics() if hydraulics is None else hydraulics
        if not isinstance(hydraulics, Hydraulics):
            raise InputError(f"hydraulics must be a Hydraulics, as Hydraulics(loop_bandwidth=20.0), not {hydraulics!r}.")
        _check_joints(robot)
        if centre is None:  # the way from the neutral configuration holds the joints' angles
            centre = robot.standing().difference(robot.neutral().q)[robot.nv - robot.d :]
        self.cylinders = Cylinders(hydraulics, robot.torque_limits / hydraulics.weakest_torque, centre)
        self.reset()

    def reset(self, tau: npt.ArrayLike | None = None, q_joints: npt.ArrayLike | None = None) -> None:
        """Close the valves with the oil pressed so that the joints have torques tau, as far as the supply goes.

        tau: (d,) N·m, zero by default. q_joints: (d,) rad, the centre by default. Construction does this; a rollout
        never does, so that it can go on where another ended: a robot that is to stand from the start needs the torques
        it stands with.
        """
        cylinders = self.cylinders
        tau = checked("tau", np.zeros(cylinders.d) if tau is None else tau, (cylinders.d,), "N·m")
        force = self._force_for(tau, cylinders.at(cylinders.centre if q_joints is None else q_joints))
        # a valve with equal edges holds a force with as much pressure missing at A as there is too much at B
        lines = cylinders.hydraulics.supply_pressure + cylinders.hydraulics.tank_pressure
        a = (force + cylinders.areas[1] * lines) / cylinders.areas.sum(axis=0)
        self.state = OilState(np.zeros(cylinders.d), np.array([a, lines - a]), np.zeros(cylinders.d))

    def torques(self, q_joints: npt.ArrayLike) -> Array:
        """The torques the oil makes at joint angles, shape (d,) rad: L F, shape (d,), N·m."""
        return self.cylinders.at(q_joints).lever * self.cylinders.force(self.state.pressures)

    def torque_limits(self, q_joints: npt.ArrayLike) -> Array:
        """The least and the largest torque that the supply pressure gives at joint angles, (d,) rad: shape (2, d), N·m."""
        return read_only(np.sort(self.cylinders.at(q_joints).lever * self.cylinders.force_limits(), axis=0))

    def step(self, tau_desired: npt.ArrayLike, q_joints: npt.ArrayLike, v_joints: npt.ArrayLike, dt: float) -> Array:
        """Let dt s pass with these torques asked for; the torques of the joints at its end, shape (d,), N·m.

        tau_desired: (d,) N·m. q_joints, v_joints: (d,) rad and rad/s, taken as they are at the start: the oil's
        spring then answers to a velocity and pushes on the next, which neither adds energy to it nor takes any
        (symplectic Euler), as long as it turns less than 2 rad in dt: √(L² k / inertia) dt < 2. At 1 ms that is at most
        1.7 in the catalogue, at the last wrist of anymal_kinova.
        The oil is integrated in equal steps of `LONGEST_STEP` at most: the spool as its equation says, the pressures by a
        linearly implicit Euler step, stable however small the chambers and the drops of pressure are. Torques come out
        within 1 % of the torque limit, where they change fastest.
        """
        cylinders = self.cylinders
        tau = checked("tau_desired", tau_desired, (cylinders.d,), "N·m")
        v = checked("v_joints", v_joints, (cylinders.d,), "rad/s")
        pose = cylinders.at(q_joints)
        steps = max(1, int(np.ceil(positive("dt", dt, "s") / LONGEST_STEP - 1e-9)))
        force = self._force_for(tau, pose)
        for _ in range(steps):
            self.state = self._advance(force, pose, v, dt / steps)
        return pose.lever * cylinders.force(self.state.pressures)

    def _force_for(self, tau: Array, pose: Pose) -> Array:
        """The piston forces for joint torques, shape (d,), N, within what supply and tank allow."""
        dead = np.abs(pose.lever) < 1e-9 * self.cylinders.crank
        least, largest = self.cylinders.force_limits()
        return np.clip(tau / np.where(dead, 1e-9 * self.cylinders.crank, pose.lever), least, largest)

    def _advance(self, force: Array, pose: Pose, v: Array, step: float) -> OilState:
        """The state `step` s later while the loop wants `force`, N."""
        cylinders, hydraulics, now = self.cylinders, self.cylinders.hydraulics, self.state
        rate = 2.0 * np.pi * hydraulics.loop_bandwidth
        error = force - cylinders.force(now.pressures)
        asked = rate * (error + _INTEGRAL_PART * rate * now.integral)
        u = cylinders.opening_for(asked, now.pressures, pose, v)
        integral = now.integral + step * np.where(np.abs(u) < 1.0, error, 0.0)
        u = np.clip(u, -1.0, 1.0)
        opening = u + (now.opening - u) * np.exp(-2.0 * np.pi * hydraulics.valve_bandwidth * step)
        halfway = 0.5 * (now.opening + opening)
        change = step * cylinders.pressure_rates(halfway, now.pressures, pose, v)
        change /= 1.0 + step * cylinders.pressure_decay(halfway, now.pressures, pose)
        return OilState(opening, np.maximum(now.pressures + change, VACUUM), integral)


def _check_joints(robot: Robot) -> None:
    """Cranks are for joints that turn, and a cylinder needs to know how strong it is to be."""
    for joint in robot.joint_names:
        kind = robot.model.joints[robot.model.getJointId(joint)].shortname()
        if not kind.startswith("JointModelR"):
            raise InputError(f"{joint} of {robot.name} slides ({kind}); hydraulic actuators here turn joints by a crank.")
    for joint, limit in zip(robot.joint_names, robot.torque_limits, strict=True):
        if not np.isfinite(limit):
            raise InputError(
                f"{joint} of {robot.name} has no torque limit, so its cylinder has no size: "
                f'load the robot with one, fb.load("{robot.name}", torque_limits=…).'
            )
