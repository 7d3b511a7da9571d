"""Lesson B, Torque is an abstraction: one cylinder on a test bench, in plain numbers, quick enough
for a slider.
"""

from __future__ import annotations

from collections.abc import Callable
from math import acos, cos, exp, hypot, pi, sin, sqrt
from typing import NamedTuple

from floatbase.actuators import VACUUM, Hydraulics

# N·m: go2's torque limit at the knee, which its cylinder gives where the lever is longest, in the
# weaker direction
KNEE_TORQUE = 45.43
LAMINAR_PRESSURE = 1e5  # Pa: as the package's cylinders have it; a test compares both
SUBSTEPS = 5  # of a millisecond
INTEGRAL_CORNER = 0.05  # of a loop's bandwidth: where its integral begins
ROUNDING = 1e-9  # rad
MIN_TORQUE_RATE = 1e-9  # N·m/s: a valve that changes the torque by less, all open, is left shut

JointMotion = Callable[[float], tuple[float, float]]


class BenchSample(NamedTuple):
    """The bench at one time: s; N·m; what the valve was told, -1 to 1; Pa of chambers A and B;
    angle, rad from the centre.
    """

    time: float
    torque: float
    u: float
    pressure_a: float
    pressure_b: float
    angle: float


def hold_then_turn(speed: float, start: float = 0.15, end: float = 0.6) -> JointMotion:
    """The joint is held at its centre until `start`, s, then turned evenly, rad/s, and from `end`,
    rad, on held again.

    speed: ≥ 0; the rod goes out.
    """

    def motion(t: float) -> tuple[float, float]:
        angle = speed * (t - start)
        return (0.0, 0.0) if t < start else (angle, speed) if angle < end - ROUNDING else (end, 0.0)

    return motion


