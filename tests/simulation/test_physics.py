"""Gravity, pushes, motors, ground and measured forces obey Newton's laws."""

import judges
import mujoco
import numpy as np
import pinocchio as pin
import pytest

import floatbase as fb

G = np.array([0.0, 0.0, -9.81])


def flying(name: str, seed: int | None = None, height: float = 5.0, speed: float = 0.3) -> fb.State:
    """Return a robot high above the ground, at rest or tumbling, away from its joint limits.

    The joint limits dissipate energy.
    """
    robot = judges.load(name)
    state = robot.standing() if seed is None else robot.random_state(seed, speed)
    q = state.q.copy()
    q[2] += height
    low, high = robot.model.lowerPositionLimit[7:], robot.model.upperPositionLimit[7:]
    margin = np.minimum(0.1, 0.4 * (high - low))
    q[7:] = np.clip(q[7:], low + margin, high - margin)
    return fb.State(robot, q, state.v)


def energy(state: fb.State) -> float:
    """Return ½ vᵀ M v + m g z [J], with M from the judge."""
    robot = state.robot
    M = judges.mujoco_of(robot.name).move_to(state).M
    return float(0.5 * state.v @ M @ state.v) + robot.weight * float(state.com[2])


def angular_momentum(state: fb.State) -> np.ndarray:
    """Return the angular momentum about the centre of mass, world frame [N·m·s]."""
    model = state.robot.model
    return np.array(
        pin.computeCentroidalMomentum(model, model.createData(), state.q, state.v).angular
    )


robot = judges.every_floating_robot


def test_motors_change_neither_momentum_of_a_robot_in_the_air(robot):
    sim, rng = fb.Simulation(robot, timestep=2e-4), np.random.default_rng(0)
    start = flying(robot.name, seed=0, speed=0.1)
    sim.reset(start)
    for _ in range(100):
        sim.step(0.01 * sim.robot.weight * rng.normal(size=sim.robot.d) * 0.1)
    end, m = sim.state, sim.robot.mass
    assert np.allclose(m * (end.com_velocity - start.com_velocity), m * sim.time * G, atol=2e-3 * m)
    assert np.allclose(angular_momentum(end), angular_momentum(start), atol=2e-3 * m)


def test_energy_is_kept_in_flight_but_for_the_integrators_first_order(robot):
    """Halving the timestep halves the energy error: damping, friction and armature add nothing."""
    start, lost = flying(robot.name, seed=1, speed=0.2), []
    for timestep in (4e-4, 2e-4):
        sim = fb.Simulation(start.robot, timestep=timestep)
        sim.reset(start)
        for _ in range(round(0.08 / timestep)):
            sim.step(np.zeros(sim.robot.d))
        lost.append(energy(sim.state) - energy(start))
    assert abs(lost[1]) < 0.005 * energy(start.replace(q=start.robot.standing().q))
    # m g² t dt / 2 of free fall alone is of first order; Richardson's extrapolation leaves the
    # second
    assert abs(2.0 * lost[1] - lost[0]) < 0.05 * abs(lost[0]) + 1e-6


def test_the_work_of_the_motors_is_what_the_energy_gains(robot):
    start, rng = flying(robot.name, seed=2, speed=0.1), np.random.default_rng(0)
    robot = start.robot
    # N·m for 500 rad/s²: no joint reaches its limits
    gentle = 500.0 / np.diag(np.linalg.inv(start.M))[-robot.d :]
    tau = rng.uniform(-0.3, 0.3, robot.d) * np.minimum(
        np.minimum(robot.torque_limits, 0.01 * robot.weight), gentle
    )
    misses, work = [], 0.0
    for timestep in (2e-4, 1e-4):
        sim = fb.Simulation(start.robot, timestep=timestep)
        sim.reset(start)
        work = 0.0
        for _ in range(round(0.02 / timestep)):
            before = sim.v[-sim.robot.d :]
            sim.step(tau)
            work += timestep * float(tau @ (before + sim.v[-sim.robot.d :])) / 2.0
        misses.append(energy(sim.state) - energy(start) - work)
    assert abs(2.0 * misses[1] - misses[0]) < 0.02 * abs(work) and abs(work) > 1e-3


