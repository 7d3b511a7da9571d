"""Robots of one's own: the models that come with the course, and what is said when a file cannot be used."""

from __future__ import annotations

from pathlib import Path

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.errors import InputError
from floatbase.robots import PLATE, unbolted

MODELS = sorted((Path(__file__).parents[2] / "assets" / "models").glob("*.urdf"))


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_a_model_of_our_own_is_the_same_to_mujoco(path: Path) -> None:
    robot = fb.load_urdf(path)
    assert robot.is_floating
    state = robot.random_state(0)
    judge = judges.Mujoco(robot).move_to(state)
    assert judges.relative(state.M, judge.M) < 1e-9
    assert judges.relative(state.h, judge.h) < 1e-9


def test_an_arm_may_be_bolted_down_or_float() -> None:
    urdf = fb.load("ur5").urdf
    assert (fb.load_urdf(urdf, floating=False).nv, fb.load_urdf(urdf).nv) == (6, 12)


def test_a_robot_without_its_bolts_has_the_joints_and_links_it_had_and_may_stand_on_a_plate() -> None:
    arm = fb.load("ur5", posture=[0.0, -1.7, 1.2, 0.5, 1.5, 0.0])
    loose, standing = unbolted(arm), unbolted(arm, plate=True)
    assert loose.joint_names == arm.joint_names and loose.mass == pytest.approx(arm.mass)
    assert np.array_equal(loose.torque_limits, arm.torque_limits)
    for robot, height in ((loose, 1.0), (standing, PLATE[1])):
        state = robot.standing()
        assert np.allclose(state.M[6:, 6:], arm.standing().M)
        assert np.allclose(state.h[6:], arm.standing().h)
        assert state.q[2] == pytest.approx(height)
    assert np.allclose(judges.stance(standing).positions(standing.standing())[:, 2], 0.0, atol=1e-9)
    with pytest.raises(InputError, match="go2 has no bolts; unbolted takes a robot with a fixed base"):
        unbolted(judges.load("go2"))


def test_a_file_that_cannot_be_used_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"there is no file .*nothing\.urdf; give the path of a URDF file"):
        fb.load_urdf(tmp_path / "nothing.urdf")
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot>")
    with pytest.raises(InputError, match=r"Pinocchio cannot read broken\.urdf as a URDF"):
        fb.load_urdf(broken)


@pytest.mark.parametrize("kind", ["planar", "floating"])
def test_a_joint_that_no_motor_drives_is_refused_by_name(kind: str, tmp_path: Path) -> None:
    link = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    path = tmp_path / "table.urdf"
    path.write_text(
        f'<robot name="table"><link name="base">{link}</link><link name="top">{link}</link>'
        f'<joint name="slide" type="{kind}"><parent link="base"/><child link="top"/><axis xyz="0 0 1"/></joint></robot>'
    )
    with pytest.raises(InputError, match=r"joint 'slide' of table.urdf moves in \d ways; a motor drives one"):
        fb.load_urdf(path)
