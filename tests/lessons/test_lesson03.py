"""Lesson 03: its helpers do what they say, and wrong answers of each kind get the hint that fits."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from hints import missed, right

import floatbase as fb
from floatbase.dynamics import dimensions, internal_forces, torque_force_matrix
from floatbase.lessons import ConstantTorques
from floatbase.lessons.lesson03 import (
    bars,
    direction,
    matrix_picture,
    rising_solo8,
    show_beta,
    show_knee,
    space_of,
    standing_go2,
    standing_still,
    tilted_squeeze,
    upright,
)

GO2 = fb.load("go2")
RANK_TOLERANCE = 1e-9  # of the largest singular value: solo8 has 1e-2 above it, and rounding of 1e-16 below
WOBBLE = np.array([0, 0, 1, 0, 0, -1, 0, 0, -1, 0, 0, 1.0])  # forces without a sum and without a moment


def torques() -> Any:
    eom, squeeze = tilted_squeeze()
    return -eom.J[:, 6:].T @ squeeze


def turned(forces: Any, R: Any) -> Any:
    return (forces.reshape(4, 3) @ R.T).ravel()


def test_03_1_knows_each_wrong_count() -> None:
    assert right("03.1", 11)
    wrong = {12: "moves nothing", 1: "do not move", 6: "components", 9: "three feet", 5: "legs move", 10: "more than"}
    assert missed("03.1", [*wrong.items(), ([11, 11], "shape")]) == []


def test_03_2_takes_the_torques_that_change_forces_and_nothing_else() -> None:
    assert right("03.2", torques())
    eom, squeeze = tilted_squeeze()
    zeta, eta = fb.forces_from_torques(eom), fb.accelerations_from_torques(eom)
    assert np.allclose(zeta.A @ torques(), squeeze, atol=1e-9)
    assert np.allclose(eta.A @ torques(), 0.0, atol=1e-9)


def test_03_2_knows_sign_transpose_frame_and_what_does_not_belong() -> None:
    eom, squeeze = tilted_squeeze()
    R, J = eom.state.frame_pose("base").rotation, eom.J[:, 6:]
    wrong = {
        "sign": -torques(),
        "transpose": -J @ squeeze,
        "The frame: J and": -J.T @ turned(squeeze, R.T),
        "The frame: the forces": -J.T @ turned(squeeze, R),
        "h is in it": torques() + eom.h[6:],
        "another posture": -standing_go2().J[:, 6:].T @ squeeze,
        "no torques at all": np.zeros(12),
        "18 numbers": -eom.J.T @ squeeze,
        "6 numbers": eom.J[:, :6].T @ squeeze,
        "one column": torques()[:, None],
        "shape": np.zeros(5),
        "not finite": np.full(12, np.nan),
        "should be numbers": "torques",
        "no answer yet": None,
        "Neither right": np.ones(12),
    }
    assert missed("03.2", [(answer, hint) for hint, answer in wrong.items()]) == []


def test_03_3_takes_any_forces_that_balance() -> None:
    eom = standing_go2()
    forces = np.linalg.lstsq(eom.J[:, :6].T, eom.h[:6], rcond=1e-9)[0]
    less = forces + (20 - forces[2]) * WOBBLE
    sideways = internal_forces(eom) @ internal_forces(eom).T @ np.eye(12)[1]
    assert right("03.3", less)
    assert right("03.3", less + 5 * sideways)


def test_03_3_knows_what_is_wrong() -> None:
    eom = standing_go2()
    forces = np.linalg.lstsq(eom.J[:, :6].T, eom.h[:6], rcond=1e-9)[0]
    vertical = np.array([0, 0, 1.0])
    short = forces.copy()
    short[2] = 20.0
    moved = short + np.concatenate([np.zeros(9), (forces[2] - 20) * vertical])
    wrong = {
        "Nothing has changed": forces,
        "add up to the weight": short,
        "moments": moved,
        "mind the sign": forces - (20 - forces[2]) * WOBBLE,
        "carries 30.0 N": forces + (30 - forces[2]) * WOBBLE,
        "shape": forces.reshape(4, 3),
        "no answer yet": None,
    }
    assert missed("03.3", [(answer, hint) for hint, answer in wrong.items()]) == []


def pairs_by_svd(C: Any, right_side: Any, tolerance: float = RANK_TOLERANCE) -> Any:
    """v and V⊥ of C x = right_side as columns, by (11)."""
    U, s, Vt = np.linalg.svd(C)
    r = int(np.sum(s > tolerance * s[0]))
    return np.column_stack([Vt[:r].T @ (U[:, :r].T @ right_side / s[:r]), Vt[r:].T])


def test_03_4_takes_any_orthonormal_columns_behind_the_shortest_pair() -> None:
    built = pairs_by_svd(*torque_force_matrix(rising_solo8()))
    assert built.shape == (20, 11)
    assert right("03.4", built)
    turned = np.linalg.qr(np.random.default_rng(0).standard_normal((10, 10)))[0]
    assert right("03.4", np.column_stack([built[:, 0], built[:, 1:] @ turned]))


def test_03_4_knows_what_was_forgotten_and_what_was_miscounted() -> None:
    eom = rising_solo8()
    C, right_side = torque_force_matrix(eom)
    built, drop, J_M = pairs_by_svd(C, right_side), eom.J @ np.linalg.solve(eom.M, eom.h), eom.J @ eom.M
    v, V = built[:, 0], built[:, 1:]
    Vt = np.linalg.svd(C)[2]
    not_inverted = pairs_by_svd(np.hstack([J_M @ eom.S, J_M @ eom.J.T]), eom.b + J_M @ eom.h)
    wrong = [
        (pairs_by_svd(C, drop), "b is missing"),
        (pairs_by_svd(C, eom.b), "h is missing"),
        (pairs_by_svd(C, eom.b - drop), "The sign of h"),
        (pairs_by_svd(C, drop - eom.b), "The sign of b"),
        (not_inverted, "M is not inverted"),
        (np.column_stack([v + 0.1 * V[:, 0], V]), "longer than need be"),
        (np.column_stack([v, Vt[12:].T]), "not every row says"),
        (np.column_stack([v, Vt[:, 10:]]), "its rows are the directions"),
        (np.column_stack([v, Vt[:10].T]), "its rows are the directions"),
        (np.column_stack([v, V, V[:, 0] + Vt[0]]), "not to zero"),
        (np.column_stack([v, 2.0 * V]), "not orthonormal"),
        (built[:, :-1], "1 missing"),
        (built[:, ::-1], "does not solve"),
        (np.zeros((20, 9)), "still zero"),
        (built.T, "These are rows"),
        (np.zeros((34, 11)), "with q̈"),
        (v, "One matrix"),
        (3.0, "One matrix"),
        (np.full((20, 11), np.nan), "not finite"),
        (None, "no answer yet"),
    ]
    assert missed("03.4", wrong) == []


def test_the_solo8_of_03_4_moves_without_asking_its_feet_for_the_impossible() -> None:
    eom = rising_solo8()
    assert np.linalg.matrix_rank(eom.J, tol=RANK_TOLERANCE) == 10
    np.testing.assert_allclose(eom.J @ eom.state.v, 0.0, atol=1e-12)
    assert abs(eom.b).max() > 0.1
    reached = eom.J @ np.linalg.pinv(eom.J, rcond=RANK_TOLERANCE) @ eom.b
    np.testing.assert_allclose(reached, eom.b, atol=1e-12)


@pytest.mark.parametrize("frames", [(), ("FL_foot", "FR_foot", "RL_foot"), ("FL_foot",)], ids=len)
def test_a_direction_gives_the_base_what_was_requested_with_least_change_of_forces(frames: tuple[str, ...]) -> None:
    space = space_of(GO2, *frames)
    desired = [0.3, -0.2, 1.0, 0.1, 0.5, -0.4] if len(frames) != 1 else [0, 0, 1.0, 0, 0, 0]
    step = direction(space, base=desired)
    np.testing.assert_allclose((space.qdd.A @ step)[:6], desired, atol=1e-9)
    free = np.linalg.svd(space.qdd.A[:6])[2][6:].T
    np.testing.assert_allclose((space.forces.A @ free).T @ (space.forces.A @ step), 0.0, atol=1e-7)


def test_standing_still_is_in_the_space_and_still() -> None:
    space = space_of(GO2)
    qdd, tau, forces = space(standing_still(space))
    assert abs(qdd).max() < 1e-9
    motion, feet = space.eom.residual(qdd, tau, forces)
    assert max(abs(motion).max(), abs(feet).max()) < 1e-9


@pytest.mark.parametrize("bend", [0.0, 0.5, 1.5])
def test_upright_puts_every_foot_on_the_ground_below_its_hip(bend: float) -> None:
    solo12 = fb.load("solo12")
    state = upright(solo12, bend)
    assert [round(foot, 9) for foot in fb.Contacts.points(solo12).positions(state)[:, 2]] == [0.0] * 4
    straight = dimensions(fb.equations_of_motion(state, fb.Contacts.points(solo12)))
    assert straight.rank_J == (11 if bend == 0 else 12)


def test_the_pictures_are_drawn() -> None:
    space = space_of(GO2)
    view = fb.Viewer(GO2)
    try:
        assert "svg" in show_beta(view, space, standing_still(space))
    finally:
        view.close()
    solo12 = fb.load("solo12")
    view = fb.Viewer(solo12)
    try:
        text = show_knee(view, solo12, 0.0, np.zeros(12))
    finally:
        view.close()
    assert "rank J = <b>11</b>" in text
    assert len(matrix_picture(np.eye(4), {"a": 1, "b": 3}, {"c": 2, "d": 2}).axes) == 3  # with the colour bar
    assert ConstantTorques([1.0])(np.zeros(1), np.zeros(1), 0.0).tau == [1.0]


def test_every_bar_says_its_name_its_number_and_its_unit() -> None:
    numbers = np.arange(42.0) - 3
    said = re.findall(r"<title>(.*?): (.*?) (.*?)</title>", bars(numbers[:18], numbers[18:30], numbers[30:]))
    assert [float(number) for _, number, _ in said] == list(numbers)
    assert said[0] == ("q̈ base x", "-3", "m/s²") and said[3] == ("q̈ turning x", "0", "rad/s²")
    assert said[6] == ("q̈ front left hip", "3", "rad/s²") and said[20] == ("τ front left knee", "17", "N·m")
    assert said[-1] == ("λ rear right z", "38", "N")
    assert re.findall("<title>(.*?)</title>", bars(np.full(18, -1e-12), np.zeros(12), np.zeros(12)))[0] == "q̈ base x: 0 m/s²"


def test_bars_are_as_long_as_their_numbers_and_those_that_are_longer_have_an_end() -> None:
    def heights(drawn: str) -> list[float]:
        return [float(height) for height in re.findall(r'height="([\d.]+)" fill="#', drawn)]

    drawn = bars(np.zeros(18), np.array([10.0, -5.0, 20.0] * 4), np.array([0.0, 50.0, 300.0] * 4), full=(20.0, 20.0, 100.0))
    full = heights(drawn)[20]
    assert heights(drawn) == [0.0] * 18 + [full / 2, full / 4, full] * 4 + [0.0, full / 2, full] * 4
    assert drawn.count('height="3"') == 4  # 20 of 20 fits, 300 of 100 does not


def test_words_below_the_bars_are_as_large_as_those_of_a_page_and_never_shrink() -> None:
    drawn = bars(np.zeros(18), np.zeros(12), np.zeros(12))
    assert min(int(size) for size in re.findall(r'font-size="(\d+)"', drawn)) >= 11
    assert "viewBox" not in drawn and "%" not in drawn
    assert re.findall("(?<=>)[xyzhtk](?=</text>)", drawn) == list("xyz" * 2 + "htk" * 8 + "xyz" * 4)


def test_the_veil_of_a_motion_is_not_called_a_posture() -> None:
    space = space_of(GO2)
    view = fb.Viewer(GO2)
    try:
        show_beta(view, space, standing_still(space) + 5.0)
        drawn = str(view.window.scene.file_commands())
    finally:
        view.close()
    assert "leads in a quarter" in drawn and "posture" not in drawn


def test_a_motion_is_drawn_without_cones_on_request() -> None:
    space = space_of(GO2)
    view = fb.Viewer(GO2)
    try:
        show_beta(view, space, standing_still(space), cones=False)
        without = str(view.window.scene.file_commands())
        show_beta(view, space, standing_still(space))
        drawn = str(view.window.scene.file_commands())
    finally:
        view.close()
    assert "friction cone" not in without and "friction cone" in drawn
