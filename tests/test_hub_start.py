"""What the hub's configuration does when a student's server starts and ends; no hub is needed."""

import os
import runpy
import subprocess
import sys
from pathlib import Path
from unittest.mock import MagicMock

from waiting import until

CONFIGURATION = Path(__file__).parent.parent / ".binder" / "jupyterhub_config.py"


def test_a_python_in_a_folder_with_a_blank_starts_and_leaves_no_folder(tmp_path, monkeypatch):
    python, log = tmp_path / "a folder" / "python", tmp_path / "log"
    python.parent.mkdir()
    python.write_text('#!/bin/sh\ntest -d "$JUPYTER_RUNTIME_DIR" && echo "$@" >>"$LOG"\n')
    python.chmod(0o700)
    monkeypatch.setattr(sys, "executable", str(python))
    start = runpy.run_path(str(CONFIGURATION), {"get_config": MagicMock})["START"]
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    environment = {"LOG": str(log), "TMPDIR": str(temporary), "HOME": str(tmp_path)}
    command = ["sh", "-c", start, "floatbase", "--an option"]
    subprocess.run(command, env=os.environ | environment, check=True)
    assert log.read_text().splitlines() == [
        f"-m floatbase.lessons.publish workspace --to {tmp_path}/floatbase",
        "-m jupyterhub.singleuser --an option",
    ]
    until(lambda: not list(temporary.iterdir()))
