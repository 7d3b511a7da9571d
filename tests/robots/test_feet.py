"""Feet found in a URDF, legs that are bent by default, and postures given by names of joints."""

import re
import warnings

import judges
import numpy as np
import pytest
from messages import raises, warns

import floatbase as fb
from floatbase.behaviours import Gait, Walk
from floatbase.errors import InputError, RobotWarning, UnknownNameError
from floatbase.robots import Foot

BALLS = "".join(
    f'<collision><origin xyz="{x} {y} -0.03"/><geometry><sphere radius="0.005"/></geometry>'
    f"</collision>"
    for x in (0.12, -0.05)
    for y in (0.03, -0.03)
)
BOX = (
    '<collision><origin xyz="0.035 0 -0.02"/><geometry><box size="0.17 0.06 0.03"/></geometry>'
    "</collision>"
)
# a tall bracket and a plate with vertices on the rim only
CORNERS = [(x, y, z) for x in (-0.05, 0.12) for y in (-0.03, 0.03) for z in (-0.035, -0.02)]
FACES = [(1, 2, 4), (1, 4, 3), (5, 7, 8), (5, 8, 6), (1, 5, 6), (1, 6, 2), (3, 4, 8), (3, 8, 7)]
MESH = (
    '<collision><geometry><mesh filename="package://feet/meshes/sole.obj"/></geometry></collision>'
)
SOLE = {(0.12, 0.03, -0.035), (0.12, -0.03, -0.035), (-0.05, 0.03, -0.035), (-0.05, -0.03, -0.035)}

AXES = {"yaw": "0 0 1", "roll": "1 0 0", "pitch": "0 1 0", "knee": "0 1 0", "ankle": "0 1 0"}


