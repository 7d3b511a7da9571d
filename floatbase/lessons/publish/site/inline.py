"""A paragraph of Markdown with formulas as HTML, for pages that Sphinx does not write."""

from __future__ import annotations

import html
import re

from floatbase.lessons.publish.site.mathml import mathml

_CODE = re.compile(r"`([^`]+)`|\$([^$]+)\$")


def inline_html(text: str) -> str:
    """Convert a paragraph of Markdown with formulas to HTML. Links become text."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    parts = []
    last = 0
    for match in _CODE.finditer(text):
        parts.append(_emphasis(text[last : match.start()]))
        code, formula = match.groups()
        parts.append(mathml(formula) if formula else f"<code>{html.escape(code)}</code>")
        last = match.end()
    return "".join([*parts, _emphasis(text[last:])])


def _emphasis(text: str) -> str:
    text = re.sub(r"</?\w+[^>]*>", "", text)  # the few tags in a lesson, such as <br>
    text = re.sub(r"\*\*(.+?)\*\*", r"<strong>\1</strong>", html.escape(text, quote=False))
    return re.sub(r"\*(.+?)\*", r"<em>\1</em>", text)
