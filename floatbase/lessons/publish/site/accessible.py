"""Mend pages of Sphinx and its theme for readers who use a screen reader."""

from __future__ import annotations

import re

_SIDE_BAR = '<div id="pst-primary-sidebar"'
_TOGGLE = '<summary><span class="toctree-toggle"'
_REPLACED = {
    _SIDE_BAR: f'{_SIDE_BAR} role="navigation" aria-label="search and pages"',
    _TOGGLE: _TOGGLE.replace(">", ' aria-label="pages of this part">', 1),
    'role="doc-biblioentry"': 'role="listitem"',  # of a list
}
# its text is its name; a label would hide the keys that it shows
_SEARCH_LABEL = re.compile(r'(<button class="btn search-button[^>]*) aria-label="Search"')
# the parameters of a signature on several lines: definitions without terms
_PARAMETERS = re.compile(r"<dl>\n((?:<dd><em class=\"sig-param.*?</dd>\n)+)</dl>", re.DOTALL)


def accessible(page: str) -> str:
    """Return a page with names for controls, terms for definitions, and roles for parts."""
    for theirs, ours in _REPLACED.items():
        page = page.replace(theirs, ours)
    page = _SEARCH_LABEL.sub(r"\1", page)
    return _PARAMETERS.sub(_as_lines, page)


def _as_lines(match: re.Match[str]) -> str:
    lines = match[1].replace("<dd>", "<span>").replace("</dd>", "</span>")
    return f'<span class="sig-params">\n{lines}</span>'
