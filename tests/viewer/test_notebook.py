"""The picture in a notebook: frame rates, busy kernels, slow or foreign pages, saved output."""

import gzip
import json
import subprocess
import sys
import time
from contextlib import closing, contextmanager

import nbformat
import numpy as np
import pytest
from IPython.core.interactiveshell import InteractiveShell
from messages import raises
from nbclient import NotebookClient
from nbformat.v4 import new_code_cell, new_notebook
from waiting import until

from floatbase.errors import MissingDependencyError
from floatbase.viewer import Viewer
from floatbase.viewer.scene import protocol
from floatbase.viewer.transport.window import Window
from floatbase.viewer.web import pages

from .looks import CONTEXTS, DRAWN, eventually, picture
from .notebook import Client, Notebook, hear
from .test_window import STRANGE

MB = 1 << 20
PACE = 1.0 / 30.0  # s from frame to frame, at least
BLIND = 0.05  # s, while the page cannot answer
# how many frames go over a port of the notebook's page
COUNTED = """() => {
  const post = MessagePort.prototype.postMessage;
  window.posted = 0;
  MessagePort.prototype.postMessage = function (...given) {
    window.posted += given[0] instanceof ArrayBuffer;
    return post.apply(this, given);
  };
}"""
# how often pages of pictures have loaded
LOADS = """() => {
  window.loads = 0;
  window.addEventListener("message", ({data}) => { window.loads += data?.ready ? 1 : 0; });
}"""
WITHOUT_STATE = "--ClearMetadataPreprocessor.enabled=True"
NOTICE = "getComputedStyle(document.getElementById('notice')).display"


def put(window, number):
    window.put([protocol.set_transform("/meshcat/a", np.eye(4) * number)])


def newest(commands):
    return float(commands[-1]["matrix"][0])


def shown(window, in_cell=False):
    """Return a page that has drawn the first frame."""
    put(window, 0)
    client = Client(window.widget("a", 100), in_cell=in_cell)
    client.commands()
    return client


def draw_for(window, seconds):
    """Draw something new repeatedly; return how often."""
    drawn, until_then = 0, time.monotonic() + seconds
    while time.monotonic() < until_then:
        drawn += 1
        put(window, drawn)
        time.sleep(0.002)
    return drawn


def frames_of(client):
    """Return how many frames have arrived by now."""
    time.sleep(2 * BLIND)
    return sum("frame" in client.messages.get()[0] for _ in range(client.messages.qsize()))


def test_a_page_that_does_not_answer_gets_two_frames_and_then_the_newest(window):
    put(window, 0)
    client = Client(window.widget("a", 100))
    assert client.frame()[0] == 1
    drawn = draw_for(window, 1.0)
    second = client.frame()
    assert second[0] == 2 and newest(second[1]) < drawn
    assert client.hears_nothing()
    client.drawn(2)
    third = client.frame()
    assert third[0] == 3 and newest(third[1]) == drawn


def test_a_page_that_answers_gets_the_pace_and_no_more(window):
    client = shown(window)
    until_then, drawn, times = time.monotonic() + 1.0, 0, []
    while time.monotonic() < until_then:
        drawn += 1
        put(window, drawn)
        time.sleep(0.002)
        while not client.messages.empty():
            client.commands()
            times.append(time.monotonic())
    assert 5 <= len(times) <= 1.0 / PACE + 2


@pytest.fixture
def shell():
    yield InteractiveShell.instance()
    InteractiveShell.clear_instance()


@pytest.fixture
def cell_window(shell):
    with Window() as opened:
        shell.events.trigger("post_run_cell", None)  # the cell that opened it
        yield opened


@contextmanager
def busy(shell):
    """Run a cell."""
    shell.events.trigger("pre_run_cell", None)
    yield
    shell.events.trigger("post_run_cell", None)


