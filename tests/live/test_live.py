"""The engine of the page with a live robot repeats the Python library."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import live_reference
import pytest

from floatbase.live import wasm
from floatbase.viewer.web import pages

WEB = pages.DIST.parent
TORQUE_TOLERANCE = 1e-8  # fraction of the motor's limit
STATE_TOLERANCE = 1e-12  # of q and v
COM_TOLERANCE = 1e-3  # m, over the first second
TARGET_TOLERANCE = 1e-9  # of all targets and bounds of a walk
WALK_TOLERANCE = 5e-3  # m, of the centre of mass of a walk that is pushed, over all its time


def test_the_control_step_is_up_to_date():
    assert wasm.is_current(), "live/tick.wasm is older than its sources: run `make live`"


@pytest.mark.front_end
@pytest.mark.timeout(900)
@pytest.mark.skipif(
    None in (wasm.linker(), wasm.library()), reason="lld or wasi-libc is not installed"
)
def test_the_control_step_compiles_to_an_equal_module(tmp_path):
    """A module that is compiled here gives the same answers as the one that is kept."""
    wasm.build(tmp_path / "tick.wasm")
    assert _compare(tmp_path, tmp_path / "tick.wasm")["states"]["torque"] < TORQUE_TOLERANCE


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("live")
    return _compare(folder, wasm.MODULE) | {"folder": folder}


def test_all_states_have_the_same_answers(found):
    states = found["states"]
    assert states["states"] == 600
    assert states["infeasible"] > 0 and states["active"] > states["states"]
    assert states["otherCode"] == 0 and states["otherActive"] == 0
    assert states["torque"] < TORQUE_TOLERANCE


def test_a_conflict_that_the_page_names_is_one_and_needs_each_of_its_constraints(found):
    """By linear programs on the rows of the library's QP."""
    conflicts = found["states"]["conflicts"]
    assert len(conflicts) == found["states"]["infeasible"]
    assert all(conflict["unchanged"] for conflict in conflicts)
    for can_hold, *without_one in live_reference.conflicts(found["folder"], conflicts):
        assert not can_hold and without_one and all(without_one)


def test_the_controller_reads_the_state_from_mujoco(found):
    assert max(found["states"]["inputs"].values()) < STATE_TOLERANCE


def test_runs_follow_those_of_the_library(found):
    outcomes = {run["python"] for run in found["runs"]}
    assert outcomes == {"completed", "fell", "controller failed"}
    for run in found["runs"]:
        assert run["firstSecond"] < COM_TOLERANCE, run
        assert run["outcome"] == run["python"], run
        assert run["moved"] > 0.0


def test_walks_have_the_targets_of_the_library(found):
    """Every step of a trot that turns and stops, and of a walk, for the same states."""
    for walk in found["walks"]:
        assert walk["inputs"] < TARGET_TOLERANCE, walk
        assert walk["outcome"] == walk["python"] == "completed"
        assert walk["distance"] < WALK_TOLERANCE < walk["moved"], walk


def test_what_makes_no_sense_is_refused_and_changes_nothing(found):
    refusals = found["refusals"]
    assert refusals["tried"] > 70 and refusals["accepted"] == []
    undisturbed, disturbed = refusals["end"]
    assert disturbed == undisturbed and disturbed[-1] == ""


def test_the_judges_of_the_page_say_what_those_of_the_library_say(found):
    """About each slice of the same runs; every challenge of the page is won once."""
    runs = found["challenges"]
    assert not [run for run in runs if "difference" in run]
    assert {run["title"] for run in runs if run["won"]} == {run["title"] for run in runs}
    assert len({run["title"] for run in runs}) == 6 and not all(run["won"] for run in runs)


def test_a_push_recovery_map_is_that_of_the_library(found):
    """Within a step of the bisection."""
    recovery = found["recovery"]
    for push, expected in zip(recovery["pushes"], recovery["python"], strict=True):
        assert expected > 0.0 and abs(push - expected) <= recovery["resolution"], recovery


def _compare(folder: Path, module: Path) -> dict[str, Any]:
    node = shutil.which("node")
    if node is None or not (WEB / "node_modules" / "@mujoco").is_dir():
        pytest.skip("MuJoCo for JavaScript is not installed: run `npm ci` in floatbase/viewer/web")
    live_reference.write(folder)
    ran = subprocess.run(
        [node, "reference.mjs", str(folder), str(module)],
        cwd=WEB, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    found: dict[str, Any] = json.loads(ran.stdout)
    return found
