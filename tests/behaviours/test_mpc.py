"""`HorizonQP` and `MPC`: the quadratic program, its predictions, and walks with flight."""

import copy
from typing import Any

import cvxpy as cp
import judges
import numpy as np
import numpy.typing as npt
import pytest
from messages import raises, refused
from scipy.linalg import expm

import floatbase as fb
from floatbase.behaviours import MPC, Gains, Gait, HorizonMotion, HorizonQP, Walk
from floatbase.control import Command
from floatbase.errors import InputError
from floatbase.friction import FrictionPolyhedron

PERIOD = 2e-3  # s
Problem = tuple[HorizonQP, tuple[Any, Any, Any, npt.NDArray[np.bool_]]]


def random_problem(seed: int, n: int = 6) -> Problem:
    """Return a horizon and its arguments, with flight in some intervals."""
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(3, 3))
    mass = rng.uniform(2.0, 60.0)
    horizon = HorizonQP(
        mass, 0.02 * mass * (half @ half.T + np.eye(3)), dt=rng.uniform(0.02, 0.05),
        mu=rng.uniform(0.2, 1.0),
    )  # fmt: skip
    reference = np.tile(0.2 * rng.normal(size=12), (n, 1)) + 0.02 * rng.normal(size=(n, 12))
    feet = rng.normal(size=(n, 4, 3)) * [0.3, 0.2, 0.05] - [0.0, 0.0, 0.4]
    stance = rng.random((n, 4)) < 0.6
    stance[rng.integers(n)] = False
    return horizon, (reference[0] + 0.1 * rng.normal(size=12), reference, feet, stance)


def forces_by_cvxpy(horizon: HorizonQP, problem: tuple[Any, ...]) -> npt.NDArray[np.floating[Any]]:
    """Return the forces of a horizon in which the states are variables, shape (n, m, 3)."""
    x, reference, feet, stance = problem
    n, m = stance.shape
    states, forces = cp.Variable((n, 12)), cp.Variable((n, 3 * m))
    weight = horizon.mass * horizon.gravity
    cost, rules, before = 0.0, [], x
    for k in range(n):
        c, s = np.cos(reference[k, 2]), np.sin(reference[k, 2])
        Rz = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        rate = np.zeros((13 + 3 * m, 13 + 3 * m))  # of (x, 1, λ)
        rate[0:3, 6:9], rate[3:6, 9:12] = Rz.T, np.eye(3)
        rate[11, 12] = -horizon.gravity
        for i, r in enumerate(feet[k]):
            part = slice(13 + 3 * i, 16 + 3 * i)
            turn = np.cross(r, np.eye(3)).T  # λ ↦ r × λ
            rate[6:9, part] = np.linalg.solve(Rz @ horizon.inertia @ Rz.T, turn)
            rate[9:12, part] = np.eye(3) / horizon.mass
            force = forces[k, 3 * i : 3 * i + 3]
            if stance[k, i]:
                rules += [cp.abs(force[:2]) <= horizon.mu * force[2]]
                rules += [force[2] >= 0.0, force[2] <= horizon.max_load * weight]
            else:
                rules += [force == 0.0]
        step = expm(horizon.dt * rate)[:12]
        rules += [states[k] == step[:, :12] @ before + step[:, 12] + step[:, 13:] @ forces[k]]
        before = states[k]
        cost += 0.5 * cp.sum_squares(
            cp.multiply(np.sqrt(horizon.state_weights), states[k] - reference[k])
        )
    cost += 0.5 * horizon.force_weight / weight**2 * cp.sum_squares(forces)
    cp.Problem(cp.Minimize(cost), rules).solve(
        solver="CLARABEL", tol_gap_abs=1e-11, tol_gap_rel=1e-11, tol_feas=1e-11
    )
    return np.asarray(forces.value).reshape(n, m, 3)


