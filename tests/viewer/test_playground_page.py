"""The playground in a browser: every control at both ends, the challenges and the texts.

It is also tested as a notebook shows it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
from messages import raises
from waiting import until

import floatbase as fb
from floatbase.errors import FloatbaseError, InputError, UnknownNameError
from floatbase.playground import CHALLENGES, Playground, Settings, mean_force_error, playground
from floatbase.robots import Robot

from .looks import control, eventually, picture

pytestmark = pytest.mark.front_end

ENDS = """() => {
  for (const input of document.querySelectorAll('#panel input[type=range]'))
    for (const end of [input.min, input.max]) {
      input.value = end;
      input.dispatchEvent(new Event('input'));
    }
}"""


@pytest.fixture
def field(go2: Robot) -> Iterator[Playground]:
    started = Playground(go2)
    started.start()
    yield started
    started.close()


def opened(page, field: Playground) -> None:
    page.goto(field.url)
    page.wait_for_function("window.viewer && viewer.gui_controllers['show cones']")


def test_every_control_can_be_moved_to_both_ends(page, field):
    opened(page, field)
    page.evaluate(ENDS)
    for count in ("#panel input[type=checkbox]", "#board button", "#panel .buttons button"):
        for number in range(
            page.evaluate("(which) => document.querySelectorAll(which).length", count)
        ):
            page.evaluate(
                "([which, i]) => document.querySelectorAll(which)[i].click()", [count, number]
            )
            page.wait_for_timeout(30)
    for number in range(page.evaluate("document.querySelectorAll('#panel select').length")):
        options = page.evaluate(
            "(i) => document.querySelectorAll('#panel select')[i].length", number
        )
        for option in range(options):
            page.locator("#panel select").nth(number).select_option(str(option), force=True)
            page.wait_for_timeout(30)
    picture(page, "playground_ends")
    control(page, "challenge", "setValue(0)")
    control(page, "reset everything", "fire()")
    eventually(page, lambda: field.run.status == "running" and 0.3 < field.session.sim.time < 30.0)
    assert field.session.settings.friction == (0.7, 0.7) and field.session.refusal == ""
    said = page.evaluate(
        "[...document.querySelectorAll('#panel .row.pair output')].map((one) => one.textContent)"
    )
    assert said[:2] == ["0.70", "0.70"] and said[-2:] == ["ideal", "ideal"]
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
    assert field.last_push.force[0] == field.force > 0.0
    field.last_push = None
    control(page, "push [N]", "setValue(0)")
    eventually(page, lambda: field.force == 0.0)
    assert field.last_push is None


def test_the_robot_is_pushed_by_dragging_it_with_shift(page, field):
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
    page.keyboard.down("Shift")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(ahead_x, ahead_y, steps=5)
    assert field.last_push is None
    page.mouse.up()
    page.keyboard.up("Shift")
    eventually(page, lambda: field.last_push is not None)
    assert 60.0 <= field.towards <= 120.0 and field.force > 20.0
    assert page.evaluate("viewer.camera.position.toArray()") == pytest.approx(view, abs=0.05)


@pytest.mark.parametrize("size", [(1200, 700), (390, 780)])
def test_the_buttons_stay_visible_in_a_panel_that_is_scrolled(page, field, size):
    page.set_viewport_size({"width": size[0], "height": size[1]})
    opened(page, field)
    assert "Push the robot" in page.evaluate(
        "document.querySelector('#panel p:not(.plot)').textContent"
    )
    page.evaluate("document.querySelectorAll('#panel summary').forEach((one) => one.click())")
    for way in (0, 300, 600):
        page.evaluate("(way) => { document.getElementById('panel').scrollTop = way; }", way)
        hidden = """[...document.querySelectorAll('#panel .head button, #fold')].filter((one) => {
          const {left, top, width, height} = one.getBoundingClientRect();
          return document.elementFromPoint(left + width / 2, top + height / 2) !== one;
        }).map((one) => one.textContent)"""
        assert page.evaluate(hidden) == []
    page.locator("#panel .head button", has_text="pause").click()
    eventually(page, lambda: field.run.status == "paused")


def test_a_challenge_is_started_and_solved(page, field):
    number = next(
        i for i, challenge in enumerate(CHALLENGES) if challenge.title == "How many facets?"
    )
    opened(page, field)
    control(page, "challenge", f"setValue({number + 1})")
    page.wait_for_function(
        "document.getElementById('panel').textContent.includes('4 facets: the weakest')"
    )
    control(page, "facets", "setValue(13)")
    page.wait_for_function("document.getElementById('panel').textContent.includes('Solved')")
    assert "facets=13" in page.evaluate("document.querySelector('#panel pre').textContent")
    picture(page, "playground_solved")


def test_a_wrong_mass_lowers_the_robot_and_the_right_one_lifts_it(page, field):
    """The plan lacks 0.5 m g. The CoM task makes up for it at an error of 0.5 g / kp = 49 mm."""
    opened(page, field)

    def sunk() -> float:
        return float(field.robot.standing().com[2] - field.session.sim.state.com[2])

    control(page, "mass [%] reality", "setValue(150)")
    eventually(page, lambda: abs(sunk() - 0.049) < 0.01)
    page.wait_for_function(
        "document.querySelector('#panel pre').textContent.includes('Perturbation(mass=1.5)')"
    )
    control(page, "mass [%] model", "setValue(150)")
    eventually(page, lambda: abs(sunk()) < 0.01)
    page.wait_for_function(
        "document.querySelector('#panel p.plot').textContent.includes('difference between')"
    )
    assert mean_force_error(field.session.last) < 0.5 * field.robot.weight


def test_a_notebook_shows_and_runs_the_playground():
    shown = playground("solo12")
    try:
        assert "image/png" in shown._repr_mimebundle_()[0]
        until(lambda: shown.session.last is not None)
        assert shown.robot.name == "solo12" and isinstance(shown.session.last, fb.Rollout)
    finally:
        shown.close()


def test_a_push_after_a_fall_is_seen_by_the_new_judge(field):
    """The push puts the robot back on its feet, which starts a new judge."""
    field.start_challenge(
        next(challenge for challenge in CHALLENGES if challenge.title == "The weakest side")
    )
    until(lambda: field.session.last is not None and field.session.last.time[-1] < 1.0)
    for size in (240.0, 220.0):
        field.push(size, 90.0)
        until(lambda seen=size: field.judge.largest_push == seen and field.run.status == "fell")
        until(lambda seen=size: f"{0.1 * seen:.1f} N·s toppled" in field.judge.message)


def test_challenges_can_be_changed_during_a_run(field):
    for challenge in (CHALLENGES[0], None, *CHALLENGES[6:9], None):
        field.start_challenge(challenge)
        before = field.session.sim.time
        until(
            lambda start=before: field.run.status == "running" and field.session.sim.time != start
        )
    assert field.run.error is None


def test_a_paused_challenge_continues_with_run(field):
    number, challenge = next(
        (i, challenge) for i, challenge in enumerate(CHALLENGES) if challenge.paused
    )
    assert challenge.title == "Down an icy slope" and "Press run" in challenge.text and number == 2
    field.start_challenge(challenge)
    until(
        lambda: (
            field.run.status == "paused" and field.session.settings.slope == challenge.start.slope
        )
    )
    assert field.session.sim.time < 0.1
    field.run.start()
    until(lambda: field.session.sim.time > 0.2)


def test_reset_everything_includes_the_push_the_speed_and_the_terms(page, field):
    first = (field.force, field.towards)
    controls = ("speed", "push [N]", "show forces", "show gravity")

    def shown() -> list:
        scene = field.view.window.scene
        said = [
            [scene.command(("/", kind, name)) for kind in ("set_control_value", "set_control")]
            for name in controls
        ]
        return [(moved or made)["value"] for moved, made in said]

    before = shown()
    opened(page, field)
    for name, value in (
        ("speed", 0.1),
        ("push [N]", 200.0),
        ("show forces", "false"),
        ("show gravity", "true"),
    ):
        control(page, name, f"setValue({value})")
    eventually(
        page, lambda: not [one for one, old in zip(shown(), before, strict=True) if one == old]
    )
    eventually(page, lambda: "term gravity/m g" in field.view.renderer.picture)
    control(page, "reset everything", "fire()")
    eventually(page, lambda: shown() == before and (field.force, field.towards) == first)
    eventually(page, lambda: "measured/FL_foot" in field.view.renderer.picture)
    assert "term gravity/m g" not in field.view.renderer.picture


def test_an_unknown_setting_is_refused_and_the_run_continues(field):
    with raises(UnknownNameError, "frction"):
        field.set(frction=(0.5, 0.5))
    field.run.pause()
    field.set(facets=6)  # while its last slice may still run
    assert field.session.settings.facets == 6 and field.run.status == "paused"


def test_undo_restores_the_settings_before_the_last_change(go2):
    """Steps of one drag are one change, and a refused change is none."""
    paused = Playground(go2)
    try:
        first = paused.session.settings
        for value in (0.6, 0.5, 0.4):
            paused.set(friction=(value, 0.7))
        paused.set(mass=(1.0, 1.5), facets=6)
        paused.set(lifted_feet=("paw",))
        paused.undo()
        assert paused.session.settings == replace(first, friction=(0.4, 0.7))
        paused.undo()
        assert paused.session.settings == first and paused.session.refusal == ""
        paused.undo()
        assert paused.session.settings == first
        paused.set(slope=(0.0, 5.0))
        paused.reset_all()
        paused.undo()  # a reset of everything forgets the changes before it
        until(lambda: paused.session.settings == first)
    finally:
        paused.close()


def test_ctrl_z_undoes_a_change_of_the_page(page, field):
    opened(page, field)
    for keys, name, value in (("Control+z", "facets", 7), (None, "friction μ reality", 0.3)):
        before = page.evaluate(f"viewer.gui_controllers['{name}'].getValue()")
        control(page, name, f"setValue({value})")
        eventually(page, lambda: field.session.settings != Settings())
        if keys:
            page.keyboard.press(keys)
        else:
            page.locator("#panel button", has_text="undo").click()
        eventually(page, lambda: field.session.settings == Settings())
        page.wait_for_function(f"viewer.gui_controllers['{name}'].getValue() == {before}")


def test_the_address_has_the_settings_and_sets_them(page, field):
    opened(page, field)
    assert page.evaluate("location.hash") == ""
    control(page, "facets", "setValue(7)")
    control(page, "lift FL_foot", "setValue(true)")
    control(page, "speed", "setValue(0.5)")
    page.wait_for_function("location.hash == '#lift+FL_foot=on&facets=7'")
    control(page, "undo", "fire()")
    page.wait_for_function("location.hash == '#facets=7'")

    page.goto("about:blank")
    page.goto(f"{field.url}#friction+reality=0.3&gait=trot&facets=many&nothing=1")
    eventually(
        page,
        lambda: (
            field.session.settings.gait == "trot" and field.session.settings.friction == (0.7, 0.3)
        ),
    )
    page.wait_for_timeout(1500)  # until the page has written its own address
    page.evaluate("location.hash = '#facets=5'")
    eventually(
        page, lambda: field.session.settings.facets == 5 and field.session.settings.gait is None
    )
    assert field.session.settings.friction == (0.7, 0.7)


def test_wrong_arguments_raise_our_own_errors(field):
    force = field.force
    with raises(InputError, "robot", 5):
        playground(5)
    with raises(InputError, "settings", 5):
        playground("go2", 5)
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
    paused = Playground(go2)
    try:
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
    finally:
        paused.close()


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
    arm = Playground(fb.load("ur5"))
    try:
        arm.start().reset_all()
        until(lambda: arm.session.last is not None and arm.run.status == "running")
        assert arm.run.error is None
    finally:
        arm.close()


def test_on_a_phone_the_panel_is_below_the_visible_robot(page, field):
    page.set_viewport_size({"width": 390, "height": 844})
    opened(page, field)
    page.wait_for_function("viewer.camera.zoom > 0.3 && viewer.camera.zoom < 1")
    assert page.evaluate("document.getElementById('panel').getBoundingClientRect().top") > 400
    picture(page, "playground_phone")


def test_the_actual_slope_is_drawn(field):
    field.set(slope=(0.0, 20.0))
    until(
        lambda: (
            field.session.settings.slope == (0.0, 20.0) and field.view.painter.ground is not None
        )
    )
    # sin 20°: it rises forwards
    until(lambda: abs(field.view.painter.ground.normal[0] + 0.342) < 1e-3)
