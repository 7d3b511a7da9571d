"""Write whole files."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path


@contextmanager
def whole_file(path: Path, keep_link: bool = False) -> Iterator[Path]:
    """Give the path of a new file, which replaces `path` when the block ends without an error.

    An interrupt, an error or a full disk leaves the former file as it was. The new file gets the
    former one's permissions. A device or a pipe cannot be replaced and is written itself.

    With `keep_link`, a link stays and the file that it names is replaced; otherwise the new file
    replaces the link.
    """
    if path.exists() and not path.is_file():
        yield path
        return
    if keep_link:
        path = Path(os.path.realpath(path))
    for number in count():  # a process that was killed may have left a file of the same name
        part = path.with_name(f".floatbase-{os.getpid()}-{number}.part")
        try:
            part.open("xb").close()
        except FileExistsError:
            continue
        break
    try:
        yield part
        if path.is_file() and not path.is_symlink():
            shutil.copymode(path, part)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def write_whole(path: Path, text: bytes, keep_link: bool = False) -> None:
    """Write a whole file or nothing; see `whole_file`."""
    with whole_file(path, keep_link) as part:
        part.write_bytes(text)
