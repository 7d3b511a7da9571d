"""The web site: built without a warning, whole in itself, small, readable without network, and
found by its search.
"""

import html
import re
import subprocess
import sys
from functools import cache
from html.parser import HTMLParser
from urllib.parse import unquote, urlsplit

import nbformat
import pytest
from browsers import barriers, browser_of_a_file, needs_axe, needs_chromium, served
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output
from PIL import ImageFont

from floatbase.errors import InputError
from floatbase.lessons.publish import NOTEBOOKS, equations, read_notebook
from floatbase.lessons.publish.site import (
    add_links,
    mathml,
    prepare_lesson,
    replace_site,
    run_lessons,
)
from floatbase.lessons.questions import all_questions

pytestmark = [pytest.mark.front_end, pytest.mark.timeout(600)]
SHOWN = ["00_start_here.ipynb", "06_friction_cones.ipynb"]
ROOT = NOTEBOOKS.parent
FONT = "floatbase/lessons/publish/site/static/formulas.woff"
ITALIC = ((0x1D434, 0x1D454), (0x1D456, 0x1D467), (0x210E, 0x210E), (0x1D6FC, 0x1D714))
MOST = 3e6  # bytes of a page with its images
browser = browser_of_a_file


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A site of two lessons, as stored; the picture of its first page is run. Faults of Sphinx end
    it with an error.
    """
    folder = tmp_path_factory.mktemp("built") / "site"
    options = ["-m", "floatbase.lessons.publish", "site", "--stored", "--to", str(folder)]
    command = [sys.executable, *options, *(str(NOTEBOOKS / name) for name in SHOWN)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    return folder


class Page(HTMLParser):
    """What a page links to, loads and is linked by. links: what a reader may click. loaded: what a
    browser fetches.
    """

    def __init__(self, path):
        super().__init__()
        self.links, self.loaded, self.names = set[str](), set[str](), set[str]()
        self.alts = []
        self.described = False
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.names.add(given.get("id") or "")
        self.described |= tag == "meta" and given.get("name") == "description"
        leads = given.get("rel") in ("next", "prev", "search", "index")
        if tag == "a" or (tag == "link" and leads):
            self.links.add(given.get("href") or "")
        elif tag in ("link", "script", "img", "iframe"):
            self.loaded.add(given.get("href" if tag == "link" else "src") or "")
        if tag == "img":
            self.alts.append(given.get("alt") or "")


@cache
def page_at(path):
    return Page(path)


def pages(folder):
    return (path for path in sorted(folder.rglob("*.html")) if "_static" not in path.parts)


def test_every_link_within_the_site_leads_somewhere(built):
    wrong = []
    for path in pages(built):
        for link in page_at(path).links | page_at(path).loaded:
            parts = urlsplit(link)
            if parts.scheme or not link:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            has_place = parts.fragment and target.suffix == ".html"
            place = unquote(parts.fragment) if has_place else ""
            if not target.is_file() or (place and place not in page_at(target).names):
                wrong.append(f"{path.relative_to(built)}: {link}")
    assert not wrong, "\n".join(wrong)


def test_no_page_loads_anything_from_elsewhere_or_is_large(built):
    wrong = []
    for path in pages(built):
        loaded = page_at(path).loaded
        away = [link for link in loaded if urlsplit(link).scheme not in ("", "data")]
        wrong += [f"{path.name} loads {link}" for link in away]
        own = [path, *(path.parent / link for link in loaded if "_images" in link)]
        size = sum(file.stat().st_size for file in own)
        wrong += [f"{path.name} has {size / 1e6:.1f} MB"] if size > MOST else []
    assert not wrong, "\n".join(wrong)


def test_pages_say_what_they_are_and_figures_what_they_show(built):
    made = {"genindex.html", "py-modindex.html", "search.html"}
    texts = [path for path in pages(built) if not made & set(path.parts)]
    assert len(texts) > 25
    assert [path.name for path in texts if not page_at(path).described] == []
    assert [path.name for path in texts if "" in page_at(path).alts] == []


def test_equations_and_functions_lead_to_each_other(built):
    map_page = page_at(built / "lessons" / "equations.html")
    for entry in equations.entries():
        package, name = entry.path.split(".", 1)
        assert f"../api/floatbase.{package}.html#floatbase.{package}.{name}" in map_page.links
        back = {f"../lessons/equations.html#{number}" for number in map(anchor, entry.equations)}
        assert back <= page_at(built / "api" / f"floatbase.{package}.html").links
    assert {anchor(number) for number in equations.TITLES} <= map_page.names


def test_no_page_tells_its_reader_that_it_is_generated(built):
    for path in pages(built):
        shown = re.sub("<!--.*?-->", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
        assert "lessons.publish map" not in shown or path.name == "contributing.html", path


def anchor(number):
    return f"app-{number[-1].lower()}" if number.startswith("App") else f"eq-{number.strip('()')}"


# controls that a screen reader cannot name by what they show, and definitions without terms
UNNAMED = """() => [...document.querySelectorAll("summary, button")].some((control) => {
  const label = control.ariaLabel ?? control.title, words = control.innerText.trim();
  return !(label || control.textContent.trim()) || (control.ariaLabel && !label.includes(words));
}) || [...document.querySelectorAll("dl")].some((list) => !list.querySelector(":scope > dt"))"""


@needs_chromium
def test_pages_ask_nobody_for_anything_and_fit_a_phone(built, browser):
    page = browser.new_page(viewport={"width": 390, "height": 800})
    asked, said, wide, unnamed = [], [], [], []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda line: said.append(line.text) if line.type == "error" else None)
    page.on("pageerror", lambda error: said.append(str(error)))
    for path in pages(built):
        page.goto(path.as_uri())
        wide += [path.name] if page.evaluate("document.documentElement.scrollWidth") > 390 else []
        unnamed += [path.name] if page.evaluate(UNNAMED) else []
    page.close()
    assert unnamed == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:", "about:"))] == []
    assert (said, wide) == ([], [])


# one page of each kind; the first two have a live robot in a frame
KINDS = (
    "index.html", "live.html", "recall.html", "search.html", "lessons/06_friction_cones.html",
    "lessons/equations.html", "api/floatbase.control.html", "teaching.html", "references.html",
    "_static/lecture.html",
)  # fmt: skip


@needs_axe
@needs_chromium
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_readers_with_a_screen_reader_or_weak_eyes_meet_no_serious_barrier(built, browser, scheme):
    page, found = browser.new_page(color_scheme=scheme), {}
    with served(built) as address:
        for name in KINDS:
            page.goto(f"{address}/{name}")
            if name == "live.html" and (built / "_static" / "live").exists():
                page.wait_for_selector("floatbase-robot iframe")
                robot = page.frames[-1]
                robot.wait_for_selector("#panel input", state="attached")
                robot.click("#fold")  # in a narrow frame, the panel is folded at first
                robot.wait_for_selector("#panel input")
            found[name] = barriers(page)
    page.close()
    assert {name: faults for name, faults in found.items() if faults} == {}


SEARCHES = {
    "install": "Installation and troubleshooting",
    "jupyterhub": "Teaching with floatbase",
    "friction cone": "06 · Friction cones",
    "infeasible": "Constraints and priorities",
    "custom task": "Whole-body controller",
    "urdf": "Your own robot",
    "humanoid": "Walking",
    "walking": "Walking",
    "push recovery": "Push recovery and parameter sweeps",
    "mp4": "Viewer in notebooks, pages and films",
    "dark mode": "Viewer in notebooks, pages and films",
    "contact forces": "Simulation and rollouts",
    "equations": "Equations",
    "numba cache": "Installation and troubleshooting",
    "cite": "References",
    "push my robot": "Live robots",
    "how do I push my robot": "Push recovery and parameter sweeps",
    "rnea returns 18 values but I have 12 motors": "Questions",
    "osqp needs many iterations after a warm start": "Questions",
    "center of pressure of each foot": "Questions",
    "exercise": "06 · Friction cones",
}


@needs_chromium
def test_excerpts_of_search_results_are_sentences(built, browser):
    page = browser.new_page()
    page.goto((built / "search.html").as_uri())
    found = """<nav><p>A cone in a list.</p></nav><div class=cell><p>cone = 0</p></div>
        <p>First. A cone opens. It has a tip.</p>"""
    whole = f"<main role=main><ul><li>A cone menu</ul><article>{found}</article></main>"
    summary = f"Search.makeSearchSummary(`{whole}`, ['cone'], '')"
    assert page.evaluate(f"{summary}.textContent") == "A cone opens. It has a tip."
    with served(built) as address:  # a page from disk cannot fetch what it searches
        page.goto(f"{address}/search.html?q=rnea+returns+18+values")
        result = page.locator("#search-results li", has=page.locator(".context")).first
        assert "#inverse-dynamics-gives-18" in (result.locator("a").get_attribute("href") or "")
        assert "has no motor" in result.inner_text()
    page.close()


@needs_chromium
def test_search_lists_the_right_page_among_the_first_three(built, browser):
    page, found = browser.new_page(), {}
    results = page.locator("#search-results li > a")
    for words in SEARCHES:
        page.goto((built / "search.html").as_uri() + f"?q={words.replace(' ', '+')}")
        results.first.wait_for(timeout=20_000)
        page.wait_for_timeout(500)  # results are listed one after the other
        found[words] = [text.split(" > ")[0].strip() for text in results.all_inner_texts()[:3]]
    page.close()
    missed = [words for words, title in SEARCHES.items() if title not in found[words]]
    assert missed == [], found


def test_a_second_build_replaces_its_own_files_and_no_others(tmp_path):
    built, folder = tmp_path / "built", tmp_path / "gh-pages"
    (built / "api").mkdir(parents=True)
    (folder / ".git").mkdir(parents=True)
    (folder / ".git" / "config").write_text("unpushed")
    (folder / ".buildinfo").write_text("of another project")
    for name in ("index.html", "api/old.html"):
        (built / name).write_text("first")
    replace_site(built, folder)
    (built / "api/old.html").unlink()
    (built / "index.html").write_text("second")
    replace_site(built, folder)
    assert (folder / "index.html").read_text() == "second"
    assert not (folder / "api/old.html").exists()
    assert (folder / ".git" / "config").read_text() == "unpushed"
    assert (folder / ".buildinfo").read_text() == "of another project"
    (built / "CNAME").write_text("ours")
    (folder / "CNAME").write_text("x.org")
    with pytest.raises(InputError, match="CNAME"):
        replace_site(built, folder)
    assert (folder / "CNAME").read_text() == "x.org"
    (built / "CNAME").unlink()
    for target in ("kept.html", "missing.html"):
        (tmp_path / "kept.html").write_text("kept")
        (folder / "index.html").unlink()
        (folder / "index.html").symlink_to(tmp_path / target)
        with pytest.raises(InputError, match="index.html"):
            replace_site(built, folder)
    assert (tmp_path / "kept.html").read_text() == "kept"
    assert not (tmp_path / "missing.html").exists()


class NoPictures:
    def place(self, data, alt):
        return f"<b>{alt}</b>" if "scene" in data else None


def test_a_lesson_shows_what_was_found_and_says_what_needs_a_kernel():
    widget = "application/vnd.jupyter.widget-view+json"
    image, wide = {widget: {}, "image/png": "…"}, {"image/png": {"width": 300}}
    outputs = [
        new_output("stream", name="stderr", text="compiling"),
        new_output("stream", name="stdout", text="\x1b[1mfound\x1b[0m"),
        new_output("display_data", {"scene": "…", widget: {}}),
        new_output("display_data", image, metadata=wide),
        new_output("display_data", {"text/html": "<svg/>"}),
        new_output("display_data", {widget: {}, "text/plain": "Widget()"}),
    ]
    cells = [
        new_markdown_cell(
            "# 07 · A page\n\nIt *says* what (7) is, as lesson 06 and [lesson 08](08.ipynb) do.\n\n"
            "## Curve"
        ),
        new_code_cell("draw()", outputs=outputs, metadata={"alt": "A <curve> falls."}),
        new_code_cell('predict("07.a", ...)', metadata={"prediction": "07.a"}),
        new_code_cell("draw()", metadata={"tags": ["picture"]}),
        new_code_cell("assert found", metadata={"tags": ["claims"]}),
        new_code_cell("x = ...", metadata={"tags": ["exercise"]}),
        new_code_cell('check("07.1", x)', metadata={"tags": ["check"]}, outputs=outputs),
        new_code_cell('review("07")', outputs=outputs),
    ]
    made = prepare_lesson(new_notebook(cells=cells), NoPictures(), {"06": "06_cones.ipynb"})
    text, draw, asked, _, missing, opening, claims, _, stub, check, said = made.cells
    assert "what [(7)](#eq-7) is, as [lesson 06](06_cones.ipynb) and lesson 08 do" in text.source
    printed, scene, image, drawing = draw.outputs
    assert (printed.text, scene.data) == ("found", {"text/html": "<b>A <curve> falls.</b>"})
    label = 'role="figure" aria-label="A &lt;curve&gt; falls."'
    assert drawing.data == {"text/html": f"<div {label}><svg/></div>"}
    assert list(image.data) == ["image/png"]
    assert draw.metadata["mystnb"]["image"] == {"alt": "A <curve> falls.", "width": "300px"}
    assert all(choice in asked.source for choice in all_questions()["07.a"].choices)
    assert "(../installation.md)" in asked.source
    assert "without running" in missing.source and "1 claim," in opening.source
    assert (claims.source, stub.source) == ("assert found", "x = ...")
    assert check.cell_type == said.cell_type == "markdown"
    assert "(../installation.md)" in check.source
    assert made.metadata["myst"]["html_meta"]["description"].startswith("It says what (7) is")


def test_a_lesson_is_run_again_when_it_has_changed(tmp_path):
    lesson, kept = tmp_path / "07_page.ipynb", tmp_path / "kept"
    for printed in ("once", "once", "twice"):
        nbformat.write(new_notebook(cells=[new_code_cell(f"print({printed!r})", id="a")]), lesson)
        before = set(kept.glob("*"))
        ran = run_lessons([lesson], kept)[lesson]
        assert ran.cells[0].outputs[0].text == f"{printed}\n" and len(ran.cells) == 1
        assert (set(kept.glob("*")) == before) == (printed == "once" and bool(before))
    assert len(list(kept.iterdir())) == 1


def test_links_leave_code_formulas_and_links_as_they_are():
    formulas = ["$h (7)$", "$$x (7)\n(8)$$"]
    for text in [
        *formulas,
        "`f(7)`",
        "```\n(7)\n```",
        "[as (7)](x.md)",
        "## On (7)",
        "f(7)",
        "(99)",
    ]:
        assert add_links(text, {}) == text
    assert add_links("(26)(27), §4.1, App. A, note 12", {}) == (
        "[(26)](#eq-26)[(27)](#eq-27), [§4.1](#sec-4-1), [App. A](#app-a), [note "
        "12](#notes-of-the-document)"
    )


def test_every_formula_of_the_course_becomes_mathml_in_the_font_of_the_site():
    cells = [cell for path in NOTEBOOKS.glob("*.ipynb") for cell in read_notebook(path).cells]
    texts = [cell.source for cell in cells if cell.cell_type == "markdown"]
    texts += [path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md")]
    plain = "\n\n".join(re.sub(r"`[^`\n]*`", "", text) for text in [*texts, equations.table()])
    found = re.findall(r"\$\$(.+?)\$\$|\$([^$\n]+?)\$", plain, re.DOTALL)
    assert len(found) > 300
    letters = set()
    for latex in {block or inline for block, inline in found}:
        drawn = mathml.mathml(re.sub(r"\\tag\{.*?\}", "", latex), "block")
        assert "\\" not in re.sub(r"<annotation.*?</annotation>|&#x0005C;", "", drawn), latex
        letters |= set(html.unescape(re.sub(r"<annotation.*?</annotation>|<[^>]*>", "", drawn)))
    # browsers draw a single letter as one of these
    italic = {chr(code) for first, last in ITALIC for code in range(first, last + 1)}
    font = ImageFont.truetype(ROOT / FONT, 40)
    missing = bytes(font.getmask("\uffff"))
    shown = sorted(letter for letter in letters | italic if not letter.isspace())
    assert [letter for letter in shown if bytes(font.getmask(letter)) == missing] == []
