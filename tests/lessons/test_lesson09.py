"""Lesson 09: its helpers do what they say."""

from dataclasses import replace
from functools import cache

import numpy as np

import floatbase as fb
from floatbase.behaviours import Gait, Walk
from floatbase.friction import centre_of_pressure, contact_wrench, wrench_set
from floatbase.lessons import all_exercises
from floatbase.lessons.lesson09 import (
    centre_of_pressure_path,
    corner_forces,
    leaning_controller,
    load_talos,
    run_lean,
    run_standing,
    single_support_rows,
)

TALOS = load_talos()
STATE = TALOS.standing()
SOLES = fb.Contacts.flat_feet(TALOS, mu=0.7)
LEFT = SOLES.only("left_sole_link")
MIDDLE = STATE.point("left_sole_link")
SOLVED = 0.05  # N, and N·m: what a least-squares fit with a small cost on forces of 100 N leaves


@cache
def limits():
    return replace(wrench_set(STATE, LEFT), reference_point=MIDDLE)


@cache
def stood():
    return run_standing(SOLES, 0.4)


def test_exercise_09_3_refuses_a_fall_and_a_jump(monkeypatch):
    judge = all_exercises()["09.3"].judge
    assert judge([1.5, 0.0]).hint in ("falls", "in_the_air", "tips")
    record = run_lean(1.5, 0.01)
    jump = replace(record, measured=0.0 * record.measured)
    lean = "floatbase.lessons.lesson09.exercises.run_lean"
    monkeypatch.setattr(lean, lambda seconds, posture: jump)
    assert judge([1.5, 0.01]).hint == "in_the_air"


def test_the_path_of_a_record_ends_at_its_centre_of_pressure():
    record = stood()
    assert record.outcome == "completed"
    expected = centre_of_pressure(record.final, SOLES, record.measured[-1])
    assert np.allclose(centre_of_pressure_path(record)[-1], expected[:2], atol=1e-5)
    assert np.isnan(centre_of_pressure_path(replace(record, measured=0.0 * record.measured))).all()


def test_corner_forces_produce_the_wrench_or_the_closest_feasible_one():
    possible = np.array([20.0, -30.0, 443.0, 5.0, -12.0, 6.0])
    forces = corner_forces(STATE, LEFT, possible)
    assert np.max(limits().face_matrix @ possible) < 0.0
    assert np.allclose(contact_wrench(STATE, LEFT, forces, MIDDLE), possible, atol=SOLVED)
    beyond = np.array([0.0, 0.0, 443.0, 0.0, -60.0, 0.0])  # beyond the toes
    nearest = contact_wrench(STATE, LEFT, corner_forces(STATE, LEFT, beyond), MIDDLE)
    assert np.max(limits().face_matrix @ nearest) < SOLVED
    assert not np.allclose(nearest, beyond, atol=1.0)


def test_a_lean_moves_the_centre_of_mass_as_planned():
    tasks = leaning_controller(6.0, 1.0, 0.01).tasks
    (path,) = (task.position for task in tasks if isinstance(task, fb.CoMTask))
    assert np.allclose(path(0.1)[0], STATE.com)
    assert np.allclose(path(1.3)[0], STATE.com + [0.06, 0.0, 0.0])
    record = run_lean(1.5, 0.01)
    assert np.isclose(record.final.com[0] - STATE.com[0], 0.06, atol=2e-3)


def test_a_walk_has_single_support_on_one_sole_at_a_time():
    walk = Walk(TALOS, SOLES, Gait.walk(TALOS, start=0.2), velocity=(0.2, 0.0))
    record = fb.rollout(fb.Simulation(TALOS), walk, 0.4, control_period=4e-3)
    alone = single_support_rows(record)
    assert alone and single_support_rows(stood()) == {}
    for i, corners in alone.items():
        (foot,) = record.contacts_at(i).names
        assert np.allclose(corners.mean(axis=0), record.state(i).point(foot)[:2], atol=1e-6)
