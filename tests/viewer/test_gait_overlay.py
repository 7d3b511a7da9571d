"""Gait overlay and the camera that follows a walk."""

import dataclasses
from contextlib import closing

import numpy as np
import pytest
from messages import refused
from numpy.testing import assert_allclose, assert_array_equal

import floatbase as fb
from floatbase.behaviours import Gait, Walk, capture_point
from floatbase.errors import InputError, UnknownNameError
from floatbase.viewer.export import recording

from .looks import vertices
from .test_recording import tracks

ROUNDED = 1e-9  # m: the same place, computed in another order
POINTS = 1e-4  # of a curve's size: vertices of lines are in single precision
SWING, START = 0.2, 0.3  # s


@pytest.fixture(scope="module")
def walked(go2):
    """Return a trot of go2 with four swings; two feet are in the air at the end of the record."""
    gait = Gait.trot(go2, swing=SWING, start=START)
    walk = Walk(go2, fb.Contacts.feet(go2, mu=0.6), gait, velocity=(0.2, 0.0))
    push = fb.Push([0.0, 40.0, 0.0], start=0.5)
    return fb.rollout(fb.Simulation(go2), walk, START + 4.5 * SWING, [push], 2e-3), walk


@pytest.fixture(scope="module")
def biped():
    """Return a walk of talos that turns left; one foot is in the air at the end of the record."""
    robot = fb.load("talos")
    gait = Gait.walk(robot, start=0.1)
    walk = Walk(robot, fb.Contacts.feet(robot, mu=0.6), gait, (0.2, 0.0), yaw_rate=0.4)
    return fb.rollout(fb.Simulation(robot), walk, 0.4, control_period=4e-3), walk


def test_marks_are_where_the_walk_plans(viewer, walked):
    run, walk = walked
    state, look = run.final, viewer.walk_overlay(walk, run.final)
    radius = run.robot.feet[0].radius
    assert walk.plan is not None and walk.time == run.time[-1]
    swinging = set(walk.contacts.names) ^ set(run.contacts.names)
    assert len(swinging) == 2
    marks = {f"foothold/{foot}" for foot in walk.footholds} | {f"swing/{foot}" for foot in swinging}
    assert set(look) == {"dcm", "zmp"} | marks
    expected = capture_point(state.com, state.com_velocity, walk.omega)
    assert_allclose(look["dcm"].matrix[:2, 3], expected, atol=ROUNDED)
    assert_allclose(look["zmp"].matrix[:2, 3], walk.plan.zmp(walk.time), atol=ROUNDED)
    for foot, place in walk.footholds.items():  # go2's frames are in the middles of its balls
        ring = look[f"foothold/{foot}"]
        assert_allclose(ring.matrix[:2, 3], place[:2], atol=ROUNDED)
        assert 0.0 < ring.matrix[2, 3] - (place[2] - radius) < 0.01 * viewer.painter.size
        assert np.linalg.norm(ring.matrix[:3, 0]) > 1.5 * radius  # seen around the foot


