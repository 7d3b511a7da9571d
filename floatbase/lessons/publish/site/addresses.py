"""The public names of each package, and the full name behind each short one."""

from __future__ import annotations

import inspect
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any

import floatbase

# package -> what it contains, from the top
PACKAGES = {
    "floatbase": "the names that most programs need",
    "floatbase.robots": "robots, their states, and loading them",
    "floatbase.dynamics": "contacts, constrained equations of motion, null spaces",
    "floatbase.objectives": "tasks, costs and their pullback",
    "floatbase.friction": "friction cones, polyhedra and contact wrenches",
    "floatbase.qp": "quadratic programs and their solvers",
    "floatbase.control": "the whole-body controller",
    "floatbase.actuators": "motor drivers, lags, delays and hydraulic cylinders",
    "floatbase.simulation": "MuJoCo, rollouts, pushes and parameter sweeps",
    "floatbase.behaviours": "standing, gaits and walking",
    "floatbase.viewer": "3-D pictures, recordings, films and plots",
    "floatbase.playground": "the playground, one live page",
    "floatbase.lessons": "predictions, exercises and figures of the course",
    "floatbase.affine": "affine maps and quadratic costs",
    "floatbase.linear_algebra": "ranks and null spaces",
    "floatbase.errors": "exceptions",
}
# derived in the course, and not needed by a controller: at the end of the page of its package
ALGEBRA = {
    "accelerations_from_torques", "argmin_coordinates", "bias_forces", "com_wrench_map",
    "contact_space", "coriolis_matrix", "cost_on_space", "delassus_matrix", "desired_wrench",
    "dimensions", "feasible_space", "FeasibleSpace", "force_bias", "forces_from_torques",
    "grasp_matrix", "internal_forces", "minimum_norm_coordinates", "minimum_norm_pullback",
    "motion_matrix", "net_force_matrix", "net_moment_matrix", "normal_bias", "partial_minimum",
    "tangential_bias", "torque_force_matrix", "torque_force_space", "torques_from_forces",
    "TorquesFromForces", "undetermined_forces", "view_from_rotating_frame", "wrench_objective",
}  # fmt: skip


@cache
def addresses() -> dict[str, str]:
    """Map each name that text may use, such as `Contacts.points`, to its full name."""
    found: dict[str, str] = {}
    for package in list(PACKAGES)[1:]:
        for name, value in exported(package):
            address = f"{package}.{name}"
            for called in (name, address):
                found.setdefault(called, address)
            for member in members(value):
                for called in (f"{name}.{member}", f"{address}.{member}"):
                    found.setdefault(called, f"{address}.{member}")
    front = {f"floatbase.{name}": found[name] for name in floatbase.__all__}
    return {**found, **{package: package for package in PACKAGES}, **front}


def exported(package: str) -> list[tuple[str, Any]]:
    """List the name and value of everything that a package exports or a module defines itself."""
    module = import_module(package)
    names = getattr(module, "__all__", None)
    if names is None:
        own = [
            name
            for name, value in vars(module).items()
            if getattr(value, "__module__", None) == package
        ]
        names = [name for name in own if not name.startswith("_")]
    return [(name, getattr(module, name)) for name in sorted(names, key=str.lower)]


def members(value: Any) -> list[str]:
    """List the documented public members of a class, or the public names of a module."""
    if isinstance(value, ModuleType):
        return [name for name, _ in exported(value.__name__)]
    if not inspect.isclass(value):
        return []
    return [
        name
        for name, member in vars(value).items()
        if not name.startswith("_") and _is_documented(member)
    ]


def _is_documented(member: Any) -> bool:
    is_code = (
        inspect.isroutine(member)
        or isinstance(member, property | staticmethod | classmethod)
        or hasattr(member, "func")
    )
    return is_code and bool(inspect.getdoc(member))
