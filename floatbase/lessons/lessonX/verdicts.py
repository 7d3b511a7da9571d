"""Lesson X, The crash investigation: what is said of a diagnosis and of the evidence for it."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from floatbase.lessons.lessonX.box import BlackBox
from floatbase.lessons.lessonX.cases import EARLY, FAULTS, MU, Case
from floatbase.lessons.lessonX.tools import ground_normal

NOTHING = "nothing"
EVIDENCE = {
    "friction": "the coefficient that the ground has",
    "normal": "the angle between the ground's normal and the one that was told, in degrees",
    "mass": "the mass believed over the true one",
    "drift": "the largest entry of b in the first half second, m/s²",
    "slow motors": "the time constant, ms",
    "swapped motors": "the names of two joints",
}
# what speaks against a fault in every box that has another
AGAINST = {
    "friction": "feet that slide get no less friction than the controller was told: |λt| / λn of the measured forces.",
    "normal": "the feet stand in a plane, and its normal is the one that was told.",
    "mass": "with M and h of the data sheet, the plan (q̈, τ, λ) satisfies the first line of (7) in every row.",
    "drift": "A q̈ of the plan is b, which is not zero, while all feet hold.",
    "slow motors": "no lag brings the orders much nearer to the torques that the motion needed.",
    "swapped motors": "no exchange of two orders brings them nearer to the torques that the motion needed.",
    NOTHING: "a sound robot twists like that to the end, and the first six rows say that nobody touched this one.",
}
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?")
_JOINT = re.compile(r"\w+_joint")
_WORKS = {"friction": 0.04, "normal": 1.5, "mass": 0.02}  # how far evidence may be off
_SHARE = 0.1  # of it, for the others
_LEAST = 3.0  # ms that a time constant may be off


def fault_in(line: str) -> str:
    """The fault that a line names first, or "nothing"; "" where it names none."""
    words = line.casefold()
    found = [(words.find(name), name) for name in (*FAULTS, NOTHING) if name in words]
    return min(found)[1] if found else ""


def judged(case: Case, box: BlackBox, line: str) -> str:
    """What is wrong with a line about a case, a fault and its evidence; "" where both are right."""
    said, fault = fault_in(line), case.mistake.fault or NOTHING
    if not said:
        return f"name one of {', '.join(FAULTS)}, and its evidence."
    if said != fault:
        known = "this robot had no fault: it " + ("was kicked." if case.falls else "did not even fall.")
        return known if fault == NOTHING else f"not {said}: {AGAINST[said]}"
    if said == NOTHING:
        return ""
    if said == "swapped motors":
        return _joints(case, box, line)
    number = _NUMBER.search(line.casefold().split(said, 1)[1])
    if number is None:
        return f"{said} it is. The evidence is missing: {EVIDENCE[said]}."
    wrong = _NUMBERS[said](case, box, float(number[0]))
    return wrong and f"{said} it is. The evidence does not hold: {wrong}"


def _joints(case: Case, box: BlackBox, line: str) -> str:
    given, right = set(_JOINT.findall(line)), set(case.mistake.joints)
    unknown = sorted(given - set(box.robot.joint_names))
    if unknown:
        return f"there is no {unknown[0]}; box.robot.joint_names lists them."
    if len(given) != 2:
        return f"swapped motors it is. The evidence is {EVIDENCE['swapped motors']}; there are {len(given)}."
    common = len(given & right)
    told = ("neither of these two is one of them", "one of these two is right")
    return "" if given == right else f"swapped motors it is. The evidence does not hold: {told[common]}."


def _friction(case: Case, box: BlackBox, x: float) -> str:
    mu = case.mistake.size
    hints = {
        MU: "that is the friction that was told; which did the feet get?",
        mu / MU: "that is a share of what was told; give the coefficient.",
        MU - mu: "that is a difference; give the coefficient.",
        np.rad2deg(np.arctan(mu)): "that is the angle of the cone; give its tangent.",
    }
    return _close(x, mu, _WORKS["friction"], hints, "take feet that slide and bear, and forces along and across the ground.")


def _normal(case: Case, box: BlackBox, x: float) -> str:
    ground, told = ground_normal(box), box.contacts.normals[0]
    slope, believed = (float(np.rad2deg(np.arccos(n[2]))) for n in (ground, told))
    hints = {
        np.deg2rad(case.mistake.size): "in degrees, please.",
        slope: "that is how steep the ground is; what counts is the angle to the normal that was told.",
        believed: "that is how steep the ground was believed to be; what counts is the angle to its normal.",
    }
    return _close(x, case.mistake.size, _WORKS["normal"], hints, "four feet that bear span the plane, before they slide.")


def _mass(case: Case, box: BlackBox, x: float) -> str:
    k, m = case.mistake.size, box.robot.mass
    hints = {
        1.0 / k: "that is the true mass over the believed one.",
        k * m: "that is the believed mass in kg; divide it by the data sheet's.",
        (k - 1.0) * m: "that is a difference in kg; give the factor.",
        k - 1.0: "that is how much it is off; give the factor, near 1.",
        100.0 * (k - 1.0): "that is how much it is off, in percent; give the factor, near 1.",
        100.0 * k: "that is in percent; give the factor, near 1.",
    }
    return _close(x, k, _WORKS["mass"], hints, "compare M q̈ + h with S τ + Jᵀ λ, both of the plan.")


def _drift(case: Case, box: BlackBox, x: float) -> str:
    b = np.array([np.asarray(box.equations(i).b) for i in np.flatnonzero(box.time < EARLY)])
    late = max(float(np.abs(box.equations(i).b).max()) for i in range(0, len(box), 5))
    right = float(np.abs(b).max())
    hints = {
        0.0: "that is what the plan asked of the feet; what should it have asked?",
        float(np.linalg.norm(b.reshape(len(b), -1, 3), axis=2).max()): "that is the length of a foot's three; give one entry.",
        float(np.linalg.norm(b, axis=1).max()): "that is the length of all of b; give its largest entry.",
        late: "that is of the whole record; in the fall everything is large. Take the first half second.",
    }
    return _close(x, right, _SHARE * right, hints, "b of box.equations(i), the largest entry while t < 0.5 s, without sign.")


def _slow(case: Case, box: BlackBox, x: float) -> str:
    ms = case.mistake.size
    hints = {
        ms / 1e3: "in ms, please.",
        1e3 / (2.0 * np.pi * ms): "that is the bandwidth in Hz; give the time constant in ms.",
        1e3 / ms: "that is 1/T; give T in ms.",
        ms / (1e3 * (box.time[1] - box.time[0])): "that is in rows of the record; give ms.",
    }
    return _close(x, ms, max(_LEAST, _SHARE * ms), hints, "try time constants, and take the one whose lagged orders fit best.")


_NUMBERS: dict[str, Callable[[Case, BlackBox, float], str]] = {
    "friction": _friction,
    "normal": _normal,
    "mass": _mass,
    "drift": _drift,
    "slow motors": _slow,
}


def _close(x: float, right: float, off: float, hints: dict[float, str], otherwise: str) -> str:
    """ "" for what is near enough, else the hint for the nearest of the numbers that a known mistake leads to."""
    if abs(x - right) <= off:
        return ""
    near = [(abs(x - wrong), hint) for wrong, hint in hints.items() if abs(x - wrong) <= max(0.02 * abs(wrong), 1e-3)]
    return min(near)[1] if near else otherwise
