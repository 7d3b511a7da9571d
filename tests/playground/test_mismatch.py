"""Model mismatch, compared with Pinocchio's dynamics of another model and with the plan."""

import judges
import numpy as np
import pinocchio as pin
import pytest
from messages import raises

import floatbase as fb
from floatbase.dynamics import EquationsOfMotion
from floatbase.errors import InputError
from floatbase.playground import ModelMismatch
from floatbase.qp import solve

ROUNDING = 1e-9  # relative, of sums of forces of some 100 N


def moving(seed: int = 3) -> fb.State:
    state = judges.load("go2").random_state(seed, 0.1)
    return state.replace(v=np.random.default_rng(seed).normal(size=state.robot.nv))


def solved(
    mismatch: ModelMismatch, state: fb.State, **options: object
) -> tuple[EquationsOfMotion, dict[str, np.ndarray]]:
    robot, contacts = state.robot, judges.stance(state.robot)
    controller = fb.WholeBodyController(
        robot, contacts, fb.standing_tasks(robot.standing()), modify_qp=mismatch, **options
    )
    command = controller(state.q, state.v)
    assert command.backend == "compiled"
    found = {"qdd": command.qdd, "tau": command.tau, "forces": command.forces.ravel()}
    return fb.equations_of_motion(state, contacts), found


@pytest.mark.parametrize("seed", range(3))
def test_mass_and_the_parts_of_h_equal_those_of_another_model(seed):
    state = moving(seed)
    eom = fb.equations_of_motion(state, judges.stance(state.robot))
    heavy, data = state.robot.model.copy(), state.robot.model.createData()
    for i, inertia in enumerate(state.robot.model.inertias):
        heavy.inertias[i] = pin.Inertia(1.3 * inertia.mass, inertia.lever, 1.3 * inertia.inertia)
    assumed = ModelMismatch(mass=1.3).assumed_equations(eom)
    M = pin.crba(heavy, data, state.q)
    M = np.triu(M) + np.triu(M, 1).T
    h = pin.nonLinearEffects(heavy, heavy.createData(), state.q, state.v)
    rounding = ROUNDING * np.abs(h).max()
    assert np.allclose(assumed.M, M, rtol=0.0, atol=ROUNDING * np.abs(M).max())
    assert np.allclose(assumed.h, h, rtol=0.0, atol=rounding)
    weightless = state.robot.model.copy()
    weightless.gravity = pin.Motion.Zero()
    velocity = pin.nonLinearEffects(weightless, weightless.createData(), state.q, state.v)
    assumed = ModelMismatch(gravity=False).assumed_equations(eom)
    assert np.allclose(assumed.h, velocity, rtol=0.0, atol=rounding)
    model = state.robot.model
    still = pin.computeGeneralizedGravity(model, model.createData(), state.q)
    assumed = ModelMismatch(velocity_forces=False).assumed_equations(eom)
    assert np.allclose(assumed.h, still, rtol=0.0, atol=rounding)


def test_the_default_is_exact_and_changes_nothing():
    state = moving()
    controller = judges.controller_of("go2")
    qp, eom = controller.qp(state), fb.equations_of_motion(state, controller.contacts)
    assert ModelMismatch().is_exact and ModelMismatch()(qp, eom) is qp
    assert not ModelMismatch(drift=False).is_exact


def test_a_plan_without_drift_has_zero_a_qdd():
    eom, x = solved(ModelMismatch(drift=False), moving())
    assert np.allclose(eom.A @ x["qdd"], 0.0, atol=1e-8)
    assert np.abs(eom.b).max() > 0.1  # m/s²: the neglected drift


@pytest.mark.parametrize("name", ["go2", "talos", "ur5"])
def test_a_mismatch_is_compiled_as_the_reference_backend_solves_it(name):
    robot = judges.load(name)
    ignored = [foot.frame for foot in robot.feet[:1]]
    for options in (
        {"mass": 1.3}, {"mass": 0.8, "gravity": False}, {"drift": False, "velocity_forces": False},
        {"ignored_contacts": ignored}, {"underactuated": False}, {"cones": False},
        {"ignored_contacts": ignored, "underactuated": False, "cones": False, "mass": 0.9},
    ):  # fmt: skip
        both = judges.pair(robot, judges.stance(robot), modify_qp=ModelMismatch(**options))
        assert judges.largest_difference(both, judges.near_and_far(name, 2)) < 1e-7, options
        state = robot.random_state(1, 0.02)
        compiled, reference = (each(state.q, state.v).solution for each in both)
        assert np.allclose(compiled.qp.A, reference.qp.A)
        assert compiled.active == reference.active and compiled.residuals.stationarity < 1e-4


def test_a_subclass_of_a_mismatch_may_change_more_and_is_not_compiled():
    changed = type("More", (ModelMismatch,), {})()
    assert judges.controller_of("go2", modify_qp=changed).backend == "reference"


def test_an_ignored_contact_exerts_no_force_in_the_plan():
    eom, x = solved(ModelMismatch(ignored_contacts=["FR_foot"]), moving())
    part = eom.contacts.force_slice("FR_foot")
    others = np.array(x["forces"])
    others[part] = 0.0
    missing, _ = eom.residual(x["qdd"], x["tau"], others)
    assert np.allclose(missing, 0.0, atol=1e-6)


def test_a_plan_with_motors_of_the_base_satisfies_only_the_joint_rows():
    eom, x = solved(ModelMismatch(underactuated=False), moving())
    missing, _ = eom.residual(x["qdd"], x["tau"], x["forces"])
    assert np.allclose(missing[6:], 0.0, atol=1e-6)
    assert np.linalg.norm(missing[:3]) > 0.5 * eom.robot.weight, (
        "the base motors should carry the base, because torques cost"
    )


def test_feet_pull_in_a_plan_without_cones():
    robot, down = judges.load("go2"), np.array([0.0, 0.0, -30.0])
    state, contacts = robot.standing(), judges.stance(robot)
    tasks = [fb.CoMTask(state.com, acceleration=down), *fb.standing_tasks(state)[1:]]
    normals = {
        assumed: fb.WholeBodyController(
            robot, contacts, tasks, modify_qp=ModelMismatch(cones=assumed)
        )(state.q, state.v).forces.reshape(-1, 3)[:, 2]
        for assumed in (True, False)
    }
    assert normals[True].min() > -1e-6
    assert normals[False].sum() == pytest.approx(robot.mass * (9.81 - 30.0), rel=0.2)


def test_a_model_mismatch_survives_a_change_of_stance_and_a_walk():
    robot, mismatch = judges.load("go2"), ModelMismatch(mass=1.1)
    controller = fb.WholeBodyController(
        robot, judges.stance(robot), fb.standing_tasks(robot.standing()), modify_qp=mismatch
    )
    lifted = controller.replace(contacts=controller.contacts.without("FL_foot"))
    assert lifted.problem.modify_qp is mismatch and lifted.backend == "compiled"
    state = robot.standing()
    qp = lifted.qp(state)
    tau, forces = solve(qp)["tau"], solve(qp)["forces"]
    carried = forces.reshape(-1, 3)[:, 2].sum()
    assert np.all(np.isfinite(tau)) and carried == pytest.approx(1.1 * robot.weight, rel=0.05)


def test_a_single_name_is_refused_and_the_error_shows_a_list():
    with raises(InputError, "ignored_contacts", 'such as ["FR_foot"]'):
        ModelMismatch(ignored_contacts="FR_foot")