@pytest.mark.parametrize(
    ("in_cell", "constant", "value", "least", "most"),
    [
        (True, "TIMEOUT", 0.4, 4, 0.6 / BLIND + 2),  # a long cell does not make a page look lost
        (True, "MAX_UNANSWERED", 1000, 2, 10),  # of 119 bytes each
        (False, "TIMEOUT", 30.0, 2, 2),  # a subshell hears the page, so its answer is awaited
    ],
)
def test_the_picture_moves_while_a_cell_keeps_the_kernel_busy(
    shell, cell_window, monkeypatch, in_cell, constant, value, least, most
):
    monkeypatch.setattr(f"floatbase.viewer.transport.connection.{constant}", value)
    client = shown(cell_window, in_cell=in_cell)
    with busy(shell):
        draw_for(cell_window, 0.5)
        frames = frames_of(client)
        assert least <= frames <= most
    put(cell_window, -1)
    assert client.hears_nothing()  # the last frame can be answered now, but has not been
    client.drawn(1 + frames)
    assert newest(client.commands()) == -1 and cell_window.n_pages == 1


def test_a_dropped_page_is_informed_and_can_come_back(window, monkeypatch):
    monkeypatch.setattr("floatbase.viewer.transport.connection.TIMEOUT", 0.2)
    put(window, 0)
    client = Client(window.widget("a", 100))
    client.frame()

    def let_go():
        put(window, 1)
        return window.n_pages == 0

    until(let_go)
    while "lost" not in client.message()[0]:
        pass
    client.drawn(1)  # it has not heard yet
    assert "lost" in client.message()[0]
    client.say("hello")
    assert client.frame()[0] == 1 and window.n_pages == 1
    client.say("bye")
    until(lambda: window.n_pages == 0)


def test_a_newer_display_retires_the_one_before_which_shows_its_image(window):
    client = shown(window)
    client.widget.thumbnail = b"png"
    second = window.widget("a", 100)
    assert (client.widget.is_live, client.widget.thumbnail, second.is_live) == (False, b"png", True)
    until(lambda: window.n_pages == 0)
    put(window, 2)
    assert client.hears_nothing()
    assert newest(Client(second).commands()) == 2.0


def test_a_display_without_its_package_names_the_extra(window, monkeypatch):
    monkeypatch.setitem(sys.modules, "anywidget", None)
    monkeypatch.delitem(sys.modules, "floatbase.viewer.transport.notebook_widget")
    with raises(MissingDependencyError, "anywidget", "floatbase[viewer]"):
        window.widget("a", 100)


def test_the_code_of_the_page_is_sent_when_a_page_asks_for_it(window):
    client = Client(window.widget("a", 100), hello=False)
    client.say("code")
    content, (html, viewer) = client.message()
    assert content["code"] and gzip.decompress(viewer) == pages.viewer_code()
    assert gzip.decompress(html).decode() == pages.notebook_page()
    assert len(html) + len(viewer) < 300_000
    assert window.n_pages == 0


def test_unknown_messages_of_a_notebook_page_are_ignored(window, caplog):
    client = shown(window)
    incomplete = [{}, {"page": "page"}, {"page": 3, "say": "hello"}, {"page": "page", "say": {}}]
    for content in (None, 3, "x", [], *incomplete):
        hear(client.widget, content)
    numbers = [json.dumps({"type": "done", "number": number}) for number in ("many", 10**400)]
    for words in (*STRANGE, *numbers):
        if isinstance(words, str) and words != "hello":
            client.say(words)
    put(window, 2)
    assert newest(client.commands()) == 2.0
    assert not [record for record in caplog.records if record.levelname in ("WARNING", "ERROR")]


def test_pages_that_leave_without_a_word_are_forgotten_in_the_end(window):
    widget = window.widget("a", 100)
    for i in range(60):
        Client(widget, f"page {i}")
    until(lambda: window.n_pages == 50)


