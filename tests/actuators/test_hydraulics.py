"""App. B: cylinder, valve, lever and force loop, judged by closed forms, power and a tight
integrator.
"""

from dataclasses import replace

import judges
import numpy as np
import pytest
from messages import refused
from scipy.integrate import solve_ivp

import floatbase as fb
from floatbase.actuators import VACUUM, Cylinders, HydraulicActuators, Hydraulics
from floatbase.errors import InputError

HYQ = Hydraulics()


def one(hydraulics: Hydraulics = HYQ) -> Cylinders:
    """A single cylinder of HyQ's size, its best angle at q = 0."""
    return Cylinders(hydraulics, [1.0], [0.0])


def joints(hydraulics: Hydraulics = HYQ) -> HydraulicActuators:
    """go2 with a cylinder on each joint."""
    return HydraulicActuators(judges.load("go2"), hydraulics)


def run(
    actuators: HydraulicActuators, tau: np.ndarray, time: float, dt: float = 1e-3, turn: float = 0.0
) -> np.ndarray:
    """Torques after each step with the joints held at an angle from the best, shape (n, d)."""
    q, v = actuators.cylinders.max_lever_angle + turn, np.zeros(actuators.cylinders.d)
    return np.array([actuators.step(tau, q, v, dt) for _ in range(round(time / dt))])


# the numbers of HyQ


def test_hyqs_cylinder_gives_the_145_newton_metres_that_are_published():
    assert HYQ.areas[0] * HYQ.supply_pressure * HYQ.crank == pytest.approx(145.0, abs=0.5)
    assert HYQ.areas == pytest.approx([np.pi * 0.008**2, np.pi * (0.008**2 - 0.005**2)])


def test_the_crank_sweeps_120_degrees_with_a_stroke_of_80_millimetres():
    """HyQ's published stroke and joint range, from our crank."""
    swept = np.deg2rad([-60.0, 60.0])
    short, long = (float(one().geometry([angle]).length[0]) for angle in swept)
    assert long - short == pytest.approx(0.080, rel=0.04)


# lever


def test_the_length_is_the_distance_between_the_two_pivots():
    cylinder = one()
    for q in np.linspace(-4.0, 4.0, 33):
        gamma = np.arccos(HYQ.crank / HYQ.base) + q
        foot, rod = np.array([HYQ.base, 0.0]), HYQ.crank * np.array([np.cos(gamma), np.sin(gamma)])
        expected = np.linalg.norm(rod - foot)
        assert cylinder.geometry([q]).length[0] == pytest.approx(expected, rel=1e-12)


def test_the_lever_is_the_derivative_of_the_length_so_that_power_is_the_same_on_both_sides():
    cylinder = one()
    for q in np.linspace(-4.0, 4.0, 33):
        slope = (cylinder.geometry([q + 1e-6]).length - cylinder.geometry([q - 1e-6]).length) / 2e-6
        assert np.allclose(cylinder.geometry([q]).lever, slope, atol=1e-9)


def test_the_lever_is_longest_at_the_centre_and_zero_where_crank_and_cylinder_line_up():
    def lever(q: float) -> float:
        return float(one().geometry([q]).lever[0])

    longest = max(lever(q) for q in np.linspace(-np.pi, np.pi, 2001))
    assert longest == pytest.approx(HYQ.crank, rel=1e-6)
    assert lever(0.0) == pytest.approx(HYQ.crank, rel=1e-12)
    assert lever(-np.arccos(HYQ.crank / HYQ.base)) == pytest.approx(0.0, abs=1e-12)


def test_chambers_take_up_what_the_piston_leaves_and_never_vanish():
    cylinder = one()
    for q in np.linspace(-np.pi, np.pi, 50):
        before, after = cylinder.geometry([q - 1e-6]), cylinder.geometry([q + 1e-6])
        moved = after.length - before.length
        expected = cylinder.areas * np.array([[1.0], [-1.0]]) * moved
        assert np.allclose(after.volumes - before.volumes, expected, atol=1e-18)
        assert np.all(before.volumes >= HYQ.dead_volume * (1.0 - 1e-9))


# valve


