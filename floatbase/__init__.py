"""floatbase: controlling floating-based robots, as a course and as a library.

The names below are all a user needs: `import floatbase as fb`. Physics and pictures load when they are first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from floatbase.affine import Affine, Quadratic
from floatbase.control.controller import Command, WholeBodyController
from floatbase.dynamics import Contacts, equations_of_motion
from floatbase.dynamics.subspace import accelerations_from_torques, feasible_space, forces_from_torques
from floatbase.errors import FloatbaseError, InfeasibleError
from floatbase.objectives.tasks import (
    CoMTask,
    ForceTask,
    FrameTask,
    OrientationTask,
    PostureTask,
    TorqueTask,
    standing_tasks,
)
from floatbase.robots import Foot, State, load, load_urdf, robots

if TYPE_CHECKING:
    from floatbase.simulation.physics import Ground, Push, Simulation
    from floatbase.simulation.rollout import Rollout, rollout
    from floatbase.viewer.scene import Viewer

__version__ = "0.1.0"

# heavy rooms, imported at first use: mujoco behind Simulation, meshcat behind Viewer
_LAZY = {
    "Ground": "floatbase.simulation.physics",
    "Push": "floatbase.simulation.physics",
    "Simulation": "floatbase.simulation.physics",
    "Rollout": "floatbase.simulation.rollout",
    "rollout": "floatbase.simulation.rollout",
    "Viewer": "floatbase.viewer.scene",
}

__all__ = [
    "Affine",
    "CoMTask",
    "Command",
    "Contacts",
    "FloatbaseError",
    "Foot",
    "ForceTask",
    "FrameTask",
    "Ground",
    "InfeasibleError",
    "OrientationTask",
    "PostureTask",
    "Push",
    "Quadratic",
    "Rollout",
    "Simulation",
    "State",
    "TorqueTask",
    "Viewer",
    "WholeBodyController",
    "accelerations_from_torques",
    "equations_of_motion",
    "feasible_space",
    "forces_from_torques",
    "load",
    "load_urdf",
    "robots",
    "rollout",
    "standing_tasks",
]


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module 'floatbase' has no attribute {name!r}")
    value = getattr(import_module(_LAZY[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
