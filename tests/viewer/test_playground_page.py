"""The playground in a browser: every control at both ends, the challenges and the texts.

It is also tested as a notebook shows it.
"""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from messages import raises, refused
from numpy.testing import assert_allclose
from PIL import Image
from waiting import until

import floatbase as fb
from floatbase.errors import FloatbaseError, InputError, UnknownNameError
from floatbase.playground import CHALLENGES, Playground, Settings, mean_force_error, playground

from .looks import control, eventually, picture

pytestmark = pytest.mark.front_end

ENDS = """() => {
  for (const input of document.querySelectorAll('#panel input[type=range]'))
    for (const end of [input.min, input.max]) {
      input.value = end;
      input.dispatchEvent(new Event('input'));
    }
}"""


def opened(page, field):
    page.goto(field.url)
    page.wait_for_function("window.viewer && viewer.gui_controllers['show cones']")


def test_every_control_can_be_moved_to_both_ends(page, field):
    opened(page, field)
    page.evaluate(ENDS)
    for which in ("#panel input[type=checkbox]", "#board button", "#panel .buttons button"):
        for i in range(page.locator(which).count()):
            page.evaluate("([which, i]) => document.querySelectorAll(which)[i].click()", [which, i])
            page.wait_for_timeout(30)
    for select in page.locator("#panel select").all():
        for option in range(select.locator("option").count()):
            select.select_option(str(option), force=True)
            page.wait_for_timeout(30)
    picture(page, "playground_ends")
    control(page, "challenge", "setValue(0)")
    control(page, "reset everything", "fire()")
    eventually(page, lambda: field.run.status == "running" and 0.3 < field.session.sim.time < 30.0)
    assert field.session.settings.friction == (0.7, 0.7) and field.session.refusal == ""
    page.wait_for_function("viewer.gui_controllers['friction μ model'].getValue() == 0.7")


def test_the_push_slider_pushes_when_it_is_released(page, field):
    opened(page, field)
    box = page.locator("input[aria-label='push [N]']").bounding_box()
    y = box["y"] + 0.5 * box["height"]
    page.mouse.move(box["x"] + 0.3 * box["width"], y)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.1 * box["width"], y, steps=4)
    page.wait_for_timeout(300)
    assert field.last_push is None
    page.mouse.up()
    eventually(page, lambda: field.last_push is not None)
    assert field.last_push.force[1] == field.force > 0.0
    field.last_push = None
    control(page, "push [N]", "release(0)")
    eventually(page, lambda: field.force == 0.0)
    assert field.last_push is None


def test_the_robot_is_pushed_by_dragging_it(page, field):
    opened(page, field)
    page.wait_for_timeout(500)
    # the middle of the base on the page, and the same point moved in the direction of +y
    pixels = """(ahead) => {
      const {Vector3} = MeshCat.THREE, {camera, renderer, scene_tree} = viewer;
      const robot = scene_tree.find(['meshcat', 'robot']).object;
      const at = new MeshCat.THREE.Box3().setFromObject(robot).getCenter(new Vector3());
      at.y += 0.05;
      at.z -= ahead;
      const {x, y} = at.project(camera);
      const {left, top, width, height} = renderer.domElement.getBoundingClientRect();
      return [left + width * (1 + x) / 2, top + height * (1 - y) / 2];
    }"""
    (x, y), (ahead_x, ahead_y) = page.evaluate(pixels, 0.0), page.evaluate(pixels, 0.2)
    view = page.evaluate("viewer.camera.position.toArray()")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(ahead_x, ahead_y, steps=5)
    assert field.last_push is None
    page.mouse.up()
    eventually(page, lambda: field.last_push is not None)
    assert 60.0 <= field.towards <= 120.0 and field.force > 20.0
    assert page.evaluate("viewer.camera.position.toArray()") == pytest.approx(view, abs=0.05)


