"""What a user can change in a `Walk`: tasks, footholds, adjustment, swings, ground, pose."""

from dataclasses import replace
from typing import Any

import judges
import numpy as np
import numpy.typing as npt
import pytest
from messages import raises

import floatbase as fb
from floatbase.behaviours import LIPM, Gait, StepPlan, Swing, Walk, raibert_foothold
from floatbase.control import JointLimits
from floatbase.errors import InputError

PERIOD = 2e-3  # s


def trot(name: str = "go2", velocity: tuple[float, float] = (0.2, 0.0), **options: Any) -> Walk:
    robot = judges.load(name)
    return Walk(
        robot, fb.Contacts.feet(robot, mu=0.6), Gait.trot(robot, start=0.2), velocity, **options
    )


def run(walk: Walk, duration: float, *pushes: fb.Push, **options: Any) -> fb.Rollout:
    return fb.rollout(fb.Simulation(walk.robot, **options), walk, duration, pushes, PERIOD)


@pytest.mark.front_end
def test_a_hand_draws_a_circle_in_the_world_while_its_robot_trots_and_is_pushed():
    robot = judges.load("anymal_kinova")
    hand = robot.standing().point(HAND)

    def circle(t: float) -> tuple[npt.ArrayLike, ...]:
        rate = 2.0
        c, s = 0.1 * np.cos(rate * t), 0.1 * np.sin(rate * t)
        position = hand + [0.0, s, c - 0.1]
        return position, [0.0, rate * c, -rate * s], [0.0, -(rate**2) * s, -(rate**2) * c]

    walk = trot("anymal_kinova", (0.0, 0.0), tasks=[fb.FrameTask(HAND, circle)])
    record = run(walk, 2.5, fb.Push([0.0, 150.0, 0.0], start=1.2))
    assert record.outcome == "completed"
    error = [
        np.linalg.norm(record.state(i).point(HAND) - circle(record.time[i])[0])
        for i in range(0, len(record), 10)
    ]
    assert max(error) < 0.005  # m
    assert np.allclose(record.targets[f"position of {HAND}"][100, :3], circle(0.2)[0], atol=1e-9)


HAND = "j2s6s200_end_effector"


@pytest.mark.parametrize("height", [None, 0.05])
def test_a_foothold_may_have_a_height(height):
    def rule(foot: str, touchdown: float, walk: Walk) -> npt.ArrayLike:
        xy = raibert_foothold(foot, touchdown, walk)
        return xy if height is None else [*xy, height]

    walk = trot(foothold=rule)
    run(walk, 0.4)
    level = walk.robot.standing().point("FL_foot")[2]
    for foot, place in walk.footholds.items():
        assert np.isclose(place[2], level if height is None else height, atol=1e-3), foot


def test_a_foothold_of_a_wrong_shape_is_refused():
    with raises(InputError, "(4,)"):
        run(trot(foothold=lambda foot, touchdown, walk: np.zeros(4)), 0.3)


def test_a_user_defined_adjustment_decides_where_feet_land_and_may_keep_its_arguments():
    asked, kept = set(), []

    def none(
        plan: StepPlan, path: Any, com: np.ndarray, com_velocity: np.ndarray, t: float
    ) -> dict[str, np.ndarray]:
        asked.update(plan.swings)
        assert com.shape == com_velocity.shape == (3,) and path.time == t
        kept.append((com, com_velocity))
        return {foot: each.planned_end[:2] for foot, each in plan.planned_swings.items()}

    walk, default = trot(adjustment=none), trot()
    push = fb.Push([0.0, 60.0, 0.0], start=0.45, duration=0.02)
    for each in (walk, default):
        assert run(each, 1.0, push).outcome == "completed"
    assert asked == {foot.frame for foot in walk.robot.feet}
    assert all(len({part.tobytes() for part in parts}) > 400 for parts in zip(*kept, strict=True))
    for step in list(walk.history)[1:]:
        for foot, swing in step.planned_swings.items():
            assert np.allclose(step.footholds[foot][:2], swing.planned_end[:2], atol=0.03)

    def moved(walk: Walk) -> list[float]:
        before, after = list(walk.history)[2:4]
        planned = before.planned_swings.items()
        return [abs(after.feet[foot][1] - swing.planned_end[1]) for foot, swing in planned]

    assert max(moved(walk)) < 0.01 < min(moved(default))  # m


def test_a_plan_may_be_replaced_and_made_more_often():
    class Wrapped:
        """A plan of the centre of mass that the compiled function does not know."""

        def __init__(self, lipm: LIPM):
            self.dcm, self.zmp, self.omega, self._lipm = lipm.dcm, lipm.zmp, lipm.omega, lipm

        def __call__(self, t: float) -> Any:
            return self._lipm(t)

    def wrap(plan: StepPlan, state: fb.State) -> StepPlan:
        return replace(plan, plan=Wrapped(plan.plan))

    def often(plan: StepPlan, state: fb.State) -> StepPlan:
        return replace(plan, replan_time=plan.time + 0.02)

    default, wrapped, more = (trot(modify_plan=change) for change in (None, wrap, often))
    records = [run(walk, 0.8) for walk in (default, wrapped, more)]
    assert all(record.outcome == "completed" for record in records)
    assert np.abs(records[0].q - records[1].q).max() < 1e-9
    assert len(more.history) > 30 > 5 > len(default.history)
    with raises(InputError, "modify_plan"):
        run(trot(modify_plan=lambda plan, state: 3), 0.1)