def test_a_closed_window_informs_its_pages_once_and_new_ones_on_request(window):
    client = shown(window)
    window.close()
    assert client.message()[0] == {"closed": True} and client.hears_nothing()
    client.say("hello")
    assert client.message()[0] == {"closed": True}


@pytest.fixture
def notebook(page):
    page.set_viewport_size({"width": 450, "height": 400})
    opened = Notebook()
    page.goto(opened.url)
    page.wait_for_function("window.started")
    yield opened
    page.goto("about:blank")
    opened.close()


TITLE = "document.getElementById('title').textContent"


def displayed(notebook, page, viewer):
    """Display a viewer in the notebook; return its frame, when it has drawn."""
    frame = notebook.show(page, viewer.widget())
    frame.wait_for_function(DRAWN)
    return frame


@pytest.mark.front_end
def test_pictures_share_code_and_one_that_lost_a_frame_gets_all_again(notebook, page, standing):
    viewer, *others = (Viewer(standing.robot, height=100) for _ in range(3))
    viewer.show(standing)
    frame, *_ = (displayed(notebook, page, view) for view in (viewer, *others))
    code = len(gzip.compress(pages.viewer_code(), 9, mtime=0))
    assert notebook.sizes.count(code) == 1
    frame.evaluate("window.old = true")
    notebook.lose = 1
    viewer.show(standing, com=False)
    until(lambda: notebook.lose == 0)
    viewer.show(standing, com=False, title="the next one")
    frame.wait_for_function("!window.old")
    frame.wait_for_function(DRAWN)
    assert frame.evaluate("!viewer.scene_tree.find(['meshcat']).children.com?.children.ball")
    for view in (viewer, *others):
        view.close()


@pytest.mark.front_end
def test_an_earlier_output_shows_its_image_and_the_newest_is_live(notebook, page, standing):
    with closing(Viewer(standing.robot, height=170)) as viewer:  # both outputs are in sight
        displayed(notebook, page, viewer.show(standing))
        second = displayed(notebook, page, viewer.show(standing, title="second"))
        page.wait_for_function("document.querySelectorAll('.output').length == 2")
        page.wait_for_function("document.querySelectorAll('iframe').length == 1")
        assert page.locator(".output").first.locator("img").is_visible()
        viewer.show(standing, title="still live")
        second.wait_for_function(f"{TITLE} == 'still live'")
        picture(page, "retired_output")


@pytest.mark.front_end
def test_many_displays_share_the_few_contexts_that_a_browser_has(notebook, page, standing):
    page.set_viewport_size({"width": 450, "height": 200})
    views = [Viewer(standing.robot, height=170).show(standing) for _ in range(CONTEXTS + 2)]
    for view in views:
        notebook.show(page, view.widget())
    frames = page.locator("iframe").element_handles()
    awake = "Boolean(window.viewer) && !viewer.resting()"
    visible = "getComputedStyle(viewer.renderer.domElement).visibility == 'visible'"
    for i in (*range(0, len(views), 2), 0):  # two in sight, and two that have just left it
        frames[i].evaluate("(frame) => frame.scrollIntoView()")
        for frame in (frames[i], frames[i + 1]):
            inside = frame.content_frame()
            inside.wait_for_function(DRAWN)
            inside.wait_for_function(f"{awake} && {visible}")
        eventually(page, lambda: sum(f.content_frame().evaluate(awake) for f in frames) <= 2)
    for view in views:
        view.close()


@pytest.mark.front_end
def test_a_page_that_moves_while_a_cell_runs_loads_once(notebook, page, viewer, standing):
    frame = displayed(notebook, page, viewer.show(standing))
    viewer.show(standing, title="the second frame")
    frame.wait_for_function(f"{TITLE} == 'the second frame'")
    page.evaluate(LOADS)
    with notebook.deaf() as said:
        page.evaluate("() => document.body.append(document.querySelector('.output'))")
        until(lambda: [content for _, content in said if content["say"] == "hello"])
        for _ in range(20):
            notebook.send_again()
            time.sleep(0.05)
        assert page.evaluate("loads") == 1
    frame = page.locator(".output iframe").element_handle().content_frame()
    frame.wait_for_function(f"{TITLE} == 'the second frame'")
    assert page.evaluate("loads") == 1


