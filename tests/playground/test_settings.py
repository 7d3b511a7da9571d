"""The program that the playground shows makes the same robot as the playground runs."""

from contextlib import closing
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import judges
import numpy as np
import pytest
from messages import raises

import floatbase as fb
from floatbase.behaviours import Gait
from floatbase.errors import FloatbaseError, InputError
from floatbase.live.settings import SETTINGS
from floatbase.playground import (
    PERIOD,
    BaseMotors,
    Playground,
    Session,
    Settings,
    nodding_rotation,
    term_arrows,
)

GO2 = judges.load("go2")
EACH = {
    "default": Settings(),
    "another model": Settings(
        friction=(0.5, 0.9), slope=(8.0, 10.0), mass=(1.2, 1.0), bandwidth=(8.0, 12.0)
    ),
    "another reality": Settings(
        mass=(1.0, 1.2), actual_off=("velocity", "cones"), friction=(0.6, 0.4)
    ),
    "another stance": Settings(com_shift=(-0.05, -0.03, -0.01), lifted_feet=("FL_foot",), facets=6),
    "another quadratic program": Settings(
        weights=(2.0, 10.0, 0.1), torque_fraction=0.8, min_normal_force=5.0
    ),
    "it trots": Settings(gait="trot", velocity=(0.2, 0.05, 0.1), friction=(0.6, 0.8)),
    "terms off": Settings(
        assumed_off=("velocity", "gravity", "drift", "cones"), actual_off=("velocity", "gravity")
    ),
    "motors of the base": Settings(assumed_off=("zeros",), actual_off=("zeros",)),
    "a leg ignored": Settings(assumed_off=("forces",), actual_off=("forces",), leg="FR_foot"),
    "it crawls with a mismatch": Settings(
        gait="crawl", mass=(1.1, 1.0), assumed_off=("drift",), facets=5, start_time=0.2
    ),
    "it steps on a slope": Settings(steps_when_pushed=True, slope=(2.0, 3.0)),
    "slowly": Settings(bandwidth=(1.2, 9.0), weights=(10.0**0.5, 1.0, 1.0), nod=0.1),
    "motors of a lighter base": Settings(
        assumed_off=("gravity", "velocity"), actual_off=("zeros",), mass=(1.3, 1.0)
    ),
}
SECONDS = 0.7  # of the program's three: the push is over, a trot is under way


def run_of(code: str) -> fb.Rollout:
    """Return the rollout of a program, for `SECONDS` instead of 3 s."""
    names: dict[str, Any] = {}
    assert code.count(", controller, 3, ") == 1
    exec(code.replace(", controller, 3, ", f", controller, {SECONDS}, "), names)
    run: fb.Rollout = names["run"]
    return run


def assert_same_run(robot: fb.Robot, settings: Settings, push: fb.Push | None = None) -> None:
    """Check that the program of a session reproduces it exactly."""
    session = Session(robot, settings)
    here = fb.rollout(
        session.sim, session.controller, SECONDS, [] if push is None else [push],
        control_period=PERIOD, actuators=session.actuators,
    )  # fmt: skip
    there = run_of(session.code(push))
    assert here.outcome == there.outcome and here.robot == there.robot
    for name in ("q", "v", "tau", "planned", "measured"):
        np.testing.assert_array_equal(getattr(here, name), getattr(there, name), err_msg=name)


@pytest.mark.parametrize("name", EACH)
def test_the_program_makes_the_same_run(name, capsys):
    assert_same_run(GO2, EACH[name], fb.Push([20.0, -10.0, 0.0], 0.5))
    assert " at " in capsys.readouterr().out


@pytest.mark.parametrize("name", ["ur5", "g1"])
def test_the_program_of_an_arm_and_of_a_biped_makes_the_same_run(name):
    robot = judges.load(name)
    walk = {"gait": "walk", "velocity": (0.1, 0.0, 0.0)} if robot.is_floating else {}
    assert_same_run(robot, Settings(com_shift=(0.01, 0.0, 0.0), **walk))


