"""Recordings, saved files and plots of a rollout made by hand, without physics."""

import dataclasses
import re
from fnmatch import fnmatch

import judges
import matplotlib
import msgpack
import numpy as np
import pytest
from messages import raises, refused
from numpy.testing import assert_allclose, assert_array_equal

import floatbase as fb
from floatbase.dynamics import Contacts, LinearConstraint, fixed_frame, rigid_between
from floatbase.errors import InputError, UnknownNameError, ViewerError
from floatbase.viewer import Viewer, plots
from floatbase.viewer.export import recording
from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.colours import ALARM, CONE, CONE_ALPHA

from .looks import SMALL, picture, settle, vertices

matplotlib.use("agg")


def record(robot, duration=2.0, walk=0.0):
    """The robot sways and leans harder on its front left foot, at 1 kHz; that foot slips in the
    middle and is pushed.
    """
    state, contacts = robot.standing(), on_its_feet(robot)
    time = np.arange(0.0, duration, 1e-3)
    q = np.tile(state.q, (time.size, 1))
    q[:, 1] += 0.03 * np.sin(2 * np.pi * time)
    q[:, 0] += walk * time
    forces = np.zeros((time.size, contacts.n_points, 3))
    forces[:, :, 2] = robot.weight / contacts.n_points
    forces[:, 0, 2] *= 1 + 0.5 * np.sin(2 * np.pi * time)
    slips = (time > 0.8) & (time < 1.2)
    forces[slips, 0, 0] = 0.9 * forces[slips, 0, 2]
    forces[time > 1.5, -1] = 0.0
    flat = forces.reshape(time.size, contacts.k)
    zeros = np.zeros((time.size, robot.d))
    feet = np.tile(contacts.positions(state), (time.size, 1, 1))
    return fb.Rollout(
        robot, contacts, time, q, np.zeros((time.size, robot.nv)), zeros, zeros, flat, flat, feet,
        (fb.Push([0.0, 30.0, 0.0], start=0.3, duration=0.2),), "completed",
    )  # fmt: skip


def tracks(viewer):
    """Return times and values of every track in the scene."""
    found = {}
    for clip in viewer.window.scene.commands()["/", "set_animation", ""]["animations"]:
        for track in clip["clip"]["tracks"]:
            times, values = (numbers(track[name]) for name in ("times", "values"))
            key = clip["path"].removeprefix("/meshcat/"), track["name"]
            found[key] = times, values.reshape(times.size, -1)
    return found


def numbers(packed):
    is_packed = isinstance(packed, msgpack.ExtType)
    return np.frombuffer(packed.data, "<f4") if is_packed else np.array(packed)


def test_a_rollout_brings_its_stairs_unless_the_viewer_has_a_ground(viewer, go2, standing):
    stairs = fb.Ground.stairs(2, 0.1, 0.3, 0.5)
    sim = fb.Simulation(go2, stairs)
    controller = fb.WholeBodyController(go2, fb.Contacts.feet(go2), fb.standing_tasks(standing))
    run = fb.rollout(sim, controller, 0.01)
    assert run.ground is stairs
    viewer.play(run)
    assert len(viewer.painter.drawn_ground.boxes) == len(stairs.boxes)
    viewer.set_ground([0.0, 0.0, 1.0])
    viewer.play(run)
    assert not hasattr(viewer.painter.drawn_ground, "boxes")


def test_a_record_with_a_constraint_that_has_no_points_plays_without_it(viewer, go2):
    made = record(go2, 0.2)
    held = LinearConstraint("held", 2, lambda state, t: (np.eye(2, go2.nv), np.zeros(2)))
    forces = np.hstack([made.measured, np.full((len(made), 2), np.nan)])
    contacts = made.contacts + Contacts([held])
    viewer.play(dataclasses.replace(made, contacts=contacts, measured=forces, planned=forces))
    drawn = {path for path in viewer.renderer.picture if path.startswith("measured/")}
    assert drawn == {f"measured/{name}" for name in made.contacts.names}


