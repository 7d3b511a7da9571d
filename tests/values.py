"""A value of every public class of the packages, for tests that hold for all of them."""

from functools import cache
from typing import Any

import judges
import numpy as np

import floatbase as fb
from floatbase.actuators import HydraulicActuators, JointTargets
from floatbase.behaviours import LIPM, Gains, Gait, HorizonQP, JumpPlan, Swing
from floatbase.control import AnalyticController, JointLimits, LinearInequality
from floatbase.dynamics import (
    RollingWheel,
    bias_forces,
    contact_space,
    fixed_frame,
    moving_frame,
    view_from_rotating_frame,
)
from floatbase.friction import FrictionCone, FrictionPolyhedron, decompose, wrench_set
from floatbase.lessons.lessonC import table_top
from floatbase.objectives import (
    AngularMomentumTask,
    AxisTask,
    CentreOfPressureTask,
    RelativePoseTask,
    torques_from_forces,
)
from floatbase.qp import active_set
from floatbase.simulation import Box, PushRecovery, SensorNoise

UP = np.array([0.0, 0.0, 1.0])


@cache
def controller() -> fb.WholeBodyController:
    return judges.controller_of("go2")


@cache
def record() -> fb.Rollout:
    return fb.rollout(fb.Simulation(judges.load("go2")), controller(), 0.005)


def horizon_arguments() -> tuple[Any, ...]:
    """Arguments of `HorizonQP.solve`: two intervals on four feet."""
    feet = np.tile([[x, y, -0.3] for x in (0.2, -0.2) for y in (0.1, -0.1)], (2, 1, 1))
    return np.zeros(12), np.zeros((2, 12)), feet, np.ones((2, 4), dtype=bool)


@cache
def values() -> dict[str, Any]:
    """The values, by the names of their classes."""
    robot, control, talos = judges.load("go2"), controller(), judges.load("talos")
    state, contacts = robot.random_state(1, 0.1), judges.stance(robot)
    eom, command = fb.equations_of_motion(state, contacts), control(state.q, state.v)
    hydraulic, run = HydraulicActuators(robot), active_set(table_top())
    pose = hydraulic.cylinders.geometry(state.q[7:])
    plan = LIPM([(0.0, 1.0, np.zeros(2), np.full(2, 0.1))], np.zeros(2), 5.0)
    horizon = HorizonQP(10.0, 0.1 * np.eye(3))
    motion = horizon.solve(*horizon_arguments())
    return {
        "HorizonQP": horizon, "HorizonMotion": motion,
        "JumpPlan": JumpPlan.of(0.1, 0.2, 0.5, 0.3, 9.81),
        "Robot": robot, "Foot": talos.feet[0], "State": state, "Contacts": contacts,
        "PointContact": contacts["FL_foot"],
        "FlatFootContact": next(iter(judges.stance(talos))),
        "RollingWheel": RollingWheel("base", [0, 1, 0], 0.2),
        "LinearConstraint": fixed_frame("base"), "EquationsOfMotion": eom,
        "FeasibleSpace": fb.feasible_space(eom),
        "Affine": fb.Affine(np.eye(2), np.ones(2), {"top": slice(0, 1)}),
        "Quadratic": fb.Quadratic(np.eye(2), np.ones(2)), "QP": control.qp(state),
        "Solution": command.solution,
        "ActiveSetRun": run, "Iteration": run.iterations[0],
        "Residuals": command.solution.residuals,
        "CoMTask": fb.CoMTask(state.com), "FrameTask": fb.FrameTask("FL_foot", UP),
        "OrientationTask": fb.OrientationTask(),
        "PostureTask": fb.PostureTask(state.q), "ForceTask": fb.ForceTask(np.ones(12)),
        "TorqueTask": fb.TorqueTask(np.ones(12)), "AngularMomentumTask": AngularMomentumTask(),
        "AxisTask": AxisTask("base", UP, UP),
        "CentreOfPressureTask": CentreOfPressureTask(np.zeros(3)),
        "RelativePoseTask": RelativePoseTask("FL_foot", "base", np.eye(4)),
        "TorquesFromForces": torques_from_forces(eom), "Limits": control.limits,
        "Problem": control.problem,
        "FrictionCone": FrictionCone(UP, 0.7), "FrictionPolyhedron": FrictionPolyhedron(UP, 0.7),
        "Decomposition": decompose([5.0, 0.0, 1.0], UP), "WrenchSet": wrench_set(state, contacts),
        "Command": command,
        "CommandBatch": control.batch([state.q], [state.v]),
        "AnalyticCommand": AnalyticController(robot, contacts, state)(state.q, state.v),
        "Rollout": record(),
        "Push": fb.Push([1.0, 0.0, 0.0]), "Ground": fb.Ground(),
        "Box": Box([0.0, 1.0], [0.0, 1.0], 0.1), "SensorNoise": SensorNoise(robot),
        "Hydraulics": hydraulic.cylinders.hydraulics,
        "JointTargets": JointTargets(*np.ones((5, 12))),
        "HydraulicState": hydraulic.state, "CylinderGeometry": pose,
        "PowerBalance": hydraulic.cylinders.power(
            np.zeros(12), hydraulic.state.pressures, pose, np.zeros(12)
        ),
        "bias forces": bias_forces(state), "contact space": contact_space(eom),
        "drive": moving_frame("base", np.zeros_like),
        "JointLimits": JointLimits.of(robot),
        "LinearInequality": LinearInequality("acceleration", "qdd", (np.eye(18), np.ones(18))),
        "PushRecovery": PushRecovery(
            np.arange(4.0), np.full(4, 30.0), 5.0, 0.1, "base", state, contacts
        ),
        "Gait": Gait.trot(robot), "Swing": Swing(np.zeros(3), UP, 0.0, 0.5), "LIPM": plan,
        "Gains": Gains(),
        "turning view": view_from_rotating_frame([0.0, 0.1], UP, UP),
    }  # fmt: skip
