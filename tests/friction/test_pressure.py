"""Centre of pressure and wrench of a sole: by definition, and against MuJoCo's contact forces."""

import judges
import numpy as np
import pytest
from messages import raises, refused
from scipy.spatial import ConvexHull

import floatbase as fb
from floatbase.dynamics import LinearConstraint
from floatbase.errors import InputError
from floatbase.friction import centre_of_pressure, contact_wrench

TALOS = judges.load("talos")
SOLES = judges.stance(TALOS)


def loads(seed):
    """Return forces at the corners of both soles that push up, shape (8, 3), N."""
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.normal(0.0, 20.0, (8, 2)), rng.uniform(0.0, 200.0, 8)])


@pytest.mark.parametrize("seed", range(5))
def test_about_the_centre_of_pressure_there_is_no_tangential_moment(seed):
    state, forces = TALOS.standing(), loads(seed)
    for contacts, part in ((SOLES, forces), (SOLES.only("left_sole_link"), forces[:4])):
        centre = centre_of_pressure(state, contacts, part)
        tilting = contact_wrench(state, contacts, part, centre)[3:5]
        assert np.allclose(tilting, 0.0, atol=1e-9 * TALOS.weight)
        middle = state.point("left_sole_link")
        f, tau = np.split(contact_wrench(state, contacts, part.ravel(), middle), 2)
        assert np.allclose(middle + [-tau[1] / f[2], tau[0] / f[2], 0.0], centre, atol=1e-9)
        hull = ConvexHull(contacts.positions(state)[:, :2])
        assert (hull.equations[:, :2] @ centre[:2] + hull.equations[:, 2]).max() < 1e-9


def test_the_wrench_of_a_sole_is_the_sum_of_its_corners():
    state, forces = TALOS.random_state(3, 0.1), loads(7)[:4]
    sole, about = SOLES.only("left_sole_link"), np.array([0.1, 0.2, 0.3])
    moment = sum(np.cross(x - about, f) for x, f in zip(sole.positions(state), forces, strict=True))
    assert np.allclose(contact_wrench(state, sole, forces, about), [*forces.sum(axis=0), *moment])


def test_the_ground_pushes_where_the_controller_planned():
    state = TALOS.standing()
    target = state.com + [0.02, 0.01, 0.0]
    tasks = [fb.CoMTask(target), *fb.standing_tasks(state)[1:]]
    controller = fb.WholeBodyController(TALOS, SOLES, tasks)
    run = fb.rollout(fb.Simulation(TALOS), controller, 2.0, control_period=2e-3)
    planned, measured = (
        centre_of_pressure(run.final, SOLES, forces[-1]) for forces in (run.planned, run.measured)
    )
    assert np.allclose(planned, measured, atol=1e-3)
    # at rest it is below the centre of mass
    assert np.allclose(measured[:2], run.final.com[:2], atol=2e-3)


def test_without_pressure_there_is_no_centre():
    state = TALOS.standing()
    refused(lambda: centre_of_pressure(state, SOLES, np.zeros(24)), InputError, 0)
    with raises(InputError, "held"):
        rows = np.eye(1, TALOS.nv), np.zeros(1)
        held = SOLES + fb.Contacts([LinearConstraint("held", 1, lambda state, t: rows)])
        centre_of_pressure(state, held, np.zeros(25))
