"""Markdown, formulas and code as HTML without script or network: formulas are MathML, which browsers draw themselves."""

from __future__ import annotations

import base64
import html
import io
import re
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import mistune
from fontTools import subset
from latex2mathml.converter import convert
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import get_lexer_by_name
from pygments.util import ClassNotFound

from floatbase.errors import ViewerError

# code is looked for first, so that a dollar in it starts no formula
_FORMULA = re.compile(r"```.*?```|`[^`\n]*`|\$\$(?P<block>.+?)\$\$|\$(?P<inline>[^$\n]+?)\$", re.DOTALL)
_TAG = re.compile(r"\\tag\{(.*?)\}")
_MATHML = re.compile(r"<math.*?</math>", re.DOTALL)
_MATRIX = re.compile(r"<mo>&#x0005B;</mo><mtable>.*?</mtable><mo>&#x0005D;</mo>")
_DOTTED = re.compile(r"<mover>(<mi>[^<]*</mi><mo>(?:&#x000A8;|&#x002D9;|&#x0007E;)</mo></mover>)")
_KEPT = re.compile(r"KEPTFORMULA(\d+)X")


class _Renderer(mistune.HTMLRenderer):
    """As mistune has it, with coloured code, and links to lessons led to their pages."""

    def link(self, text: str, url: str, title: str | None = None) -> str:
        return super().link(text, page_of(url), title)

    def block_code(self, code: str, info: str | None = None) -> str:
        return coloured(code, (info or "text").split()[0])


def to_html(markdown: str) -> str:
    """HTML of a text in Markdown with formulas between $ or $$, as JupyterLab reads it."""
    formulas: list[str] = []

    def keep(match: re.Match[str]) -> str:
        if match["block"] is None and match["inline"] is None:
            return match[0]
        formulas.append(equation(match["block"]) if match["block"] else _mathml(match["inline"], "inline"))
        return f"KEPTFORMULA{len(formulas) - 1}X"  # letters and digits: Markdown leaves them as they are

    text = str(_reader()(_FORMULA.sub(keep, markdown)))
    return _KEPT.sub(lambda match: formulas[int(match[1])], text)


def equation(latex: str) -> str:
    r"""A formula on a line of its own, with its \tag at the right."""
    tag = _TAG.search(latex)
    number = f'<span class="number">({tag[1]})</span>' if tag else ""
    return f'<span class="equation">{_mathml(_TAG.sub("", latex), "block")}{number}</span>'


def coloured(code: str, language: str = "python") -> str:
    """Code with its words coloured, by the classes of `code_style`."""
    try:
        lexer = get_lexer_by_name(language)
    except ClassNotFound:
        lexer = get_lexer_by_name("text")
    return str(highlight(code, lexer, _formatter()))


@cache
def code_style() -> str:
    """The style sheet of coloured code."""
    return str(_formatter().get_style_defs(".code"))


def formula_font(text: str) -> str:
    """A style sheet with a font for the formulas in HTML: STIX Two Math, which the package ziamath brings, cut down to them.

    Brackets grow around matrices only in a font made for formulas, and few machines have one. Nothing without formulas.
    """
    letters = {letter for formula in _MATHML.findall(text) for letter in html.unescape(re.sub("<[^>]*>", "", formula))}
    if not letters:
        return ""
    options = subset.Options(layout_features=["ssty"], notdef_outline=True)
    cutter, packed = subset.Subsetter(options), io.BytesIO()
    cutter.populate(unicodes=[ord(letter) for letter in letters | {_slanted(letter) for letter in letters}])
    with subset.load_font(_font_file(), options) as font:
        cutter.subset(font)
        font.flavor = "woff"
        font.save(packed)
    data = base64.b64encode(packed.getvalue()).decode()
    face = f'@font-face {{ font-family: Formulas; src: url("data:font/woff;base64,{data}"); }}'
    return f"{face} math {{ font-family: Formulas, math; }}"


def _font_file() -> str:
    """Where the font lies; the package around it is not imported."""
    spec = find_spec("ziamath")
    if spec is None or not spec.submodule_search_locations:
        raise ViewerError("ziamath is not installed; pages need its font. Install it with: pip install floatbase[pages]")
    return str(Path(spec.submodule_search_locations[0]) / "fonts" / "STIXTwoMath-Regular.ttf")


def _slanted(letter: str) -> str:
    """The letter as browsers draw it when it stands alone in a formula: in italics, which are letters of their own."""
    for first, last, slanted in (("a", "z", 0x1D44E), ("A", "Z", 0x1D434), ("α", "ω", 0x1D6FC)):
        if first <= letter <= last:
            return "ℎ" if letter == "h" else chr(slanted + ord(letter) - ord(first))
    return letter


def page_of(url: str) -> str:
    """Where a link between lessons leads in their pages; other links lead where they did."""
    return re.sub(r"^([^:?#]+)\.(?:ipynb|md)(#.*)?$", r"\1.html\2", url)


def _mathml(latex: str, display: str) -> str:
    """A formula as MathML, with what the converter leaves out: brackets grow with their own matrix, dots stand near."""
    text = _MATRIX.sub(r"<mrow>\g<0></mrow>", str(convert(latex.strip(), display=display)))
    return _DOTTED.sub(r'<mover accent="true">\1', text)


@cache
def _reader() -> Any:
    return mistune.create_markdown(renderer=_Renderer(escape=False), plugins=["table", "strikethrough"])


@cache
def _formatter() -> Any:
    return HtmlFormatter(style="friendly", cssclass="code")
