"""Films and images: what they show, and errors if they cannot be made."""

import shutil
import sys
import tempfile
from contextlib import closing

import numpy as np
import psutil
import pytest
from browsers import needs_chromium
from messages import raises, refused
from PIL import Image

import floatbase as fb
from floatbase.control import JointLimits
from floatbase.errors import InputError, MissingDependencyError, ViewerError
from floatbase.lessons import ConstantTorques

pytestmark = pytest.mark.front_end

SIZE = (320, 200)
SOME = 20  # of 255: by which a pixel is another


@pytest.fixture(scope="module")
def view(request):
    robot = fb.load("go2")
    tasks = fb.standing_tasks(robot.standing())
    controller = fb.WholeBodyController(robot, fb.Contacts.points(robot), tasks)
    run = fb.rollout(fb.Simulation(robot), controller, 0.2, [fb.Push((0.0, 400.0, 0.0), 0.05, 0.1)])
    view = fb.Viewer(robot)
    view.play(run, speed=0.5, follow=False)
    request.addfinalizer(view.close)
    return view


@needs_chromium
def test_a_film_that_would_take_hours_is_refused(tmp_path):
    robot = fb.load("ur5")
    run = fb.rollout(fb.Simulation(robot), ConstantTorques(np.zeros(6)), 0.2)
    view = fb.Viewer(robot)
    view.play(run, speed=1e-3)
    with raises(ViewerError, 199, 120):
        view.save(tmp_path / "slow.gif", size=SIZE)
    view.close()


def share_of_others(first, second):
    """Return the fraction of the pixels that differ between two images."""
    return float(np.mean(np.abs(first.astype(int) - second).max(axis=2) > SOME))


@needs_chromium
def test_a_film_lasts_as_long_as_the_recording_in_slow_motion_and_shows_the_push(view, tmp_path):
    av = pytest.importorskip("av", reason="av writes and reads films")
    with av.open(str(view.save(tmp_path / "push.mp4", size=SIZE))) as container:
        pictures = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
        rate = float(container.streams.video[0].average_rate)
    assert pictures[0].shape == (SIZE[1], SIZE[0], 3)
    assert abs(len(pictures) / rate - 0.2 / 0.5) < 2.0 / rate
    next_to_it, at_the_end = (share_of_others(pictures[0], pictures[i]) for i in (1, -1))
    assert next_to_it < 0.01 < at_the_end


@needs_chromium
def test_a_gif_repeats_and_an_image_is_its_first_picture(view, tmp_path):
    gif = Image.open(view.save(tmp_path / "push.GIF", size=SIZE))
    image = Image.open(view.save(tmp_path / "push.png", size=SIZE))
    assert gif.size == image.size == SIZE and image.format == "PNG" and gif.info["loop"] == 0
    assert getattr(gif, "n_frames", 1) == pytest.approx(0.4 * 20, abs=1)
    assert share_of_others(np.array(gif.convert("RGB")), np.array(image)) < 0.1  # 256 colours
    assert np.ptp(np.array(image), axis=(0, 1)).min() > 100  # a robot is in it


def test_the_errors_of_a_film_name_what_it_needs(view, tmp_path, monkeypatch):
    refused(lambda: view.save(tmp_path / "nowhere" / "push.gif"), ViewerError, "nowhere/push.gif")
    with raises(ViewerError, "push.avi", "html", "mp4", "gif", "png"):
        view.save(tmp_path / "push.avi")
    for size in ((321, 200), (20, 20), (10_000, 200)):
        with raises(InputError, "size", *size, 100, 4000):
            view.save(tmp_path / "push.mp4", size=size)
    monkeypatch.setitem(sys.modules, "playwright.sync_api", None)
    with raises(MissingDependencyError, "playwright", "floatbase[video]"):
        view.save(tmp_path / "push.png", size=SIZE)


@needs_chromium
def test_a_machine_without_a_browser_is_reported(view, tmp_path, monkeypatch):
    pytest.importorskip("playwright", reason="playwright is not installed")
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setenv("PLAYWRIGHT_BROWSERS_PATH", str(tmp_path))
    refused(lambda: view.save(tmp_path / "push.png", size=SIZE), ViewerError, "browser")


@needs_chromium
def test_a_gif_keeps_colours_that_appear_after_its_first_picture(tmp_path, go2):
    standing, q = go2.standing(), np.array(go2.standing().q)
    q[7 + go2.joint_names.index("FL_calf_joint")] = JointLimits.of(go2).upper[2]
    with closing(fb.Viewer(go2)) as view:
        pictures = [view.painter.picture(state) for state in (standing, fb.State(go2, q))]
        view.show(standing)  # places the camera
        view.play_pictures([0.0, 0.2, 0.4], [*pictures, pictures[1]])
        with Image.open(view.save(tmp_path / "limit.gif", size=SIZE)) as gif:
            orange = []
            for frame in (0, gif.n_frames - 1):
                gif.seek(frame)
                red, green, blue = np.moveaxis(np.array(gif.convert("RGB"), dtype=int), 2, 0)
                orange.append(np.sum((red > green + SOME) & (green > blue + 2 * SOME)))
    assert orange[0] == 0 and orange[1] > 10


@needs_chromium
def test_names_that_javascript_objects_have_are_drawn(tmp_path):
    robot = fb.load("ur5")
    images = []
    with closing(fb.Viewer(robot)) as view:
        picture = view.painter.picture(robot.standing())
        view.show(robot.standing())  # places the camera
        for name in ("any", "constructor", "__proto__"):
            view.draw({f"{name}/{path}": item for path, item in picture.items()})
            images.append(np.array(Image.open(view.save(tmp_path / f"{name}.png", size=SIZE))))
    assert np.ptp(images[0], axis=(0, 1)).min() > 100  # a robot is in it
    for image in images[1:]:
        assert share_of_others(images[0], image) < 0.01


@needs_chromium
@pytest.mark.parametrize("extension", [".png", ".gif", ".mp4"])
def test_a_file_that_cannot_be_written_leaves_no_browser_and_no_folder(
    extension, view, tmp_path, monkeypatch, capfd
):
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    before = set(psutil.Process().children(recursive=True))

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Image.Image, "save", full)
    if extension == ".mp4":
        monkeypatch.setattr("av.VideoFrame.from_image", full)
    path = tmp_path / f"push{extension}"
    refused(lambda: view.save(path, size=SIZE), ViewerError, "No space left on device")
    assert not set(psutil.Process().children(recursive=True)) - before
    assert not [*folder.iterdir()] and not path.exists()
    assert "Traceback" not in capfd.readouterr().err
