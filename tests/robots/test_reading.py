"""What other programs read from a URDF: each file means one robot, or is refused by name."""

from dataclasses import replace

import judges
import numpy as np
import pytest
from messages import raises, refused, warns

import floatbase as fb
from floatbase.errors import InputError, RobotWarning, SimulationError

INERTIA = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
LIMIT = '<limit lower="-1" upper="1" effort="9" velocity="9"/>'


def link(name, mass="1"):
    return f'<link name="{name}"><inertial><mass value="{mass}"/>{INERTIA}</inertial></link>'


def joint(name, parent, child, kind="revolute", inside=f'<axis xyz="0 1 0"/>{LIMIT}', xyz="0 0 -1"):
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>'


BODY = link("trunk") + link("shank") + link("foot") + joint("hip", "trunk", "shank")
PLAIN = f'<robot name="one">{BODY}{joint("knee", "shank", "foot")}</robot>'


def added(*parts):
    return PLAIN.replace("</robot>", "".join(parts) + "</robot>")


def same_robot(urdf, **options):
    """Load a URDF, and check that it is the plain robot for Pinocchio and for MuJoCo."""
    robot, plain = fb.load_urdf(urdf, **options), fb.load_urdf(PLAIN)
    state = robot.random_state(0)
    known = fb.State(plain, state.q, state.v)
    judge = judges.Mujoco(robot).move_to(state)
    for M, h in ((known.M, known.h), (judge.M, judge.h)):
        assert judges.relative(state.M, M) < 1e-12
        assert judges.relative(state.h, h) < 1e-12
    assert robot.base == "trunk" and robot.mass == pytest.approx(3.0)
    return robot


@pytest.mark.parametrize(
    "urdf",
    [
        PLAIN.replace('value="1"', 'value="1 "'),
        PLAIN.replace('ixx="0.1"', 'ixx="\t0.1\u00a0"'),
        PLAIN.replace("0 0 -1", "0\t0\n  -1.0 "),
        PLAIN.replace("<robot", '<robot xmlns="http://ros.org"'),
        PLAIN.replace("<robot", '<robot xmlns:xacro="http://ros.org"'),
        added('<drake:joint acceleration:x="2"/><!-- <robot n:a -->'),
        PLAIN.replace('lower="-1" upper="1"', 'lower="-inf" upper="+Infinity"'),
        PLAIN.replace('effort="9"', 'effort="inf"'),
        PLAIN.replace(LIMIT, LIMIT + '<safety_controller k_velocity="x"/>'),
        PLAIN.replace("</link>", "<visual><geometry><mesh/></geometry></visual></link>"),
        added('<link name="odom"/>', joint("free", "odom", "trunk", "floating", "")),
        added('<link name="World"/>', joint("stand", "World", "trunk", "fixed", "")),
        added('<link name="footprint"/>', joint("stand", "footprint", "trunk", "fixed", "")),
        added('<link name="a"/><link name="world"/>', joint("stand", "world", "a", "fixed", ""),
            joint("free", "a", "trunk", "floating", "", "1 0 0")),
    ],
)  # fmt: skip
def test_files_of_one_robot_are_one_robot_to_both_engines(urdf):
    robot = same_robot(urdf)
    assert fb.load_urdf(robot.urdf) == robot  # the checked text is read as it is


def test_the_axis_of_a_joint_without_one_is_x_for_both_engines():
    robot = fb.load_urdf(PLAIN.replace('<axis xyz="0 1 0"/>', "", 1).replace('xyz="0 1 0"', ""))
    state = robot.random_state(0)
    assert judges.relative(state.M, judges.Mujoco(robot).move_to(state).M) < 1e-12
    assert np.allclose(
        state.frame_jacobian("shank")[3:, 6], state.frame_pose("trunk").rotation[:, 0]
    )


@pytest.mark.parametrize(
    ("extension", "named"),
    [
        ('<option gravity="0 0 -1.6"/>', ("gravity", -1.6)),
        ('<compiler settotalmass="20"/>', ("settotalmass", 20)),
        ('<compiler inertiafromgeom="true"/><size memory="1"/>', ("inertiafromgeom", "memory")),
    ],
)
def test_settings_for_mujoco_are_ignored_and_named(extension, named):
    with warns(RobotWarning, *named):
        same_robot(added(f"<mujoco>{extension}</mujoco>"))