@pytest.mark.filterwarnings("ignore:.*has no posture")
@pytest.mark.parametrize(
    "names", [("it's", 'a "quoted" \\ foot'), ("__import__('os')", "'); 1/0; ('")]
)
def test_the_program_quotes_the_names_of_feet(names, tmp_path, monkeypatch):
    """The robot comes from a file in which the feet have unusual names."""
    urdf = judges.load("solo12").urdf
    for old, new in zip(("FL_FOOT", "HR_FOOT"), names, strict=True):
        urdf = urdf.replace(f'"{old}"', quoteattr(new))
    (tmp_path / "solo12.urdf").write_text(urdf)
    monkeypatch.chdir(tmp_path)
    first, last = names
    robot = fb.load_urdf("solo12.urdf", feet=[first, "FR_FOOT", "HL_FOOT", last], foot_radius=0.02)
    assert_same_run(robot, Settings(lifted_feet=(first,), friction=(0.6, 0.7), slope=(1.0, 2.0)))
    off = {"assumed_off": ("forces", "drift"), "actual_off": ("forces",)}
    assert_same_run(robot, Settings(leg=last, **off))
    push = fb.Push([1.0, 0.0, 0.0], 0.5, frame=last)
    assert_same_run(robot, Settings(), push)


def test_a_robot_of_the_catalogue_is_loaded_by_its_name():
    assert "fb.load('double_pendulum')" in Session(judges.load("double_pendulum")).code()


@pytest.mark.parametrize("name", EACH)
def test_changing_settings_equals_starting_with_them(name):
    """A session at rest that is changed equals one that starts with these settings."""
    changed, begun = Session(GO2), Session(GO2, EACH[name])
    changed.change(**{field: getattr(EACH[name], field) for field in Settings.__dataclass_fields__})
    assert changed.refusal == ""
    runs = [
        fb.rollout(s.sim, s.controller, 0.2, control_period=4e-3, actuators=s.actuators)
        for s in (changed, begun)
    ]
    assert np.array_equal(runs[0].q, runs[1].q)


REFUSED = {
    "a polyhedron with two facets": {"facets": 2, "mass": (1.0, 1.3)},
    "an unknown leg, another reality": {
        "slope": (10.0, 10.0), "friction": (0.5, 0.5), "assumed_off": ("forces",), "leg": "paw",
    },
    "an unknown leg, weak actuators": {
        "actual_off": ("forces",), "leg": "paw", "bandwidth": (5.0, 5.0), "mass": (1.0, 2.0),
    },
    "an unknown foot": {"lifted_feet": ("paw",), "mass": (1.0, 1.3), "bandwidth": (9.0, 9.0)},
    "a gait of other robots": {"gait": "walk", "friction": (0.2, 0.2)},
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "first"), [*zip(REFUSED, cycle(["default", "it trots", "motors of the base"]))]
)
def test_a_refused_change_leaves_everything_as_it_was(first, name):
    """After a refused change, a session continues as one without the request does."""
    asked, other = Session(GO2, EACH[first]), Session(GO2, EACH[first])
    for session in (asked, other):
        session.observe(fb.rollout(session.sim, session.controller, 0.1, control_period=PERIOD))
    before = dict(vars(asked))
    assert asked.change(**REFUSED[name]) is False and asked.refusal
    assert vars(asked) == before | {"refusal": asked.refusal}
    runs = []
    for session in (asked, other):
        runs.append(fb.rollout(session.sim, session.controller, 0.1, control_period=PERIOD))
        session.sim.reset()
        session.after_reset()
        runs.append(fb.rollout(session.sim, session.controller, 0.1, control_period=PERIOD))
    for mine, others in zip(runs[:2], runs[2:], strict=True):
        assert np.array_equal(mine.q, others.q) and np.array_equal(mine.tau, others.tau)
    assert asked.change(facets=5) is False and asked.refusal == ""


def test_a_walk_continues_when_its_velocity_or_gait_changes():
    session = Session(GO2, Settings(gait="trot"))
    walk = session.walk
    session.change(velocity=(0.2, 0.0, 0.1))
    session.change(gait="crawl", start_time=0.5)
    assert session.walk is walk and session.controller is walk
    assert walk.velocity.tolist() == [0.2, 0.0] and walk.yaw_rate == 0.1
    assert walk.gait == Gait.crawl(GO2, start=1.5) or walk.gait.start == 1.5
    session.change(gait=None)
    assert session.walk is walk and walk.gait.stop == session.sim.time
    session.change(gait="trot")
    assert session.walk is not walk


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("friction", (0.7, 0.0)), ("friction", 0.7), ("friction", ("a", "b")), ("slope", (0, 90)),
        ("mass", (1.0, -1.0)), ("mass", (1.0, np.nan)), ("bandwidth", (0.0, 5.0)),
        ("facets", 2), ("facets", 4.5), ("lifted_feet", "FL_foot"), ("lifted_feet", (1,)),
        ("com_shift", (0.0, 0.0)), ("nod", -0.1), ("nod", "a little"), ("torque_fraction", 0.0),
        ("torque_fraction", 1.5), ("min_normal_force", -1.0), ("weights", (1.0, 1.0, 0.0)),
        ("gait", "gallop"), ("gait", 1), ("velocity", (50.0, 0.0, 0.0)), ("leg", None),
        ("steps_when_pushed", "no"), ("assumed_off", ("inertia",)), ("actual_off", ("drift",)),
        ("actual_off", "gravity"), ("start_time", np.inf),
    ],
)  # fmt: skip
def test_invalid_settings_are_refused_by_name(field, value):
    with pytest.raises(FloatbaseError, match=field):
        Settings(**{field: value})


