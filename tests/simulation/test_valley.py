"""Ground of several planes: robots stand in a valley, and on planes with an offset."""

from collections.abc import Sequence

import judges
import numpy as np
import pytest

import floatbase as fb

LENGTHS = 1e-9  # m: error of Newton's method, and rounding
# fraction of the weight: difference of planned and measured forces after one second of standing
STEADY = 0.01


def sides(degrees: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the normals of a valley along x: of its left side, which falls to the right, first."""
    s, c = np.sin(np.deg2rad(degrees)), np.cos(np.deg2rad(degrees))
    return np.array([0.0, -s, c]), np.array([0.0, s, c])


def with_feet(robot: fb.Robot, base: Sequence[float], centres: dict[str, np.ndarray]) -> fb.State:
    """Return the state with a level base at a position, and given feet [m], by Newton's method."""
    q = robot.standing().q.copy()
    q[:3], q[3:7] = base, [0.0, 0.0, 0.0, 1.0]
    for _ in range(50):
        state = fb.State(robot, q)
        errors = [state.frame_pose(name).translation - at for name, at in centres.items()]
        jacobian = np.vstack([state.frame_jacobian(name)[:3, 6:] for name in centres])
        q[7:] -= np.clip(np.linalg.solve(jacobian, np.concatenate(errors)), -0.2, 0.2)
    assert np.max(np.abs(errors)) < LENGTHS
    return fb.State(robot, q)


def stood(sim: fb.Simulation, contacts: fb.Contacts, state: fb.State, **options: int) -> fb.Rollout:
    """Simulate a second of standing in a state, until forces are as planned."""
    sim.reset(state)
    tasks = fb.standing_tasks(state)
    controller = fb.WholeBodyController(sim.robot, contacts, tasks, **options)
    record = fb.rollout(sim, controller, 1.0)
    assert record.outcome == "completed" and record.slip().max() < 2e-3
    close = STEADY * sim.robot.weight
    assert np.allclose(record.measured[-1], record.planned[-1], rtol=0.0, atol=close)
    return record


@pytest.mark.parametrize("shift", [0.0, 0.04])  # m, of the valley's bottom to the left
def test_go2_stands_in_a_valley_with_a_level_base(shift):
    robot, normals = judges.load("go2"), np.array(sides(20.0))
    sim = fb.Simulation(robot, fb.Ground(normal=normals, offset=shift * normals[:, 1]))
    start = sim.state
    expected = robot.standing().frame_pose("base").rotation
    assert np.allclose(start.frame_pose("base").rotation, expected, atol=LENGTHS)
    clearances = sim.ground.clearances(sim.contact_positions())
    assert np.allclose(clearances.min(axis=1), 0.0, atol=LENGTHS)
    side = np.argmin(clearances, axis=1)
    assert [name[1] == "L" for name in sim.point_names] == (side == 0).tolist()
    under_feet = dict(zip(sim.point_names, sim.ground.normals[side], strict=True))
    contacts = fb.Contacts.points(robot, normals=under_feet)
    assert np.allclose(contacts.positions(start), sim.contact_positions(), atol=LENGTHS)
    total = stood(sim, contacts, start).measured[-1].reshape(4, 3).sum(axis=0)
    assert np.allclose(total, [0.0, 0.0, robot.weight], atol=STEADY * robot.weight)


def test_a_foot_in_the_bottom_of_a_valley_gets_the_forces_of_both_sides():
    robot, radius = judges.load("go2"), judges.load("go2").feet[0].radius
    home, bottom = robot.standing(), radius / np.cos(np.deg2rad(30.0))
    feet = [foot.frame for foot in robot.feet]
    centres = {foot: home.point(foot) * [1, 0, 0] + [0, 0, bottom] for foot in feet}
    sim = fb.Simulation(robot, fb.Ground(normal=sides(30.0)))
    sim.reset(with_feet(robot, home.q[:3] + [0.0, 0.0, 0.01], centres))
    balls = [sim.data.geom(name).xpos for name in sim.point_names]
    assert np.allclose(sim.ground.clearances(balls), radius, atol=LENGTHS)
    contacts = fb.Contacts.points(robot)
    controller = fb.WholeBodyController(robot, contacts, fb.standing_tasks(sim.state))
    record = fb.rollout(sim, controller, 0.1)
    assert len(sim.data.contact.geom) == 8
    forces = sim.contact_forces()
    assert np.allclose(record.measured[-1], forces.ravel())
    expected = record.planned[-1].reshape(4, 3)[:, 2]
    assert np.allclose(forces[:, 2], expected, atol=0.1 * robot.weight)
    assert forces[:, 2].sum() == pytest.approx(robot.weight, rel=0.1)


@pytest.mark.parametrize("name", ["go2", "talos"])
def test_standing_on_a_slope_may_keep_the_base_level(name):
    robot, normal = judges.load(name), np.array([0.1, 0.0, 1.0]) / np.hypot(0.1, 1.0)
    state, home = robot.standing(normal=normal, offset=0.2), robot.standing()
    for foot in robot.feet:
        height = state.point(foot.frame, foot.middle) @ normal - foot.radius
        assert height == pytest.approx(0.2, abs=LENGTHS)
        up = state.frame_pose(foot.frame).rotation[:, 2]
        assert not foot.is_flat or np.allclose(up, normal, atol=LENGTHS)
    expected = home.frame_pose("base").rotation
    assert np.allclose(state.frame_pose("base").rotation, expected, atol=LENGTHS)
    assert np.allclose(robot.standing(normal=[0.0, 0.0, 2.0]).q, home.q, atol=LENGTHS)
