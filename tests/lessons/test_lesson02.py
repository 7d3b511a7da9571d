"""Lesson 02: its experiments are what they say."""

import judges
import numpy as np
import pytest
from hints import right

import floatbase as fb
from floatbase.lessons import lesson02


@pytest.fixture(scope="module")
def go2():
    return fb.load("go2")


def test_a_run_with_constant_torques_records_the_forces_of_the_equations(go2):
    contacts = fb.Contacts.points(go2)
    record = lesson02.run_constant_torques(
        go2, contacts, np.zeros(12), judges.constrained, duration=0.01
    )
    eom = fb.equations_of_motion(record.state(3), contacts)
    assert np.allclose(record.planned[3], judges.constrained(eom, np.zeros(12), eom.b)[1])
    assert not record.tau.any()


def test_the_least_squares_solution_depends_on_the_unit_of_torque(go2):
    """What the explanation of exercise 02.3 says of lstsq; both answers are right."""
    eom = fb.equations_of_motion(go2.standing(), fb.Contacts.points(go2))
    found = []
    for unit in (1.0, 0.001):  # N·m, N·mm
        both = np.linalg.lstsq(np.hstack([unit * eom.S, eom.J.T]), eom.h, rcond=None)[0]
        assert right("02.3", (unit * both[:12], both[12:]))
        found.append(both[12:])
    assert np.abs(found[0] - found[1]).max() > 0.1
