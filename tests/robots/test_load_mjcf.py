"""MJCF files: the robot is the one that MuJoCo compiles, stands, and has the limits and keyframes
of its file; what cannot be read is named.
"""

import warnings
from functools import partial

import judges
import mujoco
import numpy as np
import pytest
from messages import refused, warns

import floatbase as fb
from floatbase.errors import InputError, RobotWarning, UnknownNameError
from floatbase.robots import with_floating_base
from floatbase.viewer.scene.meshes import robot_meshes

LEG = """
<body name="{name}_thigh" pos="{x} {y} 0">
  <joint name="{name}_roll" axis="1 0 0" pos="0 0 0.02" range="-60 60"/>
  <joint name="{name}_pitch" axis="0 1 0" pos="0.01 0 0" ref="10"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.5"/>
  <body name="{name}_shank" pos="0 0 -0.2" euler="0 90 0">
    <joint name="{name}_knee" axis="0 1 0" range="-150 -5" armature="0.02" actuatorfrcrange="-9 9"/>
    <geom type="box" pos="0.1 0 0" size="0.1 0.01 0.01" mass="0.2" euler="20 0 0"/>
    <geom name="{name}" pos="0.2 0 0" size="0.02" mass="0.05"/>
  </body>
</body>"""
FEET = {"FL": (0.2, 0.1), "FR": (0.2, -0.1), "RL": (-0.2, 0.1), "RR": (-0.2, -0.1)}
LEGS = "".join(LEG.format(name=name, x=x, y=y) for name, (x, y) in FEET.items())
MOTORS = "".join(
    f"""<motor joint="{name}_roll" gear="20" ctrlrange="-2 2"/>
    <position joint="{name}_pitch" kp="50" gear="2" forcerange="-15 15" armature="0.003"/>
    <motor joint="{name}_knee" ctrlrange="-30 30" ctrllimited="true"/>"""
    for name in FEET
)
HOME = 4 * "0.1 0.8 -1.5 "
QUADRUPED = f"""
<mujoco><compiler angle="degree"/>
<default><joint armature="0.01" damping="0.5" frictionloss="0.1"/></default>
<worldbody>
  <geom type="plane" size="1 1 1"/>
  <body name="trunk" pos="0 0 0.4"><freejoint/>
    <geom type="box" size="0.25 0.1 0.05" mass="6" pos="0.01 0.02 0"/>
    <body name="head" pos="0.3 0 0.1" euler="0 30 45"><geom type="ellipsoid" size="0.1 0.05 0.07"/>
      <site name="camera" pos="0.1 0 0"/></body>
    {LEGS}
  </body>
</worldbody>
<actuator>{MOTORS}</actuator>
<keyframe>
  <key name="home" qpos="0 0 0.3 0.6 0 0 0.8 {HOME}"/>
  <key name="low" qpos="0 0 0.2 1 0 0 0 {HOME.replace("0.8", "1.2").replace("1.5", "2.2")}"/>
</keyframe></mujoco>"""
ANGLES = {"roll": 0.1, "pitch": 0.8, "knee": -1.5}


@pytest.fixture
def load(tmp_path):
    """`load_mjcf` with the text of a file."""

    def load_text(mjcf, **options):
        (tmp_path / "robot.xml").write_text(mjcf)
        return fb.load_mjcf(tmp_path / "robot.xml", **options)

    return load_text


@pytest.fixture
def quadruped(load):
    return partial(load, QUADRUPED, feet=list(FEET), foot_radius=0.02)


def pendulum(joint='<joint name="swing" axis="0 1 0"/>', rest=""):
    """An arm of one joint; `rest` comes after the bodies."""
    return f"""<mujoco><worldbody><body name="link">{joint}<geom size="0.1" pos="0 0 -0.5"/></body>
    </worldbody>{rest}</mujoco>"""


