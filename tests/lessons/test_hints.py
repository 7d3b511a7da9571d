"""Wrong answers of each kind, exercise by exercise: each gets the hint that fits, and nothing makes a check fail."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import floatbase as fb
from floatbase.lessons import all_exercises, lesson01
from floatbase.lessons.lesson03 import standing_go2, tilted_squeeze
from floatbase.lessons.lesson04 import WANTED, tilted

GO2 = fb.load("go2")
F_R, PUSH = np.array([-60.0, 0.0, 0.0]), np.array([10.0, -5.0, 40.0])
COUNTS = {"02.1", "03.1", "04.2"}  # how many: without a sign, a frame or a velocity


def arm() -> fb.State:
    return fb.load("ur5", posture=lesson01.PRESSING).standing()


def moving() -> fb.State:
    slow = GO2.random_state(5)
    return slow.replace(v=8 * slow.v)


def solo8() -> np.ndarray:
    return np.vstack([np.zeros((6, 8)), np.eye(8)])


def holding() -> tuple[np.ndarray, np.ndarray]:
    eom = standing_go2()
    both = np.linalg.lstsq(np.hstack([eom.S, eom.J.T]), eom.h, rcond=None)[0]
    return both[:12], both[12:]


def thrust() -> np.ndarray:
    lever = fb.Contacts.points(GO2).positions(GO2.standing()) - GO2.standing().com
    G = np.vstack([np.tile(np.eye(3), 4), np.hstack([np.cross(np.eye(3), -r).T for r in lever])])
    return np.linalg.lstsq(G, [0, 0, 200, 0, 0, 0], rcond=None)[0].reshape(4, 3)


def squeeze_torques(turn: int = 0) -> np.ndarray:
    eom, squeeze = tilted_squeeze()
    R = eom.state.frame_pose("base").rotation
    forces = squeeze.reshape(4, 3) @ (np.eye(3), R, R.T)[turn]
    return -eom.J[:, 6:].T @ forces.ravel()


def gradient(drift: float = 1.0, sign: float = 1.0) -> np.ndarray:
    eom = tilted()
    A, b = fb.accelerations_from_torques(eom)
    J, wanted = eom.state.com_jacobian, eom.state.frame_pose("base").rotation @ WANTED if drift == 2.0 else WANTED
    return sign * A.T @ J.T @ (J @ b + min(drift, 1.0) * eom.state.com_drift - wanted)


def wish(towards: np.ndarray) -> fb.Quadratic:
    state = GO2.standing()
    com = fb.Quadratic.from_residual(state.com_jacobian, towards - state.com_drift)
    turn = fb.Quadratic.from_residual(state.frame_jacobian("base")[3:], -state.frame_drift("base")[3:])
    return com + turn


def on_torques(cost: fb.Quadratic) -> fb.Quadratic:
    effort = fb.Quadratic.from_residual(np.eye(12), np.zeros(12))
    return cost.pullback(fb.accelerations_from_torques(standing_go2())) + 1e-4 * effort


def unloaded(to: float) -> np.ndarray:
    """The forces of the standing robot, rocked from one diagonal to the other until FL carries so much."""
    eom = standing_go2()
    forces = np.linalg.lstsq(eom.J[:, :6].T, eom.h[:6], rcond=1e-9)[0]
    return forces + (to - forces[2]) * np.array([0, 0, 1, 0, 0, -1, 0, 0, -1, 0, 0, 1.0])


# name -> kind of mistake -> the answer it leads to, and part of the hint
WRONG: dict[str, dict[str, tuple[Callable[[], Any], str]]] = {
    "00.1": {
        "sign": (lambda: -GO2.weight, "what the robot does to the ground"),
        "shape": (lambda: np.full(4, GO2.weight / 4), "One number is asked for; this has shape (4,)"),
    },
    "01.1": {
        "sign": (lambda: np.cross(arm().point("tool0"), F_R), "sign"),
        "frame": (
            lambda: -np.cross(arm().point("tool0") - lesson01.unbolted(arm().robot).standing().com + [0, 0, 1.0], F_R),
            "about the centre of mass",
        ),
        "shape": (lambda: np.ones((3, 1)), "`.ravel()` makes it flat"),
    },
    "01.2": {
        "sign": (lambda: -solo8(), "sign"),
        "transpose": (lambda: solo8().T, "transpose"),
        "shape": (lambda: np.vstack([np.zeros((7, 8)), np.eye(8)]), "quaternion"),
    },
    "01.3": {
        "sign": (lambda: -0.7 * GO2.weight, "sign"),
        "shape": (lambda: np.full(4, 0.7 * GO2.weight / 4), "One number is asked for"),
    },
    "01.4": {
        "sign": (lambda: -thrust(), "sign"),
        "transpose": (lambda: thrust().T, "transpose"),
        "shape": (lambda: thrust()[:3], "should have shape (4, 3)"),
    },
    "02.1": {
        "transpose": (lambda: (14, 9), "transpose"),
        "shape": (lambda: 9 * 14, "a single number"),
    },
    "02.2": {
        "sign": (lambda: -moving().frame_jacobian("FL_foot")[:3].T @ PUSH, "sign"),
        "frame": (lambda: in_world(moving(), moving().frame_jacobian("FL_foot")[:3].T @ PUSH), "world axes"),
        "transpose": (lambda: moving().frame_jacobian("FL_foot")[:3, :3] @ PUSH, "its transpose goes back"),
        "shape": (lambda: moving().frame_jacobian("FL_foot")[:3, 6:].T @ PUSH, "joints alone"),
    },
    "02.3": {
        "sign": (lambda: moving().frame_drift("FL_foot")[:3], "which sign has b"),
        "frame": (lambda: -moving().frame_pose("FL_foot").rotation.T @ moving().frame_drift("FL_foot")[:3], "foot's axes"),
        "drift": (lambda: np.zeros(3), "forgets the drift"),
        "shape": (lambda: -moving().frame_drift("FL_foot"), "should have shape (3,)"),
    },
    "02.4": {
        "sign": (lambda: (holding()[0], -holding()[1]), "what the ground does to the robot"),
        "shape": (lambda: (standing_go2().h, holding()[1]), "they should be (12,)"),
    },
    "03.1": {"shape": (lambda: np.zeros(12), "One number is asked for")},
    "03.2": {
        "sign": (lambda: -squeeze_torques(), "The sign"),
        "frame": (lambda: squeeze_torques(turn=1), "The frame"),
        "transpose": (lambda: -tilted_squeeze()[0].J[:, 6:] @ tilted_squeeze()[1], "instead of its transpose"),
        "shape": (lambda: -tilted_squeeze()[0].J.T @ tilted_squeeze()[1], "18 numbers"),
    },
    "03.3": {
        "sign": (lambda: 2 * unloaded(50.0) - unloaded(20.0), "mind the sign"),
        "shape": (lambda: unloaded(20.0).reshape(4, 3), "should have shape (12,)"),
    },
    "04.1": {
        "sign": (lambda: gradient(sign=-1.0), "The sign"),
        "frame": (lambda: gradient(drift=2.0), "The frame"),
        "transpose": (lambda: gradient()[None].T @ gradient()[None], "curvature"),
        "drift": (lambda: gradient(drift=0.0), "drift is forgotten"),
        "shape": (lambda: gradient()[:, None], "one column"),
    },
    "04.2": {"shape": (lambda: np.zeros(12), "One number is asked for")},
    "04.3": {
        "sign": (lambda: on_torques(wish(-WANTED)), "The sign"),
        "shape": (lambda: wish(WANTED), "on torques it has 12"),
    },
}  # fmt: skip


def in_world(state: fb.State, forces: np.ndarray) -> np.ndarray:
    """Generalised forces, (nv,), with the base's rows in world axes."""
    R = state.frame_pose("base").rotation
    return np.concatenate([R @ forces[:3], R @ forces[3:6], forces[6:]])


