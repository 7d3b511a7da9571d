"""Constrained equations of motion and the space of motions that they allow.

Section 2 and Appendix A of the course text.
"""

from floatbase.dynamics.constraint_rank import (
    CONSTRAINT_NOISE,
    CONSTRAINT_RANK_TOLERANCE,
    contact_space,
    resolved_constraint,
)
from floatbase.dynamics.constraints import (
    LinearConstraint,
    RollingWheel,
    fixed_frame,
    moving_frame,
    rigid_between,
)
from floatbase.dynamics.contact import (
    UP,
    FlatFootContact,
    FrictionContact,
    MotionConstraint,
    PointContact,
    grasp_matrix,
)
from floatbase.dynamics.contacts import Contacts, constraint_and_jacobian
from floatbase.dynamics.equations import Block, EquationsOfMotion, equations_of_motion
from floatbase.dynamics.fictitious import bias_forces, coriolis_matrix, view_from_rotating_frame
from floatbase.dynamics.subspace import (
    FeasibleSpace,
    accelerations_from_torques,
    delassus_matrix,
    dimensions,
    feasible_space,
    forces_from_torques,
    internal_forces,
    motion_matrix,
    torque_force_matrix,
    torque_force_space,
    undetermined_forces,
)

# fmt: off
from floatbase.errors import explain_arguments

__all__ = [
    "CONSTRAINT_NOISE", "CONSTRAINT_RANK_TOLERANCE", "UP", "Block", "Contacts", "EquationsOfMotion",
    "FeasibleSpace", "FlatFootContact", "FrictionContact", "LinearConstraint", "MotionConstraint",
    "PointContact", "RollingWheel", "accelerations_from_torques", "bias_forces",
    "constraint_and_jacobian", "contact_space", "coriolis_matrix", "delassus_matrix", "dimensions",
    "equations_of_motion", "feasible_space", "fixed_frame", "forces_from_torques", "grasp_matrix",
    "internal_forces", "motion_matrix", "moving_frame", "resolved_constraint",
    "rigid_between", "torque_force_matrix", "torque_force_space", "undetermined_forces",
    "view_from_rotating_frame",
]  # fmt: skip

explain_arguments(globals())