def test_the_open_valve_passes_its_rated_flow_at_its_rated_pressure_drop():
    """Half of it at each edge, turbulent, into A and out of B."""
    pressures = np.array([[HYQ.supply_pressure - 35e5], [HYQ.tank_pressure + 35e5]])
    flows = one().valve_flows(np.array([1.0]), pressures)
    assert flows == pytest.approx(np.array([[HYQ.rated_flow], [-HYQ.rated_flow]]), rel=1e-3)
    assert one().valve_flows(np.array([0.25]), pressures) == pytest.approx(0.25 * flows)


def test_flow_grows_with_the_root_of_the_drop_and_with_its_sign():
    cylinder = one()
    flow = cylinder.orifice_flow(np.array([[40e5], [-10e5]]))[:, 0]
    expected = HYQ.valve_gain * np.array([np.sqrt(40e5), -np.sqrt(10e5)])
    assert flow == pytest.approx(expected, rel=3e-3)
    slope = cylinder.orifice_flow(np.array([[1.0], [-1.0]]))[:, 0]
    assert np.all(np.isfinite(slope)) and slope[0] == -slope[1] > 0.0


@pytest.mark.parametrize(("x", "into"), [(0.5, (1, -1)), (-0.5, (-1, 1)), (0.0, (0, 0))])
def test_the_spool_chooses_which_chamber_is_fed(x, into):
    flows = one().valve_flows(np.array([x]), np.full((2, 1), 80e5))
    assert tuple(np.sign(flows[:, 0]).astype(int)) == into


# oil


# power


