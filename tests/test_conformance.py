"""Every public function, constructor and method of the rooms, called with wrong arguments, one at a time.

An answer is right if it is an error of the package that says so, or finite numbers where the argument makes sense after all.
Anything else is a fault: another exception, a warning, NaN, or an argument of a wrong kind that nobody noticed. What is new
in a room is in here by itself, and fails until `EXAMPLES` has right values for its parameters.
"""

from __future__ import annotations

import inspect
import os
import warnings
from collections.abc import Callable, Iterator
from datetime import datetime
from functools import partial
from importlib import import_module
from types import SimpleNamespace
from typing import Any, NamedTuple

import judges
import matplotlib.pyplot as plt
import numpy as np
import pytest
from values import CONTACTS, CONTROLLER, EOM, HYDRAULIC, RECORD, ROBOT, STATE, UP, VALUES

import floatbase as fb
from floatbase.actuators import Delay, FirstOrderLag
from floatbase.behaviours import Gains, Gait, Stand, Walk
from floatbase.control import AnalyticController, Belief
from floatbase.errors import FloatbaseError
from floatbase.lessons import ConstantTorques
from floatbase.qp import table_top
from floatbase.simulation import AlteredSimulation, Live, World
from floatbase.viewer import plots, programs, recording

ROOMS = (
    "", "actuators", "behaviours", "control", "dynamics", "friction", "lessons", "objectives", "qp", "robots", "simulation",
    "viewer",
)  # fmt: skip
MODULES = (plots, programs, recording)  # of the viewer; the others draw and pack what these and `Viewer.show` have checked
OTHER, TALOS = judges.load("solo12"), judges.load("talos")
QP = CONTROLLER.qp(STATE)
TABLE = table_top()
SPACE = fb.feasible_space(EOM)
VIEW = fb.Viewer(ROBOT)
PICTURE = VIEW.painter.picture(STATE, CONTACTS)
COST = fb.Quadratic(np.eye(12), np.ones(12))
NORMAL = np.array([0.1, 0.0, 1.0])
AXES = plt.figure().gca()
POLAR = plt.figure().add_subplot(projection="polar")
SIM = fb.Simulation(ROBOT)
LIVE = Live(SIM, CONTROLLER, lambda record: None)
GAIT = Gait.trot(ROBOT, start=0.0)
WALK = Walk(ROBOT, CONTACTS, GAIT)
WALK(STATE.q, STATE.v)  # so that it has a plan

FOLDER = os.environ["FLOATBASE_HOME"]  # of this run

# values that make no argument, but where MEANT or ACCEPTED says so; a function makes one from the right argument
WRONG: dict[str, Any] = {
    "None": None,
    "NaN": np.nan,
    "inf": np.inf,
    "x": "x",
    "1": "1",
    "bytes": b"1",
    "empty": [],
    "deep": np.zeros((2, 2, 2, 2)),
    "ragged": [[1.0], [1.0, 2.0]],
    "objects": np.array([None, 1.0, "x"], dtype=object),
    "complex": 1.0 + 2.0j,
    "True": True,
    "-1": -1.0,
    "0": 0,
    "1e300": 1e300,
    "1e308": 1e308,
    "10**400": 10**400,
    "10**7": 10**7,
    "date": datetime(2020, 1, 1),
    "dict": {"a": 1.0},
    "class": fb.State,
    "instance": SimpleNamespace(),
    "generator": lambda right: (entry for entry in (1.0, 2.0)),
    "complex array": lambda right: np.array(right) + 0.5j,
    "masked array": lambda right: np.ma.masked_less(right, np.max(right)),
    "texts": lambda right: np.array(right).astype(str),
    "truths": lambda right: np.array(right) > 0.0,
    "NaN inside": lambda right: np.array(right) * np.nan,
    "one too many": lambda right: np.append(np.ravel(right), 1.0),
    "column": lambda right: np.array(right)[..., None],
    "of another robot": lambda right: others()[type(right).__name__],
}

