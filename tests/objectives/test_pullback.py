"""Pullbacks of costs, eqs. (15), (18), (19), against direct minimization over all of (q̈, τ, λ)."""

import judges
import numpy as np
import pytest
from judges import Array
from messages import raises

import floatbase as fb
from floatbase import dynamics, objectives
from floatbase.dynamics import EquationsOfMotion, fixed_frame
from floatbase.errors import InputError

READINGS = (objectives.partial_minimum, objectives.minimum_norm_pullback)
BLOCKS = ("qdd", "tau", "forces")


def sizes(eom: EquationsOfMotion) -> dict[str, int]:
    return {"qdd": eom.nv, "tau": eom.d, "forces": eom.k}


def costs(eom: EquationsOfMotion, seed: int = 0) -> dict[str, tuple[Array, Array]]:
    """Draw a residual (A, r) on each block, random, square and well conditioned."""
    rng = np.random.default_rng(seed)
    weight = {"qdd": 1.0, "tau": 0.3, "forces": 0.1}
    found = {}
    for block, n in sizes(eom).items():
        Q = np.linalg.qr(rng.normal(size=(n, n)))[0] * rng.uniform(0.5, 2.0, n)
        found[block] = (weight[block] * Q, 5.0 * weight[block] * rng.normal(size=n))
    return found


def as_quadratics(residuals: dict[str, tuple[Array, Array]]) -> dict[str, fb.Quadratic]:
    return {block: fb.Quadratic.from_residual(A, r) for block, (A, r) in residuals.items()}


def least(eom, residuals, fixed=None):
    """Minimize the sum of ½‖A x - r‖² over all (q̈, τ, λ) with eq. (7) and some fixed blocks.

    Stationarity and feasibility are solved as one linear system and checked. A convex cost has its
    minimum where they hold.
    """
    n, ends = sizes(eom), np.cumsum([0, *sizes(eom).values()])
    at = {block: slice(*ends[i : i + 2]) for i, block in enumerate(n)}
    H, g = np.zeros((ends[-1], ends[-1])), np.zeros(ends[-1])
    for block, (A, r) in residuals.items():
        H[at[block], at[block]], g[at[block]] = A.T @ A, A.T @ r
    motion = np.hstack([eom.A, np.zeros((len(eom.A), eom.d + eom.k))])
    rows = [np.hstack([eom.M, -eom.S, -eom.J.T]), motion]
    sides = [-eom.h, eom.b]
    for block, value in (fixed or {}).items():
        rows.append(np.eye(ends[-1])[at[block]])
        sides.append(value)
    E, e = np.vstack(rows), np.concatenate(sides)
    kkt = np.block([[H, E.T], [E, np.zeros((len(E), len(E)))]])
    right = np.concatenate([g, e])
    found = np.linalg.lstsq(kkt, right, rcond=1e-12)[0]
    assert np.max(np.abs(kkt @ found - right)) < 1e-8 * np.max(np.abs(right))
    gaps = [A @ found[at[block]] - r for block, (A, r) in residuals.items()]
    return sum(0.5 * float(np.sum(gap**2)) for gap in gaps)


# (15)(18) -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", judges.FLOATING)
def test_a_cost_on_accelerations_seen_from_torques_is_the_cost_of_what_the_torques_do(name):
    """Eq. (15) at random torques, with the acceleration from one solution of the whole system."""
    rng = np.random.default_rng(0)
    for seed in (None, 0):
        eom = judges.at_rest(name, seed)
        cost = fb.Quadratic.from_residual(*costs(eom)["qdd"])
        seen = cost.pullback(fb.accelerations_from_torques(eom))
        for _ in range(5):
            tau = rng.normal(size=eom.d)
            kkt = np.block([[eom.M, -eom.J.T], [eom.A, np.zeros((len(eom.A), eom.k))]])
            right = np.concatenate([eom.S @ tau - eom.h, eom.b])
            qdd = np.linalg.lstsq(kkt, right, rcond=1e-11)[0][: eom.nv]
            assert seen(tau) == pytest.approx(cost(qdd), rel=1e-7)


@pytest.mark.parametrize("name", judges.FLOATING)
def test_a_cost_pulled_back_to_the_torques_has_the_least_value_over_everything(name):
    eom = judges.at_rest(name)
    residuals = {"qdd": costs(eom)["qdd"]}
    seen = as_quadratics(residuals)["qdd"].pullback(fb.accelerations_from_torques(eom))
    assert seen(seen.minimizer()) == pytest.approx(least(eom, residuals), rel=1e-6)


@pytest.mark.parametrize("name", judges.FLOATING)
@pytest.mark.parametrize("feet", [1, 4])
def test_costs_on_all_three_pulled_back_to_beta_have_their_least_value_over_everything(name, feet):
    """Eq. (18) with costs on q̈, τ and λ together."""
    eom = judges.at_rest(name, feet=feet)
    residuals = costs(eom)
    space = dynamics.feasible_space(eom)
    seen = objectives.cost_on_space(space, **as_quadratics(residuals))
    beta = seen.minimizer()
    assert seen(beta) == pytest.approx(least(eom, residuals), rel=1e-6)
    parts = zip(as_quadratics(residuals).values(), space(beta), strict=True)
    assert sum(cost(x) for cost, x in parts) == pytest.approx(seen(beta), rel=1e-9)


