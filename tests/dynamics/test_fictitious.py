"""App. A: the parts of h, and straight paths seen from a rotating frame.

MuJoCo without gravity, finite differences and the energy give the expected results.
"""

import judges
import mujoco
import numpy as np
import scipy.integrate

import floatbase as fb
from floatbase.dynamics import bias_forces, coriolis_matrix, view_from_rotating_frame

N = 5


robot = judges.every_robot


def test_the_parts_sum_to_h(robot):
    for state in judges.states(robot.name, N, spread=1.0):
        parts = bias_forces(state)
        assert judges.relative(parts.total, state.h) < 1e-12
        assert np.array_equal(parts.fictitious, parts.centrifugal + parts.coriolis)


def test_velocity_forces_are_those_of_mujoco_with_gravity_switched_off(robot):
    judge = judges.Mujoco(robot)
    judge.model.opt.gravity[:] = 0.0
    for state in judges.states(robot.name, N, spread=1.0):
        assert judges.relative(bias_forces(state).fictitious, judge.move_to(state).h) < 1e-8


def test_in_the_worlds_axes_they_are_those_of_mujoco_too_whose_base_velocity_is_in_the_world(robot):
    """In MuJoCo, the linear velocity of a free joint is in world axes, and the angular velocity in
    the axes of the base.
    """
    judge = judges.Mujoco(robot)
    judge.model.opt.gravity[:] = 0.0
    for state in judges.states(robot.name, N, spread=1.0):
        raw = judge.move_to(state).data.qfrc_bias
        to_raw = judge.T.copy()  # maps velocities from our order to MuJoCo's
        if state.robot.is_floating:
            R = state.frame_pose("base").rotation
            to_raw[:3, :3], to_raw[3:6, 3:6] = np.eye(3), R.T
        assert judges.relative(bias_forces(state, axes="world").fictitious, to_raw.T @ raw) < 1e-8


def test_axes_do_not_change_the_acceleration_nor_the_parts_of_a_robot_that_is_bolted_down(robot):
    """World acceleration of the base if h alone acts: M q̈ = -h in base axes, Tᵀ M T u̇ = -h in
    world axes.
    """
    for state in judges.states(robot.name, N, spread=1.0):
        own, world = bias_forces(state), bias_forces(state, axes="world")
        if not state.robot.is_floating:
            assert np.array_equal(own.total, world.total)
            assert np.array_equal(own.coriolis, world.coriolis)
            continue
        R, nv = state.frame_pose("base").rotation, state.robot.nv
        T = np.eye(nv)
        T[:3, :3] = T[3:6, 3:6] = R.T
        qdd = np.linalg.solve(state.M, -own.total)
        u_dot = np.linalg.solve(T.T @ state.M @ T, -world.total)
        turning = np.cross(state.v[3:6], state.v[:3])
        expected = np.concatenate([R @ (qdd[:3] + turning), R @ qdd[3:6], qdd[6:]])
        assert judges.relative(u_dot, expected) < 1e-8
        assert np.allclose(world.gravity, T.T @ own.gravity)


def test_gravity_is_the_slope_of_the_weights_potential_energy(robot):
    """MuJoCo computes the potential energy."""
    judge = judges.Mujoco(robot)
    judge.model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY

    def potential(state: fb.State) -> np.ndarray:
        mujoco.mj_energyPos(judge.model, judge.move_to(state).data)
        return np.array([judge.data.energy[0]])

    for state in judges.states(robot.name, 2):
        slope = judges.jacobian_of(potential, state)[0]
        assert judges.relative(bias_forces(state).gravity, slope) < 1e-5


def test_coriolis_forces_are_the_products_of_two_different_velocities(robot):
    """Sum over i < j of the forces that need both velocities, by MuJoCo without gravity."""
    state = robot.random_state(4, spread=1.0)
    judge = judges.Mujoco(state.robot)
    judge.model.opt.gravity[:] = 0.0

    def felt(v: np.ndarray) -> np.ndarray:
        return judge.move_to(state.replace(v=v)).h

    parts = np.diag(state.v)
    alone = [felt(part) for part in parts]
    both = [(i, j) for i in range(len(parts)) for j in range(i)]
    pairs = sum(felt(parts[i] + parts[j]) - alone[i] - alone[j] for i, j in both)
    assert judges.relative(bias_forces(state).coriolis, pairs) < 1e-8
    assert judges.relative(bias_forces(state).centrifugal, sum(alone)) < 1e-8


