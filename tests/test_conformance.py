"""All public functions and constructors, called with one wrong argument at a time.

A wrong argument must raise an error of the package that names the parameter, not another exception,
a warning, or an answer. New functions are tested without an entry here. Right arguments come from
`values`, by annotation and by name. What each kind of check refuses is tested once, with all of
`WRONG`.
"""

import inspect
import re
import warnings
from collections.abc import Callable
from dataclasses import is_dataclass
from datetime import datetime
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import judges
import matplotlib.pyplot as plt
import numpy as np
import pytest
from values import UP, controller, record, values

import floatbase as fb
from floatbase.actuators import Delay, FirstOrderLag, HydraulicActuators
from floatbase.errors import FloatbaseError, InputError
from floatbase.friction import FrictionCone, FrictionPolyhedron
from floatbase.lessons import qp_plots
from floatbase.lessons.lessonC import table_top
from floatbase.playground import CHALLENGES, PerturbedSimulation, Settings
from floatbase.simulation import LiveSimulation
from floatbase.viewer.export import recording
from floatbase.viewer.plots import run_plots

PACKAGES = (
    "", "actuators", "behaviours", "control", "dynamics", "friction", "lessons", "objectives", "qp",
    "playground", "robots", "simulation", "viewer",
)  # fmt: skip
# of the viewer; the others draw and pack what these and `Viewer.show` have checked
MODULES = (run_plots, qp_plots, recording)
import_module("meshcat")  # warns when it is first imported
# for every parameter; a robot's state, say, becomes that of another robot instead of ragged numbers
FEW = {
    "NaN": np.nan, "instance": SimpleNamespace(), "ragged": [[1.0], [1.0, 2.0]],
    "7 numbers": np.ones(7), "-1": -1.0,
}  # fmt: skip
# what makes sense after all; some is checked when a problem's QP is built
ACCEPTED = {
    "NaN": "rounded(x)",
    "of another robot": "Problem(robot) Problem(contacts)",
    "7 numbers": """
        ForceTask(target) TorqueTask(target) PostureTask(q) PostureTask(velocity)
        PostureTask(acceleration) JointTargets(position) JointTargets(velocity)
        JointTargets(stiffness) JointTargets(damping) JointTargets(torque) Limits(torque_limits)
        ConstantTorques(tau) Affine.constant(b) rounded(x) PictureOptions(qdd)
        recording.sampled_rows(times)""",
    "-1": """
        Ground(offset) Robot.standing(offset) Box(top) View(azimuth) View(elevation) Quadratic(c)
        rounded(x) force_bias(a) normal_bias(a) AnalyticController(a) Walk(height) Walk(pitch)
        recording.joint_limits_at(row) recording.push_at(row) nodding_rotation(size)""",
}
# angles, rates and times, which may be negative in all functions, and in some
SIGNED = """
    facet_rotation yaw_rate t Gait.start stop crouch push take_off apex touchdown lead lift_off
    time_to_touchdown start_time begin
"""
# what messages say instead of the parameter's name
ALIASES = {
    "items": "contacts", "ground": "Ground", "student": "id", "observers": "observer 0",
    "coefficients": "G", "normals": "normal", "feet": "foot", "g": "[AH] has shape",
    "scale": "max_lever_angle",
}  # fmt: skip

