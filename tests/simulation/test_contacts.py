"""Planned and measured forces of contacts that are not feet: a wall, a platform, a connection."""

from dataclasses import replace

import judges
import numpy as np
import pytest
from judges import Array
from messages import refused, warns

import floatbase as fb
from floatbase.control import LinearInequality
from floatbase.dynamics import (
    FlatFootContact,
    PointContact,
    fixed_frame,
    moving_frame,
    rigid_between,
)
from floatbase.errors import InputError, SimulationWarning
from floatbase.simulation import Box

PERIOD = 2e-3  # s
UP = np.array([0.0, 0.0, 1.0])
HANDS = "right_rubber_hand", "left_rubber_hand"
GO2 = judges.load("go2")


def humanoid() -> fb.Robot:
    """A g1 whose links have no hulls, which take seconds to compute."""
    return replace(judges.load("g1"), package_dirs=())


def controller_of(
    contacts: fb.Contacts, robot: fb.Robot = GO2, **options: object
) -> fb.WholeBodyController:
    tasks = fb.standing_tasks(robot.standing())
    return fb.WholeBodyController(robot, contacts, tasks, **options)


def friction_used(forces: Array, normal: Array) -> Array:
    pressing = forces @ normal
    return np.linalg.norm(forces - pressing[:, None] * normal, axis=1) / pressing


@pytest.mark.parametrize("kind", ["ball on a wall", "palm on a table"])
def test_a_hand_pushes_as_planned_and_a_wall_has_its_own_friction(kind):
    robot = humanoid()
    state, hand, away = robot.standing(), HANDS[1], np.array([-1.0, 0.0, 0.0])
    touch = PointContact(hand, away, mu=0.3, radius=0.03, centre=[0.1, 0.0, 0.0])
    if kind == "palm on a table":
        corners = [[x, y, -0.02] for x in (0.0, 0.1) for y in (-0.02, 0.02)]
        touch, away = FlatFootContact(hand, corners, mu=0.3), UP
    place = touch.positions(state)[0] @ away
    contacts = fb.Contacts.feet(robot) + fb.Contacts([touch])
    count = len(touch.point_names)
    controller = controller_of(contacts, robot, min_normal_force={hand: 20.0 / count})
    ground = fb.Ground([0.8, 0.35], normal=[[0.0, 0.0, 1.0], away], offset=[0.0, place])
    if kind == "palm on a table":
        table = Box(state.point(hand)[0] + np.array([-0.1, 0.2]), [0.1, 0.3], place)
        ground = fb.Ground(0.8, boxes=[table])
    sim = fb.Simulation(robot, ground, contacts=contacts)
    run = fb.rollout(sim, controller, 0.3, control_period=PERIOD)
    force, planned = run.force(hand), run.force(hand, "planned")
    assert run.outcome == "completed" and run.slip(include_rolling=False)[-count:].max() < 1e-3
    assert np.abs(force - planned)[100:].max() < 0.05
    assert (force[100:] @ away).min() > 19.9
    assert friction_used(force[100:], away).max() < 0.3
    if kind == "ball on a wall":
        ball = sim.model.geom(hand).id
        found = {(ball in one.geom): one.friction[0] for one in sim.data.contact}
        assert found == {True: 0.35, False: 0.8}


@pytest.mark.parametrize("name", ["go2", "g1"])
def test_robots_stand_on_a_moving_platform_with_the_planned_forces(name):
    robot, frequency = GO2 if name == "go2" else humanoid(), 6.0  # 6 rad/s
    state, size = robot.standing(), np.array([0.03, 0.02, 0.01]) * (1.0 if name == "go2" else 0.3)

    def path(t: float) -> Array:
        return size * (1.0 - np.cos(frequency * t))

    def acceleration(t: float) -> Array:
        return size * frequency**2 * np.cos(frequency * t)

    def along(t: float) -> tuple[Array, Array, Array]:
        return state.com + path(t), size * frequency * np.sin(frequency * t), acceleration(t)

    contacts = fb.Contacts.feet(robot, 0.6, acceleration=acceleration)
    tasks = [fb.CoMTask(along), *fb.standing_tasks(state)[1:]]
    controller = fb.WholeBodyController(robot, contacts, tasks)
    assert controller.backend_reason.endswith("Python beside it: the target of centre of mass")
    sim = fb.Simulation(robot, fb.Ground(0.8, acceleration=acceleration))
    run = fb.rollout(sim, controller, 0.5, control_period=PERIOD)
    assert run.outcome == "completed" and run.slip(include_rolling=False).max() < 1e-3
    assert np.abs(run.com - [state.com + path(t) for t in run.time]).max() < 1e-3
    assert run.com[-1, 0] - state.com[0] > 1.5 * size[0]
    assert np.abs(run.ground_position - [path(t) for t in run.time]).max() < 2e-4
    assert np.abs(run.measured - run.planned)[100:].max() < 2e-3 * robot.weight
    # Newton's law in the world frame: the forces move the centre of mass with the platform
    total = run.measured.reshape(len(run), -1, 3).sum(axis=1)[100:]
    expected = [robot.mass * (acceleration(t + PERIOD / 2) + [0, 0, 9.81]) for t in run.time[100:]]
    assert np.abs(total - expected).max() < 2e-3 * robot.weight
    assert all(friction_used(run.force(name)[100:], UP).max() < 0.6 for name in contacts.names)


