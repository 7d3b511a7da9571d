"""Ground with boxes: its surface, its contacts in MuJoCo, and robots that start on it."""

import judges
import mujoco
import numpy as np
import pytest
from messages import refused

import floatbase as fb
from floatbase.errors import InputError
from floatbase.simulation import Box, Ground

ROUNDING = 1e-12
LENGTHS = 1e-9  # m: error of Newton's method, and rounding


def slope(degrees: float, axis: int = 0) -> np.ndarray:
    """Return the normal of a plane that is tilted about a horizontal axis."""
    normal = np.array([0.0, 0.0, np.cos(np.deg2rad(degrees))])
    normal[axis] = np.sin(np.deg2rad(degrees))
    return normal


GROUNDS = {
    "stairs up": Ground.stairs(4, rise=0.1, start=0.3),
    "stairs down": Ground.stairs(3, rise=-0.05, start=0.3),
    "tiles": Ground.tiles(0.05, size=(2.0, 1.0), seed=3),
    "gap": Ground.gap(0.1),
    "box on a slope": Ground(normal=slope(10.0), boxes=[Box([0.2, 0.6], [-0.3, 0.4], 0.05)]),
    "boxes that overlap, in a valley": Ground(
        normal=[slope(20.0, 1), slope(-20.0, 1)],
        boxes=[Box([0.0, 1.0], [-0.5, 0.2], 0.1), Box([0.5, 1.5], [-0.2, 0.5], 0.2)],
    ),
}


@pytest.mark.parametrize("name", GROUNDS)
def test_height_and_normal_are_what_a_ray_from_above_meets(name):
    ground = GROUNDS[name]
    sim = fb.Simulation(judges.load("go2"), ground)
    aside = np.array(sim.robot.standing().q)
    aside[:3] += [-50.0, 0.0, 50.0]  # the robot is not between ray and ground
    sim.reset(fb.State(sim.robot, aside))
    xy = np.random.default_rng(0).uniform([-0.5, -1.0], [2.5, 1.0], (200, 2))
    heights, normals = ground.height(xy), ground.normal(xy)
    for point, height, normal in zip(xy, heights, normals, strict=True):
        geom, found = np.zeros((1, 1), dtype=np.int32), np.zeros((3, 1))
        start, down = np.array([*point, 5.0]), np.array([0.0, 0.0, -1.0])
        length = mujoco.mj_ray(sim.model, sim.data, start, down, None, True, -1, geom, found)
        assert height == pytest.approx(5.0 - length, abs=ROUNDING)
        assert np.allclose(normal, found.ravel(), atol=ROUNDING)
        assert ground.height(point) == height and isinstance(ground.height(point), float)


def test_stairs_tiles_and_gap_have_the_heights_that_they_are_made_for():
    up, down = Ground.stairs(3, 0.1, run=0.3, start=0.5), Ground.stairs(3, -0.1, run=0.3, start=0.5)
    x = np.array([-5.0, 0.49, 0.51, 0.81, 1.11, 5.0])
    xy = np.column_stack([x, np.zeros(6)])
    assert np.allclose(up.height(xy), [0.0, 0.0, 0.1, 0.2, 0.3, 0.3])
    assert np.allclose(down.height(xy), [0.0, 0.0, -0.1, -0.2, -0.3, -0.3])
    gap = Ground.gap(0.1, depth=0.4, start=0.5)
    assert np.allclose(gap.height([[0.49, 0.0], [0.55, 0.0], [0.61, 0.0]]), [0.0, -0.4, 0.0])
    tiles, again = Ground.tiles(0.05, seed=4), Ground.tiles(0.05, seed=4)
    tops = tiles.box_bounds[:, 4]
    assert tops.min() >= 0.0 and 0.04 < tops.max() <= 0.05
    assert np.array_equal(tiles.box_bounds, again.box_bounds)
    assert not np.array_equal(tiles.box_bounds, Ground.tiles(0.05, seed=5).box_bounds)


