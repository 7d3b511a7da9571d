"""Errors of contacts and equations of motion: their types, and the names and numbers in them."""

from __future__ import annotations

from typing import Any

import judges
import numpy as np
import pytest
from messages import refused

import floatbase as fb
from floatbase.dynamics import (
    FlatFootContact,
    LinearConstraint,
    PointContact,
    RollingWheel,
    bias_forces,
    fixed_frame,
    moving_frame,
    view_from_rotating_frame,
)
from floatbase.errors import InputError, UnknownNameError

GO2, UR5, SOLO = judges.load("go2"), judges.load("ur5"), judges.load("solo12")
ALL = fb.Contacts.points(GO2)
STATE = GO2.standing()
X, UP = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def eom(contacts: object = ALL, state: object = STATE) -> fb.EquationsOfMotion:
    return fb.equations_of_motion(state, contacts)


def constrained(A: np.ndarray, b: np.ndarray) -> fb.EquationsOfMotion:
    return eom(fb.Contacts([LinearConstraint("bad", 2, lambda state, t: (A, b))]))


def wheel(**wrong: object) -> RollingWheel:
    return RollingWheel(**{"frame": "disc", "axis": [0.0, 1.0, 0.0], "radius": 0.2, **wrong})


@pytest.mark.parametrize(
    "case",
    [
        (lambda: fb.Contacts.points("go2"), InputError, "robot", "Robot"),
        (lambda: fb.Contacts.points(UR5), InputError, "ur5", "frames"),
        (lambda: fb.Contacts.points(GO2, mu=0.0), InputError, "mu", "FL_foot", 0),
        (lambda: fb.Contacts.points(GO2, mu=-0.5), InputError, "mu", "FL_foot", -0.5),
        (lambda: fb.Contacts.points(GO2, mu=np.nan), InputError, "mu", "FL_foot", np.nan),
        (lambda: fb.Contacts.points(GO2, mu=None), InputError, "mu", "FL_foot", "None"),
        (lambda: fb.Contacts.points(GO2, mu=[0.7, 0.7]), InputError, "mu", 2, 4),
        (lambda: fb.Contacts.points(GO2, mu=[0.7, 0.0, 0.7, 0.7]), InputError, "mu", "FR_foot", 0),
        (lambda: fb.Contacts.points(GO2, mu={"FL": 0.5}), UnknownNameError, "mu", "FL", "FL_foot"),
        (lambda: fb.Contacts.points(GO2, frames="FL_foot"), InputError, "frames", "FL_foot"),
        (lambda: fb.Contacts.points(GO2, frames=["FL_fot"]), UnknownNameError, "FL_fot", "FL_foot"),
        (lambda: fb.Contacts.points(GO2, normals=[0, 0, 0]), InputError, "FL_foot"),
        (lambda: fb.Contacts.points(GO2, normals="up"), InputError, "normals", "up"),
        (lambda: fb.Contacts.points(GO2, normals={"FL_foot": "up"}), InputError, "FL_foot", "up"),
        (lambda: fb.Contacts.points(GO2, normals=np.ones((3, 3))), InputError, "normals", 3, 4),
        (
            lambda: fb.Contacts.points(GO2, normals={"FL": [0, 0, 1]}),
            UnknownNameError,
            "normals",
            "FL",
            "FL_foot",
        ),
        (lambda: fb.Contacts.points(GO2, normals=[0, 0, np.nan]), InputError, "FL_foot", np.nan),
        (lambda: fb.Contacts.flat_feet("talos"), InputError, "robot", "Robot"),
        (lambda: fb.Contacts.flat_feet(GO2), InputError, "FL_foot", "go2", "Contacts.points"),
        (lambda: fb.Contacts(["FL_foot"]), InputError, "FL_foot"),
        (lambda: ALL + [3], InputError, "Contacts"),
        (lambda: ALL + ALL, InputError, "FL_foot"),
        (lambda: ALL + fixed_frame("base"), InputError, "Contacts", "LinearConstraint"),
        (lambda: ALL.only("FL"), UnknownNameError, "FL", "FL_foot"),
        (
            lambda: ALL.without("left"),
            UnknownNameError,
            "left",
            "FL_foot",
            "FR_foot",
            "RL_foot",
            "RR_foot",
        ),
        (lambda: ALL["FL"], UnknownNameError, "FL"),
        (lambda: ALL.force_slice("FL"), UnknownNameError, "FL"),
        (lambda: ALL.force_of(np.zeros(9), "FL_foot"), InputError, "forces", 9, 12),
        (lambda: ALL.force_of(np.zeros(12), "FL_fot"), UnknownNameError, "FL_fot", "FL_foot"),
        (
            lambda: fb.Contacts([fixed_frame("base")]).force_of(np.zeros(6), "bolts of base"),
            InputError,
            "bolts of base",
        ),
        (lambda: PointContact("toe", radius=-1.0), InputError, "radius", "toe", -1),
        (lambda: FlatFootContact("toe", np.zeros(3)), InputError, "corners", "toe", 3),
        (
            lambda: FlatFootContact("toe", [[1, 0, 0], [0, 0, 0], [2, 0, 0]]),
            InputError,
            "corners",
            "toe",
        ),
        (lambda: LinearConstraint("rail", 1, lambda state: 0), InputError, "state", "t"),
        (
            lambda: LinearConstraint("none", 0, lambda s, t: (np.zeros((0, 18)), np.zeros(0))),
            InputError,
            "m",
            "none",
            0,
        ),
        (lambda: constrained(np.eye(17)[:2], np.zeros(2)), InputError, "A", "bad", 2, 17, 18),
        (lambda: constrained(np.eye(18)[:2], np.zeros(3)), InputError, "b", "bad", 3, 2),
        (lambda: constrained(np.eye(18)[:2], np.full(2, np.nan)), InputError, "b", "bad", np.nan),
        (lambda: eom(fb.Contacts([moving_frame("base", lambda t: np.zeros(2))])), InputError, 2, 3),
        (lambda: wheel(axis=[0, 0, 0]), InputError, "axis", "disc"),
        (lambda: wheel(radius=0.0), InputError, "radius", "disc", 0),
        (lambda: wheel(radius=-1.0), InputError, "radius", "disc", -1),
        (lambda: wheel(mu=0.0), InputError, "mu", "disc", 0),
        (lambda: wheel(normal=[0, np.nan, 0]), InputError, "normal", "disc", np.nan),
        (lambda: eom(state=GO2), InputError, "state", "State"),
        (lambda: eom([1]), InputError, "contacts", "Contacts"),
        (lambda: eom(state=SOLO.standing()), UnknownNameError, "solo12", "FL_foot"),
        (lambda: eom().acceleration(np.zeros(3), np.zeros(12)), InputError, "tau", 3, 12),
        (lambda: eom().acceleration(np.zeros(12), np.zeros(3)), InputError, "forces", 3, 12),
        (
            lambda: eom().acceleration(np.zeros(12), np.zeros((3, 4))),
            InputError,
            "forces",
            3,
            4,
            12,
        ),
        (lambda: eom().residual(np.zeros(3), np.zeros(12), np.zeros(12)), InputError, "qdd", 3, 18),
        (lambda: fb.feasible_space(eom())(np.zeros(11)), InputError, "beta", 11, 12),
        (lambda: fb.feasible_space(eom())(np.full(12, np.nan)), InputError, "beta", np.nan),
        (
            lambda: fb.feasible_space(eom()).coordinates(np.zeros(17), *np.zeros((2, 12))),
            InputError,
            "qdd",
            17,
            18,
        ),
        (
            lambda: view_from_rotating_frame([0.0, 1.0], lambda t: (t, t, t), X),
            InputError,
            "omega",
            "omega_rate",
        ),
        (lambda: view_from_rotating_frame([0.0, 0.0], UP, X), InputError, "time"),
        (lambda: view_from_rotating_frame([], UP, X), InputError, "time"),
        (lambda: view_from_rotating_frame([0.0], UP, (1.0, 0.0)), InputError, "position", 2, 3),
        (
            lambda: view_from_rotating_frame([0.0, 1.0], lambda t: (1.0, t), X, omega_rate=UP),
            InputError,
            "omega",
            2,
            3,
        ),
        (
            lambda: bias_forces(STATE, axes="body"),
            UnknownNameError,
            "axes",
            "body",
            "base",
            "world",
        ),
    ],
)
def test_bad_input_is_refused_by_name(case: tuple[Any, ...]) -> None:
    refused(*case)