def test_a_robot_in_the_air_falls_as_if_the_ground_below_it_did_not_move(standing):
    start = standing.replace(q=np.r_[standing.q[:2], standing.q[2] + 1.0, standing.q[3:]])
    sims = [fb.Simulation(GO2, fb.Ground(acceleration=a)) for a in (None, [3.0, -2.0, 1.0])]
    for sim in sims:
        sim.reset(start)
        for _ in range(100):
            sim.step(np.zeros(12))
    still, moving = (sim.state for sim in sims)
    assert np.abs(still.q - moving.q).max() < 1e-9 and np.abs(still.v - moving.v).max() < 1e-9
    assert sims[1].ground_position == pytest.approx(0.005 * np.array([3.0, -2.0, 1.0]), rel=0.02)
    sims[1].reset()
    assert not sims[1].ground_position.any()


def test_a_box_in_two_hands_has_the_planned_wrench_in_the_simulation():
    robot, box = humanoid().with_payload(HANDS[1], 2.0, [0.1, -0.15, 0.0]), rigid_between(*HANDS)
    contacts = fb.Contacts.feet(robot) + fb.Contacts([box])
    part = contacts.force_slice(box.name)
    row = np.zeros((1, contacts.k))
    row[0, part.start + 1] = 1.0
    squeeze = LinearInequality("squeeze", "forces", (row, [-40.0]))
    controller = controller_of(contacts, robot, inequalities=[squeeze])
    assert "Python" not in controller.backend_reason
    run = fb.rollout(
        fb.Simulation(robot, contacts=contacts), controller, 0.3, control_period=PERIOD
    )
    state = run.final
    measured, planned = run.measured[:, part], run.planned[:, part]
    assert run.outcome == "completed" and np.abs(measured - planned)[100:].max() < 0.05
    assert measured[100:, 1].max() < -39.9
    poses = [[each.frame_pose(hand) for hand in HANDS] for each in (state, robot.standing())]
    now, before = (one.actInv(other) for one, other in poses)
    assert now.isApprox(before, 1e-3)
    # eq. (7) with the measured λ and torques
    eom = fb.equations_of_motion(state, contacts)
    residual = state.M @ run.planned_qdd[-1] + state.h - eom.S @ run.tau[-1]
    assert np.abs(residual - eom.J.T @ run.measured[-1]).max() < 0.05


@pytest.mark.parametrize("feet", [fb.Contacts.none(), fb.Contacts.feet(GO2)], ids=["alone", "feet"])
def test_a_fixed_frame_is_fixed_in_the_simulation_with_the_planned_wrench(feet):
    contacts = feet + fb.Contacts([fixed_frame("base")])
    run = fb.rollout(fb.Simulation(GO2, contacts=contacts), controller_of(contacts), 0.3)
    assert run.outcome == "completed" and np.abs(run.com[-1] - run.com[0]).max() < 5e-4
    assert np.abs(run.measured - run.planned)[-100:].max() < 2e-3 * GO2.weight


def test_a_fixed_frame_of_a_fixed_base_takes_no_force():
    robot = judges.load("ur5")
    contacts = fb.Contacts([fixed_frame("base_link"), fixed_frame("tool0")])
    sim = fb.Simulation(robot, contacts=contacts)
    sim.step(np.zeros(robot.d))
    base, tool = sim.connection_forces().reshape(2, 6)
    assert not base.any() and np.linalg.norm(tool[:3]) > 1.0


def test_a_rollout_warns_about_contacts_that_the_simulation_lacks():
    robot = GO2
    calf = fb.Contacts.points(robot, frames=["FL_calf"])
    drive = fb.Contacts([moving_frame("FR_foot", [0.0, 0.0, 0.1])])
    for contacts, sim, name in (
        (fb.Contacts([fixed_frame("base")]), fb.Simulation(robot), "bolts of base"),
        (calf, fb.Simulation(robot, contacts=drive), "FL_calf"),
        (drive, fb.Simulation(robot, contacts=drive), "drive of FR_foot"),
        (fb.Contacts.feet(robot, acceleration=[0.1, 0.0, 0.0]), fb.Simulation(robot), "RR_foot"),
    ):
        with warns(SimulationWarning, name):
            fb.rollout(sim, controller_of(contacts), PERIOD)


def test_a_rollout_warns_when_a_contact_that_the_simulation_lacks_begins():
    class Growing:
        def __init__(self) -> None:
            feet = fb.Contacts.feet(GO2)
            self.now = controller_of(feet)
            self.later = controller_of(feet + fb.Contacts([fixed_frame("base")]))

        @property
        def contacts(self) -> fb.Contacts:
            return self.now.contacts

        def __call__(self, q: Array, v: Array, t: float) -> object:
            self.now = self.later if t > 1.5 * PERIOD else self.now
            return self.now(q, v, t)

    with warns(SimulationWarning, "bolts of base"):
        fb.rollout(fb.Simulation(GO2), Growing(), 3 * PERIOD, control_period=PERIOD)


def test_a_foot_may_be_any_frame_of_a_link():
    made = fb.load("go2", feet=[f"{leg}_foot_joint" for leg in ("FL", "FR", "RL", "RR")])
    robot = replace(made, package_dirs=())  # no hulls
    sim = fb.Simulation(robot)
    run = fb.rollout(sim, controller_of(fb.Contacts.feet(robot), robot), 0.05)
    assert run.outcome == "completed" and np.abs(run.foot_positions[..., 2]).max() < 1e-3


def test_a_ground_below_a_fixed_base_cannot_accelerate():
    ground = fb.Ground(acceleration=[1.0, 0.0, 0.0])
    refused(lambda: fb.Simulation(judges.load("ur5"), ground), InputError, "ur5")
