"""An environment for each peer that floatbase is compared with, made once and kept: `python_of`
gives its Python.

TSID's wheel was built against an older Pinocchio than the current one and fails with it (in
`RobotWrapper`), so its library and bindings are compiled from their source packages, which takes
some minutes, a C++ compiler and make. placo comes as a wheel that needs Pinocchio 3.8.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from pathlib import Path

TSID, PLACO = "1.10.0", "0.10.2"
CHECKS = {
    "tsid": "import pinocchio, tsid; model = pinocchio.buildSampleModelHumanoid(); "
    "tsid.RobotWrapper(model, tsid.RootJointType.FLOATING_BASE_SYSTEM, False)",
    "placo": "import pinocchio, placo; placo.DynamicsSolver",
}


class MissingError(Exception):
    """An environment could not be made; the message says what it lacks."""


def python_of(peer: str, home: Path) -> Path:
    """The Python of a peer's environment in `home`, which is made when it is not there.

    Raises `MissingError` when that fails.
    """
    folder = home / peer
    python, ready = folder / "bin" / "python", folder / f"ready-{_key(peer)}"
    if not ready.exists():
        _check_tools(peer)
        print(f"Making the environment of {peer} in {folder}.", flush=True)
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        for command in _steps(peer, folder):
            _run(command, folder)
        _run([str(python), "-c", CHECKS[peer]], folder)
        ready.touch()
    return python


def versions(python: Path, names: Sequence[str]) -> str:
    """The names and versions of packages in an environment."""
    code = (
        "import sys; from importlib.metadata import version; "
        "print(*(f'{name} {version(name)}' for name in sys.argv[1:]), sep=', ')"
    )
    command = [str(python), "-c", code, *names]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def _key(peer: str) -> str:
    """What an environment is made for; another needs it made anew."""
    python = f"python-{sys.version_info.major}.{sys.version_info.minor}"
    return f"{TSID}-pin-{version('pin')}-{python}" if peer == "tsid" else f"{PLACO}-{python}"


def _check_tools(peer: str) -> None:
    for tool, package in (("c++", "g++"), ("make", "make")) if peer == "tsid" else ():
        if shutil.which(tool) is None:
            raise MissingError(
                f"TSID is compiled here, and there is no {tool} (on Debian and Ubuntu: apt install "
                f"{package})."
            )


def _steps(peer: str, folder: Path) -> Iterator[list[str]]:
    """The commands that make an environment."""
    yield [sys.executable, "-m", "venv", str(folder)]
    pip = [str(folder / "bin" / "python"), "-m", "pip", "--disable-pip-version-check", "install"]
    if peer == "placo":
        yield [*pip, f"placo=={PLACO}", "pin==3.8.0"]
        return
    built_with = "cmeel[build]", "eiquadprog[build]", f"pin[build]=={version('pin')}"
    yield [*pip, *built_with, "jrl-cmakemodules", "scipy"]
    compiled = "--no-build-isolation", "--no-deps", "--no-cache-dir", "--no-binary"
    for package in ("libtsid", "tsid"):
        print(f"Compiling {package} {TSID}: some minutes.", flush=True)
        yield [*pip, *compiled, package, f"{package}=={TSID}"]


def _run(command: list[str], folder: Path) -> None:
    """Run a command in an environment; what it prints goes to `log.txt` there."""
    path = f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}"
    jobs = {"CMEEL_RUN_TESTS": "OFF", "CMEEL_JOBS": str(os.cpu_count() or 1)}
    environment, log = os.environ | jobs | {"PATH": path}, folder / "log.txt"
    with log.open("a") as out:
        print("$", *command, file=out, flush=True)
        done = subprocess.run(command, stdout=out, stderr=subprocess.STDOUT, env=environment)
    if done.returncode:
        lines = log.read_text().splitlines()
        wrong = [line.strip()[:200] for line in lines if "error" in line.lower()][-3:]
        raise MissingError(
            f"`{' '.join(command)}` ended with code {done.returncode}: {' / '.join(wrong)}. All "
            f"that it said is in {log}."
        )
