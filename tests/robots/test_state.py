"""States: validated, immutable, and with frames in the world where MuJoCo has them."""

from concurrent.futures import ThreadPoolExecutor
from operator import attrgetter, methodcaller

import judges
import numpy as np
import pinocchio as pin
from hypothesis import given
from hypothesis import strategies as st

import floatbase as fb

N = 10


robot = judges.every_robot


def test_frames_lie_in_the_world_where_mujoco_has_them(robot):
    judge = judges.mujoco_of(robot.name)
    frames = [foot.frame for foot in robot.feet] + ["base", robot.frames[-1]]
    for state in judges.states(robot.name, N):
        judge.move_to(state)
        for frame in frames:
            placement = robot.model.frames[robot.frame_id(frame)].placement
            body = judge.body(frame)
            R, p = judge.data.xmat[body].reshape(3, 3), judge.data.xpos[body]
            assert np.allclose(state.frame_pose(frame).rotation, R @ placement.rotation, atol=1e-9)
            assert np.allclose(state.point(frame), p + R @ placement.translation, atol=1e-9)
            offset = np.array([0.1, -0.2, 0.3])
            local = placement.rotation @ offset + placement.translation
            assert np.allclose(state.point(frame, offset), p + R @ local, atol=1e-9)


def test_frame_jacobians_agree_with_mujoco_in_the_world_aligned_frame(robot):
    judge = judges.mujoco_of(robot.name)
    for state in judges.states(robot.name, N):
        judge.move_to(state)
        for frame in [foot.frame for foot in robot.feet] + ["base", robot.frames[-1]]:
            linear, angular = judge.jacobian(frame, state.point(frame))
            assert np.allclose(state.frame_jacobian(frame), np.vstack([linear, angular]), atol=1e-9)
            expected = np.concatenate([linear, angular]) @ state.v
            assert np.allclose(state.frame_velocity(frame), expected, atol=1e-9)


def test_frame_drift_is_the_change_of_j_v_along_v(robot):
    for state in judges.states(robot.name, N):
        for frame in [foot.frame for foot in robot.feet] + ["base", robot.frames[-1]]:
            expected = judges.drift_of(lambda s, f=frame: s.frame_jacobian(f), state)
            assert np.allclose(state.frame_drift(frame), expected, atol=1e-7), frame


def test_the_centre_of_mass_is_mujocos_and_its_jacobian_and_drift_are_its_derivatives(robot):
    judge = judges.mujoco_of(robot.name)
    for state in judges.states(robot.name, N):
        judge.move_to(state)
        # MuJoCo counts a fixed base's bolted links in, Pinocchio does not
        if judge.robot.is_floating:
            assert np.allclose(state.com, judge.data.subtree_com[1], atol=1e-9)
        expected = judges.jacobian_of(lambda s: s.com, state)
        assert np.allclose(state.com_jacobian, expected, atol=1e-7)
        velocity = judges.derivative(lambda s: s.com, state, state.v)
        assert np.allclose(state.com_velocity, velocity, atol=1e-7)
        drift = judges.drift_of(lambda s: s.com_jacobian, state)
        assert np.allclose(state.com_drift, drift, atol=1e-7)


def test_base_velocity_is_given_in_the_base_frame(go2):
    q = go2.standing().q.copy()
    q[3:7] = [0.0, 0.0, np.sin(np.pi / 4), np.cos(np.pi / 4)]  # a quarter turn about z
    v = np.zeros(go2.nv)
    v[0], v[3] = 1.0, 2.0  # forwards, and rolling about the body's own x
    state = fb.State(go2, q, v)
    assert np.allclose(state.frame_velocity("base"), [0.0, 1.0, 0.0, 0.0, 2.0, 0.0], atol=1e-12)


def test_the_base_quaternion_is_ordered_x_y_z_w(go2):
    q = go2.neutral().q.copy()
    q[3:7] = [np.sin(0.2), 0.0, 0.0, np.cos(0.2)]
    R = fb.State(go2, q).frame_pose("base").rotation
    assert np.allclose(R, judges.rotation([0.4, 0.0, 0.0]), atol=1e-12)