# what makes sense after all, by the kind of the right argument
MEANT = {
    "text": {"x", "1"},
    "flag": {"True"},
    "number": {"-1", "0", "10**7"},
    "numbers": {"-1", "0", "10**7", "empty", "one too many", "column", "deep"},
    "list": {"empty"},
    "mapping": set(),
    "function": set(),
    "value": set(),
}
# and by parameter
ANY_LENGTH = {"empty", "one too many"}  # nothing here says how long it must be
NO_LIMIT = {"inf", "1e300", "1e308", "10**400"}
ACCEPTED: dict[str, set[str]] = {
    "Problem.contacts": {"of another robot"}, "force_of.forces": {"NaN inside"}, "friction_used.forces": {"NaN inside"},
    "on_status.listener": {"None"}, "max_normal_force": NO_LIMIT, "flat_feet.mu": {"one too many"},
    "Limits.min_normal_force": {"dict"}, "Limits.max_normal_force": {"dict", "inf", "1e300", "1e308", "10**400"},
    "Problem.robot": {"of another robot"}, "torque_limits": NO_LIMIT, "Limits.torque_limits": NO_LIMIT | ANY_LENGTH,
    "Affine.constant.b": ANY_LENGTH, "Affine.__call__.x": {"column"}, "ConstantTorques.tau": ANY_LENGTH,
    "ForceTask.target": ANY_LENGTH, "TorqueTask.target": ANY_LENGTH, "PostureTask.q": ANY_LENGTH,
    "PostureTask.velocity": ANY_LENGTH, "PostureTask.acceleration": ANY_LENGTH,
    "Ground.offset": {"column"}, "Robot.standing.offset": {"column"},
    "time": {"one too many"}, "times": {"one too many"},
    "Live.use.actuators": {"None"}, "Viewer.stand_on.ground": {"None"},
    "about.x": {"NaN", "inf", "NaN inside", "1e300", "1e308"},
}  # fmt: skip