def test_a_tilted_stand_gives_the_orientation_and_the_base_its_place():
    stand = joint("stand", "world", "trunk", "fixed", "").replace("<origin", '<origin rpy="0 1 0"')
    state = fb.load_urdf(added('<link name="world"/>', stand)).standing()
    assert np.allclose(state.point("trunk"), state.point("base"))
    assert state.frame_pose("trunk").rotation[0, 2] == pytest.approx(np.sin(1.0))


@pytest.mark.parametrize("joint_name", ["foot", "shank", "trunk"])
def test_a_name_of_a_link_and_a_joint_is_that_of_the_link(joint_name):
    robot = fb.load_urdf(PLAIN.replace('"hip"', f'"{joint_name}"'))
    plain = fb.load_urdf(PLAIN)
    q = robot.random_state(0).q
    for name in ("trunk", "shank", "foot"):
        assert np.allclose(fb.State(robot, q).point(name), fb.State(plain, q).point(name))


@pytest.mark.parametrize(
    ("urdf", "named"),
    [
        (PLAIN.replace('value="1"', 'value="1_0"', 1), ("mass", "trunk", "1_0")),
        (PLAIN.replace('value="1"', 'value="0x1"', 1), ("mass", "trunk", "0x1")),
        (PLAIN.replace('ixy="0"', "", 1), ("inertia", "trunk", "ixy")),
        (PLAIN.replace(INERTIA, "", 1), ("inertia", "trunk")),
        (PLAIN.replace(INERTIA, 2 * INERTIA, 1), ("inertia", "trunk")),
        (PLAIN.replace("0 0 -1", "0,5 0 -1", 1), ("origin", "hip", "0,5", "point")),
        (PLAIN.replace("0 0 -1", "0 -1", 1), ("origin", "hip", 3)),
        (PLAIN.replace("0 0 -1", "0 0 1e999", 1), ("origin", "hip", "1e999")),
        (PLAIN.replace('effort="9" ', "", 1), ("limit", "hip", "effort")),
        (PLAIN.replace('upper="1"', 'upper="inf"', 1), ("hip", "upper", np.inf)),
        (PLAIN.replace('"revolute"', '"Revolute"', 1), ("hip", "Revolute", "revolute")),
        (PLAIN.replace("<origin", '<origin quat_xyzw="0 0 0 1"', 1), ("hip", "quat_xyzw", "rpy")),
        (PLAIN.replace('<child link="foot"/>', '<child link="toe"/>'), ("knee", "toe")),
        (PLAIN.replace('<child link="foot"/>', ""), ("knee", "child")),
        (added(link("lost")), (2, "trunk", "lost")),
        (added("<link/>"), ("links", "name")),
        (added(joint("rod", "trunk", "foot")), ("foot", "knee", "rod")),
        (added(joint("rod", "foot", "trunk")), ("loop", "trunk", "foot")),
        (added(link("a"), joint("self", "a", "a")), ("loop", "a")),
        (added('<xacro:if value="1"/>'), ("xacro",)),
        (added('<x:if xmlns:x="http://ros.org/wiki/xacro"/>'), ("xacro",)),
        (PLAIN.replace('value="1"', 'value="${m}"', 1), ("mass", "trunk", "xacro")),
        ("<robot/>", ("link",)),
        ("<mujoco/>", ("MJCF", "mujoco")),
        ("<sdf/>", ("SDF", "URDF")),
        ("version https://git-lfs", ("URDF",)),
    ],
)  # fmt: skip
def test_a_file_that_means_no_robot_is_refused_by_name(urdf, named, capfd):
    refused(lambda: fb.load_urdf(urdf), InputError, *named)
    assert not capfd.readouterr().err  # no other program had to explain it


def test_torque_limits_above_those_of_the_file_act_in_the_simulation():
    weak = PLAIN.replace('effort="9"', 'effort="0.5"')
    for limits in (20.0, [20.0, 3.0], np.inf):
        robot = fb.load_urdf(weak, torque_limits=limits)
        sim = fb.Simulation(robot)
        sim.step([20.0, 20.0])
        applied = np.minimum(20.0, robot.torque_limits)
        assert np.allclose(sim.torques(), applied)
        forces = sim.data.qfrc_actuator[
            [int(sim.model.joint(j).dofadr[0]) for j in ("hip", "knee")]
        ]
        assert np.allclose(forces, applied)


