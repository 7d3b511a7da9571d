"""URDFs: user-defined models, joints held still, robots as example-robot-data has them, and what
cannot be used.
"""

import pickle
import re
import warnings
from pathlib import Path

import example_robot_data
import judges
import numpy as np
import pinocchio as pin
import pytest
from messages import raises, refused, warns

import floatbase as fb
from floatbase.errors import InputError, RobotWarning
from floatbase.robots import PLATE_SIZE, with_floating_base

LOADERS = example_robot_data.robots_loader.ROBOTS
USUAL = example_robot_data.utils.RobotLoader.__init__
CHANGED = [name for name, loader in LOADERS.items() if loader.__init__ is not USUAL]
MODELS = sorted((Path(__file__).parents[2] / "assets" / "models").glob("*.urdf"))


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_a_model_of_our_own_is_the_same_to_mujoco(path):
    robot = fb.load_urdf(path)
    assert robot.is_floating
    state = robot.random_state(0)
    judge = judges.Mujoco(robot).move_to(state)
    assert judges.relative(state.M, judge.M) < 1e-9
    assert judges.relative(state.h, judge.h) < 1e-9


def test_a_robot_without_its_bolts_has_the_joints_and_links_it_had_and_may_stand_on_a_plate():
    arm = fb.load("ur5", posture=[0.0, -1.7, 1.2, 0.5, 1.5, 0.0])
    loose, standing = with_floating_base(arm), with_floating_base(arm, plate=True)
    assert loose.joint_names == arm.joint_names and loose.mass == pytest.approx(arm.mass)
    assert np.array_equal(loose.torque_limits, arm.torque_limits)
    for robot, height in ((loose, 1.0), (standing, PLATE_SIZE[1])):
        state = robot.standing()
        assert np.allclose(state.M[6:, 6:], arm.standing().M)
        assert np.allclose(state.h[6:], arm.standing().h)
        assert state.q[2] == pytest.approx(height)
    assert np.allclose(judges.stance(standing).positions(standing.standing())[:, 2], 0.0, atol=1e-9)
    with raises(InputError, "go2"):
        with_floating_base(judges.load("go2"))


@pytest.mark.parametrize(
    "name", judges.sampled([*judges.ROBOTS, *CHANGED], "go2", "ur5", "kinova", CHANGED[0])
)
def test_a_robot_is_the_one_of_example_robot_data_or_is_refused(name):
    """CHANGED are those whose loaders change the model after reading it: they cut links, or turn
    the world under the base.
    """
    loaded = example_robot_data.load(name)
    try:
        ours = fb.load(name, feet=[])
    except InputError as error:
        assert name in CHANGED and name in str(error)
        return
    coupled = [*map(loaded.model.getJointId, {*loaded.model.names} - {*ours.model.names})]
    theirs = pin.buildReducedModel(loaded.model, coupled, loaded.q0)
    state, data = ours.random_state(0), theirs.createData()
    q = np.array(state.q)
    if ours.is_floating:  # where the base is in the world comes from all that lies below it
        q[:7] = pin.SE3ToXYZQUAT(theirs.jointPlacements[1].inverse() * pin.XYZQUATToSE3(q[:7]))
    assert judges.relative(state.M, pin.crba(theirs, data, q)) < 1e-12
    assert judges.relative(state.h, pin.nle(theirs, data, q, np.array(state.v))) < 1e-12


def test_a_person_stands_upright():
    state = fb.load("human", feet=[]).standing()
    head, pelvis = state.point("middle_head"), state.point("middle_pelvis")
    assert head[2] - pelvis[2] > 0.9 * np.linalg.norm(head - pelvis)