def test_clearances_of_a_box_are_distances_from_its_nearest_face_or_edge():
    ground = Ground(boxes=[Box([0.0, 1.0], [0.0, 1.0], 0.5)])
    points = [[0.5, 0.5, 0.7], [1.3, 0.5, 0.2], [1.3, 0.5, 0.9], [0.9, 0.5, 0.3], [2, 2, 1.5]]
    expected = [0.2, 0.3, 0.5, -0.1, np.sqrt(3.0)]
    assert np.allclose(ground.clearances(points)[:, 1], expected)
    assert np.allclose(ground.clearances(points)[:, 0], np.array(points)[:, 2])


def test_a_robot_on_a_box_has_the_contacts_that_it_has_on_a_plane(go2):
    """A push, a slip and a fall included: boxes have the friction of planes and meet hulls, too."""
    grounds = Ground(0.3), Ground(0.3, offset=-1.0, boxes=[Box([-9, 9], [-9, 9], 0.0)])
    push = fb.Push([0.0, 60.0, 0.0], start=0.05, duration=0.1)
    runs, sims = [], [fb.Simulation(go2, ground) for ground in grounds]
    for sim in sims:
        controller = judges.controller_of("go2")
        runs.append(fb.rollout(sim, controller, 0.3, [push]))
        assert runs[-1].outcome == "completed"
    plane, box = runs
    assert plane.slip().max() > 0.02  # the feet slide, so that friction matters
    assert np.allclose(box.q, plane.q, atol=0.03)
    assert np.allclose(box.foot_positions, plane.foot_positions, atol=5e-3)
    impulses = [run.measured.sum(axis=0) * 1e-3 for run in runs]
    assert np.allclose(*impulses, atol=0.01 * go2.weight)
    for sim in sims:
        sim.reset()
        record = fb.rollout(sim, judges.limp, 0.6, settling_time=1.0)
        assert record.outcome == "fell"
        assert 0.0 < sim.state.q[2] < 0.2, "the links lie on the ground"


def test_measured_forces_carry_the_robot_across_the_edge_of_a_step(go2):
    """On an edge, contact normals are oblique; forces and mass times acceleration still agree."""
    front = max(foot_x for foot_x in fb.Simulation(go2).contact_positions()[:, 0])
    for top in (0.0, 0.02):  # edges below the front feet, and against their sides
        sim = fb.Simulation(
            go2,
            Ground(
                offset=-0.1,
                boxes=[Box([-2, front - 0.01], [-1, 1], 0.0), Box([front + 0.01, 2], [-1, 1], top)],
            ),
        )
        sim.reset(go2.standing())
        controller = judges.controller_of("go2")
        for _ in range(60):
            before = sim.state.com_velocity
            sim.step(controller(sim.q, sim.v, 0.0).tau)
            accelerating = go2.mass * (sim.state.com_velocity - before) / sim.timestep
            total = sim.contact_forces().sum(axis=0) + [0.0, 0.0, -go2.weight]
            assert np.allclose(total, accelerating, atol=0.02 * go2.weight)
        oblique = sim.contact_forces()[:2]
        assert np.any(np.abs(oblique) > 0.0)


@pytest.mark.parametrize(
    ("name", "axis", "degrees"), [("talos", 0, 10.0), ("talos", 1, -10.0), ("g1", 0, -10.0)]
)
def test_a_biped_starts_upright_on_a_slope_and_stands(name, axis, degrees):
    robot, normal = judges.load(name), slope(degrees, axis)
    sim = fb.Simulation(robot, Ground(normal=normal, offset=0.1))
    start, home = sim.state, robot.standing()
    assert np.allclose(sim.ground.clearances(sim.contact_positions()), 0.0, atol=LENGTHS)
    base, at_home = (state.frame_pose("base").rotation for state in (start, home))
    assert np.allclose(base, at_home, atol=LENGTHS)
    for foot in robot.feet:
        assert np.allclose(start.frame_pose(foot.frame).rotation[:, 2], normal, atol=LENGTHS)
    beside, before = (
        (state.com - np.mean([state.point(f.frame, f.middle) for f in robot.feet], axis=0))[:2]
        for state in (start, home)
    )
    assert np.allclose(beside, before, atol=LENGTHS)
    contacts = fb.Contacts.feet(robot, normals=sim.ground.normal([0.0, 0.0]))
    controller = fb.WholeBodyController(robot, contacts, fb.standing_tasks(start))
    record = fb.rollout(sim, controller, 0.4)
    assert record.outcome == "completed"
    assert record.slip().max() < 2e-3
    assert np.linalg.norm(record.final.com - start.com) < 5e-3


