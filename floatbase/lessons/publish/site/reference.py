"""The pages of the library: one for each package, with all that it exports."""

from __future__ import annotations

import inspect
from importlib import import_module
from types import ModuleType
from typing import Any

import floatbase
from floatbase.lessons.publish.site.addresses import PACKAGES, addresses, exported, members
from floatbase.lessons.publish.site.docstrings import to_restructured_text

_MAX_VALUE_LENGTH = 90  # characters of a constant's value that are shown


def pages() -> dict[str, str]:
    """File name -> reStructuredText of all pages of the library, and of their index."""
    listed = "\n".join(f"   {package} <{package}>" for package in PACKAGES)
    rows = "\n".join(f"* :doc:`{package}`: {about}" for package, about in PACKAGES.items())
    index = (
        f"{_meta_description('floatbase')}{_title('Library')}{_INTRODUCTION}\n\n{rows}\n\n.. "
        f"toctree::\n   :hidden:\n\n{listed}\n"
    )
    return {
        "index.rst": index,
        **{f"{package}.rst": _package_page(package) for package in PACKAGES},
    }


_INTRODUCTION = (
    "``import floatbase as fb`` has the names that most programs need; everything else is imported "
    "from its package. Each page "
    "lists what its package exports. A number such as :ref:`(9) <eq-9>` leads to the equation; "
    "symbols, frames, signs and units "
    "are those of :doc:`the conventions </lessons/conventions>`."
)


def _is_code(value: Any) -> bool:
    return inspect.isclass(value) or inspect.isroutine(value) or hasattr(value, "__wrapped__")


def _package_page(package: str) -> str:
    head = (
        f"{_meta_description(package)}{_title(package)}.. automodule:: {package}\n   "
        f":no-members:\n\n"
    )
    if package == "floatbase":
        known = addresses()
        return head + _name_table(
            [(f"fb.{name}", known[name], getattr(floatbase, name)) for name in floatbase.__all__]
        )
    things = [(name, f"{package}.{name}", value) for name, value in exported(package)]
    shown = [
        (name, address, value)
        for name, address, value in things
        if _is_code(value) or isinstance(value, ModuleType)
    ]
    return head + _name_table(shown) + "\n".join(_autodoc_entry(*thing) for thing in things)


def _meta_description(package: str) -> str:
    return f".. meta::\n   :description: The library floatbase, {package}: {PACKAGES[package]}\n\n"


def _title(text: str) -> str:
    return f"{text}\n{'=' * len(text)}\n\n"


def _name_table(things: list[tuple[str, str, Any]]) -> str:
    """Names, linked, with the beginning of what they say."""
    rows = [".. list-table::", "   :class: names", ""]
    for name, address, value in things:
        first = (inspect.getdoc(value) or "").split("\n\n")[0]
        rows += [
            f"   * - :py:obj:`{name} <{address}>`",
            f"     - {to_restructured_text(first, ()).strip()}",
        ]
    return "\n".join([*rows, "", ""])


def _autodoc_entry(name: str, address: str, value: Any) -> str:
    """Sphinx's order to print what a name says."""
    if isinstance(value, ModuleType):
        package = import_module(address.rpartition(".")[0])
        head = (
            f"{address}\n{'-' * len(address)}\n\n.. automodule:: {value.__name__}\n   "
            f":no-members:\n   :no-index:\n\n"
        )
        return head + "\n".join(
            _autodoc_entry(inner, f"{address}.{inner}", each)
            for inner, each in exported(value.__name__)
            if inner not in package.__all__  # such a name has its entry there
        )
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
    shown = (
        f"\n   :value: {text}"
        if len(text) <= _MAX_VALUE_LENGTH and "\n" not in text and " at 0x" not in text
        else ""
    )
    return f".. py:data:: {address}{shown}\n"
