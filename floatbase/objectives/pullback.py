"""Costs moved between spaces: pullbacks (15)(18), and a cost seen from fewer variables (19) in its
two readings.
"""

from __future__ import annotations

from floatbase._validation import as_instance
from floatbase.affine import Affine, Quadratic
from floatbase.dynamics import Block, FeasibleSpace
from floatbase.linear_algebra import null_space, svd_with_rank


def cost_on_space(
    space: FeasibleSpace,
    qdd: Quadratic | None = None,
    tau: Quadratic | None = None,
    forces: Quadratic | None = None,
) -> Quadratic:
    """(18) The sum of costs on q̈, τ and λ, each optional, as one cost on β;
    `cost.pullback(space.map)` moves one on all three.

    space: β -> (q̈, τ, λ), as from `feasible_space`.
    qdd, tau, forces: costs on vectors of shape (nv,), (d,) and (k,).
    """
    as_instance("space", space, FeasibleSpace)
    parts = (("qdd", qdd), ("tau", tau), ("forces", forces))
    costs = [
        as_instance(name, cost, Quadratic).pullback(space.map[name])
        for name, cost in parts
        if cost is not None
    ]
    return sum(costs, Quadratic.zero(space.dimension))


def minimum_norm_coordinates(space: FeasibleSpace, block: Block) -> Affine:
    """The β that (19) takes: the smallest β that gives a value of the block, β = V† (x - v)."""
    as_instance("space", space, FeasibleSpace)
    f = space.map[block]
    U, s, Vt, r = svd_with_rank(
        f.A, absolute=True
    )  # rows of orthonormal columns: what is below the tolerance is rounding
    V_pinv = (Vt[:r].T / s[:r]) @ U[:, :r].T
    return Affine(V_pinv, -V_pinv @ f.b)


def minimum_norm_pullback(cost: Quadratic, space: FeasibleSpace, block: Block) -> Quadratic:
    """(19) as written: the cost on β seen from one block, with the smallest β that gives the
    block's value.

    Answers "what does this motion cost, if everything it leaves open is set to zero in β?". That
    choice depends on the origin v of β and has no physical meaning where V of the block loses rank
    (four point feet: 12 columns, rank 6).
    """
    as_instance("cost", cost, Quadratic)
    return cost.pullback(minimum_norm_coordinates(space, block))


def argmin_coordinates(cost: Quadratic, space: FeasibleSpace, block: Block) -> Affine:
    """The β of least cost that gives a value of the block: β = V† (x - v) + N z*(x), N spanning
    what the block leaves open.

    Raises `InputError` where the cost has no minimum over what is left open.
    """
    as_instance("cost", cost, Quadratic)
    minimum_norm = minimum_norm_coordinates(space, block)
    return cost.argmin_over(null_space(space.map[block].A, absolute=True)) @ minimum_norm


def partial_minimum(cost: Quadratic, space: FeasibleSpace, block: Block) -> Quadratic:
    """(19) made honest: the cost on β seen from one block, minimised over what the block leaves
    free (a Schur complement).

    Answers "what does this motion cost at least?". Never above `minimum_norm_pullback`, and equal
    to it where V of the block has full column rank.
    """
    as_instance("cost", cost, Quadratic)
    return cost.pullback(argmin_coordinates(cost, space, block))
