"""Constraints other than feet, eqs. (5) and (6) and note 6: fixed and driven frames, rolling
wheels.

Closed-form solutions and numerical integration give the expected results.
"""

from pathlib import Path

import judges
import numpy as np
import numpy.typing as npt
import pinocchio as pin
import pytest
from judges import Array
from messages import refused

import floatbase as fb
from floatbase import dynamics, objectives
from floatbase.dynamics import (
    LinearConstraint,
    PointContact,
    RollingWheel,
    fixed_frame,
    moving_frame,
    rigid_between,
)
from floatbase.errors import InputError

M_DISC, R_DISC, G = 3.0, 0.25, 9.81
I_ACROSS, I_AXLE = 0.25 * M_DISC * R_DISC**2, 0.5 * M_DISC * R_DISC**2
Z = np.array([0.0, 0.0, 1.0])

DISC = f"""<robot name="disc"><link name="disc"><inertial>
<origin xyz="0 0 0"/><mass value="{M_DISC}"/>
<inertia ixx="{I_ACROSS}" ixy="0" ixz="0" iyy="{I_AXLE}" iyz="0" izz="{I_ACROSS}"/>
</inertial></link></robot>"""

# a body with a steered wheel; every axis and offset is oblique, so that no term of the drift
# vanishes by chance
CART = """<robot name="cart">
<link name="body"><inertial><origin xyz="0.02 -0.01 0.05"/><mass value="5"/>
<inertia ixx="0.1" ixy="0.01" ixz="0" iyy="0.2" iyz="-0.01" izz="0.15"/></inertial></link>
<link name="fork"><inertial><mass value="0.5"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
<link name="wheel"><inertial><origin xyz="0.01 0 0.02"/><mass value="1.5"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial></link>
<joint name="steering" type="revolute"><parent link="body"/><child link="fork"/>
<origin xyz="0.3 0.05 -0.1" rpy="0.1 0.2 -0.1"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="10" velocity="10"/></joint>
<joint name="axle" type="revolute"><parent link="fork"/><child link="wheel"/>
<origin xyz="0.05 0.02 -0.1" rpy="0.2 0 0.1"/>
<axis xyz="0 1 0"/><limit lower="-9" upper="9" effort="10" velocity="10"/></joint></robot>"""


def read(text: str, path: Path, **more: object) -> fb.Robot:
    """Load a robot from URDF text."""
    path.write_text(text)
    model = pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())
    limits, posture = np.full(model.nv - 6, np.inf), pin.neutral(model)
    return fb.Robot(path.stem, model, path, (path.parent,), (), limits, posture, **more)


@pytest.fixture
def disc(tmp_path: Path) -> fb.Robot:
    return read(DISC, tmp_path / "disc.urdf")


@pytest.fixture
def cart(tmp_path: Path) -> fb.Robot:
    return read(CART, tmp_path / "cart.urdf")


def pose(robot, R, position, omega, velocity):
    """Make the state of a floating body from world quantities."""
    q = np.concatenate([position, pin.Quaternion(R).normalized().coeffs()])
    return fb.State(robot, q, np.concatenate([R.T @ velocity, R.T @ omega]))


def rolling(robot, R, omega, place=(0.0, 0.0)):
    """Make a disc on z = 0 with its axle along R's y axis, rolling with angular velocity ω.

    Its centre moves with v_c = ω × (r u).
    """
    axle = R[:, 1]
    u = Z - axle * axle[2]
    u /= np.linalg.norm(u)
    centre = np.array([*place, 0.0]) + R_DISC * u
    return pose(robot, R, centre, omega, np.cross(omega, R_DISC * u))


def wheel_of_the_disc(normal: npt.ArrayLike = Z) -> RollingWheel:
    return RollingWheel("disc", [0.0, 1.0, 0.0], R_DISC, normal)


def motion(state: fb.State, *contacts: object, t: float = 0.0) -> tuple[Array, Array]:
    """Compute q̈ and λ without torque."""
    eom = fb.equations_of_motion(state, fb.Contacts(list(contacts)), t)
    return judges.constrained(eom, np.zeros(eom.d))


