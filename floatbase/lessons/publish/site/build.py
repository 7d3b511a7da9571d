"""Build the site: run the lessons, collect all sources in one folder, and run Sphinx on it."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import nbformat
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from floatbase._files import write_whole
from floatbase.errors import FloatbaseError, InputError
from floatbase.lessons.publish import conventions, equations
from floatbase.lessons.publish.contents import equation_ranges, title_of
from floatbase.lessons.publish.hosted import colab_address
from floatbase.lessons.publish.notebooks import read_notebook
from floatbase.lessons.publish.pictures import Pictures
from floatbase.lessons.publish.site import lecture, recall, reference
from floatbase.lessons.publish.site.accessible import accessible
from floatbase.lessons.publish.site.addresses import addresses
from floatbase.lessons.publish.site.live_robots import (
    LIVE_FOLDER,
    METADATA,
    add_robot,
    robot_script,
)
from floatbase.lessons.publish.site.outputs import prepare_lesson, run_lessons
from floatbase.lessons.publish.site.references import NOTES_ANCHOR, add_links, anchor_of
from floatbase.lessons.publish.workspace import NOTEBOOKS, lesson_notebooks
from floatbase.live import folder as live_folder

SITE = Path("build/site")
_ROOT = NOTEBOOKS.parent
DOCS = _ROOT / "docs"  # the texts of the site's own pages
RUN_FOLDER = _ROOT / "build" / "site-run"  # lessons that were run
# addresses in the repository, as the pages of docs link to them -> addresses in the site
_MOVED = {
    "notebooks/": "lessons/",
    "benchmarks/": "benchmarks/",
    "examples/": "examples/",
    "CHANGELOG.md": "changelog.md",
}
_FIRST_ALT = (
    "A four-legged robot is pushed to its left. It lifts two feet at a time, places them further "
    "to the left, and stands again."
)
_NO_LIVE = "This build has no live robots, because npm could not install MuJoCo for JavaScript."
_FILE_LIST = ".floatbase-site"  # names of the files that the last build wrote
_HEADINGS = re.compile(r"^##+ (\(\d+\)|§\S+|App\. [ABC]) .+$", re.MULTILINE)
_FUNCTIONS = re.compile(r"`([a-z_]+\.\w+(?:\.\w+)?)`")


def build(folder: Path = SITE, lessons: Sequence[Path] | None = None, stored: bool = False) -> Path:
    """Build the site."""
    known = list(lesson_notebooks().values())
    shown = known if lessons is None else sorted(path.resolve() for path in lessons)
    for path in shown:
        if path not in known:
            raise InputError(f"There is no lesson {path}. The lessons are in {NOTEBOOKS}.")
    *notebooks, scene = run_lessons(
        [*([] if stored else shown), _front_page_notebook()], RUN_FOLDER
    ).values()
    has_live = live_folder.install_mujoco() is not None
    if not has_live:
        print(_NO_LIVE)
    with tempfile.TemporaryDirectory(prefix="floatbase-") as place:
        source, built = Path(place) / "source", Path(place) / "site"
        pictures = Pictures(built / "_static")
        shutil.copytree(DOCS, source)
        shutil.copytree(_ROOT / "examples", source / "examples")
        (source / "benchmarks").mkdir()
        ran = dict(zip(shown, notebooks or map(read_notebook, shown), strict=True))
        _write_lessons(source, ran, pictures, has_live)
        _write_texts(source, shown, _first_picture(scene, pictures), has_live)
        _write_reference(source / "api")
        _run_sphinx(source, built)
        for path in built.rglob("*.html"):
            write_whole(path, accessible(path.read_text(encoding="utf-8")).encode())
        pictures.write()
        lecture.write_slides(built / "_static" / lecture.SLIDES, in_site=True)
        if has_live:
            live_folder.write(built / "_static" / LIVE_FOLDER)
        recall.write_script(shown, built / "_static")
        replace_site(built, folder)
    return folder / "index.html"


def replace_site(built: Path, folder: Path) -> None:
    """Replace the files of an earlier build in `folder`. All other files stay, such as a .git."""
    for unused in built.rglob("*.map"):  # source maps of the theme
        unused.unlink()
    names = {path.relative_to(built).as_posix() for path in built.rglob("*") if path.is_file()}
    listed = folder / _FILE_LIST
    earlier = set(listed.read_text(encoding="utf-8").splitlines()) if listed.is_file() else set()
    earlier = {name for name in earlier if ".." not in name and not Path(name).is_absolute()}
    # a link may point to any file of the user, whoever wrote it
    if foreign := sorted(
        name
        for name in names
        if (folder / name).is_symlink() or (name not in earlier and (folder / name).exists())
    ):
        raise InputError(
            f"{folder / foreign[0]} was not written by an earlier build of the site, so it is not "
            f"replaced. Choose another folder, or move the file."
        )
    folder.mkdir(parents=True, exist_ok=True)
    # listed before they are copied, so that an interrupted build can be repeated
    write_whole(listed, "".join(f"{name}\n" for name in sorted(names)).encode())
    for name in sorted(earlier - names):
        (folder / name).unlink(missing_ok=True)
    shutil.copytree(built, folder, dirs_exist_ok=True)


def _front_page_notebook() -> Path:
    """Write a notebook that plays the animation of the first page."""
    code = 'from floatbase.lessons.figures import stepping\n\nstepping("light", height=420)'
    notebook = new_notebook(cells=[new_code_cell(code, id="picture")])
    path = RUN_FOLDER / "first_page.ipynb"
    path.parent.mkdir(parents=True, exist_ok=True)
    nbformat.write(notebook, path)
    return path


def _write_lessons(
    source: Path, notebooks: dict[Path, Any], pictures: Pictures, has_live: bool
) -> None:
    """Write the page of each lesson."""
    addresses = {path.name.split("_")[0]: path.name for path in notebooks}
    (source / "lessons").mkdir()
    for path, notebook in notebooks.items():
        prepared = prepare_lesson(notebook, pictures, addresses)
        if colab := colab_address(path):
            link = f"[Open this lesson in Colab]({colab}) to run it and to change it."
            prepared.cells.insert(1, new_markdown_cell(link))
        robot = prepared.metadata.pop(METADATA, None)
        if has_live and robot:
            add_robot(prepared, robot)
        nbformat.write(prepared, source / "lessons" / path.name)


def _first_picture(notebook: Any, pictures: Pictures) -> str:
    """Return the first picture of a notebook as HTML."""
    outputs = (output for cell in notebook.cells for output in cell.outputs)
    data = next(output.data for output in outputs if "data" in output)
    image = f"data:image/png;base64,{data.get('image/png')}"
    return pictures.place(data, _FIRST_ALT) or f'<img alt="{_FIRST_ALT}" src="{image}">'


def _toctrees(lessons: Sequence[Path]) -> str:
    """Write the list of lessons for the side bar."""
    listed = {"The course": [path for path in lessons if path.name[0].isdigit()]}
    listed["Appendices and more"] = [path for path in lessons if not path.name[0].isdigit()]
    trees = []
    for caption, paths in listed.items():
        pages = "".join(f"lessons/{path.stem}\n" for path in paths)
        trees.append(f"```{{toctree}}\n:hidden:\n:caption: {caption}\n\n{pages}```")
    return "\n\n".join(trees)


def _lesson_table(known: Iterable[Path]) -> str:
    rows = [
        f"| [{title_of(path)}](lessons/{path.name}) | {equation_ranges(path)} |" for path in known
    ]
    return "\n".join(["| lesson | equations |", "|---|---|", *rows])


def _write_texts(source: Path, lessons: Sequence[Path], scene: str, has_live: bool) -> None:
    """Write all pages that are not lessons, with their links, and copy the benchmark figures."""
    live = robot_script("_static/") if has_live else f"\n<p>{_NO_LIVE}</p>\n"
    made = {
        "lessons/equations.md": _with_anchors(equations.table()),
        "lessons/conventions.md": conventions.page(),
        "lessons/how_to.md": (NOTEBOOKS / "how_to.md").read_text(encoding="utf-8"),
        "lecture.md": lecture.page(),
        "changelog.md": (_ROOT / "CHANGELOG.md").read_text(encoding="utf-8"),
    }
    for name, text in made.items():
        (source / name).write_text(text, encoding="utf-8")
    for path in [*_ROOT.glob("benchmarks/*.md"), *_ROOT.glob("benchmarks/*.png")]:
        shutil.copy(path, source / "benchmarks")
    for path in source.rglob("*.md"):
        text = path.read_text(encoding="utf-8")
        if path.parent == source:
            for there, here in _MOVED.items():
                text = text.replace(f"(../{there}", f"({here}")
        for name, part in {
            "scene": scene,
            "lessons": _lesson_table(lessons),
            "toctrees": _toctrees(lessons),
            "live script": live,
            "recall": recall.recall_box("_static/", offers_first=True),
        }.items():
            text = text.replace(f"{{{name}}}", part) if path.parent == source else text
        way = {source: "lessons/", source / "lessons": ""}.get(path.parent, "../lessons/")
        addresses = {lesson.name.split("_")[0]: way + lesson.name for lesson in lessons}
        path.write_text(_front_matter(text) + add_links(text, addresses), encoding="utf-8")


def _front_matter(text: str) -> str:
    """Write the description that search engines show: the first plain paragraph of a page."""
    paragraphs = (part for part in text.split("\n\n") if re.match(r"[A-Za-z`*]", part))
    plain = re.sub(r"\[([^\]]*)\]\([^)]*\)|[*$`\\\"{}]", r"\1", next(paragraphs, ""))
    about = " ".join(plain.split())[:200]
    return f'---\nmyst:\n  html_meta:\n    description: "{about}"\n---\n\n'


def _write_reference(target: Path) -> None:
    target.mkdir()
    for name, text in reference.pages().items():
        (target / name).write_text(text, encoding="utf-8")


def _with_anchors(page: str) -> str:
    """Add link targets to the page of equations, and link its functions to the API reference."""
    known = addresses()

    def link(match: re.Match[str]) -> str:
        address = known.get(f"floatbase.{match[1]}")
        return f"{{py:obj}}`{match[1]} <{address}>`" if address else match[0]

    notes = "## Notes of the course text"
    page = page.replace(notes, f"({NOTES_ANCHOR})=\n{notes}")
    page = _HEADINGS.sub(lambda match: f"({anchor_of(match[1])})=\n{match[0]}", page)
    return _FUNCTIONS.sub(link, page)


def _run_sphinx(source: Path, folder: Path) -> None:
    """Run Sphinx; a warning is an error."""
    from sphinx.cmd.build import build_main

    options = ["-q", "-W", "--keep-going", "-E", "-j", "2"]
    options += ["-c", str(Path(__file__).parent)]  # of conf.py
    options += ["-d", str(source / ".doctrees")]
    if build_main([*options, str(source), str(folder)]):
        raise FloatbaseError("Sphinx reported the problems above; the site is incomplete.")
