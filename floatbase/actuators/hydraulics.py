"""Equations of a hydraulic cylinder with its valve, its oil and its lever at the joint.

[FBR]_, App. B.
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

# Pa: below about this drop, the flow of an orifice is proportional to the drop, not to its root
_LAMINAR_DROP = 1e5
# N/s: smallest rate of force of an open valve. At line pressure it would be zero; then the valve
# opens fully
_MIN_GAIN = 1e-9
VACUUM = -101325.0  # Pa, gauge pressure: oil at this pressure boils and cannot pull harder
_CHAMBER_SIGN = np.array([[1.0], [-1.0]])  # chamber A pushes the rod out, chamber B pulls it in


def _positive(default: float, unit: str, allow_zero: bool = False) -> Any:
    """Declare a field that holds a positive number."""
    return field(default=default, metadata=checked(as_positive, unit, allow_zero=allow_zero))


@dataclass(frozen=True)
class Hydraulics(Value):
    """Parameters of a hydraulic joint: cylinder, lever, oil, valve and force loop.

    The default values describe one joint of the hydraulic quadruped HyQ.

    Parameters
    ----------
    bore : float
        Diameter of the piston [m].
    rod : float
        Diameter of the rod [m].
    crank : float
        Distance from the joint axis to the end of the rod [m].
    base : float
        Distance from the joint axis to the foot of the cylinder [m].
    dead_volume : float
        Volume of oil in the hose to each chamber [m³].
    supply_pressure : float
        Gauge pressure of the supply line [Pa].
    tank_pressure : float
        Gauge pressure of the tank line [Pa].
    bulk_modulus : float
        Bulk modulus of the oil, β_e [Pa].
    leakage : float
        Leakage past the piston per pressure difference [m³/(s Pa)].
    rated_flow : float
        Flow through the fully open valve when the total pressure drop across its two edges is the
        rated drop [m³/s].
    rated_pressure_drop : float
        Rated pressure drop [Pa].
    valve_bandwidth : float
        Frequency at which the amplitude of the spool has dropped by 3 dB [Hz].
    loop_bandwidth : float
        Bandwidth of the force loop [Hz]; a lower value makes the actuator slower.

    Raises
    ------
    InputError
        If the values do not describe a possible cylinder.

    Notes
    -----
    Bore 16 mm, rod 10 mm, 160 bar, 145 N·m and the Moog E024 valve of 250 Hz are from
    [Semini2011]_. The crank follows from them: 160 bar on the bore gives 3217 N, so 145 N·m
    requires 45 mm. The other values are nominal, not measured on HyQ: a dead volume of 0.4 m of
    hose with a diameter of 5 mm, a leakage of 0.02 l/min at 160 bar, a flow of 7.5 l/min at 70 bar,
    and a loop bandwidth of a fifth of the valve's.
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
        parts = {"rod": "bore", "crank": "base", "tank_pressure": "supply_pressure"}
        for small, large in parts.items():
            size, bound = getattr(self, small), getattr(self, large)
            if size >= bound:
                raise InputError(
                    f"{small} of {self._label()} is {size:g}. It must be less than {large}, which "
                    f"is {bound:g}."
                )
        if self.weakest_torque <= 0.0:
            raise InputError(
                "tank_pressure on the area of the bore exceeds supply_pressure on the ring area. "
                "Lower tank_pressure."
            )

    def _label(self) -> str:
        """Return the name that messages use for the cylinder."""
        return "the cylinder"

    @property
    def areas(self) -> Array:
        """Piston areas of chamber A (bore) and chamber B (bore minus rod), shape (2,) [m²]."""
        return read_only(0.25 * np.pi * np.array([self.bore**2, self.bore**2 - self.rod**2]))

    @property
    def valve_gain(self) -> float:
        """Flow per square root of the pressure drop, C_d w x_max √(2/ρ) [m³/(s √Pa)].

        The value is for one fully open edge, which takes half of the rated pressure drop.
        """
        return self.rated_flow / float(np.sqrt(0.5 * self.rated_pressure_drop))

    @property
    def weakest_torque(self) -> float:
        """Torque at the best angle of the lever when the rod retracts, the weaker direction [N·m].

        Only the ring area pulls in this direction.
        """
        bore, ring = self.areas
        return float(ring * self.supply_pressure - bore * self.tank_pressure) * self.crank


@dataclass(frozen=True, eq=False)
class CylinderGeometry(Value):
    """Geometry of d cylinders at given joint angles.

    Parameters
    ----------
    length : ndarray, shape (d,)
        Length ℓ from the foot of the cylinder to the end of the rod [m].
    lever : ndarray, shape (d,)
        Lever arm L = dℓ/dq [m].
    volumes : ndarray, shape (2, d)
        Volumes V of the chambers A and B [m³].
    compliance : ndarray, shape (2, d)
        Compliance V / β_e of the chambers A and B [m³/Pa].
    stiffness : ndarray, shape (d,)
        Stiffness k = β_e (A_A²/V_A + A_B²/V_B) of the oil in closed chambers [N/m].
    """

    length: Array
    lever: Array
    volumes: Array
    compliance: Array
    stiffness: Array


