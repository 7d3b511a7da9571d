"""The page with a live robot in a browser: what an address opens, undo and reset everything."""

from urllib.parse import unquote

import pytest
from browsers import browser_of_a_file, needs_chromium, served
from waiting import until

from floatbase.live import folder

pytestmark = [pytest.mark.front_end, pytest.mark.timeout(300), needs_chromium]
browser = browser_of_a_file
WALK = (
    "#gait=trot&leg+of+Jᵀλ=rear+left+foot&gravity+in+the+model=off&show+gravity=on"
    "&force+at=front+left+foot&torque+limits+[%25]=80&view=1.5,0.8,1.2,0,0.2,0&motion=0.5,-0.5"
)
ITEMS = "viewer.scene.children.length"
SETTINGS = "() => floatbaseLive.frame().settings"


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    if folder.install_mujoco() is None:
        pytest.skip("MuJoCo for JavaScript is not installed: no live robot was looked at")
    made = tmp_path_factory.mktemp("live")
    folder.write(made, ("go2",))
    with served(made) as url:
        yield f"{url}/robot.html"


@pytest.fixture
def page(browser):
    opened = browser.new_page(viewport={"width": 800, "height": 500})
    opened.context.grant_permissions(["clipboard-read", "clipboard-write"])
    yield opened
    opened.close()


def settings_at(page, address):
    """Settings of the engine, after the page has opened an address."""
    page.goto("about:blank")
    page.goto(address)
    page.wait_for_selector("body.live", timeout=60_000)
    return page.evaluate(SETTINGS)


def copied_address(page):
    page.locator("#tools summary").click()
    page.locator("#tools button", has_text="copy address").click()
    page.wait_for_function("document.getElementById('tools').textContent.includes('copied')")
    return page.evaluate("navigator.clipboard.readText()")


def control(page, name, call):
    """Use a control of the page: `setValue(0.5)` of a slider, `fire()` of a button."""
    page.evaluate(f"viewer.gui_controllers['{name}'].{call}")


def press(page, name, settings):
    """Press a button, and wait until the engine has the settings."""
    control(page, name, "fire()")
    until(lambda: page.evaluate(SETTINGS) == settings, lambda: page.wait_for_timeout(20))


def test_a_copied_address_opens_the_same_walk_with_the_same_terms_and_view(page, address):
    first = settings_at(page, address + WALK)
    assert (first["gait"], first["leg"]) == ("trot", "RL_foot")
    assert (first["assumedOff"], first["actualOff"], first["torque"]) == (["gravity"], [], 0.8)
    assert first["speed"] < 0.0 and first["turn"] < 0.0
    copied = copied_address(page)
    assert settings_at(page, copied) == first
    assert page.locator(".foot").inner_text().startswith("front left foot")
    assert page.evaluate("viewer.gui_controllers['show gravity'].getValue()")


def test_reset_everything_restores_the_first_settings_and_undo_takes_it_back(page, address):
    first = settings_at(page, address + "?gait=walk&mu=0.5")
    walking = settings_at(page, address + "?gait=walk&mu=0.5" + WALK)
    assert (first["gait"], first["mu"], walking["gait"]) == ("walk", 0.5, "trot")
    items = page.evaluate(ITEMS)
    control(page, "push-recovery map", "fire()")
    page.wait_for_function(f"{ITEMS} > {items}")
    press(page, "reset everything", first)
    assert page.evaluate(ITEMS) == items  # without the map
    kept = "[...new URLSearchParams(location.hash.slice(1)).keys()].join()"
    page.wait_for_function(f"{kept} == 'view,motion'")  # no setting
    press(page, "undo", walking)
    assert page.locator(".joystick").is_visible()


def test_a_copied_address_keeps_the_sliders_of_the_push_and_the_challenge(page, address):
    settings_at(page, address)
    last = {"challenge": 5, "duration [s]": 0.2, "towards [°]": -90, "push [N]": 20}
    for name, value in last.items():
        control(page, name, f"{'release' if 'push' in name else 'setValue'}({value})")
    last |= {"towards [°]": 45, "friction μ reality": 0.3}
    for name in list(last)[-3:]:
        control(page, name, f"setValue({last[name]})")
    copied = copied_address(page)
    assert "pushed=-1,0,0,0,0,-20,0,0.2" in unquote(copied)
    assert settings_at(page, copied)["actualMu"] == 0.3
    for name, value in last.items():
        assert page.evaluate(f"viewer.gui_controllers['{name}'].getValue()") == value, name
    assert page.evaluate("floatbaseLive.frame().challenge.text").startswith("The friction")


def test_a_page_around_the_robot_moves_its_controls(page, address):
    settings_at(page, address)
    for given in ({"mu": 0.4, "gait": "trot"}, {"mu": 99}):
        page.evaluate("set => postMessage({floatbaseSet: set}, '*')", given)
    page.wait_for_function("viewer.gui_controllers['friction μ model'].getValue() == 0.4")
    assert page.locator(".joystick").is_visible()
    page.wait_for_function("document.getElementById('title').textContent.includes('not 99')")
    assert page.evaluate(SETTINGS)["mu"] == 0.4


def test_a_paused_robot_keeps_its_time_and_the_sentence_about_its_limits(page, address):
    settings_at(page, address + "#CoM+x+[cm]=8&torque+limits+[%25]=18")
    limit = "document.getElementById('title').textContent.includes('torque limit')"
    page.wait_for_function(limit)
    page.evaluate("viewer.gui_controllers.pause.fire()")
    page.wait_for_function("document.getElementById('panel').textContent.includes('Paused at')")
    for _ in range(30):  # pictures without a step, as while the reader drags the robot
        page.evaluate("floatbaseLive.send({foot: null})")
        page.wait_for_timeout(50)
    assert page.evaluate(limit)


TOUCH = """([type, pointerId, way]) => document.querySelector("canvas").dispatchEvent(
  new PointerEvent(type, {pointerId, clientX: 400 + way, clientY: 250, bubbles: true}))"""


def test_a_second_finger_neither_releases_the_robot_nor_leaves_a_line(page, address):
    settings_at(page, address + "?panel=0")
    lines = "viewer.scene.children.filter(({isLine}) => isLine).length"
    for event, finger, way in (("down", 1, 0), ("move", 1, 60), ("down", 2, 1), ("up", 2, 1)):
        page.evaluate(TOUCH, [f"pointer{event}", finger, way])
    assert page.evaluate(lines) == 1 and page.locator(".newtons").inner_text()
    page.evaluate(TOUCH, ["pointerup", 1, 60])
    assert page.evaluate(lines) == 0