@pytest.mark.parametrize("ground", ["stairs down", "gap"])
def test_a_robot_on_a_platform_starts_as_on_level_ground(ground, talos):
    sim = fb.Simulation(talos, GROUNDS[ground])
    assert np.allclose(sim.state.q, talos.standing().q, atol=LENGTHS)


def test_go2_starts_with_its_feet_on_boxes_of_different_heights(go2):
    sim = fb.Simulation(go2, Ground.stairs(1, 0.08, start=0.0))
    feet = sim.contact_positions()
    assert np.allclose(feet[:, 2], np.where(feet[:, 0] > 0.0, 0.08, 0.0), atol=LENGTHS)
    start = sim.state
    controller = fb.WholeBodyController(go2, fb.Contacts.feet(go2), fb.standing_tasks(start))
    assert fb.rollout(sim, controller, 0.3).slip().max() < 2e-3


def test_a_robot_that_climbs_has_not_fallen_and_one_that_lies_on_a_box_has(go2):
    sim = fb.Simulation(go2, Ground.stairs(1, 0.5, start=1.0))
    low = sim.state
    q = np.array(low.q)
    q[:3] += [2.0, 0.0, 0.5]
    sim.data.qpos[:3] = q[:3]
    mujoco.mj_forward(sim.model, sim.data)
    assert not sim.fallen
    sim.data.qpos[2] = 0.55
    mujoco.mj_forward(sim.model, sim.data)
    assert sim.fallen


@pytest.mark.parametrize(
    ("make", "number"),
    [
        (lambda: Box([1.0, 0.5], [0.0, 1.0], 0.1), "1.0, 0.5"),
        (lambda: Ground(boxes=[0.1]), "0.1"),
        (lambda: Ground(boxes=Box([0.0, 1.0], [0.0, 1.0], 0.1)), "Box"),
        (lambda: Ground.stairs(0, 0.1), "0"),
        (lambda: Ground.stairs(3, 0.0), "0"),
        (lambda: Ground.tiles(0.05, tile=1e-3), "0.001"),
        (lambda: Ground.tiles(0.05, tile=5.0), "5"),
        (lambda: Ground.gap(-0.1), "-0.1"),
        (lambda: Ground().height([0.0, 0.0, 1.0]), "(3,)"),
        (lambda: Ground(normal=[1.0, 0.0, 0.0]).height([0.0, 0.0]), "vertical"),
    ],
)
def test_grounds_that_cannot_be_are_refused(make, number):
    refused(make, InputError, number)


def test_a_sole_beside_a_box_is_parallel_to_the_slope(talos):
    ground = Ground(normal=[0.0, -0.1, 1.0], boxes=[Box([-1.0, 1.0], [0.02, 1.0], 0.06)])
    state = fb.Simulation(talos, ground=ground).state
    for foot in talos.feet:
        corners = np.array([state.point(foot.frame, corner) for corner in foot.corners])
        assert np.allclose(corners[:, 2], ground.height(corners[:, :2]), rtol=0.0, atol=1e-8)
        middle = state.point(foot.frame, foot.middle)
        up = state.frame_pose(foot.frame).rotation[:, 2]
        assert np.allclose(up, ground.normal(middle[:2]), rtol=0.0, atol=1e-8)