def test_every_exercise_is_here_with_every_kind_that_it_can_be_wrong_in() -> None:
    assert set(WRONG) == set(all_exercises())
    for name, kinds in WRONG.items():
        assert "shape" in kinds and ("sign" in kinds) == (name not in COUNTS), name


@pytest.mark.parametrize(("name", "kind"), [(name, kind) for name, kinds in WRONG.items() for kind in kinds])
def test_a_wrong_answer_gets_the_hint_that_fits(name: str, kind: str) -> None:
    answer, hint = WRONG[name][kind]
    said = all_exercises()[name].judge(answer())
    assert not said.right
    assert hint in said.text


ODD = {
    "nothing": None, "Ellipsis": ..., "text": "a", "texts": ["a"] * 12, "nothings": [None] * 12, "ragged": [[1.0], [1.0, 2.0]],
    "object": object(), "three": (1, 2, 3),
    "dictionary": {}, "not a number": np.nan, "not numbers": np.full(12, np.nan), "endless": np.full((4, 3), np.inf),
    "huge": np.full(12, 1e300), "complex": np.full(12, 1j), "empty": [], "function": abs, "pair": ("a", "b"),
}  # fmt: skip


@pytest.mark.parametrize("name", all_exercises())
@pytest.mark.parametrize("odd", ODD)
def test_no_answer_at_all_makes_a_check_fail(name: str, odd: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        said = all_exercises()[name].judge(ODD[odd])
    assert not said.right and said.text


@pytest.mark.parametrize("name", ["00.1", "01.3"])
def test_a_rounded_g_is_not_taken_for_a_mistake_of_another_kind(name: str) -> None:
    share = {"00.1": 1.0, "01.3": 0.7}[name]
    judge = all_exercises()[name].judge
    assert judge(share * GO2.mass * 9.8).right
    assert "g as 10" in judge(share * GO2.mass * 10.0).text


@pytest.mark.parametrize(
    ("name", "count", "hint"),
    [
        *(("03.1", 5, "the legs move"), ("03.1", 10, "more than one internal force"), ("04.2", 0, "with effort")),
        *(("03.1", 8, "What is counted"), ("03.1", 7, "What is counted"), ("04.2", -6, "What is counted")),
        ("02.1", (8, 13), "What is counted"),
    ],
)
def test_a_wrong_count_gets_the_hint_that_fits(name: str, count: Any, hint: str) -> None:
    said = all_exercises()[name].judge(count)
    assert not said.right
    assert hint in said.text
