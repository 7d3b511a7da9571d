"""All that can be set in the playground, as one value, and as the lines of Python that the
playground itself runs.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache

from floatbase._validation import Value
from floatbase.dynamics import Contacts
from floatbase.errors import FloatbaseError
from floatbase.playground.equation import EQUATION
from floatbase.robots import Robot, load
from floatbase.simulation import Push

GAITS = {
    4: {"trot": "Gait.trot", "crawl": "Gait.crawl"},
    2: {"walk": "Gait.walk"},
}  # by number of feet
RECOVERY_GAITS = {
    4: "Gait.trot(robot, swing=0.2)",
    2: "Gait.walk(robot, swing=0.4)",
}  # with which a robot steps_when_pushed itself
IDEAL_BANDWIDTH = 100.0  # Hz: actuators at this end of their slider are perfect
FIRST_STEP_DELAY = 1.0  # s from a control to the first step
_IDEAL_KP = 100.0  # 1/s², of tasks with perfect actuators
_LIFT_HEIGHT = 0.04  # m that a foot which is to leave the ground is lifted


@dataclass(frozen=True, eq=False)
class Settings(Value):
    """What the playground's controls set. Pairs are (believed by the controller, true in the
    world).

    friction: coefficients.
    slope: degrees, how much the ground rises forwards.
    mass: of all parts, as a multiple of the robot's own.
    bandwidth: Hz, of the actuators; `IDEAL_BANDWIDTH` is a perfect one. The believed one sets how
        fast the tasks answer.
    facets: of the friction polyhedra.
    lifted_feet: names of contacts that are to leave the ground.
    shift: (3,) m, of the centre of mass.
    nod: rad, half the width of the ellipse in pitch and yaw that the base describes.
    torque_fraction: part of the motors' limits that the controller uses.
    min_normal_force: N, the least normal force that the controller plans at each point.
    weights: factors of the weights of motion (centre of mass, base), of posture, and of effort
        (torques, forces).
    gait: among those of `GAITS`, or None to stand.
    velocity: m/s forwards and to the left, rad/s to the left, of a gait.
    steps_when_pushed: whether it steps when it must.
    assumed_off, actual_off: names of terms of `EQUATION` that are switched off in the controller's
        belief, and in the world.
    leg: the contact whose force the term "forces" switches off.
    start_time: s, on the clock, when the gait or the ellipse was chosen.
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

    @property
    def is_nominal(self) -> bool:
        """Whether the world is as the robot's data sheet has it."""
        return self.mass[1] == 1.0 and not self.actual_off

    def ground(self) -> str:
        """An expression for the ground."""
        mu, slope = self.friction[1], self.slope[1]
        return f"{mu:g}" if slope == 0.0 else f"fb.Ground({mu:g}, normal={_normal(slope)})"

    def perturbation(self, robot: Robot) -> str:
        """An expression for the world of a `PerturbedSimulation`."""
        off, parts = self.actual_off, []
        if self.mass[1] != 1.0:
            parts.append(f"mass={self.mass[1]:g}")
        parts += [
            f"{term.perturbation_option}=False"
            for term in EQUATION
            if term.perturbation_option and term.name in off
        ]
        if "forces" in off:
            parts.append(
                f"disabled_contacts={list(Contacts.feet(robot).only(self.leg).point_names)}"
            )
        if "cones" in off:
            parts.append(f"adhesion_force={robot.weight:.0f}")
        return f"Perturbation({', '.join(parts)})"

    def mismatch(self) -> str:
        """An expression for what the controller believes; "" for the truth."""
        off, parts = self.assumed_off, []
        if self.mass[0] != 1.0:
            parts.append(f"mass={self.mass[0]:g}")
        parts += [
            f"{term.mismatch_option}=False"
            for term in EQUATION
            if term.mismatch_option and term.name in off
        ]
        if "forces" in off and self.leg not in self.lifted_feet:
            parts.append(f'ignored_contacts=["{self.leg}"]')
        return f"ModelMismatch({', '.join(parts)})" if parts else ""

    def simulation_lines(self, robot: Robot) -> list[str]:
        """Lines that make `sim`, `state` where it stands in it, and `actuators` for `robot`."""
        if self.is_nominal:
            lines = [f"sim = fb.Simulation(robot, {self.ground()})"]
        else:
            lines = [
                f"sim = PerturbedSimulation(robot, {self.ground()}, "
                f"perturbation={self.perturbation(robot)})"
            ]
        return [*lines, "state = sim.state", *self.actuator_lines()]

    def actuator_lines(self) -> list[str]:
        """Lines that make `actuators` for `robot` and `state`: slow ones begin with the torques
        that hold it up.
        """
        hertz = self.bandwidth[1]
        if hertz >= IDEAL_BANDWIDTH:
            return ["actuators = None"]
        return [
            f"actuators = FirstOrderLag(robot, {hertz:g})",
            "hold = fb.WholeBodyController(robot, fb.Contacts.feet(robot), "
            "fb.standing_tasks(state))",
            "actuators.reset(hold(state.q, state.v).tau)",
        ]

    def controller_lines(self, robot: Robot) -> list[str]:
        """Lines that make `controller` for `robot`, `sim` and `state`, where it is to stand."""
        mismatch, normals = (
            self.mismatch(),
            "" if self.slope[0] == 0.0 else f", normals={_normal(self.slope[0])}",
        )
        options = f", facets={self.facets}" if self.facets != 4 else ""
        options += (
            f", torque_limits={self.torque_fraction:g} * robot.torque_limits"
            if self.torque_fraction != 1.0
            else ""
        )
        options += f", min_normal_force={self.min_normal_force:g}" if self.min_normal_force else ""
        options += f", mismatch={mismatch}" if mismatch else ""
        lines = [f"contacts = fb.Contacts.feet(robot, {self.friction[0]:g}{normals})"]
        n = len(robot.feet)
        if self.gait is not None:
            gait = f"{GAITS[n][self.gait]}(robot, start={self.start_time + FIRST_STEP_DELAY:.6g})"
            forwards, left, turn = self.velocity
            lines.append(
                f"controller = Walk(robot, contacts, {gait}, [{forwards:g}, {left:g}], "
                f"{turn:g}{options})"
            )
        elif self.steps_when_pushed:
            lines.append(f"controller = Stand(robot, contacts, {RECOVERY_GAITS[n]}{options})")
        else:
            lines += self._standing_lines(options)
        if "zeros" in self.actual_off:
            lines.append(
                f"controller = BaseMotors(controller, sim{', ' + mismatch if mismatch else ''})"
            )
        return lines

    def _standing_lines(self, options: str) -> list[str]:
        """Lines of a controller that stands."""
        motion, posture, effort = self.weights
        kp = min(
            _IDEAL_KP, (2.0 * math.pi * self.bandwidth[0]) ** 2
        )  # behind a lag ω, 4 ω² is the border of what dies out
        gains = "" if kp == _IDEAL_KP else f", kp={kp:.4g}"
        weight = "" if motion == 1.0 else f", weight={10.0 * motion:g}"
        com = (
            "state.com"
            if not any(self.com_shift)
            else f"state.com + {[round(float(x), 6) for x in self.com_shift]}"
        )
        level = "state.frame_pose('base').rotation"
        if self.nod:
            level = f"nodding_rotation({level}, {self.nod:g}, {self.start_time:.6g})"
        lines = [
            f"com = fb.CoMTask({com}{gains}{weight})",
            f"level = fb.OrientationTask('base', {level}{gains}{weight})",
            f"posture = fb.PostureTask(state.q{'' if posture == 1.0 else f', weight={1e-3 * posture:g}'})",
        ]
        tasks = "com, level, posture"
        if effort != 1.0:
            lines.append(
                f"effort = fb.ForceTask(weight={1e-5 * effort:g}), "
                f"fb.TorqueTask(weight={1e-5 * effort:g})"
            )
            tasks += ", *effort"
        for i, name in enumerate(self.lifted_feet):
            lines.append(
                f"lift_{i} = fb.FrameTask('{name}', state.point('{name}') + [0.0, 0.0, "
                f"{_LIFT_HEIGHT:g}])"
            )
            tasks += f", lift_{i}"
        if self.lifted_feet:
            lines.append(
                f"contacts = contacts.without({', '.join(repr(name) for name in self.lifted_feet)})"
            )
        return [*lines, f"controller = fb.WholeBodyController(robot, contacts, [{tasks}]{options})"]

    def code(self, robot: Robot, period: float, push: Push | None = None) -> str:
        """A program that makes and runs the same robot for 3 s.

        period: s, of the controller. push: an `fb.Push`, or None.
        """
        body = [*self.simulation_lines(robot), *self.controller_lines(robot)]
        text = "\n".join(body)
        pushes = ""
        if push is not None:
            force = [round(x, 3) for x in push.force.tolist()]
            frame = "" if push.frame == "base" else f", frame={push.frame!r}"
            pushes = f", [fb.Push({force}, 0.5, {push.duration:g}{frame})]"
        rest = f"{pushes}, control_period={period:g}, actuators=actuators)"
        run = f"run = fb.rollout(sim, controller, {_whole_periods(3.0, period)}{rest}"
        imports = [line for words, line in _IMPORTS if any(word in text for word in words)]
        lines = [*imports, "", f"robot = {_load_call(robot)}"]
        return "\n".join([*lines, *body, run, 'print(run.outcome, f"at {run.time[-1]:.2f} s")', ""])