def world_acceleration(state: fb.State, qdd: Array) -> tuple[Array, Array]:
    """Return linear and angular acceleration of a floating body's origin in the world frame."""
    R = judges.quaternion_rotation(state.q[3:7])
    return R @ (qdd[:3] + np.cross(state.v[3:6], state.v[:3])), R @ qdd[3:6]


# any A q̈ = b -------------------------------------------------------------------------------------


def test_the_motion_keeps_a_linear_constraint_whose_force_is_its_rows_times_multipliers():
    rng = np.random.default_rng(0)
    state = judges.load("go2").random_state(1)
    A, b = rng.normal(size=(4, 18)), rng.normal(size=4)
    constraint = LinearConstraint("any", 4, lambda s, t: (A, b))
    foot = fb.Contacts.points(state.robot, frames=["FL_foot"])
    eom = fb.equations_of_motion(state, foot + fb.Contacts([constraint]))
    tau = rng.normal(size=12)
    qdd = dynamics.accelerations_from_torques(eom)(tau)
    forces = dynamics.forces_from_torques(eom)(tau)
    assert np.allclose(A @ qdd, b, atol=1e-8)
    judge = judges.mujoco_of("go2").move_to(state)
    J_foot = judge.jacobian("FL_foot", eom.contacts.positions(state)[0])[0]
    expected = J_foot.T @ forces[:3] + A.T @ forces[3:]
    assert np.allclose(state.M @ qdd + state.h - eom.S @ tau, expected, atol=1e-7)
    assert eom.contacts.point_names == ("FL_foot",)


def test_rows_that_turn_with_time_push_along_where_they_point_now():
    """Note 6: in A(q, q̇, t) q̈ = b(q, q̇, t), the constraint force at t is A(t)ᵀ λ, not A(0)ᵀ λ."""
    state = judges.load("go2").random_state(0)

    def rows(s: fb.State, t: float) -> tuple[Array, Array]:
        along = np.array([[np.cos(t), 0.0, np.sin(t)]])
        return along @ s.frame_jacobian("base")[:3], np.array([t])

    eom = fb.equations_of_motion(state, fb.Contacts([LinearConstraint("rail", 1, rows)]), t=0.7)
    expected = rows(state, 0.7)[0]
    assert np.allclose(eom.A, expected)
    assert np.allclose(eom.J, expected), "J of (4) was taken at another time than A of (5)"


def test_a_number_of_rows_may_be_a_float():
    whole = LinearConstraint("one", 1.0, lambda s, t: (np.ones((1, 18)), np.zeros(1)))
    assert fb.Contacts([whole]).k == 1 and whole.row_names == ("row 0",)


# bolts: Figure 1, left ----------------------------------------------------------------------------


def test_a_bolted_robot_moves_as_the_fixed_base_robot_and_its_bolts_carry_the_base_wrench(go2):
    rng = np.random.default_rng(0)
    model = pin.buildModelFromXML(go2.urdf)
    model.armature = np.array(go2.model.armature)[6:]
    for seed in range(3):
        state = go2.random_state(seed)
        R = judges.quaternion_rotation(state.q[3:7])
        v = state.v.copy()
        v[:6] = 0.0
        state, tau = state.replace(v=v), 5.0 * rng.normal(size=12)
        eom = fb.equations_of_motion(state, fb.Contacts([fixed_frame("base")]))
        model.gravity.linear = R.T @ np.array([0.0, 0.0, -G])  # the bolted base leans
        data = model.createData()
        expected = pin.aba(model, data, state.q[7:], state.v[6:], tau)
        qdd = dynamics.accelerations_from_torques(eom)(tau)
        assert judges.relative(qdd[6:], expected) < 1e-9
        assert np.max(np.abs(qdd[:6])) < 1e-9
        pin.rnea(model, data, state.q[7:], state.v[6:], expected)
        # force of the base link on its children, plus its own weight
        origin = pin.Force.Zero()
        for child in range(1, model.njoints):
            if model.parents[child] == 0:
                origin += data.liMi[child].act(data.f[child])
        own = go2.model.inertias[1]
        f_own = -own.mass * np.array(model.gravity.linear)
        origin += pin.Force(f_own, np.cross(own.lever, f_own))
        # data.f does not include the weight of links that Pinocchio fixes to the world;
        # robot.inertias[1] includes all of them
        wrench = dynamics.forces_from_torques(eom)(tau)
        assert np.allclose(R.T @ wrench[:3], origin.linear, atol=1e-7)
        assert np.allclose(R.T @ wrench[3:], origin.angular, atol=1e-7)


