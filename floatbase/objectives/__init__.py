"""Tasks, costs on the centre of mass, and pullbacks of costs between spaces.

Section 3 of the course text.
"""

from floatbase.errors import explain_arguments
from floatbase.objectives._task import Task
from floatbase.objectives.angular_momentum import AngularMomentumTask
from floatbase.objectives.axis import AxisTask
from floatbase.objectives.centre_of_pressure import CentreOfPressureTask
from floatbase.objectives.centroidal import (
    TorquesFromForces,
    centroidal_inertia,
    centroidal_momentum,
    centroidal_momentum_rate,
    com_wrench_map,
    desired_wrench,
    force_bias,
    net_force_matrix,
    net_moment_matrix,
    normal_bias,
    tangential_bias,
    torques_from_forces,
    wrench_objective,
)
from floatbase.objectives.motion_tasks import (
    CoMTask,
    FrameTask,
    OrientationTask,
    PostureTask,
    standing_tasks,
)
from floatbase.objectives.pullback import (
    argmin_coordinates,
    cost_on_space,
    minimum_norm_coordinates,
    minimum_norm_pullback,
    partial_minimum,
)
from floatbase.objectives.regularization import ForceTask, TorqueTask, effort_weight
from floatbase.objectives.relative_pose import RelativePoseTask

# fmt: off
__all__ = [
    "AngularMomentumTask", "AxisTask", "CentreOfPressureTask", "CoMTask", "ForceTask", "FrameTask",
    "OrientationTask", "PostureTask", "RelativePoseTask", "Task", "TorqueTask", "TorquesFromForces",
    "argmin_coordinates", "centroidal_inertia", "centroidal_momentum", "centroidal_momentum_rate",
    "com_wrench_map", "cost_on_space", "desired_wrench", "effort_weight", "force_bias",
    "minimum_norm_coordinates", "minimum_norm_pullback", "net_force_matrix", "net_moment_matrix",
    "normal_bias", "partial_minimum", "standing_tasks", "tangential_bias", "torques_from_forces",
    "wrench_objective",
]  # fmt: skip

explain_arguments(globals())
