"""Parts of the benchmarks: problems and processes of the comparison with peers, soaks, tables."""

import mmap
import socket
import sys
import typing
from pathlib import Path

import numpy as np
import pytest
from messages import raises

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("benchmarks are not part of this copy", allow_module_level=True)
sys.path.append(str(BENCHMARKS))

import harness  # noqa: E402
import peer_problems  # noqa: E402
import peer_wire  # noqa: E402
import peers  # noqa: E402
import robots_tried  # noqa: E402
import soak  # noqa: E402
import tick  # noqa: E402

from floatbase import control, dynamics, objectives  # noqa: E402
from floatbase.objectives._task import TargetTask  # noqa: E402


def test_the_time_of_every_task_constraint_and_inequality_is_measured(go2):
    public = {getattr(objectives, name) for name in objectives.__all__}
    tasks = {each for each in public if isinstance(each, type) and issubclass(each, TargetTask)}
    assert tasks == {type(task) for task in tick.added_tasks(go2)}
    added = {type(c).__name__ for group in tick.added_contacts(go2).values() for c in group}
    names = {*added, *tick.added_inequalities(go2), *tick.added_contacts(go2)}
    public = [getattr(module, name) for module in (dynamics, control) for name in module.__all__]
    for each in public:
        makes = getattr(each, "__annotations__", {}).get("return", "")
        is_constraint = hasattr(each, "row_names") and not getattr(each, "_is_protocol", False)
        if makes in {"LinearConstraint", "LinearInequality"} or is_constraint:
            assert each.__name__ in {*names, "FlatFootContact", "LinearInequality"}
    blocks = {each.block for each in tick.added_inequalities(go2).values()}
    assert blocks == set(typing.get_args(dynamics.Block))


def test_contact_points_and_friction_rows_are_those_of_the_peers():
    problem = peer_problems.problem("go2", "tsid")
    assert all(foot.radius == 0.0 and not np.any(foot.centre) for foot in problem.robot.feet)
    qp = problem.controller("reference").qp(problem.robot.standing())
    rows = qp.G[:4, qp.blocks["forces"]][:, :3]
    mu = peer_problems.MU
    expected = [[1, 0, -mu], [0, 1, -mu], [-1, 0, -mu], [0, -1, -mu]]
    assert np.allclose(rows, expected, atol=1e-12)


def test_joints_can_stop_within_limits_that_peers_share():
    for peer in peer_problems.LIMITED:
        problem = peer_problems.problem("talos", peer)
        limits, d = problem.joint_limits, problem.robot.d
        for q, v in problem.states("saturated", 5):
            stop = q[-d:] + v[-d:] * np.abs(v[-d:]) / (2.0 * limits.braking)
            assert np.all((limits.lower <= stop) & (stop <= limits.upper))
            assert np.all(np.abs(v[-d:]) < limits.velocity)
            least, largest = limits.bounds(q[-d:], v[-d:])
            assert np.all((least < largest) & (np.abs(largest) <= limits.acceleration))


@pytest.mark.front_end
def test_a_process_gives_the_torques_of_its_controller():
    problem = peer_problems.problem("go2", "tsid")
    states = problem.states("medium", 2)
    process = peers.ours("reference")
    assert process.ask("problem", problem.description) == "done"
    process.ask("states", {"some": [(q.tolist(), v.tolist()) for q, v in states]})
    controller = problem.controller("reference")
    expected = [controller(q, v).tau for q, v in states]
    assert np.allclose(process.ask("torques", "some"), expected, atol=1e-9)
    for clock in ("clock", "cold"):
        times = process.ask(clock, "some")
        assert len(times) == 2 and min(times) > 0
    process.close()


@pytest.mark.front_end
def test_a_process_that_ends_says_why(tmp_path):
    script = tmp_path / "broken.py"
    script.write_text("raise SystemExit('there is no such library')")
    with raises(RuntimeError, "broken", 1, "there is no such library"):
        peer_wire.Process(Path(sys.executable), script).ask("problem", {})


@pytest.mark.front_end
@pytest.mark.parametrize("name", soak.SOAKS)
def test_a_short_soak_holds(name, monkeypatch):
    monkeypatch.setattr(soak, "SAMPLES", 2)
    monkeypatch.setattr(soak, "PACE", 0.0)  # a busy machine does not keep real time
    monkeypatch.setitem(soak.LIMITS, "memory, MB", 200.0)  # some modules are loaded late
    assert soak.run(name, 3).broken == ""


@pytest.mark.front_end
def test_a_soak_reports_what_grows_and_what_breaks(monkeypatch):
    kept = []

    def leaking():
        def step():
            # an array might take memory that other tests have freed
            fresh = mmap.mmap(-1, 2_000_000)
            fresh.write(b"x" * len(fresh))
            kept.append((fresh, socket.socket()))

        yield step

    def breaks():
        def step():
            raise AssertionError("it broke")

        yield step

    monkeypatch.setattr(soak, "SAMPLES", 4)
    monkeypatch.setattr(soak, "SOAKS", {"leaking": (leaking, 20), "breaks": (breaks, 20)})
    found = soak.run("leaking", 20).broken
    kept.clear()
    assert "memory, MB: +" in found and "descriptors: +" in found and "threads" not in found
    assert soak.run("breaks", 20).broken == "it broke"


def test_a_table_has_a_line_for_each_row_and_a_page_its_parts(tmp_path):
    table = harness.table(" | a | b", [("x", 1, 2), ("y", 3, 4)])
    assert table.splitlines() == ["|  | a | b |", "|---|---|---|", "| x | 1 | 2 |", "| y | 3 | 4 |"]
    harness.write(str(tmp_path / "some.py"), "Title", "Words.", table)
    page = (tmp_path / "some.md").read_text(encoding="utf-8")
    assert page == f"# Title\n\nWords.\n\n{table}\n"


def test_the_page_of_robots_has_the_columns_of_its_program():
    text = robots_tried.PAGE.with_suffix(".md").read_text(encoding="utf-8")
    assert f"| {robots_tried.HEADER} |" in text


def test_files_of_packages_that_are_not_installed_are_named(tmp_path):
    rows = [robots_tried.row(*file) for file in robots_tried.found(str(tmp_path))]
    assert {row[0] for row in rows} >= {"mjlab", "pybullet"}
    assert all("not installed" in row and len(row) == len(rows[0]) for row in rows)
    assert len(rows[0]) == robots_tried.HEADER.count("|") + 1
