"""Pictures of a site: the samples of panels, their files, and a browser that draws them without a
kernel.
"""

import base64
import gzip
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from browsers import SCREENSHOTS, browser_of_a_file, needs_chromium, served
from panels import RANGES

import floatbase as fb
from floatbase.lessons import ConstantTorques, live_run, push_panel, slider_panel, static_export
from floatbase.lessons.publish import pictures
from floatbase.lessons.slider_samples import MAX_COMBINATIONS, combinations, sample_values
from floatbase.viewer.scene import protocol
from floatbase.viewer.web import pages

Pictures = pictures.Pictures
STATIC = Path(pictures.__file__).with_name("site") / "static"
ANIMATION = "set_animation"
GIVEN = {
    "samples": {"down": (0, 0.05, 0.1), "force": (0, 30, 60)},
    "down": (0, 0.05, 0.1, "m"), "force": (0, 30, 60, "N"),
}  # fmt: skip


@pytest.fixture(autouse=True)
def for_a_site(monkeypatch):
    monkeypatch.setenv("FLOATBASE_VIEWER", "site")


@pytest.fixture
def view(go2):
    made = fb.Viewer(go2, height=200)
    yield made
    made.close()


def squat(view, **ranges):
    """A panel that moves the robot, and shows its forces from 20 N on: they come and go, and change
    their colour.
    """
    standing, contacts = view.robot.standing(), fb.Contacts.points(view.robot)

    def draw(down, force=0.0):
        q = standing.q.copy()
        q[2] -= down
        forces = np.tile([0.6 * force - 15.0, 0.0, force], (4, 1)) if force >= 20.0 else None
        view.show(standing.replace(q=q), contacts, forces, title=f"{down:.2f}")
        if force > 50.0:
            raise fb.FloatbaseError("more than 50 < 60")
        return f"<b>{down:.2f}</b> {force:.0f}"

    return slider_panel(view, draw, **ranges)


def data_of(shown):
    return dict(shown._repr_mimebundle_()[static_export.MIME])


def scene_at(data, stop=None, view=0):
    """Key -> command of the first scene, or of a stop's, assembled as pictures.js does it."""
    commands, scene = static_export.commands(data), {}
    changes = data["stops"][stop][1 + view] if stop is not None else []
    for numbers in (data["first"][view], changes):
        for key, command in zip(numbers[::2], numbers[1::2], strict=True):
            scene[key] = None if command == static_export.REMOVED else commands[command]
    return {
        tuple(data["keys"][key]): command for key, command in scene.items() if command is not None
    }


# stops --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("low", "first", "high", "step"), RANGES)
def test_samples_of_a_slider_span_its_range(low, first, high, step):
    found = sample_values(low, first, high, step)
    assert {low, first, high} <= set(found) and list(found) == sorted(set(found))
    assert 6 <= len(found) <= 16
    steps = (np.array(found) - low) / step
    assert np.allclose(steps, np.round(steps), atol=1e-6)
    assert max(np.diff(found)) < 0.3 * (high - low)
    assert sample_values(low, low, low, step) == (low,)


def test_few_combinations_are_complete_and_many_move_one_slider_at_a_time():
    assert combinations([3, 2], [1, 0]) == ([(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)], True)
    alone, together = combinations([5, 5, 5], [1, 2, 4])
    # 5 + 5 + 5, the first place once
    assert not together and len(alone) == len(set(alone)) == 13
    assert all(sum(a != b for a, b in zip(place, (1, 2, 4), strict=True)) <= 1 for place in alone)
    assert combinations([MAX_COMBINATIONS], [0])[1]
    assert not combinations([MAX_COMBINATIONS + 1], [0])[1]


# panels -------------------------------------------------------------------------------------------


def test_a_panel_stores_the_live_picture_of_each_sample(view):
    panel = squat(view, **GIVEN)
    data = data_of(panel)
    assert data["together"]
    assert set(data["stops"]) == {f"{i},{k}" for i in range(3) for k in range(3)}
    assert data["stops"]["1,1"][1] == []  # where all began
    for stop in data["stops"]:
        down, force = ((0, 0.05, 0.1)[int(stop[0])], (0, 30, 60)[int(stop[2])])
        note = "more than 50 &lt; 60" if force == 60 else f"<b>{down:.2f}</b> {force}"
        assert data["notes"][data["stops"][stop][0]] == note
        assert panel.draw_at({"down": down, "force": force}) == note
        assert scene_at(data, stop) == dict(view.window.scene.file_entries())