ZERO = np.zeros(12)
EXAMPLES: dict[str, Any] = {
    "A": np.ones((12, 12)), "a": 10.0, "about": STATE.com, "acceleration": UP, "PostureTask.velocity": ZERO,
    "PostureTask.acceleration": ZERO, "moving_frame.acceleration": lambda t: UP,
    "actuators": HYDRAULIC, "after_reset": lambda: None, "alpha": 0.1, "angle": 30.0, "angular_acceleration": UP,
    "angular_momentum_rate": UP, "angular_velocity": UP, "around": ((0.0, 0.0, 0.3), 0.5), "axis": NORMAL,
    "arrows": True, "at_most": "all", "colour": (0.0, 0.5, 1.0), "meaning": "a force",
    "axes": "world", "plots.plot_com.axis": AXES, "plots.plot_forces.axis": AXES, "plots.plot_friction.axis": AXES,
    "plots.plot_torques.axis": AXES, "plots.plot_gait.axis": AXES, "plots.plot_normal_forces.axes": [AXES] * 4,
    "plot_roses.axis": POLAR, "rolling": True, "azimuth": 10.0, "b": ZERO, "background": "dark", "bandwidth": 10.0,
    "base": 0.32,
    "beta": np.zeros(SPACE.dimension), "bias_weight": 1e-3, "block": "tau", "blocks": {"tau": slice(0, 1)}, "bore": 0.016,
    "bulk_modulus": 1.3e9,
    "column": "force", "C": np.zeros((18, 18)), "c": 1.0, "Foot.centre": UP, "PointContact.centre": UP, "centre": ZERO,
    "changed": lambda value: None, "AnalyticController.com": STATE.com, "com": True, "com_acceleration": UP,
    "WrenchSet.cones": VALUES["WrenchSet"].cones, "cones": True, "contact": "FL_foot", "contacts": CONTACTS,
    "control_period": 0.002, "controller": CONTROLLER, "corners": TALOS.feet[0].corners,
    "cost": fb.Quadratic.zero(SPACE.dimension), "cost_on_qdd": fb.Quadratic.zero(18), "crank": 0.045, "curvature": (1.0, 2.0),
    "digits": 3, "force_weight": 1.0, "kinds": QP.inequality_names[0].kind, "moment_weight": 1.0,
    "damping": 10.0, "dead_volume": 8e-6, "delay": 0.01,
    "direction": np.ones(6), "distance": 1.0, "dt": 1e-3, "duration": 0.002,
    "dv": np.zeros(18), "elevation": 10.0, "eom": EOM, "equality_names": tuple("abcdefghijkl"), "extra": {},
    "f": fb.Affine(np.eye(12), ZERO), "facets": 4, "View.feet": True, "feet": ["FL_foot"], "load_urdf.feet": ["tool0"],
    "floor": 1e-6,
    "floating": True, "follow": True, "foot_radius": 0.02, "WrenchSet.torques.force": 150.0 * UP, "force": NORMAL,
    "cost_on_space.forces": fb.Quadratic.zero(12), "forces": 30.0 * np.tile(UP, 4),
    "plots.friction_used.forces": RECORD.measured, "frame": "FL_foot",
    "Contacts.flat_feet.frames": [foot.frame for foot in TALOS.feet], "frames": ("FL_foot", "FR_foot", "RL_foot", "RR_foot"),
    "G": np.eye(12), "g": ZERO, "ghost": STATE, "ghost_name": "goal", "Simulation.ground": 0.8, "ground": NORMAL,
    "H": np.eye(12), "h": np.ones(12), "Viewer.height": 300, "height": 0.27, "high": 1.0,
    "hydraulics": HYDRAULIC.cylinders.hydraulics, "i": 0, "idle": 10.0, "inequality_names": tuple("abcdefghijkl"),
    "inside": False, "items": tuple(CONTACTS), "kd": 20.0, "kind": "planned", "kp": 100.0, "labels": True, "leakage": 2e-14,
    "lesson": "07", "limits": CONTROLLER.limits, "load.locked": ["FL_hip_joint"],
    "load_urdf.locked": [], "listener": lambda status: None, "loop_bandwidth": 50.0, "low": 0.0, "m": 6,
    "WrenchSet.max_normal_force": 200.0 * np.ones(4), "max_normal_force": 200.0, "min_normal_force": 1.0,
    "minimum": (0.5, 1.0), "moment": UP, "mu": 0.7, "N": np.eye(12)[:, :3], "n": 3, "Command.force.name": "FL_foot",
    "Contacts.__getitem__.name": "FL_foot", "Contacts.force_of.name": "FL_foot", "Contacts.force_slice.name": "FL_foot",
    "load.name": "go2", "load_urdf.name": "arm", "name": "posture", "names": "FL_foot", "normal": NORMAL, "normals": NORMAL,
    "Ground.offset": 0.1, "standing.offset": 0.1,
    "offset": UP, "omega": UP, "omega_rate": UP, "package_dirs": (), "parts": fb.Affine(np.eye(12), ZERO),
    "joint_servo.path": lambda t: ZERO, "load_urdf.path": str(judges.load("ur5").urdf), "path": "readable",
    "save.size": (320, 200),
    "save.path": f"{FOLDER}/view.html", "paused": True, "pictures": [PICTURE, PICTURE], "Viewer.play.planned": True,
    "planned": 30.0 * np.tile(UP, 4), "plate": True, "points": CONTACTS.positions(STATE), "port": 0, "position": UP,
    "AnalyticController.posture": 1e-3, "load_urdf.posture": [0.0] * 6 + [1.0] + [0.0] * 6, "posture": ROBOT.posture,
    "predict": lambda q, v: ZERO, "pressed": lambda: None, "push": ("base", NORMAL), "pushed_body.push": fb.Push(NORMAL),
    "pushes": (fb.Push(NORMAL),), "Cylinders.pose.q": ZERO, "q": STATE.q, "q_joints": STATE.q[7:],
    "cost_on_space.qdd": fb.Quadratic.zero(18), "qdd": np.zeros(18), "qp": QP, "inward_acceleration.r": UP, "r": ZERO,
    "radius": 0.02, "rate": 30.0, "rated_drop": 70e5, "rated_flow": 1.25e-4, "residual": fb.Affine(np.eye(12), ZERO),
    "Contacts.flat_feet.robot": TALOS, "robot": ROBOT, "unbolted.robot": judges.load("ur5"), "rod": 0.01, "rollout": RECORD,
    "root": "/robot", "owners": [f"joint {i}" for i in range(12)], "rotation": np.eye(3), "row": 0,
    "LinearConstraint.rows": lambda state, t: None, "Rows.rows": lambda eom, t: (np.eye(18), np.ones(18)), "rows": (),
    "scale": 0.004, "seed": 3, "seen": 0.4, "settle": 0.002,
    "show": lambda record: None, "sim": SIM, "Cylinders.size": np.ones(12), "solver": "daqp", "space": SPACE, "speed": 1.0,
    "places": np.zeros((2, 3)), "Viewer.step.step": WALK.history[0], "steps": list(WALK.history), "walk": WALK,
    "spread": 0.2, "WrenchSet.reach.start": 150.0 * np.eye(6)[2], "active_set.start": np.zeros(QP.n), "start": 0.1,
    "most": 5, "box": (-1.0, 1.0, -1.0, 1.0), "programs.plot.axis": AXES, "programs.plot.qp": TABLE,
    "programs.allowed.qp": TABLE, "plot.point": np.zeros(2),
    "state": STATE, "status": "inside", "step": 0.1, "stiffness": 100.0, "supply_pressure": 160e5, "support": True, "t": 0.5,
    "turn": 0.3, "solution": VALUES["Solution"],
    "tank_pressure": 2e5, "target": ZERO, "tasks": CONTROLLER.tasks, "cost_on_space.tau": fb.Quadratic.zero(12), "tau": ZERO,
    "tau_desired": ZERO, "time": (0.0, 0.1), "times": (0.0, 0.1), "timestep": 1e-3, "title": "standing", "tolerance": 1e-9,
    "torque": 1e-6, "Limits.torque_limits": np.full(12, 20.0), "torque_limits": 20.0, "unit": "N", "v": STATE.v,
    "v_joints": ZERO,
    "Viewer.checkbox.value": True, "value": 0.5, "valve_bandwidth": 250.0, "velocity": UP, "view": "front", "weight": 1.0,
    "working": (), "wrench": np.ones(6), "x": ZERO,
    "LIPM.pieces": [(0.0, 1.0, np.zeros(2), np.ones(2))], "LIPM.com": np.zeros(2),
    "LIPM.omega": 5.0, "capture_point.omega": 5.0, "step_adjustment.omega": 5.0, "Gait.offsets": {"a": 0.0},
    "Gait.walk.robot": TALOS,
    "period": 1.0, "swing": 0.25, "Gains.swing": (900.0, 10.0), "Gains.com": (100.0, 10.0), "Gains.base": (100.0, 10.0),
    "Gains.posture": (100.0, 1e-2), "stop": 2.0, "pause": 0.1, "Gait.phases.n": 4, "longest": 5.0, "foot": "FL_foot",
    "Swing.start": UP, "Swing.end": UP, "lift": 0.0, "land": 0.5, "Swing.height": 0.05, "gait": GAIT, "Stand.steps": GAIT,
    "Walk.velocity": np.zeros(2), "Stand.velocity": np.zeros(2), "yaw_rate": 0.1, "clearance": 0.05, "reach": 0.2, "ramp": 0.1,
    "foothold": lambda foot, land, walk: np.zeros(2), "gains": Gains(), "place": np.zeros(2),
    "pitch_and_yaw.angles": lambda t: np.array([0.1 * t, 0.2 * t]),
    "neutral_point.velocity": np.zeros(2), "stance_time": 0.3, "capture_point.com": UP, "capture_point.velocity": UP,
    "dcm_error": np.zeros(2), "time_left": 0.1, "dead_zone": 0.02,
    "support_margin.point": np.zeros(2), "support_margin.feet": np.eye(2), "margin": 0.03,
    "progress": False,
    "contact_weight": 1e4, "section": "stance", "slider.column": "", "choice.value": 0, "choices": ["a", "b"], "symbol": "M",
    "part": "shown", "words": "text", "code": True, "strip.unit": "N", "Viewer.term.value": True,
    "AlteredSimulation.ground": 0.7, "mass": 1.2, "friction": 0.5,
    "untouched": ["FL_foot"], "magnets": 20.0, "world": World(mass=1.2),
    "gravity": False, "velocity_forces": False, "drift": False,
    "unfelt": ["FL_foot"], "underactuated": False, "Belief.cones": False, "belief": Belief(mass=1.2),
}  # fmt: skip

