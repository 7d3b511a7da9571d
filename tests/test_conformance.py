"""Every public function, constructor and method of the packages, called with wrong arguments, one
at a time.

Only an error of the package is right: not another exception, a warning, or an argument of a wrong
kind that nobody noticed. What is new in a package is in here by itself; right arguments come from
`values`, by annotation and by name. What each kind of check refuses is tested once, with all of
`WRONG`.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Iterator
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
from values import UP, controller, horizon_arguments, record, values

import floatbase as fb
from floatbase.actuators import Delay, FirstOrderLag, HydraulicActuators
from floatbase.behaviours import MPC, Gait, Jump, Stand, Walk
from floatbase.control import AnalyticController
from floatbase.errors import FloatbaseError
from floatbase.friction import FrictionCone, FrictionPolyhedron
from floatbase.lessons import ConstantTorques, qp_plots
from floatbase.lessons.lessonC import table_top
from floatbase.playground import (
    CHALLENGES,
    BaseMotors,
    ModelMismatch,
    PerturbedSimulation,
    RealTimeFactor,
    Session,
    Settings,
)
from floatbase.simulation import Latency, LiveSimulation, Observed
from floatbase.viewer.export import recording
from floatbase.viewer.plots import run_plots

PACKAGES = (
    "", "actuators", "behaviours", "control", "dynamics", "friction", "lessons", "objectives", "qp",
    "playground", "robots", "simulation", "viewer",
)  # fmt: skip
MODULES = (
    run_plots,
    qp_plots,
    recording,
)  # of the viewer; the others draw and pack what these and `Viewer.show` have checked
ZERO = np.zeros(12)
# for every parameter; a robot's state, say, becomes that of another robot instead of ragged numbers
FEW = {"NaN": np.nan, "instance": SimpleNamespace(), "ragged": [[1.0], [1.0, 2.0]]}
# what makes sense after all; a problem is checked when its QP is built
ACCEPTED = {
    "rounded(x=NaN)",
    "Problem(robot=of another robot)",
    "Problem(contacts=of another robot)",
    "Robot.has_joints_of(other=of another robot)",
}

# for every kind of check
WRONG: dict[str, Any] = {
    **FEW, "None": None, "inf": np.inf, "x": "x", "1": "1", "bytes": b"1", "empty": [],
    "deep": np.zeros((2, 2, 2, 2)),
    "objects": np.array([None, 1.0, "x"], dtype=object), "complex": 1.0 + 2.0j, "True": True,
    "-1": -1.0, "0": 0,
    "1e300": 1e300, "1e308": 1e308, "10**400": 10**400, "10**7": 10**7,
    "date": datetime(2020, 1, 1), "dict": {"a": 1.0}, "class": fb.State,
    "generator": (entry for entry in (1.0, 2.0, 3.0)), "complex array": UP + 0.5j,
    "masked array": np.ma.masked_less(UP, 1.0),
    "texts": UP.astype(str), "truths": UP > 0.0, "NaN inside": UP * np.nan,
    "one too many": np.ones(4), "column": UP[:, None],
}  # fmt: skip
# a call for each kind of check, and what it takes
CHECKS: dict[str, tuple[Callable[[Any], object], set[str]]] = {
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
def test_each_kind_of_check_refuses_what_is_no_such_thing(check: str) -> None:
    call, meant = CHECKS[check]
    answers = {label: answer(partial(call, wrong)) for label, wrong in WRONG.items()}
    assert {label: found for label, found in answers.items() if found and label not in meant} == {}
    assert {label for label in meant if answers[label] != "accepted"} == set()


@cache
def right() -> dict[str, Any]:
    """Right arguments, by annotation or by name, and what methods are called of, by the names of
    their classes.
    """
    robot, state, contacts = values()["Robot"], values()["State"], values()["Contacts"]
    talos, oil, space = judges.load("talos"), HydraulicActuators(robot), values()["FeasibleSpace"]
    sim, gait = fb.Simulation(robot), Gait.trot(robot, start=0.0)
    walk = Walk(robot, contacts, gait)
    walk(state.q, state.v)  # so that it has a plan
    view, qp = fb.Viewer(robot), values()["QP"]
    mpc = MPC(robot, contacts, gait)
    mpc(state.q, state.v)
    x, reference, feet, stance = horizon_arguments()
    forces = 30.0 * np.tile(UP, 4)
    perturbed, session = PerturbedSimulation(robot), Session(robot)
    return values() | {
        "Simulation": sim, "Viewer": view,
        "WholeBodyController":
        controller(),
        "LiveSimulation": LiveSimulation(sim, controller(), lambda record: None),
        "HydraulicActuators": oil,
        "Cylinders": oil.cylinders,
        "AnalyticController": AnalyticController(robot, contacts, state),
        "Delay": Delay(robot, 0.01), "Walk": walk,
        "FirstOrderLag": FirstOrderLag(robot, 10.0), "Stand": Stand(robot, fb.Contacts.feet(robot)),
        "Gait": gait, "MPC": mpc, "Jump": Jump(robot, fb.Contacts.feet(robot), 0.1),
        "Jump.height": 0.1, "JumpPlan.of.height": 0.1,
        **{f"HorizonQP.{name}.state": x for name in ("qp", "solve")},
        "HorizonQP.reference": reference, "HorizonQP.feet": feet, "HorizonQP.stance": stance,
        "Affine": fb.Affine(np.eye(12), ZERO, {"tau": slice(0, 3)}),
        "Quadratic": fb.Quadratic(np.eye(12), np.ones(12)),
        "ConstantTorques": ConstantTorques(ZERO), "Controller": controller(),
        "StepPlan": walk.history[0],
        "PerturbedSimulation": perturbed, "BaseMotors": BaseMotors(controller(), perturbed),
        "Session": session, "Settings": Settings(), "Challenge": CHALLENGES[0],
        "Judge": CHALLENGES[0].judge(), "RealTimeFactor": RealTimeFactor(), "fb.Rollout": record(),
        "Watch": lambda judge, record, session: "", "nodding_rotation.rotation": np.eye(3),
        "term": "gravity", "Challenge.start": Settings(), "mass": 1.0,
        "slider_panel.draw": lambda ranges: "", "ranges": (0.0, 1.0, 2.0),
        "clock": lambda: 0.0, "ModelMismatch": ModelMismatch(gravity=False),
        "term_arrows.scale": 0.01,
        "bool": True, "float": 0.5, "int": 3, "str": "FL_foot", "Callable": lambda *given: None,
        "Array": UP,
        "npt.ArrayLike": UP, "RGB": (0.0, 0.5, 1.0), "Box": (-1.0, 1.0, -1.0, 1.0),
        "Sequence[Task]": controller().tasks,
        "Sequence[str]": ["a", "b"],
        "items": view.painter.picture(state, contacts), "prefixed.path": "new",
        "Picture": view.painter.picture(state, contacts),
        "Sequence[Picture]": [view.painter.picture(state, contacts)] * 2,
        "A": np.eye(12), "b": ZERO,
        "x": ZERO, "r": ZERO,
        "N": np.eye(12)[:, :3], "tau": ZERO, "tau_desired": ZERO, "q_joints": state.q[7:],
        "v_joints": ZERO,
        "scale": np.ones(12),
        "LiveSimulation.set_time_scale.scale": 1.0,
        "JointLimits.bounds.q": ZERO, "JointLimits.bounds.v": ZERO,
        "max_lever_angle": ZERO, "Cylinders.geometry.q": ZERO, "q": state.q,
        "v": state.v, "dv":
        np.zeros(18),
        "qdd": np.zeros(18), "forces": forces, "run_plots.friction_used.forces": record().measured,
        "beta": np.zeros(space.dimension), "wrench": np.ones(6), "direction": np.ones(6),
        "points": contacts.positions(state), "xy": np.zeros(2), "Observer": lambda q, v, t: (q, v),
        "Box.x": [0.0, 1.0], "Box.y": [0.0, 1.0], "Box.top": 0.1,
        "surface": lambda xy: 0.0, "Observed": Observed(controller()), "Latency": Latency(),
        "a": 10.0,
        "flat_feet.robot": talos,
        "Gait.walk.robot": talos, "with_floating_base.robot": judges.load("ur5"),
        "force": np.array([0.1, 0.0, 1.0]), "Push.horizontal.force": 40.0,
        "cost": fb.Quadratic.zero(space.dimension),
        "f": fb.Affine(np.eye(12), ZERO), "residual": fb.Affine(np.eye(12), ZERO),
        "parts": fb.Affine(np.eye(12), ZERO),
        "kinds": qp.inequality_names[0].kind,
        "qp_plots.feasible_polygon.qp": table_top(),
        "qp_plots.plot.qp": table_top(),
        "qp_plots.plot_optimum.qp": table_top(), "block": "tau",
        "nominal_foothold": np.zeros(2),
        "neutral_point.velocity": np.zeros(2), "dcm_error":
        np.zeros(2),
        "point": np.zeros(2), "support_margin.feet": np.eye(2), "places": np.zeros((2, 3)),
        "time": (0.0, 0.1),
        "times": (0.0, 0.1), "moving_frame.acceleration": lambda t: UP,
        "angles": lambda t: np.array([0.1 * t, 0.2 * t]), "duration": 0.002, "dt": 1e-3,
        "alpha": 0.1, "rate": 30.0,
        "high": 1.0, "low": 0.0, "omega": 5.0,
        "view_from_rotating_frame.omega": UP,
        "row": 0, "i": 0, "kind": "planned", "load.name": "go2",
        "solver": "daqp",
        "status": "inside", "root": "/robot", "lesson": "07",
        "path": "floatbase-view.html",
        "load_urdf.path": str(judges.load("ur5").urdf),
    }  # fmt: skip


# what only the package makes
RESULTS = """
    EquationsOfMotion FeasibleSpace Rollout Solution Iteration ActiveSetRun Residuals Decomposition
    TorquesFromForces CylinderGeometry PowerBalance Robot PushRecovery StepPlan
    AnalyticCommand Command Verdict Item ConstraintLabel recording.Animation HydraulicState Term
