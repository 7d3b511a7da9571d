"""All that can be set in the playground, as one value, and as the lines of Python that the playground itself runs."""

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

GAITS = {4: {"trot": "Gait.trot", "crawl": "Gait.crawl"}, 2: {"walk": "Gait.walk"}}  # by number of feet
STEPS = {4: "Gait.trot(robot, swing=0.2)", 2: "Gait.walk(robot, swing=0.4)"}  # with which a robot catches itself
IDEAL = 100.0  # Hz: actuators at this end of their slider are perfect
AHEAD = 1.0  # s from a control to the first step
_GAIN = 100.0  # 1/s², of tasks with perfect actuators
_LIFT = 0.04  # m that a foot which is to leave the ground is lifted


@dataclass(frozen=True, eq=False)
class Settings(Value):
    """What the playground's controls set. Pairs are (believed by the controller, true in the world).

    friction: coefficients.
    slope: degrees, how much the ground rises forwards.
    mass: of all parts, as a multiple of the robot's own.
    bandwidth: Hz, of the actuators; `IDEAL` is a perfect one. The believed one sets how fast the tasks answer.
    facets: of the friction polyhedra.
    lifted: names of contacts that are to leave the ground.
    shift: (3,) m, of the centre of mass.
    nod: rad, half the width of the ellipse in pitch and yaw that the base describes.
    torque: part of the motors' limits that the controller uses.
    least_force: N, the least normal force that the controller plans at each point.
    weights: factors of the weights of motion (centre of mass, base), of posture, and of effort (torques, forces).
    gait: among those of `GAITS`, or None to stand.
    velocity: m/s forwards and to the left, rad/s to the left, of a gait.
    catches: whether it steps when it must.
    believed_off, true_off: names of terms of `EQUATION` that are switched off in the controller's belief, and in the world.
    leg: the contact whose force the term "forces" switches off.
    begin: s, on the clock, when the gait or the ellipse was chosen.
    """

    friction: tuple[float, float] = (0.7, 0.7)
    slope: tuple[float, float] = (0.0, 0.0)
    mass: tuple[float, float] = (1.0, 1.0)
    bandwidth: tuple[float, float] = (IDEAL, IDEAL)
    facets: int = 4
    lifted: tuple[str, ...] = ()
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    nod: float = 0.0
    torque: float = 1.0
    least_force: float = 0.0
    weights: tuple[float, float, float] = (1.0, 1.0, 1.0)
    gait: str | None = None
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    catches: bool = False
    believed_off: tuple[str, ...] = ()
    true_off: tuple[str, ...] = ()
    leg: str = ""
    begin: float = 0.0

    @property
    def is_plain(self) -> bool:
        """Whether the world is as the robot's data sheet has it."""
        return self.mass[1] == 1.0 and not self.true_off

    def ground(self) -> str:
        """An expression for the ground."""
        mu, slope = self.friction[1], self.slope[1]
        return f"{mu:g}" if slope == 0.0 else f"fb.Ground({mu:g}, normal={_normal(slope)})"

    def world(self, robot: Robot) -> str:
        """An expression for the world of a `PerturbedSimulation`."""
        off, parts = self.true_off, []
        if self.mass[1] != 1.0:
            parts.append(f"mass={self.mass[1]:g}")
        parts += [f"{term.world}=False" for term in EQUATION if term.world and term.name in off]
        if "forces" in off:
            parts.append(f"disabled_contacts={list(Contacts.feet(robot)[self.leg].point_names)}")
        if "cones" in off:
            parts.append(f"adhesion_force={robot.weight:.0f}")
        return f"Perturbation({', '.join(parts)})"

    def belief(self) -> str:
        """An expression for what the controller believes; "" for the truth."""
        off, parts = self.believed_off, []
        if self.mass[0] != 1.0:
            parts.append(f"mass={self.mass[0]:g}")
        parts += [f"{term.belief}=False" for term in EQUATION if term.belief and term.name in off]
        if "forces" in off and self.leg not in self.lifted:
            parts.append(f'ignored_contacts=["{self.leg}"]')
        return f"ModelMismatch({', '.join(parts)})" if parts else ""

    def world_lines(self, robot: Robot) -> list[str]:
        """Lines that make `sim`, `state` where it stands in it, and `actuators` for `robot`."""
        if self.is_plain:
            lines = [f"sim = fb.Simulation(robot, {self.ground()})"]
        else:
            lines = [f"sim = PerturbedSimulation(robot, {self.ground()}, perturbation={self.world(robot)})"]
        return [*lines, "state = sim.state", *self.actuators_lines()]

    def actuators_lines(self) -> list[str]:
        """Lines that make `actuators` for `robot` and `state`: slow ones begin with the torques that hold it up."""
        hertz = self.bandwidth[1]
        if hertz >= IDEAL:
            return ["actuators = None"]
        return [
            f"actuators = FirstOrderLag(robot, {hertz:g})",
            "hold = fb.WholeBodyController(robot, fb.Contacts.feet(robot), fb.standing_tasks(state))",
            "actuators.reset(hold(state.q, state.v).tau)",
        ]

    def controller_lines(self, robot: Robot) -> list[str]:
        """Lines that make `controller` for `robot`, `sim` and `state`, where it is to stand."""
        belief, normals = self.belief(), "" if self.slope[0] == 0.0 else f", normals={_normal(self.slope[0])}"
        options = f", facets={self.facets}" if self.facets != 4 else ""
        options += f", torque_limits={self.torque:g} * robot.torque_limits" if self.torque != 1.0 else ""
        options += f", min_normal_force={self.least_force:g}" if self.least_force else ""
        options += f", mismatch={belief}" if belief else ""
        lines = [f"contacts = fb.Contacts.feet(robot, {self.friction[0]:g}{normals})"]
        n = len(robot.feet)
        if self.gait is not None:
            gait = f"{GAITS[n][self.gait]}(robot, start={self.begin + AHEAD:.6g})"
            forwards, left, turn = self.velocity
            lines.append(f"controller = Walk(robot, contacts, {gait}, [{forwards:g}, {left:g}], {turn:g}{options})")
        elif self.catches:
            lines.append(f"controller = Stand(robot, contacts, {STEPS[n]}{options})")
        else:
            lines += self._standing_lines(options)
        if "zeros" in self.true_off:
            lines.append(f"controller = BaseMotors(controller, sim{', ' + belief if belief else ''})")
        return lines

    def _standing_lines(self, options: str) -> list[str]:
        """Lines of a controller that stands."""
        motion, posture, effort = self.weights
        kp = min(_GAIN, (2.0 * math.pi * self.bandwidth[0]) ** 2)  # behind a lag ω, 4 ω² is the border of what dies out
        gains = "" if kp == _GAIN else f", kp={kp:.4g}"
        weight = "" if motion == 1.0 else f", weight={10.0 * motion:g}"
        com = "state.com" if not any(self.shift) else f"state.com + {[round(float(x), 6) for x in self.shift]}"
        level = "state.frame_pose('base').rotation"
        if self.nod:
            level = f"nodding({level}, {self.nod:g}, {self.begin:.6g})"
        lines = [
            f"com = fb.CoMTask({com}{gains}{weight})",
            f"level = fb.OrientationTask('base', {level}{gains}{weight})",
            f"posture = fb.PostureTask(state.q{'' if posture == 1.0 else f', weight={1e-3 * posture:g}'})",
        ]
        tasks = "com, level, posture"
        if effort != 1.0:
            lines.append(f"effort = fb.ForceTask(weight={1e-5 * effort:g}), fb.TorqueTask(weight={1e-5 * effort:g})")
            tasks += ", *effort"
        for i, name in enumerate(self.lifted):
            lines.append(f"lift_{i} = fb.FrameTask('{name}', state.point('{name}') + [0.0, 0.0, {_LIFT:g}])")
            tasks += f", lift_{i}"
        if self.lifted:
            lines.append(f"contacts = contacts.without({', '.join(repr(name) for name in self.lifted)})")
        return [*lines, f"controller = fb.WholeBodyController(robot, contacts, [{tasks}]{options})"]

    def code(self, robot: Robot, period: float, push: Push | None = None) -> str:
        """A program that makes and runs the same robot for 3 s.

        period: s, of the controller. push: an `fb.Push`, or None.
        """
        body = [*self.world_lines(robot), *self.controller_lines(robot)]
        text = "\n".join(body)
        pushes = ""
        if push is not None:
            force = [round(x, 3) for x in push.force.tolist()]
            frame = "" if push.frame == "base" else f", frame={push.frame!r}"
            pushes = f", [fb.Push({force}, 0.5, {push.duration:g}{frame})]"
        rest = f"{pushes}, control_period={period:g}, actuators=actuators)"
        run = f"run = fb.rollout(sim, controller, {_whole(3.0, period)}{rest}"
        imports = [line for words, line in _IMPORTS if any(word in text for word in words)]
        lines = [*imports, "", f"robot = {_loaded(robot)}"]
        return "\n".join([*lines, *body, run, 'print(run.outcome, f"at {run.time[-1]:.2f} s")', ""])


