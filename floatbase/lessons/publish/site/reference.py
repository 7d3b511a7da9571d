"""The pages of the library: one for each room, with all that it exports."""

from __future__ import annotations

import inspect
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any

import floatbase

# room -> what it is for, in the order of the floors
ROOMS = {
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
_LONGEST = 90  # characters of a constant's value that are shown


def pages() -> dict[str, str]:
    """File name -> text, reStructuredText, of all pages of the library, with one that lists them."""
    listed = "\n".join(f"   {room} <{room}>" for room in ROOMS)
    rows = "\n".join(f"* :doc:`{room}`: {about}" for room, about in ROOMS.items())
    index = f"{_meta('floatbase')}{_title('Library')}{_FRONT}\n\n{rows}\n\n.. toctree::\n   :hidden:\n\n{listed}\n"
    return {"index.rst": index, **{f"{room}.rst": _page(room) for room in ROOMS}}


_FRONT = (
    "``import floatbase as fb`` has the names that most programs need; everything else is imported from its room. Each page "
    "lists what its room exports. A number such as :ref:`(9) <eq-9>` leads to the equation; symbols, frames, signs and units "
    "are those of :doc:`the conventions </lessons/conventions>`."
)


@cache
def addresses() -> dict[str, str]:
    """What texts call a thing -> its address on these pages: alone, with its room, and as a member of its class."""
    found: dict[str, str] = {}
    for room in list(ROOMS)[1:]:
        for name, value in exported(room):
            address = f"{room}.{name}"
            for called in (name, address):
                found.setdefault(called, address)
            for member in members(value):
                for called in (f"{name}.{member}", f"{address}.{member}"):
                    found.setdefault(called, f"{address}.{member}")
    front = {f"floatbase.{name}": found[name] for name in floatbase.__all__}
    return {**found, **{room: room for room in ROOMS}, **front}


def exported(room: str) -> list[tuple[str, Any]]:
    """Name and value of all that a room exports; of a module without `__all__`, what it defines itself."""
    module = import_module(room)
    names = getattr(module, "__all__", None)
    if names is None:
        own = [name for name, value in vars(module).items() if getattr(value, "__module__", None) == room]
        names = [name for name in own if not name.startswith("_")]
    return [(name, getattr(module, name)) for name in sorted(names, key=str.lower)]


def members(value: Any) -> list[str]:
    """The public members of a class, or functions of a module, that have a docstring."""
    if isinstance(value, ModuleType):
        return [name for name, _ in exported(value.__name__)]
    if not inspect.isclass(value):
        return []
    return [name for name, member in vars(value).items() if not name.startswith("_") and _explains(member)]


def _explains(member: Any) -> bool:
    is_code = inspect.isroutine(member) or isinstance(member, property | staticmethod | classmethod) or hasattr(member, "func")
    return is_code and bool(inspect.getdoc(member))


def _is_code(value: Any) -> bool:
    return inspect.isclass(value) or inspect.isroutine(value) or hasattr(value, "__wrapped__")


def _page(room: str) -> str:
    head = f"{_meta(room)}{_title(room)}.. automodule:: {room}\n   :no-members:\n\n"
    if room == "floatbase":
        known = addresses()
        return head + _table([(f"fb.{name}", known[name], getattr(floatbase, name)) for name in floatbase.__all__])
    things = [(name, f"{room}.{name}", value) for name, value in exported(room)]
    shown = [(name, address, value) for name, address, value in things if _is_code(value) or isinstance(value, ModuleType)]
    return head + _table(shown) + "\n".join(_entry(*thing) for thing in things)


def _meta(room: str) -> str:
    return f".. meta::\n   :description: The library floatbase, {room}: {ROOMS[room]}\n\n"


def _title(text: str) -> str:
    return f"{text}\n{'=' * len(text)}\n\n"


def _table(things: list[tuple[str, str, Any]]) -> str:
    """Names, linked, with the beginning of what they say."""
    from floatbase.lessons.publish.site.docstrings import restructured

    rows = [".. list-table::", "   :class: names", ""]
    for name, address, value in things:
        first = (inspect.getdoc(value) or "").split("\n\n")[0]
        rows += [f"   * - :py:obj:`{name} <{address}>`", f"     - {restructured(first, ()).strip()}"]
    return "\n".join([*rows, "", ""])


def _entry(name: str, address: str, value: Any) -> str:
    """Sphinx's order to print what a name says."""
    if isinstance(value, ModuleType):
        head = f"{address}\n{'-' * len(address)}\n\n.. automodule:: {value.__name__}\n   :no-members:\n   :no-index:\n\n"
        return head + "\n".join(_entry(inner, f"{address}.{inner}", each) for inner, each in exported(value.__name__))
    if inspect.isclass(value):
        kind = "autoexception" if issubclass(value, BaseException) else "autoclass"
        return (
            f".. {kind}:: {address}\n   :members: {', '.join(members(value)) or '__none__'}\n"
            if members(value)
            else f".. {kind}:: {address}\n"
        )
    if _is_code(value):
        return f".. autofunction:: {address}\n"
    text = repr(value)
    shown = f"\n   :value: {text}" if len(text) <= _LONGEST and "\n" not in text and " at 0x" not in text else ""
    return f".. py:data:: {address}{shown}\n"
