"""The answer to a `QP`: the minimiser, its multipliers, and the residuals that show it is one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from floatbase._validation import Array, Value, cached_property, read_only
from floatbase.errors import InputError
from floatbase.linear_algebra import RANK_TOLERANCE, row_norms
from floatbase.qp.problem import QP

# part of the largest slope above which a multiplier counts: what solvers leave on rows that touch
_ACTIVE_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Residuals:
    """What a solution leaves of each optimality condition; all are 0 at an exact optimum.

    stationarity: max |H x + g + Aᵀ ν + Gᵀ μ|.
    equality: max |A x - b|.
    inequality: max(G x - h, 0).
    complementarity: max |μ (G x - h)|.
    dual: max(-μ, 0).
    """

    stationarity: float
    equality: float
    inequality: float
    complementarity: float
    dual: float


@dataclass(frozen=True, eq=False)
class Solution(Value):
    """The minimiser of a QP and the multipliers that prove it: H x + g + Aᵀ ν + Gᵀ μ = 0.

    qp: the problem.
    x: (n,), the minimiser.
    inequality_multipliers: μ ≥ 0, (l,).
    solver: name of the back end that answered.
    iterations: the solver's own count, 0 where it has none.
    """

    qp: QP
    x: Array
    inequality_multipliers: Array
    solver: str
    iterations: int = 0

    def __post_init__(self) -> None:
        for name in ("x", "inequality_multipliers"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @cached_property
    def equality_multipliers(self) -> Array:
        """ν, shape (m,): follows from stationarity, by least squares."""
        qp = self.qp
        slope, size = qp.H @ self.x + qp.g + qp.G.T @ self.inequality_multipliers, row_norms(qp.A)
        return read_only(
            np.linalg.lstsq((qp.A / size[:, None]).T, -slope, rcond=RANK_TOLERANCE)[0] / size
        )

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
        """Names of the active inequality rows: those whose multiplier counts beside the slopes that
        it balances.
        """
        qp, scaled = self.qp, self.inequality_multipliers * self.qp.row_norms
        slopes = np.concatenate([qp.g, qp.H @ self.x, scaled])
        is_active = scaled > _ACTIVE_TOLERANCE * np.max(np.abs(slopes), initial=0.0)
        return tuple(qp.inequality_names[i] for i in np.flatnonzero(is_active))

    @property
    def multipliers(self) -> dict[str, float]:
        """Multiplier of each active inequality row, by name: what one unit more in h would lower
        the objective by.
        """
        mu = dict(zip(self.qp.inequality_names, self.inequality_multipliers, strict=True))
        return {name: float(mu[name]) for name in self.active}

    @property
    def objective(self) -> float:
        """The smallest value."""
        return self.qp.objective(self.x)

    def __getitem__(self, block: str) -> Array:
        """One named block of x."""
        if not isinstance(block, str) or block not in self.qp.blocks:
            raise InputError(
                f"this problem has no block {block!r}; its blocks are {list(self.qp.blocks)}."
            )
        return self.x[self.qp.blocks[block]]