"""
LEFT_OUT = {
    "made by `slider_panel`": ("SliderPanel",),
    "judges whatever a learner may give": (
        "Exercise", "NumericJudge", "ShapeJudge", "check", "compare", "hand_in", "import_answers",
        "array_or_verdict", "predict", "recall", "reveal", "review",
    ),
    "the page's server, with tests of its own": ("Window",),
    "packages call these among themselves, with what they have checked": (
        *(f"{kind}.{method}" for kind in ("Simulation", "PerturbedSimulation")
            for method in ("advance", "contact_forces_of", "torques_of")),
        "Push.active_fraction", "conflicting_constraints", "constraint_and_jacobian",
        "raibert_foothold",
        *(f"{kind}Task.{method}" for method in ("shapes_for", "targets_at")
            for kind in ("AngularMomentum", "Axis", "CentreOfPressure", "CoM", "Force", "Frame",
                "Orientation", "Posture", "RelativePose", "Torque")),
        "QP.objective",
        "LinearInequality.labels", "LinearInequality.at", "Limits.check_names",
        "Limits.normal_forces", "Limits.hard_normal_forces", "Limits.all_inequalities",
        "Limits.softened", "JointLimits.labels", "JointLimits.rows", "JointLimits.check_size",
        "Problem.solve_levels",
        "Limits.bounded_points", "Problem.check",
        "recording.swing_feet_at", "Cylinders.force", "Cylinders.line_pressures",
        "Cylinders.advance", "Cylinders.orifice_flow",
        "Cylinders.valve_flows",
        "Cylinders.leakage_flow", "Cylinders.power", "Cylinders.pressure_rates",
        "Cylinders.pressure_decay",
        "Cylinders.opening_for",
        "recording.as_rollout", "Ground.clearances", "Observed.observe",
        *(f"{kind}.__call__" for kind in ("Observed", "SensorNoise", "Latency")),
        "with_thumbnail", "receive_during_cells",
    ),
    "starts a page, with tests of its own": (
        "Playground", "playground", *(f"Playground.{method}" for method in (
            "close", "push", "reset_all", "set", "set_nodding", "show_term", "start",
            "start_challenge", "undo",
        )),
    ),
    "takes any field of `Settings`, which is checked itself": ("Session.change",),
    "needs trimesh": ("urdf_visuals",),
    "draws what it is given": (
        "hex_code", "robot_meshes", "appearance_digest",
    ),
    "Contacts and rollout call them, and have checked": (
        "ConstantTorques.__call__", "TorqueCommand", *(f"{kind}.{method}"
            for kind in ("PointContact", "FlatFootContact", "RollingWheel", "LinearConstraint")
            for method in (
                "positions", "jacobian", "constraint", "force_generator_matrix", "slip"
            )),
    ),
    "moves a control that is there, with tests of its own": ("Viewer.set_control_value",),
    "ends what other calls need": ("Viewer.close", "LiveSimulation.close"),
    "starts processes, with tests of its own": ("sweep", "read_sweep", "push_recovery"),
    "starts a thread": (
        "LiveSimulation.push", "LiveSimulation.call_soon", "LiveSimulation.start",
        "LiveSimulation.reset",
    ),
}  # fmt: skip
ALONE = {name for names in LEFT_OUT.values() for name in names}


class Callee(NamedTuple):
    """Something to call: package, name, the function, and its parameters but `self`."""

    package: str
    name: str
    call: Callable[..., Any]
    parameters: list[inspect.Parameter]
    self: tuple[Any, ...] = ()


def callees() -> Iterator[Callee]:
    """All that the packages offer to call: functions, constructors, methods."""
    seen: set[int] = set()
    for package in PACKAGES:
        home = import_module(f"floatbase.{package}".rstrip("."))
        found = [(name, getattr(home, name)) for name in home.__all__]
        if package == "viewer":
            found += [
                (f"{module.__name__.split('.')[-1]}.{name}", value)
                for module in MODULES
                for name, value in made_in(module)
            ]
        for name, value in found:
            if id(value) in seen or name in ALONE:
                continue
            seen.add(id(value))
            if inspect.isfunction(value):
                yield Callee(package or "floatbase", name, value, parameters_of(value))
            elif (
                inspect.isclass(value)
                and not issubclass(value, Exception)
                and not getattr(value, "_is_protocol", False)
            ):
                if name not in RESULTS.split():
                    yield Callee(package or "floatbase", name, value, parameters_of(value))
                yield from methods_of(package or "floatbase", name, value)


def made_in(module: Any) -> list[tuple[str, Any]]:
    mine = inspect.getmembers(
        module, lambda value: getattr(value, "__module__", "") == module.__name__
    )
    return [(name, value) for name, value in mine if not name.startswith("_") and callable(value)]


def methods_of(package: str, name: str, kind: type) -> Iterator[Callee]:
    for method, value in inspect.getmembers(kind, inspect.isfunction):
        if (
            not method.startswith("_") or method in ("__call__", "__getitem__")
        ) and f"{name}.{method}" not in ALONE:
            if isinstance(inspect.getattr_static(kind, method), staticmethod):
                yield Callee(package, f"{name}.{method}", value, parameters_of(value))
            else:
                one = right().get(name)
                yield Callee(
                    package,
                    f"{name}.{method}",
                    partial(value, one),
                    parameters_of(value)[1:],
                    (one,),
                )


def parameters_of(function: Callable[..., Any]) -> list[inspect.Parameter]:
    """But for `options`: more arguments by name, which go to another callee here."""
    return [p for p in inspect.signature(function).parameters.values() if p.name != "options"]


def found_for(callee: Callee, parameter: inspect.Parameter) -> Any:
    """The right argument for a parameter: the field of that name of the class's own value, or from
    the table, under callee and parameter, the parameter's name, or its annotation.
    """
    if is_dataclass(callee.call) and hasattr(right().get(callee.name), parameter.name):
        return getattr(right()[callee.name], parameter.name)
    first, *_, last = callee.name.split(".") * 2
    name, kind = parameter.name, str(parameter.annotation).split(" | ")[0]
    keys = (
        f"{callee.name}.{name}",
        f"{last}.{name}",
        f"{first}.{name}",
        name,
        kind,
        kind.split("[")[0],
    )
    return next((right()[key] for key in keys if key in right()), ...)


def rights_of(callee: Callee) -> dict[str, Any]:
    """Right arguments for all parameters that have no default."""
    return {p.name: found_for(callee, p) for p in callee.parameters if p.default is p.empty}


@cache
def others() -> dict[str, Any]:
    """Things of another robot."""
    robot = judges.load("solo12")
    state, contacts = robot.standing(), judges.stance(robot)
    return {
        "Robot": robot,
        "State": state,
        "Contacts": contacts,
        "EquationsOfMotion": fb.equations_of_motion(state, contacts),
    }


def of_a_robot(value: Any) -> bool:
    """Whether a value belongs to one robot, and to no other."""
    return isinstance(value, fb.Robot | fb.Contacts) or isinstance(
        getattr(value, "robot", None), fb.Robot
    )


def wrongs(callee: Callee, name: str) -> dict[str, Any]:
    """Wrong arguments for a parameter."""
    rights = rights_of(callee)
    kind = type(rights.pop(name, None)).__name__
    alone = not any(
        map(of_a_robot, (*callee.self, *rights.values()))
    )  # then another robot's is as good as any
    if alone or kind not in others():
        return FEW
    return {label: wrong for label, wrong in FEW.items() if label != "ragged"} | {
        "of another robot": others()[kind]
    }


def called(callee: Callee, arguments: dict[str, Any]) -> Any:
    right()["Simulation"].reset()
    by_name = {
        p.name for p in callee.parameters if p.kind is p.KEYWORD_ONLY or p.default is not p.empty
    }
    starred = [p.name for p in callee.parameters if p.kind is p.VAR_KEYWORD]
    positional = [
        value for name, value in arguments.items() if name not in by_name and name not in starred
    ]
    keyword = {
        name: value for name, value in arguments.items() if name in by_name or name in starred
    }
    return callee.call(*positional, **keyword)


def answer(call: Callable[[], object]) -> str | None:
    """What is wrong with the answer to a wrong argument, or None."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            call()
        except FloatbaseError:
            return None
        except Exception as error:
            return f"{type(error).__name__}: {str(error)[:100]}"
    return "accepted"


