"""Lesson 02: its experiments are what they say, and wrong answers get the hint that fits."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from panels import assert_a_slider_redraws

import floatbase as fb
from floatbase.lessons import check, lesson01, lesson02
from floatbase.robots import Robot


@pytest.fixture(autouse=True)
def no_progress_of_a_learner_is_touched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("floatbase.lessons.progress.record", lambda *_: None)


@pytest.fixture(scope="module")
def go2() -> Robot:
    return fb.load("go2")


@pytest.fixture(scope="module")
def moving(go2: Robot) -> fb.State:
    """The state of the lesson's exercises."""
    slow = go2.random_state(5)
    return slow.replace(v=8 * slow.v)


def motion(eom: Any, tau: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """As the lesson has it, by least squares."""
    system = np.block([[eom.M, -eom.J.T], [eom.A, np.zeros((len(eom.A), eom.k))]])
    both = np.linalg.lstsq(system, np.concatenate([eom.S @ tau - eom.h, b]), rcond=None)[0]
    return both[: eom.nv], both[eom.nv :]


def test_pinned_feet_stay_with_b_and_leave_without(go2: Robot) -> None:
    contacts = lesson02.pins(go2)
    kept = lesson02.strayed(lesson02.collapse(go2.standing(), contacts, motion, True, 0.1), contacts)
    gone = lesson02.strayed(lesson02.collapse(go2.standing(), contacts, motion, False, 0.1), contacts)
    assert kept[0] == gone[0] == 0.0
    assert gone[-1] > 20 * kept[-1]


def test_constant_torques_record_what_the_equation_says(go2: Robot) -> None:
    contacts = fb.Contacts.points(go2)
    record = lesson02.run_constant(go2, contacts, np.zeros(12), motion, duration=0.01)
    eom = fb.equations_of_motion(record.state(3), contacts)
    assert np.allclose(record.planned[3], motion(eom, np.zeros(12), eom.b)[1])
    assert not record.tau.any()


@pytest.mark.parametrize(("way", "turn"), [(0.5, -0.7), (1.0, 1.5), (0.3, 0.0)])
def test_the_disc_parks_without_slip_where_geometry_says(way: float, turn: float) -> None:
    disc, wheel = lesson02.disc(), lesson02.wheel()
    states = lesson02.park(disc, way, turn)
    assert max(np.abs(wheel.slip(state)).max() for state in states) < 1e-12
    moved = states[-1].q[:2] - states[0].q[:2]
    assert np.allclose(moved, way * np.array([1 - np.cos(turn), -np.sin(turn)]), atol=1e-12)
    assert np.allclose(states[-1].frame_pose("disc").rotation, np.eye(3), atol=1e-12)
    for before, after in pairwise(states):  # each velocity leads to the next state
        step = pin.difference(disc.model, before.q, after.q) * 20
        assert np.linalg.norm(step - before.v) < 0.2 * (np.linalg.norm(before.v) + 1e-9)


def test_sliders_of_every_picture_redraw_it(go2: Robot) -> None:
    disc = lesson02.disc()
    contacts = fb.Contacts.points(go2)
    for robot, panel in (
        (go2, lambda view: lesson02.force_panel(view, go2.standing(), contacts, "FL_foot")),
        (disc, lambda view: lesson02.parking_panel(view, disc)),
    ):
        assert_a_slider_redraws(robot, panel)


def test_the_equation_is_drawn_and_the_collapse_is_played(go2: Robot) -> None:
    state, contacts = go2.standing(), lesson02.pins(go2)
    figure = lesson02.draw_equation(fb.equations_of_motion(state, contacts))
    assert [axis.get_title() for axis in figure.axes] == ["M q̈", "+ h", "= S τ", "+ Jᵀ λ"]
    assert [label.get_text() for label in figure.axes[3].get_xticklabels()] == ["FL", "FR", "RL", "RR"]
    states = lesson02.collapse(state, contacts, motion, True, 0.02)
    view = fb.Viewer(go2)
    try:
        assert "with b" in str(lesson02.play_collapse(view, states, states, contacts, 0.02).window.scene.file_commands())
    finally:
        view.close()
    axis = lesson02.plot_strayed({"a": lesson02.strayed(states, contacts)}, 0.02)
    assert axis.get_yscale() == "log"


def hint(name: str, answer: Any) -> str:
    verdict = check(name, answer)
    assert not verdict.right
    return verdict.text


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        ((9, 8), "base's directions"),
        ((9, 9), "six directions, not one"),
        ((9, 15), "quaternion"),
        ((14, 9), "transpose"),
        ((3, 14), "three feet touch"),
        ((12, 14), "not four"),
        (9, "a single number"),
        (None, "no answer yet"),
        ("nine", "should be numbers"),
    ],
)
def test_wrong_shapes_of_j_get_their_hint(answer: Any, text: str) -> None:
    assert text in hint("02.1", answer)


PUSH = np.array([10.0, -5.0, 40.0])


def test_wrong_generalised_forces_get_their_hint(moving: fb.State) -> None:
    J = moving.frame_jacobian("FL_foot")
    right = J[:3].T @ PUSH
    assert check("02.2", right).right
    R = moving.frame_pose("base").rotation
    in_world = np.concatenate([R @ right[:3], R @ right[3:6], right[6:]])
    assert "sign" in hint("02.2", -right)
    assert "world axes" in hint("02.2", in_world)
    assert "base's rows are zero" in hint("02.2", moving.robot.S @ right[6:])
    assert "joints alone" in hint("02.2", right[6:])
    assert "transpose goes back" in hint("02.2", PUSH)
    assert "first three" in hint("02.2", np.zeros(6))
    assert "does nothing" in hint("02.2", np.zeros(18))
    assert "no answer yet" in hint("02.2", None)
    assert "shape (18, 1)" in hint("02.2", right[:, None])


