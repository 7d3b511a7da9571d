"""floatbase: control of floating-base robots, as a course and as a library.

Robots
    `catalogue`, `load`, `load_urdf`, `load_mjcf`, `Robot`, `State`
Dynamics
    `Contacts`, `equations_of_motion` (7), `forces_from_torques` (9), `accelerations_from_torques`
    (14), `feasible_space` (13)
Tasks and costs
    `Affine`, `Quadratic`, `CoMTask`, `FrameTask`, `OrientationTask`, `PostureTask`, `ForceTask`,
    `TorqueTask`, `standing_tasks`
Control
    `WholeBodyController` (26) (27), `QP`, `solve`
Simulation
    `Simulation`, `Ground`, `Push`, `rollout`, `Rollout`, `sweep`, `push_recovery`
Walking
    `from floatbase.behaviours import Gait, Walk, Stand, MPC, Jump`
3-D viewer
    `Viewer`
Errors
    `FloatbaseError`, `InfeasibleError`

Symbols, frames, signs and units: help("floatbase.conventions"). Import all other names from their
packages, as in `from floatbase.friction import FrictionPolyhedron`. MuJoCo and the viewer are
imported on first use.

Examples
--------
>>> import floatbase as fb
>>> robot = fb.load("go2")  # fb.catalogue() lists the available robots
>>> state = robot.standing()
>>> contacts = fb.Contacts.points(robot, mu=0.7)
>>> controller = fb.WholeBodyController(robot, contacts, fb.standing_tasks(state))
>>> command = controller(state.q, state.v)  # .tau, .qdd, .forces, .active
>>> run = fb.rollout(fb.Simulation(robot), controller, duration=2.0)
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from floatbase.affine import Affine, Quadratic
from floatbase.control import WholeBodyController
from floatbase.dynamics import (
    Contacts,
    accelerations_from_torques,
    equations_of_motion,
    feasible_space,
    forces_from_torques,
)
from floatbase.errors import FloatbaseError, InfeasibleError
from floatbase.objectives import (
    CoMTask,
    ForceTask,
    FrameTask,
    OrientationTask,
    PostureTask,
    TorqueTask,
    standing_tasks,
)
from floatbase.qp import QP, solve
from floatbase.robots import Robot, State, catalogue, load, load_mjcf, load_urdf

if TYPE_CHECKING:
    from floatbase.simulation import Ground, Push, Rollout, Simulation
    from floatbase.simulation.push_recovery import push_recovery
    from floatbase.simulation.rollout import rollout
    from floatbase.simulation.sweep import sweep
    from floatbase.viewer import Viewer

__version__ = "0.1.0"

# imported on first use, because mujoco and the viewer take long to import
_SIMULATION = "Ground", "Push", "Rollout", "Simulation", "push_recovery", "rollout", "sweep"
_LAZY = dict.fromkeys(_SIMULATION, "floatbase.simulation") | {"Viewer": "floatbase.viewer"}

__all__ = [
    "QP", "Affine", "CoMTask", "Contacts", "FloatbaseError", "ForceTask", "FrameTask", "Ground",
    "InfeasibleError", "OrientationTask", "PostureTask", "Push", "Quadratic", "Robot", "Rollout",
    "Simulation", "State", "TorqueTask", "Viewer", "WholeBodyController",
    "accelerations_from_torques", "catalogue", "equations_of_motion", "feasible_space",
    "forces_from_torques", "load", "load_mjcf", "load_urdf", "push_recovery", "rollout", "solve",
    "standing_tasks", "sweep",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        packages = Path(__file__).parent.glob("[a-z]*/__init__.py")
        homes = [p.parent.name for p in packages if f'"{name}"' in p.read_text(encoding="utf-8")]
        package, example = (homes[0], name) if homes else ("friction", "FrictionPolyhedron")
        raise AttributeError(
            f"module 'floatbase' has no attribute {name!r}. Import other names from their "
            f"packages, as in `from floatbase.{package} import {example}`."
        )
    value = getattr(import_module(_LAZY[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