@pytest.mark.parametrize("size", [(1200, 700), (390, 780)])
def test_the_buttons_stay_visible_in_a_panel_that_is_scrolled(page, field, size):
    page.set_viewport_size({"width": size[0], "height": size[1]})
    opened(page, field)
    page.evaluate("document.querySelectorAll('#panel summary').forEach((one) => one.click())")
    page.evaluate("() => { document.getElementById('panel').scrollTop = 600; }")
    page.locator("#panel .head button", has_text="pause").click()
    eventually(page, lambda: field.run.status == "paused")


def test_a_challenge_is_started_and_solved(page, field):
    opened(page, field)
    panel = "document.getElementById('panel').textContent"
    number = CHALLENGES.index(challenge("How many facets?"))
    control(page, "challenge", f"setValue({number + 1})")
    page.wait_for_function(f"{panel}.includes('4 facets: the weakest')")
    control(page, "facets", "setValue(13)")
    page.wait_for_function(f"{panel}.includes('Solved')")
    assert "facets=13" in page.evaluate("document.querySelector('#panel pre').textContent")
    picture(page, "playground_solved")


def challenge(title):
    return next(challenge for challenge in CHALLENGES if challenge.title == title)


def test_a_wrong_mass_lowers_the_robot_and_the_right_one_lifts_it(page, field):
    """The plan lacks 0.5 m g. The CoM task makes up for it at an error of 0.5 g / kp = 49 mm."""
    opened(page, field)

    def sunk():
        return float(field.robot.standing().com[2] - field.session.sim.state.com[2])

    control(page, "mass [%] reality", "setValue(150)")
    eventually(page, lambda: abs(sunk() - 0.049) < 0.01)
    program = "document.querySelector('#panel pre').textContent"
    page.wait_for_function(f"{program}.includes('Perturbation(mass=1.5)')")
    control(page, "mass [%] model", "setValue(150)")
    eventually(page, lambda: abs(sunk()) < 0.01)
    assert mean_force_error(field.session.last) < 0.5 * field.robot.weight


def test_a_notebook_shows_and_runs_the_playground():
    with closing(playground("solo12")) as shown:
        assert "image/png" in shown._repr_mimebundle_()[0]
        until(lambda: shown.session.last is not None)
        assert shown.robot.name == "solo12" and isinstance(shown.session.last, fb.Rollout)


def test_a_push_after_a_fall_is_seen_by_the_new_judge(field):
    """The push puts the robot back on its feet, which starts a new judge."""
    field.start_challenge(challenge("The weakest side"))
    until(lambda: field.session.last is not None and field.session.last.time[-1] < 1.0)
    for size in (240.0, 220.0):
        field.push(size, 90.0)
        until(lambda seen=size: field.judge.largest_push == seen and field.run.status == "fell")
        until(lambda seen=size: f"{0.1 * seen:.1f} N·s toppled" in field.judge.message)


def test_challenges_can_be_changed_during_a_run(field):
    for chosen in (CHALLENGES[0], None, *CHALLENGES[6:9], None):
        field.start_challenge(chosen)
        before = field.session.sim.time
        until(lambda start=before: field.session.sim.time != start)
        until(lambda: field.run.status == "running")
    assert field.run.error is None


def test_a_paused_challenge_continues_with_run(field):
    icy = challenge("Down an icy slope")
    assert [chosen for chosen in CHALLENGES if chosen.paused] == [icy]
    field.start_challenge(icy)
    until(lambda: field.session.settings.slope == icy.start.slope and field.run.status == "paused")
    assert field.session.sim.time < 0.1
    field.run.start()
    until(lambda: field.session.sim.time > 0.2)


def test_reset_everything_includes_the_push_the_speed_and_the_terms(page, field):
    first = (field.force, field.towards)
    changes = {
        "speed [×]": 0.1, "push [N]": 200, "duration [s]": 0.3, "show forces": "false",
        "show gravity": "true",
    }  # fmt: skip

    def shown():
        opened(page, field)
        return [page.evaluate(f"viewer.gui_controllers['{name}'].getValue()") for name in changes]

    before = shown()
    for name, value in changes.items():
        control(page, name, f"setValue({value})")
    eventually(page, lambda: "term gravity/m g" in field.view.renderer.picture)
    control(page, "reset everything", "fire()")
    eventually(page, lambda: "measured/FL_foot" in field.view.renderer.picture)
    eventually(page, lambda: (field.force, field.towards) == first and shown() == before)
    assert "term gravity/m g" not in field.view.renderer.picture


