"""Lesson B, Torque is an abstraction: one cylinder on a test bench, in plain numbers, quick enough for a slider."""

from __future__ import annotations

from collections.abc import Callable
from math import acos, cos, exp, hypot, pi, sin, sqrt
from typing import NamedTuple

from floatbase.actuators import VACUUM, Hydraulics

KNEE = (
    45.43  # N·m: go2's torque limit at the knee, which its cylinder gives where the lever is longest, in the weaker direction
)
LAMINAR = 1e5  # Pa: as the package's cylinders have it; a test compares both
PARTS = 5  # of a millisecond
CORNER = 0.05  # of a loop's bandwidth: where its integral begins
ROUNDING = 1e-9  # rad
LEAST = 1e-9  # N·m/s: a valve that changes the torque by less, all open, is left shut

Motion = Callable[[float], tuple[float, float]]


class Row(NamedTuple):
    """The bench at one time: s; N·m; what the valve was told, -1 to 1; Pa of chambers A and B; angle, rad from the centre."""

    time: float
    torque: float
    u: float
    a: float
    b: float
    angle: float


def held_then_turned(speed: float, start: float = 0.15, end: float = 0.6) -> Motion:
    """The joint is held at its centre until `start`, s, then turned evenly, rad/s, and from `end`, rad, on held again.

    speed: ≥ 0; the rod goes out.
    """

    def motion(t: float) -> tuple[float, float]:
        angle = speed * (t - start)
        return (0.0, 0.0) if t < start else (angle, speed) if angle < end - ROUNDING else (end, 0.0)

    return motion