def test_the_pumps_power_is_work_and_heat_and_compressed_oil():
    """At random instants; the pump's part is counted here at the supply and tank lines, by hand."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        cylinder = Cylinders(HYQ, rng.uniform(0.01, 3.0, 4), np.zeros(4))
        x, p = rng.uniform(-1.0, 1.0, 4), rng.uniform(0.0, 200e5, (2, 4))
        geometry, v = cylinder.geometry(rng.uniform(-3.0, 3.0, 4)), rng.normal(size=4)
        power, flows = cylinder.power(x, p, geometry, v), cylinder.valve_flows(x, p)
        fed = np.where(x > 0.0, flows[0], flows[1])
        drained = np.where(x > 0.0, flows[1], flows[0])
        pump = HYQ.supply_pressure * fed + HYQ.tank_pressure * drained
        volume, area = geometry.volumes, cylinder.areas
        rates = cylinder.pressure_rates(x, p, geometry, v)
        stored = np.sum(volume * p * rates, axis=0) / HYQ.bulk_modulus
        joint = (p[0] * area[0] - p[1] * area[1]) * geometry.lever * v
        scale = np.abs([pump, joint, power.valve, stored]).max(axis=0)
        for found, expected in ((power.pump, pump), (power.joint, joint), (power.stored, stored)):
            assert np.all(np.abs(found - expected) < 1e-9 * scale)
        assert np.all(np.abs(pump - joint - power.valve - power.leakage - stored) < 1e-9 * scale)
        assert np.all(power.valve >= 0.0) and np.all(power.leakage >= 0.0)


# the loop


def judge(tau: float, q: float, v: float, time: np.ndarray) -> np.ndarray:
    """The torque of HyQ's joint, from rest with zero torque, by a tight integrator and the
    equations written out.
    """
    b, a, h = HYQ.crank, HYQ.base, HYQ
    gamma = np.arccos(b / a) + q
    length = np.sqrt(a * a + b * b - 2.0 * a * b * np.cos(gamma))
    lever = a * b * np.sin(gamma) / length
    (A, B), beta, K = h.areas, h.bulk_modulus, h.valve_gain
    VA, VB = h.dead_volume + A * (length - a + b), h.dead_volume + B * (a + b - length)
    w, speed = 2.0 * np.pi * h.loop_bandwidth, lever * v

    def edge(drop: float) -> float:
        return float(K * np.sign(drop) * np.sqrt(abs(drop)))

    def rates(t: float, y: np.ndarray) -> list[float]:
        x, pA, pB, integral = y
        error = tau / lever - (A * pA - B * pB)
        desired = w * error + 0.05 * w * w * integral + beta * (A * A / VA + B * B / VB) * speed
        high_A, high_B = (
            (h.supply_pressure, h.tank_pressure)
            if desired >= 0
            else (h.tank_pressure, h.supply_pressure)
        )
        full = beta * (A / VA * edge(high_A - pA) - B / VB * edge(high_B - pB))
        u = desired / abs(full)
        line_A, line_B = (
            (h.supply_pressure, h.tank_pressure) if x >= 0 else (h.tank_pressure, h.supply_pressure)
        )
        leak = h.leakage * (pA - pB)
        return [
            2.0 * np.pi * h.valve_bandwidth * (np.clip(u, -1.0, 1.0) - x),
            beta / VA * (abs(x) * edge(line_A - pA) - leak - A * speed),
            beta / VB * (abs(x) * edge(line_B - pB) + leak + B * speed),
            error if abs(u) < 1.0 else 0.0,
        ]

    lines = h.supply_pressure + h.tank_pressure
    start = [0.0, B * lines / (A + B), A * lines / (A + B), 0.0]
    y = solve_ivp(
        rates, (0.0, time[-1]), start, t_eval=time, method="LSODA", rtol=1e-8, atol=1e-8
    ).y
    return lever * (A * y[1] - B * y[2])


def test_the_integrator_agrees_with_a_tight_one():
    """Within 1 % of the torque limit at any millisecond, and 0.05 % after 80 ms."""
    limit = HYQ.weakest_torque
    centre = judges.load("ur5").standing().q
    time = np.arange(1, 81) * 1e-3
    for tau, q, v in (
        (0.2, 0.0, 0.0),
        (-0.2, 0.3, 0.0),
        (0.8, 0.0, 0.0),
        (-0.7, -0.4, 0.0),
        (0.3, 0.0, 1.0),
    ):
        robot = fb.load("ur5", torque_limits=limit)
        actuators = HydraulicActuators(robot)
        angles, speeds, desired = centre + q, np.full(6, v), np.full(6, tau * limit)
        found = np.array([actuators.step(desired, angles, speeds, 1e-3) for _ in time])
        exact = judge(tau * limit, q, v, time)
        assert np.allclose(found, found[:, :1])
        assert np.max(np.abs(found[:, 0] - exact)) < 0.01 * limit
        assert abs(found[-1, 0] - exact[-1]) < 5e-4 * limit


@pytest.mark.parametrize("bandwidth", [10.0, 100.0])
def test_the_bandwidth_sets_the_speed_of_a_torque_step_which_ends_exactly(bandwidth):
    """10 to 90 % within 0.35 / bandwidth, as a first-order lag would; less than 10 % too much; no
    error that stays.
    """
    actuators = joints(replace(HYQ, loop_bandwidth=bandwidth))
    step = 0.3 * judges.load("go2").torque_limits
    dt = 0.01 / bandwidth
    part = run(actuators, step, 30.0 / bandwidth, dt) / step
    rise = dt * (np.argmax(part >= 0.9, axis=0) - np.argmax(part >= 0.1, axis=0))
    assert np.all(rise <= 0.35 / bandwidth)
    assert np.max(part) < 1.10
    assert np.allclose(part[-1], 1.0, atol=1e-3)


def test_leakage_leaves_no_error_behind():
    """A seal ten times worse takes a tenth off the torque at first; the integral finds the opening
    that makes up for it.
    """
    actuators = joints(replace(HYQ, leakage=2e-13))
    step = -0.4 * judges.load("go2").torque_limits
    part = run(actuators, step, 1.0) / step
    assert np.all(np.abs(part[20] - 1.0) > 0.1)
    assert np.allclose(part[-1], 1.0, atol=1e-6)
    assert np.all(actuators.state.opening < 0.0)


# strength


@pytest.mark.parametrize("robot", judges.ROBOTS, indirect=True)
def test_at_the_standing_angles_the_supply_gives_each_joint_its_torque_limit(robot):
    actuators = HydraulicActuators(robot)
    standing = robot.standing().difference(robot.neutral().q)[robot.nv - robot.d :]
    pull, push = actuators.cylinders.geometry(standing).lever * actuators.cylinders.force_limits()
    assert np.allclose(-pull, robot.torque_limits)
    assert np.allclose(push / robot.torque_limits, 1.66, atol=0.01)


@pytest.mark.parametrize("turn", [-1.0, -0.5, 0.0, 0.5, 1.0])
def test_the_supply_pressure_limits_the_torque(turn):
    actuators = joints(replace(HYQ, leakage=0.0))
    cylinders, high, low = actuators.cylinders, HYQ.supply_pressure, HYQ.tank_pressure
    A, B = cylinders.areas
    lever = cylinders.geometry(cylinders.max_lever_angle + turn).lever
    push = lever * (A * high - B * low)
    for sign, limit in ((-1.0, lever * (A * low - B * high)), (1.0, push)):
        out = run(actuators, sign * 5.0 * np.abs(push), 0.3, turn=turn)
        assert np.allclose(out[-1], limit, rtol=2e-3)
        assert np.all(sign * out <= sign * limit * (1.0 + 1e-9))


def test_where_crank_and_cylinder_line_up_there_is_no_torque():
    turn = -np.arccos(HYQ.crank / HYQ.base)
    out = run(joints(), judges.load("go2").torque_limits, 0.05, turn=turn)
    assert np.all(np.isfinite(out))
    assert np.max(np.abs(out)) < 1e-6


def test_all_joints_have_the_same_response_relative_to_their_strength():
    """Similar cylinders: the same curve for solo12's 2.7 N·m and talos' 300 N·m."""
    curves = []
    for name in ("solo12", "talos"):
        actuators = HydraulicActuators(judges.load(name))
        limits = judges.load(name).torque_limits
        curves.append((run(actuators, 0.5 * limits, 0.05) / limits).T)
    assert np.allclose(np.vstack(curves), curves[0][0], rtol=1e-9)


def test_oil_that_is_pulled_apart_boils_instead_of_pulling():
    actuators = joints(replace(HYQ, loop_bandwidth=0.01, valve_bandwidth=0.01))
    q = actuators.cylinders.max_lever_angle
    for i in range(400):
        actuators.step(np.zeros(12), q - 1e-3 * i, np.full(12, -1.0), 1e-3)
    assert np.min(actuators.state.pressures) == VACUUM


# memory


def test_a_reset_puts_the_oil_under_the_desired_torques_and_forgets_the_rest():
    robot, actuators = judges.load("go2"), joints()
    run(actuators, robot.torque_limits, 0.02)
    tau = 0.5 * robot.torque_limits * np.resize([1.0, -1.0], 12)
    q = actuators.cylinders.max_lever_angle + 0.3
    actuators.reset(tau, q)
    assert np.allclose(actuators.torques(q), tau)
    assert not np.any(actuators.state.opening) and not np.any(actuators.state.integral)
    held = run(actuators, tau, 0.1, turn=0.3)
    assert np.max(np.abs(held - tau) / robot.torque_limits) < 0.01
    actuators.reset()
    assert np.allclose(actuators.torques(actuators.cylinders.max_lever_angle), 0.0, atol=1e-9)


def test_two_steps_are_one_step_after_another_and_the_same_every_time():
    tau = 0.4 * judges.load("go2").torque_limits
    first, second = joints(), joints()
    assert np.array_equal(run(first, tau, 0.02), run(second, tau, 0.02))
    again = run(joints(), tau, 0.02, dt=2e-3)
    assert np.allclose(again, run(joints(), tau, 0.02)[1::2], rtol=1e-12)


# bad input


@pytest.mark.parametrize(
    ("part", "value", "named"),
    [
        ("rod", 0.016, ("rod", "bore", 0.016)),
        ("crank", 0.4, ("crank", 0.4, "base", 0.32)),
        ("dead_volume", 0.0, (0,)),
        ("supply_pressure", 1e5, (2e5, 1e5)),
        ("supply_pressure", 2.5e5, ("bore",)),
        ("valve_bandwidth", 0.0, (0,)),
        ("loop_bandwidth", np.inf, (np.inf,)),
    ],
)
def test_parameters_that_make_no_cylinder_are_refused(part, value, named):
    refused(lambda: replace(HYQ, **{part: value}), InputError, *named)


def test_robots_that_cannot_have_cylinders_are_refused(go2):
    endless = fb.load("go2", torque_limits=np.r_[np.full(11, 20.0), np.inf])
    panda = fb.load("panda", locked=["panda_finger_joint2"])
    refused(lambda: HydraulicActuators(endless), InputError, "RR_calf_joint", "go2")
    refused(lambda: Cylinders(HYQ, [0.0], [0.0]), InputError, 0)
    refused(lambda: HydraulicActuators(panda), InputError, "panda_finger_joint1")  # it slides
