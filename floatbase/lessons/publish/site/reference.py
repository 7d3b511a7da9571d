"""Pages of the API reference: one per package, with a summary table and an entry per name."""

from __future__ import annotations

import inspect
import re
from importlib import import_module
from types import ModuleType
from typing import Any

from sphinx.ext.napoleon.docstring import NumpyDocstring
from sphinx.util.docstrings import prepare_docstring

import floatbase
from floatbase.lessons.publish.site.addresses import ALGEBRA, PACKAGES, addresses, exported, members
from floatbase.lessons.publish.site.references import anchor_of, is_known

_MAX_VALUE_LENGTH = 90  # characters of a constant's value that are shown
_NUMBER = re.compile(r"(?<![\w`<])\((\d{1,2})\)|\bApp\. [ABC]\b")
_INTRODUCTION = (
    "``import floatbase as fb`` provides the names that most programs need. Import everything else "
    "from its package. Each page lists the public names of one package. Symbols, frames, signs and "
    "units are the same everywhere: see :doc:`the conventions </lessons/conventions>`."
)


def pages() -> dict[str, str]:
    """Map the file name of each page to its reStructuredText, the index included."""
    listed = "\n".join(f"   {package} <{package}>" for package in PACKAGES)
    rows = "\n".join(f"* :doc:`{package}`: {about}" for package, about in PACKAGES.items())
    index = (
        f"{_meta_description('floatbase')}{_title('API reference')}{_INTRODUCTION}\n\n{rows}\n\n"
        f".. toctree::\n   :hidden:\n\n{listed}\n"
    )
    return {"index.rst": index, **{f"{name}.rst": _package_page(name) for name in PACKAGES}}


def _package_page(package: str) -> str:
    head = (
        f"{_meta_description(package)}{_title(package)}"
        f".. automodule:: {package}\n   :no-members:\n\n"
    )
    if package == "floatbase":
        return head + _summary_table(
            [addresses()[name].removeprefix("floatbase.") for name in floatbase.__all__]
        )
    public = exported(package)
    text = head + _entries(package, [thing for thing in public if thing[0] not in ALGEBRA])
    if algebra := [thing for thing in public if thing[0] in ALGEBRA]:
        text += "\nAlgebra of the course\n---------------------\n\n" + _entries(package, algebra)
    return text


def _entries(package: str, things: list[tuple[str, Any]]) -> str:
    """Write a table of public names, and the entry of each."""
    listed = [name for name, value in things if _is_code(value) or isinstance(value, ModuleType)]
    entries = [_entry(f"{package}.{name}", value) for name, value in things]
    return _summary_table(listed) + "\n".join(entries)


def _is_code(value: Any) -> bool:
    return inspect.isclass(value) or inspect.isroutine(value) or hasattr(value, "__wrapped__")


def _meta_description(package: str) -> str:
    return f".. meta::\n   :description: API reference of {package}: {PACKAGES[package]}\n\n"


def _title(text: str) -> str:
    return f"{text}\n{'=' * len(text)}\n\n"


def _summary_table(names: list[str]) -> str:
    """Write a table of names, given relative to the module of the page."""
    return "\n".join([".. autosummary::", "", *(f"   ~{name}" for name in names), "", ""])


def _entry(address: str, value: Any) -> str:
    """Write the autodoc directive for a public name."""
    if isinstance(value, ModuleType):
        package = import_module(address.rpartition(".")[0])
        head = (
            f"{address}\n{'-' * len(address)}\n\n.. automodule:: {value.__name__}\n"
            f"   :no-members:\n   :no-index:\n\n"
        )
        return head + "\n".join(
            _entry(f"{address}.{name}", each)
            for name, each in exported(value.__name__)
            if name not in package.__all__  # such a name has its entry there
        )
    if inspect.isclass(value):
        kind = "autoexception" if issubclass(value, BaseException) else "autoclass"
        listed = ", ".join(members(value))
        return f".. {kind}:: {address}\n" + (f"   :members: {listed}\n" if listed else "")
    if _is_code(value):
        return f".. autofunction:: {address}\n"
    text = repr(value)
    is_short = len(text) <= _MAX_VALUE_LENGTH and "\n" not in text and " at 0x" not in text
    return f".. py:data:: {address}\n" + (f"   :value: {text}\n" if is_short else "")


def link_equations(
    app: Any, what: str, name: str, value: Any, options: Any, lines: list[str]
) -> None:
    """Link equation numbers of a docstring (Sphinx's event autodoc-process-docstring)."""
    if what in ("property", "attribute"):
        text = prepare_docstring(inspect.getdoc(value) or "")
        lines[:] = NumpyDocstring(text, app.config, app, "method", name, value, options).lines()

    def link(match: re.Match[str]) -> str:
        return f":ref:`{match[0]} <{anchor_of(match[0])}>`" if is_known(match[0]) else match[0]

    for at, line in enumerate(lines):
        if re.search(r"\beqs?\. \(|\[FBR\]_", line):
            lines[at] = _NUMBER.sub(link, line)


def hide_protocol_signature(
    app: Any, what: str, name: str, value: Any, options: Any, signature: Any, returns: Any
) -> Any:
    """Leave out the signature of a protocol (Sphinx's event autodoc-process-signature)."""
    return ("", None) if getattr(value, "_is_protocol", False) else (signature, returns)


def resolve_short_name(app: Any, env: Any, node: Any, content: Any) -> Any:
    """Resolve `Contacts` or `fb.load` to its full name (Sphinx's event missing-reference)."""
    short = node.get("reftarget", "").removesuffix("()").removeprefix("fb.")
    full = addresses().get(short) or addresses().get(f"floatbase.{short}")
    if node.get("refdomain") != "py" or full is None or full == node["reftarget"]:
        return None
    python = env.get_domain("py")
    return python.resolve_xref(env, node["refdoc"], app.builder, "obj", full, node, content)
