"""A file is written whole or not at all, whatever ends the writing."""

import os
import signal
import subprocess
import sys
import threading
from contextlib import closing
from pathlib import Path

import judges
import pytest
from disk import full_disk
from PIL import Image

import floatbase as fb
from floatbase._files import whole_file, write_whole
from floatbase.errors import InputError, ViewerError
from floatbase.lessons import import_answers
from floatbase.lessons.publish import prepare_workspace
from floatbase.lessons.publish.__main__ import main
from floatbase.lessons.publish.gradebook import Policy, write_gradebook
from floatbase.lessons.publish.grades import grade_file, write_table
from floatbase.lessons.publish.notebooks import read_notebook
from floatbase.simulation import read_sweep
from floatbase.viewer.export import film

KILLED = """
import sys
from pathlib import Path
from floatbase._files import whole_file
with whole_file(Path(sys.argv[1])) as part:
    with part.open("wb") as file:
        file.write(b"half")
        file.flush()
        print("written", flush=True)
        sys.stdin.read()
"""


def test_a_process_that_is_killed_leaves_the_former_file(tmp_path):
    target = tmp_path / "film.mp4"
    target.write_bytes(b"former")
    process = subprocess.Popen(
        [sys.executable, "-c", KILLED, target], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    with process:
        assert process.stdout is not None and process.stdout.readline() == b"written\n"
        process.send_signal(signal.SIGKILL)
    assert target.read_bytes() == b"former"
    write_whole(target, b"new")  # what the killed process left is in nobody's way
    assert target.read_bytes() == b"new"


def test_a_file_that_cannot_be_written_is_named(tmp_path):
    target = tmp_path / "gone" / "answers.json"
    with pytest.raises(FileNotFoundError) as failed:
        write_whole(target, b"new")
    assert failed.value.filename == str(target)


def test_the_permissions_of_a_file_are_kept(tmp_path):
    target = tmp_path / "answers.json"
    target.write_bytes(b"former")
    target.chmod(0o600)
    write_whole(target, b"new")
    assert target.read_bytes() == b"new" and target.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize("linked", [False, True])
def test_a_pipe_is_written_and_not_replaced(linked, tmp_path):
    pipe, link = tmp_path / "pipe", tmp_path / "link"
    os.mkfifo(pipe)
    link.symlink_to(pipe)
    received = []
    reader = threading.Thread(target=lambda: received.append(pipe.read_bytes()), daemon=True)
    reader.start()
    write_table([], link if linked else pipe)  # such as --table /dev/stdout
    reader.join(20.0)
    assert received[0].startswith(b'"file","name"') and pipe.is_fifo() and link.is_symlink()


def test_two_files_of_one_folder_can_be_written_at_once(tmp_path):
    with whole_file(tmp_path / "a") as a, whole_file(tmp_path / "b") as b:
        a.write_text("a")
        b.write_text("b")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a": "a", "b": "b"}


def no_space(*_):
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize("extension", [".png", ".gif", ".mp4", ".html"])
@pytest.mark.parametrize("linked", [False, True])
def test_a_picture_that_fails_leaves_all_other_files(extension, linked, tmp_path, monkeypatch):
    if extension == ".mp4":
        pytest.importorskip("av", reason="av writes films")
    target, other = tmp_path / f"run{extension}", tmp_path / f"run.part{extension}"
    former = tmp_path / "former" if linked else target
    former.write_bytes(b"former")
    other.write_bytes(b"other")
    if linked:
        target.symlink_to(former)

    def pictures(*_):
        if broken and extension == ".png":
            no_space()
        yield Image.new("RGB", (320, 200), "red")
        if broken:
            no_space()

    monkeypatch.setattr(film, "_frames", pictures)
    broken = True
    with closing(fb.Viewer(robot := judges.load("ur5"))) as view:
        view.show(robot.standing())
        with monkeypatch.context() as patch, pytest.raises(ViewerError, match="No space"):
            if extension == ".html":
                patch.setattr(Path, "write_bytes", no_space)
            view.save(target, size=(320, 200))
        assert former.read_bytes() == b"former" and other.read_bytes() == b"other"
        broken = False
        view.save(target, size=(320, 200))
    assert former.read_bytes() not in (b"", b"former") and other.read_bytes() == b"other"
    assert target.is_symlink() == linked
    assert {path.name for path in tmp_path.iterdir()} == {target.name, former.name, other.name}


def test_a_table_that_cannot_be_written_leaves_the_former_one(tmp_path, monkeypatch):
    table = tmp_path / "marks.csv"
    write_table([], table)
    former = table.read_bytes()

    monkeypatch.setattr(Path, "write_bytes", no_space)
    with pytest.raises(InputError, match="No space"):
        write_table([], table)
    assert former and table.read_bytes() == former


def make_large(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(10_000_000_000)  # bytes, none of which takes space


def same(x: float) -> float:
    return x


KINDS = {
    "pipe": os.mkfifo,
    "folder": Path.mkdir,
    "device": lambda path: path.symlink_to("/dev/zero"),
    "endless": lambda path: path.symlink_to("/proc/self/pagemap"),
    "10 GB": make_large,
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "read",
    [
        fb.load_urdf,
        read_sweep,
        fb.Rollout.load,
        import_answers,
        grade_file,
        read_notebook,
        lambda path: fb.sweep(same, {"x": [1]}, file=path, workers=1, progress=False),
        lambda path: write_gradebook("canvas", [], path, path, column="", policy=Policy()),
    ],
)
def test_what_is_no_file_of_a_usual_size_is_refused_at_once(read, kind, tmp_path):
    path = tmp_path / "file.urdf"
    KINDS[kind](path)
    with pytest.raises((InputError, OSError), match="file") as caught:
        read(path)
    assert isinstance(caught.value, InputError) or caught.value.strerror


def test_a_package_for_which_there_is_no_room_leaves_nothing(tmp_path, capsys):
    with full_disk(50_000), pytest.raises(SystemExit):
        main(["assign", "00", "--to", str(tmp_path / "package")])
    assert "File too large" in capsys.readouterr().err and not [*tmp_path.iterdir()]


def test_a_folder_that_is_gone_is_told_before_anything_starts(tmp_path, monkeypatch):
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    with pytest.raises(InputError, match="No such file"):
        prepare_workspace(mine=Path())
    monkeypatch.chdir(tmp_path)
