"""What stands where on the pages of the library: packages, what they export, and the address of
each name.
"""

from __future__ import annotations

import inspect
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any

import floatbase

# package -> what it is for, in the order of the floors
PACKAGES = {
    "floatbase": "the front door",
    "floatbase.robots": "robots and their states",
    "floatbase.dynamics": "contacts, equations of motion, spaces",
    "floatbase.objectives": "costs and tasks",
    "floatbase.friction": "cones, polyhedra, wrenches",
    "floatbase.qp": "quadratic programs",
    "floatbase.control": "controllers",
    "floatbase.actuators": "hydraulics, lags, delays",
    "floatbase.simulation": "MuJoCo, rollouts, sweeps",
    "floatbase.behaviours": "gaits and walking",
    "floatbase.viewer": "pictures and plots",
    "floatbase.playground": "the live page",
    "floatbase.lessons": "what the lessons share",
    "floatbase.affine": "affine maps and quadratic costs",
    "floatbase.linear_algebra": "ranks and null spaces",
    "floatbase.errors": "errors",
}


@cache
def addresses() -> dict[str, str]:
    """What texts call a thing -> its address on these pages: alone, with its package, and as a
    member of its class.
    """
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
    """Name and value of all that a package exports; of a module without `__all__`, what it defines
    itself.
    """
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
    """The public members of a class, or functions of a module, that have a docstring."""
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