def test_swings_may_have_another_shape_or_class():
    class Wrapped:
        """A `Swing` that the compiled function does not know."""

        def __init__(self, swing: Swing):
            self._swing = swing

        def __getattr__(self, name: str) -> Any:
            return getattr(self._swing, name)

        def __call__(self, t: float) -> Any:
            return self._swing(t)

        def with_end(self, end: npt.ArrayLike) -> Any:
            return Wrapped(self._swing.with_end(end))

    def high(start: np.ndarray, end: np.ndarray, *others: float) -> Swing:
        return replace(Swing(start, end, *others), height=0.09)

    records = [
        run(trot(swing=swing), 0.6) for swing in (high, lambda *given: Wrapped(high(*given)))
    ]
    for record in records:
        assert record.outcome == "completed"
    height = records[0].foot_positions[:, :, 2].max(axis=0)
    assert np.all(height[[0, 3]] > 0.08)
    assert np.abs(records[0].q - records[1].q).max() < 1e-9


def test_the_body_may_be_lower_and_pitched_while_it_walks():
    walk = trot(height=-0.03)
    sim = fb.Simulation(walk.robot)
    assert fb.rollout(sim, walk, 1.0, control_period=PERIOD).outcome == "completed"
    walk.pitch = 0.1
    record = fb.rollout(sim, walk, 1.0, control_period=PERIOD)
    standing = walk.robot.standing()
    assert record.outcome == "completed"
    assert np.isclose(record.com[-1, 2] - standing.com[2], -0.03, atol=0.005)
    x_axis = record.final.frame_pose("base").rotation[:, 0]
    assert np.isclose(np.arcsin(-x_axis[2]), 0.1, atol=0.02)


def test_the_commanded_motion_approaches_its_goal_at_the_largest_acceleration():
    walk = trot(velocity=(0.4, 0.0), yaw_rate=0.3, acceleration=(0.5, 2.0))
    standing = walk.robot.standing()
    for t in np.arange(0.0, 0.61, 0.1):
        walk(standing.q, standing.v, float(t))
    assert np.allclose(walk.path.velocity, [0.5 * 0.4, 0.0, 0.3])
    assert np.allclose(walk.path_at(2.0).velocity, [0.4, 0.0, 0.3])


def test_soles_follow_a_ground_that_is_known():
    """With level soles, talos slid 20 mm in each stance on a slope of 5°."""
    robot, angle = judges.load("talos"), np.deg2rad(5.0)
    slope = fb.Ground(normal=[-np.sin(angle), 0.0, np.cos(angle)])
    contacts, slides = fb.Contacts.feet(robot, mu=0.6, normals=slope.normals[0]), {}
    for known in (None, slope):
        walk = Walk(robot, contacts, Gait.walk(robot), (0.2, 0.0), ground=known)
        record = run(walk, 3.2, ground=slope)
        assert record.outcome == "completed"
        slides[known is None] = record.slip(include_rolling=False).max()
    assert slides[False] < 2e-3 < 5e-3 < slides[True]  # m


def test_a_pendulum_of_another_frequency_is_followed_as_planned():
    def slower(plan: StepPlan, state: fb.State) -> StepPlan:
        return replace(plan, plan=replace(plan.plan, omega=0.8 * plan.plan.omega))

    walk = trot(modify_plan=slower)
    state = walk.robot.standing()
    walk(state.q, state.v, 0.0)
    targets, plan = walk(state.q, state.v, 0.1).targets["centre of mass"], walk.history[-1].plan
    assert np.allclose(targets.reshape(3, 3)[:, :2], plan(0.1), rtol=0.0, atol=1e-12)


def test_a_class_derived_from_swing_keeps_its_shape_with_another_end():
    class Higher(Swing):
        def __call__(self, t: float) -> Any:
            position, velocity, acceleration = super().__call__(t)
            return position + [0.0, 0.0, 1.0], velocity, acceleration

    path = Higher([0.0, 0.0, 0.0], [0.1, 0.0, 0.0], 0.0, 0.3).with_end([0.2, 0.0, 0.0])
    assert path(0.3)[0].tolist() == [0.2, 0.0, 1.0]


def test_joints_brake_as_the_torque_limits_of_a_walk_allow(go2, standing):
    torque_limits = 0.2 * go2.torque_limits
    walk = trot(torque_limits=torque_limits)
    command = walk(standing.q, standing.v, 0.0)
    assert command.joint_limits is not None
    expected = JointLimits.of(go2, torque_limits=torque_limits).braking
    assert np.array_equal(command.joint_limits.braking, expected)
    assert not np.array_equal(expected, JointLimits.of(go2).braking)
