"""Light meshes: their size, their similarity to the originals, and what is shown without them."""

import re
import sys
import warnings
from pathlib import Path

import judges
import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from floatbase.dynamics import Contacts
from floatbase.errors import RobotWarning
from floatbase.robots import catalogue, load, load_urdf, with_floating_base
from floatbase.simulation import Simulation
from floatbase.viewer.scene.meshes import robot_meshes
from floatbase.viewer.scene.visuals import urdf_visuals

MESHES = Path(__file__).parents[2] / "assets" / "meshes"
# m: by which decimation may move an outermost vertex; three pixels in a picture of a whole robot
BOX = 0.01
# m from a contact to the nearest vertex: a foot's ball has a radius of 2 cm, and a sole few
# vertices
REACH = 0.03


def test_light_meshes_are_under_400_kb_and_good_triangles():
    for name in catalogue():
        assert (MESHES / f"{name}.npz").stat().st_size < 400_000, name
        for mesh in robot_meshes(load(name)):
            assert mesh.faces.max() < len(mesh.vertices) == len(mesh.colours), name
            assert np.all(np.isfinite(mesh.vertices)), name


@pytest.mark.parametrize("robot", judges.sampled(catalogue(), "go2", "ur5"), indirect=True)
def test_every_visual_of_the_original_is_read_and_light_meshes_fill_the_same_boxes(robot):
    pytest.importorskip("trimesh", reason="the originals are read with trimesh")
    pytest.importorskip("collada", reason="the originals are read with pycollada")
    folders = [str(folder) for folder in robot.package_dirs]
    found = pin.buildGeomFromUrdfString(robot.model, robot.urdf, pin.VISUAL, package_dirs=folders)
    visuals = {(one.parentJoint, Path(one.meshPath).stem) for one in found.geometryObjects}
    pieces = urdf_visuals(robot)
    assert {(piece.joint, piece.source) for piece in pieces} == visuals
    light = robot_meshes(robot)
    assert {mesh.joint for mesh in light} == {piece.joint for piece in pieces}
    for mesh in light:
        own = np.vstack([piece.mesh.vertices for piece in pieces if piece.joint == mesh.joint])
        for corner in (np.min, np.max):
            assert_allclose(corner(mesh.vertices, axis=0), corner(own, axis=0), atol=BOX)


def test_light_meshes_reach_down_to_the_contacts():
    for name in catalogue():
        robot = load(name)
        if not robot.feet:
            continue
        state = robot.standing()
        contacts = (Contacts.flat_feet if robot.feet[0].is_flat else Contacts.points)(robot)
        poses = state.joint_transforms
        points = [
            mesh.vertices @ poses[mesh.joint][:3, :3].T + poses[mesh.joint][:3, 3]
            for mesh in robot_meshes(robot)
        ]
        for position in contacts.positions(state):
            assert np.linalg.norm(np.vstack(points) - position, axis=1).min() < REACH, name


def test_a_robot_outside_the_catalogue_shows_its_own_meshes():
    pytest.importorskip("trimesh", reason="other robots' meshes are read with trimesh")
    robot = load("hyq", feet=["lf_foot", "rf_foot", "lh_foot", "rh_foot"])
    assert sum(len(mesh.faces) for mesh in robot_meshes(robot)) > 1000


