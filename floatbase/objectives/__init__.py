"""Costs: moved between spaces, on the centre of mass, and as tasks (§3 of the document)."""

from floatbase.objectives.centroidal import (
    TorqueForForces,
    com_wrench,
    desired_wrench,
    force_bias,
    force_sum,
    moment_sum,
    momentum,
    momentum_rate,
    normal_bias,
    rotational_inertia,
    tangential_bias,
    torque_for_forces,
    wrench_objective,
)
from floatbase.objectives.pullback import (
    best_coordinates,
    cost_on_space,
    cost_on_torques,
    seen_from_best,
    seen_from_smallest,
    smallest_coordinates,
)
from floatbase.objectives.tasks import (
    CoMTask,
    ForceTask,
    FrameTask,
    OrientationTask,
    PostureTask,
    Task,
    TorqueTask,
    standing_tasks,
    target_shapes,
    targets_at,
)

# fmt: off
__all__ = [
    "CoMTask", "ForceTask", "FrameTask", "OrientationTask", "PostureTask", "Task", "TorqueForForces", "TorqueTask",
    "best_coordinates", "com_wrench", "cost_on_space", "cost_on_torques", "desired_wrench", "force_bias", "force_sum",
    "moment_sum", "momentum", "momentum_rate", "normal_bias", "rotational_inertia", "seen_from_best", "seen_from_smallest",
    "smallest_coordinates", "standing_tasks", "tangential_bias", "target_shapes", "targets_at", "torque_for_forces",
    "wrench_objective",
]