# for every kind of check
WRONG = {
    **FEW, "None": None, "inf": np.inf, "x": "x", "1": "1", "bytes": b"1", "empty": [],
    "deep": np.zeros((2, 2, 2, 2)),
    "objects": np.array([None, 1.0, "x"], dtype=object), "complex": 1.0 + 2.0j, "True": True,
    "0": 0, "1e300": 1e300, "1e308": 1e308, "10**400": 10**400, "10**7": 10**7,
    "date": datetime(2020, 1, 1), "dict": {"a": 1.0}, "class": fb.State,
    "generator": (entry for entry in (1.0, 2.0, 3.0)), "complex array": UP + 0.5j,
    "masked array": np.ma.masked_less(UP, 1.0),
    "texts": UP.astype(str), "truths": UP > 0.0, "NaN inside": UP * np.nan,
    "one too many": np.ones(4), "column": UP[:, None],
}  # fmt: skip
# a call for each kind of check, and what it takes
CHECKS = {
    "text": (lambda x: fb.FrameTask(x, UP), {"x", "1"}),
    "texts": (lambda x: fb.load("ur5", locked=x), {"empty"}),
    "flag": (lambda x: FrictionPolyhedron(UP, 0.7, inner_approximation=x), {"True"}),
    "whole number": (lambda x: fb.Affine.identity(x), {"0"}),
    "number": (lambda x: fb.Push(UP, start=x), {"0", "10**7"}),
    "positive number": (lambda x: FrictionCone(UP, x), {"10**7"}),
    "numbers": (lambda x: fb.Push(x), set()),
    "any length": (lambda x: fb.Quadratic(np.eye(3), x), set()),
    "matrix": (lambda x: fb.Quadratic(x, UP), set()),
    "direction": (lambda x: FrictionCone(x, 0.7), set()),
    "forces": (lambda x: values()["Contacts"].force_of(x, "FL_foot"), set()),
    "function": (
        lambda x: LiveSimulation(fb.Simulation(judges.load("go2")), controller(), x),
        set(),
    ),
    "value": (lambda x: fb.State(x, values()["State"].q), set()),
}


@pytest.mark.parametrize("check", CHECKS)
def test_each_kind_of_check_refuses_wrong_values(check):
    call, meant = CHECKS[check]
    answers = {label: answer(partial(call, wrong)) for label, wrong in WRONG.items()}
    assert {label: found for label, found in answers.items() if found and label not in meant} == {}
    assert {label for label in meant if answers[label] != "accepted"} == set()


@cache
def right():
    """Right arguments, by the parameter's annotation or name, before it the callee's if needed."""
    robot, state, contacts = values()["Robot"], values()["State"], values()["Contacts"]
    view, standing = fb.Viewer(robot), controller()
    picture = view.painter.picture(state, contacts)
    x, up, plane = np.zeros(12), np.array(UP), np.zeros(2)
    affine = fb.Affine(np.eye(12), x, {"tau": slice(0, 3)})
    return values() | {
        "Simulation": fb.Simulation(robot), "Viewer": view, "Controller": standing,
        "WholeBodyController": standing,
        "Settings": Settings(),
        "LiveSimulation": LiveSimulation(fb.Simulation(robot), standing, lambda record: None),
        "PerturbedSimulation": PerturbedSimulation(robot), "Challenge": CHALLENGES[0],
        "Affine": affine, "Quadratic": fb.Quadratic(np.eye(12), np.ones(12)),
        "fb.Rollout": record(), "Runs": record(), "items": picture,
        "Sequence[Picture]": [picture] * 2, "Sequence[Task]": standing.tasks,
        "Observer": lambda q, v, t: (q, v),
        "float": 0.5, "int": 3, "str": "FL_foot", "Callable": lambda *given: None,
        "Array": up, "npt.ArrayLike": up, "a": 10.0, "alpha": 0.1, "rate": 30.0, "omega": 5.0,
        "N": np.eye(12)[:, :3],
        "Delay": Delay(robot, 0.01), "FirstOrderLag": FirstOrderLag(robot, 5.0),
        "HydraulicActuators": HydraulicActuators(robot), "dt": 1e-3,
        "tau_desired": x, "q_joints": state.q[7:], "v_joints": x,
        "x": x, "tau": x, "beta": x, "max_lever_angle": x, "scale": np.ones(12),
        "q": state.q, "v": state.v, "dv": np.zeros(18), "qdd": np.zeros(18),
        "Q": state.q[None], "V": state.v[None],
        "forces": np.tile(30.0 * up, 4), "force": np.array([0.1, 0.0, 1.0]), "point": plane,
        "dcm_error": plane, "nominal_foothold": plane, "neutral_point.velocity": plane,
        "points": contacts.positions(state), "places": np.zeros((2, 3)),
        "support_margin.feet": np.eye(2), "time": (0.0, 0.1), "times": (0.0, 0.1),
        "duration": 0.002, "angles": lambda t: np.array([0.1 * t, 0.2 * t]),
        "acceleration": lambda t: up, "view_from_rotating_frame.omega": up,
        "rigid_between.other": "RR_foot", "JointServo.stiffness": 40.0, "JointServo.damping": 1.0,
        "nodding_rotation.rotation": np.eye(3), "cost": fb.Quadratic.zero(12),
        "Push.horizontal.force": 40.0, "Jump.height": 0.1,
        "feasible_polygon.box": (-1.0, 1.0, -1.0, 1.0),
        "with_floating_base.robot": judges.load("ur5"), "flat_feet.robot": judges.load("talos"),
        "linear.A": np.eye(3), "from_residual.A": np.eye(3),
        "load.name": "go2", "load_urdf.path": str(judges.load("ur5").urdf),
        "MujocoAdapter.model": fb.Simulation(robot).model,
        "load_mjcf.path": str(Path(__file__).parent / "robots/hopper.xml"),
        "run_plots.friction_used.forces": record().measured, "block": "tau", "row": 0,
        **{f"{name}.qp": table_top() for name in ("feasible_polygon", "plot", "plot_optimum")},
        "slider_panel.draw": lambda ranges: "", "ranges": (0.0, 1.0, 2.0),
        "term": "gravity", "term_arrows.scale": 0.01, "prefixed.path": "new", "root": "/robot",
        "t": 0.0,
        "solver": "daqp", "status": "inside", "lesson": "07",
    }  # fmt: skip


