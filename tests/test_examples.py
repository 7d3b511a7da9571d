"""The programs in examples/ run, and wbc.py computes what the library computes."""

import ast
import contextlib
import io
import json
import re
import runpy
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import loky
import numpy as np
import pinocchio as pin
import pytest

import floatbase as fb

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "examples"
WBC = EXAMPLES / "wbc.py"
TORQUE = 1e-6  # of each motor's limit
LIBRARIES = {"daqp", "example_robot_data", "mujoco", "numpy", "pinocchio"}


@pytest.fixture(scope="module")
def wbc():
    """Run wbc.py as a script, and return its names and what it prints."""
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        names = runpy.run_path(str(WBC), run_name="__main__")
    return SimpleNamespace(**names, printed=printed.getvalue())


def run(name, **settings):
    """Call the main function of an example."""
    return runpy.run_path(str(EXAMPLES / f"{name}.py"))["main"](**settings)


def test_examples_are_short_enough_for_one_sitting():
    lengths = {
        path.name: len(path.read_text("utf-8").splitlines()) for path in EXAMPLES.glob("*.py")
    }
    assert lengths.pop("wbc.py") <= 350 and max(lengths.values()) <= 60


def test_wbc_computes_the_torques_of_the_library(wbc, go2):
    controller = fb.WholeBodyController(
        go2,
        fb.Contacts.points(go2, mu=wbc.MU),
        fb.standing_tasks(go2.standing().replace(q=wbc.Q_GOAL)),
        joint_limits=None,
        backend="reference",
    )
    rng, active = np.random.default_rng(0), set()
    for speed in np.repeat([0.0, 0.3, 1.0], 10):  # m/s and rad/s
        q = pin.integrate(go2.model, wbc.Q_GOAL, rng.uniform(-0.1, 0.1, go2.nv))
        v = speed * rng.uniform(-1.0, 1.0, go2.nv)
        command = controller(q, v)
        _, tau, _ = wbc.control(q, v)
        assert np.all(np.abs(tau - command.tau) <= TORQUE * go2.torque_limits)
        active |= {label.kind for label in command.active}
    assert {"friction", "lower torque limit", "upper torque limit"} <= active


def test_wbc_stands_like_the_library(wbc, go2, standing):
    assert np.allclose(wbc.Q_GOAL, standing.q, atol=1e-12)
    assert np.allclose(wbc.COM_GOAL, standing.com, atol=1e-12)
    assert go2.feet[0].radius == wbc.RADIUS


def test_wbc_reads_states_of_mujoco_in_the_convention_of_pinocchio(wbc, go2):
    rng = np.random.default_rng(0)
    q = pin.integrate(go2.model, wbc.Q_GOAL, rng.uniform(-1.0, 1.0, go2.nv))
    state = fb.State(go2, q, rng.uniform(-1.0, 1.0, go2.nv))
    sim = fb.Simulation(go2)
    sim.reset(state)
    q, v = wbc.read_state(sim.data)
    assert np.allclose(q, state.q, atol=1e-12) and np.allclose(v, state.v, atol=1e-12)


def test_wbc_imports_only_the_libraries_that_it_names():
    tree = ast.parse(WBC.read_text(encoding="utf-8"))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    assert {name.name for node in imports for name in node.names} == LIBRARIES


def test_wbc_checks_each_equation_and_the_robot_returns_after_the_push(wbc):
    checks, path = wbc.printed.split("\n\n")
    equations = {f"({n})" for n in (5, 6, 7, 10, 12, 14, 15, 17, 18, 20, 21, 26, 27)}
    assert equations <= set(re.findall(r"\(\d+\)", checks))
    left = [int(mm) for mm in re.findall(r"\d s +(-?\d+) mm", path)]
    assert max(left[:2]) == 0 and 20 < max(left) < 30 and left[-1] == 0


def test_lesson_07_shows_the_last_line_of_wbc(wbc):
    lesson = json.loads((ROOT / "notebooks/07_quadratic_program.ipynb").read_text(encoding="utf-8"))
    (box,) = [text for cell in lesson["cells"] if "wbc.py" in (text := "".join(cell["source"]))]
    assert wbc.printed.splitlines()[-1] in box


def test_the_walk_example_goes_forwards_turns_and_stops(tmp_path, capsys):
    run("walk", duration=1.0, page=tmp_path / "walk.html")
    places = re.findall(r"completed, at x = (.*) m, y = (.*) m", capsys.readouterr().out)
    x, y = np.array(places, dtype=float).T
    assert x[0] > 0.1 and x[1] > x[0] + 0.1 and abs(x[2] - x[1]) < 0.05
    assert abs(y[0]) < 0.01 < y[1]
    assert (tmp_path / "walk.html").stat().st_size > 100_000


def test_the_custom_terms_of_the_example_limit_power_and_unload_a_foot(capsys):
    run("custom_terms", duration=0.5, watts=10.0)
    (power, load), (limited_power, chosen_load) = np.array(
        re.findall(r"completed: .* ([\d.]+) W, (\d+) N", capsys.readouterr().out), dtype=float
    )
    assert power > 15.0 and limited_power <= 10.0
    assert load > 40.0 and chosen_load == 20.0


def test_the_push_recovery_example_prints_and_draws_a_map(tmp_path, capsys, monkeypatch):
    # a thread instead of a process, which would take two seconds to import everything
    monkeypatch.setattr(loky, "get_reusable_executor", lambda *_, **__: ThreadPoolExecutor(1))
    picture = tmp_path / "map.png"
    run("push_recovery_map", directions=3, resolution=100.0, workers=1, picture=picture)
    printed = re.findall(r"(\d+)° +(\d+) N", capsys.readouterr().out)
    assert printed == [("0", "100"), ("120", "200"), ("240", "200")]
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_demonstrations_are_states_of_the_simulation_and_torques_of_the_controller(capsys, go2):
    q, v, tau = run("demonstrations", robots=8, steps=5)
    speed, simulation = re.findall(r"\d+", capsys.readouterr().out)
    assert int(speed) > 0 and 0 < int(simulation) < 100
    sim, tasks = fb.Simulation(go2), fb.standing_tasks(go2.standing())
    controller = fb.WholeBodyController(go2, fb.Contacts.feet(go2), tasks)
    for i in range(8):
        sim.reset(fb.State(go2, q[0, i], v[0, i]))
        for step in range(4):
            assert np.array_equal(controller(q[step, i], v[step, i]).tau, tau[step, i])
            sim.step(tau[step, i])
            sim.step(tau[step, i])
            assert np.allclose(sim.q, q[step + 1, i], atol=1e-6)
            assert np.allclose(sim.v, v[step + 1, i], atol=1e-4)
