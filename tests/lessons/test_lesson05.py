"""Lesson 05: its helpers do what they say, and wrong answers of each kind get the hint that fits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hints import missed, right

import floatbase as fb
from floatbase.dynamics import internal_forces, torque_force_matrix
from floatbase.lessons.lesson03 import standing_go2
from floatbase.lessons.lesson05 import (
    GivenForces,
    arm_robot,
    com_in_base,
    leans,
    planned_pull,
    pressed,
    reaching,
    rose_controller,
    show_forces,
    show_moved_com,
    squeezes,
    three_feet,
)
from floatbase.objectives import (
    com_wrench,
    desired_wrench,
    force_bias,
    moment_sum,
    normal_bias,
    tangential_bias,
    torque_for_forces,
    wrench_objective,
)

GO2 = fb.load("go2")
EOM = standing_go2()
FORCE = np.array([60.0, 0.0, GO2.weight])  # N, world: of exercise 05.4
COST = wrench_objective(EOM.state, EOM.contacts, FORCE, [0.0, 0.0, 0.0])
ROUNDING = 1e-9  # of forces of 100 N and levers of 1 m


def leaning(weight: float = 1e-3, direction: Any = FORCE) -> fb.Quadratic:
    """The wish, and friction counted from another direction than the ground's normal."""
    normals = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    return COST + weight * tangential_bias(fb.Contacts.points(GO2, normals=normals))


def test_05_1_takes_the_moments_about_the_centre_of_mass() -> None:
    assert right("05.1", moment_sum(three_feet().state, three_feet().contacts))


def test_05_1_knows_order_transpose_point_unit_feet_and_shape() -> None:
    state, contacts = three_feet().state, three_feet().contacts
    G = moment_sum(state, contacts)
    levers = contacts.positions(state) - state.com
    blocks = [np.cross(lever, np.eye(3)).T for lever in levers]

    def about(point: Any) -> Any:
        return np.hstack([np.cross(x - point, np.eye(3)).T for x in contacts.positions(state)])

    wrong = {
        "The opposite moment": -G,
        "opposite moment": np.hstack([block.T for block in blocks]),
        "about the base's origin": about(state.frame_pose("base").translation),
        "about the world's origin": about(np.zeros(3)),
        "The unit": 1000 * G,
        "in the opposite order": np.hstack(blocks[::-1]),
        "in a wrong order": np.hstack([blocks[1], blocks[0], blocks[2]]),
        "FL is in the air": moment_sum(state, fb.Contacts.points(GO2)),
        "`np.hstack`": np.vstack(blocks),
        "added up": sum(blocks),
        "That is a moment": G @ np.ones(9),
        "nothing there yet": np.zeros((3, 9)),
        "no answer yet": None,
        "Neither right": np.ones((3, 9)),
    }
    assert missed("05.1", [(answer, hint) for hint, answer in wrong.items()]) == []


def test_05_2_takes_mass_times_acceleration_and_the_weight() -> None:
    assert right("05.2", desired_wrench(EOM.state, [0.5, 0.0, 1.0])[0])


def test_05_2_knows_gravity_mass_and_sign() -> None:
    a, m, weight = np.array([0.5, 0.0, 1.0]), GO2.mass, np.array([0.0, 0.0, GO2.weight])
    wrong = {
        "holds it still": weight,
        "Gravity is forgotten": m * a,
        "The sign of gravity": m * a - weight,
        "counts twice": m * a + 2 * weight,
        "these are m/s²": a + weight / m,
        "in one of the two parts": a + weight,
        "is an acceleration": m * a + weight / m,
        "Weight times acceleration": GO2.weight * a + weight,
        "the sign is not": -(m * a + weight),
        "no answer yet": None,
        "shape": np.zeros(6),
    }
    assert missed("05.2", [(answer, hint) for hint, answer in wrong.items()]) == []