# made only by the package; judge whatever a learner gives; have their own tests, since they
# start a page or processes; are called by packages with what they have checked
NOT_CALLED = """
    EquationsOfMotion FeasibleSpace Rollout Solution Iteration ActiveSetRun Residuals Decomposition
    TorquesFromForces CylinderGeometry PowerBalance Robot PushRecovery StepPlan
    Command CommandBatch ConstraintLabel recording.Animation HydraulicState Item SliderPanel Term
    NumericJudge check compare hand_in import_answers predict recall reveal review
    Playground playground sweep read_sweep push_recovery
    conflicting_constraints constraint_and_jacobian raibert_foothold TorqueCommand State.unchecked
    recording.as_rollout recording.swing_feet_at Affine.stack
"""


WITH_METHODS = """
    Robot State Contacts EquationsOfMotion FeasibleSpace WholeBodyController
    Affine Quadratic FrictionCone FrictionPolyhedron Gait Delay FirstOrderLag HydraulicActuators
"""


class Callee(NamedTuple):
    """A function or a class to call, by its name in the package."""

    name: str
    call: Callable[..., Any]

    @property
    def parameters(self):
        """But for `options`: more arguments by name, which go to another callee here."""
        found = inspect.signature(self.call).parameters.values()
        return [parameter for parameter in found if parameter.name != "options"]


@cache
def callees():
    """All functions and constructors that users call, by the first package that has them."""
    found = {}
    seen = set()
    for package in PACKAGES:
        home = import_module(f"floatbase.{package}".rstrip("."))
        public = {name: getattr(home, name) for name in home.__all__}
        for module in MODULES if package == "viewer" else ():
            mine = inspect.getmembers(module, lambda x, m=module.__name__: is_made_in(x, m))
            public |= {f"{module.__name__.split('.')[-1]}.{name}": x for name, x in mine}
        found[package or "floatbase"] = [
            Callee(name, value)
            for name, value in public.items()
            if is_called(value) and id(value) not in seen and name not in NOT_CALLED.split()
        ]
        seen |= {id(value) for value in public.values()}
    for name in WITH_METHODS.split():
        of = right()[name]
        methods = inspect.getmembers(of, lambda x: inspect.ismethod(x) or inspect.isfunction(x))
        found["floatbase"] += [
            Callee(f"{name}.{method}", value)
            for method, value in methods
            if not method.startswith("_") and f"{name}.{method}" not in NOT_CALLED.split()
        ]
    return found


def is_made_in(value, module):
    name = getattr(value, "__name__", "_")
    return getattr(value, "__module__", "") == module and not name.startswith("_")


def is_called(value):
    if inspect.isclass(value):
        return not issubclass(value, Exception) and not getattr(value, "_is_protocol", False)
    return inspect.isfunction(value)


