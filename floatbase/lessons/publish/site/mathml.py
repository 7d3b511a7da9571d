"""Formulas as MathML."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert

_TAG = re.compile(r"\\tag\{(.*?)\}")
# what the converter leaves out: brackets grow only with their own matrix, dots are close to their
# letter, and the variable of min is below it
_MATRIX = re.compile(r"<mo>&#x0005B;</mo><mtable>.*?</mtable><mo>&#x0005D;</mo>")
_DOTTED = re.compile(r"<mover>(<mi>[^<]*</mi><mo>(?:&#x000A8;|&#x002D9;|&#x0007E;)</mo></mover>)")
_BELOW = re.compile(r"<msub>(<mo>(?:min|max)</mo>(?:<mi>[^<]*</mi>|<mrow>.*?</mrow>))</msub>")


def mathml(latex: str, display: str = "inline") -> str:
    """Convert a LaTeX formula to MathML. `display` is "inline" or "block"."""
    text = _MATRIX.sub(r"<mrow>\g<0></mrow>", str(convert(latex.strip(), display=display)))
    text = _BELOW.sub(r"<munder>\1</munder>", text) if display == "block" else text
    return _DOTTED.sub(r'<mover accent="true">\1', text)


def visit_math(writer: Any, node: Any) -> None:
    """Write an inline formula for Sphinx."""
    writer.body.append(mathml(node.astext()))
    raise nodes.SkipNode


def visit_displaymath(writer: Any, node: Any) -> None:
    r"""Write a displayed formula for Sphinx, with its \tag on the right."""
    latex = node.astext()
    tag = _TAG.search(latex)
    number = f'<span class="number">({tag[1]})</span>' if tag else ""
    writer.body.append(
        f'<div class="equation">{mathml(_TAG.sub("", latex), "block")}{number}</div>'
    )
    raise nodes.SkipNode
