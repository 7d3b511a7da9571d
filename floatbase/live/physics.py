"""The MuJoCo model of a simulation, as data for the robot in a web page."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from floatbase.simulation import FALLEN_COSINE, FALLEN_HEIGHT_FRACTION, Simulation, joint_damping

# fields of MuJoCo's model that its XML file rounds to six digits. Meshes are left out: only the
# hulls of the links have them, on which a fallen robot lies
_ROUNDED_FIELDS = ("actuator_", "body_", "dof_", "geom_", "jnt_")
_BASE_QPOS = [0, 1, 2, 4, 5, 6, 3]  # MuJoCo's quaternion begins with w, that of q ends with it


def model_data(sim: Simulation) -> dict[str, Any]:
    """Return the model of a robot with a floating base and joints with limits.

    The names are those of the page's JavaScript: the model as XML, the fields that the XML does not
    store exactly, the places of joints and bodies in MuJoCo's arrays, and the limits of `fallen`.
    """
    model, xml = sim.model, sim.spec().to_xml()
    joints = [model.joint(name) for name in sim.robot.joint_names]
    base = model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]
    hulls, hull_bodies = _hulls(sim)
    return {
        "xml": xml,
        "overrides": _lost_digits(model, xml),
        "fallenHeight": FALLEN_HEIGHT_FRACTION,
        "fallenCosine": FALLEN_COSINE,
        "home": {"qpos": sim.data.qpos.tolist(), "com": sim.state.com.tolist()},
        # in the package's order: entries of qpos and qvel, bodies that joints move, joints
        "qposOfQ": [*_BASE_QPOS, *(int(joint.qposadr[0]) for joint in joints)],
        "qvelOfV": [*range(6), *(int(joint.dofadr[0]) for joint in joints)],
        "bodies": [0, *base.tolist(), *(int(joint.bodyid[0]) for joint in joints)],
        "joints": [int(joint.id) for joint in joints],
        "motors": [int(model.actuator(name).id) for name in sim.robot.joint_names],
        "damping": joint_damping(sim.state, sim.timestep).tolist(),
        "hulls": hulls,
        "hullBodies": hull_bodies,
        "points": [
            {"name": name, "geom": int(geom), "radius": float(model.geom_size[geom, 0])}
            for name, geom in zip(sim.point_names, sim.foot_contacts.geoms, strict=True)
        ],
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


def _hulls(sim: Simulation) -> list[list[int]]:
    """Return the geoms and the bodies that `link_collisions` switches."""
    affinities = sim.model.geom_conaffinity, sim.model.body_conaffinity
    off = [affinity.copy() for affinity in affinities]
    sim.link_collisions = True
    switched = [np.flatnonzero(on != old).tolist() for on, old in zip(affinities, off, strict=True)]
    sim.link_collisions = False
    return switched