def test_the_ground_of_a_record_moves_and_takes_its_boxes_and_projections_along(viewer, go2):
    made = record(go2, 0.2)
    path = np.outer(np.linspace(0.0, 1.0, len(made)), [0.3, -0.2, 0.1])
    ground = fb.Ground.stairs(1, 0.1, start=0.5)
    viewer.play(dataclasses.replace(made, ground=ground, ground_position=path), follow=False)
    moving = tracks(viewer)
    for item in ("ground", "terrain/faces", "scale/label"):
        times, places = moving[item, ".position"]
        rows = np.round(times / 1e-3).astype(int)
        assert_allclose(places - places[0], path[rows], atol=1e-6)
    assert_allclose(moving["com/projection", ".position"][1][:, 2], path[rows, 2], atol=1e-6)
    assert_allclose(moving["com/ball", ".position"][1], made.com[rows], atol=1e-6)
    viewer.show(made.state(0), ground_position=path[-1])
    assert_allclose(viewer.renderer.picture["ground"].matrix[:3, 3], path[-1])


def test_fixed_frames_and_rigid_connections_have_arrows_at_their_first_frames(viewer, go2):
    made = record(go2, 0.2)
    pair = rigid_between("FL_calf", "FR_calf"), fixed_frame("base")
    wrenches = np.array([10.0, 20.0, 30.0, 1.0, 1.0, 1.0, 0.0, 0.0, 50.0, 1.0, 1.0, 1.0])
    measured = np.hstack([made.measured, np.tile(wrenches, (len(made), 1))])
    planned = np.where(np.arange(measured.shape[1]) < 15, np.nan, measured)
    contacts = made.contacts + Contacts(pair)
    run = dataclasses.replace(made, contacts=contacts, measured=measured, planned=planned)
    viewer.play(run)
    assert f"planned/{pair[1].name}" in viewer.renderer.picture
    viewer.show(run.state(0), contacts, measured[0])
    for each, frame, force in zip(pair, ("FL_calf", "base"), wrenches.reshape(2, 6), strict=True):
        arrow = viewer.renderer.picture[f"measured/{each.name}"].matrix
        assert_allclose(arrow[:3, 2], viewer.scale * force[:3])
        assert_allclose(arrow[:3, 3], run.state(0).point(frame))


def test_a_record_is_thinned_to_thirty_pictures_a_second():
    rows = recording.sampled_rows(np.arange(0.0, 2.0, 1e-3), 30.0)
    assert rows[0] == 0 and rows[-1] == 1999
    assert 60 <= rows.size <= 62
    assert list(recording.sampled_rows([0.0], 30.0)) == [0]


def test_the_robot_and_its_forces_move_as_recorded(viewer, go2):
    rollout = record(go2)
    viewer.play(rollout)
    moving = tracks(viewer)
    times, positions = moving["robot/root_joint", ".position"]
    rows = np.round(times / 1e-3).astype(int)
    assert_allclose(positions, rollout.q[rows, :3], atol=1e-5)
    _, scales = moving["measured/FL_foot", ".scale"]
    expected = viewer.scale * np.linalg.norm(rollout.measured[rows, :3], axis=1)
    assert_allclose(scales[:, 2], expected, rtol=1e-4)
    assert times[-1] == pytest.approx(rollout.time[-1])


def test_a_cone_turns_to_alarm_while_its_foot_slips_and_a_force_that_ends_is_hidden(viewer, go2):
    viewer.play(record(go2))
    moving = tracks(viewer)
    times, colours = moving["cone/FL_foot/surface", "shape.material.color"]
    slips = ((times > 0.8) & (times < 1.2))[:, None]
    assert_allclose(colours, np.where(slips, CONE["outside"], CONE["inside"]), atol=1e-6)
    times, faint = moving["cone/RR_foot/surface", "shape.material.opacity"]  # its force ends
    expected = np.where(times <= 1.5, CONE_ALPHA["inside"], CONE_ALPHA["idle"])
    assert_allclose(faint[:, 0], expected, atol=1e-6)
    times, visible = moving["measured/RR_foot", ".visible"]
    assert_array_equal(visible[:, 0], times <= 1.5)
    times, pushed = moving["push", ".visible"]
    assert_array_equal(pushed[:, 0], (times >= 0.3 - 1e-6) & (times < 0.5 - 1e-6))


