"""Quadratic programs with named rows, and what makes a point their optimum (§4, App. C).

    min ½ xᵀ H x + gᵀ x   subject to   A x = b,   G x ≤ h

The course text's g_i(x) = 0 are the rows of A x - b = 0; its h_j(x) < 0 are those of G x - h ≤ 0,
with the ≤ that it means: an active row holds with equality. For positive semidefinite H, x is an
optimum exactly if there are multipliers ν, one for each equality, and μ, one for each inequality,
with (Karush, Kuhn, Tucker)

    H x + g + Aᵀ ν + Gᵀ μ = 0     stationarity: the rows balance the objective's slope
    A x = b,  G x ≤ h             feasibility
    μ ≥ 0                         a multiplier is never negative: a table top pushes, it never pulls
    μ_i (G x - h)_i = 0           complementarity: only the rows we rest on are active

μ_i is what one unit more in h_i would lower the objective by, to first order; ν_i likewise in b_i,
of either sign.
Source: [FBR], Appendix C; Boyd and Vandenberghe, Convex Optimization (2004), ch. 5.5.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from floatbase._validation import Array, Value, as_array, as_strings, cached_property, read_only
from floatbase.affine import Affine, as_blocks
from floatbase.errors import InfeasibleError, unknown_name
from floatbase.linear_algebra import row_norms, svd_with_rank
from floatbase.qp.conflicts import conflicting_constraints
from floatbase.qp.labels import constraint_labels

# part of the largest |b| by which equalities of unit length may miss each other: measured b
_CONSISTENCY_TOLERANCE = 1e-7
_ROUNDING = 1e-14  # part of a sum's terms that may be rounding: some 50 units in the last place


@dataclass(frozen=True, eq=False)
class QP(Value):
    """App. C: min ½ xᵀ H x + gᵀ x  subject to  A x = b,  G x ≤ h, with the ≤ that the course text
    means.

    H: (n, n), symmetric, positive semidefinite where A x = b.
    g: (n,).
    A, b: (m, n) and (m,), the equalities.
    G, h: (l, n) and (l,), the inequalities.
    equality_names, inequality_names: one for each row, plain texts or `ConstraintLabel`s; both are
        kept as `ConstraintLabel`s.
    blocks: names of slices of x.

    Raises `InputError` when shapes or names do not fit.
    """

    _example = "controller.qp(state)"
    H: Array
    g: Array
    A: Array
    b: Array
    G: Array
    h: Array
    equality_names: tuple[str, ...] = ()
    inequality_names: tuple[str, ...] = ()
    blocks: Mapping[str, slice] = field(default_factory=dict)

    def __post_init__(self) -> None:
        g = as_array("g", self.g, (None,))
        A, G = as_array("A", self.A, (None, g.size)), as_array("G", self.G, (None, g.size))
        H = as_array("H", self.H, (g.size, g.size))
        values: dict[str, object] = {"H": read_only(0.5 * (H + H.T)), "g": g, "A": A, "G": G}
        values["b"], values["h"] = (
            as_array("b", self.b, (len(A),)),
            as_array("h", self.h, (len(G),)),
        )
        values["blocks"] = as_blocks(self.blocks)
        values["equality_names"] = constraint_labels(self.equality_names, len(A), "equality")
        values["inequality_names"] = constraint_labels(self.inequality_names, len(G), "inequality")
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def without(self, *kinds: str) -> QP:
        """The same problem without the inequality rows of these kinds, such as "friction" or
        "normal force".

        The kind of a row is `ConstraintLabel.kind`, "other constraints" where its name is a plain
        text. Raises `UnknownNameError` for a kind that no row has.
        """
        labels = constraint_labels(self.inequality_names, len(self.G), "inequality")
        for kind in as_strings("kinds", kinds):
            if kind not in (known := {label.kind: None for label in labels}):
                raise unknown_name("kind of constraint", kind, known)
        kept = [i for i, label in enumerate(labels) if label.kind not in kinds]
        names = tuple(labels[i] for i in kept)
        return QP(
            self.H,
            self.g,
            self.A,
            self.b,
            self.G[kept],
            self.h[kept],
            self.equality_names,
            names,
            self.blocks,
        )

    @property
    def n(self) -> int:
        """Number of variables."""
        return int(self.g.size)

    def objective(self, x: Array) -> float:
        """½ xᵀ H x + gᵀ x."""
        return float(0.5 * x @ self.H @ x + self.g @ x)

    @cached_property
    def equality_space(self) -> Affine:
        """All x with A x = b, as the map β -> x0 + Z β with orthonormal Z and x0 of smallest norm
        (13).

        Rows count at unit length, so that multiplying an equation changes nothing. Raises
        `InfeasibleError` naming rows when the equalities are inconsistent.
        """
        size = row_norms(self.A)
        A, b = self.A / size[:, None], self.b / size
        U, s, Vt, rank = svd_with_rank(A)
        residual = np.max(np.abs(U[:, rank:].T @ b), initial=0.0)
        if residual > _CONSISTENCY_TOLERANCE * (1.0 + np.max(np.abs(b), initial=0.0)):
            resolved = (U[:, :rank] * s[:rank]) @ Vt[
                :rank
            ]  # rows that nearly repeat each other would meet far away
            sides = conflicting_constraints(
                np.vstack([resolved, -resolved]), np.append(b, -b)
            )  # A x ≤ b and A x ≥ b
            rows = [self.equality_names[i] for i in sorted(side % len(A) for side in sides)]
            raise InfeasibleError(
                f"these equality constraints are inconsistent: {', '.join(rows)}. Drop one of "
                f"them.",
                rows,
            )
        return Affine(Vt[rank:].T, Vt[:rank].T @ ((U[:, :rank].T @ b) / s[:rank]))

    @cached_property
    def reduced(self) -> QP:
        """The same problem in β: the objective pulled back through `equality_space` (18), the same
        inequality rows.
        """
        if not len(self.A):
            return self
        Z, x0 = self.equality_space
        # what vanishes on the space must come out as zero: its rounding would pass for a curvature,
        # a slope or a row
        H = _zero_if_rounding(Z.T @ self.H @ Z, np.max(np.abs(self.H), initial=0.0))
        g = _zero_if_rounding(
            Z.T @ (self.H @ x0 + self.g),
            np.max(np.abs(self.H) @ np.abs(x0) + np.abs(self.g), initial=0.0),
        )
        G, h = self.G @ Z, self.h - self.G @ x0
        G[np.linalg.norm(G, axis=1) <= _ROUNDING * self.row_norms] = 0.0
        h[np.abs(h) <= _ROUNDING * (np.abs(self.G) @ np.abs(x0) + np.abs(self.h))] = 0.0
        return InequalityQP._unchecked(
            H=0.5 * (H + H.T), g=g, A=np.zeros((0, g.size)), b=self.b[:0], G=G, h=h,
            row_norms=self.row_norms,
            equality_names=(), inequality_names=self.inequality_names, blocks=MappingProxyType({}),
        )  # fmt: skip

    @cached_property
    def row_norms(self) -> Array:
        """The unit to compare violations of rows in, shape (l,): the length of each row of G, 1 for
        a row of zeros.

        `reduced` keeps the lengths that the rows have in x.
        """
        return read_only(row_norms(self.G))

    def __repr__(self) -> str:
        return f"QP({self.n} variables, {len(self.A)} equalities, {len(self.G)} inequalities)"


@dataclass(frozen=True, eq=False, repr=False)
class InequalityQP(QP):
    """A `QP` without equalities, made from another one, whose `row_norms` (l,) are given rather
    than measured.
    """

    row_norms: Array = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "row_norms", as_array("row_norms", self.row_norms, (len(self.G),)))

    @classmethod
    def _unchecked(cls, **values: Any) -> InequalityQP:
        """One whose values are known to fit, and are not checked again."""
        qp = object.__new__(cls)
        for name, value in values.items():
            object.__setattr__(
                qp, name, read_only(value) if isinstance(value, np.ndarray) else value
            )
        return qp


def _zero_if_rounding(value: Array, terms: float) -> Array:
    """`value`, or zeros when it is within the rounding error of sums of terms of that size."""
    return value if np.max(np.abs(value), initial=0.0) > _ROUNDING * terms else np.zeros_like(value)
