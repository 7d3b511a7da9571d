"""What contacts and equations of motion answer to what they cannot use."""

from __future__ import annotations

from collections.abc import Callable

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.dynamics import FlatFootContact, LinearConstraint, PointContact, fixed_frame
from floatbase.errors import FloatbaseError, InputError, UnknownNameError

GO2, UR5, SOLO = judges.load("go2"), judges.load("ur5"), judges.load("solo12")
ALL = fb.Contacts.points(GO2)


@pytest.mark.parametrize(
    ("make", "kind", "text"),
    [
        (lambda: fb.Contacts.points(UR5), InputError, r'ur5 has no feet; name the frames that touch: frames=\["…"\]'),
        (lambda: fb.Contacts.points(GO2, mu=0.0), InputError, "coefficient mu of FL_foot is 0; it must be > 0"),
        (lambda: fb.Contacts.points(GO2, mu=-0.5), InputError, "coefficient mu of FL_foot is -0.5; it must be > 0"),
        (lambda: fb.Contacts.points(GO2, mu=np.nan), InputError, "coefficient mu of FL_foot is nan; it must be > 0"),
        (lambda: fb.Contacts.points(GO2, mu=None), InputError, "mu of FL_foot must be a number, not None"),
        (lambda: fb.Contacts.points(GO2, mu=[0.7, 0.7]), InputError, r"mu has shape \(2,\); it must have shape \(4,\)"),
        (
            lambda: fb.Contacts.points(GO2, mu=[0.7, 0.0, 0.7, 0.7]),
            InputError,
            "coefficient mu of FR_foot is 0; it must be > 0",
        ),
        (lambda: fb.Contacts.points(GO2, mu={"FL": 0.5}), UnknownNameError, "frame in mu 'FL'; near names: FL_foot"),
        (lambda: ALL.force_of(np.zeros(9), "FL_foot"), InputError, r"forces has shape \(9,\); Contacts.* takes \(12,\) or"),
        (lambda: ALL.force_of(np.zeros(12), "FL_fot"), UnknownNameError, "unknown contact 'FL_fot'; near names: FL_foot"),
        (
            lambda: fb.Contacts([fixed_frame("base")]).force_of(np.zeros(6), "bolts of base"),
            InputError,
            "the forces of bolts of base do not act at points",
        ),
        (lambda: fb.Contacts.points(GO2, frames="FL_foot"), InputError, r'list of names, as in frames=\["FL_foot"\]'),
        (lambda: fb.Contacts.points(GO2, frames=["FL_fot"]), UnknownNameError, "'FL_fot'; near names: FL_foot"),
        (lambda: fb.Contacts.points(GO2, normals=[0, 0, 0]), InputError, "normal of FL_foot is the zero vector"),
        (lambda: fb.Contacts.points(GO2, normals=np.ones((3, 3))), InputError, r"normals has shape \(3, 3\); .*\(4, 3\)"),
        (lambda: fb.Contacts.points(GO2, normals={"FL": [0, 0, 1]}), UnknownNameError, "'FL'; near names: FL_foot"),
        (lambda: fb.Contacts.points(GO2, normals=[0, 0, np.nan]), InputError, r"normal of FL_foot holds nan at index \[2\]"),
        (lambda: fb.Contacts.flat_feet(GO2), InputError, r"FL_foot of go2 is not a flat foot; use fb\.Contacts\.points"),
        (lambda: ALL + ALL, InputError, "contact 'FL_foot' stands twice in the list; each name may stand once"),
        (
            lambda: ALL + LinearConstraint("rail", 1, lambda state, t: (np.ones((1, 18)), [0.0])),
            InputError,
            r"added to Contacts must be Contacts, as fb\.Contacts\(\[contact\]\), not a LinearConstraint",
        ),
        (
            lambda: LinearConstraint("rail", 1, lambda state: 0),
            InputError,
            r"rows\(state, t\); <lambda> takes \(state\): too many",
        ),
        (lambda: ALL.only("FL"), UnknownNameError, "unknown contact 'FL'; near names: FL_foot"),
        (lambda: ALL.without("left"), UnknownNameError, "unknown contact 'left'; known: FL_foot, FR_foot, RL_foot, RR_foot"),
        (lambda: ALL["FL"], UnknownNameError, "unknown contact 'FL'"),
        (lambda: ALL.force_slice("FL"), UnknownNameError, "unknown contact 'FL'"),
        (lambda: PointContact("toe", radius=-1.0), InputError, "radius of toe is -1; it must be ≥ 0 m"),
        (lambda: FlatFootContact("toe", np.zeros(3)), InputError, r"corners of toe has shape \(3,\); .*\(any, 3\) \(m\)"),
        (lambda: FlatFootContact("toe", [[1, 0, 0], [0, 0, 0], [2, 0, 0]]), InputError, "corners of toe span no area"),
        (lambda: fb.equations_of_motion(GO2, ALL), InputError, r"state must be a State, as robot\.standing\(\), not a Robot"),
        (lambda: fb.equations_of_motion(GO2.standing(), [1]), InputError, r"must be Contacts, as fb\.Contacts\.points"),
        (lambda: fb.equations_of_motion(SOLO.standing(), ALL), UnknownNameError, "unknown frame of solo12 'FL_foot'"),
        (
            lambda: fb.equations_of_motion(GO2.standing(), ALL).acceleration(np.zeros(3), np.zeros(12)),
            InputError,
            r"tau has shape \(3,\); it must have shape \(12,\) \(N·m\)",
        ),
        (
            lambda: fb.equations_of_motion(GO2.standing(), ALL).acceleration(np.zeros(12), np.zeros(3)),
            InputError,
            r"forces has shape \(3,\); it must have shape \(12,\) \(N\)",
        ),
        (
            lambda: fb.equations_of_motion(GO2.standing(), ALL).acceleration(np.zeros(12), np.zeros((3, 4))),
            InputError,
            r"forces has shape \(3, 4\); it must have shape \(12,\) \(N\)",
        ),
        (lambda: fb.ForceTask(np.zeros((3, 4))), InputError, r"target of force regularisation has shape \(3, 4\)"),
        (
            lambda: fb.equations_of_motion(GO2.standing(), ALL).residual(np.zeros(3), np.zeros(12), np.zeros(12)),
            InputError,
            r"qdd has shape \(3,\); it must have shape \(18,\)",
        ),
    ],
)
def test_bad_input_is_told_what_would_be_right(make: Callable[[], object], kind: type[FloatbaseError], text: str) -> None:
    with pytest.raises(kind, match=text):
        make()


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: fb.Contacts.points("go2"), "Robot"),
        (lambda: fb.Contacts.flat_feet("talos"), "Robot"),
        (lambda: fb.Contacts(["FL_foot"]), "contact"),
        (lambda: ALL + [3], "ontacts"),
        (lambda: fb.Contacts.points(GO2, normals="up"), "normal"),
        (lambda: fb.Contacts.points(GO2, normals={"FL_foot": "up"}), "normal"),
    ],
)
def test_values_of_another_kind_are_refused_by_an_error_of_the_package(make: Callable[[], object], text: str) -> None:
    with pytest.raises(InputError, match=text):
        make()
