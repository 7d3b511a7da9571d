"""Conversion of states and models between our convention and MuJoCo's."""

import ast
import re

import judges
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from messages import raises

import floatbase as fb
from floatbase.errors import SimulationError

seeds = st.integers(0, 100_000)
any_robot = st.sampled_from(judges.ROBOTS)


@given(seed=seeds, name=any_robot)
def test_a_state_survives_the_way_to_mujoco_and_back(seed, name):
    state, convert = judges.load(name).random_state(seed, 0.7), judges.mujoco_of(name).convert
    qpos, qvel = convert.to_mujoco(state.q, state.v)
    assert np.allclose(convert.q(qpos), state.q, atol=1e-12)
    assert np.allclose(convert.v(qpos, qvel), state.v, atol=1e-12)


@given(seed=seeds, name=st.sampled_from(judges.FLOATING))
def test_mujoco_gets_the_scalar_of_the_quaternion_first_and_the_linear_velocity_in_the_world(
    seed, name
):
    state, convert = judges.load(name).random_state(seed, 0.7), judges.mujoco_of(name).convert
    qpos, qvel = convert.to_mujoco(state.q, state.v)
    assert np.array_equal(qpos[3:7], state.q[[6, 3, 4, 5]])
    assert np.allclose(qvel[:3], judges.quaternion_rotation(state.q[3:7]) @ state.v[:3], atol=1e-12)
    assert np.array_equal(qvel[3:6], state.v[3:6])


@given(seed=seeds, name=any_robot)
def test_joints_keep_their_names_on_the_way_to_mujoco(seed, name):
    robot, judge = judges.load(name), judges.mujoco_of(name)
    state = robot.random_state(seed, 0.7)
    qpos, qvel = judge.convert.to_mujoco(state.q, state.v)
    for joint in robot.joint_names:
        number = robot.model.getJointId(joint)
        assert qvel[judge.model.joint(joint).dofadr[0]] == state.v[robot.model.idx_vs[number]]
        if robot.model.nqs[number] == 1:
            assert qpos[judge.model.joint(joint).qposadr[0]] == state.q[robot.model.idx_qs[number]]


def test_joints_without_limits_are_angles_for_mujoco_and_cosine_and_sine_for_us():
    robot = fb.load("kinova")
    turning = [j for j in range(1, robot.model.njoints) if robot.model.nqs[j] == 2]
    assert turning, "the Kinova arm has joints that turn without limit"
    judge = judges.Mujoco(robot)
    q, v = robot.standing().q.copy(), np.arange(robot.nv) + 1.0
    for angle in (-3.0, -0.4, 0.0, 1.9):
        for k, joint in enumerate(turning):
            at = robot.model.idx_qs[joint]
            q[at : at + 2] = np.cos(angle + 0.1 * k), np.sin(angle + 0.1 * k)
        qpos, qvel = judge.convert.to_mujoco(fb.State(robot, q).q, v)
        for k, joint in enumerate(turning):
            assert np.isclose(
                qpos[judge.model.joint(robot.model.names[joint]).qposadr[0]], angle + 0.1 * k
            )
        assert np.allclose(judge.convert.q(qpos), q, atol=1e-12)
        assert np.allclose(judge.convert.v(qpos, qvel), v, atol=1e-12)
        state = fb.State(robot, q, v)
        assert judges.relative(state.M, judge.move_to(state).M) < 1e-9
        assert judges.relative(state.h, judge.h) < 1e-9