def test_costs_may_be_given_on_any_of_the_three_and_add_up():
    eom = judges.at_rest("go2", feet=3)
    space, parts = dynamics.feasible_space(eom), as_quadratics(costs(eom))
    beta = np.random.default_rng(0).normal(size=space.dimension)
    values = {b: objectives.cost_on_space(space, **{b: parts[b]})(beta) for b in BLOCKS}
    for block, x in zip(BLOCKS, space(beta), strict=True):
        assert values[block] == pytest.approx(parts[block](x), rel=1e-10)
    expected = sum(values.values())
    assert objectives.cost_on_space(space, **parts)(beta) == pytest.approx(expected, rel=1e-10)
    assert objectives.cost_on_space(space)(beta) == 0.0


# (19) ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", judges.FLOATING)
@pytest.mark.parametrize("block", BLOCKS)
@pytest.mark.parametrize("feet", [1, 2, 4])
def test_the_best_reading_is_the_least_that_a_value_of_the_block_can_cost(name, block, feet):
    """Every block, against the minimum with this block fixed and everything else free. The literal
    reading is never lower.
    """
    eom = judges.at_rest(name, feet=feet)
    residuals = costs(eom)
    space = dynamics.feasible_space(eom)
    cost = objectives.cost_on_space(space, **as_quadratics(residuals))
    best, smallest = (reading(cost, space, block) for reading in READINGS)
    rng = np.random.default_rng(0)
    for seed in range(2):
        x = space.map[block](3.0 * rng.normal(size=space.dimension))
        assert best(x) <= smallest(x) * (1 + 1e-9)
        if seed == 0:
            assert best(x) == pytest.approx(least(eom, residuals, {block: x}), rel=1e-6)
        beta = objectives.argmin_coordinates(cost, space, block)(x)
        assert np.allclose(space.map[block](beta), x, atol=1e-7 * max(1.0, np.abs(x).max()))


@pytest.mark.parametrize("name", judges.BALLS)
def test_the_two_readings_agree_where_the_block_determines_beta_and_differ_where_it_does_not(name):
    """V_q̈ has full column rank on one foot, but not on four. On four feet, the literal reading has
    a clearly higher cost.
    """
    for feet, agree in ((1, True), (4, False)):
        eom = judges.at_rest(name, 0, feet)
        space, found = dynamics.feasible_space(eom), dynamics.dimensions(eom)
        assert (found.rank_V_qdd == found.null_B) == agree
        cost = objectives.cost_on_space(space, **as_quadratics(costs(eom)))
        best, smallest = (reading(cost, space, "qdd") for reading in READINGS)
        rng = np.random.default_rng(0)
        for _ in range(4):
            x = space.qdd(rng.normal(size=space.dimension))
            assert (smallest(x) == pytest.approx(best(x), rel=1e-7)) == agree


def test_accelerations_that_cannot_change_do_not_determine_beta(go2):
    """go2 with a fixed base and feet on the ground: V_q̈ = 0 up to rounding, so the map from q̈ to
    β must not contain 1 / rounding.
    """
    contacts = fb.Contacts.points(go2) + fb.Contacts([fixed_frame("base")])
    eom = fb.equations_of_motion(go2.standing(), contacts)
    space = dynamics.feasible_space(eom)
    assert np.max(np.abs(space.qdd.A)) < 1e-10
    assert np.max(np.abs(objectives.minimum_norm_coordinates(space, "qdd").A)) < 1e6
    cost = objectives.cost_on_space(space, tau=fb.Quadratic.from_residual(np.eye(12), np.zeros(12)))
    found = objectives.partial_minimum(cost, space, "qdd")(np.zeros(18))
    assert found == pytest.approx(cost(cost.minimizer()), abs=1e-6)  # q̈ leaves everything free


def test_a_cost_that_falls_for_ever_over_what_the_block_leaves_free_is_refused():
    """A reward for internal forces has no minimum, and the error says so."""
    eom = judges.at_rest("go2")
    space = dynamics.feasible_space(eom)
    squeeze = dynamics.internal_forces(eom)[:, 0]
    reward = objectives.cost_on_space(space, forces=fb.Quadratic(np.zeros((12, 12)), -squeeze))
    for call in (objectives.partial_minimum, objectives.argmin_coordinates):
        with raises(InputError):
            call(reward, space, "qdd")
    assert np.isfinite(objectives.minimum_norm_pullback(reward, space, "qdd")(np.zeros(18)))


def test_directions_that_cost_nothing_are_left_alone():
    eom = judges.at_rest("go2")
    space = dynamics.feasible_space(eom)
    free = fb.Quadratic.zero(space.dimension)
    x = space.qdd(np.ones(space.dimension))
    smallest = objectives.minimum_norm_coordinates(space, "qdd")(x)
    assert np.allclose(objectives.argmin_coordinates(free, space, "qdd")(x), smallest)


def test_weights_ten_orders_apart_do_not_blind_the_best_reading():
    """A force cost of 1e-10 beside a torque cost of 1 still decides where the torque cost is
    constant.

    solo8 on four feet: null(Jᵀ) changes only forces, so the small weight decides there.
    """
    eom = judges.at_rest("solo8")
    space = dynamics.feasible_space(eom)
    desired = np.arange(12.0)
    for weight in (1e-2, 1e-6, 1e-10):
        tau = fb.Quadratic.from_residual(np.eye(8), np.zeros(8))
        forces = fb.Quadratic.from_residual(np.eye(12), desired, weight)
        cost = objectives.cost_on_space(space, tau=tau, forces=forces)
        beta = objectives.argmin_coordinates(cost, space, "qdd")(np.zeros(14))
        N = dynamics.undetermined_forces(eom)
        assert np.allclose(N.T @ (space.forces(beta) - desired), 0.0, atol=1e-3), weight