# what only the package makes, and by what
RESULTS = {
    "EquationsOfMotion": "equations_of_motion", "FeasibleSpace": "feasible_space", "Rollout": "rollout", "Solution": "solve",
    "Iteration": "active_set", "ActiveSetRun": "active_set", "Residuals": "Solution.residuals", "Decomposition": "decompose",
    "TorqueForForces": "torque_for_forces", "Pose": "Cylinders.pose", "Power": "Cylinders.power", "Robot": "load",
    "PushRose": "push_rose", "Table": "sweep", "Step": "Walk.history",
    "AnalyticCommand": "AnalyticController", "Command": "WholeBodyController", "Verdict": "check", "Piece": "urdf_visuals",
    "Item": "shapes", "RowLabel": "QP", "recording.Animation": "animate", "OilState": "HydraulicActuators",
}  # fmt: skip
LEFT_OUT = {
    "a widget": ("SliderPanel", "slider_panel", "push_panel", "live"),
    "judges whatever a learner may give": ("Exercise", "Numeric", "Shaped", "check", "compare", "hand_in", "numbers", "predict",
        "reveal", "review"),
    "the page's server, with tests of its own": ("Window",),
    "rooms call these among themselves, with what they have checked": (
        "Simulation.advance", "AlteredSimulation.advance",
        "Conversion", "check_unit_lengths", "checked_corners", "torque_limits_of", "cone_rows",
        "vertices", "conflicting_rows", "linear_program", "motion_of", "below_the_body", "target_shapes", "targets_at",
        "QP.objective", "Belief.program", "Belief.check",
        "Rows.labels", "Rows.at", "Limits.check_names", "Limits.normal_forces", "Limits.bounded_points", "Problem.check",
        "recording.lifted_at", "Cylinders.force", "Cylinders.line", "Cylinders.edge_flow", "Cylinders.flows",
        "Cylinders.leak", "Cylinders.power", "Cylinders.pressure_rates", "Cylinders.pressure_decay", "Cylinders.opening_for",
        "recording.checked_rollout", "Ground.clearances", "with_image", "hear_at_once",
    ),
    "needs trimesh": ("urdf_visuals",),
    "draws what it is given": ("Viewer.draw", "Viewer.play_pictures", "below", "hexadecimal", "robot_meshes", "appearance"),
    "Contacts and rollout call them, and have checked": (
        "ConstantTorques.__call__", "Torques", *(f"{kind}.{method}"
            for kind in ("PointContact", "FlatFootContact", "RollingWheel", "LinearConstraint")
            for method in ("positions", "jacobian", "constraint", "generators", "slip")),
    ),
    "moves a control that is there, with tests of its own": ("Viewer.move",),
    "ends what other calls need": ("Viewer.close", "Live.close"),
    "starts processes, with tests of its own": ("sweep", "push_rose", "Table.read"),
    "starts a thread": ("Live.push", "Live.soon", "Live.start", "Live.reset"),
}  # fmt: skip
ALONE = {name for names in LEFT_OUT.values() for name in names}
SELVES: dict[str, Any] = {
    "Simulation": SIM, "AlteredSimulation": AlteredSimulation(ROBOT),
    "Viewer": VIEW, "WholeBodyController": CONTROLLER, "Live": LIVE,
    "AnalyticController": AnalyticController(ROBOT, CONTACTS, STATE), "HydraulicActuators": HYDRAULIC,
    "Delay": Delay(ROBOT, 0.01), "FirstOrderLag": FirstOrderLag(ROBOT, 10.0),
    "Walk": WALK, "Stand": Stand(ROBOT, fb.Contacts.feet(ROBOT)),
    "Cylinders": HYDRAULIC.cylinders, "Affine": fb.Affine(np.eye(12), ZERO, {"tau": slice(0, 3)}), "Quadratic": COST,
    "ConstantTorques": ConstantTorques(ZERO),
}  # fmt: skip


