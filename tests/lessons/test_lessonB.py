"""Lesson B: the bench is the package's cylinder, and pictures show it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.actuators import VACUUM, Cylinders, HydraulicActuators, Hydraulics
from floatbase.lessons.lessonB import (
    Bench,
    draw_cylinder,
    hold_then_turn,
    plot_com_sway,
    plot_power,
    plot_torques,
    push_response,
    run_force_loop,
    show_crank,
    show_torque_step,
)
from floatbase.viewer.scene.colours import GREYS, hex_code

ROBOT = judges.load("go2")
KNEE = ROBOT.joint_names.index("FL_calf_joint")
ROUNDING = 1e-9  # N·m and Pa per Pa: the same formulas in another order


@pytest.fixture(scope="module")
def view() -> Iterator[fb.Viewer]:
    made = fb.Viewer(ROBOT)
    yield made
    made.close()


# the bench


def knee(hydraulics: Hydraulics) -> HydraulicActuators:
    """The package's actuators with another supply, the cylinders' size that of the first."""
    actuators = HydraulicActuators(ROBOT, hydraulics)
    size = ROBOT.torque_limits / Hydraulics().weakest_torque
    actuators.cylinders = Cylinders(hydraulics, size, actuators.cylinders.max_lever_angle)
    actuators.reset()
    return actuators


def test_the_bench_is_the_knee_of_go2() -> None:
    """Turned fast, out of reach, boiling: 0.4 s."""
    bandwidth, speed, wanted, supply = 1.0, 15.0, 12.0, 60e5
    hydraulics = Hydraulics(loop_bandwidth=bandwidth, supply_pressure=supply)
    actuators, motion = knee(hydraulics), hold_then_turn(speed)
    rows = run_force_loop(Bench(motion, wanted, hydraulics), bandwidth, 0.4)
    centre = actuators.cylinders.max_lever_angle
    for row, after in pairwise(rows):
        angle, velocity = motion(row.time)
        actuators.step(np.full(12, wanted), centre + angle, np.full(12, velocity), 1e-3)
        got = actuators.torques(centre + after.angle)[KNEE]
        assert after.torque == pytest.approx(got, abs=ROUNDING * 1e2)
        assert np.allclose(
            actuators.state.pressures[:, KNEE], [after.pressure_a, after.pressure_b], rtol=ROUNDING
        )


def test_the_benchs_rate_is_the_cylinders() -> None:
    cylinders, angle = HydraulicActuators(ROBOT).cylinders, 0.4
    bench = Bench(lambda t: (angle, 0.0))
    geometry = cylinders.geometry(cylinders.max_lever_angle + angle)
    _, _, _, pressure_a, pressure_b, _ = bench.samples[0]
    pressures = np.array([[pressure_a], [pressure_b]]) * np.ones(12)
    for side in (1.0, -1.0):
        rates = cylinders.pressure_rates(np.full(12, side), pressures, geometry, np.zeros(12))
        leaking = cylinders.pressure_rates(np.zeros(12), pressures, geometry, np.zeros(12))
        change = geometry.lever * cylinders.force(rates - leaking)
        assert bench.torque_rate(side) == pytest.approx(side * change[KNEE], rel=1e-9)


def test_the_joint_is_held_then_turned_then_held() -> None:
    motion = hold_then_turn(2.0, start=0.1, end=0.6)
    assert (
        motion(0.05) == (0.0, 0.0)
        and motion(0.3) == pytest.approx((0.4, 2.0))
        and motion(0.9) == (0.6, 0.0)
    )


def test_a_valve_told_to_open_more_than_it_can_is_all_open() -> None:
    wide, full = Bench(), Bench()
    wide.step(7.0)
    full.step(1.0)
    assert (
        wide.samples == full.samples
        and wide.samples[-1].u == 1.0
        and wide.samples[-1].time == pytest.approx(1e-3)
    )


# pictures


def test_the_crank_is_drawn_with_its_lever_and_what_is_out_of_reach_is_said(
    view: fb.Viewer,
) -> None:
    best = show_crank(view, 0.0, 12.0)
    picture = view.renderer.picture
    rod, crank = picture["cylinder/rod"].matrix, picture["crank"].matrix
    assert np.allclose(
        rod[:3, 2] / np.linalg.norm(rod[:3, 2]) @ crank[:3, 2], 0.0, atol=1e-6
    )  # square
    assert np.allclose(rod[:3, 3] + rod[:3, 2], crank[:3, 3] + crank[:3, 2])
    for name, chamber in (
        ("A", "base chamber"),
        ("B", "rod chamber"),
    ):  # each label beside the middle of its chamber
        filled = picture[f"cylinder/{chamber}"].matrix
        off = picture[f"chamber {name}"].matrix[:3, 3] - filled[:3, 3] - 0.5 * filled[:3, 2]
        assert (
            off @ filled[:3, 2] == pytest.approx(0.0, abs=1e-9) and 0.03 < np.linalg.norm(off) < 0.1
        )
    assert "lever <b>36 mm</b>" in best and "possible: -45 to 76 N·m" in best
    assert (
        "more than the supply allows" not in best
        and "more than the supply allows" in show_crank(view, -80.0, 12.0)
    )
    a, b = (int(bar) for bar in re.findall(r"(\d+) bar", best))
    bench = Bench()
    assert bench.lever * 1e5 * (a * bench.piston_area - b * bench.ring_area) == pytest.approx(
        12.0, abs=0.4
    )  # N·m: bars are rounded


def test_the_valve_joins_each_chamber_to_supply_or_tank_or_to_neither() -> None:
    out, back, shut = (draw_cylinder(u) for u in (0.4, -1.0, 0.0))
    assert "into A" in out and "<b>out</b>" in out
    assert "into B" in back and "<b>in</b>" in back and "trapped" in shut
    widths = [set(re.findall(r'stroke-width="([\d.]+)"', text)) for text in (out, back, shut)]
    assert "3.8" in widths[0] and "8.0" in widths[1] and not {"3.8", "8.0"} & widths[2]


def test_the_step_response_tells_when_the_torque_comes_and_when_oil_boils() -> None:
    quick, slow, torn = (
        show_torque_step(50.0, 160.0, 0.0),
        show_torque_step(5.0, 160.0, 0.0),
        show_torque_step(50.0, 60.0, 20.0),
    )
    comes = [int(re.findall(r"after <b>(\d+) ms", text)[0]) for text in (quick, slow)]
    assert comes[0] < 15 < comes[1] < 120
    assert "does not boil" in quick and "does not boil" in slow and "the oil boils for" in torn
    bench = Bench(hold_then_turn(20.0), hydraulics=replace(Hydraulics(), supply_pressure=60e5))
    boiled = sum(
        min(row.pressure_a, row.pressure_b) <= VACUUM for row in run_force_loop(bench, 50.0, 0.4)
    )
    assert f"boils for {boiled} ms" in torn
    assert set(re.findall(r"#[0-9A-F]{6}", torn)) <= {hex_code(grey) for grey in GREYS}
    assert re.findall(r"<text[^>]*\sfill=", torn) == []


def test_plots_show_what_they_are_given() -> None:
    bench = Bench()
    bench.step(0.1)
    runs = {"one": bench.samples, "two": bench.samples}
    record = fb.rollout(fb.Simulation(ROBOT), judges.controller_of("go2"), 0.02)
    gone = 1000 * (record.com - record.com[0])[:, 1]
    torques, sways = plot_torques(runs), plot_com_sway({"perfect": record}, side=-1)
    watts = plot_power(np.arange(6.0).reshape(3, 2), ("pump", "joint"))
    assert np.allclose(torques.lines[1].get_ydata(), [row.torque for row in bench.samples])
    assert np.allclose(sways.lines[0].get_ydata(), -gone) and "right" in sways.get_ylabel()
    assert np.allclose(watts.lines[1].get_ydata(), [1, 3, 5])
    for axis, names in ((torques, ["one", "two"]), (watts, ["pump", "joint"])):
        legend = axis.get_legend()
        assert legend is not None and [text.get_text() for text in legend.get_texts()] == names


# exercises


def test_go2_stays_aside_by_what_leaks_and_less_on_a_stiffer_spring() -> None:
    soft, stiff = push_response(100.0, 20.0), push_response(250.0, 20.0)
    assert soft.outcome == stiff.outcome == "completed"
    assert 2.0 < soft.offset / stiff.offset < 4.0
    assert soft.offset > 3.0 and max(soft.oscillation, stiff.oscillation) < 1.0
