"""Read and write whole files."""

from __future__ import annotations

import errno
import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any

from floatbase.errors import InputError, short_repr

# bytes: a text that people write, and a file that programs fill
LARGEST_TEXT, LARGEST_DATA = 50_000_000, 1_000_000_000
_NONBLOCK = getattr(os, "O_NONBLOCK", 0)  # with it, opening a pipe does not wait; not on Windows


def open_file(path: str | Path, flags: int) -> int:
    """Open a file by `os.open`. A pipe or a device, which may never end, is an `OSError`."""
    file = os.open(path, flags | _NONBLOCK, 0o666)
    if stat.S_ISREG(os.fstat(file).st_mode):
        return file
    os.close(file)
    raise OSError(errno.EINVAL, "it is a folder, a pipe or a device", os.fspath(path))


def read_file(path: str | Path, largest: int = LARGEST_TEXT) -> bytes:
    """Read a whole file. One with more than `largest` bytes is an `OSError`."""
    with open(path, "rb", opener=open_file) as file:
        size = os.fstat(file.fileno()).st_size
        if size <= largest:
            return file.read(size)
    raise OSError(errno.EFBIG, f"it is larger than {largest / 1e6:g} MB", os.fspath(path))


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
        except OSError as error:  # people know the file's name, not that of the new one
            error.filename = str(path)
            raise
        break
    try:
        yield part
        if path.is_file() and not path.is_symlink():
            shutil.copymode(path, part)
        part.replace(path)
    except OSError as error:  # the system names no file when a disk is full
        error.filename = error.filename or str(path)
        raise
    finally:
        part.unlink(missing_ok=True)


def write_whole(path: Path, text: bytes, keep_link: bool = False) -> None:
    """Write a whole file or nothing; see `whole_file`."""
    with whole_file(path, keep_link) as part:
        part.write_bytes(text)


@contextmanager
def file_errors(argument: str, path: Any, example: str, what: str, advice: str) -> Iterator[None]:
    """Raise `InputError` if the path does not name a file, or if the body cannot use the file."""
    if not isinstance(path, str | os.PathLike):
        raise InputError(f'{argument} must be a path, such as "{example}", not {short_repr(path)}.')
    try:
        yield
    except InputError:
        raise
    except BlockingIOError:  # it is locked
        raise InputError(
            f"Another program is writing to {path}. Wait until it ends, or pass another file."
        ) from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path} {what}: {reason}. {advice}") from None