def others() -> dict[str, Any]:
    state, contacts = OTHER.standing(), judges.stance(OTHER)
    return {"Robot": OTHER, "State": state, "Contacts": contacts, "EquationsOfMotion": fb.equations_of_motion(state, contacts)}


class Callee(NamedTuple):
    """Something to call: room, name, the function, and its parameters but `self`."""

    room: str
    name: str
    call: Callable[..., Any]
    parameters: list[inspect.Parameter]
    self: tuple[Any, ...] = ()


def callees() -> Iterator[Callee]:
    """All that the rooms offer to call: functions, constructors, methods."""
    seen: set[int] = set()
    for room in ROOMS:
        home = import_module(f"floatbase.{room}".rstrip("."))
        found = [(name, getattr(home, name)) for name in home.__all__]
        if room == "viewer":
            found += [
                (f"{module.__name__.split('.')[-1]}.{name}", value) for module in MODULES for name, value in made_in(module)
            ]
        for name, value in found:
            if id(value) in seen or name in ALONE:
                continue
            seen.add(id(value))
            if inspect.isfunction(value):
                yield Callee(room or "floatbase", name, value, parameters_of(value))
            elif inspect.isclass(value) and not issubclass(value, Exception) and not getattr(value, "_is_protocol", False):
                if name not in RESULTS:
                    yield Callee(room or "floatbase", name, value, parameters_of(value))
                yield from methods_of(room or "floatbase", name, value)


