"""`floatbase doctor`: what is installed, what is missing, and how to get it."""

from __future__ import annotations

import platform
import re
import sys
from importlib.metadata import PackageNotFoundError, requires, version

import floatbase as fb
from floatbase._browser import browser_path

_MAIN = ("pin", "mujoco", "numba", "numpy", "daqp")
_FOR_DEVELOPERS = {"cluster", "hub", "site", "test"}


def report() -> str:
    """Describe this installation."""
    lines = [
        f"Python {platform.python_version()} at {sys.executable}, {platform.platform()}",
        f"floatbase {version('floatbase')}, "
        + ", ".join(f"{name} {_version(name) or 'missing'}" for name in _MAIN),
        f"controller: {_backend()}",
    ]
    for extra, names in _extras().items():
        missing = [name for name in names if _version(name) is None]
        advice = f'{", ".join(missing)} missing; pip install "floatbase[{extra}]"'
        lines.append(f"{extra}: {advice if missing else 'installed'}")
    none = "none found; install Chromium or Chrome (apt install chromium)"
    lines.append(f"browser for films: {browser_path() or none}")
    return "\n".join(lines)


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _extras() -> dict[str, dict[str, None]]:
    """Return the packages of each extra that a user may want, each once and in order."""
    found: dict[str, dict[str, None]] = {}
    for line in requires("floatbase") or []:
        match = re.match(r"([\w.-]+).*extra == ['\"]([\w-]+)", line)
        if match and match[1] != "floatbase" and match[2] not in _FOR_DEVELOPERS:
            found.setdefault(match[2], {})[match[1]] = None
    return found


def _backend() -> str:
    """Return the backend that the controller of a quadruped uses, and why."""
    go2 = fb.load("go2")
    contacts, tasks = fb.Contacts.points(go2), fb.standing_tasks(go2.standing())
    controller = fb.WholeBodyController(go2, contacts, tasks)
    return f"{controller.backend} backend; {controller.backend_reason}"
