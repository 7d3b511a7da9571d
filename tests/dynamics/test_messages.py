"""Errors of contacts and equations of motion: their types, and the names and numbers in them."""

import judges
import numpy as np
import pytest
from messages import refused

import floatbase as fb
from floatbase.dynamics import (
    EquationsOfMotion,
    FlatFootContact,
    LinearConstraint,
    PointContact,
    RollingWheel,
    bias_forces,
    fixed_frame,
    moving_frame,
    rigid_between,
    view_from_rotating_frame,
)
from floatbase.errors import InputError, UnknownNameError

GO2, UR5, SOLO = judges.load("go2"), judges.load("ur5"), judges.load("solo12")
ALL = fb.Contacts.points(GO2)
STATE = GO2.standing()
X, UP = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def eom(contacts: object = ALL, state: object = STATE) -> EquationsOfMotion:
    return fb.equations_of_motion(state, contacts)


def constrained(A: np.ndarray, b: np.ndarray) -> EquationsOfMotion:
    return eom(fb.Contacts([LinearConstraint("bad", 2, lambda state, t: (A, b))]))


@pytest.mark.parametrize(
    "case",
    [
        (lambda: fb.Contacts.points(UR5), "ur5", "frames"),
        (lambda: fb.Contacts.points(GO2, mu=0.0), "mu", "FL_foot", 0),
        (lambda: fb.Contacts.points(GO2, mu=[0.7, 0.0, 0.7, 0.7]), "mu", "FR_foot", 0),
        (lambda: fb.Contacts.points(GO2, frames="FL_foot"), "frames", "FL_foot"),
        (lambda: fb.Contacts.points(GO2, normals=[0, 0, 0]), "FL_foot"),
        (lambda: fb.Contacts.points(GO2, normals={"FL_foot": "up"}), "FL_foot", "up"),
        (lambda: fb.Contacts.points(GO2, normals=[0, 0, np.nan]), "FL_foot", np.nan),
        (lambda: fb.Contacts.flat_feet(GO2), "FL_foot", "go2", "Contacts.points"),
        (lambda: fb.Contacts(["FL_foot"]), "FL_foot"),
        (lambda: ALL + [3], "Contacts"),
        (lambda: ALL + ALL, "FL_foot"),
        (lambda: ALL + fixed_frame("base"), "Contacts", "LinearConstraint"),
        (lambda: fb.Contacts([fixed_frame("base")]).force_of(np.zeros(6), "bolts of base"),
            "bolts of base"),
        (lambda: FlatFootContact("toe", [[1, 0, 0], [0, 0, 0], [2, 0, 0]]), "corners", "toe"),
        (lambda: LinearConstraint("rail", 1, lambda state: 0), "state", "t"),
        (lambda: LinearConstraint("none", 0, lambda s, t: (np.zeros((0, 18)), np.zeros(0))), "m",
            "none", 0),
        (lambda: constrained(np.eye(17)[:2], np.zeros(2)), "A", "bad", 2, 17, 18),
        (lambda: constrained(np.eye(18)[:2], np.zeros(3)), "b", "bad", 3, 2),
        (lambda: constrained(np.eye(18)[:2], np.full(2, np.nan)), "b", "bad", np.nan),
        (lambda: eom(fb.Contacts([moving_frame("base", lambda t: np.zeros(2))])), 2, 3),
        (lambda: moving_frame("base", None), "acceleration", "fixed_frame"),
        (lambda: PointContact("toe", acceleration=lambda: 0), "acceleration", "toe", "t"),
        (lambda: eom(fb.Contacts.points(GO2, acceleration=lambda t: np.zeros(2))), 2, 3),
        (lambda: rigid_between("base", "base"), "base"),
        (lambda: eom(fb.Contacts([rigid_between("FL_calf", "FL_foot")])), "FL_calf", "FL_foot"),
        (lambda: RollingWheel("disc", [0.0, 0.0, 0.0], 0.2), "axis", "disc"),
        (lambda: fb.feasible_space(eom())(np.zeros(11)), "beta", 11, 12),
        (lambda: fb.feasible_space(eom())(np.full(12, np.nan)), "beta", np.nan),
        (lambda: view_from_rotating_frame([0.0, 1.0], lambda t: (t, t, t), X), "omega",
            "omega_rate"),
        (lambda: view_from_rotating_frame([0.0, 0.0], UP, X), "time"),
        (lambda: view_from_rotating_frame([], UP, X), "time"),
        (lambda: view_from_rotating_frame([0.0, 1.0], lambda t: (1.0, t), X, omega_rate=UP),
            "omega", 2, 3),
    ],
)  # fmt: skip
def test_bad_input_is_refused_by_name(case):
    call, *wanted = case
    refused(call, InputError, *wanted)


@pytest.mark.parametrize(
    "case",
    [
        (lambda: fb.Contacts.points(GO2, mu={"FL": 0.5}), "mu", "FL", "FL_foot"),
        (lambda: fb.Contacts.points(GO2, frames=["FL_fot"]), "FL_fot", "FL_foot"),
        (lambda: fb.Contacts.points(GO2, normals={"FL": [0, 0, 1]}), "normals", "FL", "FL_foot"),
        (lambda: ALL.only("FL"), "FL", "FL_foot"),
        (lambda: ALL.without("left"), "left", "FL_foot", "FR_foot", "RL_foot", "RR_foot"),
        (lambda: ALL["FL"], "FL"),
        (lambda: ALL.force_slice("FL"), "FL"),
        (lambda: ALL.force_of(np.zeros(12), "FL_fot"), "FL_fot", "FL_foot"),
        (lambda: eom(state=SOLO.standing()), "solo12", "FL_foot"),
        (lambda: bias_forces(STATE, axes="body"), "axes", "body", "base", "world"),
    ],
)  # fmt: skip
def test_an_unknown_name_is_refused_with_similar_names(case):
    call, *wanted = case
    refused(call, UnknownNameError, *wanted)