class Bench:
    """The hydraulic cylinder of a knee of go2. The bench holds or turns the joint, whatever its
    torque; the valve is yours.

    `step(u)` tells the valve u, from -1 to 1, and lets a millisecond pass. `torque`, N·m, is what
    the joint gets, `desired_torque` what it should; `samples` is the record. Equations, spool and
    steps are those of `Cylinders` and `HydraulicActuators`.

    motion: t -> angle and velocity of the joint, rad from the centre and rad/s; held, by default.
    desired_torque: N·m, at t ≥ 0. The bench begins at zero torque.
    hydraulics: the cylinder that is scaled to the knee.
    """

    dt = 1e-3  # s, of a step

    def __init__(
        self,
        motion: JointMotion | None = None,
        desired_torque: float = 12.0,
        hydraulics: Hydraulics | None = None,
    ):
        h = self.hydraulics = hydraulics or Hydraulics()
        reference = Hydraulics()  # the supply may change, the cylinder does not
        size = KNEE_TORQUE / reference.weakest_torque
        self.motion, self.desired_torque = motion or hold_then_turn(0.0), desired_torque
        self.crank, self.base = h.crank * size ** (1 / 3), h.base * size ** (1 / 3)
        self.piston_area, self.ring_area = (float(area) * size ** (2 / 3) for area in h.areas)
        self._dead, self._leakage, self._flow = (
            h.dead_volume * size,
            h.leakage * size,
            h.valve_gain * size,
        )
        self._best, self.time, self.opening = acos(h.crank / h.base), 0.0, 0.0
        lines = h.supply_pressure + h.tank_pressure
        self.pressure_a = (
            self.ring_area * lines / (self.piston_area + self.ring_area)
        )  # no force, and as much missing at A as is too much at B
        self.pressure_b = lines - self.pressure_a
        self._update_geometry()
        self.samples = [self._sample(0.0)]

    def _update_geometry(self) -> None:
        """Take the angle, the velocity and what follows from them."""
        self.angle, self.velocity = self.motion(self.time)
        gamma = self._best + self.angle
        length = sqrt(self.base**2 + self.crank**2 - 2.0 * self.base * self.crank * cos(gamma))
        self.lever = self.base * self.crank * sin(gamma) / length
        out = length - (self.base - self.crank)
        beta = self.hydraulics.bulk_modulus
        self._compliance_a = (self._dead + self.piston_area * out) / beta
        self._compliance_b = (self._dead + self.ring_area * (2.0 * self.crank - out)) / beta

    @property
    def torque(self) -> float:
        """What the joint gets, N·m."""
        return self.lever * (self.piston_area * self.pressure_a - self.ring_area * self.pressure_b)

    @property
    def volumes(self) -> tuple[float, float]:
        """Of the oil in the chambers A and B, m³."""
        beta = self.hydraulics.bulk_modulus
        return self._compliance_a * beta, self._compliance_b * beta

    @property
    def stiffness(self) -> float:
        """What closed chambers are for the joint, N·m/rad: L² k."""
        return self.lever**2 * (
            self.piston_area**2 / self._compliance_a + self.ring_area**2 / self._compliance_b
        )

    def torque_rate(self, side: float = 1.0) -> float:
        """How fast the torque changes with the valve all open, N·m/s: the way that `side` says, 1
        or -1.
        """
        p_a, p_b = self._line_pressures(side)
        into_a, into_b = (
            self._valve_flow(p_a - self.pressure_a),
            self._valve_flow(p_b - self.pressure_b),
        )
        return (
            self.lever
            * (
                self.piston_area * into_a / self._compliance_a
                - self.ring_area * into_b / self._compliance_b
            )
            * side
        )

    def torque_range(self) -> tuple[float, float]:
        """The least and the largest torque that supply and tank allow at this angle, N·m."""
        high, low = self.hydraulics.supply_pressure, self.hydraulics.tank_pressure
        pulled = self.lever * (self.piston_area * low - self.ring_area * high)
        pushed = self.lever * (self.piston_area * high - self.ring_area * low)
        return min(pulled, pushed), max(pulled, pushed)

    def step(self, u: float) -> None:
        """Tell the valve u and let a millisecond pass."""
        u = min(1.0, max(-1.0, u))
        step = self.dt / SUBSTEPS
        for _ in range(SUBSTEPS):
            self.advance(u, step)
        self.record_sample(u)

    def record_sample(self, u: float) -> None:
        """Move on by a millisecond, and keep a row."""
        self.time = self.dt * len(self.samples)
        self._update_geometry()
        self.samples.append(self._sample(u))

    def _sample(self, u: float) -> BenchSample:
        return BenchSample(self.time, self.torque, u, self.pressure_a, self.pressure_b, self.angle)

    def _line_pressures(self, x: float) -> tuple[float, float]:
        high, low = self.hydraulics.supply_pressure, self.hydraulics.tank_pressure
        return (high if x >= 0.0 else low), (high if -x >= 0.0 else low)

    def _valve_flow(self, drop: float) -> float:
        return self._flow * drop / sqrt(hypot(drop, LAMINAR_PRESSURE))

    def _flow_slope(self, drop: float) -> float:
        return (
            self._flow
            * (0.5 * drop**2 + LAMINAR_PRESSURE**2)
            / hypot(drop, LAMINAR_PRESSURE) ** 2.5
        )

    def advance(self, u: float, step: float) -> None:
        """Let `step` s pass with the valve told u: the spool exactly, the pressures by linearly
        implicit Euler.
        """
        opening = u + (self.opening - u) * exp(-2.0 * pi * self.hydraulics.valve_bandwidth * step)
        x, self.opening = 0.5 * (self.opening + opening), opening
        (p_a, p_b), leak, way = (
            self._line_pressures(x),
            self._leakage * (self.pressure_a - self.pressure_b),
            self.lever * self.velocity,
        )
        drop_a, drop_b = p_a - self.pressure_a, p_b - self.pressure_b
        rate_a = (
            abs(x) * self._valve_flow(drop_a) - leak - self.piston_area * way
        ) / self._compliance_a
        rate_b = (
            abs(x) * self._valve_flow(drop_b) + leak + self.ring_area * way
        ) / self._compliance_b
        decay_a = (abs(x) * self._flow_slope(drop_a) + self._leakage) / self._compliance_a
        decay_b = (abs(x) * self._flow_slope(drop_b) + self._leakage) / self._compliance_b
        self.pressure_a = max(VACUUM, self.pressure_a + step * rate_a / (1.0 + step * decay_a))
        self.pressure_b = max(VACUUM, self.pressure_b + step * rate_b / (1.0 + step * decay_b))


def run_force_loop(bench: Bench, bandwidth: float, time: float) -> list[BenchSample]:
    """The package's force loop of so many Hz on the bench for `time` s: its rows."""
    rate, total, step = 2.0 * pi * bandwidth, 0.0, bench.dt / SUBSTEPS
    for _ in range(round(time / bench.dt)):
        least, most = bench.torque_range()
        wanted = min(most, max(least, bench.desired_torque))
        for _ in range(SUBSTEPS):
            e = (wanted - bench.torque) / bench.lever  # N, of the piston
            change = (
                bench.lever * rate * (e + INTEGRAL_CORNER * rate * total)
                + bench.stiffness * bench.velocity
            )
            u = _valve_opening(bench, change)
            total += step * e if abs(u) < 1.0 else 0.0
            bench.advance(min(1.0, max(-1.0, u)), step)
        bench.record_sample(u)
    return bench.samples


def _valve_opening(bench: Bench, change: float) -> float:
    """The opening for which the valve changes the torque by `change`, N·m/s; it may be beyond -1 to
    1.
    """
    full = bench.torque_rate(1.0 if change >= 0.0 else -1.0)
    return change / full if full > MIN_TORQUE_RATE else 0.0