def test_a_foot_that_swings_has_no_cone_but_its_measured_force(viewer, go2):
    rollout = record(go2)
    swings = (rollout.time > 0.4) & (rollout.time < 1.0)
    stance = rollout.contacts.without("FL_foot")
    stances = tuple(stance if away else rollout.contacts for away in swings)
    viewer.play(dataclasses.replace(rollout, stances=stances), support=True)
    moving = tracks(viewer)
    for part in ("cone/FL_foot/surface", "patch/FL_foot"):
        times, visible = moving[part, ".visible"]
        assert_array_equal(visible[:, 0], (times < 0.4 + 1e-6) | (times > 1.0 - 1e-6))
    always = {("cone/FR_foot/surface", ".visible"), ("measured/FL_foot", ".visible")}
    assert not always & moving.keys()
    regions = [path for path in viewer.renderer.picture if path.startswith("support")]
    n_corners = {len(vertices(viewer.renderer.picture[path])) for path in regions}
    assert {3, 4} <= n_corners


def test_quaternions_do_not_jump(go2, viewer):
    rollout = record(go2)
    half = 2 * np.pi * rollout.time / rollout.time[-1]
    q = np.array(rollout.q)
    q[:, 3:7] = np.stack([0 * half, 0 * half, np.sin(half), np.cos(half)], axis=1)
    viewer.play(dataclasses.replace(rollout, q=q))
    _, quaternions = tracks(viewer)["robot/root_joint", ".quaternion"]
    assert np.abs(np.diff(quaternions, axis=0)).max() < 0.2


def test_facets_that_light_up_become_tracks(go2):
    viewer = Viewer(go2, facets=4)
    viewer.play(record(go2))
    lit = {path for path, name in tracks(viewer) if "facet" in path and name == ".visible"}
    assert lit == {"cone/FL_foot/facet 0"}
    viewer.close()


def test_the_next_picture_ends_the_animation_and_leaves_nothing_of_it(viewer, go2, standing):
    def drawn():
        commands = viewer.window.scene.commands().items()
        return {key: value for key, value in commands if key[0].startswith("/meshcat")}

    viewer.show(standing)
    before = drawn()
    viewer.play(record(go2))
    viewer.show(standing)
    assert viewer.window.scene.commands()["/", "set_animation", ""]["animations"] == []
    assert drawn() == before


def on_its_feet(robot):
    make = Contacts.flat_feet if robot.feet and robot.feet[0].is_flat else Contacts.points
    return make(robot, mu=0.6) if robot.feet else Contacts.none()


@pytest.mark.parametrize("robot", judges.sampled(fb.catalogue(), "talos"), indirect=True)
def test_a_robot_saves_to_less_than_a_megabyte_and_ten_seconds_to_less_than_two(robot, tmp_path):
    viewer, contacts = Viewer(robot), on_its_feet(robot)
    n = contacts.n_points
    forces = np.tile([0.0, 0.0, robot.weight / max(n, 1)], (n, 1))
    viewer.show(robot.standing(), contacts, forces, forces, support=n > 2, title=robot.name)
    saved = viewer.save(tmp_path / "still.html")
    assert saved.stat().st_size < 1e6
    assert re.findall(r"(?:src|href)=\"(?!data:).*?\"", saved.read_text()) == []
    if robot.feet:
        viewer.play(record(robot, duration=10.0), support=True)
        assert viewer.save(tmp_path / "moving.html").stat().st_size < 2e6
    viewer.close()


def test_wrong_records_and_file_names_are_refused(viewer, go2, standing, tmp_path):
    refused(lambda: viewer.play(record(fb.load("solo12"))), InputError, "go2", "solo12")
    refused(lambda: viewer.play(record(go2, duration=0.0)), InputError)
    refused(lambda: viewer.play(record(go2), speed=0), InputError, "speed", 0)
    refused(lambda: viewer.save(tmp_path / "x.html"), ViewerError, "show", "play")
    assert not (tmp_path / "x.html").exists()
    viewer.show(standing)
    refused(lambda: viewer.save(tmp_path / "x.svg"), ViewerError, "x.svg", "html")
    refused(lambda: viewer.save(tmp_path / "nowhere" / "x.html"), ViewerError, "nowhere/x.html")


