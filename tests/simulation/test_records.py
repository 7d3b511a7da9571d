"""A loaded run equals the saved one, and its table has a name and a unit for each column."""

from __future__ import annotations

import json
from dataclasses import fields
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import judges
import numpy as np
import pandas as pd
import pytest
from messages import raises, refused, warns
from numpy.testing import assert_allclose, assert_array_equal
from values import record

import floatbase as fb
from floatbase.behaviours import Gait, Walk
from floatbase.dynamics import PointContact, fixed_frame
from floatbase.errors import InfeasibleError, InputError, SimulationWarning
from floatbase.robots import with_floating_base
from floatbase.simulation import Box

ROBOTS = {
    "changed": lambda: fb.load("solo12", locked=["FL_KFE"]).with_payload("base", 0.5),
    "fixed base": lambda: fb.load("tiago"),
    "MJCF": lambda: fb.load(Path(__file__).parents[1] / "robots/hopper.xml"),
    "on a plate": lambda: with_floating_base(judges.load("ur5"), plate=True),
}


def without_control(robot: fb.Robot, seconds: float = 0.01) -> fb.Rollout:
    """Return a run of a robot with small torques."""
    command = SimpleNamespace(tau=0.01 * np.arange(robot.d))
    return fb.rollout(fb.Simulation(robot), lambda q, v, t: command, seconds)


def reloaded(run: fb.Rollout, folder: Path, **options: Any) -> fb.Rollout:
    """Save a run, and return the loaded one."""
    run.save(folder / "run.npz")
    return fb.Rollout.load(folder / "run.npz", **options)


@pytest.mark.parametrize("kind", ROBOTS)
@pytest.mark.filterwarnings("ignore::floatbase.errors.RobotWarning")
def test_a_loaded_run_has_the_same_robot(kind: str, tmp_path: Path) -> None:
    run = without_control(ROBOTS[kind]())
    loaded = reloaded(run, tmp_path)
    for name in ("joint_names", "frames", "package_dirs", "name"):
        assert getattr(loaded.robot, name) == getattr(run.robot, name)
    assert loaded.robot.has_joints_of(run.robot)  # states and controllers fit both
    assert (loaded.robot.nominal is None) == (run.robot.nominal is None)
    here, there = loaded.state(-1), run.state(-1)
    assert_allclose(here.M, there.M, atol=1e-12 * np.abs(there.M).max())
    assert_allclose(here.h, there.h, atol=1e-12 * np.abs(there.h).max())
    assert_array_equal(loaded.robot.torque_limits, run.robot.torque_limits)
    made, saved = fb.Simulation(loaded.robot), fb.Simulation(run.robot)
    assert_array_equal(made.contact_positions(), saved.contact_positions())


def test_a_loaded_walk_has_all_that_was_recorded(tmp_path: Path, go2) -> None:
    ground = fb.Ground(0.8, boxes=[Box([1.0, 2.0], [-1.0, 1.0], 0.1)])
    walk = Walk(go2, fb.Contacts.feet(go2, 0.6), Gait.trot(go2, start=0.01), (0.3, 0.0))
    sim, push = fb.Simulation(go2, ground), fb.Push([0.0, 9.0, 0.0], 0.01, 0.02, "FL_foot")

    def fails_late(q: Any, v: Any, t: float) -> Any:
        if t > 0.1:
            raise InfeasibleError("no forces", ["friction of FL_foot"])
        command, fails_late.contacts = walk(q, v, t), walk.contacts
        return command

    run = fb.rollout(sim, fails_late, 0.2, [push], settling_time=0.02)
    loaded = reloaded(run, tmp_path, robot=go2)
    assert loaded.robot is go2
    for field in fields(fb.Rollout):
        one, other = getattr(loaded, field.name), getattr(run, field.name)
        if isinstance(other, np.ndarray):
            assert_array_equal(one, other)
            assert not one.flags.writeable
    assert {name: rows.shape for name, rows in loaded.targets.items()} == {
        name: rows.shape for name, rows in run.targets.items()
    }
    names = [stance.names for stance in run.stances]
    assert [stance.names for stance in loaded.stances] == names and len(set(names)) > 1
    assert_array_equal(loaded.slip(), run.slip())
    assert_array_equal(loaded.pushes[0].force, push.force)
    assert type(loaded.error) is InfeasibleError and loaded.error.constraints == (
        "friction of FL_foot",
    )
    assert loaded.outcome == run.outcome and loaded.controller_off_time == run.controller_off_time
    assert_array_equal(loaded.joint_limits.lower, run.joint_limits.lower)
    assert loaded.ground.height([1.5, 0.0]) == 0.1 and loaded.ground.mus == [0.8]


