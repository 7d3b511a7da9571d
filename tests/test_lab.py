"""JupyterLab in a real browser: two lessons run without an error, each of their pictures answers to
its sliders, and reopened without a kernel each is an image.

The browser reaches JupyterLab's own address and nothing else, as that of a reader whose kernel is
on another machine. What JupyterLab saves of a lesson that was only run and looked at does not count
as a learner's writing.

What the lessons compute is test_notebooks' business, what all other sliders do is tests/lessons':
both need no browser.
"""

import json
import shutil

import nbformat
import pytest
from browsers import browser_of_a_file, needs_chromium
from labs import (
    LONG,
    NOTEBOOK,
    WINDOW,
    address_in,
    answers_to_sliders,
    is_heard_while_the_kernel_works,
    lesson_opened,
    only,
    push_panel_of,
    push_until_it_falls,
    ran_without_error,
    run_all,
    screenshot,
    server,
)

from floatbase.lessons.publish import MY_FOLDER, NOTEBOOKS, prepare_workspace, read_notebook

# a robot that is simulated under the page; panels of many sliders
LESSONS = ("00_start_here", "03_feasible_space")
# in their pictures; the ghost is the veil
MOVES = {LESSONS[0]: {"robot"}, LESSONS[1]: {"robot", "ghost", "planned"}}

pytestmark = [pytest.mark.front_end, needs_chromium, pytest.mark.timeout(600)]

# what a reader may press; none of it is writing
LOOKS = (
    "notebook:hide-all-cell-code", "notebook:hide-all-cell-outputs",
    "notebook:enable-output-scrolling",
    "notebook:collapse-all-headings", "notebook:insert-cell-below",
)  # fmt: skip
SAVE = f"""async () => {{
  for (const name of {list(LOOKS)}) await window.jupyterapp.commands.execute(name);
  await {NOTEBOOK}.context.save();
}}"""
# settings of JupyterLab that make it save more than by default
SETTINGS = {
    "@jupyterlab/notebook-extension/tracker": {"recordTiming": True},
    "@jupyter-widgets/jupyterlab-manager/plugin": {"saveState": True},
}


@pytest.fixture(scope="module")
def course(tmp_path_factory):
    """A course of these lessons, prepared for a learner: without outputs, so that what is seen was
    made here.
    """
    folder = tmp_path_factory.mktemp("course")
    for name in LESSONS:
        shutil.copy(NOTEBOOKS / f"{name}.ipynb", folder)
    prepare_workspace(folder)
    return folder


@pytest.fixture(scope="module")
def lab(course, tmp_path_factory):
    """The address of a JupyterLab for that learner."""
    home = tmp_path_factory.mktemp("home")
    for name, setting in SETTINGS.items():
        place = home / "lab" / "user-settings" / f"{name}.jupyterlab-settings"
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(json.dumps(setting))
    options = ["--no-browser", "--ip=127.0.0.1", "--port=0", "--allow-root"]
    options += ["--IdentityProvider.token=a-test", "--LabApp.expose_app_in_browser=True"]
    with server(["jupyterlab", *options, str(course)], home) as (_, log):
        yield address_in(log)


browser = browser_of_a_file


@pytest.mark.parametrize("name", LESSONS)
def test_a_lesson_runs_its_pictures_answer_to_their_sliders_and_nothing_of_it_counts_as_writing(
    lab, course, browser, name
):
    page = browser.new_page(**WINDOW)
    page.set_default_timeout(1000 * LONG)
    strangers = only(page, lab)
    try:
        page.goto(f"{lab}/lab/workspaces/{name}/tree/{MY_FOLDER}/{name}.ipynb?token=a-test")
        lesson_opened(page)
        run_all(page)
        ran_without_error(page)
        assert answers_to_sliders(page, name) >= MOVES[name]
        if name == LESSONS[0]:
            push_until_it_falls(page, push_panel_of(page), "00")
            is_heard_while_the_kernel_works(page, push_panel_of(page))
        assert strangers == []
        page.evaluate(SAVE)
        _shows_images_when_reopened(page, lab, course / MY_FOLDER / f"{name}.ipynb")
        _change(course / f"{name}.ipynb")
        assert prepare_workspace(course) == [f"{name}.ipynb: updated"]
    finally:
        screenshot(page, f"{name.split('_')[0]}_end")
        page.evaluate("() => window.jupyterapp?.serviceManager.sessions.shutdownAll()")
        page.close()


def _shows_images_when_reopened(page, lab, lesson):
    """Open the pictures of a saved lesson with a new kernel, which does not know its widgets."""
    notebook = nbformat.read(lesson, as_version=4)
    notebook.metadata.pop("widgets")  # as JupyterLab saves by default
    notebook.cells = [cell for cell in notebook.cells if "widget-view" in str(cell.get("outputs"))]
    for cell in notebook.cells:
        for name in set(cell.metadata) - {"alt"}:
            del cell.metadata[name]  # its output is hidden, see LOOKS
    nbformat.write(notebook, lesson.with_name("reopened.ipynb"))
    assert notebook.cells
    page.goto(f"{lab}/lab/workspaces/reopened/tree/{MY_FOLDER}/reopened.ipynb?token=a-test")
    lesson_opened(page)
    for number in range(len(notebook.cells)):
        page.evaluate(f"(number) => {NOTEBOOK}.content.scrollToItem(number)", number)
        image = page.locator(".jp-Notebook .jp-Cell").nth(number).locator(".jp-OutputArea img")
        image.first.wait_for()
        text = json.dumps(notebook.cells[number].metadata["alt"])
        page.wait_for_function(
            f"(number) => document.querySelectorAll('.jp-Notebook .jp-Cell')[number]"
            f".querySelector('.jp-OutputArea img').alt === {text}",
            arg=number,
        )
    assert "Error displaying widget" not in page.locator(".jp-Notebook").inner_text()


def _change(lesson):
    notebook = read_notebook(lesson)
    notebook.cells[0].source += "."
    nbformat.write(notebook, lesson)
