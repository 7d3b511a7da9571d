"""Helpers and exercises of lesson 03, The space of possible motions."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

import floatbase as fb
from floatbase._arrays import Array
from floatbase.dynamics import EquationsOfMotion, FeasibleSpace
from floatbase.lessons import Exercise, Numeric, Shaped, Verdict, numbers
from floatbase.linear_algebra import rank
from floatbase.robots import Robot
from floatbase.viewer import Viewer

GHOST_TIME = 0.25  # s: the veil shows where an acceleration leads in this time from rest
FULL = (20.0, 20.0, 100.0)  # m/s² or rad/s², N·m, N: bars of full length


class ConstantTorques:
    """A controller that looks at nothing: the same torques, shape (d,), N·m, for ever."""

    def __init__(self, tau: npt.ArrayLike):
        self.tau = np.array(tau, dtype=np.float64)

    def __call__(self, q: Array, v: Array, t: float) -> ConstantTorques:
        """Itself: it holds `.tau`."""
        return self


def direction(space: FeasibleSpace, base: npt.ArrayLike = (0.0,) * 6, squeeze: npt.ArrayLike | None = None) -> Array:
    """The step in β, shape (dimension,), that changes the base's acceleration by `base` and nothing it need not change.

    base: shape (6,), m/s² and rad/s², base frame. squeeze: internal forces to add, shape (k,), N, world. Of all steps with
    that acceleration it takes the one that changes the forces least.
    """
    rows = space.qdd.A[:6]
    step = np.linalg.pinv(rows, rcond=1e-9) @ np.asarray(base, dtype=np.float64)
    free = np.linalg.svd(rows)[2][rank(rows, absolute=True) :].T
    step -= free @ np.linalg.pinv(space.forces.A @ free, rcond=1e-9) @ (space.forces.A @ step)
    if squeeze is not None:
        forces = np.asarray(squeeze, dtype=np.float64)
        torques = -space.eom.S.T @ space.eom.J.T @ forces
        step += space.map.A.T @ np.concatenate([np.zeros(space.eom.nv), torques, forces])
    return step


def standing_still(space: FeasibleSpace) -> Array:
    """The β of no acceleration at all, q̈ = 0, with the smallest forces that allow it."""
    eom = space.eom
    J_base, J_joints = eom.J[:, :6], eom.J[:, 6:]
    forces = np.linalg.lstsq(J_base.T, eom.h[:6], rcond=1e-9)[0]
    return space.coordinates(np.zeros(eom.nv), eom.h[6:] - J_joints.T @ forces, forces)


def show_beta(view: Viewer, space: FeasibleSpace, beta: npt.ArrayLike) -> str:
    """Draw (q̈, τ, λ) of a β: forces as arrows, where q̈ leads from rest as a veil; return all the numbers as bars, SVG."""
    qdd, tau, forces = space(beta)
    state = space.eom.state
    ghost = state.replace(q=state.integrate(0.5 * GHOST_TIME**2 * qdd), v=np.zeros(space.eom.nv))
    name = "where q̈ leads in a quarter of a second"
    view.show(state, contacts=space.eom.contacts, planned=forces, ghost=ghost, ghost_name=name)
    return bars(qdd, tau, forces)


def bars(qdd: npt.ArrayLike, tau: npt.ArrayLike, forces: npt.ArrayLike, full: tuple[float, float, float] = FULL) -> str:
    """All numbers of a quadruped's motion as bars, SVG, leg by leg.

    full: what a bar of full length means in each group; longer ones get a dark end.
    """
    legs = ("front left", "front right", "rear left", "rear right")
    groups = (
        ("q̈", "m/s², rad/s²", "#7A86A8", ("base x y z", "turning", *legs)),
        ("τ", "N·m", "#E69F00", legs),
        ("λ", "N", "#0072B2", legs),
    )
    parts, x = [], 10
    for (name, unit, colour, blocks), values, most in zip(groups, (qdd, tau, forces), full, strict=True):
        parts.append(f'<text x="{x}" y="12" font-size="11" fill="#222">{name}, ± {most:g} {unit}</text>')
        parts.append(f'<line x1="{x}" y1="60" x2="{x + 12 * np.size(values) + 5 * len(blocks) - 8}" y2="60" stroke="#888"/>')
        for block, three in zip(blocks, np.reshape(values, (-1, 3)), strict=True):
            parts.append(f'<text x="{x + 17}" y="112" font-size="7" fill="#444" text-anchor="middle">{block}</text>')
            for value in three:
                parts += _bar(x, float(value) / most, colour)
                x += 12
            x += 5
        x += 20
    return f'<svg width="{1.45 * x:.0f}" style="max-width: 100%" viewBox="0 0 {x} 118">{"".join(parts)}</svg>'


def _bar(x: float, part: float, colour: str) -> list[str]:
    """A bar at x, up or down from the middle; part: of the full length."""
    length = min(abs(part), 1.0) * 40
    top = 60 - length if part > 0 else 60
    drawn = [f'<rect x="{x}" y="{top:.1f}" width="9" height="{length:.1f}" fill="{colour}"/>']
    if length == 40:
        drawn.append(f'<rect x="{x}" y="{20 if part > 0 else 97}" width="9" height="3" fill="#222"/>')
    return drawn


def matrix_picture(A: npt.ArrayLike, rows: Mapping[str, int], columns: Mapping[str, int]) -> Figure:
    """Where a matrix is not zero, its blocks named with their sizes, and beside it its singular values."""
    A = np.asarray(A)
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained", width_ratios=[3, 2])
    size = np.log10(np.maximum(np.abs(A), 1e-12))
    shown = left.imshow(np.where(np.abs(A) > 1e-9, size, np.nan), cmap="viridis", aspect="auto", vmin=-3, vmax=1.5)
    figure.colorbar(shown, ax=left, ticks=[-3, -2, -1, 0, 1], label="size, as a power of ten", shrink=0.8)
    _name_blocks(left, rows, columns)
    values = np.linalg.svd(A, compute_uv=False)
    right.semilogy(np.arange(1, len(values) + 1), values, "o", color="#0072B2")
    right.set(xlabel="number", ylabel="singular value", title=f"{len(values)} singular values, rank {rank(A)}")
    right.grid(alpha=0.3)
    plt.close(figure)
    return figure


def _name_blocks(axes: Any, rows: Mapping[str, int], columns: Mapping[str, int]) -> None:
    for mapping, line, ticks, names in (
        (rows, axes.axhline, axes.set_yticks, axes.set_yticklabels),
        (columns, axes.axvline, axes.set_xticks, axes.set_xticklabels),
    ):
        ends = np.cumsum(list(mapping.values()))
        for end in ends[:-1]:
            line(end - 0.5, color="#222", linewidth=0.8)
        ticks(ends - np.array(list(mapping.values())) / 2 - 0.5)
        names([f"{name}\n{size}" for name, size in mapping.items()])
    axes.xaxis.tick_top()
    axes.tick_params(length=0)


def upright(robot: Robot, bend: float) -> fb.State:
    """solo12 with every foot below its hip and every knee bent by `bend` rad: 0 is a straight leg. At rest on the ground."""
    q = robot.standing().q.copy()
    for leg in range(4):
        side = 1.0 if leg < 2 else -1.0
        q[7 + 3 * leg : 10 + 3 * leg] = 0.0, side * bend / 2, -side * bend
    for _ in range(3):  # turn the hips until the foot is below the hip's axis
        state = fb.State(robot, q)
        for leg, foot in enumerate(robot.feet):
            joint = robot.model.getJointId(robot.joint_names[3 * leg])
            hip, sole = state.joint_transforms[joint][:3, 3], state.point(foot.frame)
            q[7 + 3 * leg] -= np.arctan2(sole[1] - hip[1], hip[2] - sole[2])
    state = fb.State(robot, q)
    q[2] -= min(state.point(foot.frame)[2] - foot.radius for foot in robot.feet)
    return fb.State(robot, q)


def show_knee(view: Viewer, robot: Robot, bend: float, wobble: Array) -> str:
    """Draw solo12 standing still with knees bent by `bend` rad under its weight's forces plus `wobble`; say what it takes."""
    contacts = fb.Contacts.points(robot)
    eom = fb.equations_of_motion(upright(robot, bend), contacts)
    forces = np.linalg.lstsq(eom.J[:, :6].T, eom.h[:6], rcond=1e-9)[0] + wobble
    tau = eom.h[6:] - eom.J[:, 6:].T @ forces
    extra = eom.J[:, 6:].T @ wobble
    view.show(eom.state, contacts=contacts, planned=forces, cones=False)
    return (
        f"rank J = <b>{rank(eom.J)}</b>, smallest singular value {np.linalg.svd(eom.J)[1][-1]:.3f}; "
        f"torques for the wobble: <b>{np.linalg.norm(extra):.3f} N·m</b>"
        + "<br>"
        + bars(np.zeros(18), tau, forces, full=(20.0, 2.0, 20.0))
    )


