"""The dynamics inside the compiled tick against Pinocchio's."""

from dataclasses import replace

import judges
import numpy as np
import pinocchio as pin
import pytest

import floatbase as fb
from floatbase.control.tick import dynamics

ROUNDING = 1e-12  # relative to the largest entry
LINK = """<link name="l{0}"><inertial><mass value="{0}.5"/><origin xyz="0.1 -0.2 0.2" rpy="1 2 3"/>
<inertia ixx="0.1" iyy="0.2" izz="0.15" ixy="0.01" ixz="0.02" iyz="-0.01"/></inertial></link>"""
JOINT = """<joint name="j{0}" type="{1}"><parent link="l{2}"/><child link="l{0}"/>
<origin xyz="0.1 0.2 0.3" rpy="{0} 1 2"/><axis xyz="{3}"/>
<limit effort="50" velocity="9" lower="-3" upper="3"/></joint>"""
JOINTS = (
    ("continuous", 0, "0.6 0 0.8"), ("prismatic", 1, "0 0.6 -0.8"),
    ("revolute", 2, "0.48 0.6 0.64"), ("continuous", 0, "0 0 1"), ("prismatic", 4, "1 0 0"),
    ("fixed", 5, "1 0 0"),
)  # fmt: skip


def own_robot(floating: bool) -> fb.Robot:
    """Return two branches of all kinds of joints, with rotors and tilted gravity."""
    joints = [JOINT.format(i, *each) for i, each in enumerate(JOINTS, 1)]
    links = [LINK.format(i) for i in range(len(JOINTS) + 1)]
    robot = fb.load_urdf(f"<robot name='own'>{''.join(links + joints)}</robot>", floating=floating)
    model = robot.model.copy()
    model.gravity = pin.Motion(np.array([3.0, -2.0, -8.0]), np.zeros(3))
    model.armature = np.linspace(0.1, 0.4, model.nv)
    return replace(robot, model=model)


@pytest.mark.parametrize("name", [*judges.ROBOTS, "own", "own, bolted down"])
def test_the_tick_computes_what_pinocchio_computes(name):
    robot = own_robot(name == "own") if "own" in name else judges.load(name)
    tick = fb.WholeBodyController(robot, fb.Contacts.none(), [], backend="compiled").compiled
    model, data, n, nv = robot.model, robot.model.createData(), robot.model.njoints, robot.nv
    # as `take_bodies` takes them
    shapes = (n, 12), (nv, 6), (n, 6), (n, 6), (n, dynamics.RATE + 6), (nv, 6), (nv, nv), (nv, 1)
    ends = 1 + 3 * (nv + 1) + 2 * robot.d + np.cumsum([0, *map(np.prod, shapes)])
    for seed in range(5):
        state = robot.random_state(seed, 1.0)
        q, v = np.array(state.q), np.array(state.v)
        tick.run(q, v, tick.default_inputs, 1)
        parts = zip(np.split(tick.workspace()[0], ends)[1:-1], shapes, strict=True)
        poses, J, velocity, drift, carried, Ag, M, h = (part.reshape(to) for part, to in parts)
        _, moments_of_mass, mass, force, moment = np.split(carried[0], [9, 12, 13, 16])
        com = moments_of_mass / mass
        expected = [
            (h[:, 0], pin.nonLinearEffects(model, data, q, v)),
            (M, pin.crba(model, data, q, pin.Convention.WORLD)),
            (J.T, pin.computeJointJacobians(model, data, q)),
            (com, pin.centerOfMass(model, data, q)),
            (np.append(force, moment - np.cross(com, force)), pin.dccrba(model, data, q, v) @ v),
            (Ag.T, data.Ag),
        ]
        pin.forwardKinematics(model, data, q, v, np.zeros(nv))
        for i, placement in enumerate(data.oMi):
            expected += [
                (poses[i], np.append(placement.rotation.T, placement.translation)),
                (velocity[i], placement.act(data.v[i]).vector),
                (drift[i], placement.act(data.a[i]).vector),
            ]
        for ours, judged in expected:
            assert np.abs(ours - judged).max() <= ROUNDING * max(1.0, np.abs(judged).max())
