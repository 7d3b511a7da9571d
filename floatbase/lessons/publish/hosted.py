"""Lessons on Colab, Kaggle and similar services: the cell that installs the course, and links.

The cell is only in the files of the repository, below the title. All tools of the course read the
lessons without it, and learners' copies lack it, because the course is installed there.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import floatbase as fb
from floatbase.lessons.publish.workspace import INSTALL_TAG, NOTEBOOKS

_CELL = """\
# On Colab, Kaggle and similar services, this cell installs the course.
# Elsewhere, it does nothing.
import site
from importlib.util import find_spec

if getattr(find_spec("floatbase"), "origin", None) is None:
    %pip install -q "floatbase[lessons]=={version}" numba=={numba}
    site.main()  # finds the new packages without a restart"""


def insert_install_cell(notebook: Any) -> None:
    """Insert the cell below the title of a lesson, in place.

    It names the numba for which a wheel contains the compiled controller. A folder named floatbase,
    such as a clone, is found without an origin and is not the installed course.
    """
    from nbformat.v4 import new_code_cell

    lock = (NOTEBOOKS.parent / "environment.txt").read_text(encoding="utf-8")
    (numba,) = re.findall(r"^numba==(\S+)", lock, flags=re.M)
    source = _CELL.format(version=fb.__version__, numba=numba)
    cell = new_code_cell(source, id=INSTALL_TAG, metadata={"tags": [INSTALL_TAG]})
    notebook.cells.insert(1, cell)


def colab_address(lesson: Path) -> str:
    """Return the address that opens a lesson of this version on Colab, or "".

    There is none before `pyproject.toml` has the address of the repository on GitHub.
    """
    file = NOTEBOOKS.parent / "pyproject.toml"
    project = tomllib.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    address = project.get("project", {}).get("urls", {}).get("Repository", "")
    match = re.fullmatch(r"https://github\.com/([^/]+/[^/]+?)(?:\.git)?/?", address)
    if not match:
        return ""
    folder = f"{match[1]}/blob/v{fb.__version__}/notebooks"
    return f"https://colab.research.google.com/github/{folder}/{lesson.name}"