@pytest.mark.parametrize(
    ("name", "locked"),
    [
        ("talos", ["torso_1_joint", "arm_left_1_joint", "arm_left_4_joint", "leg_right_4_joint"]),
        ("kinova", ["j2s6s200_joint_1", "j2s6s200_joint_3"]),  # the first turns without limit
        (
            "panda",
            ["panda_finger_joint1", "panda_finger_joint2"],
        ),  # fingers that slide; the second mimics the first
    ],
)
def test_locked_joints_are_still_and_the_others_move_as_in_the_whole_robot(name, locked):
    """M and h are those of the whole robot for the joints that move, to MuJoCo too, which reads the
    changed URDF itself.
    """
    robot, theirs = fb.load(name, locked=locked), example_robot_data.load(name)
    state, whole = robot.random_state(0), theirs.model
    q, v, kept = np.array(theirs.q0), np.zeros(whole.nv), []
    if name == "panda":  # example-robot-data places the first finger only
        q[-1] = q[-2]
    for i, joint in list(enumerate(whole.names))[1:]:
        if joint not in locked:
            own = robot.model.getJointId(joint)
            nq, nv, model = whole.nqs[i], whole.nvs[i], robot.model
            q[whole.idx_qs[i] :][:nq] = state.q[model.idx_qs[own] :][:nq]
            v[whole.idx_vs[i] :][:nv] = state.v[model.idx_vs[own] :][:nv]
            kept += range(whole.idx_vs[i], whole.idx_vs[i] + whole.nvs[i])
    data, judge = whole.createData(), judges.Mujoco(robot).move_to(state)
    assert robot.nv == whole.nv - len(locked) == len(kept) and judge.model.neq == 0
    for M, h in (
        (pin.crba(whole, data, q)[np.ix_(kept, kept)], pin.nle(whole, data, q, v)[kept]),
        (judge.M, judge.h),
    ):
        assert judges.relative(state.M, M) < 1e-9
        assert judges.relative(state.h, h) < 1e-9


def test_a_joint_is_locked_only_where_it_can_be():
    cases = ("continuous", [2.0, 0.0], 2), ("revolute", [10.0], 10, 0.5, 2)
    for kind, posture, *numbers in cases:
        with raises(InputError, "posture", "elbow", *numbers):
            whole = [0.0] * 6 + [1.0, *posture]
            fb.load_urdf(two_links(kind=kind), posture=whole, locked=["elbow"])


def test_a_joint_that_is_called_like_a_link_can_be_locked_and_be_named_twice():
    urdf = two_links(joint="top").replace("<robot", '\n<?xml version="1.0"?>\n<robot', 1)
    assert fb.load_urdf(urdf, locked=["top", "top"]).d == 0


def test_a_robot_is_what_its_file_was_when_it_was_loaded(tmp_path):
    file = tmp_path / "arm.urdf"
    file.write_text(fb.load("ur5").urdf, encoding="utf-8")
    arm = fb.load_urdf(file, floating=False, package_dirs=fb.load("ur5").package_dirs)
    file.write_text("<robot/>")
    state = pickle.loads(pickle.dumps(with_floating_base(arm))).random_state(0)
    assert judges.relative(state.M, judges.Mujoco(state.robot).move_to(state).M) < 1e-9


LIMIT = '<limit effort="5" velocity="9" lower="0.5" upper="2"/>'


LINK = (
    '<link name="{}"><inertial><mass value="{}"/><inertia ixx="1" iyy="{}" izz="1" ixy="0" '
    'ixz="0" iyz="0"/></inertial></link>'
)


def two_links(mass=1.0, iyy=1.0, joint="elbow", kind="revolute", extra=LIMIT):
    """A URDF: a base of 1 kg, and a link that a joint moves."""
    ends = '<parent link="base"/><child link="top"/><axis xyz="0 1 0"/>'
    links = LINK.format("base", 1, 1) + LINK.format("top", mass, iyy)
    return (
        f'<robot name="two">{links}<joint name="{joint}" '
        f'type="{kind}">{ends}{extra}</joint></robot>'
    )


HUNG = """<link name="tip"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="swing" type="prismatic"><parent link="top"/><child link="tip"/>
<limit effort="0" velocity="1"/></joint></robot>"""


def fingers(*joints, kind="revolute"):
    """A URDF: joints j0, j1, … in a row, each with elements of its own; the first has a type."""
    links = "".join(LINK.format(f"l{i}", 1, 1) for i in range(len(joints) + 1))
    rest = "".join(
        f'<joint name="j{i}" type="{"revolute" if i else kind}"><parent link="l{i}"/>'
        f'<child link="l{i + 1}"/><origin xyz="0 0 1"/>{LIMIT.replace("0.5", "-3")}{extra}</joint>'
        for i, extra in enumerate(joints)
    )
    return f'<robot name="fingers">{links}{rest}</robot>'