_IMPORTS = (
    (("fb.",), "import floatbase as fb"),
    (("FirstOrderLag",), "from floatbase.actuators import FirstOrderLag"),
    (("Gait", "Walk", "Stand("), "from floatbase.behaviours import Gait, Stand, Walk"),
    (("ModelMismatch",), "from floatbase.control import ModelMismatch"),
    (("BaseMotors", "nodding"), "from floatbase.playground import BaseMotors, nodding"),
    (("Perturbed",), "from floatbase.simulation import Perturbation, PerturbedSimulation"),
)


@lru_cache(maxsize=8)
def _loaded(robot: Robot) -> str:
    """The call that loads a robot: one that `load` does not give comes from the file that its name tells.

    Limits of one's own, locked joints and feet of several radii are not told.
    """
    with suppress(FloatbaseError):
        if load(robot.name) == robot:
            return f"fb.load({robot.name!r})"
    given = [repr(f"{robot.name}.urdf"), *([] if robot.is_floating else ["floating=False"])]
    if robot.feet:
        given += [f"feet={[foot.frame for foot in robot.feet]}", f"foot_radius={robot.feet[0].radius!r}"]
    return f"fb.load_urdf({', '.join(given)})"


def _normal(slope: float) -> list[float]:
    """Normal of a ground that rises forwards by so many degrees."""
    angle = math.radians(slope)
    return [round(-math.sin(angle), 6), 0.0, round(math.cos(angle), 6)]


def _whole(time: float, period: float) -> str:
    """About `time` s, as a whole number of periods."""
    return f"{round(time / period) * period:.6g}"
