"""Exercises of lesson 06, Friction cones."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from floatbase._validation import Array
from floatbase.friction import FrictionCone, FrictionPolyhedron, tangents
from floatbase.lessons.exercises import Exercise, OwnNumber
from floatbase.lessons.judges import (
    BugHunt,
    Mistake,
    NumericJudge,
    ShapeJudge,
)
from floatbase.lessons.lesson06.pictures import slope_normal

# of exercise 06.1: normal, not a unit vector; μ; number of facets
BANK, BANK_MU, BANK_FACETS = np.array([0.3, -0.2, 1.0]), 0.5, 5
FACETS, MU = 8, 0.7  # of exercise 06.2


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


def _with_tangents(
    mu_facet: float, subtracted: npt.ArrayLike | None = None, level: bool = False
) -> Array:
    """Return d_i - mu_facet · (subtracted, or the unit normal) for exercise 06.1."""
    n = BANK / np.linalg.norm(BANK)
    t1, t2 = np.eye(3)[:2] if level else tangents(n)
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
        ("mu_of_lesson", _rows_from_edges(MU), "These are the facets for μ = 0.7. Here μ is 0.5."),
        ("turned", _rows_from_edges(turn=np.pi / 5), "The facets are rotated by half a facet. "
         "Facet 0 must face t1."),
        ("horizontal", _with_tangents(BANK_MU * np.cos(np.pi / 5), level=True), "The directions d "
         "are horizontal. On a bank they must lie along the surface, as `tangents` gives them."),
        ("whole_angle", _with_tangents(BANK_MU * np.cos(2 * np.pi / 5)), "This uses cos(2π/N). "
         "From the middle of a facet to its edge, the angle is half as large, π/N."),
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
        stub='fault = ["", ""]  # the line, and: frame, sign, transpose, missing term',
        solution='fault = ["2", "sign"]',
        judge=BugHunt(
            lines=("2",),
            kind="sign",
            praise="On a slope that rises forwards, the normal leans backwards. This one leans "
            "forwards by the same angle.",
            refuted={
                "frame": "With rows for level ground, the middle of each interval would move by "
                "the slope itself. It moves by twice the slope.",
                "transpose": "A transpose would change the rows on level ground as well. They are "
                "right.",
                "missing term": "On level ground all is right, and the width of the interval is "
                "52° on every slope. So no term is missing.",
            },
            elsewhere="The middle of each interval is the axis of the cone. Which line chooses "
            "this axis?",
        ),
        explanation="The axis of the cone is off by twice the slope, so the normal leans to the "
        "wrong side. It must be (-sin, 0, cos).",
    ),
)
