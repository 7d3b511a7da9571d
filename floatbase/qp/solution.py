"""Solutions of QPs: the minimizer, its multipliers, and the residuals that prove optimality."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from floatbase._validation import Array, Value, cached_property, read_only, short_repr
from floatbase.errors import InputError
from floatbase.linear_algebra import RANK_TOLERANCE, row_norms
from floatbase.qp.conflicts import violation_tolerance
from floatbase.qp.problem import QP

# fraction of the largest slope above which a multiplier counts: solvers leave less on touching rows
_ACTIVE_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Residuals:
    """Residuals of the optimality conditions; all are 0 at an exact optimum.

    Parameters
    ----------
    stationarity : float
        Largest magnitude in H x + g + Aᵀ ν + Gᵀ μ [units of g].
    equality : float
        Largest magnitude in A x - b [units of b].
    inequality : float
        Largest positive entry of G x - h in the hard inequalities, or 0 [units of h].
    complementarity : float
        Largest magnitude in μ (G x - h), entry by entry; (w - μ) (G x - h) for soft inequalities
        that are violated [units of the objective].
    dual : float
        Largest positive entry of -μ, or of μ - w, or 0 [units of μ].
    """

    stationarity: float
    equality: float
    inequality: float
    complementarity: float
    dual: float


@dataclass(frozen=True, eq=False)
class Solution(Value):
    """The minimizer of a QP, with the multipliers that prove it: H x + g + Aᵀ ν + Gᵀ μ = 0.

    Parameters
    ----------
    qp : QP
        The problem.
    x : ndarray, shape (n,)
        The minimizer.
    inequality_multipliers : ndarray, shape (l,)
        Multipliers μ ≥ 0 of the inequalities; at most the penalties of soft ones.
    solver : str
        Name of the solver that found the solution.
    iterations : int
        Number of iterations that the solver reports; 0 if it reports none.
    earlier_violations : mapping of str to float, optional
        Violations of soft inequalities in a QP of higher priority, whose h this problem has relaxed
        accordingly [units of h].
    earlier_multipliers : mapping of str to float, optional
        Multipliers of inequalities that are active in a QP of higher priority, and are equality
        constraints of this problem.
    """

    qp: QP
    x: Array
    inequality_multipliers: Array
    solver: str
    iterations: int = 0
    earlier_violations: Mapping[str, float] = field(default_factory=dict)
    earlier_multipliers: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("x", "inequality_multipliers"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @cached_property
    def equality_multipliers(self) -> Array:
        """Multipliers ν of the equalities, shape (m,), from stationarity by least squares."""
        qp = self.qp
        slope, size = qp.H @ self.x + qp.g + qp.G.T @ self.inequality_multipliers, row_norms(qp.A)
        return read_only(
            np.linalg.lstsq((qp.A / size[:, None]).T, -slope, rcond=RANK_TOLERANCE)[0] / size
        )

    @cached_property
    def residuals(self) -> Residuals:
        """Residuals of the optimality conditions, computed from the problem itself."""
        qp, mu = self.qp, self.inequality_multipliers
        slack = qp.G @ self.x - qp.h
        weights = np.full(len(mu), np.inf) if qp.penalties is None else qp.penalties
        products = mu * slack
        violated = qp.soft[slack[qp.soft] > 0.0]
        products[violated] = (weights - mu)[violated] * slack[violated]
        slack[violated] = 0.0
        slope = qp.H @ self.x + qp.g + qp.A.T @ self.equality_multipliers + qp.G.T @ mu
        return Residuals(
            stationarity=float(np.max(np.abs(slope), initial=0.0)),
            equality=float(np.max(np.abs(qp.A @ self.x - qp.b), initial=0.0)),
            inequality=float(np.max(slack, initial=0.0)),
            complementarity=float(np.max(np.abs(products), initial=0.0)),
            dual=float(max(np.max(-mu, initial=0.0), np.max(mu - weights, initial=0.0))),
        )

    @cached_property
    def active(self) -> tuple[str, ...]:
        """Names of the active inequality constraints.

        A constraint is active if its multiplier is significant compared with the slopes it
        balances.
        """
        qp, scaled = self.qp, self.inequality_multipliers * self.qp.row_norms
        slopes = np.concatenate([qp.g, qp.H @ self.x, scaled])
        is_active = scaled > _ACTIVE_TOLERANCE * np.max(np.abs(slopes), initial=0.0)
        found = (qp.inequality_names[i] for i in np.flatnonzero(is_active))
        return tuple(dict.fromkeys([*self.earlier_multipliers, *found]))

    @property
    def multipliers(self) -> dict[str, float]:
        """Multiplier of each active inequality constraint, by name.

        To first order, raising the constraint's entry of h by one unit lowers the objective by this
        much. With priorities, this is the objective of the first level in which it is active.
        """
        mu = dict(zip(self.qp.inequality_names, self.inequality_multipliers, strict=True))
        return {name: float({**mu, **self.earlier_multipliers}[name]) for name in self.active}

    @property
    def violations(self) -> dict[str, float]:
        """Violation of each violated soft inequality, by name [units of h]."""
        qp = self.qp
        size = qp.row_norms[qp.soft]
        excess = (qp.G @ self.x - qp.h)[qp.soft]
        violated = excess > size * violation_tolerance(qp.h[qp.soft] / size, self.x)
        return {
            **self.earlier_violations,
            **{
                qp.inequality_names[i]: float(amount)
                for i, amount in zip(qp.soft[violated], excess[violated], strict=True)
            },
        }

    @property
    def objective(self) -> float:
        """Value of the objective at the minimizer, without penalties."""
        return self.qp.objective(self.x)

    def __getitem__(self, block: str) -> Array:
        """Return one named block of x."""
        if not isinstance(block, str) or block not in self.qp.blocks:
            raise InputError(
                f"This problem has no block {short_repr(block)}. Its blocks are "
                f"{list(self.qp.blocks)}."
            )
        return self.x[self.qp.blocks[block]]
