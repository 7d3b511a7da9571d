"""Settings of the playground as one checked value."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields

from floatbase._validation import (
    Value,
    as_array,
    as_bool,
    as_integer,
    as_number,
    as_positive,
    as_string,
    as_strings,
)
from floatbase.behaviours import Gait
from floatbase.errors import unknown_name
from floatbase.friction._polytopes import MAX_FACETS
from floatbase.playground.equation import EQUATION

GAITS: dict[int, dict[str, Callable[..., Gait]]] = {  # by number of feet
    4: {"trot": Gait.trot, "crawl": Gait.crawl},
    2: {"walk": Gait.walk},
}
IDEAL_BANDWIDTH = 100.0  # Hz: actuators with this bandwidth, the end of the slider, are ideal
IDEAL_KP = 100.0  # 1/s², gain of tasks with ideal actuators
_MAX_SLOPE = 89.0  # degrees: at 90 the ground is a wall
_MAX_SHIFT = 10.0  # m: a larger value is probably in the wrong unit
_MAX_SPEED = 5.0  # m/s and rad/s: a larger value is probably in the wrong unit
_GAIT_NAMES = tuple(name for gaits in GAITS.values() for name in gaits)


@dataclass(frozen=True)
class Settings(Value):
    """Settings of the playground.

    Pairs are (nominal, actual): the first value is what the controller assumes, the second is what
    holds in the simulation. Numbers are rounded to six digits, so that `Session.code` shows the
    same values.

    Parameters
    ----------
    friction : tuple of float
        Friction coefficients, nominal and actual, dimensionless.
    slope : tuple of float
        Rise of the ground in the forward direction, nominal and actual [degrees].
    mass : tuple of float
        Masses of all parts as a multiple of the robot's own, nominal and actual, dimensionless.
    bandwidth : tuple of float
        Bandwidth of the actuators, nominal and actual [Hz]; at `IDEAL_BANDWIDTH` they are ideal.
        The nominal one limits the gains of the tasks.
    facets : int
        Number of facets of the friction polyhedra.
    lifted_feet : tuple of str
        Names of contacts that leave the ground.
    com_shift : tuple of float
        Displacement of the centre of mass in the world frame, three numbers [m].
    nod : float
        Half the width of the ellipse in pitch and yaw that the base describes [rad].
    torque_fraction : float
        Fraction of the torque limits that the controller uses, dimensionless.
    min_normal_force : float
        Smallest normal force that the controller plans at each point [N].
    weights : tuple of float
        Factors of the weights of motion (centre of mass, base), posture, and effort (torques,
        forces), dimensionless.
    gait : str or None
        Name of a gait in `GAITS`, or None to stand.
    velocity : tuple of float
        Walking velocity: forward [m/s], to the left [m/s], and yaw rate to the left [rad/s].
    steps_when_pushed : bool
        Whether the robot takes steps to recover from pushes.
    assumed_off : tuple of str
        Names of terms of `EQUATION` that are switched off in the controller's model.
    actual_off : tuple of str
        Names of terms of `EQUATION` that are switched off in the simulation.
    leg : str
        Contact whose force the term "forces" switches off.
    start_time : float
        Time at which the gait or the ellipse was selected [s].

    Raises
    ------
    InputError
        If a value has the wrong type or is out of range.
    UnknownNameError
        If a gait or a term does not exist. Names of feet and the robot's gaits are checked by
        `Session`, which knows the robot.
    """

    friction: tuple[float, float] = (0.7, 0.7)
    slope: tuple[float, float] = (0.0, 0.0)
    mass: tuple[float, float] = (1.0, 1.0)
    bandwidth: tuple[float, float] = (IDEAL_BANDWIDTH, IDEAL_BANDWIDTH)
    facets: int = 4
    lifted_feet: tuple[str, ...] = ()
    com_shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    nod: float = 0.0
    torque_fraction: float = 1.0
    min_normal_force: float = 0.0
    weights: tuple[float, float, float] = (1.0, 1.0, 1.0)
    gait: str | None = None
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    steps_when_pushed: bool = False
    assumed_off: tuple[str, ...] = ()
    actual_off: tuple[str, ...] = ()
    leg: str = ""
    start_time: float = 0.0

    def __post_init__(self) -> None:
        for name in ("friction", "mass", "bandwidth", "weights"):
            self._keep(name, [as_positive(name, x) for x in self._entries(name)])
        for name, unit, limit in (
            ("slope", "°", _MAX_SLOPE),
            ("com_shift", "m", _MAX_SHIFT),
            ("velocity", "m/s and rad/s", _MAX_SPEED),
        ):
            numbers = [as_number(name, x, unit, -limit, limit) for x in self._entries(name)]
            self._keep(name, [round(x, 6) for x in numbers])
        self._keep("facets", as_integer("facets", self.facets, 3, MAX_FACETS))
        self._keep("nod", as_positive("nod", self.nod, "rad", True, 0.5 * math.pi))
        fraction = as_positive("torque_fraction", self.torque_fraction, maximum=1.0)
        self._keep("torque_fraction", fraction)
        force = as_positive("min_normal_force", self.min_normal_force, "N", True)
        self._keep("min_normal_force", force)
        self._keep("start_time", as_number("start_time", self.start_time, "s"))
        self._keep("steps_when_pushed", as_bool("steps_when_pushed", self.steps_when_pushed))
        as_string("leg", self.leg)
        if self.gait is not None and as_string("gait", self.gait) not in _GAIT_NAMES:
            raise unknown_name("gait", self.gait, _GAIT_NAMES)
        for name in ("lifted_feet", "assumed_off", "actual_off"):
            self._keep(name, dict.fromkeys(as_strings(name, getattr(self, name))))
        for name in ("assumed_off", "actual_off"):
            terms = [term.name for term in EQUATION if name in term.switches]
            for off in getattr(self, name):
                if off not in terms:
                    raise unknown_name(f"term of {name}", off, terms)

    def _entries(self, name: str) -> list[float]:
        """Return the numbers of a field, as many as its default has."""
        n = len(getattr(type(self), name))  # entries of the default
        entries: list[float] = as_array(name, getattr(self, name), (n,)).tolist()
        return entries

    def _keep(self, name: str, value: object) -> None:
        """Store a checked field: numbers rounded, sequences as tuples."""
        if isinstance(value, (list, dict)):
            value = tuple(six_digits(x) if isinstance(x, float) else x for x in value)
        object.__setattr__(self, name, six_digits(value) if isinstance(value, float) else value)

    @property
    def normals(self) -> tuple[list[float], ...]:
        """Nominal and actual normal of the ground, shape (3,) each, world frame."""
        angles = [math.radians(slope) for slope in self.slope]
        return tuple([round(-math.sin(a), 6), 0.0, round(math.cos(a), 6)] for a in angles)

    @property
    def kp(self) -> float:
        """Gain of the motion tasks [1/s²]; a lag of ω rad/s makes gains above 4 ω² unstable."""
        return float(f"{min(IDEAL_KP, (2.0 * math.pi * self.bandwidth[0]) ** 2):.4g}")


SETTING_NAMES = tuple(field.name for field in fields(Settings))
PAIR_NAMES = ("friction", "slope", "mass", "bandwidth")  # settings that are (nominal, actual)


def six_digits(x: float) -> float:
    """Round a number to six significant digits."""
    return float(f"{x:.6g}")
