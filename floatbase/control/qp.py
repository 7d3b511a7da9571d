"""Quadratic programs with named rows, and the solvers behind one function (§4, Appendix C)."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from floatbase._arrays import Array, checked, read_only
from floatbase.affine import Affine
from floatbase.control.conflicts import conflicting_rows
from floatbase.errors import InfeasibleError, InputError, SolverError, unknown_name

RANK_TOLERANCE = 1e-10  # singular values below this part of the largest count as zero
FEASIBILITY_TOLERANCE = 1e-9  # what DAQP may leave of an inequality, in the row's unit


@dataclass(frozen=True, eq=False)
class QP:
    """min ½ xᵀ H x + gᵀ x  subject to  A x = b,  G x ≤ h (Appendix C, with the ≤ that it means).

    H: (n, n) symmetric, positive semidefinite. g: (n,). A: (m, n), b: (m,). G: (l, n), h: (l,). `blocks` names slices of
    x; `equality_names` and `inequality_names` name the rows. Raises `InputError` when shapes or names do not fit.
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
        for kind, rows in (("equality", len(A)), ("inequality", len(G))):
            names = getattr(self, f"{kind}_names") or tuple(f"{kind} {i}" for i in range(rows))
            if len(names) != rows:
                raise InputError(f"{len(names)} {kind} names for {rows} rows; give one for each row, or none at all.")
            object.__setattr__(self, f"{kind}_names", tuple(names))

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

        Raises `InfeasibleError` naming rows when the equalities contradict each other.
        """
        if not len(self.A):
            return Affine.identity(self.n)
        U, s, Vt = np.linalg.svd(self.A)
        rank = int(np.sum(s > RANK_TOLERANCE * s[0])) if s.size else 0
        left = U[:, rank:].T @ self.b
        if np.max(np.abs(left), initial=0.0) > 1e-7 * (1.0 + float(np.max(np.abs(self.b)))):
            weight = np.abs(U[:, rank:] @ left)
            rows = [self.equality_names[i] for i in np.flatnonzero(weight > 1e-3 * weight.max())]
            raise InfeasibleError(f"these equality rows contradict each other: {', '.join(rows)}.", rows)
        return Affine(Vt[rank:].T, Vt[:rank].T @ ((U[:, :rank].T @ self.b) / s[:rank]))

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
        """Names of the inequality rows that push: those with a multiplier that counts, relative to the objective's slope."""
        mu = self.inequality_multipliers
        threshold = 1e-9 * (1.0 + float(np.max(np.abs(self.qp.g), initial=0.0)))
        return tuple(self.qp.inequality_names[i] for i in np.flatnonzero(mu > threshold))

    @property
    def multipliers(self) -> dict[str, float]:
        """Multiplier of each active inequality row, by name: what a unit of room on that row would lower the objective by."""
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

    solver: one of `solvers()`: "daqp" is what controllers use; "cvxpy" (Clarabel at tight tolerances) is the judge, slow
    and independent. Raises `InfeasibleError` with a smallest set of conflicting rows, `SolverError` when the solver gives
    up, `UnknownNameError` for a solver that does not exist.
    """
    if solver not in _SOLVERS:
        raise unknown_name("solver", solver, _SOLVERS)
    found = _SOLVERS[solver](qp)
    if found is None:
        raise _infeasible(qp)
    x, mu, iterations = found
    slope = qp.H @ x + qp.g + qp.G.T @ mu
    nu = -np.linalg.lstsq(qp.A.T, slope, rcond=RANK_TOLERANCE)[0] if len(qp.A) else np.zeros(0)
    return Solution(qp, read_only(x), read_only(nu), read_only(mu), solver, iterations)


def solvers() -> tuple[str, ...]:
    """Names that `solve` takes."""
    return tuple(_SOLVERS)


_Found = tuple[Array, Array, int] | None


def _daqp(qp: QP) -> _Found:
    """Eliminate the equalities, then DAQP's dual active set on what is left: x, μ, iterations; None when infeasible."""
    import daqp

    space = qp.equality_space
    if space.n_in == 0:
        return _single_point(qp, space.b)
    H = np.ascontiguousarray(space.A.T @ qp.H @ space.A)
    g = space.A.T @ (qp.H @ space.b + qp.g)
    scale = max(float(np.max(np.abs(H))), 1e-300)
    y, _, flag, info = daqp.solve(
        H / scale,
        g / scale,
        np.ascontiguousarray(qp.G @ space.A),
        qp.h - qp.G @ space.b,
        np.full(len(qp.h), -1e30),
        np.zeros(len(qp.h), dtype=np.int32),
        primal_tol=FEASIBILITY_TOLERANCE,
        eps_prox=-1.0,
    )
    if flag == -1:
        return None
    if flag not in (1, 2):
        raise SolverError(f"DAQP gave up with flag {flag} on {qp!r}; check weights (too far apart?) and curvature.")
    mu = np.maximum(np.asarray(info["lam"], dtype=np.float64)[-len(qp.h) :] * scale, 0.0) if len(qp.h) else np.zeros(0)
    return space(y), mu, int(info["iterations"])