@cache
def _go2() -> Robot:
    return fb.load("go2")


@cache
def standing_go2() -> EquationsOfMotion:
    """go2 standing on four feet."""
    return fb.equations_of_motion(_go2().standing(), fb.Contacts.points(_go2(), mu=0.7))


@cache
def tilted_squeeze() -> tuple[EquationsOfMotion, Array]:
    """go2 tilted and moving, and forces, shape (12,), N, world: 10 N that push the feet FL and RR apart along their line."""
    eom = fb.equations_of_motion(_go2().random_state(4), fb.Contacts.points(_go2(), mu=0.7))
    feet = eom.contacts.positions(eom.state)
    line = (feet[0] - feet[3]) / np.linalg.norm(feet[0] - feet[3])
    return eom, np.concatenate([10.0 * line, np.zeros(6), -10.0 * line])


def _on_diagonal() -> EquationsOfMotion:
    contacts = fb.Contacts.points(_go2()).only("FL_foot", "RR_foot")
    return fb.equations_of_motion(_go2().standing(), contacts)


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
        "h is in it: that would hold the robot up as well. Asked for is only what the squeeze adds.": torques(
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
                "That is the number of force components k; asked for are directions of β.": lambda: 6,
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
                (12, 1): "This is a matrix with one column; a vector of shape (12,) is asked for.",
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


def space_of(robot: Robot, *frames: str) -> FeasibleSpace:
    """The space of motions of a robot that stands on these feet, all of them when none is named."""
    contacts = fb.Contacts.points(robot, mu=0.7)
    return fb.feasible_space(fb.equations_of_motion(robot.standing(), contacts.only(*frames) if frames else contacts))
