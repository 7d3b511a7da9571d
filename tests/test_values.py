"""Values cannot be written to: neither their arrays nor their attributes."""

from __future__ import annotations

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.control import AnalyticController
from floatbase.dynamics import RollingWheel
from floatbase.friction import FrictionCone, FrictionPolyhedron, decompose, wrench_set

UP = np.array([0.0, 0.0, 1.0])
ROBOT = judges.load("go2")
STATE = ROBOT.random_state(1, 0.1)
CONTACTS = judges.stance(ROBOT)
EOM = fb.equations_of_motion(STATE, CONTACTS)
CONTROLLER = judges.controller_of("go2")
COMMAND = CONTROLLER(STATE.q, STATE.v)
RECORD = fb.rollout(fb.Simulation(ROBOT), CONTROLLER, 0.005)
VALUES = {
    "Robot": ROBOT, "Foot": judges.load("talos").feet[0], "State": STATE, "Contacts": CONTACTS,
    "PointContact": CONTACTS["FL_foot"],
    "FlatFootContact": next(iter(judges.stance(judges.load("talos")))), "RollingWheel": RollingWheel("base", [0, 1, 0], 0.2),
    "EquationsOfMotion": EOM, "Affine": fb.Affine(np.eye(2), np.ones(2)),
    "Quadratic": fb.Quadratic(np.eye(2), np.ones(2)), "QP": CONTROLLER.qp(STATE), "Solution": COMMAND.solution,
    "Limits": CONTROLLER.limits, "FrictionCone": FrictionCone(UP, 0.7), "FrictionPolyhedron": FrictionPolyhedron(UP, 0.7),
    "Decomposition": decompose([5.0, 0.0, 1.0], UP),
    "WrenchSet": wrench_set(STATE, CONTACTS),
    "Command": COMMAND, "AnalyticCommand": AnalyticController(ROBOT, CONTACTS, STATE)(STATE.q, STATE.v), "Rollout": RECORD,
    "Push": fb.Push([1.0, 0.0, 0.0]),
}  # fmt: skip


def test_no_array_and_no_attribute_of_a_value_can_be_written_to() -> None:
    for kind, value in VALUES.items():
        names = [name for name in dir(value) if not name.startswith("_")]
        arrays = {name: array for name in names if isinstance(array := getattr(value, name), np.ndarray)}
        assert arrays, kind
        for name, array in arrays.items():
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0.0
                pytest.fail(f"{kind}.{name} was written to")
            with pytest.raises((AttributeError, fb.FloatbaseError)):
                setattr(value, name, array)
                pytest.fail(f"{kind}.{name} was set")


def test_what_a_value_returns_cannot_be_written_to() -> None:
    wrenches = VALUES["WrenchSet"]
    answers = {
        "frame_jacobian": STATE.frame_jacobian("base"), "frame_drift": STATE.frame_drift("base"), "point": STATE.point("base"),
        "positions": CONTACTS.positions(STATE), "jacobian": CONTACTS.jacobian(STATE), "A": CONTACTS.constraint(STATE)[0],
        "torques": wrenches.torques(), "support_region": wrenches.support_region(), "solution block": COMMAND.solution["tau"],
        "slip": RECORD.slip(), "final q": RECORD.final.q, "command force": COMMAND.force("FL_foot"),
    }  # fmt: skip
    for shape in (VALUES["FrictionCone"], VALUES["FrictionPolyhedron"]):
        answers |= {f"projection of {force} to {shape}": shape.project(force) for force in ([5.0, 0.0, 1.0], UP, -UP)}
    assert [name for name, array in answers.items() if array.flags.writeable] == []
    with pytest.raises(TypeError):
        COMMAND.solution.qp.blocks["tau"] = slice(0, 1)
