"""Lesson 03: its helpers do what they say."""

import numpy as np
import pytest

import floatbase as fb
from floatbase.lessons.lesson03 import beta_direction, rising_solo8_eom

GO2 = fb.load("go2")
# of the largest singular value: solo8 has 1e-2 above it, and rounding of 1e-16 below
RANK_TOLERANCE = 1e-9


def test_the_rising_solo8_has_a_drift_that_its_joints_can_produce():
    eom = rising_solo8_eom()
    assert np.linalg.matrix_rank(eom.J, tol=RANK_TOLERANCE) == 10
    np.testing.assert_allclose(eom.J @ eom.state.v, 0.0, atol=1e-12)
    assert abs(eom.b).max() > 0.1
    reached = eom.J @ np.linalg.pinv(eom.J, rcond=RANK_TOLERANCE) @ eom.b
    np.testing.assert_allclose(reached, eom.b, atol=1e-12)


@pytest.mark.parametrize(
    "frames",
    [tuple(f.frame for f in GO2.feet), ("FL_foot", "FR_foot", "RL_foot"), ("FL_foot",)],
    ids=len,
)
def test_a_direction_moves_the_base_as_requested_with_the_least_change_of_forces(frames):
    contacts = fb.Contacts.points(GO2, mu=0.7).only(*frames)
    space = fb.feasible_space(fb.equations_of_motion(GO2.standing(), contacts))
    desired = [0.3, -0.2, 1.0, 0.1, 0.5, -0.4] if len(frames) != 1 else [0, 0, 1.0, 0, 0, 0]
    step = beta_direction(space, base=desired)
    np.testing.assert_allclose((space.qdd.A @ step)[:6], desired, atol=1e-9)
    free = np.linalg.svd(space.qdd.A[:6])[2][6:].T
    np.testing.assert_allclose((space.forces.A @ free).T @ (space.forces.A @ step), 0.0, atol=1e-7)