@pytest.mark.parametrize("seed", range(6))
def test_the_forces_are_those_of_an_independent_formulation(seed):
    horizon, problem = random_problem(seed)
    expected = forces_by_cvxpy(horizon, problem)[problem[3]].ravel()
    forces = horizon.solve(*problem).forces
    weight = horizon.mass * horizon.gravity
    assert np.abs(forces[problem[3]].ravel() - expected).max() < 1e-5 * weight
    assert not forces[~problem[3]].any()
    normal, sideways = forces[..., 2:], np.abs(forces[..., :2])
    assert np.all(sideways <= horizon.mu * normal + 1e-6 * weight)
    assert np.all(normal <= horizon.max_load * weight * (1.0 + 1e-9))


@pytest.mark.parametrize("seed", range(3))
def test_the_states_are_those_of_the_matrix_exponential(seed):
    horizon, (x, reference, feet, stance) = random_problem(seed)
    motion = horizon.solve(x, reference, feet, stance)
    for k, forces in enumerate(motion.forces):
        c, s = np.cos(reference[k, 2]), np.sin(reference[k, 2])
        Rz = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        rate = np.zeros((13, 13))  # of (x, 1)
        rate[0:3, 6:9], rate[3:6, 9:12] = Rz.T, np.eye(3)
        moment = np.cross(feet[k], forces).sum(axis=0)
        rate[6:9, 12] = np.linalg.solve(Rz @ horizon.inertia @ Rz.T, moment)
        rate[9:12, 12] = forces.sum(axis=0) / horizon.mass - [0.0, 0.0, horizon.gravity]
        x = (expm(horizon.dt * rate) @ [*x, 1.0])[:12]
        assert np.allclose(motion.states[k], x, atol=1e-9)


def test_a_horizon_checks_its_arguments():
    horizon, (x, reference, feet, stance) = random_problem(0)
    ragged = [[True], [True, False]]
    for call, *named in (
        (lambda: HorizonQP(1.0, -np.eye(3)), "inertia", "positive definite"),
        (lambda: HorizonQP(1.0, np.eye(3), state_weights=-np.ones(12)), "state_weights"),
        (lambda: horizon.solve(x, reference, feet, stance.astype(float)), "stance", "bool"),
        (lambda: horizon.solve(x, reference, feet, ragged), "stance", "bool"),
        (lambda: horizon.solve(x, reference, feet[:-1], stance), "feet"),
        (lambda: horizon.solve(x, reference[:0], feet[:0], stance[:0]), "reference"),
    ):
        refused(call, InputError, *named)


class Observed:
    """A controller that records its commands and the solutions of its horizon."""

    def __init__(self, walk: MPC):
        self.walk, self.robot = walk, walk.robot
        self.commands: list[Command] = []
        self.motions: dict[float, HorizonMotion] = {}

    @property
    def contacts(self) -> fb.Contacts:
        return self.walk.contacts

    def __call__(self, q: npt.ArrayLike, v: npt.ArrayLike, t: float) -> Command:
        before, command = self.walk.motion, self.walk(q, v, t)
        self.commands.append(command)
        if self.walk.motion is not before and self.walk.motion is not None:
            self.motions[t] = self.walk.motion
        return command


def walked(
    name: str, gait: Gait, velocity: float, duration: float, **options: Any
) -> tuple[fb.Rollout, Observed]:
    robot = judges.load(name)
    observed = Observed(
        MPC(robot, fb.Contacts.feet(robot, mu=0.6), gait, (velocity, 0.0), **options)
    )
    return fb.rollout(fb.Simulation(robot), observed, duration, control_period=PERIOD), observed


@pytest.fixture(scope="module")
def flying() -> tuple[fb.Rollout, Observed]:
    return walked("go2", Gait.flying_trot(judges.load("go2"), start=0.2), 0.5, 2.0)


def test_a_flying_trot_reaches_its_speed_on_the_compiled_backend(flying):
    run, observed = flying
    assert run.outcome == "completed"
    last_second = run.time >= 1.0
    x, t = run.com[last_second, 0], run.time[last_second]
    assert (x[-1] - x[0]) / (t[-1] - t[0]) == pytest.approx(0.5, rel=0.05)
    assert {command.backend for command in observed.commands} == {"compiled"}
    flights = [i for i in range(len(run)) if len(run.contacts_at(i)) == 0]
    assert len(flights) > 0.15 * len(run)
    # the horizon is solved at 50 Hz, and at each change of stance
    assert 90 < len(observed.motions) < 150