def test_a_line_follows_the_swing_to_its_foothold(viewer, walked):
    run, walk = walked
    look = viewer.walk_overlay(walk, run.final)
    for foot, path in walk.swings.items():
        line = vertices(look[f"swing/{foot}"])
        ground = [0.0, 0.0, -run.robot.feet[0].radius]
        size = np.linalg.norm(path.end - path.start) + path.height
        for point, at in ((line[0], path.start), (line[-1], path.end)):
            assert_allclose(point, at + ground, atol=POINTS * size)
        middle, *_ = path((path.lift_off + path.touchdown) / 2.0)
        # feet touch down at slightly different heights, so the curve leans by the difference of its
        # ends
        leans = abs(path.end[2] - path.start[2]) + POINTS * size
        assert_allclose(line[len(line) // 2], middle + ground, atol=leans)


def test_a_swing_with_a_new_target_costs_no_new_shape(viewer, walked):
    run, walk = walked
    viewer.show(run.final, walk.contacts, extra=viewer.walk_overlay(walk, run.final))
    before = viewer.renderer.picture
    # the capture point is elsewhere, and so the picture of the same step differs
    other = run.state(-20)
    marks = viewer.step_overlay(walk.history[-1], float(run.time[-20]), other)
    viewer.show(other, walk.contacts, extra=marks)
    now = viewer.renderer.picture
    assert all(now[path].shape is before[path].shape for path in now)
    assert np.abs(now["dcm"].matrix - before["dcm"].matrix).max() > 1e-4


def test_a_stored_step_is_drawn_as_it_was_planned(viewer, walked):
    run, walk = walked
    step, t = walk.history[2], walk.history[2].time + 0.1
    look = viewer.step_overlay(step, t, run.state(int(np.searchsorted(run.time, t - 1e-9))))
    assert set(step.swings) == set(run.contacts.names) - set(step.stance) and len(step.swings) == 2
    expected = {f"swing/{foot}" for foot in step.swings}
    assert {path for path in look if path.startswith("swing/")} == expected
    assert_allclose(look["zmp"].matrix[:2, 3], step.plan.zmp(t), atol=ROUNDED)


def test_a_walk_has_no_marks_before_its_first_control_step(viewer, go2, standing):
    walk = Walk(go2, fb.Contacts.feet(go2), Gait.trot(go2))
    assert viewer.walk_overlay(walk, standing) == {} and walk.time is None


def test_soles_are_outlined_with_position_and_rotation_at_touchdown(biped):
    run, walk = biped
    with closing(fb.Viewer(run.robot)) as viewer:
        look = viewer.walk_overlay(walk, run.final)
    (foot,) = walk.swings
    outline = vertices(look[f"foothold/{foot}"])[:, :2]
    corners = run.robot.feet[0].corners[:, :2]
    middle = outline.mean(axis=0)
    # m: the sole's frame is in its middle, and vertices are 16-bit numbers
    assert_allclose(middle, walk.footholds[foot][:2], atol=1e-3)
    radii = np.linalg.norm(outline[:4] - middle, axis=1)
    assert_allclose(radii, np.linalg.norm(corners, axis=1), atol=1e-3)
    x, y = look[f"foothold/{foot}"].matrix[:2, 0]
    left = walk.yaw_rate * (walk.swings[foot].touchdown - walk.time)
    base = run.final.frame_pose("base").rotation
    assert np.arctan2(y, x) == pytest.approx(np.arctan2(base[1, 0], base[0, 0]) + left)


def test_invalid_overlays_are_refused_by_name(viewer, walked):
    run, walk = walked
    final, step = run.final, walk.history[1]
    paw = dataclasses.replace(step, footholds={"paw": np.zeros(3)})
    solo = fb.load("solo12").standing()
    for call, error, *named in (
        (lambda: viewer.walk_overlay(None, final), InputError, "walk", "Walk", "None"),
        (lambda: viewer.walk_overlay(walk, solo), InputError, "go2", "solo12"),
        (lambda: viewer.step_overlay(walk, 0.0, final), InputError, "step", "StepPlan", "Walk"),
        (lambda: viewer.step_overlay(paw, 0.0, final), UnknownNameError, "go2", "paw"),
        (lambda: viewer.step_overlay(step, np.nan, final), InputError, "t", np.nan),
        (lambda: viewer.play(run, steps=walk), InputError, "steps", "Walk", "walk.history"),
        (lambda: viewer.play(run, steps=[run]), InputError, "step", "StepPlan", "Rollout"),
    ):
        refused(call, error, *named)


def test_a_recorded_walk_plays_with_its_marks(viewer, walked):
    run, walk = walked
    viewer.play(run, steps=walk.history)
    moving = tracks(viewer)
    first, second = walk.history[1], walk.history[2]  # one pair lifts, then the other
    for foot in first.swings:
        times, seen = moving[f"swing/{foot}", ".visible"]
        assert seen[(times >= first.time) & (times < second.time)].all()
        assert not seen[times < first.time].any()
    assert ("dcm", ".position") in moving
    before = set(viewer.renderer.picture)
    viewer.play(run)
    expected = {"dcm", "zmp", "foothold", "swing"}
    assert {path.split("/")[0] for path in before - set(viewer.renderer.picture)} == expected


def test_a_followed_path_is_smooth_without_the_sway_of_steps():
    t = np.linspace(0.0, 4.0, 121)
    straight = np.stack([0.3 * t, -0.1 * t, np.full_like(t, 0.3)], axis=1)
    assert_allclose(recording.smoothed(t, straight), straight, atol=ROUNDED)
    swayed = straight + 0.02 * np.stack([0.0 * t, np.sin(2.0 * np.pi * t / 0.5), 0.0 * t], axis=1)
    left = recording.smoothed(t, swayed) - straight
    assert np.abs(left[30:-30]).max() < 0.02 / 100.0
    short = straight[:2]
    assert_array_equal(recording.smoothed(t[:2], short), short)
    refused(lambda: recording.smoothed(t, straight[:3]), InputError, 121, 3)


def test_the_grounds_lines_reach_as_far_as_the_robot_walks(viewer, standing):
    q = standing.q.copy()
    q[:2] = 40.0, -21.0
    viewer.show(fb.State(viewer.robot, q))
    lines = vertices(viewer.renderer.picture["ground"])
    low, high = lines.min(axis=0), lines.max(axis=0)
    assert (low[:2] < q[:2] - 3.0).all() and (high[:2] > q[:2] + 3.0).all()
    # the same lines
    assert_allclose(lines[:, :2] / 0.25, np.round(lines[:, :2] / 0.25), atol=1e-3)
