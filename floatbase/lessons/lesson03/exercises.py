"""Exercises of lesson 03, The space of possible motions."""

from __future__ import annotations

from typing import Any

import numpy as np

import floatbase as fb
from floatbase._arrays import Array
from floatbase.dynamics import EquationsOfMotion
from floatbase.lessons.exercises import Exercise, Numeric, Shaped, Verdict, numbers
from floatbase.lessons.lesson03.helpers import standing_go2, tilted_squeeze
from floatbase.linear_algebra import rank


def _on_diagonal() -> EquationsOfMotion:
    """(7) of go2 standing on two feet."""
    standing = standing_go2()
    return fb.equations_of_motion(standing.state, standing.contacts.only("FL_foot", "RR_foot"))


def _squeeze_torques() -> Array:
    """By the inverse of ζ, not by the transpose of J."""
    eom, squeeze = tilted_squeeze()
    return np.linalg.solve(fb.forces_from_torques(eom).A, squeeze)


def _turned(forces: Array, R: Array) -> Array:
    return (forces.reshape(-1, 3) @ R.T).ravel()


def _wrong_squeezes() -> dict[str, Any]:
    def torques(change: Any = lambda eom, f: f, after: Any = lambda eom, tau: tau) -> Any:
        def value() -> Array:
            eom, squeeze = tilted_squeeze()
            return after(eom, -eom.J[:, 6:].T @ change(eom, squeeze))

        return value

    return {
        "The sign: these torques squeeze the other way. Torques and forces must cancel in the joint rows of (7).": torques(
            after=lambda eom, tau: -tau
        ),
        "J instead of its transpose: J turns velocities of joints into velocities of feet, Jᵀ forces into torques.": (
            lambda: -tilted_squeeze()[0].J[:, 6:] @ tilted_squeeze()[1]
        ),
        "The frame: J and the forces are both in world axes here; no rotation of the base is needed.": torques(
            lambda eom, f: _turned(f, eom.state.frame_pose("base").rotation.T)
        ),
        "The frame: the forces are given in world axes already; the base's rotation takes them out of it.": torques(
            lambda eom, f: _turned(f, eom.state.frame_pose("base").rotation)
        ),
        "This is the J of the standing robot; `tilted` has another posture, so another J.": (
            lambda: -standing_go2().J[:, 6:].T @ tilted_squeeze()[1]
        ),
        "h is in it: that would hold the robot up as well. The answer is only what the squeeze adds.": torques(
            after=lambda eom, tau: tau + eom.h[6:]
        ),
    }


def _standing_forces() -> Array:
    """The smallest forces, shape (12,), N, world, that carry the standing robot."""
    eom = standing_go2()
    return np.asarray(np.linalg.lstsq(eom.J[:, :6].T, eom.h[:6], rcond=1e-9)[0])


def _judge_unloading(answer: Any) -> Verdict:
    """Any forces will do that balance the standing robot and give FL its 20 N."""
    forces = numbers(answer, (12,))
    if isinstance(forces, Verdict):
        return forces
    eom = standing_go2()
    before = _standing_forces()
    if np.allclose(forces, before, atol=1e-3):
        return Verdict(False, f"Nothing has changed yet: the front left foot still carries {forces[2]:.0f} N.")
    off = eom.h[:6] - eom.J[:, :6].T @ forces
    if abs(off[:3]).max() > 0.05:
        return Verdict(False, "The forces no longer add up to the weight: what one foot loses, the others must take.")
    if abs(off[3:]).max() > 0.01:
        return Verdict(False, "The sum is right, but the moments are not: the body would turn. Add internal forces only.")
    if abs(forces[2] - 20.0) > 0.05:
        more = " That is more than before: mind the sign." if forces[2] > before[2] + 0.05 else ""
        return Verdict(False, f"The robot stays at rest, but the front left foot carries {forces[2]:.1f} N, not 20.{more}")
    if forces[2::3].min() < 0.0:
        return Verdict(False, "It balances, but some foot would have to pull on the ground.")
    return Verdict(True, "The wobbling table: FL gives up 23 N, RR as well, and the other diagonal takes them.")


EXERCISES = (
    Exercise(
        name="03.1",
        statement="go2 stands on FL and RR alone. Of the 12 directions of β, how many move the robot?",
        stub="moving = 12  # replace this number by what you find",
        solution='two_feet = fb.equations_of_motion(state, contacts.only("FL_foot", "RR_foot"))\n'
        "moving = dimensions(two_feet).rank_V_qdd",
        judge=Numeric(
            count=True,
            right=lambda: rank(fb.accelerations_from_torques(_on_diagonal()).A),
            praise="Two feet have one internal force, along the line between them; every other direction moves something.",
            mistakes={
                "That is all of them. One thing can be done between two feet that moves nothing.": lambda: 12,
                "That is how many do not move it.": lambda: 1,
                "That is the number of force components k; the answer is the number of directions of β.": lambda: 6,
                "That is for three feet.": lambda: 9,
                "That is how many motions of the base two feet can stop; the legs move, too.": lambda: 5,
                "You have counted more than one internal force. Which pushes of two feet turn nothing?": lambda: 10,
            },
        ),
        explanation="d - r + rank J_b = 12 - 6 + 5: about the line through both feet no point foot can stop the base from "
        "turning, so J_b has rank 5, and 6 - 5 = 1 direction only squeezes.",
    ),
    Exercise(
        name="03.2",
        statement="Which torques make the ground add exactly `squeeze` to the contact forces of the tilted robot?",
        stub="torques = np.zeros(12)  # replace: N·m, from tilted.J and squeeze",
        solution="torques = -tilted.J[:, 6:].T @ squeeze",
        judge=Shaped(
            Numeric(
                right=_squeeze_torques,
                praise="Internal forces are answered joint by joint, in any posture, at any velocity, without M and without h.",
                mistakes={"These are no torques at all, so the forces stay as they are.": lambda: np.zeros(12)}
                | _wrong_squeezes(),
            ),
            {
                (18,): "18 numbers: these are generalised forces of base and joints. Motors reach the joints alone: see S.",
                (12, 1): "This is a matrix with one column; the answer is a vector of shape (12,).",
                (6,): "6 numbers: those are the base columns of J. The base has no motors.",
            },
        ),
        explanation="In (7) nothing may change but τ and λ: 0 = S τ + Jᵀ λ. The base rows say that λ is internal; the joint "
        "rows give τ.",
    ),
    Exercise(
        name="03.3",
        statement="Redistribute the forces of the standing robot so that FL carries 20 N and the robot does not move.",
        stub="new_forces = forces.copy()  # replace: shape (12,), N",
        solution="N = internal_forces(eom)  # (12, 6)\n"
        "row = N[2]  # what each internal force does to the vertical force of FL\n"
        "new_forces = forces + N @ row * (20 - forces[2]) / (row @ row)",
        judge=_judge_unloading,
        names=lambda: {"forces": _standing_forces()},
        explanation="Every λ = λ₀ + N x keeps the robot still; x is the shortest vector with row x = 20 - λ₀[2].",
    ),
)
