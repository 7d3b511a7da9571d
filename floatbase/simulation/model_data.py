"""A simulation's model as plain data, from which another program can build the same physics."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from floatbase._validation import as_instance
from floatbase.errors import InputError
from floatbase.simulation.after_fall import joint_damping
from floatbase.simulation.build import build_spec
from floatbase.simulation.physics import FALLEN_COSINE, FALLEN_HEIGHT_FRACTION, Simulation

# fields of MuJoCo's model that its XML file rounds to six digits. Meshes are left out: only the
# hulls of the links have them, on which a fallen robot lies
_ROUNDED_FIELDS = ("actuator_", "body_", "dof_", "geom_", "jnt_")


def model_data(sim: Simulation) -> dict[str, Any]:
    """Return the model of a simulation, and how its numbers relate to those of the package.

    Parameters
    ----------
    sim : Simulation
        Simulation of a floating-base robot without continuous joints, in its initial state.

    Returns
    -------
    dict
        Plain lists and numbers: MuJoCo's XML, `overrides` with the fields that it rounds, MuJoCo's
        indices in the package's order, the initial `qpos`, damping of the joints after a fall
        [N·m·s/rad], and the limits that `Simulation.fallen` uses.

    Raises
    ------
    InputError
        If the robot has a fixed base or joints without limits.
    """
    robot, model = as_instance("sim", sim, Simulation).robot, sim.model
    if not robot.is_floating or robot.nq != robot.nv + 1:
        raise InputError(
            f"{robot.name} has a fixed base, or joints without limits. Use a robot with a floating "
            f"base and joints with limits."
        )
    xml, conversion = build_spec(robot, sim.ground, sim.timestep).to_xml(), sim._conversion
    joints = [model.joint(name) for name in robot.joint_names]
    return {
        "xml": xml,
        "overrides": _lost_digits(model, xml),
        "qpos": sim.data.qpos.tolist(),
        "qposOfQ": conversion._qpos_of_q.tolist(),
        "qvelOfV": conversion._qvel_of_v.tolist(),
        # bodies that joints move, joint 0 being the world; then joints
        "bodies": [0, 1, *(int(joint.bodyid[0]) for joint in joints)],
        "joints": [int(joint.id) for joint in joints],
        "motors": sim._actuator_ids.tolist(),
        "damping": joint_damping(sim, sim.timestep).tolist(),
        "hulls": sim._hull_geoms.tolist(),
        "hullBodies": sim._hull_bodies.tolist(),
        "points": [
            {"name": name, "geom": int(geom), "radius": float(model.geom_size[geom, 0])}
            for name, geom in zip(sim.point_names, sim.foot_contacts.geoms, strict=True)
        ],
        "fallenHeight": FALLEN_HEIGHT_FRACTION,
        "fallenCosine": FALLEN_COSINE,
    }


def _lost_digits(model: mujoco.MjModel, xml: str) -> dict[str, list[float]]:
    """Return the fields of a model that its XML file does not hold to the last digit."""
    read, lost = mujoco.MjModel.from_xml_string(xml), {}
    for name in dir(model):
        exact: Any = getattr(model, name) if name.startswith(_ROUNDED_FIELDS) else None
        is_real = isinstance(exact, np.ndarray) and exact.dtype.kind == "f"
        if is_real and not np.array_equal(exact, getattr(read, name)):
            lost[name] = exact.ravel().tolist()
    return lost