@pytest.mark.parametrize("name", ["solo12", "anymal_kinova"])
def test_other_robots_pronk_with_the_same_numbers(name):
    run, _ = walked(name, Gait.pronk(judges.load(name), 0.2, 0.2, start=0.2), 0.2, 1.6)
    assert run.outcome == "completed"
    assert max(np.rad2deg(np.arccos(1 - 2 * (run.q[:, 3:5] ** 2).sum(axis=1)))) < 10.0
    feet = run.foot_positions[:, :, 2]
    assert (feet - feet[0]).min(axis=1).max() > 0.01  # m, of the lowest foot


@pytest.mark.parametrize("facets", [3, 4, 6, 8, 16])
@pytest.mark.parametrize("rotation", [0.0, 0.3])
def test_the_corners_of_the_horizons_pyramid_are_inside_the_controllers_polyhedron(
    facets, rotation, go2
):
    walk = MPC(
        go2, fb.Contacts.feet(go2, mu=0.6), Gait.trot(go2), facets=facets,
        facet_rotation=rotation,
    )  # fmt: skip
    mu = walk.horizon.mu
    polyhedron = FrictionPolyhedron([0.0, 0.0, 1.0], 0.6, facets, facet_rotation=rotation)
    corners = [[x * mu, y * mu, 1.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
    margins = [polyhedron.margin(corner) for corner in corners]
    assert min(margins) == pytest.approx(0.0, abs=1e-12)  # as large as possible
    assert np.hypot(mu, mu) <= 0.6 + 1e-12  # inside the cone


def test_the_force_task_follows_the_gains(go2):
    contacts, gait = fb.Contacts.feet(go2, mu=0.6), Gait.trot(go2, start=0.1)
    diagonals: list[list[npt.NDArray[Any]]] = []

    def record(qp: fb.QP, eom: Any) -> fb.QP:
        diagonals[-1].append(np.diag(qp.H)[-eom.k :])  # the forces are the last variables
        return qp

    for gains in (None, Gains(com=(100.0, 30.0))):
        diagonals.append([])
        walk = MPC(go2, contacts, gait, gains=gains, modify_qp=record)
        walk(go2.standing().q, np.zeros(go2.nv))
    one, three = (found[-1] for found in diagonals)
    assert three == pytest.approx(3.0 * one)
    assert np.all(one >= 0.02 * 10.0 / go2.mass**2)
    with raises(InputError, "gains"):
        MPC(go2, contacts, gait, gains=3.0)


@pytest.mark.parametrize(
    ("n", "bounce", "outcome"),
    [(1, True, "completed"), (1, False, "fell"), (3, False, "completed")],
)
def test_a_pronk_needs_a_horizon_or_a_reference_that_bounces(n, bounce, outcome):
    gait = Gait.pronk(judges.load("go2"), 0.2, 0.2, start=0.2)
    assert walked("go2", gait, 0.3, 1.4, n=n, bounce=bounce)[0].outcome == outcome


def test_copies_and_restarts_give_the_same_torques(go2):
    walk = MPC(go2, fb.Contacts.feet(go2, mu=0.6), Gait.trot(go2, start=0.0), (0.3, 0.0))
    runs = [
        fb.rollout(fb.Simulation(go2), each, 0.5, control_period=PERIOD)
        for each in (walk, walk, copy.deepcopy(walk))
    ]
    assert all(np.array_equal(run.tau, runs[0].tau) for run in runs)


def test_walk_refuses_flight_and_mpc_refuses_soles(go2, talos):
    contacts = fb.Contacts.feet(go2)
    with raises(InputError, "MPC"):
        Walk(go2, contacts, Gait.flying_trot(go2))
    with raises(InputError, "flat foot", "left_sole_link"):
        MPC(talos, fb.Contacts.feet(talos), Gait.walk(talos))
    with raises(InputError, "solve_period", "0.05"):
        MPC(go2, contacts, Gait.trot(go2), solve_period=0.05)
    with raises(InputError, "bounce", "no"):
        MPC(go2, contacts, Gait.pronk(go2), bounce="no")