def test_the_coriolis_matrix_gives_the_velocity_forces(robot):
    for state in judges.states(robot.name, N, spread=1.0):
        found = coriolis_matrix(state) @ state.v
        assert judges.relative(found, bias_forces(state).fictitious) < 1e-9


def test_inertia_changes_as_finite_differences_along_v_say(robot):
    for state in judges.states(robot.name, N, spread=1.0):
        differences = judges.derivative(lambda s: s.M, state, state.v, 1e-5)
        C = coriolis_matrix(state)
        assert judges.relative(C + C.T, differences) < 1e-6


# a particle seen from a rotating frame


def wandering(t: float) -> np.ndarray:
    """Return an angular velocity that changes in size and direction [rad/s]."""
    return np.array([np.sin(2.0 * t), 1.5 + 0.5 * t, np.cos(3.0 * t)])


def wandering_rate(t: float) -> np.ndarray:
    return np.array([2.0 * np.cos(2.0 * t), 0.5, -3.0 * np.sin(3.0 * t)])


def test_the_three_terms_explain_the_curved_path_whatever_the_frame_does():
    time = np.linspace(0.0, 2.0, 4001)
    start, speed = (0.4, -0.2, 0.7), (0.3, 0.5, -0.1)
    view = view_from_rotating_frame(time, wandering, start, speed, wandering_rate)
    dt = time[1] - time[0]
    velocity = (view.position[2:] - view.position[:-2]) / (2.0 * dt)
    acceleration = (view.position[2:] - 2.0 * view.position[1:-1] + view.position[:-2]) / dt**2
    assert np.max(np.abs(view.velocity[1:-1] - velocity)) < 1e-5
    assert np.max(np.abs(view.acceleration[1:-1] - acceleration)) < 2e-5
    # two of the three terms are not enough
    for term in (view.centrifugal, view.coriolis, view.euler):
        assert np.max(np.abs(term)) > 0.5


def test_the_frames_rotation_agrees_with_a_tight_integrator():
    def derivative(t: float, R: np.ndarray) -> np.ndarray:
        x, y, z = wandering(t)
        return (np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ R.reshape(3, 3)).ravel()

    time = np.linspace(0.0, 3.0, 7)
    view = view_from_rotating_frame(time, wandering, (1.0, 0.0, 0.0), omega_rate=wandering_rate)
    found = view.rotation
    exact = scipy.integrate.solve_ivp(
        derivative, (0.0, 3.0), np.eye(3).ravel(), t_eval=time, rtol=1e-12, atol=1e-13
    )
    assert np.max(np.abs(found.reshape(7, 9) - exact.y.T)) < 1e-8
    assert np.allclose(found @ found.transpose(0, 2, 1), np.eye(3), atol=1e-12)


def test_a_particle_at_rest_in_the_world_circles_backwards_in_a_frame_that_turns_evenly():
    """p' = (r cos ωt, -r sin ωt): the inward Coriolis acceleration is twice the outward centrifugal
    acceleration.
    """
    time = np.linspace(0.0, 5.0, 101)
    r, w = 0.8, 1.3
    view = view_from_rotating_frame(time, (0.0, 0.0, w), (r, 0.0, 0.2))
    circle = np.column_stack([r * np.cos(w * time), -r * np.sin(w * time), np.full(time.size, 0.2)])
    assert np.allclose(view.position, circle, atol=1e-12)
    outward = circle * [1.0, 1.0, 0.0]
    assert np.allclose(view.centrifugal, w**2 * outward, atol=1e-12)
    assert np.allclose(view.coriolis, -2.0 * w**2 * outward, atol=1e-12)
    assert np.array_equal(view.euler, np.zeros((101, 3)))
