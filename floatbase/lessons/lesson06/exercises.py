"""Exercises of lesson 06, Friction cones."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

import floatbase as fb
from floatbase._validation import Array
from floatbase.friction import FrictionCone, FrictionPolyhedron, decompose, tangents
from floatbase.lessons.exercises import Exercise, OwnNumber
from floatbase.lessons.judges import (
    Example,
    Mistake,
    NumericJudge,
    ShapeJudge,
    Verdict,
    array_judge,
    first_fault,
)
from floatbase.lessons.lesson06.pictures import slope_normal
from floatbase.objectives import com_wrench_map

# of exercise 06.1: normal, not a unit vector; μ; number of facets
BANK, BANK_MU, BANK_FACETS = np.array([0.3, -0.2, 1.0]), 0.5, 5
FACETS, MU = 8, 0.7  # of exercise 06.2
HILL, MARGIN = 20.0, 9.0  # of exercise 06.3: degrees; N
BALANCE = 0.1  # N, and N·m: tolerance of the balance in exercise 06.3
SOLVED = 1e-3  # N: tolerance of the margin in exercise 06.3, for any solver


class _HalfSpaceJudge(NumericJudge):
    """Judge of half-spaces rows @ f ≤ 0, whatever their order and the scale of each row."""

    def _equal(self, a: Any, b: Any, tolerance: float = 0.0) -> bool:
        a, b = (self._of_unit_tangents(np.asarray(x, dtype=np.float64)) for x in (a, b))
        if a.shape != b.shape:
            return False
        distances = np.max(np.abs(a[:, None] - b[None]), axis=2)
        return bool(np.max(distances[linear_sum_assignment(distances)]) <= max(tolerance, 1e-3))

    @staticmethod
    def _of_unit_tangents(rows: Array) -> Array:
        """Scale each row so that its part along the surface has length one, if there is one."""
        n = BANK / np.linalg.norm(BANK)
        lengths = np.linalg.norm(rows - np.outer(rows @ n, n), axis=1)
        return rows / np.where(lengths > 1e-9, lengths, 1.0)[:, None]


def _rows_from_edges(mu: float = BANK_MU, normal: npt.ArrayLike = BANK, turn: float = 0.0) -> Array:
    """Compute the constraints of exercise 06.1 from the edges of the polyhedron."""
    n = np.asarray(normal) / np.linalg.norm(normal)
    t1, t2 = tangents(n)
    angles = turn + 2 * np.pi * (np.arange(BANK_FACETS + 1) - 0.5) / BANK_FACETS
    edges = n + mu * (np.outer(np.cos(angles), t1) + np.outer(np.sin(angles), t2))
    rows = np.cross(edges[:-1], edges[1:])
    rows *= np.sign(rows @ -n)[:, None]
    return np.asarray(rows / np.linalg.norm(rows - np.outer(rows @ n, n), axis=1)[:, None])


def _with_tangents(mu_facet: float, subtracted: npt.ArrayLike | None = None) -> Array:
    """Return d_i - mu_facet · (subtracted, or the unit normal) for exercise 06.1."""
    n = BANK / np.linalg.norm(BANK)
    t1, t2 = tangents(n)
    angles = 2 * np.pi * np.arange(BANK_FACETS) / BANK_FACETS
    directions = np.outer(np.cos(angles), t1) + np.outer(np.sin(angles), t2)
    return np.asarray(directions - mu_facet * (n if subtracted is None else np.asarray(subtracted)))


def _facet_mistakes() -> list[Mistake]:
    return [
        ("zero", np.zeros((5, 3)), "There is no answer yet. Zero rows allow every force."),
        ("outside", _rows_from_edges(BANK_MU / np.cos(np.pi / 5)), "That polyhedron is outside the "
         "cone: its facets touch the cone in their middle."),
        ("not_unit", _with_tangents(BANK_MU * np.cos(np.pi / 5), BANK), "The normal is not a unit "
         "vector. Normalize it before you use it for the friction term."),
        ("sign", -_rows_from_edges(), "The sign is wrong. rows @ f ≤ 0 must hold for forces "
         "inside."),
        ("normal_sign", _with_tangents(-BANK_MU * np.cos(np.pi / 5)), "The sign of the normal "
         "component is wrong. With a plus, the constraints forbid pushing."),
        ("no_mu", _rows_from_edges(1.0), "μ is missing: these are the facets for μ = 1."),
        ("turned", _rows_from_edges(turn=np.pi / 5), "The facets are rotated by half a facet. "
         "Facet 0 must face t1."),
        ("level", _rows_from_edges(normal=[0.0, 0.0, 1.0]), "These are the constraints on level "
         "ground. Use the given normal."),
    ]  # fmt: skip


def _slip_angle(facets: int | None = FACETS, inside: bool = True, mu: float = MU) -> float:
    """Find the steepest slope [°] whose cone contains a vertical force, by bisection."""
    low, high = 0.0, 89.0
    while high - low > 1e-9:  # degrees
        middle = 0.5 * (low + high)
        n = slope_normal(middle)
        cone = FrictionCone(n, mu) if facets is None else FrictionPolyhedron(n, mu, facets, inside)
        low, high = (middle, high) if cone.contains([0.0, 0.0, 1.0]) else (low, middle)
    return low


@cache
def stance_on_hill() -> tuple[fb.State, fb.Contacts]:
    """Return go2 standing on the slope of exercise 06.3, and its contacts."""
    robot, n = fb.load("go2"), slope_normal(HILL)
    return fb.Simulation(robot, fb.Ground(normal=n)).state, fb.Contacts.points(robot, MU, normals=n)


@array_judge((12,))
def _judge_forces(given: Array) -> Verdict:
    """Judge forces for exercise 06.3 by their sum, moment and margins."""
    f = given.reshape(4, 3)
    return _out_of_balance(f) or _judge_margins(f)


def _out_of_balance(f: Array) -> Verdict | None:
    """Return what is wrong with the sum or moment of forces, shape (4, 3) [N], or None."""
    state, contacts = stance_on_hill()
    weight, n = state.robot.weight, slope_normal(HILL)
    carried = weight * np.array([0.0, 0.0, 1.0])
    total = f.sum(axis=0)
    missing = np.linalg.norm(total - carried)
    moment = np.linalg.norm(np.cross(contacts.positions(state) - state.com, f).sum(axis=0))

    def is_near(force: Array) -> bool:
        return bool(np.linalg.norm(total - force) < BALANCE)

    return first_fault([
        ("no_force", is_near(0.0 * n), "The forces do not carry the robot yet."),
        ("sign", is_near(-carried), "The sign is wrong. λ is the force of the ground on the robot, "
         "and it pushes upwards."),
        ("slides", is_near(weight * n[2] * n), "These forces carry only the normal component of "
         "the weight, so the robot slides."),
        ("along_normal", is_near(weight * n), "Their sum has the magnitude of the weight, but it "
         "is along the normal of the slope. Gravity is vertical."),
        ("sum", missing > BALANCE, f"The sum differs by {missing:.1f} N from the force that "
         "carries the weight."),
        ("moment", moment > BALANCE, f"The sum is right, but a moment of {moment:.1f} N·m remains: "
         "go2 would turn over."),
    ])  # fmt: skip


def _judge_margins(f: Array) -> Verdict:
    """Judge whether each of the balanced forces, shape (4, 3) [N], is well inside its cone."""
    names, n = stance_on_hill()[1].names, slope_normal(HILL)
    margins = np.array([FrictionCone(n, MU).margin(each) for each in f])
    upright = np.array([FrictionCone(np.array([0.0, 0.0, 1.0]), MU).margin(each) for each in f])
    least = f"{names[int(np.argmin(margins))]} has a margin of {margins.min():.1f} N"
    if margins.min() >= MARGIN - SOLVED:
        text = f"The forces are balanced. The smallest margin is {margins.min():.1f} N."
        return Verdict(True, text)
    return first_fault([
        ("upright", np.abs(f[:, :2]).max() < BALANCE and margins.min() >= -BALANCE,
         f"Vertical forces are balanced and inside their cones, but {least} only. Internal forces "
         "can give some of the front feet's tangential force to the rear feet."),
        ("alike", np.ptp([decompose(each, n).f_par for each in f], axis=0).max() < BALANCE,
         "The forces are balanced. But all feet have the same tangential force, and the upper feet "
         f"carry little: {least}."),
        ("in_cones", margins.min() >= -BALANCE, "The forces are balanced and inside their cones, "
         f"but {least} only."),
        ("vertical_cones", upright.min() >= MARGIN, "The forces are balanced and have enough "
         "margin in cones about the vertical. But in the cones about the slope's normal, "
         f"{least}."),
    ]) or Verdict(
        False, f"The forces are balanced, but one is outside its cone: {least}.", "outside"
    )  # fmt: skip


def _in_balance(facets: int, room: float) -> Array:
    """Return the smallest forces that carry go2 on the hill with a margin, shape (12,) [N]."""
    state, contacts = stance_on_hill()
    carry = np.array([0.0, 0.0, state.robot.weight, 0.0, 0.0, 0.0])
    rows = np.kron(np.eye(4), FrictionPolyhedron(slope_normal(HILL), MU, facets).face_matrix)
    balance = (com_wrench_map(state, contacts).A, carry)
    return fb.solve(fb.QP(np.eye(12), np.zeros(12), *balance, rows, np.full(len(rows), -room))).x


def _vertical() -> Array:
    """Return vertical forces that carry go2 on the hill, equal at both feet of a pair."""
    state, contacts = stance_on_hill()
    x = contacts.positions(state)[:, 0] - state.com[0]
    front = state.robot.weight / 2 * x[2] / (x[2] - x[0])
    forces = np.zeros((4, 3))
    forces[:, 2] = front, front, state.robot.weight / 2 - front, state.robot.weight / 2 - front
    return forces.ravel()


def _forces() -> list[Example]:
    state, contacts = stance_on_hill()
    weight, n = state.robot.weight, slope_normal(HILL)
    smallest = np.linalg.pinv(com_wrench_map(state, contacts).A) @ [0, 0, weight, 0, 0, 0]
    # the left feet against the right feet: the sum and the moment do not change
    squeeze = np.zeros(12)
    squeeze[[7, 10]] = 1.0, -1.0
    return [
        *((_in_balance(facets, room), "") for facets, room in ((8, 9.0), (16, 9.0), (16, 10.0))),
        (np.zeros(12), "no_force"), (-smallest, "sign"),
        (np.tile(weight * n[2] * n / 4, 4), "slides"),
        (np.tile(weight * n / 4, 4), "along_normal"), (0.9 * smallest, "sum"),
        (np.tile([0.0, 0.0, weight / 4], 4), "moment"), (smallest, "alike"),
        (smallest + squeeze, "vertical_cones"),
        (_in_balance(16, 0.1), "in_cones"), (_vertical(), "upright"),
        (smallest + 40 * squeeze, "outside"),
    ]  # fmt: skip


def _slope_mistakes(mu: float) -> list[Mistake]:
    return [
        ("45", 45.0, "At 45°, a vertical force needs μ = 1."),
        ("radians", np.deg2rad(_slip_angle(mu=mu)), "That is in radians."),
        ("round", _slip_angle(None, mu=mu), "That is the round cone. A facet faces uphill, in the "
         "direction of this force, and its middle allows less than μ."),
        ("round_radians", np.deg2rad(_slip_angle(None, mu=mu)), "That is the angle in radians, and "
         "for the round cone."),
        ("sine", np.rad2deg(np.arcsin(mu * np.cos(np.pi / 8))), "This uses a sine. On a slope, α_∥ "
         "/ α_⊥ is a tangent."),
        ("round_sine", np.rad2deg(np.arcsin(mu)), "This uses a sine and the round cone. α_∥ / α_⊥ "
         "is a tangent, and a facet allows less than μ."),
        ("four_facets", _slip_angle(4, mu=mu), "That is for 4 facets, as before. Here there are "
         "8."),
        ("outside", np.rad2deg(np.arctan(mu / np.cos(np.pi / 8))), "That is for facets outside the "
         "cone. What does the middle of a facet allow inside?"),
        ("cosine_on_angle", _slip_angle(None, mu=mu) * np.cos(np.pi / 8),
         "This multiplies the angle by the cosine. The cosine belongs to μ."),
    ]  # fmt: skip


def _slope_judge(mu: float = MU) -> NumericJudge:
    """Return the judge of exercise 06.2 for a friction coefficient."""
    return NumericJudge(
        right=lambda: _slip_angle(mu=mu),
        praise="This is less than for the cone itself, because the facets are flat.",
        mistakes=lambda: _slope_mistakes(mu),
    )


EXERCISES = (
    Exercise(
        name="06.1",
        stub="bank_rows = np.zeros((5, 3))  # replace: from bank, mu = 0.5, five facets inside",
        solution="from floatbase.friction import tangents\n\n"
        "n_bank = bank / np.linalg.norm(bank)\n"
        "t1, t2 = tangents(n_bank)\n"
        "turns = 2 * np.pi * np.arange(5) / 5\n"
        "directions = np.outer(np.cos(turns), t1) + np.outer(np.sin(turns), t2)\n"
        "bank_rows = directions - 0.5 * np.cos(np.pi / 5) * n_bank",
        judge=ShapeJudge(
            _HalfSpaceJudge(
                right=_rows_from_edges,
                praise="Five half-spaces. Two of them meet at an edge, and the edges lie on the "
                "cone.",
                mistakes=_facet_mistakes,
            ),
            {
                (3, 5): "This is the transpose. The matrix has one row for each facet.",
                (4, 3): "There are four rows, but five facets are required.",
                (5,): "There are five numbers, but each facet needs a row of three.",
            },
        ),
        examples=lambda: [
            (2.0 * _rows_from_edges()[::-1], ""),
            (_rows_from_edges()[[1, 0, 2, 4, 3]], ""),
        ],
        explanation="The row of a facet takes the force along d_i and subtracts what friction "
        "allows in the middle of the facet, μ cos(π/5) nᵀf.",
    ),
    Exercise(
        name="06.2",
        stub="steepest = 45.0  # degrees; replace by your expression",
        solution="steepest = np.rad2deg(np.arctan(0.7 * np.cos(np.pi / 8)))",
        judge=_slope_judge(),
        explanation="α_∥ / α_⊥ of a vertical force is the tangent of the slope, and the middle "
        "of a facet allows μ cos(π/8).",
        own=OwnNumber("μ", "", MU, (0.4, 0.45, 0.5, 0.55, 0.6, 0.65), _slope_judge),
    ),
    Exercise(
        name="06.3",
        stub="forces_on_hill = np.tile([0, 0, robot.weight / 4], 4)  # replace or change",
        solution="from floatbase.friction import FrictionPolyhedron\n"
        "from floatbase.objectives import wrench_objective\n\n"
        "carry = wrench_objective(hill_state, hill_contacts, [0, 0, robot.weight], np.zeros(3))\n"
        "small = fb.Quadratic.from_residual(np.eye(12), np.zeros(12), 1e-6)\n"
        "facets = [FrictionPolyhedron(n, 0.7, 8).face_matrix for n in hill_contacts.normals]\n"
        "rows_on_hill = block_diag(*facets)\n"
        "# each facet with 9 N to spare\n"
        "forces_on_hill = constrained_minimiser(carry + small, rows_on_hill, -9)",
        judge=_judge_forces,
        namespace=lambda: {"robot": fb.load("go2")},
        examples=_forces,
        explanation="The constraints of all feet have -9 on the right-hand side, and the cost is "
        "the desired wrench with a small weight on the size of the forces. An internal force "
        "moves tangential force from the front feet to the rear feet, which carry more.",
    ),
)
