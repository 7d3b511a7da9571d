"""Lesson 09: its helpers do what they say, and wrong answers of each kind get the hint that fits."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hints import missed, right
from matplotlib.colors import to_hex
from matplotlib.patches import Polygon

import floatbase as fb
from floatbase.behaviours import Gait, Swing, Walk
from floatbase.dynamics import LinearConstraint
from floatbase.friction import WrenchSet, centre_of_pressure, contact_wrench, wrench_set
from floatbase.lessons import all_exercises
from floatbase.lessons.lesson09 import (
    ankle_sensor,
    corner_forces,
    held,
    kinds_of,
    leaned,
    leaning,
    play_resultants,
    plot_lean,
    plot_walk,
    pressure,
    rose_controller,
    show_sole,
    show_soles,
    soles_from_above,
    standing_rose_controller,
    talos,
)
from floatbase.simulation import Rollout
from floatbase.viewer import GREYS, MEASURED, PLANNED, hexadecimal

TALOS = talos()
STATE = TALOS.standing()
SOLES = fb.Contacts.flat_feet(TALOS, mu=0.7)
LEFT = SOLES.only("left_sole_link")
MIDDLE = STATE.point("left_sole_link")
SOLVED = 0.05  # N, and N·m: what a least-squares fit with a small cost on forces of 100 N leaves


@cache
def limits() -> WrenchSet:
    return replace(wrench_set(STATE, LEFT), about=MIDDLE)


@cache
def stood() -> Rollout:
    return held(SOLES, 0.4)


@pytest.fixture
def view() -> Iterator[fb.Viewer]:
    made = fb.Viewer(TALOS)
    yield made
    made.close()


# exercises ------------------------------------------------------------------------------------------------------------------


def test_09_1_takes_the_mean_of_the_corners() -> None:
    f, tau = np.split(ankle_sensor(), 2)
    at = np.array([-tau[1] - 0.107 * f[0], tau[0] - 0.107 * f[1]]) / f[2]
    assert right("09.1", at) and right("09.1", np.round(at, 5))
    assert -0.1 < at[0] < 0.1 and -0.06 < at[1] < 0.06


def test_09_1_knows_height_order_sign_unit_and_what_divides() -> None:
    fx, fy, fz, tx, ty, _ = ankle_sensor()
    at = np.array([-ty - 0.107 * fx, tx - 0.107 * fy]) / fz
    flat = np.array([-ty, tx]) / fz
    wrong = {
        "point below the sensor": np.zeros(2),
        "height is missing": flat,
        "wrong sign: the ground": np.array([-ty + 0.107 * fx, tx + 0.107 * fy]) / fz,
        "x and y are swapped: ": at[::-1],
        "Height forgotten": flat[::-1],
        "The sign: (x": -at,
        "in mm": 1000 * at,
        "Divide by": at * fz,
        "f_z alone": at * fz / np.linalg.norm([fx, fy, fz]),
        "shape": np.zeros(3),
        "no answer yet": None,
        "Neither right": np.array([0.3, -0.2]),
    }
    assert missed("09.1", [(answer, hint) for hint, answer in wrong.items()]) == []


def test_09_2_knows_each_wrong_count() -> None:
    assert right("09.2", np.array([24, 30, 56]))
    wrong = [
        ([12, 18, 44], "four corners"), ([12, 12, 50], "one sole"), ([12, 30, 44], "has rank 12"),
        ([0, 30, 32], "no rows of motion"), ([30, 24, 56], "swapped"),
        ([24, 30, 44], "dim β"), ([24, 24, 56], "six dimensions"), ([36, 30, 56], "length of λ"),
        (24, "Three numbers"), ([1, 2, 3], "Neither right"), (None, "no answer yet"),
    ]  # fmt: skip
    assert missed("09.2", [(np.array(answer) if answer is not None else None, hint) for answer, hint in wrong]) == []


def test_09_3_knows_levers_shares_friction_and_pyramids() -> None:
    force = 0.6 * 400
    exact = force * np.hypot(0.12, 0.05)
    assert right("09.3", exact)
    wrong = [
        (0.0, "Nothing there"), (force * np.cos(np.pi / 4) * 0.17, "pyramids"), (force * 0.12, "half the length"),
        (force * 0.05, "half the width"), (2 * exact, "Half the sides"), (exact / 4, "one corner"), (4 * exact, "share"),
        (exact / 0.6, "μ is missing"), (exact * 0.7 / 0.6, "μ of the lesson"), (force * 0.17, "square pyramids"),
        (2 / 3 * force * 0.12, "disc"), (None, "no answer yet"), (-exact, "sign"), (1.0, "Neither right"),
    ]  # fmt: skip
    assert missed("09.3", wrong) == []


def test_09_4_takes_leans_that_arrive_with_room_in_time() -> None:
    for design in ([1.5, 0.01], [1.45, 0.02]):
        assert right("09.4", design), all_exercises()["09.4"].judge(design)


def test_09_4_knows_what_is_wrong() -> None:
    wrong = [
        ([1.0, 0.1], "Too near to the toes, and it does not"),
        ([0.6, 0.01], "It tips"),
        ([1.1, 0.01], "Braking pushes there"),
        ([1.3, 0.1], "Another wish holds it back"),
        ([3.0, 0.01], "room to be quicker"),
        ([-1.0, 0.1], "from 0.05"),
        ([1.0, -0.1], "from 0.05"),
        (1.5, "shape"),
        (None, "no answer yet"),
    ]
    assert missed("09.4", wrong) == []


# helpers --------------------------------------------------------------------------------------------------------------------


def test_talos_stands_and_the_pressure_of_a_record_is_the_centre_of_pressure() -> None:
    record = stood()
    assert record.outcome == "completed"
    expected = centre_of_pressure(record.final, SOLES, record.measured[-1])
    assert np.allclose(pressure(record)[-1], expected[:2], atol=1e-5)
    assert np.isnan(pressure(replace(record, measured=0.0 * record.measured))).all()


def test_a_filed_corner_changes_the_corners_and_not_the_wrench() -> None:
    sim = fb.Simulation(TALOS)
    sim.model.geom("left_sole_link corner 0").pos[2] += 1e-4
    even, filed = stood(), held(SOLES, 0.4, sim=sim)
    assert np.abs(filed.measured[-1] - even.measured[-1]).max() > 50.0
    wrenches = [contact_wrench(run.final, LEFT, run.measured[-1, :12], MIDDLE) for run in (even, filed)]
    assert np.allclose(wrenches[0], wrenches[1], atol=0.1)


def test_corner_forces_make_the_wrench_where_the_rows_allow_it_and_stay_inside_where_they_do_not() -> None:
    possible = np.array([20.0, -30.0, 443.0, 5.0, -12.0, 6.0])
    forces = corner_forces(STATE, LEFT, possible)
    assert np.max(limits().rows @ possible) < 0.0
    assert np.allclose(contact_wrench(STATE, LEFT, forces, MIDDLE), possible, atol=SOLVED)
    beyond = np.array([0.0, 0.0, 443.0, 0.0, -60.0, 0.0])  # beyond the toes
    nearest = contact_wrench(STATE, LEFT, corner_forces(STATE, LEFT, beyond), MIDDLE)
    assert np.max(limits().rows @ nearest) < SOLVED and not np.allclose(nearest, beyond, atol=1.0)


def test_rows_of_a_sole_have_names() -> None:
    kinds = kinds_of(limits().rows)
    assert [kinds.count(kind) for kind in ("sliding", "tipping", "twisting")] == [4, 4, 8]
    rows = [[1, 0, -0.5, 0, 0, 0], [0, 0, -0.1, 0, 1, 0], [0.1, 0, -0.1, 0, 0, -1]]
    assert kinds_of(rows) == ["sliding", "tipping", "twisting"]


def test_a_lean_goes_where_it_should_at_its_time() -> None:
    path = next(task for task in leaning(6.0, 1.0, 0.01).tasks if isinstance(task, fb.CoMTask)).position
    assert isinstance(path, Swing)
    assert np.allclose(path(0.1)[0], STATE.com) and np.allclose(path(1.3)[0], STATE.com + [0.06, 0.0, 0.0])
    record = leaned(1.5, 0.01)
    assert np.isclose(record.final.com[0] - STATE.com[0], 0.06, atol=2e-3)


def test_the_roses_are_of_talos_with_and_without_steps() -> None:
    assert rose_controller().steps is not None and standing_rose_controller().steps is None
    assert rose_controller().robot is standing_rose_controller().robot is TALOS


# pictures -------------------------------------------------------------------------------------------------------------------


def test_soles_are_drawn_with_their_forces_and_crosses(view: fb.Viewer) -> None:
    forces = np.tile([0.0, 0.0, TALOS.weight / 8], 8)
    drawn = show_soles(view, STATE, SOLES, forces)
    assert drawn.count("<polygon") == 2 and drawn.count("<circle") == 8 + 1 and drawn.count("<path") == 3
    assert sum(path.startswith("planned/") for path in view.canvas.picture) == 8
    right_foot_up = np.concatenate([forces[:12], np.zeros(12)])
    assert soles_from_above(STATE, SOLES, right_foot_up).count("<path") == 2
    assert set(re.findall(r"#[0-9A-F]{6}", drawn)) <= {hexadecimal(colour) for colour in (*GREYS, PLANNED)}


def test_one_sole_says_which_rows_are_broken(view: fb.Viewer) -> None:
    weight = np.array([0.0, 0.0, 443.0, 0.0, 0.0, 0.0])
    assert "corner forces exist" in show_sole(view, STATE, LEFT, limits(), weight)
    assert "planned/sum" in view.canvas.picture
    for change, kind in (((0, 300.0), "sliding"), ((4, -60.0), "tipping"), ((5, 40.0), "twisting")):
        wrench = weight.copy()
        wrench[change[0]] = change[1]
        drawn = show_sole(view, STATE, LEFT, limits(), wrench)
        assert kind in drawn and "the nearest miss it" in drawn


def test_the_slice_is_as_wide_as_the_sole_and_as_high_as_the_twist(view: fb.Viewer) -> None:
    weight = np.array([0.0, 0.0, 443.0, 0.0, 0.0, 0.0])
    drawn = show_sole(view, STATE, LEFT, limits(), weight)
    points = re.search(r'<polygon points="([^"]*)"', drawn)
    assert points is not None
    corners = np.array([[float(x) for x in pair.split(",")] for pair in points[1].split()])
    assert np.allclose(np.ptp(corners[:, 0]) * 300 / 300, 200.0, atol=2.0)  # mm
    most = limits().reach([0, 0, 0, 0, 0, 1], weight)
    assert np.allclose(np.ptp(corners[:, 1]) * 120 / 250, 2 * most, atol=1.0)  # N·m


def test_a_plan_without_corners_is_played_with_its_resultants(view: fb.Viewer) -> None:
    bolts = fb.Contacts([LinearConstraint(sole.name, 6, sole.constraint) for sole in SOLES])
    record = held(bolts, 0.1)
    assert play_resultants(view, record, 0.5, "bolted") is view
    assert [path for path in view.canvas.picture if path.startswith("planned/")] == [f"planned/{name}" for name in bolts.names]


def test_a_walk_and_a_lean_are_plotted_in_greys() -> None:
    walk = Walk(TALOS, SOLES, Gait.walk(TALOS, start=0.2), velocity=(0.2, 0.0))
    record = fb.rollout(fb.Simulation(TALOS), walk, 0.4, control_period=4e-3)
    for axis, patches in ((plot_walk(record, walk.history), 1), (plot_lean(leaned(1.5, 0.01)), 0)):
        colours = {to_hex(line.get_color()).upper() for line in axis.get_lines()}
        assert colours == {hexadecimal(GREYS[0]), hexadecimal(GREYS[1])} and hexadecimal(MEASURED) not in colours
        assert sum(isinstance(patch, Polygon) for patch in axis.patches) >= patches