def made_in(module: Any) -> list[tuple[str, Any]]:
    mine = inspect.getmembers(module, lambda value: getattr(value, "__module__", "") == module.__name__)
    return [(name, value) for name, value in mine if not name.startswith("_") and callable(value)]


def methods_of(room: str, name: str, kind: type) -> Iterator[Callee]:
    for method, value in inspect.getmembers(kind, inspect.isfunction):
        if (not method.startswith("_") or method in ("__call__", "__getitem__")) and f"{name}.{method}" not in ALONE:
            if isinstance(inspect.getattr_static(kind, method), staticmethod):
                yield Callee(room, f"{name}.{method}", value, parameters_of(value))
            else:
                one = SELVES.get(name, VALUES.get(name))
                yield Callee(room, f"{name}.{method}", partial(value, one), parameters_of(value)[1:], (one,))


def parameters_of(function: Callable[..., Any]) -> list[inspect.Parameter]:
    """But for `options`: more arguments by name, which go to another callee here."""
    return [p for p in inspect.signature(function).parameters.values() if p.name != "options"]


def entry(table: dict[str, Any], callee: Callee, parameter: str, default: Any = None) -> Any:
    """What a table has for a parameter: under callee and parameter, else under the parameter's name alone."""
    first, *_, last = callee.name.split(".") * 2
    keys = (f"{callee.name}.{parameter}", f"{last}.{parameter}", f"{first}.{parameter}", parameter)
    return next((table[key] for key in keys if key in table), default)


def rights_of(callee: Callee) -> dict[str, Any]:
    return {p.name: entry(EXAMPLES, callee, p.name) for p in callee.parameters}