@pytest.mark.parametrize(
    ("force", "towards", "direction"),
    [(40.0, 0.0, [1, 0]), (40.0, 90.0, [0, 1]), (-40.0, 45.0, [-(0.5**0.5)] * 2)],
)
def test_a_horizontal_push_has_its_magnitude_and_direction(force, towards, direction):
    push = fb.Push.horizontal(force, towards, start=0.2, duration=0.3, frame="FL_foot")
    assert np.allclose(push.force, 40.0 * np.array([*direction, 0.0]), atol=1e-12)
    assert (push.start, push.duration, push.frame) == (0.2, 0.3, "FL_foot")


def test_a_push_acts_in_its_own_steps_and_no_others():
    sim = fb.Simulation(judges.load("go2"))
    sim.reset(flying("go2"))
    push, speeds = fb.Push([30.0, 0.0, 0.0], start=0.003, duration=0.004), [0.0]
    for _ in range(12):
        sim.step(np.zeros(12), (push,))
        speeds.append(float(sim.state.com_velocity[0]))
    pushed = np.flatnonzero(np.diff(speeds) > 1e-4)
    assert list(pushed) == [3, 4, 5, 6]


def test_the_impulse_of_a_push_is_force_times_duration_however_its_ends_lie_between_steps():
    """Pushes of a free ball: shorter than a step, over many steps, and both at once.

    MuJoCo's steps conserve its momentum up to rounding.
    """
    inertia = '<mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    ball = fb.load_urdf(
        f'<robot name="ball"><link name="ball"><inertial>{inertia}</inertial></link></robot>'
    )
    sim, rng = fb.Simulation(ball), np.random.default_rng(0)
    starts = rng.uniform(0.0, 0.02, 40)
    durations = rng.choice([1e-4, 5e-4, 1.5e-3, 8e-3], 40) * rng.uniform(0.5, 1.0, 40)
    pushes = [fb.Push(rng.normal(size=3), *times) for times in zip(starts, durations, strict=True)]
    for some in ([pushes[0]], pushes):
        sim.reset(ball.neutral().replace(q=[0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 1.0]))
        for _ in range(40):
            sim.step([], tuple(some))
        impulse = sum(push.duration * push.force for push in some)
        assert np.allclose(2.0 * (sim.state.com_velocity - 0.04 * G), impulse, rtol=0.0, atol=1e-12)


def test_a_push_at_a_frame_turns_the_robot_about_its_centre_of_mass(robot):
    """Angular momentum about the CoM grows by (p - com) × F dt, for frames all over the robot."""
    start = flying(robot.name, seed=3, speed=0.2).replace(v=np.zeros(robot.nv))
    force = np.array([20.0, -10.0, 15.0])
    for frame in ("base", robot.feet[0].frame, robot.frames[-1], robot.base):
        sim = fb.Simulation(robot, timestep=1e-4)
        sim.reset(start)
        sim.step(np.zeros(robot.d), (fb.Push(force, frame=frame),))
        gained = angular_momentum(sim.state) - angular_momentum(start)
        expected = 1e-4 * np.cross(start.point(frame) - start.com, force)
        assert np.allclose(gained, expected, atol=2e-2 * np.linalg.norm(expected)), frame


def test_torques_beyond_a_motors_limit_are_cut_at_the_limit(robot, tmp_path, monkeypatch):
    """MuJoCo drops all controls if one without a limit exceeds 1e10, so limits must come first."""
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log to the working directory
    sims = [fb.Simulation(robot) for _ in range(4)]
    signs = np.where(np.arange(robot.d) % 2, 1.0, -1.0)
    for sim, part in zip(sims, (1.0, 7.0, 0.5, 1e12), strict=True):
        sim.reset(flying(robot.name))
        for _ in range(3):
            sim.step(part * signs * robot.torque_limits)
    assert np.array_equal(sims[0].v, sims[1].v) and np.array_equal(sims[0].v, sims[3].v)
    assert not np.allclose(sims[0].v, sims[2].v)


