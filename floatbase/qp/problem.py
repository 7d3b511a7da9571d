"""Quadratic programs with named constraints, and their optimality conditions.

    min ½ xᵀ H x + gᵀ x   subject to   A x = b,   G x ≤ h

The g_i(x) = 0 of the course text are the rows of A x - b = 0. Its h_j(x) < 0 are the rows of
G x - h ≤ 0. We write ≤, which is what the text means, since an active row holds with equality. For
positive semidefinite H, x is an optimum exactly if there are multipliers ν, one per equality, and
μ, one per inequality, that satisfy the Karush-Kuhn-Tucker conditions

    H x + g + Aᵀ ν + Gᵀ μ = 0     stationarity: the constraints balance the slope of the objective
    A x = b,  G x ≤ h             feasibility
    μ ≥ 0                         no multiplier is negative: a table top pushes, but never pulls
    μ_i (G x - h)_i = 0           complementarity: only the rows we rest on are active

To first order, raising h_i by one unit lowers the objective by μ_i. The same holds for ν_i and b_i,
but ν_i can have either sign.

An inequality can be soft: its violation s_i = max(0, (G x - h)_i) adds w_i s_i to the objective.
This penalty is exact [Kerrigan2000]_: the constraint holds whenever its multiplier without the
penalty is below w_i. The conditions are then 0 ≤ μ_i ≤ w_i, and s_i > 0 only if μ_i = w_i.

[FBR]_, App. C. [Boyd2004]_, section 5.5.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from types import MappingProxyType
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_strings,
    cached_property,
    frozen,
    numeric_copy,
    read_only,
    short_repr,
)
from floatbase.affine import Affine, as_blocks
from floatbase.errors import InfeasibleError, InputError, unknown_name
from floatbase.linear_algebra import row_norms, svd_with_rank
from floatbase.qp.conflicts import conflicting_constraints
from floatbase.qp.labels import ConstraintLabel, constraint_labels

# fraction of 1 + the largest |b| by which equalities of unit length may disagree: b is measured
_CONSISTENCY_TOLERANCE = 1e-7
# fraction of the terms of a sum that may be rounding: about 50 units in the last place
_ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class QP(Value):
    """A quadratic program: min ½ xᵀ H x + gᵀ x subject to A x = b and G x ≤ h.

    Parameters
    ----------
    H : array_like, shape (n, n)
        Symmetric matrix of the objective, positive semidefinite on the space where A x = b.
    g : array_like, shape (n,)
        Vector of the objective.
    A : array_like, shape (m, n)
        Matrix of the equality constraints.
    b : array_like, shape (m,)
        Right-hand side of the equality constraints.
    G : array_like, shape (l, n)
        Matrix of the inequality constraints.
    h : array_like, shape (l,)
        Right-hand side of the inequality constraints.
    equality_names : sequence of str
        Name of each equality, as a plain string or `ConstraintLabel`; stored as `ConstraintLabel`.
    inequality_names : sequence of str
        Name of each inequality, as a plain string or `ConstraintLabel`; stored as
        `ConstraintLabel`.
    blocks : mapping of str to slice
        Names of slices of x.
    penalties : array_like, shape (l,), optional
        Weight w of the violation of each inequality in the objective; inf for a hard constraint. By
        default all inequalities are hard [units of the objective per unit of h]. Only solvers of
        this package know weights; `with_slacks` prepares the problem for others.

    Raises
    ------
    InputError
        If shapes or names do not match, or if a penalty is not positive.

    Notes
    -----
    [FBR]_, App. C. The inequalities are meant with ≤.
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
    penalties: Array | None = None

    def __post_init__(self) -> None:
        g = as_array("g", self.g, (None,))
        A, G = as_array("A", self.A, (None, g.size)), as_array("G", self.G, (None, g.size))
        H = as_array("H", self.H, (g.size, g.size))
        vars(self).update(
            H=frozen(0.5 * (H + H.T)), g=g, A=A, G=G,
            b=as_array("b", self.b, (len(A),)), h=as_array("h", self.h, (len(G),)),
            blocks=as_blocks(self.blocks),
            equality_names=constraint_labels(self.equality_names, len(A), "equality"),
            inequality_names=constraint_labels(self.inequality_names, len(G), "inequality"),
            penalties=None if self.penalties is None else _as_penalties(self.penalties, len(G)),
        )  # fmt: skip

    @classmethod
    def _unchecked(cls, **values: Any) -> Self:
        """Make a problem from values that are known to fit, without checking them again."""
        qp = object.__new__(cls)
        arrays = {k: read_only(v) for k, v in values.items() if isinstance(v, np.ndarray)}
        vars(qp).update(values | arrays)
        return qp

    def without(self, *kinds: str) -> QP:
        """Return the same problem without the inequality constraints of some kinds.

        Parameters
        ----------
        *kinds : str
            Kinds to remove, such as "friction" or "normal force". The kind of a constraint is its
            `ConstraintLabel.kind`, which is "other constraints" if its name is a plain string.

        Returns
        -------
        QP
            The problem with fewer constraints.

        Raises
        ------
        UnknownNameError
            If no constraint is of a given kind.
        """
        labels = constraint_labels(self.inequality_names, len(self.G), "inequality")
        for kind in as_strings("kinds", kinds):
            if kind not in (known := {label.kind: None for label in labels}):
                raise unknown_name("kind of constraint", kind, known)
        kept = [i for i, label in enumerate(labels) if label.kind not in kinds]
        names = tuple(labels[i] for i in kept)
        G, h = self.G[kept], self.h[kept]
        penalties = None if self.penalties is None else self.penalties[kept]
        return QP(
            self.H, self.g, self.A, self.b, G, h, self.equality_names, names, self.blocks, penalties
        )

    @cached_property
    def soft(self) -> npt.NDArray[np.int_]:
        """Row numbers of the soft inequalities, shape (s,)."""
        found = np.flatnonzero(np.isfinite(np.inf if self.penalties is None else self.penalties))
        found.setflags(write=False)
        return found

    def with_slacks(self) -> QP:
        """Return the equivalent problem with hard inequalities only, for any QP solver.

        Returns
        -------
        QP
            Problem whose variables are x and, in the block "slacks", the violations of the soft
            inequalities.

        Raises
        ------
        InputError
            If a block of the problem is named "slacks".
        """
        n, s, soft = self.n, len(self.soft), self.soft
        if not s:
            return self
        if "slacks" in self.blocks:
            raise InputError('Rename the block "slacks": with_slacks needs this name.')
        assert self.penalties is not None
        m, rows = len(self.A), len(self.G)
        H, A, G = np.zeros((n + s, n + s)), np.zeros((m, n + s)), np.zeros((rows + s, n + s))
        H[:n, :n], A[:, :n], G[:rows, :n] = self.H, self.A, self.G
        slacks = np.arange(s)
        G[soft, n + slacks] = G[rows + slacks, n + slacks] = -1.0
        names = [_slack_label(self.inequality_names[i]) for i in soft.tolist()]
        return QP._unchecked(
            H=frozen(H), g=frozen(np.concatenate([self.g, self.penalties[soft]])),
            A=frozen(A), b=self.b, G=frozen(G), h=frozen(np.concatenate([self.h, np.zeros(s)])),
            equality_names=self.equality_names,
            inequality_names=constraint_labels(
                (*self.inequality_names, *names), rows + s, "inequality"
            ),
            blocks=as_blocks({**self.blocks, "slacks": slice(n, n + s)}), penalties=None,
        )  # fmt: skip

    @property
    def n(self) -> int:
        """Number of variables."""
        return int(self.g.size)

    def objective(self, x: Array) -> float:
        """Return ½ xᵀ H x + gᵀ x, without penalties.

        Parameters
        ----------
        x : ndarray, shape (n,)
            Point at which the objective is evaluated.

        Returns
        -------
        float
            Value of the objective.
        """
        return float(0.5 * x @ self.H @ x + self.g @ x)

    @cached_property
    def equality_space(self) -> Affine:
        """All solutions of A x = b, as the map β -> x0 + Z β of eq. (13).

        Z has orthonormal columns, and x0 is the solution of smallest norm. Equations are scaled to
        unit length, so multiplying an equation by a number changes nothing. Inconsistent equations
        raise an `InfeasibleError` that names them.
        """
        if not len(self.A):
            return Affine(np.eye(self.n), np.zeros(self.n))
        size = row_norms(self.A)
        A, b = self.A / size[:, None], self.b / size
        U, s, Vt, rank = svd_with_rank(A)
        residual = np.max(np.abs(U[:, rank:].T @ b), initial=0.0)
        if residual > _CONSISTENCY_TOLERANCE * (1.0 + np.max(np.abs(b), initial=0.0)):
            # solutions of nearly equal rows would lie far away
            resolved = (U[:, :rank] * s[:rank]) @ Vt[:rank]
            # A x ≤ b and A x ≥ b
            sides = conflicting_constraints(np.vstack([resolved, -resolved]), np.append(b, -b))
            rows = [self.equality_names[i] for i in sorted(side % len(A) for side in sides)]
            raise InfeasibleError(
                f"These equality constraints are inconsistent: {', '.join(rows)}. Remove one of "
                f"them.",
                rows,
            )
        return Affine(Vt[rank:].T, Vt[:rank].T @ ((U[:, :rank].T @ b) / s[:rank]))

    @cached_property
    def reduced(self) -> QP:
        """Equivalent problem in the coordinates β of `equality_space`, without equalities.

        The objective is pulled back as in eq. (18). The inequality constraints are the same.
        """
        if not len(self.A):
            return self
        Z, x0 = self.equality_space
        # terms that vanish on the space must be exactly zero: their rounding would look like a
        # curvature, a slope or a row
        H = _zero_if_rounding(Z.T @ self.H @ Z, np.max(np.abs(self.H), initial=0.0))
        g = _zero_if_rounding(
            Z.T @ (self.H @ x0 + self.g),
            np.max(np.abs(self.H) @ np.abs(x0) + np.abs(self.g), initial=0.0),
        )
        G, h = self.G @ Z, self.h - self.G @ x0
        G[np.linalg.norm(G, axis=1) <= _ROUNDING * self.row_norms] = 0.0
        h[np.abs(h) <= _ROUNDING * (np.abs(self.G) @ np.abs(x0) + np.abs(self.h))] = 0.0
        return in_coordinates(self, 0.5 * (H + H.T), g, G, h)

    @cached_property
    def row_norms(self) -> Array:
        """Length of each row of G, shape (l,), used to compare violations; 1 for a row of zeros.

        `reduced` keeps the lengths that the rows have in x.
        """
        return read_only(row_norms(self.G))

    def __repr__(self) -> str:
        soft = f", {len(self.soft)} of them soft" if len(self.soft) else ""
        sizes = f"{self.n} variables, {len(self.A)} equalities, {len(self.G)} inequalities"
        return f"QP({sizes}{soft})"