def test_constraints_keep_their_forces_and_lose_their_functions(tmp_path: Path, go2) -> None:
    class Lift(PointContact):
        def constraint(self, state: fb.State, t: float = 0.0) -> Any:
            A, b = super().constraint(state, t)
            return A, b + [0.0, 0.0, 0.1]

    feet = [Lift(foot.frame, mu=0.4, radius=foot.radius) for foot in go2.feet]
    contacts = fb.Contacts([*feet, fixed_frame("base")])
    control = fb.WholeBodyController(go2, contacts, fb.standing_tasks(go2.standing()))
    with warns(SimulationWarning, "bolts of base"):
        run = fb.rollout(fb.Simulation(go2), control, 0.005)
    with warns(SimulationWarning, "FL_foot", "PointContact"):
        loaded = reloaded(run, tmp_path)
    assert loaded.contacts.names == contacts.names and loaded.contacts["FL_foot"].mu == 0.4
    assert_array_equal(loaded.force("FL_foot", "planned"), run.force("FL_foot", "planned"))
    assert_array_equal(loaded.table()["bolts of base multiplier row 2 [SI]"], run.planned[:, 14])
    with raises(InputError, "bolts of base"):
        loaded.contacts.constraint(loaded.state(0))


def test_other_files_and_robots_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    record().save(path)
    content = path.read_bytes()
    with np.load(path) as stored:
        arrays = dict(stored)
    header = json.loads(str(arrays["header"]))
    with raises(InputError, "run.npz", "ur5"):
        fb.Rollout.load(path, robot=judges.load("ur5"))
    newer = json.dumps(header | {"format": "floatbase rollout 2"})
    changes = [
        ("2", {"header": np.array(newer)}),
        ("damaged", {"header": np.zeros(3)}),
        ("(4, 19)", {"q": arrays["q"][:-1]}),
        ("(5, 11)", {"tau": arrays["tau"][:, :-1]}),
    ]
    for named, change in changes:
        np.savez(path, **arrays | change)
        with raises(InputError, "run.npz", named):
            fb.Rollout.load(path)
    np.savez(path, **{name: rows for name, rows in arrays.items() if name != "measured"})
    with raises(InputError, "run.npz", "damaged"):
        fb.Rollout.load(path)
    for wrong in (b"", b"junk", content[: len(content) // 2], content.replace(b"PK", b"PQ")):
        path.write_bytes(wrong)
        with raises(InputError, "run.npz"):
            fb.Rollout.load(path)
    for odd in (tmp_path, tmp_path / "nowhere" / "run.npz", 3):
        for call in (fb.Rollout.load, record().save):
            refused(partial(call, odd), InputError, str(odd))


def test_a_save_that_fails_leaves_the_former_file(tmp_path: Path, monkeypatch: Any) -> None:
    path = tmp_path / "run.npz"
    record().save(path)

    def full(file: Any, **arrays: Any) -> None:
        file.write(b"part")
        raise OSError(28, "No space left")

    monkeypatch.setattr(np, "savez_compressed", full)
    with raises(InputError, "run.npz", "No space left"):
        record().save(path)
    assert len(fb.Rollout.load(path)) == len(record()) and [*tmp_path.iterdir()] == [path]


def test_a_table_has_a_column_with_its_unit_for_everything(tmp_path: Path) -> None:
    run = record()
    table = run.table()
    assert table.columns.is_unique and len(table) == len(run)
    assert [name for name in table.columns if not name.endswith("]")] == [
        f"{name} in stance" for name in run.contacts.names
    ]
    for name, rows in {
        "time [s]": run.time,
        "base position z [m]": run.q[:, 2],
        "base quaternion w [-]": run.q[:, 6],
        "base angular velocity x [rad/s]": run.v[:, 3],
        "CoM position y [m]": run.com[:, 1],
        "FR_calf_joint position [rad]": run.q[:, 12],
        "FR_calf_joint velocity [rad/s]": run.v[:, 11],
        "FR_calf_joint torque [N·m]": run.tau[:, 5],
        "RL_foot planned force z [N]": run.planned[:, 8],
        "RR_foot position x [m]": run.foot_positions[:, 3, 0],
    }.items():
        assert_array_equal(table[name], rows)
    table.to_csv(tmp_path / "run.csv", index=False)
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "run.csv"), table)


@pytest.mark.filterwarnings("ignore::floatbase.errors.RobotWarning")
def test_tables_have_soles_sliding_joints_wheels_and_empty_runs() -> None:
    run = without_control(with_floating_base(judges.load("ur5"), plate=True))
    table, foot = run.table(), run.contacts.names[0]
    corners = [f"{name} measured force z [N]" for name in run.contacts[foot].point_names]
    assert_allclose(table[f"{foot} measured force z [N]"], table[corners].sum(axis=1))
    tiago = without_control(fb.load("tiago"))
    table = tiago.table()
    lift = tiago.robot.joint_names.index("torso_lift_joint")
    assert_array_equal(table["torso_lift_joint torque [N]"], tiago.tau[:, lift])
    angle = table["wheel_left_joint position [rad]"].to_numpy()
    index = tiago.robot.model.joints[tiago.robot.model.getJointId("wheel_left_joint")].idx_q
    assert_allclose(np.cos(angle), tiago.q[:, index], atol=1e-12)

    def fails(q: Any, v: Any, t: float) -> Any:
        raise InfeasibleError("no")

    empty = fb.rollout(fb.Simulation(judges.load("go2")), fails, 0.01).table()
    assert len(empty) == 0 and set(empty.columns) == set(record().table().columns)