def mesh_points(model):
    """The vertices of the last geom, the only mesh of a model, in the world."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model.mesh_vert @ data.geom_xmat[-1].reshape(3, 3).T + data.geom_xpos[-1]


def test_m_and_h_are_those_of_mujoco_in_its_file_and_in_the_simulation(quadruped):
    robot = quadruped()
    original = mujoco.MjModel.from_xml_string(QUADRUPED)
    for model in (original, None):
        judge = judges.Mujoco(robot, model)
        for seed in range(3):
            state = robot.random_state(seed)
            judge.move_to(state)
            assert judges.relative(state.M, judge.M) < 1e-12
            assert judges.relative(state.h, judge.h) < 1e-12
    judge = judges.Mujoco(robot, original).move_to(state)
    camera = state.point("camera")
    assert np.allclose(camera, judge.data.site("camera").xpos, atol=1e-12)
    assert np.allclose(state.point("RL"), judge.data.geom("RL").xpos, atol=1e-12)


def test_limits_and_rotor_inertias_are_those_of_the_file(quadruped):
    robot = quadruped()
    limits = dict(zip(robot.joint_names, robot.torque_limits, strict=True))
    armature = dict(zip(robot.joint_names, robot.model.armature[6:], strict=True))
    assert {name: limits[f"FL_{name}"] for name in ANGLES} == {"roll": 40, "pitch": 30, "knee": 9}
    assert [armature[f"RR_{name}"] for name in ANGLES] == pytest.approx([0.01, 0.022, 0.02])
    knee = robot.model.idx_qs[robot.model.getJointId("FL_knee")]
    assert robot.model.upperPositionLimit[knee] == pytest.approx(np.radians(-5.0))
    assert set(quadruped(torque_limits=5.0).torque_limits) == {5.0}


def test_motors_add_damping_to_their_joints_and_integrators_have_other_limits(load):
    robot = load(
        pendulum(
            '<joint name="swing" damping="0.5"/>',
            """<actuator><motor joint="swing" gear="3" damping="0.1" ctrlrange="-1 1"/>
            <general joint="swing" dyntype="integrator" ctrlrange="-1 1"/></actuator>""",
        )
    )
    assert robot.model.damping == pytest.approx([0.5 + 3**2 * 0.1])
    assert robot.torque_limits == [np.inf]  # the control of an integrator is the rate of its force


def test_keyframes_are_postures(quadruped):
    for robot, knee in ((quadruped(), -1.5), (quadruped(posture="low"), -2.2)):
        q = robot.model.idx_qs[robot.model.getJointId("RR_knee")]
        assert robot.posture[q] == pytest.approx(knee)
    turned = quadruped(posture="home").standing()
    heading = turned.point("head") - turned.point("trunk")
    assert np.arctan2(heading[1], heading[0]) == pytest.approx(2.0 * np.arctan2(0.8, 0.6))
    refused(lambda: quadruped(posture="hoem"), UnknownNameError, "hoem", "home")
    assert quadruped(posture=quadruped().posture) == quadruped()


@pytest.mark.parametrize(
    ("knee", "quaternion", "named"),
    [(-1.5, "0 1 0 0", "w, x, y, z"), (0.0, "1 0 0 0", "legs"), (-1.5, "1 0 0 0", None)],
)
def test_a_keyframe_upside_down_or_with_straight_legs_is_reported(load, knee, quaternion, named):
    home = HOME.replace("-1.5", str(knee)).replace("0.1 0.8", "0 0.4")
    text = QUADRUPED.replace("0.6 0 0 0.8", quaternion).replace(HOME, home)
    with warnings.catch_warnings(record=True, action="always") as caught:
        load(text.replace("-150 -5", "-150 0"))
    found = [str(each.message) for each in caught]
    assert len(found) == (named is not None) and all(named in message for message in found)


def test_a_quadruped_stands_on_its_named_geoms_and_takes_a_push(quadruped):
    robot = quadruped()
    state, contacts = robot.standing(), fb.Contacts.feet(robot)
    controller = fb.WholeBodyController(robot, contacts, fb.standing_tasks(state))
    push = fb.Push([30.0, 0.0, 0.0], start=0.2, duration=0.1)
    run = fb.rollout(fb.Simulation(robot), controller, 1.0, pushes=[push])
    assert run.outcome == "completed"
    assert np.linalg.norm(run.final.com - state.com) < 0.01


def test_shapes_of_the_file_are_drawn_and_can_lie_on_the_ground(tmp_path):
    (tmp_path / "parts").mkdir()
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
    faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    (tmp_path / "parts" / "wedge.obj").write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in corners)
        + "".join(f"f {i + 1} {j + 1} {k + 1}\n" for i, j, k in faces)
    )
    (tmp_path / "wedge.xml").write_text("""
      <mujoco><compiler meshdir="parts"/>
      <asset><mesh file="wedge.obj" scale="0.1 0.1 -0.1"/></asset>
      <worldbody><body name="stone"><freejoint/>
        <geom type="mesh" mesh="wedge" pos="0.3 0 0" quat="0 1 0 0"/></body>
      </worldbody></mujoco>""")
    stone = fb.load_mjcf(tmp_path / "wedge.xml")
    expected = mesh_points(mujoco.MjModel.from_xml_path(str(tmp_path / "wedge.xml")))
    (drawn,) = robot_meshes(stone)
    for points in (drawn.vertices, mesh_points(fb.Simulation(stone).model)):
        assert np.allclose(points.min(axis=0), expected.min(axis=0), atol=1e-6)
        assert np.allclose(points.max(axis=0), expected.max(axis=0), atol=1e-6)
    (tmp_path / "parts" / "wedge.obj").unlink()
    path = tmp_path / "wedge.xml"
    path.write_text(path.read_text().replace("</body>", "<geom size='0.1'/></body>"))
    refused(lambda: fb.load_mjcf(path), InputError, "stone", "wedge")
    path.write_text(path.read_text().replace('type="mesh"', 'type="mesh" mass="0"'))
    with warns(RobotWarning, "wedge"):
        assert fb.load_mjcf(path).mass > 0.0


def test_meshes_of_an_attached_file_are_beside_that_file(tmp_path):
    (tmp_path / "arm").mkdir()
    corners = "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\n"
    (tmp_path / "arm" / "wedge.obj").write_text(corners + "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    joint = '<joint name="swing"/><geom type="mesh" mesh="wedge"/>'
    part = f'<mujoco><asset><mesh file="wedge.obj"/></asset>{pendulum(joint)[8:]}'
    (tmp_path / "arm" / "arm.xml").write_text(part)
    (tmp_path / "robot.xml").write_text("""
      <mujoco><asset><model name="arm" file="arm/arm.xml"/></asset><worldbody>
      <body name="trunk"><freejoint/><geom size="0.2"/>
      <frame euler="30 0 0"><attach model="arm" body="link" prefix="left_"/></frame>
      </body></worldbody></mujoco>""")
    robot = fb.load_mjcf(tmp_path / "robot.xml")
    judge = judges.Mujoco(robot, mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml")))
    state = robot.random_state(1)
    assert judges.relative(state.M, judge.move_to(state).M) < 1e-12
    assert np.ptp(robot_meshes(robot)[-1].vertices, axis=0).max() > 2.5


def test_parts_without_a_name_get_one_that_no_other_part_has(load):
    """MuJoCo's first body has the number 1, and its first joint the number 0."""
    mjcf = """<mujoco><worldbody><body><joint/><geom size="0.1"/><body name="body_1" pos="1 0 0">
      <joint name="joint_0"/><geom size="0.1"/></body></body></worldbody></mujoco>"""
    robot = load(mjcf)
    assert robot.joint_names[1] == "joint_0" and len(set(robot.joint_names)) == 2
    assert robot.standing().point("body_1").tolist() == [1.0, 0.0, 0.0]


