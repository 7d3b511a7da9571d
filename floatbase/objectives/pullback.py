"""Pullbacks of costs between spaces: costs on coordinates, and costs on a single block."""

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
    """Add costs on q̈, τ and λ, and pull them back to one cost on β.

    For a cost on all three together, use `cost.pullback(space.map)`.

    Parameters
    ----------
    space : FeasibleSpace
        Map from β to (q̈, τ, λ), such as `fb.feasible_space(eom)`.
    qdd : Quadratic, optional
        Cost on q̈, shape (nv,).
    tau : Quadratic, optional
        Cost on τ, shape (d,).
    forces : Quadratic, optional
        Cost on λ, shape (k,).

    Returns
    -------
    Quadratic
        Sum of the costs as a function of β.

    Notes
    -----
    [FBR]_, eq. (18).
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
    """Compute the smallest β for a value x of one block, β = V† (x - v).

    Parameters
    ----------
    space : FeasibleSpace
        Space of feasible (q̈, τ, λ).
    block : {"qdd", "tau", "forces"}
        Block of (q̈, τ, λ) that x belongs to.

    Returns
    -------
    Affine
        Map from x to the β that eq. (19) uses.
    """
    as_instance("space", space, FeasibleSpace)
    f = space.map[block]
    # part of orthonormal columns: singular values below the tolerance are rounding
    U, s, Vt, r = svd_with_rank(f.A, absolute=True)
    V_pinv = (Vt[:r].T / s[:r]) @ U[:, :r].T
    return Affine(V_pinv, -V_pinv @ f.b)


def minimum_norm_pullback(cost: Quadratic, space: FeasibleSpace, block: Block) -> Quadratic:
    """Express a cost on β as a cost on one block, using the smallest β for each value.

    The result answers the question "What does this motion cost if everything that it leaves open is
    set to zero in β?" This choice depends on the origin v of β. The result has no physical meaning
    where V of the block loses rank, as for four point feet with 12 columns and rank 6. See
    `partial_minimum` for the least cost.

    Parameters
    ----------
    cost : Quadratic
        Cost on β, such as `cost_on_space(…)`.
    space : FeasibleSpace
        Space of feasible (q̈, τ, λ).
    block : {"qdd", "tau", "forces"}
        Block of (q̈, τ, λ) on which the result depends.

    Returns
    -------
    Quadratic
        Cost on the block.

    Notes
    -----
    [FBR]_, eq. (19), as written.
    """
    as_instance("cost", cost, Quadratic)
    return cost.pullback(minimum_norm_coordinates(space, block))


def argmin_coordinates(cost: Quadratic, space: FeasibleSpace, block: Block) -> Affine:
    """Compute the β of least cost for a value x of one block, β = V† (x - v) + N z*(x).

    The columns of N span the directions of β that the block leaves open.

    Parameters
    ----------
    cost : Quadratic
        Cost on β, such as `cost_on_space(…)`.
    space : FeasibleSpace
        Space of feasible (q̈, τ, λ).
    block : {"qdd", "tau", "forces"}
        Block of (q̈, τ, λ) that x belongs to.

    Returns
    -------
    Affine
        Map from x to β.

    Raises
    ------
    InputError
        If the cost has no minimum over the directions left open.
    """
    as_instance("cost", cost, Quadratic)
    minimum_norm = minimum_norm_coordinates(space, block)
    return cost.argmin_over(null_space(space.map[block].A, absolute=True)) @ minimum_norm


def partial_minimum(cost: Quadratic, space: FeasibleSpace, block: Block) -> Quadratic:
    """Express a cost on β as the least cost for each value of one block (a Schur complement).

    The result answers the question "What does this motion cost at least?" The cost is at most
    `minimum_norm_pullback`, and equal to it where V of the block has full column rank.

    Parameters
    ----------
    cost : Quadratic
        Cost on β, such as `cost_on_space(…)`.
    space : FeasibleSpace
        Space of feasible (q̈, τ, λ).
    block : {"qdd", "tau", "forces"}
        Block of (q̈, τ, λ) on which the result depends.

    Returns
    -------
    Quadratic
        Cost on the block.

    Raises
    ------
    InputError
        If the cost has no minimum over the directions left open.

    Notes
    -----
    [FBR]_, eq. (19), with a minimum over β in place of the smallest β. A partial minimum of a
    quadratic function is a Schur complement [Boyd2004]_.
    """
    as_instance("cost", cost, Quadratic)
    return cost.pullback(argmin_coordinates(cost, space, block))
