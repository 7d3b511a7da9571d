"""A wheel is complete, and importing the package stays light."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

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
    name = wheel.name.rsplit("-", 3)[0]
    assert {name.split("/")[0] for name in packed} == {
        "floatbase", f"{name}.dist-info", f"{name}.data"
    }  # fmt: skip
    extension = f"{name}.data/data/share/jupyter/labextensions/floatbase/package.json"
    assert extension in packed  # where JupyterLab finds it
    run_lesson_of_wheel("02_equations_of_motion.ipynb", wheel, tmp_path)


def run_lesson_of_wheel(name, wheel, folder):
    """Run a lesson in an empty folder, without the repository; it reads robots and meshes."""
    packages, empty = folder / "packages", folder / "empty"
    zipfile.ZipFile(wheel).extractall(packages)
    empty.mkdir()
    notebook = nbformat.read(packages / "floatbase" / "_notebooks" / name, as_version=4)
    notebook.cells.append(nbformat.v4.new_code_cell("import floatbase; print(floatbase.__file__)"))
    client = NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(empty)}})
    client.execute(env={**os.environ, "PYTHONPATH": str(packages)})
    (install,) = (cell for cell in notebook.cells if cell.id == "install")
    assert install.outputs == [] and list(empty.iterdir()) == []
    assert notebook.cells[-1].outputs[0].text.startswith(str(packages))


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