def test_a_site_leaves_a_panel_unchanged_and_names_its_sliders(view):
    panel = squat(view, down=(0, 0.02, 0.1, "m"))
    before = dict(view.window.scene.file_entries())
    data = data_of(panel)
    assert dict(view.window.scene.file_entries()) == before and panel.sliders["down"].value == 0.02
    (control,) = data["controls"]
    assert (control["name"], control["unit"], control["kind"]) == ("down", "m", "range")
    assert control["values"][control["first"]] == "0.020" and control["values"][-1] == "0.100"
    assert data["words"] and "one slider" not in data["words"]


def test_a_panel_without_a_view_stores_its_notes():
    data = data_of(
        slider_panel(None, lambda x: f"<img alt='{x:.0f}'>", samples={"x": (0, 1, 2)}, x=(0, 1, 2))
    )
    assert data["notes"] == [f"<img alt='{i}'>" for i in range(3)] and data["first"] == []
    assert data["stops"] == {"0": [0], "1": [1], "2": [2]}


def test_a_control_refuses_an_unknown_position():
    with pytest.raises(fb.errors.ViewerError, match="position 3"):
        static_export.Control("x", ("0", "1"), 3)


def test_a_push_panel_becomes_recorded_runs(view):
    sim = fb.Simulation(view.robot)
    controller = fb.WholeBodyController(view.robot, sim.feet, fb.standing_tasks(sim.state))
    view.show(sim.state, sim.feet)
    run = live_run(sim, controller, view)
    # the robot of the panel falls
    fb.rollout(sim, controller, 0.6, [fb.Push([0.0, 480.0, 0.0], start=0.0)])
    data = data_of(push_panel(run, view))
    assert [len(control["values"]) for control in data["controls"]] == [5, 4]
    for unpushed in (scene_at(data), scene_at(data, "0,1")):
        assert not any(key[1] == ANIMATION for key in unpushed)
        arrows = [key[0].split("/measured/") for key in unpushed if "/measured/" in key[0]]
        assert len({name.split("/")[0] for _, name in arrows}) == 4
    notes = {stop: data["notes"][about[0]] for stop, about in data["stops"].items()}
    assert notes["1,0"] == "it stands" and notes["4,1"].endswith("it falls") and notes["0,0"] == ""
    moving = [
        {key: c for key, c in scene_at(data, f"{i},{k}").items() if key[1] == ANIMATION}
        for i in (1, 4)
        for k in range(4)
    ]
    assert all(len(one) == 1 for one in moving)
    assert len({c for one in moving for c in one.values()}) == 8
    assert run.status == "paused" and sim.time == 0.0


# files --------------------------------------------------------------------------------------------


def parts_of(path):
    found = re.fullmatch(
        r'floatbasePictures\.take\("([^"]+)","([^"]+)"\)\n', path.read_text(encoding="ascii")
    )
    assert found is not None and found.group(1) == path.stem
    return protocol.unframe(gzip.decompress(base64.b64decode(found.group(2))))


def placed(html):
    return re.findall(r'data-picture="([^"]+)"', html)[0]


def test_files_hold_the_outputs_and_shared_meshes_once(view, tmp_path):
    made, data, names = Pictures(tmp_path), [], []
    for title in ("one", "two"):
        bundle = view.show(view.robot.standing(), title=title)._repr_mimebundle_()
        data.append(bundle[static_export.MIME])
        html = made.place(bundle, "It <stands>.") or ""
        assert '<img alt="It &lt;stands&gt;." src="data:' in html and "aria-label" not in html
        names.append(placed(html))
    made.write()
    files = {path.stem: path for path in (tmp_path / "pictures").glob("go2-*.js")}
    assert len(files) == 1
    (shared,) = (parts_of(path) for path in files.values())
    for name, about in zip(names, data, strict=True):
        head, *own = parts_of(tmp_path / "pictures" / f"{name}.js")
        known = json.loads(head)
        assert known["shared"] == list(files)
        assert [[*shared, *own][i] for i in known["at"]] == static_export.commands(about)
        assert sum(map(len, own)) < 0.05 * sum(map(len, shared))


