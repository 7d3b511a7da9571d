"""A wheel is complete, and importing the package stays light."""

import json
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
HEAVY = ("mujoco", "meshcat", "cvxpy", "matplotlib", "numba", "scipy.optimize", "scipy.spatial")
IMPORT_LIMIT = 0.5  # s of one core, which a busy machine does not change


@pytest.mark.front_end
def test_the_wheel_brings_the_meshes_their_licences_and_the_built_pages(tmp_path):
    options = ["-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "-w"]
    pip = [sys.executable, *options, str(tmp_path), str(ROOT)]
    subprocess.run(pip, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("floatbase-*.whl")
    packed = set(zipfile.ZipFile(wheel).namelist())
    meshes = {
        f"floatbase/_assets/meshes/{path.name}"
        for path in (ROOT / "assets" / "meshes").glob("*.npz")
    }
    assert meshes
    assert meshes | {"floatbase/__init__.py", "floatbase/_assets/LICENSES.md"} <= packed
    web = ROOT / "floatbase" / "viewer" / "web"
    built = {path.relative_to(ROOT).as_posix() for path in (web / "dist").iterdir()}
    assert built <= packed
    assert not [name for name in packed if "web/src/" in name or "node_modules" in name]
    expected = {"floatbase", wheel.name.rsplit("-", 3)[0] + ".dist-info"}
    assert {name.split("/")[0] for name in packed} == expected


def test_importing_floatbase_is_light_and_quick():
    code = (
        "import json, sys, time; start = time.process_time(); import floatbase; took = "
        "time.process_time() - start; "
    )
    code += "print(json.dumps([took, list(sys.modules)]))"
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    took, loaded = json.loads(answer.stdout)
    assert not set(HEAVY) & set(loaded)
    assert took < IMPORT_LIMIT, f"{took:.2f} s"