@dataclass(frozen=True, eq=False)
class PowerBalance(Value):
    """Power flows of d cylinders: pump = joint + valve + leakage + stored.

    Parameters
    ----------
    pump : ndarray, shape (d,)
        Power from the supply line minus power into the tank line [W].
    joint : ndarray, shape (d,)
        Torque times velocity [W].
    valve : ndarray, shape (d,)
        Heat in the valve, never negative [W].
    leakage : ndarray, shape (d,)
        Heat due to leakage, never negative [W].
    stored : ndarray, shape (d,)
        Power stored in compressed oil, V p ṗ / β_e summed over both chambers [W].
    """

    pump: Array
    joint: Array
    valve: Array
    leakage: Array
    stored: Array


class Cylinders(Value):
    """The equations of d double-acting cylinders, each on a crank; they have no internal state.

    At a joint angle q, γ is the angle at the joint between the crank, of length b, and the line to
    the foot of the cylinder, at distance a:

        ℓ² = a² + b² - 2 a b cos γ                       law of cosines: length of the cylinder
        L = dℓ/dq = a b sin γ / ℓ,   τ = L F             equal power on both sides: τ q̇ = F ℓ̇
        F = p_A A_A - p_B A_B                            force of the oil, pushing the rod out [N]
        ṗ = (β_e / V) (Q ∓ A ℓ̇ - c (p - p_other))        each chamber; its volume V depends on ℓ
        Q = C_d w x √(2 Δp / ρ)                          each edge of the valve
        ẋ = 2π f_valve (u - x)                           spool; its command u is in [-1, 1]

    If x > 0, A is connected to the supply and B to the tank; if x < 0, the other way round. If Δp
    changes its sign, so does the flow.

    In the methods, x is the opening of the valves, shape (d,), -1 to 1. Pressures are gauge
    pressures of the chambers A and B, shape (2, d) [Pa]. The geometry is the result of
    `geometry(q)`, and v holds the joint velocities, shape (d,) [rad/s].

    Parameters
    ----------
    hydraulics : Hydraulics
        Cylinder of scale 1.
    scale : array_like, shape (d,)
        Torque of each cylinder relative to that of `hydraulics`, dimensionless. Lengths are
        multiplied by scale^(1/3), and therefore volumes, flow, leakage and torque by scale.
    max_lever_angle : array_like, shape (d,)
        Joint angle at which the lever is longest [rad]. There L = b, and the crank is perpendicular
        to the cylinder. L is zero where they are aligned. The stroke 2 b allows a full turn of the
        joint.

    Raises
    ------
    InputError
        If a scale is not positive.

    Notes
    -----
    [FBR]_, App. B. Equations: Merritt, Hydraulic Control Systems, 1967. The triangle is that of HyQ
    [Semini2011]_.
    """

    hydraulics: Hydraulics
    max_lever_angle: Array
    areas: Array
    crank: Array
    base: Array
    _signed_areas: Array
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
            raise InputError(f"scale of a cylinder is {scale.min():g}. It must be > 0.")
        areas = read_only(np.outer(hydraulics.areas, scale ** (2.0 / 3.0)))
        vars(self).update(
            hydraulics=hydraulics,
            max_lever_angle=as_array("max_lever_angle", max_lever_angle, scale.shape, "rad"),
            areas=areas,
            _signed_areas=_CHAMBER_SIGN * areas,
            crank=read_only(hydraulics.crank * scale ** (1.0 / 3.0)),
            base=read_only(hydraulics.base * scale ** (1.0 / 3.0)),
            _dead_volume=hydraulics.dead_volume * scale,
            _valve_gain=hydraulics.valve_gain * scale,
            _leakage=hydraulics.leakage * scale,
            # γ with the crank perpendicular to the cylinder
            _best_gamma=float(np.arccos(hydraulics.crank / hydraulics.base)),
        )

    @property
    def d(self) -> int:
        """Number of cylinders."""
        return int(self.crank.size)

    def geometry(self, q: npt.ArrayLike) -> CylinderGeometry:
        """Compute lengths, lever arms and chamber volumes.

        Parameters
        ----------
        q : array_like, shape (d,)
            Joint angles [rad].

        Returns
        -------
        CylinderGeometry
            The geometry.
        """
        gamma = self._best_gamma + as_array("q", q, (self.d,), "rad") - self.max_lever_angle
        length = np.sqrt(
            self.base**2 + self.crank**2 - 2.0 * self.base * self.crank * np.cos(gamma)
        )
        extension = length - (self.base - self.crank)  # of the rod, from 0 to 2 b
        volumes = self._dead_volume + self.areas * np.array(
            [extension, 2.0 * self.crank - extension]
        )
        compliance = volumes / self.hydraulics.bulk_modulus
        lever = self.base * self.crank * np.sin(gamma) / length
        stiffness = np.sum(self.areas**2 / compliance, axis=0)
        return CylinderGeometry(*map(read_only, (length, lever, volumes, compliance, stiffness)))

    def force(self, pressures: Array) -> Array:
        """Return the forces F = p_A A_A - p_B A_B of the oil.

        Parameters
        ----------
        pressures : ndarray, shape (2, d)
            Pressures of the chambers A and B [Pa].

        Returns
        -------
        ndarray, shape (d,)
            Forces, positive if they push the rod out [N].
        """
        forces: Array = self.areas[0] * pressures[0] - self.areas[1] * pressures[1]
        return forces

    def force_limits(self) -> Array:
        """Return the smallest and the largest F that supply and tank allow.

        Returns
        -------
        ndarray, shape (2, d)
            Smallest forces, then largest forces [N].
        """
        lines = np.array([[self.hydraulics.tank_pressure], [self.hydraulics.supply_pressure]])
        return np.array([self.force(lines), self.force(lines[::-1])])

    def line_pressures(self, x: Array) -> Array:
        """Return the pressure of the line to which each chamber is connected.

        Parameters
        ----------
        x : ndarray, shape (d,)
            Valve openings, of which only the sign matters.

        Returns
        -------
        ndarray, shape (2, d)
            Pressures for the chambers A and B [Pa].
        """
        return np.where(
            _CHAMBER_SIGN * x >= 0.0, self.hydraulics.supply_pressure, self.hydraulics.tank_pressure
        )

    def orifice_flow(self, drop: Array) -> Array:
        """Return the flow through a fully open edge: √Δp, smoothed through zero.

        Parameters
        ----------
        drop : ndarray, shape (2, d)
            Pressure drop Δp [Pa].

        Returns
        -------
        ndarray, shape (2, d)
            Flow, with the sign of the drop [m³/s].
        """
        return self._valve_gain * drop / np.sqrt(np.hypot(drop, _LAMINAR_DROP))

    def valve_flows(self, x: Array, pressures: Array) -> Array:
        """Return the flows Q from the valve into the chambers.

        Parameters
        ----------
        x : ndarray, shape (d,)
            Valve openings.
        pressures : ndarray, shape (2, d)
            Pressures of the chambers A and B [Pa].

        Returns
        -------
        ndarray, shape (2, d)
            Flows into the chambers A and B [m³/s].
        """
        return np.abs(x) * self.orifice_flow(self.line_pressures(x) - pressures)

    def leakage_flow(self, pressures: Array) -> Array:
        """Return the leakage past the piston.

        Parameters
        ----------
        pressures : ndarray, shape (2, d)
            Pressures of the chambers A and B [Pa].

        Returns
        -------
        ndarray, shape (2, d)
            Flows out of the chambers A and B [m³/s].
        """
        return self._leakage * (pressures - pressures[::-1])

    def pressure_rates(
        self, x: Array, pressures: Array, geometry: CylinderGeometry, v: Array
    ) -> Array:
        """Return the rates of change ṗ of the pressures.

        Parameters
        ----------
        x : ndarray, shape (d,)
            Valve openings.
        pressures : ndarray, shape (2, d)
            Pressures of the chambers A and B [Pa].
        geometry : CylinderGeometry
            Geometry at the joint angles.
        v : ndarray, shape (d,)
            Joint velocities [rad/s].

        Returns
        -------
        ndarray, shape (2, d)
            Rates for the chambers A and B [Pa/s].
        """
        return self._pressure_rates(self.valve_flows(x, pressures), pressures, geometry, v)

    def _pressure_rates(
        self, flows: Array, pressures: Array, geometry: CylinderGeometry, v: Array
    ) -> Array:
        """Return the rates of change of the pressures for flows from the valve [Pa/s]."""
        moved = self._signed_areas * (geometry.lever * v)  # m³/s, by the piston
        rates: Array = (flows - self.leakage_flow(pressures) - moved) / geometry.compliance
        return rates

    def pressure_decay(self, x: Array, pressures: Array, geometry: CylinderGeometry) -> Array:
        """Return the decay rate -∂ṗ/∂p of each chamber's own pressure.

        The rate shows how stiff the equations of the oil are.

        Parameters
        ----------
        x : ndarray, shape (d,)
            Valve openings.
        pressures : ndarray, shape (2, d)
            Pressures of the chambers A and B [Pa].
        geometry : CylinderGeometry
            Geometry at the joint angles.

        Returns
        -------
        ndarray, shape (2, d)
            Decay rates, never negative [1/s].
        """
        drop = self.line_pressures(x) - pressures
        return self._decay(np.abs(x), drop, np.hypot(drop, _LAMINAR_DROP), geometry)

    def _decay(
        self, opening: Array, drop: Array, smooth_drop: Array, geometry: CylinderGeometry
    ) -> Array:
        """Return the decay rates for openings without their signs and pressure drops [1/s]."""
        slope = self._valve_gain * (0.5 * drop**2 + _LAMINAR_DROP**2) / smooth_drop**2.5
        rates: Array = (opening * slope + self._leakage) / geometry.compliance
        return rates

    def advance(
        self,
        opening: Array,
        pressures: Array,
        u: Array,
        geometry: CylinderGeometry,
        v: Array,
        step: float,
    ) -> tuple[Array, Array]:
        """Advance the valve spools and the pressures by a time step.

        The spools are integrated exactly, and the pressures by the linearly implicit Euler method.
        Pressures never drop below `VACUUM`.

        Parameters
        ----------
        opening : ndarray, shape (d,)
            Valve openings at the start.
        pressures : ndarray, shape (2, d)
            Pressures of the chambers A and B at the start [Pa].
        u : ndarray, shape (d,)
            Valve commands, -1 to 1.
        geometry : CylinderGeometry
            Geometry at the joint angles.
        v : ndarray, shape (d,)
            Joint velocities [rad/s].
        step : float
            Length of the step [s].

        Returns
        -------
        opening : ndarray, shape (d,)
            Valve openings at the end.
        pressures : ndarray, shape (2, d)
            Pressures at the end [Pa].
        """
        decay = np.exp(-2.0 * np.pi * self.hydraulics.valve_bandwidth * step)
        new_opening = u + (opening - u) * decay
        x = 0.5 * (opening + new_opening)
        # the flows and the decay share the pressure drop, which the force loop needs very often
        drop, size = self.line_pressures(x) - pressures, np.abs(x)
        smooth_drop = np.hypot(drop, _LAMINAR_DROP)
        flows = size * (self._valve_gain * drop / np.sqrt(smooth_drop))
        change = step * self._pressure_rates(flows, pressures, geometry, v)
        change /= 1.0 + step * self._decay(size, drop, smooth_drop, geometry)
        return new_opening, np.maximum(pressures + change, VACUUM)

    def opening_for(
        self, force_rate: Array, pressures: Array, geometry: CylinderGeometry, v: Array
    ) -> Array:
        """Return the valve opening that changes the force at a given rate while the joints move.

        Parameters
        ----------
        force_rate : ndarray, shape (d,)
            Rate of change Ḟ of the force [N/s].
        pressures : ndarray, shape (2, d)
            Pressures of the chambers A and B [Pa].
        geometry : CylinderGeometry
            Geometry at the joint angles.
        v : ndarray, shape (d,)
            Joint velocities [rad/s].

        Returns
        -------
        ndarray, shape (d,)
            Valve openings, which can lie outside -1 to 1.

        Notes
        -----
        Ḟ = x g - k ℓ̇, where k is the stiffness of the oil and g is the rate of change of the force
        when the valve is fully open. Hence x = (Ḟ + k ℓ̇) / g, which includes a feedforward of the
        piston velocity. Leakage is left to the integral of the force loop.
        """
        valve_force_rate = force_rate + geometry.stiffness * geometry.lever * v
        flows = self.orifice_flow(self.line_pressures(valve_force_rate) - pressures)
        gain = np.sign(valve_force_rate) * self.force(flows / geometry.compliance)
        return valve_force_rate / np.maximum(gain, _MIN_GAIN)

    def power(
        self, x: Array, pressures: Array, geometry: CylinderGeometry, v: Array
    ) -> PowerBalance:
        """Return the power flows at one instant.

        Parameters
        ----------
        x : ndarray, shape (d,)
            Valve openings.
        pressures : ndarray, shape (2, d)
            Pressures of the chambers A and B [Pa].
        geometry : CylinderGeometry
            Geometry at the joint angles.
        v : ndarray, shape (d,)
            Joint velocities [rad/s].

        Returns
        -------
        PowerBalance
            The power flows.
        """
        flows, line = self.valve_flows(x, pressures), self.line_pressures(x)
        filling = geometry.compliance * pressures * self.pressure_rates(x, pressures, geometry, v)
        leaked = pressures * self.leakage_flow(pressures)
        pump, valve, leakage, stored = (
            read_only(np.sum(power, axis=0))
            for power in (line * flows, (line - pressures) * flows, leaked, filling)
        )
        joint = read_only(self.force(pressures) * geometry.lever * v)
        return PowerBalance(pump, joint, valve, leakage, stored)