def _single_point(qp: QP, x: Array) -> _Found:
    """The equalities leave one point: it is the answer if it satisfies the inequalities."""
    if np.max(qp.G @ x - qp.h, initial=0.0) > 1e-7:
        return None
    return x, np.zeros(len(qp.h)), 0


def _cvxpy(qp: QP) -> _Found:
    """The whole problem, equalities included, by cvxpy and Clarabel at tight tolerances."""
    import cvxpy as cp

    # written around the optimum without inequalities: Clarabel's gap is relative to an objective that is then small, which
    # is what lets it see weights of 1e-6 beside weights of 10
    origin = _without_inequalities(qp)
    slope = qp.H @ origin + qp.g
    step = cp.Variable(qp.n)
    constraints = []
    if len(qp.A):
        constraints.append(qp.A @ step == qp.b - qp.A @ origin)
    if len(qp.G):
        constraints.append(qp.G @ step <= qp.h - qp.G @ origin)
    problem = cp.Problem(cp.Minimize(0.5 * cp.quad_form(step, cp.psd_wrap(qp.H)) + slope @ step), constraints)
    try:
        with warnings.catch_warnings():
            # at its last digits Clarabel calls itself inaccurate; how accurate it was, Solution.residuals says
            warnings.filterwarnings("ignore", message="Solution may be inaccurate")
            problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-12, tol_gap_rel=1e-12, tol_feas=1e-12, max_iter=200)
    except cp.error.SolverError as error:
        raise SolverError(f"Clarabel gave up on {qp!r}: {error}") from None
    if problem.status in (cp.INFEASIBLE, cp.INFEASIBLE_INACCURATE):
        return None
    if step.value is None:
        raise SolverError(f"Clarabel ended with status {problem.status!r} on {qp!r}.")
    mu = np.maximum(np.asarray(constraints[-1].dual_value), 0.0) if len(qp.G) else np.zeros(0)
    return origin + np.asarray(step.value), np.atleast_1d(mu), int(problem.solver_stats.num_iters or 0)


def _without_inequalities(qp: QP) -> Array:
    """A stationary point of the problem without its inequalities, shape (n,), from its KKT system."""
    m = len(qp.A)
    kkt = np.block([[qp.H, qp.A.T], [qp.A, np.zeros((m, m))]])
    return np.linalg.lstsq(kkt, np.concatenate([-qp.g, qp.b]), rcond=None)[0][: qp.n]


_SOLVERS: dict[str, Callable[[QP], _Found]] = {"daqp": _daqp, "cvxpy": _cvxpy}


def _infeasible(qp: QP) -> InfeasibleError:
    """The error for a problem without a feasible point, naming the rows in conflict."""
    space = qp.equality_space
    rows = [qp.inequality_names[i] for i in conflicting_rows(qp.G @ space.A, qp.h - qp.G @ space.b)]
    if not rows:
        raise SolverError(f"the solver found {qp!r} infeasible, but a linear program finds a feasible point: borderline.")
    return InfeasibleError(
        "no point satisfies all rows. Given the equalities, these contradict each other: "
        + ", ".join(rows)
        + ". Loosen or drop any one of them.",
        rows,
    )