def test_damping_and_friction_of_the_file_act_if_they_are_asked_for():
    lossy = PLAIN.replace(LIMIT, LIMIT + '<dynamics damping="0.4" friction="0.2"/>')
    robot = fb.load_urdf(lossy, floating=False, posture=[0.0, 0.0])
    state = robot.standing().replace(v=[0.5, -0.5])
    sims = fb.Simulation(robot), fb.Simulation(robot, joint_losses=True)
    for sim in sims:
        sim.reset(state)
        sim.step([0.0, 0.0])
    # M Δv / Δt: the torque of damping and dry friction, up to what the first step changes
    torque = state.M @ (sims[1].state.v - sims[0].state.v) / sims[0].timestep
    assert torque == pytest.approx([-0.4, 0.4], abs=0.02)


def test_engines_that_differ_are_reported_with_the_links():
    robot = fb.load_urdf(PLAIN)
    for change, named in (
        (lambda model: setattr(model.inertias[2], "mass", 1.001), ("mass", "shank")),
        (lambda model: setattr(model.jointPlacements[3], "translation", np.ones(3)), ("M", "foot")),
        (lambda model: setattr(model.gravity, "linear", np.array([0, 0, -1.6])), ("gravity",)),
        (lambda model: setattr(model, "armature", np.r_[np.zeros(6), 1e-3, 2e-3]), ()),
    ):
        model = robot.model.copy()
        change(model)
        changed = replace(robot, model=model)
        if named:
            refused(lambda robot=changed: fb.Simulation(robot), SimulationError, *named)
        else:  # rotor inertia comes from Pinocchio's model
            fb.Simulation(changed)


def test_joints_without_effort_among_others_are_named():
    with warns(RobotWarning, "knee", "effort", "locked"):
        fb.load_urdf(PLAIN[::-1].replace('"9"=troffe', '"0"=troffe', 1)[::-1])


@pytest.mark.parametrize("encoding", ["utf-16", "iso-8859-1", "utf-8-sig"])
def test_a_file_is_read_in_its_encoding(tmp_path, encoding):
    path = tmp_path / "one.urdf"
    declaration = f'<?xml version="1.0" encoding="{encoding}"?>' if encoding[0] == "i" else ""
    path.write_bytes((declaration + PLAIN.replace("foot", "Fuß")).encode(encoding))
    assert "Fuß" in fb.load(path).frames


@pytest.mark.parametrize(
    ("old", "new", "label"),
    [
        ('effort="9"', 'effort="-1"', "hip"),
        ('velocity="9"', 'velocity="-1"', "hip"),
        ("0 0 -1", "0 0 1e308", "hip"),
        ('xyz="0 1 0"', 'xyz="0 1e-320 0"', "hip"),
    ],
)
def test_numbers_that_no_robot_has_are_refused(old, new, label):
    with raises(InputError, label):
        fb.load_urdf(PLAIN.replace(old, new, 1))


def test_an_effort_beyond_all_numbers_means_no_limit():
    robot = fb.load_urdf(PLAIN.replace('effort="9"', 'effort="1.79769e+308"'))
    assert np.isinf(robot.torque_limits).all()


def test_a_chain_of_thousands_of_links_is_refused():
    links = [link(f"l{i}") for i in range(5001)]
    joints = [joint(f"j{i}", f"l{i}", f"l{i + 1}", "fixed", "") for i in range(5000)]
    with raises(InputError, "5001"):
        fb.load_urdf(f'<robot name="chain">{"".join(links + joints)}</robot>')


def test_limits_in_degrees_are_reported():
    with warns(RobotWarning, "robot", "radians"):
        fb.load_urdf(PLAIN.replace('lower="-1" upper="1"', 'lower="-90" upper="90"'))


@pytest.mark.parametrize(
    ("ending", "text", "shown"),
    [("urdf", "version https://git-lfs.github.com", "git-lfs"), ("xml", "<mujoco><a", "MJCF")],
)
def test_a_broken_file_is_described_by_what_it_is(tmp_path, ending, text, shown):
    path = tmp_path / f"one.{ending}"
    path.write_text(text)
    with raises(InputError, shown):
        fb.load(path)