def test_a_driven_frame_has_the_desired_acceleration_at_that_time():
    def desired(t: float) -> Array:
        return np.array([np.sin(t), 2.0 * np.cos(3.0 * t), -t])

    for seed, (t, frame) in enumerate(((0.0, "base"), (0.8, "FL_foot"), (1.9, "RR_calf"))):
        state = judges.load("go2").random_state(seed, spread=0.6)
        qdd, force = motion(state, moving_frame(frame, desired), t=t)
        found = judges.acceleration_of(lambda s, f=frame: s.point(f), state, qdd)
        assert np.allclose(found, desired(t), atol=1e-4)
        rate = objectives.centroidal_momentum_rate(state, qdd)
        assert np.allclose(force, rate[:3] + np.array([0.0, 0.0, state.robot.mass * G]), atol=1e-7)


def test_a_contact_on_accelerated_ground_accelerates_with_it():
    ground = np.array([0.3, -0.2, 0.5])
    for seed, acceleration in enumerate((ground, lambda t: ground * t / 2.0)):
        state = judges.load("go2").random_state(seed, spread=0.6)
        qdd, _ = motion(state, PointContact("FL_foot", acceleration=acceleration), t=2.0)
        found = judges.acceleration_of(lambda s: s.point("FL_foot"), state, qdd)
        assert np.allclose(found, ground, atol=1e-4)


# the wheel ----------------------------------------------------------------------------------------


def test_b_of_a_wheel_and_of_bolts_is_minus_the_change_of_their_rows_along_the_motion(cart):
    """Eq. (6) by central differences of J(q) v with fixed v, at random states on slopes."""
    rng = np.random.default_rng(0)
    for seed in range(20):
        q = pin.integrate(cart.model, pin.neutral(cart.model), rng.uniform(-0.8, 0.8, cart.nv))
        state = fb.State(cart, q, rng.normal(size=cart.nv))
        normal = judges.random_normals(1, seed)[0]
        wheel = RollingWheel("wheel", [0.1, 1.0, -0.2], 0.17, normal, centre=[0.1, 0.2, -0.3])
        for each in (wheel, fixed_frame("body"), rigid_between("wheel", "body")):
            A, b = each.constraint(state)
            expected = -judges.derivative(lambda s, c=each: c.jacobian(s) @ s.v, state, state.v)
            assert np.linalg.norm(expected) > 1e-2
            assert np.allclose(b, expected, atol=1e-7)
            assert np.array_equal(A, each.jacobian(state))


def test_the_slip_is_the_velocity_of_the_wheels_material_point_at_the_contact(cart):
    rng = np.random.default_rng(1)
    for seed in range(10):
        q = pin.integrate(cart.model, pin.neutral(cart.model), rng.uniform(-0.8, 0.8, cart.nv))
        state = fb.State(cart, q, rng.normal(size=cart.nv))
        wheel = RollingWheel(
            "wheel",
            [0.1, 1.0, -0.2],
            0.17,
            judges.random_normals(1, seed)[0],
            centre=[0.1, 0.2, 0.3],
        )
        touching = wheel.positions(state)[0]
        in_wheel = state.frame_pose("wheel").actInv(touching)
        velocity = judges.derivative(lambda s, p=in_wheel: s.point("wheel", p), state, state.v)
        assert np.allclose(wheel.slip(state), velocity, atol=1e-8)


def test_the_contact_is_the_lowest_point_of_the_rim(cart):
    rng = np.random.default_rng(2)
    angles = np.linspace(0.0, 2.0 * np.pi, 20001)
    for seed in range(5):
        q = pin.integrate(cart.model, pin.neutral(cart.model), rng.uniform(-0.8, 0.8, cart.nv))
        state, n = fb.State(cart, q), judges.random_normals(1, seed)[0]
        wheel = RollingWheel("wheel", [0.0, 1.0, 0.0], 0.17, n)
        rim = np.stack([0.17 * np.cos(angles), 0.0 * angles, 0.17 * np.sin(angles)])
        R, centre = state.frame_pose("wheel").rotation, state.point("wheel")
        heights = n @ (R @ rim + centre[:, None])
        touching = wheel.positions(state)[0]
        assert n @ touching == pytest.approx(heights.min(), abs=1e-8)
        assert np.linalg.norm(touching - (R @ rim + centre[:, None])[:, heights.argmin()]) < 1e-4