def test_each_motor_turns_its_own_joint(robot):
    sim, start = fb.Simulation(robot, timestep=1e-5), flying(robot.name)
    eom = fb.equations_of_motion(start, fb.Contacts.none())
    for i in range(robot.d):
        tau = np.zeros(robot.d)
        tau[i] = 0.5 * min(robot.torque_limits[i], 2.0)
        sim.reset(start)
        sim.step(tau)
        expected = judges.aba(eom, tau, np.zeros(0))
        atol = 1e-3 * np.max(np.abs(expected))
        assert np.allclose(sim.v / 1e-5, expected, rtol=1e-3, atol=atol), robot.joint_names[i]


def test_measured_forces_are_what_changes_the_momentum(robot):
    """Σ (forces + weight + push) dt = m Δv_com over a push and a recovery, in the world frame."""
    sim, start = fb.Simulation(robot), robot.standing()
    controller = fb.WholeBodyController(robot, judges.stance(robot), fb.standing_tasks(start))
    push = fb.Push([0.1 * robot.weight, 0.15 * robot.weight, 0.0], start=0.02, duration=0.05)
    record = fb.rollout(sim, controller, 0.12, [push])
    forces = record.measured.reshape(len(record), -1, 3)
    pushed = 0.05 * push.force
    impulse = 1e-3 * forces.sum(axis=(0, 1)) + 0.12 * robot.mass * G + pushed
    change = robot.mass * (sim.state.com_velocity - start.com_velocity)
    assert np.allclose(impulse, change, atol=0.02 * np.linalg.norm(pushed))
    assert np.linalg.norm(forces[..., :2], axis=2).max() > 0.005 * robot.weight


def test_measured_forces_belong_to_the_points_they_are_named_after(go2, standing):
    """The foot below a downward push has a larger force."""
    controller = fb.WholeBodyController(go2, fb.Contacts.points(go2), fb.standing_tasks(standing))
    for i, foot in enumerate(go2.feet):
        sim = fb.Simulation(go2)
        assert sim.point_names[i] == foot.frame
        push = fb.Push([0.0, 0.0, -40.0], start=0.0, duration=1.0, frame=foot.frame)
        record = fb.rollout(sim, controller, 0.1, [push])
        extra = record.measured[-1].reshape(4, 3)[:, 2] - record.planned[0].reshape(4, 3)[:, 2]
        assert extra[i] == pytest.approx(40.0, rel=0.1)
        assert np.all(np.abs(np.delete(extra, i)) < 8.0)


def test_a_steeper_slope_than_friction_allows_lets_a_robot_slide_and_a_flatter_one_holds_it(go2):
    """A robot with fixed joints slides if tan θ > μ, and stays if tan θ < μ: Coulomb's law."""
    slid = {}
    for mu in (0.15, 0.5):
        angle = 0.25  # rad: tan θ = 0.255
        start, ground = on_slope(go2, angle), fb.Ground(mu=mu, normal=slope_normal(angle))
        sim = fb.Simulation(go2, ground)
        sim.reset(start)
        # the controller plans with 0.4, which is right if the robot stays and wrong if it slides
        contacts = fb.Contacts.points(go2, mu=0.4, normals=ground.normals[0])
        controller = fb.WholeBodyController(go2, contacts, fb.standing_tasks(start))
        record = fb.rollout(sim, controller, 0.3)
        slid[mu] = float(record.slip().max())
    assert slid[0.5] < 1e-3 and slid[0.15] > 0.01


def slope_normal(angle: float) -> np.ndarray:
    return np.array([np.sin(angle), 0.0, np.cos(angle)])


def on_slope(robot: fb.Robot, angle: float) -> fb.State:
    """Return the standing robot, rotated with the ground about the world's y axis."""
    q = robot.standing().q.copy()
    R = judges.rotation([0.0, angle, 0.0])
    q[:3] = R @ q[:3]
    turn = pin.Quaternion(R) * pin.Quaternion(np.array(q[3:7]))
    q[3:7] = turn.coeffs()
    return fb.State(robot, q)