def test_a_gait_for_another_number_of_feet_is_refused():
    for settings in (Settings(gait="trot"), Settings(steps_when_pushed=True)):
        with raises(InputError, "ur5", "feet", 2, 4):
            Session(judges.load("ur5"), settings)


def test_removed_motors_of_the_base_push_no_more():
    session = Session(GO2, Settings(assumed_off=("zeros",), actual_off=("zeros",)))
    fb.rollout(session.sim, session.controller, 0.1, control_period=4e-3)
    assert session.sim.base_wrench[2] > 0.5 * GO2.weight
    session.change(assumed_off=(), actual_off=())
    assert not session.sim.base_wrench.any()


@pytest.mark.parametrize("off", ["gravity", "forces", "velocity"])
def test_motors_of_the_base_do_not_correct_other_mismatches(off):
    session = Session(GO2, Settings(assumed_off=(off,), actual_off=("zeros",), leg="FR_foot"))
    fb.rollout(session.sim, session.controller, 0.02, control_period=4e-3)
    assert np.abs(session.sim.base_wrench).max() < 1e-6 * GO2.weight


def test_motors_of_the_base_act_only_if_the_controller_assumes_them():
    """With motors of the base in the controller's model, the base carries itself."""
    used = {}
    for off in ((), ("zeros",)):
        session = Session(GO2, Settings(assumed_off=off, actual_off=("zeros",)))
        assert isinstance(session.controller, BaseMotors)
        record = fb.rollout(session.sim, session.controller, 0.4, control_period=4e-3)
        assert record.outcome == "completed"
        used[off] = float(np.abs(session.sim.base_wrench).max())
    assert used[()] < 1e-6 * GO2.weight < 0.5 * GO2.weight < used[("zeros",)]


def test_arrows_have_the_actual_mass():
    session = Session(GO2, Settings(mass=(1.0, 1.5)))
    record = fb.rollout(session.sim, session.controller, 0.02, control_period=4e-3)
    for mass in (1.0, 1.5):
        arrow = term_arrows("gravity", record, 1e-3, 0.4, (), mass)["term gravity/m g"]
        assert np.linalg.norm(arrow.matrix[:3, 2]) == pytest.approx(1e-3 * mass * GO2.weight)


def test_the_velocity_and_acceleration_of_nodding_are_its_derivatives():
    path, h = nodding_rotation(np.eye(3), 0.3, begin=1.0), 1e-4
    assert np.allclose(path(0.5)[0], np.eye(3), atol=1e-12)
    for t in (1.4, 2.0, 7.3):
        (before, w0, _), (now, omega, alpha), (after, w1, _) = path(t - h), path(t), path(t + h)
        spin = (after - before) / (2 * h) @ now.T
        assert np.allclose([spin[2, 1], spin[0, 2], spin[1, 0]], omega, atol=1e-5)
        assert np.allclose((w1 - w0) / (2 * h), alpha, atol=1e-3)


def test_settings_are_values_rounded_to_six_digits():
    assert replace(Settings(), gait="trot") == Settings(gait="trot") != Settings()
    assert Settings(weights=(10.0**0.5, 1, 1), lifted_feet=["a", "a"]) == Settings(
        weights=(3.16228, 1.0, 1.0), lifted_feet=("a",)
    )


def test_settings_being_applied_count_as_set(monkeypatch):
    """A slider that moves while the session changes keeps what another slider has set."""
    with closing(Playground(GO2)) as playground:
        change, seen = playground.session.change, []

        def watched(**changes: object) -> bool:
            seen.append(playground.pending_settings.velocity)
            return change(**changes)

        monkeypatch.setattr(playground.session, "change", watched)
        playground.set(velocity=(0.5, 0.0, 0.0))
        playground.set(friction=(0.5, 0.5))
        assert seen == [(0.5, 0.0, 0.0)] * 2
        assert playground.pending_settings == playground.session.settings