@pytest.mark.parametrize(("joint", "floating"), [("<freejoint/>", False), ("", True)])
def test_a_base_that_is_set_free_or_welded_keeps_its_place(load, joint, floating):
    mjcf = f"""<mujoco><worldbody><body name="trunk" pos="0 0 2" euler="90 0 0">{joint}
      <geom size="0.1"/><body name="link" pos="0 1 0"><joint/><geom size="0.1"/></body>
      </body></worldbody></mujoco>"""
    robot = load(mjcf, floating=floating, feet=())
    assert robot.is_floating == floating
    assert np.allclose(robot.standing().point("link"), [0.0, 0.0, 3.0])


def test_the_robot_is_the_free_body_with_joints_or_what_is_attached_to_the_world(load, quadruped):
    ball = "<body name='ball'><freejoint/><geom size='0.1'/></body></worldbody>"
    with warns(RobotWarning, "ball"):
        assert load(QUADRUPED.replace("</worldbody>", ball)).base == "trunk"
    with warns(RobotWarning, "ball"):
        arm = load(pendulum().replace("</worldbody>", ball))
    assert not arm.is_floating and arm.joint_names == ("swing",)
    free = load(pendulum(), floating=True)
    assert free.is_floating and (free.d, free.base) == (0, "link")
    assert quadruped(floating=False).nv == 12
    twice = pendulum().replace("</worldbody>", "<body name='two'><joint/><geom size='1'/></body>")
    twice = twice.replace("</mujoco>", "</worldbody></mujoco>")
    refused(lambda: load(twice, floating=True), InputError, "link", "two")


