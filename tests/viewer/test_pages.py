"""The pages: the vendored files match their notice."""

import hashlib
from pathlib import Path

from floatbase.viewer.web import pages

VENDOR = Path(pages.__file__).with_name("vendor")


def test_meshcats_viewer_is_the_one_that_its_notice_names():
    assert hashlib.sha256(pages.viewer_code()).hexdigest() in (VENDOR / "README.md").read_text()
    assert "MIT License" in (VENDOR / "meshcat.LICENSE.txt").read_text()
