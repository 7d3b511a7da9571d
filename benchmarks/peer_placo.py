"""placo's side of the comparison: `peers.py` starts it in placo's environment. What is said here is
said in placo's own words.

Contacts are hard tasks without gains (J q̈ = -J̇ q̇), torque limits and force weights are set,
everything that would change the optimum unasked (joint limits, the default torque cost) is off or
set to the problem's.
"""

import xml.etree.ElementTree as ET

import numpy as np
import pinocchio  # noqa: F401  (its types are what placo speaks in)
import placo
from peer_wire import Contender, serve


def build(description: dict) -> Contender:
    """The solver of a problem."""
    robot = placo.RobotWrapper(
        "", placo.Flags.ignore_collisions, _prepared(description["urdf"], description["contacts"])
    )
    names = [name for name in robot.model.names if name not in ("universe", "root_joint")]
    expected, armatures = description["joints"], description["armature"]
    if names != expected:
        raise SystemExit(f"placo orders the joints as {names}, the problem as {expected}.")
    solver = placo.DynamicsSolver(robot)
    solver.torque_cost = description["torque_weight"]
    solver.problem.regularization = description["hessian"]
    solver.enable_joint_limits(False)
    solver.enable_velocity_limits(False)
    solver.enable_torque_limits(True)
    for joint, limit, armature in zip(names, description["torque_limits"], armatures, strict=True):
        solver.set_torque_limit(joint, limit)
        robot.set_rotor_inertia(joint, armature)
        robot.set_gear_ratio(joint, 1.0)
    _add_tasks(solver, description)
    for contact in description["contacts"]:
        _add_contact(solver, contact, description["force_weight"])

    def tick(q, v):
        robot.state.q, robot.state.qd = q, v
        robot.update_kinematics()
        result = solver.solve()
        return result.tau[6:] if result.success else None

    return tick


def _prepared(urdf: str, contacts: list[dict]) -> str:
    """The URDF without its meshes, which no torque depends on, and with a massless link at each
    corner of a sole.
    """
    root = ET.fromstring(urdf)
    for link in root.iter("link"):
        for part in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(part)
    for contact in contacts:
        for i, corner in enumerate(contact["corners"] or []):
            name = _corner(contact["frame"], i)
            ET.SubElement(root, "link", name=name)
            joint = ET.SubElement(root, "joint", name=f"{name} joint", type="fixed")
            ET.SubElement(joint, "parent", link=contact["frame"])
            ET.SubElement(joint, "child", link=name)
            ET.SubElement(joint, "origin", xyz=" ".join(map(str, corner)), rpy="0 0 0")
    return ET.tostring(root, encoding="unicode")


def _add_tasks(solver: placo.DynamicsSolver, description: dict) -> None:
    desired = {
        kind: np.array(description[kind]["target"]) for kind in ("com", "orientation", "posture")
    }
    com = solver.add_com_task(desired["com"])
    base = solver.add_orientation_task(description["base"], desired["orientation"])
    posture = solver.add_joints_task()
    posture.set_joints(dict(zip(description["joints"], desired["posture"], strict=True)))
    for task, kind in ((com, "com"), (base, "orientation"), (posture, "posture")):
        task.configure(kind, "soft", description[kind]["weight"])
        task.kp, task.kd = description[kind]["kp"], description[kind]["kd"]


def _add_contact(solver: placo.DynamicsSolver, contact: dict, force_weight: float) -> None:
    """A point, or a sole that carries a force at each corner."""
    frame, corners = contact["frame"], contact["corners"]
    if corners is None:
        task = _kept(solver.add_position_task(frame, np.zeros(3)), frame, "hard", 1.0)
        made = [solver.add_unilateral_point_contact(task)]
    else:
        task = solver.add_frame_task(frame, np.eye(4))
        for part in (task.position(), task.orientation()):
            _kept(part, frame, "hard", 1.0)
        made = []
        for name in (_corner(frame, i) for i in range(len(corners))):
            carrier = _kept(solver.add_position_task(name, np.zeros(3)), name, "soft", 0.0)
            made.append(solver.add_unilateral_point_contact(carrier))
    for one in made:
        one.mu, one.weight_forces, one.weight_tangentials = contact["mu"], force_weight, 0.0


def _kept(task, name: str, priority: str, weight: float):
    """The task without gains, so that hard it says J q̈ = -J̇ q̇, and without weight only gives a
    contact its Jacobian.
    """
    task.configure(name, priority, weight)
    task.kp = task.kd = 0.0
    return task


def _corner(frame: str, i: int) -> str:
    return f"{frame} corner {i}"


if __name__ == "__main__":
    serve(build)
