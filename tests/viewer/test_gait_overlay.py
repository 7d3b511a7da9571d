"""Gait overlay and the camera that follows a walk."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from messages import raises, refused
from numpy.testing import assert_allclose, assert_array_equal

import floatbase as fb
from floatbase.behaviours import Gait, StepPlan, Walk, capture_point
from floatbase.dynamics import Contacts
from floatbase.errors import InputError, UnknownNameError
from floatbase.robots import Robot, State
from floatbase.simulation import Rollout, Simulation
from floatbase.viewer import Item, Viewer
from floatbase.viewer.export import recording
from floatbase.viewer.scene.colours import COM, CONE, GREYS, LEGEND, MEASURED, PLANNED, hex_code

ROUNDED = 1e-9  # m: the same place, computed in another order
POINTS = 1e-4  # of a curve's size: vertices of lines are in single precision
SWING, START = 0.2, 0.3  # s


@pytest.fixture(scope="module")
def walked(go2: Robot) -> tuple[Rollout, Walk]:
    """Return a trot of go2 with four swings; two feet are in the air at the end of the record."""
    contacts = Contacts.feet(go2, mu=0.6)
    walk = Walk(go2, contacts, Gait.trot(go2, swing=SWING, start=START), velocity=(0.2, 0.0))
    push = fb.Push([0.0, 40.0, 0.0], start=0.5)
    return fb.rollout(
        Simulation(go2), walk, START + 4.5 * SWING, pushes=[push], control_period=2e-3
    ), walk


@pytest.fixture(scope="module")
def biped() -> tuple[Rollout, Walk]:
    """Return a walk of talos that turns left; one foot is in the air at the end of the record."""
    robot = fb.load("talos")
    walk = Walk(
        robot,
        Contacts.feet(robot, mu=0.6),
        Gait.walk(robot, start=0.1),
        velocity=(0.2, 0.0),
        yaw_rate=0.4,
    )
    return fb.rollout(Simulation(robot), walk, 0.4, control_period=4e-3), walk


def vertices(item: Item) -> np.ndarray:
    """Return the vertices of an item, (n, 3), in the world frame [m]."""
    (packed,) = item.shape.data["geometries"]
    raw = packed["data"]["attributes"]["position"]
    unit = np.frombuffer(
        raw["array"].data, "<f4" if raw["type"] == "Float32Array" else "<i2"
    ).reshape(-1, 3)
    return (
        unit * item.shape.data["object"]["matrix"][0] @ item.matrix[:3, :3].T + item.matrix[:3, 3]
    )


def test_marks_are_where_the_walk_plans(viewer, walked):
    run, walk = walked
    state, look = run.final, viewer.walk_overlay(walk, run.final)
    assert walk.plan is not None and walk.time == run.time[-1]
    swinging = set(walk.contacts.names) ^ set(run.contacts.names)
    assert len(swinging) == 2
    assert set(look) == {"dcm", "zmp"} | {f"foothold/{f}" for f in walk.footholds} | {
        f"swing/{f}" for f in swinging
    }
    expected = capture_point(state.com, state.com_velocity, walk.omega)
    assert_allclose(look["dcm"].matrix[:2, 3], expected, atol=ROUNDED)
    assert_allclose(look["zmp"].matrix[:2, 3], walk.plan.zmp(walk.time), atol=ROUNDED)
    for foot, place in walk.footholds.items():  # go2's frames are in the middles of its balls
        ring = look[f"foothold/{foot}"]
        assert_allclose(ring.matrix[:2, 3], place[:2], atol=ROUNDED)
        assert (
            0.0
            < ring.matrix[2, 3] - (place[2] - run.robot.feet[0].radius)
            < 0.01 * viewer.painter.size
        )
        # seen around the foot
        assert np.linalg.norm(ring.matrix[:3, 0]) > 1.5 * run.robot.feet[0].radius


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
    shapes = {path: item.shape for path, item in viewer.renderer.picture.items()}
    # the capture point is elsewhere, and so the picture of the same step differs
    other = run.state(-20)
    viewer.show(
        other,
        walk.contacts,
        extra=viewer.step_overlay(walk.history[-1], float(run.time[-20]), other),
    )
    now = viewer.renderer.picture
    assert all(now[path].shape is shapes[path] for path in now)
    assert (
        np.abs(
            now["dcm"].matrix[:2, 3] - viewer.walk_overlay(walk, run.final)["dcm"].matrix[:2, 3]
        ).max()
        > 1e-4
    )


def test_a_stored_step_is_drawn_as_it_was_planned(viewer, walked):
    run, walk = walked
    step, t = walk.history[2], walk.history[2].time + 0.1
    row = int(np.searchsorted(run.time, t - 1e-9))
    look = viewer.step_overlay(step, t, run.state(row))
    assert set(step.swings) == set(run.contacts.names) - set(step.stance) and len(step.swings) == 2
    assert {path for path in look if path.startswith("swing/")} == {
        f"swing/{foot}" for foot in step.swings
    }
    assert_allclose(look["zmp"].matrix[:2, 3], step.plan.zmp(t), atol=ROUNDED)
    for foot, place in step.footholds.items():
        assert_allclose(look[f"foothold/{foot}"].matrix[:2, 3], place[:2], atol=ROUNDED)


def test_a_walk_has_no_marks_before_its_first_control_step(viewer, go2, standing):
    walk = Walk(go2, Contacts.feet(go2), Gait.trot(go2))
    assert viewer.walk_overlay(walk, standing) == {} and walk.time is None


def test_soles_are_outlined_with_position_and_rotation_at_touchdown(biped):
    run, walk = biped
    viewer = Viewer(run.robot)
    try:
        look = viewer.walk_overlay(walk, run.final)
        (foot,) = walk.swings
        outline = vertices(look[f"foothold/{foot}"])
        corners = run.robot.feet[0].corners[:, :2]
        middle = outline[:, :2].mean(axis=0)
        # m: the sole's frame is in its middle
        assert_allclose(middle, walk.footholds[foot][:2], atol=1e-3)
        radii = np.linalg.norm(outline[:4, :2] - middle, axis=1)
        # vertices are 16-bit numbers
        assert_allclose(radii, np.linalg.norm(corners, axis=1), atol=1e-3)
        x, y = look[f"foothold/{foot}"].matrix[:2, 0]
        left = walk.yaw_rate * (walk.swings[foot].touchdown - walk.time)
        base = run.final.frame_pose("base").rotation
        assert np.arctan2(y, x) == pytest.approx(np.arctan2(base[1, 0], base[0, 0]) + left)
    finally:
        viewer.close()


def test_marks_have_legend_entries_and_no_colour_of_a_force_or_a_cone(viewer, walked):
    run, walk = walked
    viewer.show(
        run.final, walk.contacts, extra=viewer.walk_overlay(walk, run.final), title="go2 trots"
    )
    items = viewer.window.scene.commands()["/", "set_legend", ""]["items"]
    shown = {text: (colour, symbol) for colour, text, symbol in items}
    assert shown["capture point"] == (hex_code(COM), "ring")
    assert shown["centre of mass"] == (hex_code(COM), "disc")
    assert shown["planned ZMP"] == (hex_code(viewer.painter.text_colour), "diamond")
    assert shown["planned foothold"] == (hex_code(GREYS[1]), "ring") and "swing path" in shown
    assert len({*shown.values()}) == len(shown)  # two of one colour differ in their symbol
    kinds = {key: colour for key, colour, _ in LEGEND if key in ("dcm", "zmp", "foothold", "swing")}
    assert len(kinds) == 4 and not {MEASURED, PLANNED, *CONE.values()} & set(kinds.values())


def test_invalid_overlays_are_refused_by_name(viewer, walked):
    run, walk = walked
    refused(lambda: viewer.walk_overlay(None, run.final), InputError, "walk", "Walk", "None")
    with raises(InputError, "go2", "solo12"):
        viewer.walk_overlay(walk, fb.load("solo12").standing())
    with raises(InputError, "step", "StepPlan", "Walk"):
        viewer.step_overlay(walk, 0.0, run.final)
    with raises(UnknownNameError, "go2", "paw"):
        viewer.step_overlay(renamed(walk.history[1]), 0.0, run.final)
    with raises(InputError, "t", np.nan):
        viewer.step_overlay(walk.history[1], np.nan, run.final)
    refused(lambda: viewer.play(run, steps=walk), InputError, "steps", "Walk", "walk.history")
    refused(lambda: viewer.play(run, steps=[run]), InputError, "step", "StepPlan", "Rollout")


def renamed(step: StepPlan) -> StepPlan:
    return dataclasses.replace(step, footholds={"paw": np.zeros(3)})


def test_a_recorded_walk_plays_with_its_marks(viewer, walked):
    run, walk = walked
    viewer.play(run, steps=walk.history)
    (command,) = (
        c for (_, kind, _), c in viewer.window.scene.commands().items() if kind == "set_animation"
    )
    tracks = {
        (clip["path"], track["name"]): track
        for clip in command["animations"]
        for track in clip["clip"]["tracks"]
    }
    # after standing: one pair lifts, then the other
    first, second = (walk.history[1], walk.history[2])
    for foot in first.swings:
        track = tracks[f"/meshcat/swing/{foot}", ".visible"]
        times, seen = np.array(track["times"]), np.array(track["values"])
        assert seen[(times >= first.time) & (times < second.time)].all()
        assert not seen[times < first.time].any()
    assert ("/meshcat/dcm", ".position") in tracks
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
    viewer.show(State(viewer.robot, q))
    lines = vertices(viewer.renderer.picture["ground"])
    low, high = lines.min(axis=0), lines.max(axis=0)
    assert (low[:2] < q[:2] - 3.0).all() and (high[:2] > q[:2] + 3.0).all()
    # the same lines
    assert_allclose(lines[:, :2] / 0.25, np.round(lines[:, :2] / 0.25), atol=1e-3)