def test_a_robot_without_meshes_is_drawn_along_its_tree(monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    robot = load_urdf(
        load("go2").urdf.replace("package://", "package://unheard/of/"), feet=["RR_foot"]
    )
    meshes = robot_meshes(robot)
    assert [mesh.joint for mesh in meshes] == list(range(1, robot.model.njoints))
    calf = meshes[-1].vertices
    foot = robot.model.frames[robot.model.getFrameId("RR_foot")].placement.translation
    assert np.linalg.norm(calf - foot, axis=1).min() < REACH


def test_light_meshes_belong_to_a_urdf_and_not_to_a_name():
    """Light meshes are found for the same visuals, whatever the name of the robot.

    Another name, other masses and legs further apart keep them. Other feet, another joint or
    another robot with the same name do not.
    """
    urdf = load("go2").urdf
    light = [mesh.vertices for mesh in robot_meshes(load("go2"))]
    for old, new, name, same in (
        ("6.921", "7.5", "mine", True),
        ("0 0.0955 0", "0 0.12 0", "mine", True),
        ("0 0 -0.213", "0 0 -0.25", "go2", False),
    ):
        assert old in urdf
        robot = load_urdf(urdf.replace(old, new), name=name)
        drawn = [mesh.vertices for mesh in robot_meshes(robot)]
        assert same == (len(drawn) == len(light) and all(map(np.array_equal, drawn, light)))
    ankle = re.sub('"FL_foot_joint"\\s*type="fixed"', '"FL_foot_joint" type="continuous"', urdf)
    walker = load_urdf(re.sub('<axis\\s*xyz="0 0 0"', '<axis xyz="0 1 0"', ankle))
    # its foot turns
    assert walker.model.getJointId("FL_foot_joint") in {mesh.joint for mesh in robot_meshes(walker)}
    other = load_urdf(MESHES.parent / "models" / "cart.urdf", name="go2")
    assert len(robot_meshes(other)) < len(light)


def test_the_base_of_a_floating_arm_moves_with_it():
    arm = load("ur5")
    bolted = {mesh.joint: mesh for mesh in robot_meshes(arm)}
    loose = with_floating_base(arm)
    free = {mesh.joint: mesh for mesh in robot_meshes(loose)}
    assert set(free) == {joint + 1 for joint in bolted}
    for joint, mesh in bolted.items():
        assert_array_equal(free[joint + 1].vertices, mesh.vertices)


def test_parts_of_a_locked_joint_move_with_its_parent():
    arm = load("ur5")
    stiff = load("ur5", locked=["wrist_1_joint", "wrist_2_joint", "wrist_3_joint"])
    meshes = robot_meshes(stiff)
    assert [mesh.joint for mesh in meshes] == [0, 1, 2, 3]
    assert sum(len(mesh.faces) for mesh in meshes) == sum(
        len(mesh.faces) for mesh in robot_meshes(arm)
    )
    home, whole = arm.standing(), robot_meshes(arm)[-1]
    tip = stiff.standing().joint_transforms[3] @ [*meshes[-1].vertices[-1], 1.0] @ np.eye(4, 3)
    expected = home.joint_transforms[whole.joint] @ [*whole.vertices[-1], 1.0] @ np.eye(4, 3)
    assert_allclose(tip, expected, atol=1e-5)


INCH = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>{unit}<up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="12">0 0 0 10 0 0 0 10 0 0 0 10</float_array>
<technique_common><accessor source="#a" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common>
</source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>
<p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""


def single_link(name, scale="", others=""):
    """A URDF of one link of 12 kg that is drawn as a mesh."""
    return (
        f'<robot name="one"><link name="trunk"><inertial><mass value="12"/><inertia ixx="0.05" '
        f'iyy="0.1" izz="0.13" ixy="0" ixz="0" iyz="0"/></inertial><visual><geometry><mesh '
        f'filename="{name}" {scale}/></geometry></visual>{others}</link></robot>'
    )


@pytest.mark.parametrize(
    ("unit", "scale", "size"),
    [
        ('<unit meter="0.0254" name="inch"/>', "", 0.254),
        ('<unit name="millimeter" meter="0.001"/>', 'scale="2 2 2"', 0.02),
        ("", "", 10.0),
        ('<unit name="meter"/>', "", 10.0),
    ],
)
def test_collada_files_are_drawn_and_collide_in_their_unit(unit, scale, size, tmp_path):
    pytest.importorskip("trimesh", reason="meshes are read with trimesh")
    (tmp_path / "part.dae").write_text(INCH.format(unit=unit), encoding="utf-8")
    (tmp_path / "one.urdf").write_text(single_link("part.dae", scale), encoding="utf-8")
    robot = load_urdf(tmp_path / "one.urdf", name=f"one of {size} m {unit}")
    (mesh,) = robot_meshes(robot)
    for points in (mesh.vertices, Simulation(robot).model.mesh_vert):
        lengths = np.linalg.norm(points[:, None] - points, axis=2)
        assert_allclose(lengths.max(), size * np.sqrt(2.0), rtol=1e-5)


def test_meshes_are_found_in_the_package_around_the_file(tmp_path):
    (tmp_path / "my_robot" / "urdf").mkdir(parents=True)
    (tmp_path / "copy" / "urdf").mkdir(parents=True)
    for package in ("my_robot", "copy"):  # a copy need not have the name of the package
        (tmp_path / package / "part.dae").write_text(INCH.format(unit=""), encoding="utf-8")
        file = tmp_path / package / "urdf" / "one.urdf"
        for name in (
            "package://my_robot/part.dae",
            "../part.dae",
            f"file://{file.parents[1]}/part.dae",
        ):
            file.write_text(single_link(name), encoding="utf-8")
            with warnings.catch_warnings(action="error"):
                (mesh,) = robot_meshes(load_urdf(file))
            assert len(mesh.faces) == 4, name


CRATE = '<collision><geometry><box size="0.4 0.3 0.2"/></geometry></collision>'


@pytest.mark.parametrize("content", [None, "", "no mesh"])
@pytest.mark.parametrize(("others", "size"), [(CRATE, [0.4, 0.3, 0.2]), ("", [0.3, 0.2, 0.1])])
def test_a_mesh_that_cannot_be_read_is_named_and_costs_only_its_own_link(
    content, others, size, tmp_path
):
    pytest.importorskip("trimesh", reason="meshes are read with trimesh")
    if content is not None:
        (tmp_path / "part.stl").write_text(content, encoding="utf-8")
    file = tmp_path / "one.urdf"
    file.write_text(single_link("part.stl", others=others), encoding="utf-8")
    with pytest.warns(RobotWarning, match="part.stl") as caught:
        (mesh,) = robot_meshes(load_urdf(file))
    assert len(caught) == 1
    assert_allclose(np.ptp(mesh.vertices, axis=0), size, rtol=1e-5)
