"""Lesson 09: its helpers do what they say."""

from dataclasses import replace
from functools import cache

import numpy as np

import floatbase as fb
from floatbase.friction import contact_wrench, wrench_set
from floatbase.lessons import all_exercises
from floatbase.lessons.lesson09 import corner_forces, load_talos, run_lean

TALOS = load_talos()
STATE = TALOS.standing()
SOLES = fb.Contacts.flat_feet(TALOS, mu=0.7)
LEFT = SOLES.only("left_sole_link")
MIDDLE = STATE.point("left_sole_link")
SOLVED = 0.05  # N, and N·m: what a least-squares fit with a small cost on forces of 100 N leaves


@cache
def limits():
    return replace(wrench_set(STATE, LEFT), reference_point=MIDDLE)


def test_exercise_09_3_refuses_a_fall_and_a_jump(monkeypatch):
    judge = all_exercises()["09.3"].judge
    assert judge([1.5, 0.0]).hint in ("falls", "in_the_air", "tips")
    record = run_lean(1.5, 0.01)
    jump = replace(record, measured=0.0 * record.measured)
    lean = "floatbase.lessons.lesson09.exercises.run_lean"
    monkeypatch.setattr(lean, lambda seconds, posture: jump)
    assert judge([1.5, 0.01]).hint == "in_the_air"


def test_corner_forces_produce_the_wrench_or_the_closest_feasible_one():
    possible = np.array([20.0, -30.0, 443.0, 5.0, -12.0, 6.0])
    forces = corner_forces(STATE, LEFT, possible)
    assert np.max(limits().face_matrix @ possible) < 0.0
    assert np.allclose(contact_wrench(STATE, LEFT, forces, MIDDLE), possible, atol=SOLVED)
    beyond = np.array([0.0, 0.0, 443.0, 0.0, -60.0, 0.0])  # beyond the toes
    nearest = contact_wrench(STATE, LEFT, corner_forces(STATE, LEFT, beyond), MIDDLE)
    assert np.max(limits().face_matrix @ nearest) < SOLVED
    assert not np.allclose(nearest, beyond, atol=1.0)