def test_05_3_takes_the_smallest_torques_of_the_forces() -> None:
    assert right("05.3", torque_for_forces(arm_robot()).torque(pressed()))


def test_05_3_knows_what_is_solved_for_what_is_forgotten_and_what_is_larger() -> None:
    eom = arm_robot()
    C, a = torque_force_matrix(eom)
    C_tau, C_forces = C[:, :18], C[:, 18:]
    inverse, least = np.linalg.pinv(C_tau), torque_for_forces(eom).torque
    standing = pressed().copy()
    for foot, side in (("LF_FOOT", 20.0), ("RF_FOOT", -20.0)):
        standing[eom.contacts.force_slice(foot)] -= [0.0, side, 0.0]
    tau = least(pressed())
    wrong = {
        "of the whole C": (np.linalg.pinv(C) @ a)[:18],
        "a is forgotten": -inverse @ C_forces @ pressed(),
        "λ is forgotten": inverse @ a,
        "The sign of C_λ λ": inverse @ (a + C_forces @ pressed()),
        "The sign of a": inverse @ (-a - C_forces @ pressed()),
        "A transpose": C_tau.T @ (a - C_forces @ pressed()),
        "for less": eom.h[6:] - eom.J[:, 6:].T @ pressed(),
        "without the squeeze": eom.h[6:] - eom.J[:, 6:].T @ standing,
        "forces of standing still": least(standing),
        "those are forces": pressed(),
        "that is (τ, λ)": np.concatenate([tau, pressed()]),
        "six zeros": eom.S @ tau,
        "one column": tau[:, None],
        "nothing there yet": np.zeros(18),
        "no answer yet": None,
        "Neither right": np.ones(18),
    }
    assert missed("05.3", [(answer, hint) for hint, answer in wrong.items()]) == []


def test_05_4_takes_any_cost_whose_forces_hold_on_the_physics() -> None:
    assert right("05.4", leaning())
    by_hand = np.linalg.pinv(com_wrench(EOM.state, EOM.contacts).A) @ [*FORCE, 0, 0, 0]
    by_hand[0::3] += [-7.8, -7.8, 7.8, 7.8]
    assert right("05.4", fb.Quadratic.from_residual(np.eye(12), by_hand))


def test_05_4_knows_what_is_wrong() -> None:
    smallest = COST.minimiser()
    pulling = smallest + 25.0 * squeezes(EOM.contacts)["diagonal"]
    share = GO2.weight / 4
    wrong = [
        (COST + 1e-3 * force_bias(EOM.contacts, 0.1, share), "foot FL leans 0.79"),
        (COST + force_bias(EOM.contacts, 0.1, share), "f_c is (46.8, 0, 158) N"),
        (COST + 1e-3 * force_bias(EOM.contacts, 10.0, share), "the moment is not"),
        (fb.Quadratic.from_residual(np.eye(12), pulling), "a foot pulls"),
        (COST.pullback(fb.forces_from_torques(arm_robot())), "18 numbers"),
        (COST.pullback(fb.forces_from_torques(EOM)), "a cost on τ"),
        (leaning().pullback(fb.forces_from_torques(EOM)), "a cost on τ"),
        (force_bias(EOM.contacts, 0.1, share), "f_c is (0, 0, 158) N"),
        (leaning(direction=[30.0, 0.0, GO2.weight]), "leans"),
        (smallest, "Give the cost"),
        (-1.0 * COST, "no least point"),
        (None, "no answer yet"),
    ]
    assert missed("05.4", wrong) == []


def test_05_4_is_out_of_reach_of_weights() -> None:
    """No α and no weight of (23) keeps both the wish and the lean, whatever the normal force it prefers."""
    tangential = tangential_bias(EOM.contacts)
    for a in (0.0, 20.0, GO2.weight / 4, 60.0):
        normal = normal_bias(EOM.contacts, a)
        for alpha in (0.0, 0.01, 0.1, 1.0, 10.0):
            for weight in 10.0 ** np.arange(-4.0, 2.0, 0.5):
                assert not right("05.4", COST + weight * (tangential + alpha * normal))


