"""The playground in a browser: every control at both ends, the challenges and the texts.

It is also tested as a notebook shows it.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from messages import raises
from waiting import until

import floatbase as fb
from floatbase.playground import CHALLENGES, Playground, mean_force_error, playground
from floatbase.robots import Robot

from .looks import picture

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


def test_every_control_can_be_moved_to_both_ends(page, field: Playground) -> None:
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
    page.evaluate("viewer.gui_controllers['challenge'].setValue(0)")
    page.evaluate("viewer.gui_controllers['reset everything'].fire()")
    until(
        lambda: field.run.status == "running" and 0.3 < field.session.sim.time < 30.0,
        lambda: page.wait_for_timeout(20),
    )
    assert field.session.settings.friction == (0.7, 0.7) and field.session.refusal == ""
    said = page.evaluate(
        "[...document.querySelectorAll('#panel .row.pair output')].map((one) => one.textContent)"
    )
    assert said[:2] == ["0.70", "0.70"] and said[-2:] == ["ideal", "ideal"]
    page.wait_for_function("viewer.gui_controllers['friction model'].getValue() == 0.7")


def test_a_challenge_is_started_and_solved(page, field: Playground) -> None:
    number = next(
        i for i, challenge in enumerate(CHALLENGES) if challenge.title == "How many facets?"
    )
    opened(page, field)
    page.evaluate(f"viewer.gui_controllers['challenge'].setValue({number + 1})")
    page.wait_for_function(
        "document.getElementById('panel').textContent.includes('4 facets: the weakest')"
    )
    page.evaluate("viewer.gui_controllers['facets'].setValue(13)")
    page.wait_for_function("document.getElementById('panel').textContent.includes('Solved')")
    assert "facets=13" in page.evaluate("document.querySelector('#panel pre').textContent")
    picture(page, "playground_solved")


def test_a_wrong_mass_lowers_the_robot_and_the_right_one_lifts_it(page, field: Playground) -> None:
    """The plan lacks 0.5 m g. The CoM task makes up for it at an error of 0.5 g / kp = 49 mm."""
    opened(page, field)

    def sunk() -> float:
        return float(field.robot.standing().com[2] - field.session.sim.state.com[2])

    def work() -> None:
        page.wait_for_timeout(20)

    page.evaluate("viewer.gui_controllers['mass [×] reality'].setValue(1.5)")
    until(lambda: abs(sunk() - 0.049) < 0.01, work)
    page.wait_for_function(
        "document.querySelector('#panel pre').textContent.includes('Perturbation(mass=1.5)')"
    )
    page.evaluate("viewer.gui_controllers['mass [×] model'].setValue(1.5)")
    until(lambda: abs(sunk()) < 0.01, work)
    page.wait_for_function(
        "document.querySelector('#panel p.plot').textContent.includes('difference between')"
    )
    assert mean_force_error(field.session.last) < 0.5 * field.robot.weight


def test_a_notebook_shows_and_runs_the_playground() -> None:
    shown = playground("solo12")
    try:
        assert "image/png" in shown._repr_mimebundle_()[0]
        until(lambda: shown.session.last is not None)
        assert shown.robot.name == "solo12" and isinstance(shown.session.last, fb.Rollout)
    finally:
        shown.close()


def test_a_push_after_a_fall_is_seen_by_the_new_judge(field: Playground) -> None:
    """The push puts the robot back on its feet, which starts a new judge."""
    field.start_challenge(
        next(challenge for challenge in CHALLENGES if challenge.title == "The weakest side")
    )
    until(lambda: field.session.last is not None and field.session.last.time[-1] < 1.0)
    for size in (240.0, 220.0):
        field.push(size, 90.0)
        until(lambda seen=size: field.judge.largest_push == seen and field.run.status == "fell")
        until(lambda seen=size: f"{0.1 * seen:.1f} N·s toppled" in field.judge.message)


def test_challenges_can_be_changed_during_a_run(field: Playground) -> None:
    for challenge in (CHALLENGES[0], None, *CHALLENGES[6:9], None):
        field.start_challenge(challenge)
        before = field.session.sim.time
        until(
            lambda start=before: field.run.status == "running" and field.session.sim.time != start
        )
    assert field.run.error is None


def test_a_paused_challenge_continues_with_run(field: Playground) -> None:
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


def test_reset_everything_includes_the_push_the_speed_and_the_terms(
    page, field: Playground
) -> None:
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
        page.evaluate(f"viewer.gui_controllers['{name}'].setValue({value})")
    until(
        lambda: not [one for one, old in zip(shown(), before, strict=True) if one == old],
        lambda: page.wait_for_timeout(20),
    )
    until(
        lambda: "term gravity/m g" in field.view.renderer.picture, lambda: page.wait_for_timeout(20)
    )
    page.evaluate("viewer.gui_controllers['reset everything'].fire()")
    until(
        lambda: shown() == before and (field.force, field.towards) == first,
        lambda: page.wait_for_timeout(20),
    )
    until(
        lambda: "measured/FL_foot" in field.view.renderer.picture, lambda: page.wait_for_timeout(20)
    )
    assert "term gravity/m g" not in field.view.renderer.picture


def test_an_unknown_setting_is_refused_and_the_run_continues(
    field: Playground,
) -> None:
    with raises(TypeError, "frction"):
        field.set(frction=(0.5, 0.5))
    field.run.pause()
    field.set(facets=6)  # while its last slice may still run
    assert field.session.settings.facets == 6 and field.run.status == "paused"


def test_reset_everything_works_for_an_arm() -> None:
    arm = Playground(fb.load("ur5"))
    try:
        arm.start().reset_all()
        until(lambda: arm.session.last is not None and arm.run.status == "running")
        assert arm.run.error is None
    finally:
        arm.close()


def test_on_a_phone_the_panel_is_below_the_visible_robot(page, field: Playground) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    opened(page, field)
    page.wait_for_function("viewer.camera.zoom > 0.3 && viewer.camera.zoom < 1")
    assert page.evaluate("document.getElementById('panel').getBoundingClientRect().top") > 400
    picture(page, "playground_phone")


def test_the_actual_slope_is_drawn(field: Playground) -> None:
    field.set(slope=(0.0, 20.0))
    until(
        lambda: (
            field.session.settings.slope == (0.0, 20.0) and field.view.painter.ground is not None
        )
    )
    until(
        lambda: abs(field.view.painter.ground.normal[0] + 0.342) < 1e-3
    )  # sin 20°: it rises forwards
