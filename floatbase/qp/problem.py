"""Quadratic programs with named rows, what makes a point their optimum, and one function to solve them (§4, App. C).

    min ½ xᵀ H x + gᵀ x   subject to   A x = b,   G x ≤ h

The document's g_i(x) = 0 are the rows of A x - b = 0; its h_j(x) < 0 are those of G x - h ≤ 0, with the ≤ that it
means: an active row holds with equality. x is an optimum, for H positive semidefinite, exactly if there are multipliers
ν, one for each equality, and μ, one for each inequality, with (Karush, Kuhn, Tucker)

    H x + g + Aᵀ ν + Gᵀ μ = 0     stationarity: the objective's slope is held by the rows
    A x = b,  G x ≤ h             feasibility
    μ ≥ 0                         a table top pushes, it never pulls
    μ_i (G x - h)_i = 0           complementarity: only the rows we rest on push

μ_i is what one unit of room on row i (h_i + 1) would lower the objective by, to first order; ν_i likewise, of either
sign. Source: the document, Appendix C; Boyd and Vandenberghe, Convex Optimization (2004), ch. 5.5.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from floatbase._arrays import Array, checked, read_only
from floatbase.affine import Affine, Quadratic
from floatbase.errors import InfeasibleError, InputError, SolverError, unknown_name
from floatbase.linear_algebra import RANK_TOLERANCE, row_lengths
from floatbase.qp.conflicts import conflicting_rows, contradicting_equalities, contradiction

if TYPE_CHECKING:
    from floatbase.qp.backends import BackEnd

FEASIBILITY_TOLERANCE = 1e-9  # what a solver may leave of an inequality of unit length
_ROUNDING = 1e-14  # part of a sum's terms that may be rounding


@dataclass(frozen=True, eq=False)
class QP:
    """App. C: min ½ xᵀ H x + gᵀ x  subject to  A x = b,  G x ≤ h, with the ≤ that the document means.

    H: (n, n) symmetric, positive semidefinite where A x = b. g: (n,). A: (m, n), b: (m,). G: (l, n), h: (l,). `blocks`
    names slices of x; `equality_names` and `inequality_names` name the rows. Raises `InputError` when shapes or names
    do not fit.
    """

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
        g = checked("g", self.g, (None,))
        A, G = checked("A", self.A, (None, g.size)), checked("G", self.G, (None, g.size))
        H = checked("H", self.H, (g.size, g.size))
        values: dict[str, Array] = {"H": read_only(0.5 * (H + H.T)), "g": g, "A": A, "G": G}
        values["b"], values["h"] = checked("b", self.b, (len(A),)), checked("h", self.h, (len(G),))
        for name, value in values.items():
            object.__setattr__(self, name, value)
        object.__setattr__(self, "blocks", MappingProxyType(dict(self.blocks)))
        for kind, rows in (("equality", len(A)), ("inequality", len(G))):
            names = tuple(getattr(self, f"{kind}_names")) or tuple(f"{kind} {i}" for i in range(rows))
            if len(names) != rows:
                raise InputError(f"{len(names)} {kind} names for {rows} rows; give one for each row, or none at all.")
            if len(set(names)) != rows:
                twice = next(name for name in names if names.count(name) > 1)
                raise InputError(f"{kind} name {twice!r} stands twice; each row needs a name of its own.")
            object.__setattr__(self, f"{kind}_names", names)

    @property
    def n(self) -> int:
        """Number of variables."""
        return int(self.g.size)

    def objective(self, x: Array) -> float:
        """½ xᵀ H x + gᵀ x."""
        return float(0.5 * x @ self.H @ x + self.g @ x)

    @cached_property
    def equality_space(self) -> Affine:
        """All x with A x = b, as the map β -> x0 + Z β with orthonormal Z and x0 of smallest norm (13).

        Rows count at unit length, so that multiplying an equation changes nothing. Raises `InfeasibleError` naming rows
        when the equalities contradict each other.
        """
        if not len(self.A):
            return Affine.identity(self.n)
        size = row_lengths(self.A)
        A, b = self.A / size[:, None], self.b / size
        U, s, Vt = np.linalg.svd(A)
        rank = int(np.sum(s > RANK_TOLERANCE * s[0])) if s.size else 0
        left = U[:, rank:].T @ b
        tolerance = 1e-7 * (1.0 + float(np.max(np.abs(b))))
        if np.max(np.abs(left), initial=0.0) > tolerance:
            rows = [self.equality_names[i] for i in contradicting_equalities(A, b, tolerance)]
            raise InfeasibleError(f"these equality rows contradict each other: {', '.join(rows)}. Drop one.", rows)
        return Affine(Vt[rank:].T, Vt[:rank].T @ ((U[:, :rank].T @ b) / s[:rank]))

    @cached_property
    def reduced(self) -> QP:
        """The same problem in β: the objective pulled back through `equality_space` (18), the same inequality rows."""
        if not len(self.A):
            return self
        space = self.equality_space
        Z, x0 = space.A, space.b
        cost = Quadratic(self.H, self.g).pullback(space)
        # what vanishes on the space must come out as zero: its rounding would pass for a curvature, a slope or a row
        H = _without_rounding(cost.H, np.max(np.abs(self.H), initial=0.0))
        g = _without_rounding(cost.g, np.max(np.abs(self.H) @ np.abs(x0) + np.abs(self.g), initial=0.0))
        G, h = self.G @ Z, self.h - self.G @ x0
        G[np.linalg.norm(G, axis=1) <= _ROUNDING * self.row_lengths] = 0.0
        h[np.abs(h) <= _ROUNDING * (np.abs(self.G) @ np.abs(x0) + np.abs(self.h))] = 0.0
        return QP(H, g, np.zeros((0, space.n_in)), np.zeros(0), G, h, inequality_names=self.inequality_names)

    @cached_property
    def row_lengths(self) -> Array:
        """Length of each row of G, shape (l,), 1 for a row of zeros: the unit to compare violations of rows in."""
        return read_only(row_lengths(self.G))

    def __repr__(self) -> str:
        return f"QP({self.n} variables, {len(self.A)} equalities, {len(self.G)} inequalities)"


@dataclass(frozen=True)
class Residuals:
    """What a solution leaves of each optimality condition; all are 0 at an exact optimum.

    stationarity: max |H x + g + Aᵀ ν + Gᵀ μ|. equality: max |A x - b|. inequality: max(G x - h, 0).
    complementarity: max |μ (G x - h)|. dual: max(-μ, 0).
    """

    stationarity: float
    equality: float
    inequality: float
    complementarity: float
    dual: float


@dataclass(frozen=True, eq=False)
class Solution:
    """The minimiser x of a QP with the evidence that it is one.

    equality_multipliers ν: (m,), inequality_multipliers μ ≥ 0: (l,), with H x + g + Aᵀ ν + Gᵀ μ = 0. iterations is the
    solver's own count, 0 where it has none.
    """

    qp: QP
    x: Array
    equality_multipliers: Array
    inequality_multipliers: Array
    solver: str
    iterations: int = 0

    @cached_property
    def residuals(self) -> Residuals:
        """How well the optimality conditions hold, computed from the problem itself."""
        qp, mu = self.qp, self.inequality_multipliers
        slack = qp.G @ self.x - qp.h
        slope = qp.H @ self.x + qp.g + qp.A.T @ self.equality_multipliers + qp.G.T @ mu
        return Residuals(
            stationarity=float(np.max(np.abs(slope), initial=0.0)),
            equality=float(np.max(np.abs(qp.A @ self.x - qp.b), initial=0.0)),
            inequality=float(np.max(slack, initial=0.0)),
            complementarity=float(np.max(np.abs(mu * slack), initial=0.0)),
            dual=float(np.max(-mu, initial=0.0)),
        )

    @cached_property
    def active(self) -> tuple[str, ...]:
        """Names of the inequality rows that push: those whose multiplier counts beside the slopes it holds."""
        qp, push = self.qp, self.inequality_multipliers * self.qp.row_lengths
        slopes = np.concatenate([qp.g, qp.H @ self.x, push])
        return tuple(qp.inequality_names[i] for i in np.flatnonzero(push > 1e-9 * np.max(np.abs(slopes), initial=0.0)))

    @property
    def multipliers(self) -> dict[str, float]:
        """Multiplier of each active inequality row, by name: what a unit of room there would lower the objective by."""
        mu = dict(zip(self.qp.inequality_names, self.inequality_multipliers, strict=True))
        return {name: float(mu[name]) for name in self.active}

    @property
    def objective(self) -> float:
        """The smallest value."""
        return self.qp.objective(self.x)

    def __getitem__(self, block: str) -> Array:
        """One named block of x."""
        if block not in self.qp.blocks:
            raise InputError(f"this problem has no block {block!r}; its blocks are {list(self.qp.blocks)}.")
        return self.x[self.qp.blocks[block]]


def solve(qp: QP, solver: str = "daqp") -> Solution:
    """Solve a QP.

    solver: one of `solvers()`. "daqp" is what controllers use; "cvxpy" (Clarabel at tight tolerances) is the judge,
    slow and independent; "active_set" is the method of `active_set.py`, written to be read; "proxsuite" (ProxQP) needs
    that package. Raises `InfeasibleError` with a smallest set of conflicting rows, `SolverError` when the objective has
    no minimum or the solver gives up, `UnknownNameError` for a solver that does not exist, `InputError` for one that is
    not installed.
    """
    check_solver(solver)
    found = _installed()[solver](qp)
    if found is None:
        raise _infeasible(qp)
    return found


def solvers() -> tuple[str, ...]:
    """Names that `solve` takes here; "proxsuite" is among them where that package is installed."""
    return tuple(_installed())


def check_solver(solver: str) -> None:
    """Raises for a solver that `solve` does not take: `UnknownNameError`, or `InputError` saying what to install."""
    from floatbase.qp.backends import ALWAYS, OPTIONAL

    if solver in OPTIONAL and solver not in solvers():
        raise InputError(
            f"solver {solver!r} needs a package that is not installed: pip install {solver}. "
            f"Here without it: {', '.join(solvers())}."
        )
    if solver not in solvers():
        raise unknown_name("solver", solver, [*ALWAYS, *OPTIONAL])


def finished(qp: QP, x: Array, mu: Array, solver: str, iterations: int) -> Solution:
    """The `Solution` of a back end that found x and μ; ν follows from stationarity, by least squares."""
    slope, size = qp.H @ x + qp.g + qp.G.T @ mu, row_lengths(qp.A)
    nu = np.linalg.lstsq((qp.A / size[:, None]).T, -slope, rcond=RANK_TOLERANCE)[0] / size if len(qp.A) else np.zeros(0)
    return Solution(qp, read_only(x), read_only(nu), read_only(mu), solver, iterations)


def unbounded(qp: QP) -> SolverError:
    """The error for a problem whose objective falls for ever."""
    return SolverError(
        f"the objective of {qp!r} has no minimum: it falls for ever along a direction without curvature or row. "
        "Add a task of small weight that wants something of every variable (force or torque regularisation), or bounds."
    )


def not_convex(qp: QP) -> SolverError:
    """The error for an objective that curves downwards."""
    return SolverError(
        f"{qp!r} is not convex: along one direction its curvature is {np.linalg.eigvalsh(qp.reduced.H)[0]:.3g}. "
        "H must be positive semidefinite where the equalities hold; weights must be ≥ 0."
    )


def _without_rounding(value: Array, terms: float) -> Array:
    """`value`, or zeros when all of it is no more than the rounding of sums of terms of that size."""
    return value if np.max(np.abs(value), initial=0.0) > _ROUNDING * terms else np.zeros_like(value)


def _installed() -> Mapping[str, BackEnd]:
    from floatbase.qp.backends import installed  # the back ends import this module for what they take and give

    return installed()


def _infeasible(qp: QP) -> InfeasibleError | SolverError:
    """The error for a problem in which a solver found no feasible point, naming the rows in conflict."""
    size = qp.row_lengths
    rows = conflicting_rows(qp.reduced.G / size[:, None], qp.reduced.h / size)
    if rows:
        return contradiction(qp.inequality_names[i] for i in rows)
    return SolverError(
        f"the solver found no point that satisfies all rows of {qp!r}, but a linear program found one: the rows only "
        f"just meet. Loosen them by more than {FEASIBILITY_TOLERANCE:g}."
    )
