"""Robots of one's own: the models that come with the course, and what is said when a file cannot be used."""

from __future__ import annotations

from pathlib import Path

import judges
import pytest

import floatbase as fb
from floatbase._assets import assets_root
from floatbase.errors import InputError

MODELS = sorted((assets_root() / "models").glob("*.urdf"))


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_a_model_of_our_own_is_the_same_to_mujoco(path: Path) -> None:
    robot = fb.load_urdf(path)
    assert robot.is_floating
    state = robot.random_state(0)
    judge = judges.Mujoco(robot).at(state)
    assert judges.relative(state.M, judge.M) < 1e-9
    assert judges.relative(state.h, judge.h) < 1e-9


def test_an_arm_may_be_bolted_down_or_float() -> None:
    urdf = fb.load("ur5").urdf
    assert (fb.load_urdf(urdf, floating=False).nv, fb.load_urdf(urdf).nv) == (6, 12)


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