@pytest.mark.parametrize(
    ("mjcf", "named"),
    [
        (pendulum(rest='<option gravity="0 0 -1.6"/>'), -1.6),
        (pendulum(rest='<option><flag gravity="disable"/></option>'), 9.81),
        (pendulum('<joint name="swing" stiffness="3"/>'), "swing"),
        (pendulum('<joint name="swing" stiffness="0 3"/>'), "swing"),
        (pendulum('<joint name="swing" damping="0 3"/>'), "swing"),
        (pendulum('<joint name="loose" type="free" armature="1"/>'), "loose"),
        (pendulum(rest='<equality><weld name="bolt" body1="link"/></equality>'), "bolt"),
        (
            pendulum(
                rest='<tendon><fixed name="rope"><joint joint="swing" coef="1"/></fixed></tendon>'
            ),
            "rope",
        ),
        (
            pendulum(
                '<joint name="swing"/><joint name="slip" type="slide"/>',
                '<actuator><motor joint="swing"/></actuator>',
            ),
            "slip",
        ),
    ],
)
def test_what_the_robot_does_not_have_is_named(load, mjcf, named):
    with warns(RobotWarning, named):
        load(mjcf)
    with warnings.catch_warnings(action="error", category=RobotWarning):
        load(pendulum())


def test_joints_that_an_equality_couples_are_locked_as_in_mujoco(load):
    """MuJoCo measures a coupling from the initial configuration, which `ref` sets."""
    mjcf = """<mujoco><compiler angle="radian"/><worldbody><body><joint name="a" ref="0.3"/>
      <geom size="0.1"/><body pos="1 0 0"><joint name="b" axis="1 0 0" ref="-0.2"/>
      <geom size="0.1"/><body name="tip" pos="0 1 0"><joint name="c"/><geom size="0.1"/>
      </body></body></body></worldbody>
      <equality><joint joint1="b" joint2="a" polycoef="0.1 -2 {} 0 0"/></equality></mujoco>"""
    with warns(RobotWarning, "a", "b", "locked"):
        robot = load(mjcf.format(0), posture={"a": 0.5})
    model = mujoco.MjModel.from_xml_string(mjcf.format(0))
    data = mujoco.MjData(model)
    data.qpos = [0.5, 0.0, 0.0]
    mujoco.mj_forward(model, data)
    data.qpos[1] -= data.efc_pos[0]
    mujoco.mj_forward(model, data)
    tip = robot.standing().frame_pose("tip")
    assert abs(data.efc_pos[0]) < 1e-12 and robot.joint_names == ("c",)
    assert np.allclose(tip.translation, data.body("tip").xpos)
    assert np.allclose(tip.rotation.ravel(), data.body("tip").xmat)
    with warns(RobotWarning, "equality_0"):  # it is not linear
        assert load(mjcf.format(1)).d == 3


def test_an_arm_keeps_its_rotor_inertias_when_it_is_locked_or_set_free(load):
    arm = f"""<mujoco><worldbody><body name="foot"><geom size="0.1"/>
      {4 * '<body pos="0 0 1"><joint axis="0 1 0" armature="0.3"/><geom size="0.1"/>'}
      {4 * "</body>"}</body></worldbody></mujoco>"""
    fixed = load(arm)
    free = with_floating_base(fixed)
    assert (free.base, free.d) == ("foot", 4)
    assert np.allclose(free.neutral().M[6:, 6:], fixed.neutral().M)
    assert load(arm, locked=["joint_1"]).model.armature.tolist() == [0.3, 0.3, 0.3]


def test_what_cannot_be_read_is_refused(load, tmp_path):
    ball = pendulum('<joint name="swing" type="ball"/>')
    for mjcf, *names in (
        (ball, "swing", "ball"),
        ("<mujoco><worldbody></mujoco>", "robot.xml", "MJCF"),
        (pendulum("<jiont/>"), "jiont"),
        (judges.load("solo12").urdf, "load_urdf"),
    ):
        refused(lambda mjcf=mjcf: load(mjcf), InputError, *names)
    refused(lambda: fb.load_urdf(QUADRUPED), InputError, "load_mjcf")
    refused(lambda: fb.load_mjcf(tmp_path / "nothing.xml"), InputError, "nothing.xml")


def test_the_kind_of_a_file_is_found_in_it(tmp_path):
    (tmp_path / "legs.xml").write_text(QUADRUPED)
    robot = fb.load(str(tmp_path / "legs.xml"), feet=list(FEET), foot_radius=0.02, posture="low")
    assert robot.d == 12 and robot.name == "legs"
    (tmp_path / "solo.xml").write_text(judges.load("solo12").urdf)
    assert fb.load(tmp_path / "solo.xml", feet=["FL_FOOT"], posture=np.zeros(12)).d == 12