def biped(foot: str, knee: str = 'lower="-0.1" upper="2"', kind: str = "revolute") -> str:
    """A biped with legs of 0.8 m, whose ankles have two joints."""
    inertial = (
        '<inertial><mass value="{0}"/>'
        '<inertia ixx="{1}" iyy="{1}" izz="{1}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    text = f'<robot name="biped"><link name="pelvis">{inertial.format(20, 0.8)}</link>'
    for side, y in (("L", 0.1), ("R", -0.1)):
        parent = "pelvis"
        for name, axis in {**AXES, "foot": "1 0 0"}.items():
            z = {"yaw": -0.1, "knee": -0.4, "ankle": -0.4}.get(name, 0.0)
            place = f"0 {y if name == 'yaw' else 0} {z}"
            limits = knee if name == "knee" else 'lower="-1.5" upper="1.5"'
            shapes = foot if name == "foot" else ""
            joint = kind if name == "knee" else "revolute"
            text += (
                f'<link name="{side}_{name}">{inertial.format(1, 0.01)}{shapes}</link>'
                f'<joint name="{side}_{name}_joint" type="{joint}">'
                f'<parent link="{parent}"/><child link="{side}_{name}"/><origin xyz="{place}"/>'
                f'<axis xyz="{axis}"/><limit {limits} effort="200" velocity="20"/></joint>'
            )
            parent = f"{side}_{name}"
    return text + "</robot>"


def package(folder, name="sole.obj", unit=1.0):
    """Write a ROS package with the mesh of a sole, and return its folder for URDFs."""
    (folder / "meshes").mkdir()
    lines = [f"v {x / unit} {y / unit} {z / unit}" for x, y, z in CORNERS]
    lines += [f"f {a} {b} {c}" for a, b, c in FACES]
    (folder / "meshes" / name).write_text("\n".join(lines), encoding="utf-8")
    (folder / "urdf").mkdir()
    return folder / "urdf"


@pytest.mark.parametrize("foot", [BALLS, BOX, MESH], ids=["balls", "box", "mesh"])
@pytest.mark.parametrize("feet", [None, ["L_foot", "R_foot"]])
def test_soles_are_found_in_the_collision_shapes(foot, feet, tmp_path):
    file = package(tmp_path) / "biped.urdf"
    file.write_text(biped(foot), encoding="utf-8")
    with warnings.catch_warnings(action="error"):
        robot = fb.load_urdf(file, feet=feet)
    assert [foot.frame for foot in robot.feet] == ["L_foot", "R_foot"]
    for sole in robot.feet:
        assert set(map(tuple, sole.corners.round(9).tolist())) == SOLE


@pytest.mark.parametrize("size", ["0.001 0.001 0.001", "0 0 0"])
def test_a_marker_at_a_sole_does_not_hide_the_sole(size):
    markers = "".join(
        f'<link name="{side}_marker"><collision><geometry><box size="{size}"/></geometry>'
        f'</collision></link><joint name="{side}_at" type="fixed"><parent link="{side}_foot"/>'
        f'<child link="{side}_marker"/><origin xyz="0 0 -0.035"/></joint>'
        for side in "LR"
    )
    robot = fb.load_urdf(biped(BOX).replace("</robot>", markers + "</robot>"))
    for foot in robot.feet:
        corners = {tuple(corner) for corner in foot.corners[:, :2].round(3)}
        assert corners == {(x, y) for x, y, _ in SOLE}


@pytest.mark.parametrize("kind", ["revolute", "continuous"])
def test_a_quadruped_bends_its_legs_far_enough_to_walk(kind):
    solo12 = fb.load("solo12")
    urdf = solo12.urdf.replace('"revolute"', f'"{kind}"')
    robot = fb.load_urdf(urdf, package_dirs=solo12.package_dirs)
    walk = Walk(robot, fb.Contacts.feet(robot), Gait.trot(robot), (0.2, 0.0))
    walk(robot.standing().q, np.zeros(robot.nv), 0.0)
    assert walk.speed_fraction == 1.0


@pytest.mark.parametrize("robot", ["hyq", "anymal_kinova", "g1"], indirect=True)
def test_feet_of_the_catalogue_are_found_in_their_urdfs(robot):
    found = fb.load_urdf(robot.urdf, package_dirs=robot.package_dirs)
    known = {foot.frame: foot for foot in robot.feet}
    assert {foot.frame for foot in found.feet} == set(known)
    for foot in found.feet:
        assert foot.radius == pytest.approx(known[foot.frame].radius)
        assert np.allclose(foot.points, known[foot.frame].points, rtol=0.0, atol=1e-6)


def test_a_humanoid_stands_three_lines_after_its_file():
    robot = fb.load_urdf(biped(BALLS))
    controller = fb.WholeBodyController(
        robot, fb.Contacts.feet(robot, mu=0.7), fb.standing_tasks(robot.standing())
    )
    run = fb.rollout(fb.Simulation(robot), controller, 0.5)
    assert run.outcome == "completed"
    assert abs(run.state(-1).q[2] - robot.standing().q[2]) < 0.01  # m


@pytest.mark.parametrize(
    ("knee", "kind", "sign"),
    [
        ('lower="-0.1" upper="2"', "revolute", 1.0),
        ('lower="-2" upper="0"', "revolute", -1.0),
        ('lower="0.3" upper="2"', "revolute", 1.0),
        ('lower="-2" upper="2"', "revolute", 0.0),
        ("", "continuous", 0.0),
    ],
)
def test_straight_legs_are_bent_as_far_as_their_limits_allow(knee, kind, sign):
    with warnings.catch_warnings(action="error"):
        robot = fb.load_urdf(biped(BALLS, knee, kind))
    start = fb.State(robot, robot.posture)
    thigh, shank, sole = (start.frame_pose(f"L_{link}") for link in ("pitch", "knee", "foot"))
    angle = np.arctan2(*(thigh.rotation.T @ shank.rotation)[[0, 0], [2, 0]])
    assert abs(angle) > 0.2 and (sign == 0.0 or np.sign(angle) == sign)
    assert np.allclose(sole.rotation[:, 2], [0.0, 0.0, 1.0], atol=1e-3)
    assert np.allclose(sole.translation[:2], thigh.translation[:2], atol=2e-3)  # below the hip
    right = start.frame_pose("R_foot").translation
    assert np.allclose(sole.translation * [1, -1, 1], right, atol=1e-3)


def test_legs_that_cannot_bend_are_reported():
    with warns(RobotWarning, "posture", "L_foot"):
        fb.load_urdf(biped(BALLS, 'lower="0" upper="0.01"'))


def test_a_biped_on_points_is_reported():
    with warns(RobotWarning, "L_foot", "corners", "R_foot"):
        fb.load_urdf(biped(""))
    with warns(RobotWarning, "L_foot", "corners", "R_foot"):
        fb.load_urdf(biped(BALLS), feet=["L_foot", "R_foot"], foot_radius=0.02)
    with warns(RobotWarning, "L_foot", "R_foot"):  # a box without a size marks a place
        fb.load_urdf(biped('<collision><geometry><box size="0 0 0"/></geometry></collision>'))
    with warnings.catch_warnings():
        warnings.simplefilter("error", RobotWarning)  # the user's own points are no mistake
        fb.load_urdf(biped(BALLS), feet=[Foot(f"{s}_foot", 0.02, [0.1, 0, -0.2]) for s in "LR"])


@pytest.mark.parametrize("kind", ["continuous", "revolute"])  # here revolute joints have no limits
@pytest.mark.parametrize("shape", ['cylinder radius="0.08" length="0.03"', 'sphere radius="0.08"'])
def test_a_wheel_has_its_radius_and_its_axle_and_a_driven_ball_stays_a_ball(kind, shape):
    urdf = biped(
        f'<collision><origin xyz="0 0.02 0" rpy="1.5707963267948966 0 0"/><geometry><{shape}/>'
        f"</geometry></collision>"
    )
    urdf = re.sub('(_foot_joint" type=)"revolute"', rf'\1"{kind}"', urdf).replace(
        '<axis xyz="1 0 0"/><limit lower="-1.5" upper="1.5"', '<axis xyz="0 1 0"/><limit'
    )
    with warns(RobotWarning, "L_foot"):
        robot = fb.load_urdf(urdf)
    for foot in robot.feet:
        assert foot.radius == pytest.approx(0.08, abs=1e-5)
        assert np.allclose(foot.centre, [0.0, 0.02, 0.0], atol=1e-5)
        assert str(foot.axis) == ("[0. 1. 0.]" if shape.startswith("cylinder") else "None")


def test_arms_and_robots_without_limbs_have_no_feet_and_feet_can_be_declined():
    assert fb.load_urdf(fb.load("ur5").urdf).feet == ()
    assert fb.load("iris").feet == ()
    assert fb.load_urdf(biped(BALLS), feet=[]).feet == ()
    assert fb.load_urdf(biped(BALLS), floating=False).feet == ()


def test_a_posture_may_be_given_by_joint_names():
    wheeled = biped(BALLS, "", "continuous")
    robot = fb.load_urdf(
        wheeled, posture={"*_pitch_joint": -0.3, "*_knee_joint": 0.6, "R_pitch_joint": -0.2}
    )
    by_name = {
        name: robot.posture[i:][:n].tolist()
        for name, i, n in zip(
            list(robot.model.names)[2:], robot.model.idx_qs[2:], robot.model.nqs[2:], strict=True
        )
    }
    assert by_name["L_pitch_joint"] == [-0.3] and by_name["R_pitch_joint"] == [-0.2]
    assert by_name["R_knee_joint"] == pytest.approx([np.cos(0.6), np.sin(0.6)])
    assert by_name["L_ankle_joint"] == [0.0]
    go2, other = judges.load("go2"), fb.load("go2", posture={"FL_calf_joint": -1.0})
    assert np.count_nonzero(other.posture != go2.posture) == 1
    with raises(UnknownNameError, "*_calf", *go2.joint_names):
        fb.load("go2", posture={"*_calf": -1.0})
    with raises(InputError, "FL_calf_joint", "straight"):
        fb.load("go2", posture={"FL_calf_joint": "straight"})
    with raises(InputError, "FL_calf_joint", 9, -0.83776):
        fb.load("go2", posture={"FL_calf_joint": 9.0})


def test_a_ball_far_from_the_origin_of_its_link_has_a_frame_of_its_own_which_swings_move():
    ball = BALLS.split("</collision>")[0] + "</collision>"
    ball = ball.replace("0.12 0.03 -0.03", "0.1 0 -0.2").replace("0.005", "0.02")
    robot = fb.load_urdf(biped(ball), posture={"*knee*": 0.5})
    named = fb.load_urdf(
        biped(ball), posture={"*knee*": 0.5}, feet=["L_foot", Foot("R_foot", 0.02, [0.1, 0, -0.2])]
    )
    assert [foot.frame for foot in robot.feet] == ["L_foot foot", "R_foot foot"]
    assert [foot.frame for foot in named.feet] == [foot.frame for foot in robot.feet]
    state = robot.standing()
    for foot in robot.feet:
        link = state.frame_pose(foot.frame.removesuffix(" foot"))
        assert np.allclose(state.point(foot.frame), link.act(np.array([0.1, 0.0, -0.2])))
        assert state.point(foot.frame)[2] == pytest.approx(0.02)
