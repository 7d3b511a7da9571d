"""Lesson 02: a ground that attracts the feet."""

import pytest

import floatbase as fb
from floatbase.lessons import ConstantTorques
from floatbase.playground import Perturbation, PerturbedSimulation


@pytest.mark.front_end
def test_a_ground_that_can_pull_pulls_as_hard_as_the_equations_say(go2):
    state, contacts = go2.standing(), fb.Contacts.points(go2)
    hold = fb.WholeBodyController(go2, contacts, fb.standing_tasks(state))(state.q, state.v).tau
    by_equation = fb.forces_from_torques(fb.equations_of_motion(state, contacts))(-0.5 * hold)
    sim = PerturbedSimulation(go2, perturbation=Perturbation(adhesion_force=100.0))
    run = fb.rollout(sim, ConstantTorques(-0.5 * hold, contacts), 0.02)
    assert abs(run.measured[19, 2::3].sum() - by_equation[2::3].sum()) < 2.0  # N, of -62