class Bench:
    """The hydraulic cylinder of a knee of go2. The bench holds or turns the joint, whatever its torque; the valve is yours.

    `step(u)` tells the valve u, from -1 to 1, and lets a millisecond pass. `torque`, N·m, is what the joint gets, `wanted`
    what it should; `rows` is the record. Equations, spool and steps are those of `Cylinders` and `HydraulicActuators`.

    motion: t -> angle and velocity of the joint, rad from the centre and rad/s; held, by default.
    wanted: N·m, at t ≥ 0. The bench begins at zero torque.
    hydraulics: the cylinder that is scaled to the knee.
    """

    dt = 1e-3  # s, of a step

    def __init__(self, motion: Motion | None = None, wanted: float = 12.0, hydraulics: Hydraulics | None = None):
        h = self.hydraulics = hydraulics or Hydraulics()
        reference = Hydraulics()  # the supply may change, the cylinder does not
        size = KNEE / reference.weakest_torque
        self.motion, self.wanted = motion or held_then_turned(0.0), wanted
        self.crank, self.base = h.crank * size ** (1 / 3), h.base * size ** (1 / 3)
        self.area, self.ring = (float(area) * size ** (2 / 3) for area in h.areas)
        self._dead, self._leakage, self._flow = h.dead_volume * size, h.leakage * size, h.valve_gain * size
        self._best, self.time, self.opening = acos(h.crank / h.base), 0.0, 0.0
        lines = h.supply_pressure + h.tank_pressure
        self.a = self.ring * lines / (self.area + self.ring)  # no force, and as much missing at A as is too much at B
        self.b = lines - self.a
        self._place()
        self.rows = [self._row(0.0)]

    def _place(self) -> None:
        """Take the angle, the velocity and what follows from them."""
        self.angle, self.velocity = self.motion(self.time)
        gamma = self._best + self.angle
        length = sqrt(self.base**2 + self.crank**2 - 2.0 * self.base * self.crank * cos(gamma))
        self.lever = self.base * self.crank * sin(gamma) / length
        out = length - (self.base - self.crank)
        beta = self.hydraulics.bulk_modulus
        self._soft_a = (self._dead + self.area * out) / beta
        self._soft_b = (self._dead + self.ring * (2.0 * self.crank - out)) / beta

    @property
    def torque(self) -> float:
        """What the joint gets, N·m."""
        return self.lever * (self.area * self.a - self.ring * self.b)

    @property
    def volumes(self) -> tuple[float, float]:
        """Of the oil in the chambers A and B, m³."""
        beta = self.hydraulics.bulk_modulus
        return self._soft_a * beta, self._soft_b * beta

    @property
    def spring(self) -> float:
        """What closed chambers are for the joint, N·m/rad: L² k."""
        return self.lever**2 * (self.area**2 / self._soft_a + self.ring**2 / self._soft_b)

    def rate(self, side: float = 1.0) -> float:
        """How fast the torque changes with the valve all open, N·m/s: the way that `side` says, 1 or -1."""
        p_a, p_b = self._lines(side)
        into_a, into_b = self._edge(p_a - self.a), self._edge(p_b - self.b)
        return self.lever * (self.area * into_a / self._soft_a - self.ring * into_b / self._soft_b) * side

    def reach(self) -> tuple[float, float]:
        """The least and the largest torque that supply and tank allow at this angle, N·m."""
        high, low = self.hydraulics.supply_pressure, self.hydraulics.tank_pressure
        pulled = self.lever * (self.area * low - self.ring * high)
        pushed = self.lever * (self.area * high - self.ring * low)
        return min(pulled, pushed), max(pulled, pushed)

    def step(self, u: float) -> None:
        """Tell the valve u and let a millisecond pass."""
        u = min(1.0, max(-1.0, u))
        step = self.dt / PARTS
        for _ in range(PARTS):
            self.advance(u, step)
        self.note(u)

    def note(self, u: float) -> None:
        """Move on by a millisecond, and keep a row."""
        self.time = self.dt * len(self.rows)
        self._place()
        self.rows.append(self._row(u))

    def _row(self, u: float) -> Row:
        return Row(self.time, self.torque, u, self.a, self.b, self.angle)

    def _lines(self, x: float) -> tuple[float, float]:
        high, low = self.hydraulics.supply_pressure, self.hydraulics.tank_pressure
        return (high if x >= 0.0 else low), (high if -x >= 0.0 else low)

    def _edge(self, drop: float) -> float:
        return self._flow * drop / sqrt(hypot(drop, LAMINAR))

    def _slope(self, drop: float) -> float:
        return self._flow * (0.5 * drop**2 + LAMINAR**2) / hypot(drop, LAMINAR) ** 2.5

    def advance(self, u: float, step: float) -> None:
        """Let `step` s pass with the valve told u: the spool exactly, the pressures by linearly implicit Euler."""
        opening = u + (self.opening - u) * exp(-2.0 * pi * self.hydraulics.valve_bandwidth * step)
        x, self.opening = 0.5 * (self.opening + opening), opening
        (p_a, p_b), leak, way = self._lines(x), self._leakage * (self.a - self.b), self.lever * self.velocity
        drop_a, drop_b = p_a - self.a, p_b - self.b
        rate_a = (abs(x) * self._edge(drop_a) - leak - self.area * way) / self._soft_a
        rate_b = (abs(x) * self._edge(drop_b) + leak + self.ring * way) / self._soft_b
        decay_a = (abs(x) * self._slope(drop_a) + self._leakage) / self._soft_a
        decay_b = (abs(x) * self._slope(drop_b) + self._leakage) / self._soft_b
        self.a = max(VACUUM, self.a + step * rate_a / (1.0 + step * decay_a))
        self.b = max(VACUUM, self.b + step * rate_b / (1.0 + step * decay_b))


def run_loop(bench: Bench, bandwidth: float, time: float) -> list[Row]:
    """The package's force loop of so many Hz on the bench for `time` s: its rows."""
    rate, total, step = 2.0 * pi * bandwidth, 0.0, bench.dt / PARTS
    for _ in range(round(time / bench.dt)):
        least, most = bench.reach()
        wanted = min(most, max(least, bench.wanted))
        for _ in range(PARTS):
            e = (wanted - bench.torque) / bench.lever  # N, of the piston
            change = bench.lever * rate * (e + CORNER * rate * total) + bench.spring * bench.velocity
            u = _opening(bench, change)
            total += step * e if abs(u) < 1.0 else 0.0
            bench.advance(min(1.0, max(-1.0, u)), step)
        bench.note(u)
    return bench.rows


def _opening(bench: Bench, change: float) -> float:
    """The opening for which the valve changes the torque by `change`, N·m/s; it may be beyond -1 to 1."""
    full = bench.rate(1.0 if change >= 0.0 else -1.0)
    return change / full if full > LEAST else 0.0