def test_an_ellipse_that_grows_keeps_its_phase():
    with closing(Playground(GO2)) as playground:
        session = playground.session
        playground.set(nod=0.1, start_time=0.5)
        session.sim.data.time = 2.0
        playground.set_nodding(0.2)
        assert (session.settings.nod, session.settings.start_time) == (0.2, 0.5)
        playground.set_nodding(0.0)
        playground.set_nodding(0.3)
        assert (session.settings.nod, session.settings.start_time) == (0.3, 2.0)


PLACES = {"live": "live page", "playground": "playground", "lesson": "lessons"}


def shown_control(playground: Playground, key: str, column: str = "") -> dict[str, Any]:
    """Return the command of a control; `key` is its key in the table of settings."""
    name = f"{SETTINGS[key].label} {column}".strip()
    command = playground.view.window.scene.command(("/", "set_control", name))
    assert command is not None, f"there is no control {name!r}"
    return command


def test_controls_have_the_words_and_ranges_of_the_table_of_settings():
    """Their first values are those of `Settings`, in the units of the table."""
    pairs = ("friction", "slope", "mass", "bandwidth")
    others = (
        "com_x", "com_y", "com_z", "nodding", "velocity_x", "velocity_y", "yaw_rate", "facets",
        "torque_limits", "normal_force", "motion_weight", "posture_weight", "effort_weight",
    )  # fmt: skip
    with closing(Playground(GO2)) as playground:
        for key in (*pairs, *others):
            for column in ("model", "reality") if key in pairs else ("",):
                made, setting = shown_control(playground, key, column), SETTINGS[key]
                assert made["value"] == setting.first, key
                assert (made["min"], made["max"]) == (setting.low, setting.high), key
                assert (made["step"], made["section"]) == (setting.step, setting.section), key


def test_the_playground_and_the_documentation_have_the_controls_of_the_table():
    """The live page's are tested in live.test.js, those of the lessons in test_panels.py."""
    with closing(Playground(GO2)) as playground:
        commands = playground.view.window.scene.commands()
    made = [name for _, kind, name in commands if kind == "set_control"]
    docs = (Path(__file__).parents[2] / "docs" / "live.md").read_text(encoding="utf-8")
    table = {tuple(cell.strip() for cell in row.split("|")[1:5]) for row in docs.splitlines()}
    for key, row in SETTINGS.items():
        in_playground = any(name.startswith(row.label) for name in made)
        assert in_playground == ("playground" in row.places) or key == "force_error", key
        if key != "force_error":
            bounds = f"{row.low:g} to {row.high:g}" if row.step else ""
            places = ", ".join(PLACES[place] for place in row.places.split())
            assert (f"*{row.label}*", row.section, bounds, places) in table, key


def test_sliders_show_settings_in_the_units_of_the_table():
    settings = Settings(
        mass=(1.0, 1.5), com_shift=(0.04, 0.0, -0.5), torque_fraction=0.55, weights=(1.0, 10.0, 1.0)
    )
    with closing(Playground(GO2, settings)) as playground:
        assert shown_control(playground, "mass", "reality")["value"] == 150
        assert shown_control(playground, "com_x")["value"] == 4
        assert shown_control(playground, "com_z")["value"] == -8  # the end of the slider
        assert shown_control(playground, "torque_limits")["value"] == 55
        assert shown_control(playground, "posture_weight")["value"] == 1


def test_a_speed_that_the_legs_cannot_reach_is_shown():
    session = Session(GO2, Settings(gait="trot", velocity=(0.2, 0.0, 0.0)))
    assert session.walk is not None and session.speed_limit == ""
    assert not session.change(gait="crawl", velocity=(0.5, 0.0, 0.0)) and not session.refusal
    assert session.walk.speed_fraction < 1.0
    assert f"{0.5 * session.walk.speed_fraction:.2f} m/s" in session.speed_limit
    session.change(gait=None)
    assert session.speed_limit == ""


@pytest.mark.parametrize("name", ["go2", "solo12", "talos"])
def test_a_robot_survives_the_default_push(name):
    robot = judges.load(name)
    with closing(Playground(robot)) as playground:
        force = playground.force
    assert force == pytest.approx(SETTINGS["push"].first * robot.weight, abs=0.5)
    session = Session(robot)
    push = fb.Push([0.0, force, 0.0], start=0.1)
    record = fb.rollout(session.sim, session.controller, 1.0, [push], PERIOD)
    assert record.outcome == "completed"
    moved = np.linalg.norm(record.com - record.com[0], axis=1).max()
    assert moved > 2e-3  # visible