def test_an_unknown_setting_is_refused_and_the_run_continues(field):
    with raises(UnknownNameError, "frction"):
        field.set(frction=(0.5, 0.5))
    field.run.pause()
    field.set(facets=6)  # while its last slice may still run
    assert field.session.settings.facets == 6 and field.run.status == "paused"


def test_undo_restores_the_settings_before_the_last_change(go2):
    """Steps of one drag are one change, and a refused change is none."""
    with closing(Playground(go2)) as paused:
        first = paused.session.settings
        for value in (0.6, 0.5, 0.4):
            paused.set(friction=(value, 0.7))
        paused.set(mass=(1.0, 1.5), facets=6)
        paused.set(lifted_feet=("paw",))
        for expected in (replace(first, friction=(0.4, 0.7)), first, first):
            paused.undo()
            assert paused.session.settings == expected and paused.session.refusal == ""
        paused.set(slope=(0.0, 5.0))
        paused.reset_all()
        paused.undo()  # a reset of everything forgets the changes before it
        until(lambda: paused.session.settings == first)


def test_ctrl_z_undoes_a_change_of_the_page(page, field):
    opened(page, field)
    value = "viewer.gui_controllers['facets'].getValue()"
    before = page.evaluate(value)
    control(page, "facets", "setValue(7)")
    eventually(page, lambda: field.session.settings != Settings())
    page.keyboard.press("Control+z")
    eventually(page, lambda: field.session.settings == Settings())
    page.wait_for_function(f"{value} == {before}")


def test_the_address_has_the_settings_and_sets_them(page, field):
    def has(**settings):
        return all(getattr(field.session.settings, name) == v for name, v in settings.items())

    opened(page, field)
    assert page.evaluate("location.hash") == ""
    control(page, "facets", "setValue(7)")
    control(page, "lift front left foot", "setValue(true)")
    control(page, "speed [×]", "setValue(0.5)")
    hash_is = "text => decodeURIComponent(location.hash) == `#speed+[×]=0.5${text}&facets=7`"
    page.wait_for_function(hash_is, arg="&lift+front+left+foot=on")
    control(page, "undo", "fire()")
    page.wait_for_function(hash_is, arg="")

    page.goto("about:blank")
    page.goto(f"{field.url}#friction+μ+reality=0.3&gait=trot&facets=many&nothing=1")
    eventually(page, lambda: has(gait="trot", friction=(0.7, 0.3)))
    panel = page.locator("#panel")
    assert 'facets in the address must be a number from 3 to 16, not "many"' in panel.inner_text()
    page.wait_for_timeout(1500)  # until the page has written its own address
    page.evaluate("location.hash = '#facets=5'")
    eventually(page, lambda: has(facets=5, gait=None, friction=(0.7, 0.7)))