@pytest.mark.parametrize(("address", "reached"), [("", True), ("sealed", False)])
def test_frames_arrive_whether_or_not_the_notebook_may_reach_into_the_picture(
    notebook, page, viewer, standing, address, reached
):
    page.goto(f"{notebook.url}{address}")
    page.wait_for_function("window.started")
    page.evaluate(COUNTED)
    frame = displayed(notebook, page, viewer.show(standing))
    for i in range(3):
        viewer.show(standing, title=f"number {i}")
        frame.wait_for_function(f"{TITLE} == 'number {i}'")
    assert (page.evaluate("posted") == 0) == reached


@pytest.mark.front_end
@pytest.mark.parametrize("how", ["kernel", "window"])
def test_a_picture_outlives_its_kernel_or_window(notebook, page, viewer, standing, how):
    frame = displayed(notebook, page, viewer.show(standing))
    assert frame.evaluate(NOTICE) == "none"
    notebook.end() if how == "kernel" else viewer.close()
    frame.wait_for_function(f"{NOTICE} == 'block'")
    assert frame.evaluate("viewer.scene_tree.find(['meshcat', 'robot']).object.visible")
    picture(page, f"notebook_without_{how}")


def test_an_output_has_the_widget_and_an_image_or_the_scene(viewer, standing, monkeypatch):
    viewer.show(standing)
    data, _ = viewer._repr_mimebundle_()
    assert set(data) == {"application/vnd.jupyter.widget-view+json", "image/png", "text/plain"}
    with monkeypatch.context() as patch:
        patch.setenv("FLOATBASE_VIEWER", "static")
        shown = viewer._repr_mimebundle_()
    assert set(shown) == {"text/html"} and "srcdoc=" in shown["text/html"]
    assert viewer.url not in shown["text/html"]
    viewer.close()
    assert set(viewer._repr_mimebundle_()) == {"text/html"}


SAVED = (
    """import floatbase as fb
from floatbase.lessons import slider_panel, live_run, push_panel
robot = fb.load("go2")
view = fb.Viewer(robot, height=300)
view.show(robot.standing())""",
    """other = fb.Viewer(robot, height=300)
show = lambda z: other.show(robot.standing(), com=z > 0.5) and None
slider_panel(other, show, z=(0.0, 0.5, 1.0))""",
    """sim = fb.Simulation(robot)
third = fb.Viewer(robot, height=300)
third.show(sim.state)
controller = fb.WholeBodyController(robot, sim.feet, fb.standing_tasks(sim.state))
push_panel(live_run(sim, controller, third), third)""",
)


@pytest.mark.front_end
def test_a_saved_notebook_shows_every_picture_as_html(tmp_path):
    path, cells = tmp_path / "saved.ipynb", [new_code_cell(source) for source in SAVED]
    saved = NotebookClient(new_notebook(cells=cells), timeout=120).execute()
    # as docs say: a page with the state of widgets loads their code from another host
    command = [sys.executable, "-m", "nbconvert", "--to", "html", WITHOUT_STATE, str(path)]
    for with_state in (True, False):  # JupyterLab saves no state by default
        nbformat.write(saved, path)
        subprocess.run(command, check=True, capture_output=True, timeout=120)
        html = path.with_suffix(".html").read_text()
        assert html.count("<img") == html.count('src="data:image/png;base64,') == 3
        assert "127.0.0.1" not in html and "widget-" not in html and "unpkg" not in html
        if with_state:
            saved.metadata.pop("widgets")
    assert path.stat().st_size < 0.3 * MB