def test_a_floating_robot_whose_root_link_is_called_world_is_built_and_falls_freely():
    """MuJoCo would weld a link named "world" to the ground; that of ur5 gets a mass here."""
    arm = judges.load("ur5")
    inertia = 'ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"'
    inertial = f'<inertial><mass value="1"/><inertia {inertia}/></inertial>'
    urdf = arm.urdf.replace('<link name="world" />', f'<link name="world">{inertial}</link>')
    loose = fb.load_urdf(urdf, package_dirs=arm.package_dirs)
    assert loose.base == "world"
    sim, state = fb.Simulation(loose, timestep=1e-4), loose.random_state(0)
    sim.reset(state)
    assert np.allclose(sim.q, state.q)
    assert np.allclose(judges.Mujoco(loose).move_to(state).M, state.M, atol=1e-9)
    lift = fb.Push([0.0, 0.0, 2.0 * loose.weight], duration=1.0)  # it falls upwards with g
    sim.reset(state.replace(v=np.zeros(12)))
    for _ in range(200):
        sim.step(np.zeros(6), (lift,))
    assert sim.state.com_velocity[2] == pytest.approx(0.02 * loose.gravity, rel=0.01)


@pytest.mark.parametrize(
    ("name", "feet"),
    [
        # feet with mass and no inertia, the last links of their legs
        ("hyq", ["lf_foot", "lh_foot", "rf_foot", "rh_foot"]),
        ("anymal_c", ["LF_FOOT"]),  # cameras whose inertia no body has
        ("bolt", ["FL_FOOT"]),  # feet with inertia and no mass
    ],
)
def test_welded_links_move_as_one_body_whatever_each_of_them_is(name, feet):
    state = fb.load(name, feet=feet, foot_radius=0.02).random_state(0)
    judge = judges.Mujoco(state.robot).move_to(state)
    # each entry relative to its own joints', or a shank's would not show next to the trunk's
    size = np.sqrt(state.M.diagonal())
    assert np.max(np.abs(state.M - judge.M) / np.outer(size, size)) < 1e-9
    assert judges.relative(state.h, judge.h) < 1e-9


def test_an_impossible_inertia_with_turned_axes_is_handed_on_as_it_stands(tmp_path):
    """<inertial> may be rotated (rpy) both in a fused link and in the link that it is fused to."""

    def link(name: str, inertia: str, rpy: str) -> str:
        return (
            f'<link name="{name}"><inertial><mass value="2"/><origin xyz="0.1 0 0.05" rpy="{rpy}"/>'
            f'<inertia {inertia} ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )

    good, bad = 'ixx="0.1" iyy="0.12" izz="0.15"', 'ixx="0.05" iyy="0.02" izz="-0.001"'
    links = (
        link("trunk", good, "0 0 0")
        + link("leg", good, "0.3 -0.2 0.5")
        + link("toe", bad, "-0.4 0.1 0.8")
    )
    joints = "".join(
        f'<joint name="{kind}" type="{kind}"><parent link="{parent}"/><child '
        f'link="{child}"/><origin xyz="0.1 0 -0.2"'
        ' rpy="0.4 0.2 -0.3"/><axis xyz="0 1 0"/><limit effort="50" velocity="9" lower="-3" '
        'upper="3"/></joint>'
        for kind, parent, child in (("revolute", "trunk", "leg"), ("fixed", "leg", "toe"))
    )
    urdf = tmp_path / "turned.urdf"
    urdf.write_text(f'<robot name="turned">{links}{joints}</robot>')
    robot = fb.load_urdf(urdf, feet=["toe"])
    state = robot.random_state(0)
    judge = judges.Mujoco(robot).move_to(state)
    assert judges.relative(state.M, judge.M) < 1e-12
    assert judges.relative(state.h, judge.h) < 1e-12


def test_moving_links_with_an_impossible_inertia_are_named_with_the_joints_to_hold():
    feet = ["l_sole", "r_sole"]
    with raises(SimulationError, "r_hip_1", "icub_reduced", 0) as caught:
        fb.Simulation(fb.load("icub_reduced", feet=feet))
    found = re.search(r"locked=(\[.*?\])", str(caught.value))
    assert found
    fb.Simulation(fb.load("icub_reduced", feet=feet, locked=ast.literal_eval(found[1])))