@dataclass(frozen=True, eq=False, repr=False)
class InequalityQP(QP):
    """A `QP` without equalities, made from another `QP`, with given `row_norms`."""

    row_norms: Array = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "row_norms", as_array("row_norms", self.row_norms, (len(self.G),)))


def in_coordinates(qp: QP, H: Array, g: Array, G: Array, h: Array) -> InequalityQP:
    """Return a problem in other coordinates, in which its equalities always hold, unchecked."""
    return InequalityQP._unchecked(
        H=H, g=g, A=np.zeros((0, g.size)), b=np.zeros(0), G=G, h=h, row_norms=qp.row_norms,
        equality_names=(), inequality_names=qp.inequality_names, blocks=MappingProxyType({}),
        penalties=qp.penalties,
    )  # fmt: skip


@lru_cache(maxsize=4096)
def _slack_label(inequality: str) -> ConstraintLabel:
    """Return the name of the row s ≥ 0 of the slack of an inequality."""
    return ConstraintLabel(f"slack of {inequality} ≥ 0", "slack", inequality)


def _as_penalties(penalties: npt.ArrayLike, count: int) -> Array:
    """Return penalties, shape (count,), after checking that all are positive or inf."""
    weights = numeric_copy(penalties)
    if weights is None or weights.shape != (count,) or not (weights > 0.0).all():
        raise InputError(
            f"penalties must be {count} positive numbers, one for each inequality, or inf for "
            f"hard constraints, not {short_repr(penalties)}."
        )
    return read_only(weights)


def _zero_if_rounding(value: Array, terms: float) -> Array:
    """Return `value`, or zeros if it is within the rounding error of sums of such terms."""
    return value if np.max(np.abs(value), initial=0.0) > _ROUNDING * terms else np.zeros_like(value)
