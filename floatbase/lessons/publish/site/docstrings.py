"""The package's docstrings, which are plain text, as what Sphinx reads: lists of parameters, links,
code, and no more.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable
from contextlib import suppress
from typing import Any

from sphinx.util.inspect import stringify_signature

from floatbase.lessons.publish.site.addresses import addresses
from floatbase.lessons.publish.site.references import REFERENCE, target_of

_CODE_SPAN = re.compile(r"``?([^`]+)``?")
_SPECIAL_CHARACTERS = re.compile(r"([\\*_|])")
_CLASS_NAME = re.compile(r"\b(npt\.|np\.|fb\.)?([A-Z]\w*)\b")
_UNDERLINE = re.compile(r"^(?:-+|=+)$")


def process_docstring(
    app: Any, what: str, name: str, value: Any, options: Any, lines: list[str]
) -> None:
    """Sphinx's event autodoc-process-docstring: changes the lines in place."""
    own = name if what == "class" else name.rpartition(".")[0]
    lines[:] = to_restructured_text("\n".join(lines), parameters(value), own).splitlines() + [""]


def process_signature(
    app: Any, what: str, name: str, value: Any, options: Any, signature: Any, returns: Any
) -> Any:
    """Sphinx's event autodoc-process-signature: types as the source writes them, "Array" and not
    what stands behind it.
    """
    if getattr(value, "_is_protocol", False):
        return "", None
    if signature is None or what in ("property", "attribute", "data"):
        return signature, returns
    found = inspect.signature(value)
    given = list(found.parameters.values())
    shown = given[1:] if what == "method" and given and given[0].name in ("self", "cls") else given
    typed = [one.replace(annotation=_linked_type(one.annotation)) for one in shown]
    returned = (
        None
        if what == "class" or found.return_annotation is found.empty
        else _linked_type(found.return_annotation)
    )
    return stringify_signature(inspect.Signature(typed)).replace("<factory>", "…"), returned


def _linked_type(annotation: Any) -> Any:
    """A type as its source writes it, with the names that have a place in the site linked."""
    if not isinstance(annotation, str):
        return annotation
    known = addresses()
    return _CLASS_NAME.sub(
        lambda match: f"~{known[match[2]]}" if match[2] in known else match[2], annotation
    )


def parameters(value: Any) -> set[str]:
    """The names that a docstring may explain: parameters of a function, those of a class, its
    fields and its members.
    """
    names = {*getattr(value, "__annotations__", ())} | {
        *(vars(value) if inspect.isclass(value) else ())
    }
    with suppress(TypeError, ValueError):  # a module or a property takes nothing
        names |= set(inspect.signature(value).parameters)
    return {name for name in names if not name.startswith("_")} - {"self", "return"}


def to_restructured_text(text: str, names: Iterable[str], own: str = "") -> str:
    """A docstring as reStructuredText. names: those that it may explain. own: address of the class
    or module it belongs to.
    """
    blocks = []
    name = "|".join(sorted(map(re.escape, names), key=len, reverse=True))
    entry = re.compile(
        rf"(?:^|(?<=\n)|(?<=[.;] ))((?:{name})(?:, (?:{name}))*):\s" if name else r"(?!)"
    )
    for block in re.split(r"\n\s*\n", text.strip("\n")):
        rows = block.splitlines()
        if not block.strip():
            continue
        if all(row.startswith("    ") for row in rows):
            blocks.append("\n".join(["::", "", *rows]))
        elif len(rows) > 1 and _UNDERLINE.match(rows[1]):
            blocks.append(f".. rubric:: {rows[0]}")
            blocks += [_paragraph(" ".join(rows[2:]), own)] if rows[2:] else []
        elif any("   " in row.strip() for row in rows):  # columns
            blocks.append("\n".join(["::", "", *(f"    {row}" for row in rows)]))
        else:
            blocks += _parameter_list(block, entry, own)
    return "\n\n".join(blocks) + "\n"


def _parameter_list(block: str, entry: re.Pattern[str], own: str) -> list[str]:
    """A paragraph, and a list of the names that it explains."""
    before, *parts = entry.split(block)
    found = [_paragraph(before, own)] if before.strip() else []
    pairs = zip(parts[::2], parts[1::2], strict=True)
    items = [
        f"* {', '.join(f'``{one}``' for one in names.split(', '))}: {_paragraph(about, own)}"
        for names, about in pairs
    ]
    return [*found, "\n".join(items)] if items else found


def _paragraph(text: str, own: str) -> str:
    """A text in one line, with what is in backticks as a link or code, and all else as it is."""
    flat, parts, at = " ".join(text.split()), [], 0
    for span in _CODE_SPAN.finditer(flat):
        parts += [_linked_text(flat[at : span.start()]), _linked_code(span[1], own)]
        at = span.end()
    return "".join([*parts, _linked_text(flat[at:])]).strip()


def _linked_code(code: str, own: str) -> str:
    known = addresses()
    bare = code.removesuffix("()").removeprefix("fb.").removeprefix("floatbase.")
    for address in (f"{own}.{bare}", f"floatbase.{bare}", bare):
        if address in known:
            return rf"\ :py:obj:`{code} <{known[address]}>`\ "
    return rf"\ ``{code}``\ "


def _linked_text(text: str) -> str:
    """Text without code, with links to the map."""

    def link(match: re.Match[str]) -> str:
        target = "" if match["lesson"] else target_of(match)
        return rf"\ :ref:`{match[0]} <{target}>`\ " if target else match[0]

    return REFERENCE.sub(link, _SPECIAL_CHARACTERS.sub(r"\\\1", text))
