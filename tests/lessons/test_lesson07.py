"""Lesson 07: how long the last answer of a QP is valid in a trot."""

from types import SimpleNamespace

import judges
import pytest

import floatbase as fb
from floatbase.behaviours import Gait, Walk


class Repeating:
    """A walk that repeats its last torques from a time on, for a while."""

    def __init__(self, walk: Walk, start: float, duration: float) -> None:
        self.walk, self.start, self.end = walk, start, start + duration

    @property
    def contacts(self) -> fb.Contacts:
        return self.walk.contacts

    def __call__(self, q, v, t):
        new = self.walk(q, v, t)
        if not self.start <= t < self.end:
            self.tau = new.tau
        return SimpleNamespace(tau=self.tau, forces=new.forces, contacts=new.contacts)


@pytest.mark.front_end
@pytest.mark.parametrize(("duration", "survivors"), [(0.12, 4), (0.16, 3)])
def test_a_trot_survives_the_repetition_of_its_last_torques_for_a_tenth_of_a_second(
    duration, survivors
):
    go2 = judges.load("go2")
    outcomes = []
    for start in (1.0, 1.1, 1.2, 1.3):
        walk = Walk(go2, fb.Contacts.points(go2), Gait.trot(go2, start=0.3), (0.3, 0.0))
        run = fb.rollout(fb.Simulation(go2), Repeating(walk, start, duration), 2.0)
        outcomes.append(run.outcome)
    assert outcomes.count("completed") == survivors
