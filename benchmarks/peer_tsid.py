"""TSID's side of the comparison: `peers.py` starts it in TSID's environment. What is said here is
said in TSID's own words.

Contacts are motion constraints without gains (J q̈ = -J̇ q̇); forces are regularised alike along
all axes (by default the normal counts a thousandth) and may be as large as they like.
"""

import numpy as np
import pinocchio as pin
import tsid
from peer_wire import Contender, serve

HARD, SOFT = 0, 1  # priority levels
NO_LIMIT = 1e6  # N


def build(description: dict) -> Contender:
    """The formulation and solver of a problem."""
    model = pin.buildModelFromXML(description["urdf"], pin.JointModelFreeFlyer())
    names, expected = list(model.names)[2:], description["joints"]
    if names != expected:
        raise SystemExit(f"TSID orders the joints as {names}, the problem as {expected}.")
    model.armature = np.concatenate([np.zeros(6), description["armature"]])
    robot = tsid.RobotWrapper(model, tsid.RootJointType.FLOATING_BASE_SYSTEM, False)
    formulation = tsid.InverseDynamicsFormulationAccForce("standing", robot, False)
    formulation.computeProblemData(0.0, pin.neutral(model), np.zeros(model.nv))
    kept = [
        _add_contact(formulation, robot, contact, description["force_weight"])
        for contact in description["contacts"]
    ]
    kept += [*_add_tasks(formulation, robot, description), robot]
    if description["joint_limits"]:
        kept.append(_add_joint_limits(formulation, robot, description["joint_limits"]))
    solver = tsid.SolverHQuadProgFast("solver")
    solver.resize(formulation.nVar, formulation.nEq, formulation.nIn)

    def tick(q, v, kept=kept):  # TSID only points at its tasks and robot: keep them
        solution = solver.solve(formulation.computeProblemData(0.0, q, v))
        return formulation.getActuatorForces(solution) if solution.status == 0 else None

    return tick


def _add_contact(formulation, robot, contact: dict, force_weight: float):
    frame, friction = contact["frame"], (np.array([0.0, 0.0, 1.0]), contact["mu"], 0.0, NO_LIMIT)
    if contact["corners"] is None:
        made, size = tsid.ContactPoint(frame, robot, frame, *friction), 3
        made.useLocalFrame(False)
        made.setRegularizationTaskWeightVector(np.ones(size))
    else:
        corners = np.array(contact["corners"]).T
        made, size = tsid.Contact6d(frame, robot, frame, corners, *friction), 6
    made.setKp(np.zeros(size))
    made.setKd(np.zeros(size))
    made.setReference(pin.SE3.Identity())
    formulation.addRigidContact(made, force_weight)
    return made


def _add_tasks(formulation, robot, description: dict) -> list:
    com = tsid.TaskComEquality("com", robot)
    base = tsid.TaskSE3Equality("orientation", robot, description["base"])
    base.setMask(np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]))
    posture = tsid.TaskJointPosture("posture", robot)
    desired = {
        kind: np.array(description[kind]["target"]) for kind in ("com", "orientation", "posture")
    }
    # position, then columns
    desired["orientation"] = np.r_[np.zeros(3), desired["orientation"].ravel(order="F")]
    tasks = (com, "com", 3), (base, "orientation", 6), (posture, "posture", robot.na)
    for task, kind, size in tasks:
        task.setKp(description[kind]["kp"] * np.ones(size))
        task.setKd(description[kind]["kd"] * np.ones(size))
        sample = tsid.TrajectorySample(desired[kind].size, size)
        sample.value(desired[kind])
        task.setReference(sample)
        formulation.addMotionTask(task, description[kind]["weight"], SOFT, 0.0)
    limits = np.array(description["torque_limits"])
    bounds = tsid.TaskActuationBounds("torque limits", robot)
    bounds.setBounds(-limits, limits)
    formulation.addActuationTask(bounds, 1.0, HARD, 0.0)
    return [com, base, posture, bounds]


def _add_joint_limits(formulation, robot, limits: dict):
    # TSID doubles the time step of the constructor
    bounds = tsid.TaskJointPosVelAccBounds("joint limits", robot, 0.5 * limits["period"], False)
    bounds.setPositionBounds(np.array(limits["lower"]), np.array(limits["upper"]))
    bounds.setVelocityBounds(np.array(limits["velocity"]))
    bounds.setAccelerationBounds(np.array(limits["acceleration"]))
    bounds.setImposeBounds(True, True, True, True)
    formulation.addMotionTask(bounds, 1.0, HARD, 0.0)
    return bounds


if __name__ == "__main__":
    serve(build)