@pytest.mark.parametrize("package", [package or "floatbase" for package in PACKAGES])
def test_wrong_arguments_are_told(
    package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    here = [callee for callee in callees() if callee.package == package]
    missing = [
        f"{callee.name}: {name}"
        for callee in here
        for name, value in rights_of(callee).items()
        if value is ...
    ]
    assert missing == [], "`right` needs an argument for each of these"
    refused = {
        c.name: found
        for c in here
        if (found := answer(partial(called, c, rights_of(c)))) != "accepted"
    }
    assert refused == {}, "`right` needs other arguments for these"
    faults = {
        f"{callee.name}({p.name}={label})": found
        for callee in here
        for p in callee.parameters
        for label, wrong in wrongs(callee, p.name).items()
        if (found := answer(partial(called, callee, rights_of(callee) | {p.name: wrong})))
    }
    assert {call: found for call, found in faults.items() if call not in ACCEPTED} == {}


SAMPLES = 300


@pytest.mark.parametrize("seed", range(2))
def test_a_sample_of_calls_with_any_wrong_argument_raises_no_other_error(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(seed)  # other calls with --seed
    calls = [(callee, p.name) for callee in callees() for p in callee.parameters]
    faults = {}
    for i, label in zip(
        rng.integers(len(calls), size=SAMPLES), rng.choice(list(WRONG), SAMPLES), strict=True
    ):
        callee, name = calls[i]
        found = answer(partial(called, callee, rights_of(callee) | {name: WRONG[label]}))
        if found not in (None, "accepted"):
            faults[f"{callee.name}({name}={label})"] = found
        plt.close("all")
    assert faults == {}
