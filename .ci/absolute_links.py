"""Make the README's links to files absolute, because the package index has no files.

`python .ci/absolute_links.py https://github.com/OWNER/floatbase v0.1.0`, before the build.
"""

import re
import sys
from pathlib import Path

README = Path(__file__).resolve().parent.parent / "README.md"


def with_absolute_links(text: str, repository: str, reference: str) -> str:
    """A text whose pictures and links point to a tag or branch of the repository."""
    for start, kind in ((r"!\[", "raw"), (r"(?<!!)\[", "blob")):
        relative = rf"({start}[^]]*\]\()(?![a-z]+:|#)([^)]+\))"
        text = re.sub(relative, rf"\1{repository}/{kind}/{reference}/\2", text)
    return text


if __name__ == "__main__":
    text = README.read_text("utf-8")
    README.write_text(with_absolute_links(text, *sys.argv[1:]), "utf-8")
