"""The commands of `floatbase`, whatever is installed."""

import os
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version

import pytest
from jupyterlab.labapp import LabApp
from messages import missing

from floatbase.__main__ import main

# what the base install lacks
EXTRAS = (
    "anywidget", "cvxpy", "ipywidgets", "IPython", "jupyterlab", "matplotlib", "meshcat",
    "msgpack", "nbclient", "nbformat", "pandas", "PIL", "sphinx", "tornado", "traitlets", "zmq",
)  # fmt: skip
BASE_INSTALL = f"""
import sys
sys.modules.update(dict.fromkeys({EXTRAS}))  # their imports fail
from floatbase.__main__ import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.fixture
def jupyterlab(monkeypatch):
    """The arguments that JupyterLab gets; nothing starts."""
    given = []

    def become(_, command):
        given.extend(command)
        raise SystemExit  # this program does not go on

    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: None)
    monkeypatch.setattr(os, "execv", become)
    monkeypatch.setenv("JUPYTER_CONFIG_PATH", "mine")
    return given


@pytest.mark.parametrize("options", [[], ["--ip=0.0.0.0", "--port=9000"]])
def test_jupyterlab_gets_the_options_and_settings_of_the_course(
    jupyterlab, tmp_path, monkeypatch, options
):
    monkeypatch.setenv("JUPYTER_CONFIG_DIR", str(tmp_path / "none"))  # not this user's settings
    with pytest.raises(SystemExit):
        main(["lab", str(tmp_path), *options])
    _, *command = jupyterlab
    assert command[:2] == ["-m", "jupyterlab"]
    app = LabApp.serverapp_class()
    app.parse_command_line(command[2:])
    assert app.root_dir == str(tmp_path) and (tmp_path / "00_start_here.ipynb").exists()
    assert (app.ip, app.port) == (("0.0.0.0", 9000) if options else ("localhost", 8888))
    course, mine = os.environ["JUPYTER_CONFIG_PATH"].split(os.pathsep)
    assert mine == "mine"
    monkeypatch.setenv("JUPYTER_CONFIG_PATH", course)
    app.load_config_file(suppress_errors=False)
    assert not app.config.LabApp.news_url and not app.config.LanguageServerManager.autodetect


@pytest.mark.parametrize("arguments", [["--port", "9000"], ["--no-browser", "week1"]])
def test_the_value_of_an_option_does_not_become_the_folder(
    jupyterlab, tmp_path, monkeypatch, capsys, arguments
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit):
        main(["lab", *arguments])
    assert not missing(capsys.readouterr().err, "folder", "--port=9000")
    assert jupyterlab == [] and os.listdir() == []
    with pytest.raises(SystemExit):
        main(["lab", "mine", *arguments])
    assert jupyterlab[-2:] == arguments and os.listdir() == ["mine"]


def test_the_base_install_says_how_to_get_what_a_command_needs(tmp_path):
    for command, extra in (("lab", "course"), ("lecture", "site")):
        run = in_the_base_install(command, tmp_path)
        assert run.returncode == 2
        assert not missing(run.stderr, f'pip install "floatbase[{extra}]"')
        assert "Traceback" not in run.stderr


def test_the_doctor_needs_no_extra(tmp_path):
    run = in_the_base_install("doctor", tmp_path)
    assert run.returncode == 0, run.stderr
    assert not missing(run.stdout, "controller", "viewer", "browser")


def in_the_base_install(command, folder):
    code = [sys.executable, "-c", BASE_INSTALL, *command.split()]
    return subprocess.run(code, cwd=folder, capture_output=True, text=True)


def test_the_doctor_names_a_missing_package_and_the_command_that_installs_it(capsys, monkeypatch):
    def installed(name):
        if name in ("loky", "ipywidgets"):
            raise PackageNotFoundError(name)
        return version(name)

    monkeypatch.setattr("floatbase.doctor.version", installed)
    assert main(["doctor"]) == 0
    lines = dict(
        line.split(": ", 1) for line in capsys.readouterr().out.split("\n") if ": " in line
    )
    assert not missing(lines["sweep"], "loky", 'pip install "floatbase[sweep]"')
    assert lines["course"].count("ipywidgets") == 1  # also its extra `viewer` needs it
    assert lines["cvxpy"] == "installed"


def test_commands_of_the_course_get_their_arguments(capsys, tmp_path):
    for arguments, status, said in (
        (["assign", "99", "--to", str(tmp_path / "new")], 2, ["99"]),
        (["grade", "--help"], 0, ["floatbase grade", "--roster"]),
        (["robots", "--roster"], 2, ["--roster"]),
    ):
        with pytest.raises(SystemExit) as end:
            main(arguments)
        assert end.value.code == status
        assert not missing("".join(capsys.readouterr()), *said)