def kind_of(right: Any) -> str:
    if isinstance(right, bool | str):
        return "flag" if isinstance(right, bool) else "text"
    if isinstance(right, int | float):
        return "number"
    if isinstance(right, dict):
        return "mapping"
    if type(right).__module__.startswith("floatbase"):
        return "value"
    if callable(right):
        return "function"
    return "numbers" if np.asarray(right, dtype=object).dtype != object or plain(right) else "list"


def plain(right: Any) -> bool:
    try:
        return np.asarray(right).dtype.kind in "fi" and np.size(right) > 0
    except ValueError:
        return False


def of_a_robot(value: Any) -> bool:
    """Whether a value belongs to one robot, and to no other."""
    return isinstance(value, fb.Robot | fb.Contacts) or isinstance(getattr(value, "robot", None), fb.Robot)


def not_finite(answer: Any, depth: int = 3) -> bool:
    """Whether an answer holds NaN or infinite numbers."""
    if isinstance(answer, np.ndarray | float):
        return np.asarray(answer).dtype.kind in "fc" and not np.all(np.isfinite(answer))
    if isinstance(answer, tuple | list):
        return any(not_finite(part, depth) for part in answer)
    if depth and type(answer).__module__.startswith("floatbase") and hasattr(answer, "__dataclass_fields__"):
        return any(not_finite(part, depth - 1) for part in vars(answer).values())
    return False


def fault(callee: Callee, name: str, label: str) -> str | None:
    """What is wrong with the answer to one wrong argument, or None."""
    rights = rights_of(callee)
    right = rights[name]
    kind = kind_of(right)
    wrong = WRONG[label]
    if callable(wrong) and not inspect.isclass(wrong):
        if label == "of another robot" and type(right).__name__ not in others():
            return None
        if label in (
            "complex array",
            "masked array",
            "texts",
            "truths",
            "NaN inside",
            "one too many",
            "column",
        ) and kind not in ("number", "numbers"):
            return None
        wrong = wrong(right)
    default = next(p.default for p in callee.parameters if p.name == name)
    special = entry(ACCEPTED, callee, name, set())
    meant = MEANT[kind] | special | ({"None"} if default is None else set())
    if label == "of another robot" and not any(
        of_a_robot(part) for part in (*callee.self, *rights.values()) if part is not right
    ):
        return None  # alone, it is as good as any
    outcome = called(callee, rights | {name: wrong})
    if isinstance(outcome, FloatbaseError):
        return None
    if isinstance(outcome, Exception):
        return f"{type(outcome).__name__}: {str(outcome)[:100]}"
    if label not in meant:
        return "accepted"
    return "not finite" if not_finite(outcome) and not special else None


def called(callee: Callee, arguments: dict[str, Any]) -> Any:
    """The answer, or the exception."""
    SIM.reset()
    keyword = {p.name: arguments[p.name] for p in callee.parameters if p.kind is p.KEYWORD_ONLY}
    starred = [p.name for p in callee.parameters if p.kind is p.VAR_KEYWORD]
    positional = [arguments[p.name] for p in callee.parameters if p.name not in keyword and p.name not in starred]
    keyword |= dict.fromkeys(starred, arguments.get("parts"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return callee.call(*positional, **keyword)
        except Exception as error:
            return error


@pytest.mark.parametrize("room", [room or "floatbase" for room in ROOMS])
def test_wrong_arguments_are_told_or_make_sense(room: str) -> None:
    here = [callee for callee in callees() if callee.room == room]
    missing = [
        f"{callee.name}: {p.name}" for callee in here for p in callee.parameters if entry(EXAMPLES, callee, p.name, ...) is ...
    ]
    assert missing == [], "EXAMPLES needs a right argument for each of these"
    wrong_rights = {callee.name: error for callee in here if isinstance(error := called(callee, rights_of(callee)), Exception)}
    assert wrong_rights == {}, "EXAMPLES needs other arguments for these"
    faults = [
        f"{callee.name}({p.name}={label}): {found}"
        for callee in here
        for p in callee.parameters
        for label in WRONG
        if (found := fault(callee, p.name, label))
    ]
    assert faults == [], "\n".join(faults)
