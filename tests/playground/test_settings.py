"""What the playground shows as Python is what it runs: pasted elsewhere, it makes the same robot."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.playground import (
    BaseMotors,
    Playground,
    Session,
    Settings,
    nodding_rotation,
    term_arrows,
)

GO2 = judges.load("go2")
EACH = {
    "as it begins": Settings(),
    "believed otherwise": Settings(
        friction=(0.5, 0.9), slope=(8.0, 10.0), mass=(1.2, 1.0), bandwidth=(8.0, 12.0)
    ),
    "another world": Settings(
        mass=(1.0, 1.2), actual_off=("velocity", "cones"), friction=(0.6, 0.4)
    ),
    "another stance": Settings(com_shift=(-0.05, -0.03, -0.01), lifted_feet=("FL_foot",), facets=6),
    "another program": Settings(
        weights=(2.0, 10.0, 0.1), torque_fraction=0.8, min_normal_force=5.0
    ),
    "it nods": Settings(nod=0.2),
    "it trots": Settings(gait="trot", velocity=(0.2, 0.05, 0.1), friction=(0.6, 0.8)),
    "it steps": Settings(steps_when_pushed=True),
    "terms off": Settings(assumed_off=("velocity", "drift", "cones"), actual_off=("velocity",)),
    "motors of the base": Settings(assumed_off=("zeros",), actual_off=("zeros",)),
    "a leg unfelt": Settings(assumed_off=("forces",), actual_off=("forces",), leg="FR_foot"),
    "no gravity": Settings(assumed_off=("gravity",), actual_off=("gravity",)),
}
SECONDS = 1.0  # of the program's three: the push is over, a trot is under way


def run_of(code: str) -> fb.Rollout:
    """The rollout of a program."""
    names: dict[str, Any] = {}
    exec(code, names)
    run: fb.Rollout = names["run"]
    return run


@pytest.mark.parametrize("name", EACH)
def test_the_program_runs_and_makes_the_same_robot(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    settings, period = EACH[name], 4e-3
    session = Session(GO2, settings)
    push = fb.Push([20.0, -10.0, 0.0], 0.5)
    here = fb.rollout(
        session.sim,
        session.controller,
        SECONDS,
        [push],
        control_period=period,
        actuators=session.actuators,
    )
    program = settings.code(GO2, period, push)
    assert ", controller, 3, [" in program
    there = run_of(program.replace(", controller, 3, [", f", controller, {SECONDS}, ["))
    assert (
        here.outcome == there.outcome
        and np.array_equal(here.q, there.q)
        and np.array_equal(here.planned, there.planned)
    )
    assert there.outcome in capsys.readouterr().out


def test_the_program_of_a_robot_of_ones_own_loads_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "my.urdf").write_text(judges.load("solo12").urdf)
    monkeypatch.chdir(tmp_path)
    assert "fb.load('double_pendulum')" in Settings().code(judges.load("double_pendulum"), 4e-3)
    own = fb.load_urdf(
        "my.urdf", feet=["FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT"], foot_radius=0.02
    )
    assert run_of(Settings().code(own, 4e-3)).robot == own


@pytest.mark.parametrize("name", EACH)
def test_changes_lead_where_a_beginning_with_them_leads(name: str) -> None:
    """On its feet and at rest, a session that is changed has the controller, world and actuators of
    one that begins so.
    """
    changed, begun = Session(GO2), Session(GO2, EACH[name])
    changed.change(**{field: getattr(EACH[name], field) for field in Settings.__dataclass_fields__})
    assert changed.refusal == ""
    runs = [
        fb.rollout(s.sim, s.controller, 0.2, control_period=4e-3, actuators=s.actuators)
        for s in (changed, begun)
    ]
    assert np.array_equal(runs[0].q, runs[1].q)


def test_what_cannot_be_is_told_and_the_robot_goes_on() -> None:
    session = Session(GO2)
    before = session.controller
    session.change(facets=2)
    assert "facets" in session.refusal and session.controller is before
    session.change(facets=5)
    assert session.refusal == "" and session.controller is not before


def test_the_program_is_what_runs_after_a_change_was_refused() -> None:
    """Nothing of a refused change stays, in the world or on the page, and a reset after it finds
    its controller.
    """
    session = Session(GO2)
    for changes in ({"facets": 2, "mass": (1.0, 1.3)}, {"facets": 2, "slope": (10.0, 10.0)}):
        assert session.change(**changes) == ("slope" in changes)
        assert session.refusal and np.isclose(session.sim.model.body_mass.sum(), GO2.mass)
        session.sim.reset()
        session.after_reset()
        here = fb.rollout(
            session.sim, session.controller, 0.2, control_period=4e-3, actuators=session.actuators
        )
        there = run_of(session.settings.code(GO2, 4e-3))
        assert np.array_equal(here.q, there.q[: len(here)])


def test_motors_of_the_base_that_are_taken_away_push_no_more() -> None:
    session = Session(GO2, Settings(assumed_off=("zeros",), actual_off=("zeros",)))
    fb.rollout(session.sim, session.controller, 0.1, control_period=4e-3)
    assert session.sim.base_wrench[2] > 0.5 * GO2.weight
    session.change(assumed_off=(), actual_off=())
    assert not session.sim.base_wrench.any()


@pytest.mark.parametrize("believed", ["gravity", "forces", "velocity"])
def test_motors_of_the_base_do_not_mend_what_else_a_controller_mistakes(believed: str) -> None:
    session = Session(GO2, Settings(assumed_off=(believed,), actual_off=("zeros",), leg="FR_foot"))
    fb.rollout(session.sim, session.controller, 0.02, control_period=4e-3)
    assert np.abs(session.sim.base_wrench).max() < 1e-6 * GO2.weight


def test_motors_of_the_base_do_nothing_unless_the_controller_believes_in_them() -> None:
    """With them and without gravity in its plan's torques, the base carries itself: joints need
    next to nothing.
    """
    used = {}
    for believed in ((), ("zeros",)):
        session = Session(GO2, Settings(assumed_off=believed, actual_off=("zeros",)))
        assert isinstance(session.controller, BaseMotors)
        record = fb.rollout(session.sim, session.controller, 0.4, control_period=4e-3)
        assert record.outcome == "completed"
        used[believed] = float(np.abs(session.sim.base_wrench).max())
    assert used[()] < 1e-6 * GO2.weight < 0.5 * GO2.weight < used[("zeros",)]


def test_gravity_has_no_arrow_where_the_world_has_none() -> None:
    session = Session(GO2)
    record = fb.rollout(session.sim, session.controller, 0.02, control_period=4e-3)
    assert list(term_arrows("gravity", record, 1e-3, 0.4)) == [
        "term gravity/m g",
        "term gravity/m g label",
    ]
    (word,) = term_arrows("gravity", record, 1e-3, 0.4, ("gravity",)).values()
    assert word.shape.name == "m g: switched off"
    (word,) = term_arrows("velocity", record, 1e-3, 0.4).values()
    assert word.shape.name == "C q̇ ≈ 0"
    assert term_arrows("zeros", record, 1e-2, 0.4, ("zeros",)), (
        "torques are there with motors of the base, too"
    )


def test_arrows_of_masses_are_those_of_the_world() -> None:
    session = Session(GO2, Settings(mass=(1.0, 1.5)))
    record = fb.rollout(session.sim, session.controller, 0.02, control_period=4e-3)
    lengths = [
        np.linalg.norm(
            term_arrows("gravity", record, 1e-3, 0.4, (), mass)["term gravity/m g"].matrix[:3, 2]
        )
        for mass in (1, 1.5)
    ]
    assert lengths[1] == pytest.approx(1.5 * lengths[0])
    assert lengths[0] == pytest.approx(1e-3 * GO2.weight)


def test_nodding_has_the_velocity_and_acceleration_that_differences_have() -> None:
    path, h = nodding_rotation(np.eye(3), 0.3, begin=1.0), 1e-4
    assert np.allclose(path(0.5)[0], np.eye(3), atol=1e-12)
    for t in (1.4, 2.0, 7.3):
        (before, w0, _), (now, omega, alpha), (after, w1, _) = path(t - h), path(t), path(t + h)
        spin = (after - before) / (2 * h) @ now.T
        assert np.allclose([spin[2, 1], spin[0, 2], spin[1, 0]], omega, atol=1e-5)
        assert np.allclose((w1 - w0) / (2 * h), alpha, atol=1e-3)


def test_settings_keep_their_kind_when_replaced() -> None:
    assert replace(Settings(), gait="trot").gait == "trot"
    assert Settings().is_nominal and not Settings(mass=(1.0, 1.1)).is_nominal


def test_an_ellipse_that_grows_keeps_its_phase() -> None:
    playground = Playground(GO2)
    try:
        playground.set(nod=0.1, start_time=0.5)
        playground.session.sim.data.time = 2.0
        playground.set_nodding(0.2)
        assert (playground.session.settings.nod, playground.session.settings.start_time) == (
            0.2,
            0.5,
        )
        playground.set_nodding(0.0)
        playground.set_nodding(0.3)
        assert (playground.session.settings.nod, playground.session.settings.start_time) == (
            0.3,
            2.0,
        )
    finally:
        playground.close()
