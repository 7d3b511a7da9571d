"""Lesson 09: its helpers do what they say."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.patches import Polygon

import floatbase as fb
from floatbase.behaviours import Gait, Swing, Walk
from floatbase.dynamics import LinearConstraint
from floatbase.friction import WrenchSet, centre_of_pressure, contact_wrench, wrench_set
from floatbase.lessons import all_exercises
from floatbase.lessons.lesson09 import (
    centre_of_pressure_path,
    corner_forces,
    leaning_controller,
    limit_kinds,
    load_talos,
    make_controller,
    make_standing_controller,
    outcome_text,
    play_resultants,
    plot_walk,
    run_lean,
    run_standing,
    show_sole,
    show_soles,
    single_support_rows,
    soles_picture,
)
from floatbase.simulation import Rollout
from floatbase.viewer.scene.colours import GREYS, PLANNED, hex_code

TALOS = load_talos()
STATE = TALOS.standing()
SOLES = fb.Contacts.flat_feet(TALOS, mu=0.7)
LEFT = SOLES.only("left_sole_link")
MIDDLE = STATE.point("left_sole_link")
SOLVED = 0.05  # N, and N·m: what a least-squares fit with a small cost on forces of 100 N leaves


@cache
def limits() -> WrenchSet:
    return replace(wrench_set(STATE, LEFT), reference_point=MIDDLE)


@cache
def stood() -> Rollout:
    return run_standing(SOLES, 0.4)


@pytest.fixture
def view() -> Iterator[fb.Viewer]:
    made = fb.Viewer(TALOS)
    yield made
    made.close()


# exercises ----------------------------------------------------------------------------------------


def test_09_4_takes_no_lean_that_lets_arms_and_trunk_go(monkeypatch: pytest.MonkeyPatch) -> None:
    judge = all_exercises()["09.3"].judge
    assert judge([1.5, 0.0]).hint in ("falls", "in_the_air", "tips")
    record = run_lean(1.5, 0.01)
    jump = replace(record, measured=0.0 * record.measured)
    monkeypatch.setattr(
        "floatbase.lessons.lesson09.exercises.run_lean", lambda seconds, posture: jump
    )
    assert judge([1.5, 0.01]).hint == "in_the_air"


# helpers ------------------------------------------------------------------------------------------


def test_talos_stands_and_the_pressure_of_a_record_is_the_centre_of_pressure() -> None:
    record = stood()
    assert record.outcome == "completed"
    expected = centre_of_pressure(record.final, SOLES, record.measured[-1])
    assert np.allclose(centre_of_pressure_path(record)[-1], expected[:2], atol=1e-5)
    assert np.isnan(centre_of_pressure_path(replace(record, measured=0.0 * record.measured))).all()


def test_how_a_record_ended_in_words() -> None:
    record = stood()
    assert outcome_text(record) == "stands"
    ways = {
        "falls forwards": [0.2, 0.1, 0],
        "falls backwards": [-0.2, 0.1, 0],
        "falls aside": [0.1, -0.2, 0],
    }
    for words, way in ways.items():
        q = np.array(record.q)
        q[-1, :3] += way
        assert outcome_text(replace(record, outcome="fell", q=q)) == words


def test_corner_forces_make_the_wrench_if_the_rows_allow_it_and_else_stay_inside() -> None:
    possible = np.array([20.0, -30.0, 443.0, 5.0, -12.0, 6.0])
    forces = corner_forces(STATE, LEFT, possible)
    assert np.max(limits().face_matrix @ possible) < 0.0
    assert np.allclose(contact_wrench(STATE, LEFT, forces, MIDDLE), possible, atol=SOLVED)
    beyond = np.array([0.0, 0.0, 443.0, 0.0, -60.0, 0.0])  # beyond the toes
    nearest = contact_wrench(STATE, LEFT, corner_forces(STATE, LEFT, beyond), MIDDLE)
    assert np.max(limits().face_matrix @ nearest) < SOLVED and not np.allclose(
        nearest, beyond, atol=1.0
    )


def test_rows_of_a_sole_have_names() -> None:
    rows = [[1, 0, -0.5, 0, 0, 0], [0, 0, -0.1, 0, 1, 0], [0.1, 0, -0.1, 0, 0, -1]]
    assert limit_kinds(rows) == ["sliding", "tipping", "twisting"]


def test_a_lean_goes_where_it_should_at_its_time() -> None:
    path = next(
        task for task in leaning_controller(6.0, 1.0, 0.01).tasks if isinstance(task, fb.CoMTask)
    ).position
    assert isinstance(path, Swing)
    assert np.allclose(path(0.1)[0], STATE.com) and np.allclose(
        path(1.3)[0], STATE.com + [0.06, 0.0, 0.0]
    )
    record = run_lean(1.5, 0.01)
    assert np.isclose(record.final.com[0] - STATE.com[0], 0.06, atol=2e-3)


def test_the_roses_are_of_talos_with_and_without_steps() -> None:
    assert (
        make_controller().stepping_gait is not None
        and make_standing_controller().stepping_gait is None
    )
    assert make_controller().robot is make_standing_controller().robot is TALOS


# pictures -----------------------------------------------------------------------------------------


def test_soles_are_drawn_with_their_forces_and_crosses(view: fb.Viewer) -> None:
    forces = np.tile([0.0, 0.0, TALOS.weight / 8], 8)
    drawn = show_soles(view, STATE, SOLES, forces)
    assert (
        drawn.count("<polygon") == 2
        and drawn.count("<circle") == 8 + 1
        and drawn.count("<path") == 3
    )
    assert sum(path.startswith("planned/") for path in view.renderer.picture) == 8
    right_foot_up = np.concatenate([forces[:12], np.zeros(12)])
    assert soles_picture(STATE, SOLES, right_foot_up).count("<path") == 2
    assert set(re.findall(r"#[0-9A-F]{6}", drawn)) <= {
        hex_code(colour) for colour in (*GREYS, PLANNED)
    }


def test_one_sole_says_which_rows_are_broken(view: fb.Viewer) -> None:
    weight = np.array([0.0, 0.0, 443.0, 0.0, 0.0, 0.0])
    assert "corner forces exist" in show_sole(view, STATE, LEFT, limits(), weight)
    assert "planned/sum" in view.renderer.picture
    for change, kind in (((0, 300.0), "sliding"), ((4, -60.0), "tipping"), ((5, 40.0), "twisting")):
        wrench = weight.copy()
        wrench[change[0]] = change[1]
        drawn = show_sole(view, STATE, LEFT, limits(), wrench)
        assert kind in drawn and "closest forces" in drawn


def test_the_slice_is_as_wide_as_the_sole_and_as_high_as_the_twist(view: fb.Viewer) -> None:
    weight = np.array([0.0, 0.0, 443.0, 0.0, 0.0, 0.0])
    drawn = show_sole(view, STATE, LEFT, limits(), weight)
    points = re.search(r'<polygon points="([^"]*)"', drawn)
    assert points is not None
    corners = np.array([[float(x) for x in pair.split(",")] for pair in points[1].split()])
    assert np.allclose(np.ptp(corners[:, 0]) * 300 / 300, 200.0, atol=2.0)  # mm
    most = limits().max_scaling([0, 0, 0, 0, 0, 1], weight)
    assert np.allclose(np.ptp(corners[:, 1]) * 120 / 250, 2 * most, atol=1.0)  # N·m


def test_a_plan_without_corners_is_played_with_its_resultants(view: fb.Viewer) -> None:
    bolts = fb.Contacts([LinearConstraint(sole.name, 6, sole.constraint) for sole in SOLES])
    record = run_standing(bolts, 0.1)
    assert play_resultants(view, record, 0.5, "bolted") is view
    assert [path for path in view.renderer.picture if path.startswith("planned/")] == [
        f"planned/{name}" for name in bolts.names
    ]


def test_a_walk_and_a_lean_are_plotted_in_greys() -> None:
    walk = Walk(TALOS, SOLES, Gait.walk(TALOS, start=0.2), velocity=(0.2, 0.0))
    record = fb.rollout(fb.Simulation(TALOS), walk, 0.4, control_period=4e-3)
    alone = single_support_rows(record)
    assert alone and single_support_rows(stood()) == {}
    for i, corners in alone.items():
        (foot,) = record.contacts_at(i).names
        assert np.allclose(corners.mean(axis=0), record.state(i).point(foot)[:2], atol=1e-6)
    axis = plot_walk(record, walk.history)
    colours = {to_hex(line.get_color()).upper() for line in axis.get_lines()}
    assert colours == {hex_code(GREYS[0]), hex_code(GREYS[1])}
    assert any(isinstance(patch, Polygon) for patch in axis.patches)