@pytest.mark.parametrize("slope", [0.1, 0.4, 0.9])
def test_a_solid_disc_rolls_down_a_slope_with_two_thirds_of_g_sin_theta(disc, slope):
    normal = np.array([np.sin(slope), 0.0, np.cos(slope)])
    down = np.array([np.cos(slope), 0.0, -np.sin(slope)])
    state = pose(disc, np.eye(3), R_DISC * normal, np.zeros(3), np.zeros(3))
    qdd, force = motion(state, wheel_of_the_disc(normal))
    linear, angular = world_acceleration(state, qdd)
    assert np.allclose(linear, 2.0 / 3.0 * G * np.sin(slope) * down, atol=1e-10)
    assert np.allclose(angular, [0.0, 2.0 / 3.0 * G * np.sin(slope) / R_DISC, 0.0], atol=1e-9)
    # friction acts up the slope with the remaining third
    expected = M_DISC * G * (np.cos(slope) * normal - np.sin(slope) / 3.0 * down)
    assert np.allclose(force, expected, atol=1e-9)


@pytest.mark.parametrize(("lean", "radius"), [(1.2, 0.6), (0.8, 1.0), (0.5, 0.3)])
def test_a_leaning_coin_rolls_in_a_circle_at_the_rate_of_the_closed_form(disc, lean, radius):
    """Steady rolling at angle α between disc and ground, with the centre on a circle of radius b.

    The rate is Ω² = 4 g cot α / (6 b + r cos α).
    """
    rate = np.sqrt(4.0 * G / np.tan(lean) / (6.0 * radius + R_DISC * np.cos(lean)))
    out, along = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    u = -np.cos(lean) * out + np.sin(lean) * Z  # leans towards the circle's centre
    axle = np.sin(lean) * out + np.cos(lean) * Z
    omega = -rate * radius / R_DISC * axle + rate * np.sin(lean) * u
    R = np.column_stack([np.cross(axle, u), axle, u])
    assert np.linalg.det(R) == pytest.approx(1.0)
    state = pose(disc, R, radius * out + R_DISC * np.sin(lean) * Z, omega, rate * radius * along)
    wheel = wheel_of_the_disc()
    assert np.allclose(wheel.slip(state), 0.0, atol=1e-12)
    qdd, force = motion(state, wheel)
    assert abs(force @ (wheel.constraint(state)[0] @ state.v)) < 1e-9  # rolling does no work
    linear, angular = world_acceleration(state, qdd)
    assert np.allclose(linear, -(rate**2) * radius * out, atol=1e-9)
    assert np.allclose(angular, rate * np.cross(Z, omega), atol=1e-9)
    assert np.allclose(force, M_DISC * (G * Z - rate**2 * radius * out), atol=1e-9)
    # at another rate the lean changes, and the path is not a circle
    faster = state.replace(v=1.2 * state.v)
    other = world_acceleration(faster, motion(faster, wheel)[0])[1]
    assert np.linalg.norm(other - 1.44 * angular) > 1.0


def test_a_wheel_that_lies_flat_has_no_lowest_point(disc):
    state = pose(disc, judges.rotation([np.pi / 2, 0.0, 0.0]), *np.zeros((3, 3)))
    refused(lambda: wheel_of_the_disc().constraint(state), InputError, "disc")


def test_a_wheel_and_feet_and_bolts_stand_in_one_list_under_their_names(cart):
    contacts = fb.Contacts([RollingWheel("wheel", [0, 1, 0], 0.17), fixed_frame("body")])
    assert contacts.names == ("wheel", "bolts of body")
    assert contacts.force_slice("bolts of body") == slice(3, 9)
    assert contacts.point_names == ("wheel",)
    eom = fb.equations_of_motion(fb.State(cart, pin.neutral(cart.model)), contacts)
    assert eom.J.shape == (9, cart.nv)
