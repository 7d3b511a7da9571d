"""`floatbase lab`: the learner's copy of the course in JupyterLab."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from floatbase.errors import FloatbaseError
from floatbase.lessons.publish.workspace import prepare_workspace

FIRST = "00_start_here.ipynb"
# JupyterLab saves twice a minute, installs no extensions, does not look for news, updates and
# language servers, and shows the stored image of a picture whose kernel has gone
SETTINGS = Path(__file__).parent / "jupyter"
_TABS = ".open_tabs"  # kept with the copy, so that tabs of another copy do not open


def open_lab(folder: Path, arguments: Sequence[str] = ()) -> None:
    """Update the lessons in a folder, and become JupyterLab there.

    A second process compiles the controller if necessary. The first cell that needs the controller
    waits for this process.
    """
    if find_spec("jupyterlab") is None:
        raise FloatbaseError(
            'JupyterLab is not installed. Install the course with pip install "floatbase[course]".'
        )
    messages = prepare_workspace(mine=folder)
    others = [message for message in messages if not message.endswith(": new")]
    print(*others, sep="\n", end="\n" if others else "")
    if len(others) < len(messages):
        print(f"{len(messages) - len(others)} new files in {folder}.")
    print("To stop JupyterLab, press Ctrl-C here, then y and Enter.", flush=True)
    subprocess.Popen(
        [sys.executable, "-m", "floatbase", "compile"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    folders = [str(SETTINGS), *filter(None, [os.environ.get("JUPYTER_CONFIG_PATH")])]
    os.environ["JUPYTER_CONFIG_PATH"] = os.pathsep.join(folders)
    os.execv(sys.executable, [sys.executable, "-m", "jupyterlab", *_options(folder), *arguments])


def _options(folder: Path) -> list[str]:
    """Return the options of JupyterLab."""
    root = folder.resolve()
    options = [
        f"--ServerApp.root_dir={root}",
        f"--LabApp.default_url=/lab/tree/{FIRST}",
        f"--LabApp.workspaces_dir={root / _TABS}",
    ]
    is_root = hasattr(os, "geteuid") and os.geteuid() == 0
    return [*options, "--allow-root"] if is_root else options
