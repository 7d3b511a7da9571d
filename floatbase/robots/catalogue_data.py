"""Data that the catalogue adds to the robots of example-robot-data; `loading` reads it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from floatbase.robots.robot import Foot


@dataclass(frozen=True)
class CatalogueEntry:
    """Data that the catalogue adds to a robot of example-robot-data."""

    description: str
    feet: tuple[Foot, ...] = ()
    torque_limit: float | None = None
    joints: Mapping[str, float] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)


def _ball_feet(
    frames: Sequence[str], radius: float, centre: Sequence[float] = (0.0, 0.0, 0.0)
) -> tuple[Foot, ...]:
    """Return ball feet with the same radius [m] and centre, shape (3,) [m], in each frame."""
    return tuple(Foot(frame, radius, np.array(centre)) for frame in frames)


# of talos
_TALOS_SOLE = np.array([[0.1, 0.06, 0.0], [0.1, -0.06, 0.0], [-0.1, -0.06, 0.0], [-0.1, 0.06, 0.0]])
_G1_SOLE = np.array(
    [[0.12, 0.03, -0.035], [0.12, -0.03, -0.035], [-0.05, -0.025, -0.035], [-0.05, 0.025, -0.035]]
)
_solo = partial(
    CatalogueEntry,
    feet=_ball_feet(("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT"), 0.016),
    torque_limit=2.7,
    sources={
        "foot radius": "half the width of the foot mesh in example-robot-data",
        "torque limit": "2.7 N·m at 12 A: Grimminger et al., An open torque-controlled modular "
        "robot architecture, 2020 "
        "(the URDF has 1000 N·m, which no motor of this size can exert)",
    },
)

CATALOGUE: Mapping[str, CatalogueEntry] = {
    "go2": CatalogueEntry(
        "quadruped with 3 joints per leg: as many leg torques as contact forces",
        _ball_feet(("FL_foot", "FR_foot", "RL_foot", "RR_foot"), 0.022),
        sources={"foot radius": "foot mesh in example-robot-data", "torque limits": "URDF"},
    ),
    "solo12": _solo(
        "small quadruped with 3 joints per leg and weak motors: torque limits are close"
    ),
    "solo8": _solo("small quadruped with 2 joints per leg: fewer torques than contact forces"),
    "anymal_kinova": CatalogueEntry(
        "quadruped with an arm: more torques than contact forces",
        _ball_feet(("LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT"), 0.031, (0.0, 0.0, 0.02325)),
        sources={"foot radius": "URDF collision sphere", "torque limits": "URDF"},
    ),
    "talos": CatalogueEntry(
        "humanoid with flat feet: each foot transmits a wrench through its corners",
        tuple(Foot(frame, corners=_TALOS_SOLE) for frame in ("left_sole_link", "right_sole_link")),
        sources={
            "sole": "20 cm × 12 cm, within the collision mesh of the ankle",
            "torque limits": "URDF",
        },
    ),
    "hyq": CatalogueEntry(
        "hydraulic quadruped of 80 kg with 3 joints per leg",
        _ball_feet(("lf_foot", "rf_foot", "lh_foot", "rh_foot"), 0.02175),
        sources={"foot radius": "URDF collision sphere", "torque limits": "URDF"},
    ),
    "g1": CatalogueEntry(
        "humanoid of 33 kg with flat feet",
        tuple(
            Foot(frame, corners=_G1_SOLE)
            for frame in ("left_ankle_roll_link", "right_ankle_roll_link")
        ),
        joints={
            f"{side}_{joint}_joint": angle
            for side in ("left", "right")
            for joint, angle in {"hip_pitch": -0.25, "knee": 0.5, "ankle_pitch": -0.25}.items()
        },
        sources={
            "sole": "lowest points of the collision spheres in the URDF",
            "posture": "knees bent by 0.5 rad, since the reference posture has straight legs",
            "torque limits": "URDF",
        },
    ),
    "ur5": CatalogueEntry(
        "arm bolted to the ground: the fixed-base equations (1)",
        joints={
            "shoulder_lift_joint": -1.3,
            "elbow_joint": 1.6,
            "wrist_1_joint": -0.3,
            "wrist_2_joint": 0.0,
        },
        sources={"torque limits": "URDF"},
    ),
}