def test_a_copied_address_opens_the_same_view_and_pushes(page, field):
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    opened(page, field)
    topple = challenge("The weakest side")
    control(page, "duration [s]", "setValue(0.2)")
    control(page, "push [N]", "release(50)")
    control(page, "challenge", f"setValue({CHALLENGES.index(topple) + 1})")
    control(page, "facets", "setValue(6)")
    control(page, "towards [°]", "setValue(-45)")
    page.evaluate("viewer.camera.position.set(1.5, 0.8, 1.2)")
    page.locator("#tools summary").click()
    page.locator("#tools button", has_text="copy address").click()
    page.wait_for_function("document.getElementById('tools').textContent.includes('copied')")
    address = page.evaluate("navigator.clipboard.readText()")
    field.start_challenge(None)
    page.goto("about:blank")
    until(lambda: field.challenge is None and field.session.settings == Settings())
    field.reset_all()
    page.goto(address)
    eventually(page, lambda: field.last_push is not None)
    assert_allclose(field.last_push.force, [0.0, 50.0, 0.0], atol=1e-9)
    assert field.last_push.duration == 0.2 and field.challenge == topple
    eventually(page, lambda: (field.force, field.towards, field.duration) == (50.0, -45.0, 0.2))
    assert field.session.settings.facets == 6
    where = page.evaluate("viewer.camera.position.toArray()")
    assert_allclose(where, [1.5, 0.8, 1.2], atol=0.05)  # it follows the robot

    page.goto("about:blank")
    page.goto(f"{field.url}#view=1,2&pushed=50,90")
    page.wait_for_function("document.getElementById('panel').textContent.includes('6 numbers')")


def test_a_picture_is_saved_as_it_is_seen(page, field):
    opened(page, field)
    page.locator("#tools summary").click()
    with page.expect_download() as download:
        page.locator("#tools button", has_text="save picture").click()
    image = np.asarray(Image.open(download.value.path()).convert("RGB")).astype(int)
    assert image.std() > 5.0 and image.shape[1] > 400
    with page.expect_download(timeout=60_000) as download:
        page.locator("#tools button", has_text="save 5 s as film").click()
    assert download.value.path().stat().st_size > 10_000


def test_wrong_arguments_raise_our_own_errors(field):
    force = field.force
    refused(lambda: playground(5), InputError, "robot", 5)
    refused(lambda: playground("go2", 5), InputError, "settings", 5)
    for call in (
        lambda: field.push("x"),
        lambda: field.push(10.0, "x"),
        lambda: field.push(float("nan")),
        lambda: field.start_challenge(5),
        lambda: field.show_term([1], True),
        lambda: field.show_term("nothing", True),
        lambda: field.show_term("forces", "no"),
    ):
        with pytest.raises(FloatbaseError):
            call()
    assert field.force == force and field.challenge is None


def test_a_ground_that_cannot_be_drawn_is_refused_and_leaves_everything_as_it_was(go2):
    """The physics accepts a slope of 89°, but the picture does not."""
    with closing(Playground(go2)) as paused:
        before, ground = paused.session.settings, paused.view.painter.ground
        paused.set(slope=(0.0, 89.0), facets=6)
        assert "ground" in paused.session.refusal and paused.session.settings == before
        assert paused.view.painter.ground == ground
        paused.set(torque_fraction=0.9)
        assert paused.session.refusal == "" and paused.session.settings.torque_fraction == 0.9
        paused.start()
        paused.set(slope=(0.0, 89.0))
        until(lambda: "ground" in paused.session.refusal and paused.session.sim.time > 0.2)
        paused.set(friction=(0.7, 0.6))
        until(lambda: paused.session.settings.friction == (0.7, 0.6))
        assert paused.run.status == "running" and paused.session.settings.slope == (0.0, 0.0)


def test_without_gravity_the_robot_leaves_the_ground_instead_of_falling(field):
    field.set(gait="trot", actual_off=("gravity",))
    until(lambda: field.run.status == "fell")
    until(lambda: field.outcome.startswith("left the ground"))
    field.set(actual_off=())
    field.run.reset()
    until(lambda: field.run.status == "running" and field.outcome == "")
    field.push(240.0, 90.0)
    until(lambda: field.outcome.startswith("fell"))


def test_reset_everything_works_for_an_arm():
    with closing(Playground(fb.load("ur5"))) as arm:
        arm.start().reset_all()
        until(lambda: arm.session.last is not None and arm.run.status == "running")
        assert arm.run.error is None


def test_the_actual_slope_is_drawn(field):
    field.set(slope=(0.0, 20.0))
    until(lambda: field.view.painter.ground is not None)
    # sin 20°: it rises forwards
    until(lambda: abs(field.view.painter.ground.normal[0] + 0.342) < 1e-3)
