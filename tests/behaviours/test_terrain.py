"""Walking on a ground that the walk knows: footholds, soles and the lean of the body."""

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.behaviours import Gait, Walk
from floatbase.behaviours._level_place import level_place

CIRCLE = 0.05 * np.array([[np.cos(a), np.sin(a)] for a in np.arange(12) * np.pi / 6])


class Hills:
    """A smooth terrain that accepts one point at a time."""

    def height(self, xy: np.ndarray) -> float:
        x, _ = xy
        return 0.1 * float(np.sin(x))

    def normal(self, xy: np.ndarray) -> np.ndarray:
        normal = np.array([-0.1 * np.cos(xy[0]), 0.0, 1.0])
        return normal / np.linalg.norm(normal)


def test_a_level_place_is_flat_around_and_near():
    ground = fb.Ground.tiles(0.06, tile=0.25, start=0.0, size=(2.0, 2.0), seed=1)
    for point in np.random.default_rng(0).uniform([0.3, -0.7], [1.7, 0.7], (100, 2)):
        place = level_place(ground, point, CIRCLE, 0.15)
        moved = np.linalg.norm(place - point)
        if moved == 0.0:
            continue
        assert moved <= 0.15
        assert np.ptp(ground.height(place + CIRCLE)) < 0.02
        assert np.ptp(ground.height([*(point + CIRCLE), point])) > 0.005, "moved without need"


def test_a_place_without_edges_stays_where_it_is():
    slope = fb.Ground(normal=[0.2, 0.1, 1.0])
    for terrain in (slope, Hills()):
        point = np.array([0.3, -0.2])
        assert np.array_equal(level_place(terrain, point, CIRCLE, 0.15), point)


@pytest.mark.front_end
def test_go2_steps_over_a_gap_that_it_knows(go2):
    ground = fb.Ground.gap(0.1, start=0.4)
    contacts = fb.Contacts.feet(go2, mu=0.6)
    walk = Walk(go2, contacts, Gait.trot(go2, start=0.2), (0.3, 0.0), ground=ground)
    run = fb.rollout(fb.Simulation(go2, ground), walk, 4.0, control_period=0.002)
    assert run.outcome == "completed"
    assert run.foot_positions[-1, :, 0].min() > 0.5  # all feet are across
    loaded = run.measured.reshape(len(run), 4, 3)[:, :, 2] > 0.1 * go2.weight
    assert run.foot_positions[loaded][:, 2].min() > -0.01


def test_go2_climbs_stairs_that_it_knows_and_its_body_leans_with_them(go2):
    ground = fb.Ground.stairs(3, 0.1, start=0.35)
    contacts = fb.Contacts.feet(go2, mu=0.6)
    walk = Walk(go2, contacts, Gait.trot(go2, start=0.2), (0.3, 0.0), clearance=0.08, ground=ground)
    run = fb.rollout(fb.Simulation(go2, ground), walk, 5.5, control_period=0.002)
    assert run.outcome == "completed"
    assert run.q[-1, 2] - run.q[0, 2] == pytest.approx(0.3, abs=0.02)
    nose = run.robot.nq and np.array(
        [run.state(i).frame_pose("base").rotation[2, 0] for i in range(0, len(run), 50)]
    )
    slope = 0.1 / 0.3  # of the stairs; a nose up is positive
    assert 0.7 * slope < np.tan(np.arcsin(nose.max())) < 1.4 * slope
    assert abs(nose[-1]) < 0.05  # level again on the platform


@pytest.mark.parametrize("name", ["go2", "talos"])
def test_a_standing_robot_is_balanced_above_the_middle_of_its_contacts_on_a_slope(name):
    """The points at which its feet touch the slope, also after a turn."""
    robot, normal = judges.load(name), np.array([-0.2, 0.1, 1.0])
    contacts = fb.Contacts.feet(robot, mu=0.6, normals=normal / np.linalg.norm(normal))
    turn = np.zeros(robot.nv)
    turn[5] = 0.7 * any(foot.corners is None for foot in robot.feet)  # soles turn with the slope
    state = robot.standing()
    state = fb.State(robot, state.integrate(turn))
    walk = Walk(robot, contacts, Gait.walk(robot, start=1.0))
    walk(state.q, state.v, 0.0)
    middle = contacts.positions(state).mean(axis=0)
    assert walk.plan.zmp(0.0) == pytest.approx(middle[:2], abs=1e-6)