def test_a_later_build_keeps_the_files_of_an_earlier_one(view, tmp_path):
    view.show(view.robot.standing())
    first, second = Pictures(tmp_path), Pictures(tmp_path)
    first.place(view._repr_mimebundle_())
    first.write()
    before = {path: path.read_bytes() for path in (tmp_path / "pictures").iterdir()}
    second.place(view.show(view.robot.standing(), title="new")._repr_mimebundle_())
    second.write()
    assert all(path.read_bytes() == content for path, content in before.items())


def test_only_pictures_are_placed_and_texts_are_escaped(tmp_path):
    made = Pictures(tmp_path)
    assert made.place({"text/html": "<b>3</b>"}) is None and made.place({}) is None
    panel = slider_panel(None, lambda **x: "<i>note</i>", **{"a<b": (0, 1, 2, '"s"')})
    html = made.place(panel._repr_mimebundle_(), "A drawing")
    assert html is not None and '<figure class="floatbase-picture" data' in html
    assert ' aria-label="A drawing">' in html
    assert html is not None and "<i>note</i>" in html and "a&lt;b" in html
    assert "a<b" not in html and '"s"' not in html


def test_the_playground_on_a_site_is_a_still_picture(go2):
    from floatbase.playground import playground

    field = playground("go2")
    data = data_of(field)
    assert "live" in data["words"] and data["controls"] == [] and not field.run.is_simulating
    assert any("/robot/" in key[0] for key in scene_at(data))
    field.close()


def test_a_site_has_every_set_of_constraints_of_the_game():
    from floatbase.lessons.lessonC import ActiveSetGame

    game = ActiveSetGame([(0.5, -1.0)])
    data = data_of(game)
    bowls = data["controls"][0]["values"]
    assert len(data["stops"]) == len(bowls) * 2 ** len(game.rows)
    solved = [stop for stop, (note, *_) in data["stops"].items() if "solved" in data["notes"][note]]
    assert {stop.split(",")[0] for stop in solved} == {str(i) for i in range(len(bowls))}
    assert (game.working, game.clicks) == ((), 0)


# in a browser -------------------------------------------------------------------------------------

browser = browser_of_a_file


