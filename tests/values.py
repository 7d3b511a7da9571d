"""A value of every public class of the rooms, for tests that hold for all of them."""

from __future__ import annotations

import judges
import numpy as np

import floatbase as fb
from floatbase.actuators import HydraulicActuators
from floatbase.behaviours import LIPM, Gains, Gait, Swing
from floatbase.control import AnalyticController, Belief, Rows
from floatbase.dynamics import RollingWheel, bias_forces, contact_space, fixed_frame, moving_frame, seen_from_turning_frame
from floatbase.friction import FrictionCone, FrictionPolyhedron, decompose, wrench_set
from floatbase.objectives import torque_for_forces
from floatbase.qp import active_set, table_top
from floatbase.simulation import PushRose, Table, World

UP = np.array([0.0, 0.0, 1.0])
ROBOT = judges.load("go2")
STATE = ROBOT.random_state(1, 0.1)
CONTACTS = judges.stance(ROBOT)
EOM = fb.equations_of_motion(STATE, CONTACTS)
CONTROLLER = judges.controller_of("go2")
COMMAND = CONTROLLER(STATE.q, STATE.v)
RECORD = fb.rollout(fb.Simulation(ROBOT), CONTROLLER, 0.005)
HYDRAULIC = HydraulicActuators(ROBOT)
POSE = HYDRAULIC.cylinders.pose(STATE.q[7:])
RUN = active_set(table_top())
PLAN = LIPM([(0.0, 1.0, np.zeros(2), np.full(2, 0.1))], np.zeros(2), 5.0)
VALUES = {
    "Robot": ROBOT, "Foot": judges.load("talos").feet[0], "State": STATE, "Contacts": CONTACTS,
    "PointContact": CONTACTS["FL_foot"],
    "FlatFootContact": next(iter(judges.stance(judges.load("talos")))), "RollingWheel": RollingWheel("base", [0, 1, 0], 0.2),
    "LinearConstraint": fixed_frame("base"), "EquationsOfMotion": EOM, "FeasibleSpace": fb.feasible_space(EOM),
    "Affine": fb.Affine(np.eye(2), np.ones(2), {"top": slice(0, 1)}),
    "Quadratic": fb.Quadratic(np.eye(2), np.ones(2)), "QP": CONTROLLER.qp(STATE), "Solution": COMMAND.solution,
    "ActiveSetRun": RUN, "Iteration": RUN.iterations[0], "Residuals": COMMAND.solution.residuals,
    "CoMTask": fb.CoMTask(STATE.com), "FrameTask": fb.FrameTask("FL_foot", UP), "OrientationTask": fb.OrientationTask(),
    "PostureTask": fb.PostureTask(STATE.q), "ForceTask": fb.ForceTask(np.ones(12)), "TorqueTask": fb.TorqueTask(np.ones(12)),
    "TorqueForForces": torque_for_forces(EOM), "Limits": CONTROLLER.limits, "Problem": CONTROLLER.problem,
    "FrictionCone": FrictionCone(UP, 0.7), "FrictionPolyhedron": FrictionPolyhedron(UP, 0.7),
    "Decomposition": decompose([5.0, 0.0, 1.0], UP), "WrenchSet": wrench_set(STATE, CONTACTS),
    "Command": COMMAND, "AnalyticCommand": AnalyticController(ROBOT, CONTACTS, STATE)(STATE.q, STATE.v), "Rollout": RECORD,
    "Push": fb.Push([1.0, 0.0, 0.0]), "Ground": fb.Ground(), "Hydraulics": HYDRAULIC.cylinders.hydraulics,
    "OilState": HYDRAULIC.state, "Pose": POSE,
    "Power": HYDRAULIC.cylinders.power(np.zeros(12), HYDRAULIC.state.pressures, POSE, np.zeros(12)),
    "bias forces": bias_forces(STATE), "contact space": contact_space(EOM), "drive": moving_frame("base", np.zeros_like),
    "Rows": Rows("acceleration", "qdd", (np.eye(18), np.ones(18))), "Table": Table(({"force": 1.0, "error": None},)),
    "PushRose": PushRose(np.arange(4.0), np.full(4, 30.0), 5.0, 0.1, "base", STATE, CONTACTS),
    "Gait": Gait.trot(ROBOT), "Swing": Swing(np.zeros(3), UP, 0.0, 0.5), "LIPM": PLAN, "Gains": Gains(),
    "Belief": Belief(mass=1.2), "World": World(mass=1.2),
    "turning view": seen_from_turning_frame([0.0, 0.1], UP, UP),
}  # fmt: skip