def right_for(callee, parameter):
    """The field of that name of the class's own value, or an entry of `right`."""
    if is_dataclass(callee.call) and hasattr(right().get(callee.name), parameter.name):
        return getattr(right()[callee.name], parameter.name)
    name, kind = parameter.name, str(parameter.annotation).split(" | ")[0]
    keys = (f"{callee.name}.{name}", f"{callee.name.split('.')[-1]}.{name}")
    keys += (name, kind, kind.split("[")[0])
    return next((right()[key] for key in keys if key in right()), ...)


def rights_of(callee):
    """Right arguments for all parameters that have no default."""
    required = [
        p
        for p in callee.parameters
        if p.default is p.empty and (p.kind is not p.VAR_KEYWORD or p.name == "ranges")
    ]
    return {p.name: right_for(callee, p) for p in required}


@cache
def others():
    """Things of another robot."""
    robot = judges.load("solo12")
    eom = fb.equations_of_motion(robot.standing(), judges.stance(robot))
    things = (robot, eom.state, eom.contacts, eom)
    return {type(thing).__name__: thing for thing in things}


def of_a_robot(value):
    """Whether a value belongs to one robot, and to no other."""
    kinds = fb.Robot | fb.Contacts
    return isinstance(value, kinds) or isinstance(getattr(value, "robot", None), fb.Robot)


def wrongs(callee, name):
    """Wrong arguments for a parameter."""
    rights = rights_of(callee)
    kind = type(rights.pop(name, None)).__name__
    if kind not in others() or not any(map(of_a_robot, rights.values())):
        return FEW  # another robot's is as good as any
    wrong = {label: wrong for label, wrong in FEW.items() if label != "ragged"}
    return wrong | {"of another robot": others()[kind]}


def answer_of(callee, named="", **wrong):
    """Return what is wrong with the answer if `wrong` replaces right arguments, or None."""
    right()["Simulation"].reset()
    arguments = rights_of(callee) | wrong
    positional = [
        arguments.pop(p.name)
        for p in callee.parameters
        if p.default is p.empty and p.kind not in (p.KEYWORD_ONLY, p.VAR_KEYWORD)
    ]
    return answer(partial(callee.call, *positional, **arguments), named)


def answer(call, named=""):
    """What is wrong with the answer to a wrong argument, or None. An InputError says `named`."""
    with warnings.catch_warnings(action="error"):
        try:
            call()
        except FloatbaseError as error:
            is_named = type(error) is not InputError or re.search(rf"\b({named})\b", str(error))
            return None if is_named else f"does not name {named}: {str(error)[:100]}"
        except Exception as error:
            return f"{type(error).__name__}: {str(error)[:100]}"
    return "accepted"


@pytest.mark.parametrize("package", [package or "floatbase" for package in PACKAGES])
def test_wrong_arguments_raise_an_error_of_the_package(package, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    faults = {}
    for callee in callees()[package]:
        unknown = [name for name, value in rights_of(callee).items() if value is ...]
        assert unknown == [], f"`right` needs an argument for these parameters of {callee.name}"
        assert answer_of(callee) == "accepted", f"`right` needs other arguments of {callee.name}"
        for name in [p.name for p in callee.parameters]:
            for label, wrong in wrongs(callee, name).items():
                named = "" if "another" in label else f"{name}|{ALIASES.get(name, name)}"
                found, call = answer_of(callee, named, **{name: wrong}), f"{callee.name}({name})"
                signed = label == "-1" and {name, f"{callee.name.split('.')[0]}.{name}"} & {
                    *SIGNED.split()
                }
                meant = found == "accepted" and (signed or call in ACCEPTED.get(label, "").split())
                if found and not meant:
                    faults[f"{call}: {label}"] = found
    assert faults == {}


SAMPLES = 150


@pytest.mark.parametrize("seed", range(2))
def test_a_sample_of_wrong_arguments_raises_no_other_error(seed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(seed)  # other calls with --seed
    every = [callee for package in callees().values() for callee in package]
    calls = [(callee, p.name) for callee in every for p in callee.parameters]
    samples = rng.integers(len(calls), size=SAMPLES)
    faults = {}
    for i, label in zip(samples, rng.choice(list(WRONG), SAMPLES), strict=True):
        callee, name = calls[i]
        found = answer_of(callee, **{name: WRONG[label]})
        if found not in (None, "accepted"):
            faults[f"{callee.name}({name}={label})"] = found
        plt.close("all")
    assert faults == {}