_IMPORTS = (
    (("fb.",), "import floatbase as fb"),
    (("FirstOrderLag",), "from floatbase.actuators import FirstOrderLag"),
    (("Gait", "Walk", "Stand("), "from floatbase.behaviours import Gait, Stand, Walk"),
    (("ModelMismatch",), "from floatbase.control import ModelMismatch"),
    (
        ("BaseMotors", "nodding_rotation"),
        "from floatbase.playground import BaseMotors, nodding_rotation",
    ),
    (("Perturbed",), "from floatbase.simulation import Perturbation, PerturbedSimulation"),
)


@lru_cache(maxsize=8)
def _load_call(robot: Robot) -> str:
    """The call that loads a robot: one that `load` does not give comes from the file that its name
    tells.

    User-defined limits, locked joints and feet of several radii are not told.
    """
    with suppress(FloatbaseError):
        if load(robot.name) == robot:
            return f"fb.load({robot.name!r})"
    given = [repr(f"{robot.name}.urdf"), *([] if robot.is_floating else ["floating=False"])]
    if robot.feet:
        given += [
            f"feet={[foot.frame for foot in robot.feet]}",
            f"foot_radius={robot.feet[0].radius!r}",
        ]
    return f"fb.load_urdf({', '.join(given)})"


def _normal(slope: float) -> list[float]:
    """Normal of a ground that rises forwards by so many degrees."""
    angle = math.radians(slope)
    return [round(-math.sin(angle), 6), 0.0, round(math.cos(angle), 6)]


def _whole_periods(time: float, period: float) -> str:
    """About `time` s, as a whole number of periods."""
    return f"{round(time / period) * period:.6g}"