def test_a_saved_animation_plays_from_disk_without_network(page, viewer, go2, tmp_path):
    rollout = record(go2)
    viewer.play(rollout, paused=True, title="saved")
    viewer.close()
    saved = tmp_path / "moving.html"
    saved.write_text(viewer.static_html())
    page.set_viewport_size(SMALL)
    page.context.set_offline(True)
    frame = tmp_path / "frame.html"
    frame.write_text('<iframe src="moving.html" style="width: 100%; height: 95vh"></iframe>')
    for address in (saved, frame):
        page.goto(address.as_uri())
        inside = page.frames[-1]
        inside.wait_for_function(RECORDED)
        expected = rollout.time[-1]
        assert inside.evaluate("viewer.animator.duration") == pytest.approx(expected, abs=1e-3)
        slider = inside.locator("#player input")
        slider.evaluate("(node) => { node.value = 0.25; node.dispatchEvent(new Event('input')); }")
        where = inside.evaluate(
            "viewer.scene_tree.find(['meshcat', 'robot', 'root_joint']).object.position.toArray()"
        )
        assert_allclose(where, rollout.q[250, :3], atol=1e-3)
    page.context.set_offline(False)
    inside.wait_for_function("!viewer.needs_render")
    picture(page, "saved_animation")
    inside.locator("#player button").click()
    inside.wait_for_function("viewer.animator.playing && viewer.animator.time > 0.3")
    inside.locator("#player select").select_option("0.25")
    assert inside.evaluate("viewer.animator.mixer.timeScale") == 0.25


RECORDED = "window.viewer && viewer.animator.duration > 0"
TARGET = "viewer.controls.target.toArray()"
STEP = 0.01  # m: what the eye does not see in a page that follows a robot through metres


def test_the_camera_goes_with_the_robot(page, viewer, go2, standing):
    page.set_viewport_size(SMALL)
    viewer.play(record(go2, walk=1.0), paused=True)
    page.goto(viewer.url)
    settle(page)
    page.wait_for_function(RECORDED)
    before = page.evaluate(TARGET)
    page.evaluate("viewer.animator.seek(1.5)")
    page.wait_for_function("!viewer.needs_render")
    after = page.evaluate(TARGET)
    assert after[0] - before[0] == pytest.approx(1.5, abs=STEP) and after[1] == before[1]

    viewer.show(standing).camera(follow=True)
    viewer.show(standing, title="still")  # the page has the camera when it has the title
    settle(page, "still")
    before = page.evaluate(TARGET)
    viewer.draw({})
    q = standing.q.copy()
    for moved in (0.1, 0.4):
        q[0] = standing.q[0] + moved
        viewer.show(fb.State(go2, q), title=f"{moved}")
        settle(page, f"{moved}")
    after = page.evaluate(TARGET)
    assert after[0] - before[0] == pytest.approx(0.4, abs=STEP)


def leaning(viewer, state, contacts, tangents):
    """Pictures of forces that lean forwards by so much of their normal part."""
    quarter = viewer.robot.weight / 4
    forces = [np.tile([tangent * quarter, 0.0, quarter], (4, 1)) for tangent in tangents]
    return [viewer.painter.picture(state, contacts, force) for force in forces]


# the page answers "done" when it has drawn; a page whose answer is withheld is busy for the window
WITHHOLD = """() => {
  const send = WebSocket.prototype.send;
  WebSocket.prototype.send = function (message) {
    window.release = () => { WebSocket.prototype.send = send; send.call(this, message); };
  };
}"""


