"""Constrained equations of motion and the space of motions they leave (§2 and App. A of the document)."""

from floatbase.dynamics.constraints import LinearConstraint, RollingWheel, fixed_frame, moving_frame
from floatbase.dynamics.contact import UP, Contact, FlatFootContact, PointContact, grasp_matrix
from floatbase.dynamics.contacts import Contacts, motion_of
from floatbase.dynamics.equations import Block, EquationsOfMotion, equations_of_motion
from floatbase.dynamics.fictitious import (
    bias_forces,
    coriolis_matrix,
    inertia_rate,
    inward_acceleration,
    power_identity,
    seen_from_turning_frame,
)
from floatbase.dynamics.resolve import MOTION_NOISE, MOTION_TOLERANCE, contact_space, resolved_motion
from floatbase.dynamics.subspace import (
    FeasibleSpace,
    accelerations_from_torques,
    contact_inertia_inverse,
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
__all__ = [
    "MOTION_NOISE", "MOTION_TOLERANCE", "UP", "Block", "Contact", "Contacts", "EquationsOfMotion", "FeasibleSpace",
    "FlatFootContact", "LinearConstraint", "PointContact", "RollingWheel", "accelerations_from_torques", "bias_forces",
    "contact_inertia_inverse", "contact_space", "coriolis_matrix", "dimensions", "equations_of_motion", "feasible_space",
    "fixed_frame", "forces_from_torques", "grasp_matrix", "inertia_rate", "internal_forces", "inward_acceleration",
    "motion_matrix", "motion_of", "moving_frame", "power_identity", "resolved_motion", "seen_from_turning_frame",
    "torque_force_matrix", "torque_force_space", "undetermined_forces",
]
