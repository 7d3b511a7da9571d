"""Judges of lesson X for a diagnosis and its evidence."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from floatbase.lessons.judges import Mistake, Verdict, first_fault
from floatbase.lessons.lessonX.black_box import BlackBox
from floatbase.lessons.lessonX.cases import DRIFT_TIME, FAULTS, MU, Case
from floatbase.lessons.lessonX.diagnostics import ground_normal

NOTHING = "nothing"
EVIDENCE = {
    "friction": "the friction coefficient of the ground",
    "normal": "the angle between the ground's normal and the assumed one, in degrees",
    "mass": "the assumed mass over the actual one",
    "drift": "the largest entry of b in the first half second, m/s²",
    "slow motors": "the time constant, ms",
    "swapped motors": "the names of two joints",
}
# what speaks against a fault in every box that has another
COUNTER_EVIDENCE = {
    "friction": "feet that slide get at least the friction that the controller assumed: |λt| / "
    "λn of the measured forces.",
    "normal": "the feet are in a plane, and its normal is the assumed one.",
    "mass": "with M and h of the data sheet, the plan (q̈, τ, λ) satisfies the first line of (7) "
    "in every row.",
    "drift": "in the plan A q̈ equals b, which is not zero, while no foot slips.",
    "slow motors": "no lag brings the commands much closer to the torques that the motion "
    "required.",
    "swapped motors": "no swap of two commands brings them closer to the torques that the "
    "motion required.",
    NOTHING: "a robot without a fault twists like that to the end, and the first six rows say "
    "that nothing touched this one.",
}
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?")
_JOINT = re.compile(r"\w+_joint")
# absolute tolerances of evidence
_EVIDENCE_TOLERANCES = {"friction": 0.04, "normal": 1.5, "mass": 0.02}
_RELATIVE_TOLERANCE = 0.1  # of the other evidence
_MIN_TOLERANCE = 3.0  # ms: smallest tolerance of a time constant
_RIGHT = Verdict(True, "")


@dataclass(frozen=True)
class _Evidence:
    """Number that serves as evidence."""

    right: float
    off: float
    known: list[Mistake]
    otherwise: str


def named_fault(line: str) -> str:
    """Return the fault that a line names first, or "nothing"; "" if there is none."""
    words = line.casefold()
    found = [(words.find(name), name) for name in (*FAULTS, NOTHING) if name in words]
    return min(found)[1] if found else ""


def judge_line(case: Case, box: BlackBox, line: str) -> Verdict:
    """Judge a line about a case: a fault and its evidence."""
    said, fault = named_fault(line), case.injected_fault.kind or NOTHING
    if not said:
        return Verdict(False, f"name one of {', '.join(FAULTS)}, and its evidence.", "no_fault")
    if said != fault and fault == NOTHING:
        end = "was kicked." if case.falls else "did not even fall."
        return Verdict(False, f"this robot had no fault. It {end}", "innocent")
    if said != fault:
        start = "there is a fault" if said == NOTHING else f"it is not {said}"
        return Verdict(False, f"{start}: {COUNTER_EVIDENCE[said]}", f"not {said}")
    if said == NOTHING:
        return _RIGHT
    if said == "swapped motors":
        return _joints(case, box, line)
    number = _NUMBER.search(line.casefold().split(said, 1)[1])
    if number is None:
        text = f"{said} is right, but the evidence is missing: {EVIDENCE[said]}."
        return Verdict(False, text, "no_evidence")
    return _judge_number(said, float(number[0]), _NUMBERS[said](case, box))


def mistaken(case: Case, box: BlackBox) -> dict[str, str]:
    """Return, for each hint, a line with the right fault and the evidence of this mistake."""
    fault = str(case.injected_fault.kind)
    if fault not in _NUMBERS:
        return {}
    evidence = _NUMBERS[fault](case, box)
    return {
        hint: f"{fault} {number!r}"
        for hint, number, _ in evidence.known
        if abs(number - evidence.right) > evidence.off
    }


def _joints(case: Case, box: BlackBox, line: str) -> Verdict:
    given, right = set(_JOINT.findall(line)), set(case.injected_fault.joints)
    unknown = sorted(given - set(box.robot.joint_names))
    if unknown:
        text = f"there is no {unknown[0]}. box.robot.joint_names lists the joints."
        return Verdict(False, text, "no_such_joint")
    start = "swapped motors is right, but the evidence is not:"
    return first_fault([
        ("not_two_joints", len(given) != 2, "swapped motors is right. The evidence must be "
         f"{EVIDENCE['swapped motors']}, but there are {len(given)}."),
        ("no_joint", not given & right, f"{start} neither of these two joints is right."),
        ("one_joint", given != right, f"{start} one of these two joints is right."),
    ]) or _RIGHT  # fmt: skip


def _friction(case: Case, box: BlackBox) -> _Evidence:
    mu = case.injected_fault.size
    known: list[Mistake] = [
        ("believed", MU, "that is the friction that the controller assumed. Which friction did the "
         "feet get?"),
        ("share", mu / MU, "that is a fraction of the assumed coefficient. Give the coefficient."),
        ("difference", MU - mu, "that is a difference. Give the coefficient."),
        ("angle", float(np.rad2deg(np.arctan(mu))), "that is the angle of the cone. Give its "
         "tangent."),
    ]  # fmt: skip
    otherwise = "use feet that slide under load, and forces along the ground and normal to it."
    return _Evidence(mu, _EVIDENCE_TOLERANCES["friction"], known, otherwise)


def _normal(case: Case, box: BlackBox) -> _Evidence:
    ground, assumed = ground_normal(box), box.contacts.normals[0]
    slope, assumed_slope = (float(np.rad2deg(np.arccos(n[2]))) for n in (ground, assumed))
    known: list[Mistake] = [
        ("radians", float(np.deg2rad(case.injected_fault.size)), "the answer must be in degrees."),
        ("slope", slope, "that is the slope of the ground. The evidence is the angle to the "
         "assumed normal."),
        ("believed", assumed_slope, "that is the assumed slope of the ground. The evidence is the "
         "angle to the actual normal."),
    ]  # fmt: skip
    return _Evidence(
        case.injected_fault.size,
        _EVIDENCE_TOLERANCES["normal"],
        known,
        "four loaded feet define the plane, before they slide.",
    )


def _mass(case: Case, box: BlackBox) -> _Evidence:
    k, m = case.injected_fault.size, box.robot.mass
    known: list[Mistake] = [
        ("inverse", 1.0 / k, "that is the actual mass over the assumed one."),
        ("kilograms", k * m, "that is the assumed mass in kg. Divide it by the mass in the data "
         "sheet."),
        ("difference_kilograms", (k - 1.0) * m, "that is a difference in kg. Give the factor."),
        ("difference", k - 1.0, "that is the relative error. Give the factor, which is near 1."),
        ("difference_percent", 100.0 * (k - 1.0), "that is the relative error in percent. Give the "
         "factor, which is near 1."),
        ("percent", 100.0 * k, "that is in percent. Give the factor, which is near 1."),
    ]  # fmt: skip
    return _Evidence(
        k, _EVIDENCE_TOLERANCES["mass"], known, "compare M q̈ + h with S τ + Jᵀ λ, both of the plan."
    )


@lru_cache(maxsize=8)  # it needs the equations of motion of hundreds of rows
def _drift(case: Case, box: BlackBox) -> _Evidence:
    b = np.array([np.asarray(box.equations(i).b) for i in np.flatnonzero(box.time < DRIFT_TIME)])
    late = max(float(np.abs(box.equations(i).b).max()) for i in range(0, len(box), 5))
    right, of_feet = float(np.abs(b).max()), np.linalg.norm(b.reshape(len(b), -1, 3), axis=2)
    known: list[Mistake] = [
        ("planned", 0.0, "that is what the plan required of the feet. What should it have "
         "required?"),
        ("of_one_foot", float(of_feet.max()), "that is the norm of the three entries of a foot. "
         "Give one entry."),
        ("of_all_feet", float(np.linalg.norm(b, axis=1).max()), "that is the norm of all of b. "
         "Give its largest entry."),
        ("late", late, "that is for the whole record, and during the fall everything is large. Use "
         "the first half second."),
    ]  # fmt: skip
    otherwise = "b of box.equations(i), the largest entry while t < 0.5 s, without sign."
    return _Evidence(right, _RELATIVE_TOLERANCE * right, known, otherwise)


def _slow(case: Case, box: BlackBox) -> _Evidence:
    ms = case.injected_fault.size
    known: list[Mistake] = [
        ("seconds", ms / 1e3, "the answer must be in ms."),
        ("bandwidth", 1e3 / (2.0 * np.pi * ms), "that is the bandwidth in Hz. Give the time "
         "constant in ms."),
        ("inverse", 1e3 / ms, "that is 1/T. Give T in ms."),
        ("rows", ms / (1e3 * float(box.time[1] - box.time[0])), "that is in rows of the record. "
         "Give ms."),
    ]  # fmt: skip
    otherwise = "try time constants, and take the one whose lagged commands fit best."
    return _Evidence(ms, max(_MIN_TOLERANCE, _RELATIVE_TOLERANCE * ms), known, otherwise)


_NUMBERS: dict[str, Callable[[Case, BlackBox], _Evidence]] = {
    "friction": _friction,
    "normal": _normal,
    "mass": _mass,
    "drift": _drift,
    "slow motors": _slow,
}


def _judge_number(fault: str, x: float, evidence: _Evidence) -> Verdict:
    """Judge a number as evidence."""
    if abs(x - evidence.right) <= evidence.off:
        return _RIGHT
    near = [
        (abs(x - wrong), hint, text)
        for hint, wrong, text in evidence.known
        if abs(x - wrong) <= max(0.02 * abs(wrong), 1e-3)
    ]
    if not near:
        return _wrong(fault, "evidence", evidence.otherwise)
    _, hint, text = min(near)
    return _wrong(fault, hint, text)


def _wrong(fault: str, hint: str, text: str) -> Verdict:
    return Verdict(False, f"{fault} is right, but the evidence is not: {text}", hint)