def test_wrong_drifts_get_their_hint(moving: fb.State) -> None:
    right = -moving.frame_drift("FL_foot")[:3]
    assert check("02.3", right).right
    R = moving.frame_pose("FL_foot").rotation
    spatial = pin.getFrameAcceleration(
        moving.robot.model, moving._data, moving.robot.frame_id("FL_foot"), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    ).linear
    assert "which sign has b" in hint("02.3", -right)
    assert "forgets the drift" in hint("02.3", np.zeros(3))
    assert "foot's axes" in hint("02.3", R.T @ right)
    assert "ω × v is missing" in hint("02.3", -spatial)
    assert "velocity of the foot" in hint("02.3", moving.frame_velocity("FL_foot")[:3])
    assert "shape (6,)" in hint("02.3", -moving.frame_drift("FL_foot"))
    assert "no answer yet" in hint("02.3", None)


@pytest.fixture(scope="module")
def holding(go2: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Torques and forces that hold, by the lever rule and one leg at a time."""
    state = go2.standing()
    contacts = fb.Contacts.points(go2)
    feet = contacts.positions(state) - state.com
    front, rear = abs(feet[0, 0]), abs(feet[2, 0])
    left, right = abs(feet[0, 1]), abs(feet[1, 1])
    share = np.outer([rear, front], [right, left]).ravel() / ((front + rear) * (left + right))
    forces = go2.weight * share[:, None] * [0.0, 0.0, 1.0]
    return state.h[6:] - contacts.jacobian(state).T[6:] @ forces.ravel(), forces


def test_holding_by_levers_is_right_and_wrong_holdings_get_their_hint(
    go2: Robot, holding: tuple[np.ndarray, np.ndarray]
) -> None:
    tau, forces = holding
    gravity = go2.standing().h[6:]
    assert check("02.4", (tau, forces)).right
    assert check("02.4", (tau, forces.ravel())).right
    assert "push the robot down" in hint("02.4", (tau, -forces))
    assert "force rows" in hint("02.4", (tau, 0.5 * forces))
    assert "moment rows" in hint("02.4", (tau, forces[::-1]))
    assert "Jᵀ λ is missing" in hint("02.4", (gravity, forces))
    assert "same side" in hint("02.4", (2 * gravity - tau, forces))
    assert "the sign is not" in hint("02.4", (-tau, forces))
    assert "left over" in hint("02.4", (tau + 1.0, forces))
    assert "one foot pulls" in hint("02.4", (tau, forces + np.outer([1, -1, -1, 1], [0.0, 0.0, 100.0])))


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        (None, "no answer yet"),
        ((None, None), "no answer yet"),
        (np.zeros(12), "two arrays"),
        (("a", "b"), "two arrays of numbers"),
        ((np.zeros(18), np.zeros(12)), "shapes are (18,) and (12,)"),
        ((np.full(12, np.nan), np.zeros(12)), "not finite"),
    ],
)
def test_holdings_of_the_wrong_kind_get_their_hint(answer: Any, text: str) -> None:
    assert text in hint("02.4", answer)


def test_the_arm_turns_about_a_tool_that_rests() -> None:
    arm = fb.load("ur5", posture=lesson01.PRESSING)
    state = lesson02.turning_about_its_tool(arm)
    assert np.linalg.norm(state.v) == pytest.approx(3.0)
    assert abs(state.frame_velocity("tool0")[:3]).max() < 1e-12
    assert np.linalg.norm(state.frame_drift("tool0")[:3]) > 0.3


def test_a_jacobian_of_another_posture_and_angular_rows_get_their_hint(moving: fb.State) -> None:
    standing = moving.robot.standing()
    assert "another posture" in hint("02.2", standing.frame_jacobian("FL_foot")[:3].T @ PUSH)
    assert "angular rows" in hint("02.2", moving.frame_jacobian("FL_foot")[3:].T @ PUSH)
    assert "angular rows" in hint("02.3", -moving.frame_drift("FL_foot")[3:])


def test_the_arm_without_its_drift_leaves_and_both_are_played() -> None:
    arm = fb.load("ur5", posture=lesson01.PRESSING)
    start = lesson02.turning_about_its_tool(arm)

    def controller(q: np.ndarray, v: np.ndarray, t: float) -> lesson01.Torques:
        return lesson01.Torques(fb.State(arm, q, v).h)  # q̈ = 0: no b

    sim = fb.Simulation(arm)
    sim.reset(start)
    record = fb.rollout(sim, controller, 0.1)
    assert lesson02.tool_path(record)[0] == 0.0
    assert lesson02.tool_path(record)[-1] > 1.0
    view = fb.Viewer(arm)
    try:
        drawn = str(lesson02.play_tools(view, record, record).window.scene.file_commands())
        assert "with b" in drawn
        assert "way" in drawn
    finally:
        view.close()


def test_the_columns_of_another_robot_get_their_hint() -> None:
    assert "go2's" in hint("02.1", (9, 18))