FOLLOW = '<mimic joint="j0" multiplier="-2" offset="0.3"/>'


@pytest.mark.parametrize(
    ("urdf", "posture", "places"),
    [
        (fingers("", FOLLOW, ""), {"j0": 0.4}, {"j0": 0.4, "j1": -0.5}),
        (fingers("", FOLLOW, ""), [0.4, 1.0, 0.0], {"j0": 0.4, "j1": -0.5}),
        (fingers("", '<mimic joint="j2" multiplier="3"/>', FOLLOW, ""), {"j0": 0.4},
            {"j0": 0.4, "j1": -1.5, "j2": -0.5}),  # it follows a follower
        (fingers("", '<mimic joint="j0"/>', "", kind="continuous"), {"j0": -2.0},
            {"j0": -2.0, "j1": -2.0}),
        (fingers("", FOLLOW, "", kind="fixed"), None, {"j1": 0.3}),
        (fingers("", FOLLOW.replace("j0", "gone"), ""), None, {"j1": 0.3}),
    ],
)  # fmt: skip
def test_coupled_joints_are_locked_where_their_leader_puts_them(urdf, posture, places):
    with warns(RobotWarning, *places):
        robot = fb.load_urdf(urdf, posture=posture, feet=[])
    alone = re.sub("<mimic.*?>", "", urdf)
    assert robot == fb.load_urdf(alone, posture=places, locked=list(places), feet=[])


def test_a_leader_moves_alone_only_if_its_followers_are_locked_by_name():
    with warnings.catch_warnings(action="error", category=RobotWarning):
        robot = fb.load_urdf(fingers("", FOLLOW), posture={"j0": 0.4}, locked=["j1"], feet=[])
    assert robot.joint_names == ("j0",) and robot.posture[7:] == 0.4
    with warns(RobotWarning, "j1"):
        assert fb.load_urdf(fingers("", FOLLOW), locked=["j0"], feet=[]).d == 0


@pytest.mark.parametrize(
    ("urdf", "named"),
    [
        (two_links(mass=-0.5), ("inertial", "top", "mass", -0.5)),
        (two_links(mass="inf"), ("inertial", "top", "mass", np.inf)),
        (two_links(iyy="nan"), ("inertial", "top", "iyy", np.nan)),
        (two_links(iyy=-0.1), ("elbow", "inertia", -0.1)),
        (two_links().replace("0 1 0", "0 0 0"), ("elbow", "axis")),
        (two_links(extra=LIMIT.replace("0.5", "3")), ("elbow", "lower", 3, "upper", 2)),
        (two_links(extra=LIMIT.replace('"2"', '"-2"').replace('lower="0.5"', "")),
            ("elbow", "lower", 0, "upper", -2)),
        (two_links(joint="base").replace('"base"', '"a"', 1).replace('k="base"', 'k="a"'),
            ("joint", "base")),
        (two_links().replace('"base"', '"a"').replace('"top"', '"base"'), ("link", "base")),
        (two_links(joint="root_joint"), ("joint", "root_joint")),
        (fingers("", '<mimic joint="j2"/>', '<mimic joint="j1"/>'), ("j1", "j2", "mimic")),
        (two_links(extra=LIMIT + "<mimic/>"), ("elbow", "mimic", "joint")),
        (two_links(mass=0, iyy=0), ("M", "elbow", "locked")),
        (two_links(extra=""), ("elbow", "limit")),
        (two_links().replace('k name="top"', 'k name="base"'), (2, "base")),
        ("<html/>", ("html", "robot")),
        (two_links().replace('"1"', '"0"', 4), ("M", "elbow", "floating=False")),
        (two_links(kind="planar"), ("elbow", 3)),
        (two_links(kind="floating"), ("elbow", 6)),
        ('<robot name="none"><link name="base"/></robot>', ("mass", 0, "inertial")),
    ],
)  # fmt: skip
def test_a_urdf_that_1_to_7_cannot_hold_is_refused_by_name(urdf, named):
    refused(lambda: fb.load_urdf(urdf), InputError, *named)


