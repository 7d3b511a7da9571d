"""The lock agrees with pyproject.toml, and importing the package stays light."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
LOCK = (ROOT / "environment.txt").read_text(encoding="utf-8")
PINS = [Requirement(line) for line in LOCK.splitlines() if line and not line.startswith("#")]
REQUIRED = [
    Requirement(text) for texts in (PROJECT["dependencies"], *PROJECT["optional-dependencies"].values()) for text in texts
]
HEAVY = ("mujoco", "meshcat", "cvxpy", "matplotlib", "numba", "scipy.optimize", "scipy.spatial")
IMPORT_LIMIT = 0.5  # s of one core, which a busy machine does not change


def test_every_package_is_pinned_once_to_one_version() -> None:
    names = [canonicalize_name(pin.name) for pin in PINS]
    assert len(names) == len(set(names))
    for pin in PINS:
        assert [spec.operator for spec in pin.specifier] == ["=="], f"{pin} is not exact"
        assert pin.url is None, f"{pin} names a place instead of a version"


def test_every_dependency_is_pinned_within_its_range() -> None:
    pins = {canonicalize_name(pin.name): pin for pin in PINS}
    wrong = []
    for required in REQUIRED:
        pin = pins.get(canonicalize_name(required.name))
        if pin is None:
            wrong.append(f"{required.name} is not in environment.txt")
        elif not required.specifier.contains(next(iter(pin.specifier)).version, prereleases=True):
            wrong.append(f"{pin} is not within {required}")
        elif pin.marker is not None:
            wrong.append(f"{pin} would not be installed everywhere")
    assert not wrong, "\n".join([*wrong, "make lock"])


def test_markers_speak_of_platform_and_python_only() -> None:
    known = {
        "implementation_name", "os_name", "platform_machine", "platform_python_implementation", "platform_system",
        "python_full_version", "python_version", "sys_platform",
    }  # fmt: skip
    for pin in PINS:
        words = {word for word in str(pin.marker or "").replace("(", " ").split() if "_" in word and word[0].isalpha()}
        assert words <= known, f"{pin} depends on {words - known}"


def test_the_lock_names_no_place() -> None:
    assert "make lock" in LOCK.splitlines()[1]
    for word in ("://", "--index", "--extra-index", "--find-links", "/home/", "/root/", "@"):
        assert word not in LOCK, f"environment.txt holds {word}"


def test_versions_agree() -> None:
    import floatbase

    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert floatbase.__version__ == PROJECT["version"]
    assert f"version: {PROJECT['version']}\n" in citation
    assert f"## [{PROJECT['version']}]" in changelog


def test_the_wheel_brings_the_meshes_and_their_licences(tmp_path: Path) -> None:
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "-w", str(tmp_path), str(ROOT)]
    subprocess.run(pip, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("floatbase-*.whl")
    packed = set(zipfile.ZipFile(wheel).namelist())
    meshes = {f"floatbase/_assets/meshes/{path.name}" for path in (ROOT / "assets" / "meshes").glob("*.npz")}
    assert meshes
    assert meshes | {"floatbase/__init__.py", "floatbase/_assets/LICENSES.md"} <= packed
    assert {name.split("/")[0] for name in packed} == {"floatbase", wheel.name.rsplit("-", 3)[0] + ".dist-info"}


def test_importing_floatbase_is_light_and_quick() -> None:
    code = "import json, sys, time; start = time.process_time(); import floatbase; took = time.process_time() - start; "
    code += "print(json.dumps([took, list(sys.modules)]))"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    took, loaded = json.loads(answer.stdout)
    assert not set(HEAVY) & set(loaded)
    assert took < IMPORT_LIMIT, f"{took:.2f} s"