def test_a_robot_on_a_slope_is_carried_upright_by_tilted_feet_that_share_the_worlds_frame():
    robot, angle = judges.load("go2"), 0.25
    start, ground = on_slope(robot, angle), fb.Ground(normal=slope_normal(angle))
    sim = fb.Simulation(robot, ground)
    sim.reset(start)
    contacts = fb.Contacts.points(robot, normals=ground.normals[0])
    assert np.allclose(contacts.positions(start), sim.contact_positions(), atol=1e-9)
    assert np.allclose(sim.contact_positions() @ ground.normals[0], 0.0, atol=1e-9)
    record = fb.rollout(sim, fb.WholeBodyController(robot, contacts, fb.standing_tasks(start)), 1.0)
    assert record.outcome == "completed"
    total = record.measured[-1].reshape(4, 3).sum(axis=0)
    assert np.allclose(total, [0.0, 0.0, robot.weight], atol=0.01 * robot.weight)
    forces = record.measured[-1].reshape(4, 3)
    pressing = forces @ ground.normals[0]
    assert pressing.sum() == pytest.approx(robot.weight * np.cos(angle), rel=0.01)
    assert np.allclose(record.planned[-1].reshape(4, 3) @ ground.normals[0], pressing, rtol=0.05)
    assert record.slip().max() < 1e-3


def test_an_arm_bolted_to_the_ground_accelerates_as_the_equations_say():
    robot = judges.load("ur5")
    state = robot.random_state(0)
    tau = np.linspace(-5.0, 5.0, 6)
    sim = fb.Simulation(robot, timestep=1e-5)
    sim.reset(state)
    sim.step(tau)
    eom = fb.equations_of_motion(state, fb.Contacts.none())
    expected = judges.aba(eom, tau, np.zeros(0))
    assert np.allclose((sim.v - state.v) / 1e-5, expected, rtol=1e-3, atol=1e-2)


def test_measured_forces_do_not_depend_on_mujocos_shape_of_the_friction_cone():
    sim = fb.Simulation(judges.load("go2"))
    sim.model.opt.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
    sim.step(np.zeros(12))
    before = sim.state.com_velocity
    sim.step(np.zeros(12))
    change = sim.robot.mass * ((sim.state.com_velocity - before) / sim.timestep - G)
    assert np.allclose(sim.contact_forces().sum(axis=0), change, atol=0.01 * sim.robot.weight)


def test_feet_near_the_ground_get_no_force():
    """MuJoCo lists a contact without a force for a ball closer to the ground than its gap."""
    sim = fb.Simulation(judges.load("go2"))
    sim.model.geom_gap[:] = 0.05
    state = sim.robot.standing()
    tilt = np.concatenate([[0.0, 0.0, 0.0, 0.05, 0.0, 0.0], np.zeros(12)])
    sim.reset(state.replace(q=state.integrate(tilt)))
    assert sim.data.ncon == 4
    wrench, expected = np.zeros(6), np.zeros((4, 3))
    for i, geom in enumerate(sim.data.contact.geom[:, 1]):
        mujoco.mj_contactForce(sim.model, sim.data, i, wrench)
        frame = sim.data.contact.frame[i].reshape(3, 3)
        expected[sim.point_names.index(sim.model.geom(geom).name)] = frame.T @ wrench[:3]
    pressed = expected[:, 2] > 1.0
    assert 0 < pressed.sum() < 4
    assert not np.any(sim.contact_forces()[~pressed])
    assert np.allclose(sim.contact_forces(), expected, rtol=1e-12)


def test_the_description_of_a_simulation_compiles_to_its_model():
    sim = fb.Simulation(judges.load("go2"), 0.4, 2e-3)
    made = sim.spec().compile()
    for part in ("body_mass", "geom_friction", "geom_conaffinity", "actuator_forcerange"):
        assert np.array_equal(getattr(made, part), getattr(sim.model, part))
    assert made.opt.timestep == 2e-3