def test_a_joint_that_bolts_the_base_may_be_called_base_and_limits_that_are_equal_are_none():
    bolted = two_links(joint="base", kind="fixed").replace('"base"', '"a"', 1)
    bolted = bolted.replace('k="base"', 'k="a"')
    robot = fb.load_urdf(bolted.replace("</robot>", "") + HUNG, floating=False)
    assert robot.base == "a" and robot.model.frames[robot.frame_id("base")].parentJoint == 0
    assert abs(robot.random_state(0, spread=3.0).q[0]) > 0.0


def test_joints_without_a_posture_stand_at_their_nearest_limit_and_weak_motors_are_reported():
    heavy = two_links(mass=20).replace("<mass", '<origin xyz="0.1 0 0"/><mass')
    with warns(RobotWarning, "elbow", 17.2, 5):
        arm = fb.load_urdf(heavy, floating=False)
    assert arm.standing().q == pytest.approx([0.5])
    with raises(InputError, "posture", "elbow", 0.4, 0.5, 2):
        fb.load_urdf(heavy, floating=False, posture=[0.4])
    refused(lambda: fb.load_urdf(heavy, floating=False, locked=["elbow"]), InputError)


def test_a_file_that_cannot_be_used_is_named(tmp_path):
    refused(lambda: fb.load_urdf(tmp_path / "nothing.urdf"), InputError, "nothing.urdf")
    refused(lambda: fb.load_urdf("zero\0.urdf"), InputError, "path")
    refused(lambda: fb.load_urdf("go2"), InputError, 'fb.load("go2")')
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot>")
    refused(lambda: fb.load_urdf(broken), InputError, "broken", "URDF")


def go2_again(**options):
    go2 = judges.load("go2")
    options = {"feet": list(go2.feet), "posture": go2.posture, **options}
    return fb.load_urdf(options.pop("urdf", go2.urdf), **options)


@pytest.mark.parametrize("base", [[1.0, 0.0, 0.0, 0.0], [0.95, 0.0, 0.1, 0.3]])
@pytest.mark.parametrize("feet", [True, False])
def test_a_quaternion_in_the_order_of_mujoco_is_reported(base, feet):
    joints = judges.load("go2").posture[7:]
    options = {} if feet else {"feet": []}
    with warns(RobotWarning, "go2", "x, y, z, w"):
        posture = [0.0, 0.0, 0.3, *base / np.linalg.norm(base), *joints]
        go2_again(name="go2", posture=posture, **options)
    with warnings.catch_warnings(action="error"):
        posture[3:7] = np.roll(posture[3:7], -1)
        go2_again(posture=posture, **options)


def test_motors_that_cannot_carry_a_floating_robot_are_reported_and_just_enough_is_no_fault(go2):
    state, contacts = go2.standing(), judges.stance(go2)
    tau = fb.WholeBodyController(go2, contacts, fb.standing_tasks(state))(state.q, state.v).tau
    with warnings.catch_warnings(action="error"):
        go2_again(torque_limits=1.02 * np.abs(tau))
    with warns(RobotWarning, "robot", "FL_calf_joint"):
        go2_again(torque_limits=0.5 * np.abs(tau).max() * np.ones(12))
    grams = go2.with_scaled_mass(1000.0).urdf
    with warns(RobotWarning, "robot", "FL_calf_joint"):
        go2_again(urdf=grams, torque_limits=go2.torque_limits)


@pytest.mark.parametrize(("unit", "reported"), [(1.0, False), (39.4, True), (100.0, True)])
def test_lengths_that_are_not_in_metres_are_reported(unit, reported):
    urdf = re.sub(
        r'(<origin[^>]*xyz=")([^"]*)',
        lambda found: found[1] + " ".join(str(unit * float(x)) for x in found[2].split()),
        judges.load("solo12").urdf,
    )
    with warnings.catch_warnings(record=True, action="always") as caught:
        fb.load_urdf(urdf, name="solo12")
    messages = [str(each.message) for each in caught if each.category is RobotWarning]
    assert len(messages) == reported
    assert all("solo12" in message and "metres" in message for message in messages)