@pytest.mark.front_end
def test_a_busy_page_shows_the_second_record_as_it_is(page, viewer, standing, contacts):
    page.set_viewport_size(SMALL)
    viewer.play_pictures(
        [0, 1, 2], leaning(viewer, standing, contacts, [0.0, 0.6, 0.0]), paused=True
    )
    page.goto(viewer.url)
    page.wait_for_function(RECORDED)
    page.evaluate("viewer.animator.seek(1.0)")
    page.evaluate(WITHHOLD)
    # the page is busy with this one
    viewer.window.put([protocol.set_property("/Grid", "visible", True)])
    page.wait_for_function("Boolean(window.release)")
    viewer.play_pictures([0, 1], leaning(viewer, standing, contacts, [0.9, 0.9]), title="second")
    page.evaluate("release()")
    settle(page, "second")
    cone, arrow = page.evaluate(
        """() => ["cone/FL_foot/surface", "measured/FL_foot"].map((path) =>
          viewer.scene_tree.find(["meshcat", ...path.split("/")]).object)
          .map((node) => [node.children.concat(node).find((o) => o.material), node.scale.z])
          .map(([drawn, length]) => [drawn.material.color.toArray(), length])"""
    )
    assert_allclose(cone[0], ALARM, atol=1e-3)
    length = viewer.scale * 0.25 * viewer.robot.weight * np.hypot(0.9, 1.0)
    assert arrow[1] == pytest.approx(length, rel=1e-3)


def test_plots_show_the_record(go2):
    rollout = record(go2)
    used = plots.friction_used(rollout, rollout.measured)
    assert used[0, 1000] == pytest.approx(0.9 / 0.6) and used[1, 1000] == 0.0
    assert np.isnan(used[3, -1])
    forces = plots.plot_forces(rollout)
    curves = {line.get_label(): line.get_ydata() for line in forces.lines}
    assert_allclose(curves["FL_foot"], rollout.measured[:, 2])
    matplotlib.pyplot.close("all")


def labels(axis):
    return [text.get_text() for text in axis.get_legend().get_texts()]


@pytest.mark.parametrize(
    "select, plotted",
    [
        ([], ["displacement", "normal", "friction", "torque"]),
        (["torques"], ["torque"]),
        (["R*_foot"], ["normal", "friction"]),
        (["com", "FL_*"], ["displacement", "normal", "friction", "torque"]),
        (["forces", "FR_foot", "*_hip_joint"], ["normal", "torque"]),
    ],
)
def test_plots_show_what_is_selected(go2, select, plotted):
    rollout = record(go2, 0.1)
    axes = plots.plot_run(rollout, select).axes
    assert [axis.get_ylabel().split()[0] for axis in axes] == plotted
    for axis in axes:
        names = {*rollout.contacts.names, *go2.joint_names}
        for name in names & {*labels(axis)}:
            chosen = [pattern for pattern in select if "_" in pattern]
            assert not chosen or any(fnmatch(name, pattern) for pattern in chosen)
    matplotlib.pyplot.close("all")


def test_plots_name_the_joints_nearest_to_their_limits_and_both_records(go2):
    one = record(go2, 0.1)
    tau = np.zeros((len(one), 12))
    tau[5:, 4], tau[5:, 9] = 0.5 * go2.torque_limits[4], -0.7 * go2.torque_limits[9]
    axis = plots.plot_torques(dataclasses.replace(one, tau=tau))
    assert {go2.joint_names[4], go2.joint_names[9]} < {*labels(axis)}
    assert "6 others, up to 0 %" in labels(axis) and len(axis.lines) >= 12
    axes = plots.plot_run(
        {"stiff": one, "soft": dataclasses.replace(one, tau=tau)}, ["forces", "com"]
    ).axes
    for axis in axes:
        assert {"stiff", "soft"} < {*labels(axis)} and "planned" not in labels(axis)
    for wrong, kind in (("FL_foot", InputError), (["FL_foo"], UnknownNameError)):
        with raises(kind, "FL_foot"):
            plots.plot_run(one, wrong)
    for wrong in ({}, {"one": 3}, {3: one}, 3):
        with pytest.raises(InputError):
            plots.plot_run(wrong)
    matplotlib.pyplot.close("all")


def test_the_sole_of_a_humanoid_is_one_curve_and_its_friction_that_of_the_worst_corner():
    rollout = record(judges.load("talos"), 1.0)
    foot = rollout.contacts.names[0]
    curves = [
        {line.get_label(): line.get_ydata() for line in plot(rollout).lines}[foot]
        for plot in (plots.plot_forces, plots.plot_friction)
    ]
    assert_allclose(curves[0], rollout.force(foot)[:, 2])
    assert curves[1].max() == pytest.approx(0.9 / rollout.contacts.mus[0])
    matplotlib.pyplot.close("all")
