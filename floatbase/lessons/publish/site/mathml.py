"""Formulas as MathML, and the font that browsers draw them with."""

from __future__ import annotations

import html
import logging
import re
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from docutils import nodes
from fontTools import subset
from latex2mathml.converter import convert

from floatbase.errors import ViewerError

FONT = "formulas.woff"  # in the site's static files
logging.getLogger("fontTools").setLevel(logging.WARNING)  # it logs each step
_TAG = re.compile(r"\\tag\{(.*?)\}")
_MATHML = re.compile(r"<math.*?</math>", re.DOTALL)
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


def write_font(pages: Iterable[str], target: Path) -> None:
    """Write the part of STIX Two Math that the formulas of the pages use."""
    formulas = (formula for page in pages for formula in _MATHML.findall(page))
    letters = {
        letter for formula in formulas for letter in html.unescape(re.sub("<[^>]*>", "", formula))
    }
    cutter = subset.Subsetter(subset.Options(layout_features=["ssty"], notdef_outline=True))
    letters |= {_slanted(letter) for letter in letters}
    cutter.populate(unicodes=[ord(letter) for letter in sorted(letters)])
    with subset.load_font(_font_file(), subset.Options()) as font:
        cutter.subset(font)
        font.flavor = "woff"
        font.save(target)


def _font_file() -> str:
    """Return the path of the font; the package around it is not imported."""
    spec = find_spec("ziamath")
    if spec is None or not spec.submodule_search_locations:
        raise ViewerError(
            "The site needs the font of ziamath, which is not installed. Install it with "
            'pip install "floatbase[site]".'
        )
    return str(Path(spec.submodule_search_locations[0]) / "fonts" / "STIXTwoMath-Regular.ttf")


def _slanted(letter: str) -> str:
    """Return the italic character that browsers draw for a single letter."""
    for first, last, slanted in (("a", "z", 0x1D44E), ("A", "Z", 0x1D434), ("α", "ω", 0x1D6FC)):
        if first <= letter <= last:
            return "ℎ" if letter == "h" else chr(slanted + ord(letter) - ord(first))
    return letter
