"""App. B: a hydraulic cylinder with its valve, its oil, and the lever to the joint, as equations
without memory.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_instance,
    as_positive,
    checked,
    read_only,
)
from floatbase.errors import InputError

# Pa: below about this drop an orifice's flow grows with the drop rather than with its root
_LAMINAR_DROP = 1e5
# N/s: least change of force by an open valve. Chambers at line pressure have none; they get the
# valve's all
_MIN_GAIN = 1e-9
VACUUM = -101325.0  # Pa over the air outside: oil at this pressure boils and pulls no more
_CHAMBER_SIGN = np.array([[1.0], [-1.0]])  # chamber A pushes the rod out, chamber B pulls it in


def _positive(default: float, unit: str, allow_zero: bool = False) -> Any:
    """Declare a field that holds a positive number."""
    return field(default=default, metadata=checked(as_positive, unit, allow_zero=allow_zero))


@dataclass(frozen=True)
class Hydraulics(Value):
    """One joint of HyQ, the hydraulic quadruped: cylinder, lever, oil, valve and force loop.

    bore, rod: m, diameters.
    crank, base: m, from the joint's axis to the rod's end and to the cylinder's foot.
    dead_volume: m³, oil in the hose to each chamber.
    supply_pressure, tank_pressure: Pa over the air outside.
    bulk_modulus: Pa, β_e.
    leakage: m³/(s Pa), past the piston.
    rated_flow, rated_pressure_drop: m³/s through the valve, all open, when its two edges together
        take that drop, Pa.
    valve_bandwidth: Hz, where the spool's amplitude has fallen by 3 dB.
    loop_bandwidth: Hz, of the force loop: turn it down to make the actuator slow.

    Sources: bore 16 mm, rod 10 mm, 160 bar, 145 N·m and the Moog E024 valve of 250 Hz: Semini et
    al., Design of HyQ, a hydraulically and electrically actuated quadruped robot, Proc. IMechE Part
    I 225, 2011. The crank follows from them: 160 bar on the bore gives 3217 N, and 145 N·m need 45
    mm. The others are nominal, not measured on HyQ: a dead volume of 0.4 m of hose of 5 mm, leakage
    of 0.02 l/min at 160 bar, flow of 7.5 l/min at 70 bar, a loop of a fifth of the valve's. Raises
    `InputError` for values that make no cylinder.
    """

    _example = "Hydraulics(loop_bandwidth=20.0)"
    bore: float = _positive(0.016, "m")
    rod: float = _positive(0.010, "m")
    crank: float = _positive(0.045, "m")
    base: float = _positive(0.32, "m")
    dead_volume: float = _positive(8e-6, "m³")
    supply_pressure: float = _positive(160e5, "Pa")
    tank_pressure: float = _positive(2e5, "Pa", allow_zero=True)
    bulk_modulus: float = _positive(1.3e9, "Pa")
    leakage: float = _positive(2e-14, "m³/(s Pa)", allow_zero=True)
    rated_flow: float = _positive(1.25e-4, "m³/s")
    rated_pressure_drop: float = _positive(70e5, "Pa")
    valve_bandwidth: float = _positive(250.0, "Hz")
    loop_bandwidth: float = _positive(50.0, "Hz")

    def __post_init__(self) -> None:
        super().__post_init__()
        for small, large in (
            ("rod", "bore"),
            ("crank", "base"),
            ("tank_pressure", "supply_pressure"),
        ):
            size, bound = getattr(self, small), getattr(self, large)
            if size >= bound:
                raise InputError(
                    f"{small} of {self._label()} is {size:g}; it must be less than {large}, "
                    f"{bound:g}."
                )
        if self.weakest_torque <= 0.0:
            raise InputError(
                "the tank pressure on the bore holds off the supply on the ring: it must be lower."
            )

    def _label(self) -> str:
        return "the cylinder"

    @property
    def areas(self) -> Array:
        """Piston areas of chamber A (bore) and B (bore less rod), shape (2,), m²."""
        return read_only(0.25 * np.pi * np.array([self.bore**2, self.bore**2 - self.rod**2]))

    @property
    def valve_gain(self) -> float:
        """C_d w x_max √(2/ρ), m³/(s √Pa): flow per root of drop through one edge, all open; it
        takes half the rated drop.
        """
        return self.rated_flow / float(np.sqrt(0.5 * self.rated_pressure_drop))

    @property
    def weakest_torque(self) -> float:
        """N·m that the supply gives at the best angle when the rod is pulled in, the weaker way:
        only the ring pulls.
        """
        bore, ring = self.areas
        return float(ring * self.supply_pressure - bore * self.tank_pressure) * self.crank


@dataclass(frozen=True, eq=False)
class CylinderGeometry(Value):
    """Where d cylinders stand at given joint angles.

    length: (d,) m, ℓ, from foot to rod end.
    lever: (d,) m, L = dℓ/dq.
    volumes: (2, d) m³, V of the chambers A and B.
    compliance: (2, d) m³/Pa, V / β_e.
    stiffness: (d,) N/m, k = β_e (A_A²/V_A + A_B²/V_B), the spring that closed chambers make.
    """

    length: Array
    lever: Array
    volumes: Array
    compliance: Array
    stiffness: Array


@dataclass(frozen=True, eq=False)
class PowerBalance(Value):
    """Where the power goes, each of shape (d,), W: pump = joint + valve + leakage + stored.

    pump: what the supply line gives less what the tank line takes.
    joint: torque times velocity.
    valve, leakage: heat, never negative.
    stored: in the compression of the oil, V p ṗ / β_e of both chambers.
    """

    pump: Array
    joint: Array
    valve: Array
    leakage: Array
    stored: Array


class Cylinders(Value):
    """App. B: d double-acting cylinders, each on a crank, as equations without memory.

    For a joint angle q, with γ the angle at the joint between the crank b and the cylinder's foot
    at distance a:

        ℓ² = a² + b² - 2 a b cos γ                       the triangle: length of the cylinder
        L = dℓ/dq = a b sin γ / ℓ,   τ = L F             the same power on both sides: τ q̇ = F ℓ̇
        F = p_A A_A - p_B A_B                            force of the oil, N, pushing the rod out
        ṗ = (β_e / V) (Q ∓ A ℓ̇ - c (p - p_other))        each chamber, whose volume V varies with ℓ
        Q = C_d w x √(2 Δp / ρ)                          each edge of the valve
        ẋ = 2π f_valve (u - x)                           the spool; u in [-1, 1] is its command

    x > 0 joins A to the supply and B to the tank, x < 0 the other way. Where Δp turns round, flow
    turns round.
    Source: Merritt, Hydraulic Control Systems, 1967; the triangle is HyQ's.

    hydraulics: the cylinder of scale 1.
    scale: (d,), each cylinder's torque as a multiple of that one's. Lengths are multiplied by
        scale^(1/3), hence volumes, flow, leakage and torque by scale.
    max_lever_angle: (d,) rad, the joint angle at which the lever is longest, L = b, and crank and
        cylinder stand square. L is zero where they line up. The stroke 2 b lets a joint turn full
        circle.

    In the methods x is the valves' opening, shape (d,), -1 to 1; pressures those of the chambers A
    and B, shape (2, d), Pa; geometry from `geometry(q)`; v the joints' velocities, shape (d,),
    rad/s.
    """

    hydraulics: Hydraulics
    max_lever_angle: Array
    areas: Array
    crank: Array
    base: Array
    _dead_volume: Array
    _valve_gain: Array
    _leakage: Array
    _best_gamma: float

    def __init__(
        self, hydraulics: Hydraulics, scale: npt.ArrayLike, max_lever_angle: npt.ArrayLike
    ):
        as_instance("hydraulics", hydraulics, Hydraulics)
        scale = as_array("scale", scale, (None,))
        if np.any(scale <= 0.0):
            raise InputError(f"scale of a cylinder is {scale.min():g}; it must be > 0.")
        vars(self).update(
            hydraulics=hydraulics,
            max_lever_angle=as_array("max_lever_angle", max_lever_angle, scale.shape, "rad"),
            areas=read_only(np.outer(hydraulics.areas, scale ** (2.0 / 3.0))),
            crank=read_only(hydraulics.crank * scale ** (1.0 / 3.0)),
            base=read_only(hydraulics.base * scale ** (1.0 / 3.0)),
            _dead_volume=hydraulics.dead_volume * scale,
            _valve_gain=hydraulics.valve_gain * scale,
            _leakage=hydraulics.leakage * scale,
            _best_gamma=float(
                np.arccos(hydraulics.crank / hydraulics.base)
            ),  # γ with crank and cylinder square
        )

    @property
    def d(self) -> int:
        """Number of cylinders."""
        return int(self.crank.size)

    def geometry(self, q: npt.ArrayLike) -> CylinderGeometry:
        """Lengths, levers and chambers at joint angles q, shape (d,), rad."""
        gamma = self._best_gamma + as_array("q", q, (self.d,), "rad") - self.max_lever_angle
        length = np.sqrt(
            self.base**2 + self.crank**2 - 2.0 * self.base * self.crank * np.cos(gamma)
        )
        extension = length - (self.base - self.crank)  # how far the rod is out, from 0 to 2 b
        volumes = self._dead_volume + self.areas * np.array(
            [extension, 2.0 * self.crank - extension]
        )
        compliance = volumes / self.hydraulics.bulk_modulus
        lever, stiffness = (
            self.base * self.crank * np.sin(gamma) / length,
            np.sum(self.areas**2 / compliance, axis=0),
        )
        return CylinderGeometry(*map(read_only, (length, lever, volumes, compliance, stiffness)))

    def force(self, pressures: Array) -> Array:
        """F = p_A A_A - p_B A_B, shape (d,), N."""
        forces: Array = self.areas[0] * pressures[0] - self.areas[1] * pressures[1]
        return forces

    def force_limits(self) -> Array:
        """The least and the largest F that supply and tank allow, shape (2, d), N."""
        lines = np.array([[self.hydraulics.tank_pressure], [self.hydraulics.supply_pressure]])
        return np.array([self.force(lines), self.force(lines[::-1])])

    def line_pressures(self, x: Array) -> Array:
        """Pressure of the line that each chamber is open to, shape (2, d), Pa, when the valve opens
        towards x.
        """
        return np.where(
            _CHAMBER_SIGN * x >= 0.0, self.hydraulics.supply_pressure, self.hydraulics.tank_pressure
        )

    def orifice_flow(self, drop: Array) -> Array:
        """Flow through an edge, all open, for a drop of pressure, shape (2, d), m³/s: √Δp, but
        smooth through zero.
        """
        return self._valve_gain * drop / np.sqrt(np.hypot(drop, _LAMINAR_DROP))

    def valve_flows(self, x: Array, pressures: Array) -> Array:
        """Q into the chambers A and B, shape (2, d), m³/s."""
        return np.abs(x) * self.orifice_flow(self.line_pressures(x) - pressures)

    def leakage_flow(self, pressures: Array) -> Array:
        """Flow past the piston out of the chambers A and B, shape (2, d), m³/s."""
        return self._leakage * (pressures - pressures[::-1])

    def pressure_rates(
        self, x: Array, pressures: Array, geometry: CylinderGeometry, v: Array
    ) -> Array:
        """ṗ of the chambers A and B, shape (2, d), Pa/s."""
        inflow = (
            self.valve_flows(x, pressures)
            - self.leakage_flow(pressures)
            - _CHAMBER_SIGN * self.areas * (geometry.lever * v)
        )
        return inflow / geometry.compliance

    def pressure_decay(self, x: Array, pressures: Array, geometry: CylinderGeometry) -> Array:
        """-∂ṗ/∂p of each chamber by itself, shape (2, d), 1/s, never negative: how stiff the oil's
        equations are.
        """
        drop = self.line_pressures(x) - pressures
        slope = (
            self._valve_gain
            * (0.5 * drop**2 + _LAMINAR_DROP**2)
            / np.hypot(drop, _LAMINAR_DROP) ** 2.5
        )
        return (np.abs(x) * slope + self._leakage) / geometry.compliance

    def advance(
        self,
        opening: Array,
        pressures: Array,
        u: Array,
        geometry: CylinderGeometry,
        v: Array,
        step: float,
    ) -> tuple[Array, Array]:
        """Opening, (d,), and pressures, (2, d) Pa, `step` s later with the valves' inputs u, (d,),
        -1 to 1: the spool exactly, the pressures by linearly implicit Euler, never below `VACUUM`.
        """
        decay = np.exp(-2.0 * np.pi * self.hydraulics.valve_bandwidth * step)
        new_opening = u + (opening - u) * decay
        x = 0.5 * (opening + new_opening)
        change = step * self.pressure_rates(x, pressures, geometry, v)
        change /= 1.0 + step * self.pressure_decay(x, pressures, geometry)
        return new_opening, np.maximum(pressures + change, VACUUM)

    def opening_for(
        self, force_rate: Array, pressures: Array, geometry: CylinderGeometry, v: Array
    ) -> Array:
        """The opening, shape (d,), that makes the force change by force_rate, (d,) N/s, while the
        joints move with v.

        Ḟ = x g - k ℓ̇ with k the oil's stiffness and g the change of force at the valve all open,
        so x = (Ḟ + k ℓ̇) / g: it feeds the piston's velocity forward. Leakage is left to the loop's
        integral. x may be beyond -1 to 1.
        """
        valve_force_rate = force_rate + geometry.stiffness * geometry.lever * v
        full_opening_rate = (
            self.orifice_flow(self.line_pressures(valve_force_rate) - pressures)
            / geometry.compliance
        )
        return valve_force_rate / np.maximum(
            np.sign(valve_force_rate) * self.force(full_opening_rate), _MIN_GAIN
        )

    def power(
        self, x: Array, pressures: Array, geometry: CylinderGeometry, v: Array
    ) -> PowerBalance:
        """Where the power goes at an instant: see `PowerBalance`."""
        flows, line = self.valve_flows(x, pressures), self.line_pressures(x)
        stored = geometry.compliance * pressures * self.pressure_rates(x, pressures, geometry, v)
        leaked = pressures * self.leakage_flow(pressures)
        pump, valve, leakage, stored = (
            np.sum(p, axis=0) for p in (line * flows, (line - pressures) * flows, leaked, stored)
        )
        return PowerBalance(
            *map(
                read_only,
                (pump, self.force(pressures) * geometry.lever * v, valve, leakage, stored),
            )
        )
