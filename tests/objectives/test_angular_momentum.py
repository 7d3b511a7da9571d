"""The angular momentum task, against finite differences of Pinocchio's centroidal momentum."""

import judges
import numpy as np
import pinocchio as pin
from messages import refused

import floatbase as fb
from floatbase.errors import InputError
from floatbase.objectives import AngularMomentumTask

STEP = 1e-5  # s
robot = judges.every_robot
PENDULUM = """<robot name="pendulum"><link name="wall"/><link name="bob"><inertial>
<origin xyz="0 0 -0.5"/><mass value="1"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="wall"/><child link="bob"/><axis xyz="0 1 0"/>
<limit effort="10" velocity="10" lower="-1" upper="1"/></joint></robot>"""


def angular_momentum(state: fb.State) -> np.ndarray:
    model = state.robot.model
    momentum = pin.computeCentroidalMomentum(model, model.createData(), state.q, state.v)
    return np.array(momentum.angular)


def test_the_residual_is_the_rate_of_the_angular_momentum_less_the_desired_one(robot):
    for seed, state in enumerate(judges.states(robot.name, 3)):
        rng = np.random.default_rng(seed)
        eom = fb.equations_of_motion(state, judges.stance(state.robot))
        qdd, (target, rate) = rng.normal(size=eom.nv), rng.normal(size=(2, 3))
        speeds = [(judges.moved(state, qdd, t), state.v + t * qdd) for t in (STEP, -STEP)]
        after, before = (angular_momentum(there.replace(v=v)) for there, v in speeds)
        desired = rate - 3.0 * (angular_momentum(state) - target)
        expected = (after - before) / (2.0 * STEP) - desired
        for given in ((target, rate), (lambda t, both=(target, rate): both,)):
            found = AngularMomentumTask(*given, kd=3.0).residual(eom)(qdd)
            assert np.max(np.abs(found - expected)) < 1e-5 * (1.0 + np.max(np.abs(expected)))


def test_in_the_air_no_torque_changes_the_angular_momentum():
    state = judges.load("go2").random_state(0)
    eom = fb.equations_of_motion(state, fb.Contacts.none())
    residual = AngularMomentumTask(kd=2.0).residual(eom)
    qdd = eom.acceleration(np.ones(eom.d), np.zeros(0))
    assert np.allclose(residual(qdd), 2.0 * angular_momentum(state), atol=1e-9)


def test_one_joint_has_an_angular_momentum_too(tmp_path):
    """Pinocchio's matrices of one joint have one dimension less."""
    urdf = tmp_path / "pendulum.urdf"
    urdf.write_text(PENDULUM)
    robot = fb.load_urdf(urdf, floating=False)
    state = fb.State(robot, [0.3], [2.0])
    eom = fb.equations_of_motion(state, fb.Contacts.none())
    residual = AngularMomentumTask(kd=2.0).residual(eom)
    # about its own centre of mass a bob on a rod turns with its inertia alone
    assert np.allclose(residual([3.0]), [0.0, 0.1 * 3.0 + 2.0 * 0.1 * 2.0, 0.0], atol=1e-12)


def test_a_state_is_as_it_was_after_the_residual():
    """The residual is computed in the memory that holds the state's other results."""
    for state in judges.states("go2", 3):
        fresh = state.replace()
        _ = state.frame_jacobian("base"), state.M
        AngularMomentumTask().residual(fb.equations_of_motion(state, fb.Contacts.none()))
        for ask in ("frame_jacobian", "frame_velocity", "frame_drift", "point"):
            expected = getattr(fresh, ask)("FL_foot")
            AngularMomentumTask().residual(fb.equations_of_motion(state, fb.Contacts.none()))
            assert np.allclose(getattr(state, ask)("FL_foot"), expected, rtol=0.0, atol=1e-12), ask
        assert np.allclose(state.com_drift, fresh.com_drift, rtol=0.0, atol=1e-12)


def test_bad_targets_are_refused_by_name():
    both = {"momentum": lambda t: np.zeros(3), "rate": np.ones(3)}
    refused(lambda: AngularMomentumTask(**both), InputError, "momentum", "rate")
