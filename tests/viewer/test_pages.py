"""The pages: meshcat's script comes from the installed package."""

import hashlib
import subprocess
import sys

from floatbase.viewer.web import pages

MESHCAT_0_3_2 = "dd07b95fb6957cf6c18ee7cf3909b6eb28214995142428171a60d76c3358211f"
WITHOUT_MESHCAT = """
import sys
sys.modules["meshcat"] = None
import floatbase as fb
try:
    fb.Viewer
except fb.errors.MissingDependencyError as error:
    print(error)
"""


def test_the_pages_run_the_script_for_which_they_were_written():
    assert hashlib.sha256(pages.viewer_code()).hexdigest() == MESHCAT_0_3_2


def test_a_viewer_without_meshcat_names_the_extra_that_installs_it():
    command = [sys.executable, "-c", WITHOUT_MESHCAT]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert "meshcat" in told and "floatbase[viewer]" in told
