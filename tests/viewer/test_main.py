"""The page of the command line: a live robot without a notebook."""

import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from threading import Event

import numpy as np
import pytest
from messages import missing
from numpy.testing import assert_allclose
from waiting import PATIENCE, until

from floatbase.__main__ import main
from floatbase.errors import InputError
from floatbase.playground import Playground, RealTimeFactor
from floatbase.playground._view_command import start_when_connected
from floatbase.robots import catalogue, load

from .looks import control, eventually, picture

SIDES = ("left", "right")
ARM = """<mujoco><worldbody><body><joint name="rail" type="slide"/><geom size="1"/></body>
</worldbody><keyframe><key name="zero"/><key name="up" qpos="0.5"/></keyframe></mujoco>"""


def test_the_robots_are_listed(capsys):
    assert main(["robots"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(catalogue())


def test_wrong_arguments_are_a_message_and_not_a_traceback(tmp_path, capsys):
    file = tmp_path / "mine.urdf"
    file.write_text(load("solo12").urdf)
    for arguments, *named in (
        (["go3"], "go3", "go2"),
        (["go2", "--port", "99999"], "port", 99999),
        ([str(file), "--feet", "FL_FOTT"], "FL_FOTT"),
        ([str(tmp_path / "none.urdf")], "none.urdf"),
        ([str(file), "--posture", "FL_KFE"], "--posture", "FL_KFE"),
        (["go2", "--posture", "*_cal=1"], "*_cal", "FL_calf_joint"),
        (["go2", "--posture", "home"], "--posture", "home", "keyframe"),
    ):
        assert main(["view", *arguments, "--no-browser"]) == 2
        assert not missing(capsys.readouterr().err, *named)


def test_a_robot_is_described_by_the_arguments(tmp_path, monkeypatch):
    file, g1, shown = tmp_path / "mine.urdf", load("g1"), []
    file.write_text(g1.urdf)

    def show(robot, *args, **options):
        shown.append(robot)
        raise InputError("shown")

    monkeypatch.setattr("floatbase.playground._view_command.Playground", show)
    folders = ["--package-dirs", *map(str, g1.package_dirs)]
    for options in ([], ["--feet", "left_ankle_roll_link", "right_ankle_roll_link"]):
        posture = ["--posture", "*_knee_joint=0.7", "left_knee_joint=0.6"]
        assert main(["view", str(file), *folders, *options, *posture]) == 2
        robot = shown[-1]
        assert [foot.is_flat for foot in robot.feet] == [True, True]
        knees = [robot.posture[7:][robot.joint_names.index(f"{s}_knee_joint")] for s in SIDES]
        assert knees == [0.6, 0.7]
    assert main(["view", "go2", "--feet"]) == 2
    assert shown[-1].feet == ()
    arm = tmp_path / "arm.xml"
    arm.write_text(ARM)
    assert main(["view", str(arm), "--posture", "up"]) == 2
    assert shown[-1].posture.tolist() == [0.5]


@pytest.mark.front_end
def test_a_user_defined_urdf_is_shown(tmp_path):
    file, solo = tmp_path / "mine.urdf", load("solo12")
    file.write_text(solo.urdf)
    options = ["--feet", *(foot.frame for foot in solo.feet), "--foot-radius", "0.01"]
    options += ["--posture", "*_HFE=0.7", "FL_KFE=-1.4", "--package-dirs"]
    options += map(str, solo.package_dirs)
    command = [sys.executable, "-m", "floatbase", "view", str(file), "--no-browser", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert "mine at http://127.0.0.1" in process.stdout.readline()
        process.terminate()
        assert process.wait(timeout=20) == 0


@pytest.mark.front_end
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_ends_it_cleanly(number):
    command = [sys.executable, "-m", "floatbase", "view", "ur5", "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert "ur5 at http://127.0.0.1" in process.stdout.readline()
    process.send_signal(number)
    _, errors = process.communicate(timeout=20)
    # where `make setup` did not
    compiled = (
        "floatbase is compiling its controller. This happens once and takes about a minute.\n"
    )
    assert (process.returncode, errors.replace(compiled, "")) == (0, "")


@pytest.mark.front_end
def test_the_robot_waits_for_its_first_page(page, go2):
    with closing(Playground(go2)) as playground, ThreadPoolExecutor(1) as other:
        ended = Event()
        begun = other.submit(start_when_connected, playground, ended)
        try:
            with pytest.raises(TimeoutError):
                begun.result(0.3)
            assert playground.run.status == "paused" and playground.session.sim.time == 0.0
            page.goto(playground.url)
            begun.result(PATIENCE)
            until(lambda: playground.session.sim.time > 0.0)
        finally:
            ended.set()


def test_the_end_of_the_program_ends_the_wait_for_a_page(go2):
    ended = Event()
    ended.set()
    with closing(Playground(go2)) as playground:
        start_when_connected(playground, ended)
        assert playground.run.status == "paused"


def test_the_controls_reach_the_robot(page, field, go2):
    session, run = field.session, field.run

    def drawn():
        return {path for path in field.view.renderer.picture if path.startswith("measured/")}

    page.goto(field.url)
    page.wait_for_function("window.viewer && viewer.gui_controllers['push']")
    control(page, "CoM x [cm]", "setValue(4)")
    eventually(page, lambda: abs(session.sim.state.com[0] - go2.standing().com[0] - 0.04) < 0.01)
    control(page, "facets", "setValue(6)")
    control(page, "friction μ model", "setValue(0.3)")
    eventually(page, lambda: abs(session.settings.friction[0] - 0.3) < 1e-9)
    eventually(page, lambda: (session.settings.facets, field.view.painter.facets) == (6, 6))
    picture(page, "bare_page")
    control(page, "pause", "fire()")
    eventually(page, lambda: run.status == "paused")
    run.close()  # waits for the last slice
    stopped = session.sim.time
    control(page, "lift front left foot", "setValue(true)")
    control(page, "run", "fire()")
    eventually(page, lambda: session.sim.time > stopped and "measured/FL_foot" not in drawn())
    assert "measured/FR_foot" in drawn()


@pytest.mark.front_end
def test_the_page_makes_the_robot_walk_and_stand_where_it_is(page, field):
    def place():
        return field.session.last.final.com if field.session.last else np.zeros(3)

    page.goto(field.url)
    page.wait_for_function("window.viewer && viewer.gui_controllers['gait']")
    control(page, "velocity x [m/s]", "setValue(0.5)")
    control(page, "gait", "setValue(2)")
    eventually(page, lambda: place()[0] > 0.3)
    control(page, "gait", "setValue(0)")
    eventually(page, lambda: len(field.session.last.contacts_at(-1)) == 4)
    stopped = place()
    control(page, "CoM z [cm]", "setValue(-2)")
    eventually(page, lambda: place()[2] < stopped[2] - 0.01)
    assert np.linalg.norm(place()[:2] - stopped[:2]) < 0.1
    control(page, "reset", "fire()")
    eventually(page, lambda: np.linalg.norm(place()[:2]) < 0.05)


@pytest.mark.front_end
def test_the_page_draws_the_push_and_shows_what_stopped_the_run(page, field):
    page.goto(field.url)
    page.wait_for_function("window.viewer && viewer.gui_controllers['push']")
    control(page, "towards [°]", "setValue(-90)")
    control(page, "push [N]", "setValue(40)")
    drawn = "viewer.scene_tree.find(['meshcat', 'push']).object"
    # its shape comes with one message, its direction, which is not up, with the next
    turned = f"{drawn}.children.length > 0 && {drawn}.matrix.elements[10] < 0.5"
    # once a second: the arrow stays for half a second, in which a busy machine may draw no frame
    push = "Date.now() % 1000 < 50 && viewer.gui_controllers['push'].fire()"
    seen = f"({push}, {turned}) && Array.from({drawn}.matrix.elements.slice(8, 11))"
    arrow = page.wait_for_function(seen).json_value()
    assert_allclose(arrow, [0, -40 * field.view.scale, 0], atol=1e-6)
    page.wait_for_function(f"{drawn}.children.length == 0")
    field.run.push([0.0, 0.0, -1200.0], duration=0.3)  # harder than the handle can
    title = "document.getElementById('title').textContent"
    page.wait_for_function(f"{title}.includes('fell: press reset')")
    control(page, "reset", "fire()")
    page.wait_for_function(f"!{title}.includes('fell')")
    assert field.run.status == "running"


@pytest.mark.filterwarnings("error")  # as an exception in the run's thread would be
def test_a_window_that_closes_first_stops_the_run(field):
    until(lambda: field.session.last is not None)
    field.view.close()
    until(lambda: field.run.status != "running")
    assert "window" in field.run.reason
    field.run.close()


def test_the_pace_is_simulated_time_over_time():
    now = [0.0]
    pace = RealTimeFactor(lambda: now[0])
    for i in range(101):
        now[0] = 0.03 * i
        found = pace.update(0.5 * now[0])
        assert (found is None) == (now[0] <= 0.5)
    assert found == pytest.approx(0.5)
    now[0] += 60.0  # a pause
    assert pace.update(2.0) is None
    now[0] += 0.6
    assert pace.update(2.6) == pytest.approx(1.0)
    assert pace.update(0.0) is None  # a reset


@pytest.mark.parametrize("name", ["ur5", "talos"])
def test_robots_without_point_feet_run_too(name):
    playground = Playground(load(name))
    playground.start()
    until(lambda: playground.session.sim.time >= 0.05)
    assert playground.run.status == "running"
    playground.close()