@pytest.fixture(scope="module")
def site(go2, tmp_path_factory):
    """A page of a panel, a recording far below it and a note with a slider, one level deep as the
    pages of the site.
    """
    folder = tmp_path_factory.mktemp("site")
    made, views = Pictures(folder / "_static"), [fb.Viewer(go2, height=240) for _ in range(2)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FLOATBASE_VIEWER", "site")
        panel = squat(views[0], **GIVEN)
        push = fb.Push(np.array([0.0, 40.0, 0.0]), 0.1, 0.05)
        record = fb.rollout(fb.Simulation(go2), ConstantTorques(np.zeros(12)), 0.2, [push])
        moving = views[1].play(record, title="falls")
        note = slider_panel(None, lambda x: f"x is {x:.0f}", samples={"x": (0, 1, 2)}, x=(0, 1, 2))
        shown = [made.place(one._repr_mimebundle_()) for one in (panel, note, moving)]
    for one in views:
        one.close()
    made.write()
    for path in (pages.DIST / "pictures.js", STATIC / "pictures.css"):
        shutil.copy(path, folder / "_static")
    (folder / "lessons").mkdir()
    head = (
        '<meta charset="utf-8"><link rel="icon" href="data:,">'
        '<link rel="stylesheet" href="../_static/pictures.css">'
        '<script src="../_static/pictures.js"></script>'
    )
    body = '<div style="height: 4000px"></div>'.join(map(str, (f"{shown[0]}{shown[1]}", shown[2])))
    text = f"<!DOCTYPE html><html><head>{head}</head><body>{body}</body></html>"
    (folder / "lessons" / "00.html").write_text(text, encoding="utf-8")
    return folder


@pytest.fixture
def page(site, browser):
    """The page, served by this machine; it asks nobody else and reports no error."""
    opened = browser.new_page(viewport={"width": 900, "height": 700}, reduced_motion="reduce")
    said = []
    requested = []
    opened.on("console", lambda line: said.append(line.text) if line.type == "error" else None)
    opened.on("pageerror", lambda error: said.append(str(error)))
    opened.on("request", lambda request: requested.append(request.url))
    with served(site) as address:
        opened.goto(f"{address}/lessons/00.html")
        yield opened
        assert said == []
        known = (address, "data:", "blob:", "about:")
        assert [url for url in requested if not url.startswith(known)] == []
        opened.close()


def inside(page, number=0):
    """The frame of a picture, once it has drawn."""
    place = page.locator(".floatbase-picture:has(.floatbase-scene)").nth(number)
    place.scroll_into_view_if_needed()
    place.locator("iframe").wait_for(state="attached", timeout=60_000)
    frame = place.locator("iframe").element_handle().content_frame()
    frame.wait_for_function("window.viewer && viewer.num_messages_received > 0", timeout=60_000)
    return frame


SIGNATURE = """() => {
  const found = {}, walk = (node, path) => {
    const drawn = node.children["<object>"], {matrix, visible} = node.object;
    node.object.updateMatrix();
    const colour = drawn ? drawn.object.material?.color?.getHex() : null;
    found[path] = [...matrix.elements.map((x) => x.toFixed(4)), colour].join();
    for (const [name, child] of Object.entries(node.children))
      if (name !== "<object>") walk(child, `${path}/${name}`);
  };
  walk(viewer.scene_tree.find(["meshcat"]), "");
  return found;
}"""


def set_to(page, number, value):
    page.locator("input[type=range]").nth(number).evaluate(
        "(one, value) => { one.value = value; one.dispatchEvent(new Event('input')); }", value
    )


@needs_chromium
def test_a_slider_moves_the_robot_without_a_kernel(page):
    frame = inside(page)
    height = "viewer.scene_tree.find(['meshcat', 'robot', 'root_joint']).object.position.z"
    before = frame.evaluate(height)
    page.locator("input[type=range]").first.focus()
    page.keyboard.press("ArrowRight")
    frame.wait_for_function(f"Math.abs({height} - {before} + 0.05) < 1e-4")
    assert page.locator(".floatbase-note b").first.text_content() == "0.10"
    assert frame.evaluate("document.getElementById('title').textContent") == "0.10"
    page.locator("input[type=range]").nth(2).focus()  # of the note below
    page.keyboard.press("End")
    assert page.locator(".floatbase-note").nth(1).text_content() == "x is 2"


@pytest.mark.front_end
@needs_chromium
def test_a_sample_looks_the_same_after_any_other(page):
    frame = inside(page)
    seen = {}
    count = 1
    for order in ([0, 1, 2, 1, 0], [2, 0, 1, 2]):
        for force in order:
            set_to(page, 1, force)
            count += 1
            frame.wait_for_function(f"viewer.num_messages_received >= {count}")
            assert seen.setdefault(force, frame.evaluate(SIGNATURE)) == frame.evaluate(SIGNATURE)
    arrows = [any("/measured/" in path for path in seen[force]) for force in (0, 1)]
    assert arrows == [False, True] and seen[1] != seen[2]


@pytest.mark.front_end
@needs_chromium
def test_a_recording_plays_on_request_and_pauses_out_of_sight(page):
    frame = inside(page, 1)
    assert frame.evaluate("viewer.animator.playing") is False
    assert frame.evaluate("viewer.animator.duration") == pytest.approx(0.2, abs=0.01)
    arrow = "viewer.scene_tree.find(['meshcat', 'push']).object.visible"
    assert not frame.evaluate(arrow)  # it comes with the push
    frame.locator("#player button").click()
    frame.wait_for_function(f"viewer.animator.playing && {arrow}")
    panel = inside(page, 0)
    frame.wait_for_function("viewer.resting()", timeout=20_000)
    panel.wait_for_function("!viewer.resting()", timeout=20_000)
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=str(SCREENSHOTS / "site_picture.png"))


FRAMED = """(address) => new Promise((done) => {
  window.onmessage = ({source}) => {
    source.postMessage({seen: true}, "*");
    done();
  };
  document.body.append(Object.assign(document.createElement("iframe"), {src: address}));
})"""


@pytest.mark.front_end
@needs_chromium
# the site's own, and another origin on the same machine
@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])
def test_the_viewer_obeys_pages_of_its_own_site_only(site, browser, host):
    page = browser.new_page()
    with served(site) as address:
        page.goto(f"{address}/_static/pictures.css".replace("127.0.0.1", host))
        page.evaluate(FRAMED, f"{address}/_static/pictures/viewer.html")
        frame = page.frames[-1]
        heard = "new Promise((done) => window.addEventListener('message', done))"
        frame.evaluate(f"() => {{ window.heard = {heard}; }}")
        page.evaluate("window[0].postMessage({seen: true}, '*')")
        frame.evaluate("window.heard.then(() => 0)")
        assert frame.evaluate("window.viewer !== undefined") == (host == "127.0.0.1")
    page.close()