@given(seed=st.integers(0, 10_000), which=st.sampled_from(judges.ROBOTS))
def test_difference_undoes_integrate(seed, which):
    robot = judges.load(which)
    rng = np.random.default_rng(seed)
    state, dv = robot.random_state(seed), rng.uniform(-0.5, 0.5, robot.nv)
    reached = state.replace(q=state.integrate(dv))
    assert np.allclose(reached.difference(state.q), dv, atol=1e-9)
    assert not np.allclose(state.difference(reached.q), dv, atol=1e-3)


def test_a_state_computes_from_a_copy_and_gives_copies_of_its_poses(robot):
    q, v = robot.standing().q.copy(), np.zeros(robot.nv)
    state = fb.State(robot, q, v)
    com = state.com.copy()
    q += 1.0
    v += 1.0
    assert np.array_equal(fb.State(robot, state.q, state.v).com, com)
    pose = state.frame_pose("base")
    pose.translation = pose.translation + 1.0
    assert not np.allclose(state.frame_pose("base").translation, pose.translation)


def test_a_state_answers_the_same_in_any_order_of_questions(robot):
    """Pinocchio's algorithms write to one memory: none may change what another has left there."""
    parts = ("M", "h", "com", "com_velocity", "com_drift", "com_jacobian", "joint_transforms")
    questions = [attrgetter(part) for part in parts]
    for frame in ("base", robot.frames[-1]):
        asked = ("point", "frame_jacobian", "frame_velocity", "frame_drift")
        of_frame = (methodcaller(ask, frame) for ask in asked)
        questions += [*of_frame, lambda s, frame=frame: s.frame_pose(frame).homogeneous]
    alone = [[ask(robot.random_state(seed)) for ask in questions] for seed in (5, 6)]
    rng = np.random.default_rng(0)
    for _ in range(N):
        two, answers = (robot.random_state(5), robot.random_state(6)), []
        for i in rng.permutation(4 * len(questions)):  # each twice of both states, interleaved
            which, question = i % 2, i // 2 % len(questions)
            answers.append((questions[question](two[which]), alone[which][question]))
        assert all(np.array_equal(found, expected) for found, expected in answers)  # still so


def test_threads_may_ask_the_same_state(robot):
    states = [robot.random_state(seed) for seed in range(4)]
    expected = [robot.random_state(seed).frame_drift("base") for seed in range(4)]

    def ask(i):
        return np.array_equal(states[i % 4].frame_drift("base"), expected[i % 4])

    with ThreadPoolExecutor(4) as threads:
        assert all(threads.map(ask, range(400)))


def test_joint_transforms_are_where_mujoco_has_the_joints(robot):
    judge = judges.mujoco_of(robot.name)
    state = robot.random_state(1)
    judge.move_to(state)
    for joint in robot.joint_names:
        T = state.joint_transforms[robot.model.getJointId(joint)]
        body = int(judge.model.joint(joint).bodyid[0])
        assert np.allclose(T[:3, 3], judge.data.xpos[body], atol=1e-9)
        assert np.allclose(T[:3, :3], judge.data.xmat[body].reshape(3, 3), atol=1e-9)


def test_centroidal_matrix_and_drift_are_the_momentum_and_its_rate(robot):
    step = 1e-06
    state = robot.random_state(3, 0.3)

    def momentum(q):
        data = robot.model.createData()
        return pin.computeCentroidalMomentum(robot.model, data, q, state.v).vector

    after, before = (state.integrate(way * step * state.v) for way in (1, -1))
    rate = (momentum(after) - momentum(before)) / (2.0 * step)
    assert np.allclose(state.centroidal_matrix @ state.v, momentum(state.q), atol=1e-10)
    assert np.allclose(state.centroidal_drift, rate, atol=1e-5)
    linear = sum(inertia.mass for inertia in robot.model.inertias) * state.com_velocity
    assert robot.is_floating is False or np.allclose(
        state.centroidal_matrix[:3] @ state.v, linear, atol=1e-10
    )