def test_squeezes_leave_the_wrench_and_the_base_alone() -> None:
    found = np.column_stack(list(squeezes(EOM.contacts).values()))
    assert abs(com_wrench(EOM.state, EOM.contacts).A @ found).max() < ROUNDING
    inside = internal_forces(EOM)
    assert abs(found - inside @ (inside.T @ found)).max() < ROUNDING
    assert np.linalg.matrix_rank(found) == 4


@pytest.mark.parametrize("normal", [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]])
def test_a_lean_is_friction_over_normal_force(normal: list[float]) -> None:
    contacts = fb.Contacts.points(GO2, normals=normal)
    n, t = np.array(normal), np.array([0.0, 1.0, 0.0])
    forces = [10 * n + 5 * t, 10 * n, -10 * n + t, t]
    np.testing.assert_allclose(leans(contacts, np.ravel(forces)), [0.5, 0.0, np.inf, np.inf], atol=ROUNDING)


def test_the_arm_takes_the_centre_of_mass_along() -> None:
    ahead, left, right_hand = (com_in_base(reaching(turn)) for turn in (0.0, np.pi / 2, -np.pi / 2))
    assert left[1] > 0.04 > 0.005 > abs(ahead[1]) and right_hand[1] < -0.04
    assert ahead[0] > left[0] + 0.04
    state = reaching(1.0).replace(v=None)
    turned = com_in_base(state)
    expected = state.frame_pose("base").inverse().act(state.com)
    np.testing.assert_allclose(turned, expected, atol=ROUNDING)


def test_given_forces_are_measured_on_the_physics() -> None:
    forces = leaning().minimiser()
    record = fb.rollout(fb.Simulation(GO2, 0.5), GivenForces(GO2, EOM.contacts, forces), 0.1)
    np.testing.assert_allclose(record.measured[-1], forces, atol=1.0)  # N: the robot has moved by 2 cm
    np.testing.assert_allclose(record.planned[-1], forces, atol=ROUNDING)
    assert record.final.com_velocity[0] == pytest.approx(0.1 * 60.0 / GO2.mass, rel=0.03)


def test_a_light_push_is_survived_and_a_plan_that_pulls_comes_before_the_fall() -> None:
    light, hard = (
        fb.rollout(fb.Simulation(GO2), rose_controller(), 0.5, [fb.Push(np.array([0.0, size, 0.0]), start=0.05)])
        for size in (30.0, 80.0)
    )
    assert light.outcome == "completed" and light.planned[:, 2::3].min() > 0
    assert hard.outcome == "fell"
    assert np.argmax((hard.planned[:, 2::3] < 0).any(axis=1)) in range(50, len(hard) - 1)
    axis = planned_pull(hard, 0.25).axes[0]
    assert axis.get_ylim()[0] < 0 and axis.get_xlim() == (0.0, 0.25)


def test_the_pictures_are_drawn() -> None:
    view = fb.Viewer(GO2)
    try:
        forces = leaning().minimiser()
        note = show_forces(view, EOM.state, EOM.contacts, forces, wish=[60, 0, 0])
        assert "(60, 0, 0) N" in note and "(0, 0, 0) N·m" in note
        assert {"wish", "wrench"} <= {path.split("/")[0] for path in view.canvas.picture}
        assert "(60" in show_forces(view, EOM.state, EOM.contacts, forces) and "wish" not in view.canvas.picture
    finally:
        view.close()
    arm_view = fb.Viewer(reaching(0.0).robot)
    try:
        drawn = show_moved_com(arm_view, reaching(1.0), reaching(0.0), "before").canvas.picture
        np.testing.assert_allclose(drawn["earlier/spot"].matrix[:2, 3], reaching(0.0).com[:2], atol=ROUNDING)
    finally:
        arm_view.close()
