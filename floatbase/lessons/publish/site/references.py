"""Link equations (7), sections §4, App. C, notes and lessons in texts to their pages.

A text links a section of a lesson as JupyterLab and nbconvert do: `05_….ipynb#The-heading`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import unquote

from floatbase.lessons.publish.formulas import FORMULAS, SECTIONS

NOTES_ANCHOR = "notes-of-the-document"
_NUMBERS = {formula.number for formula in FORMULAS}
_SECTIONS = {section.number for section in SECTIONS}
# what is left as it is: code, formulas, links, headings, HTML, fences
_NOT_LINKED = (
    r"```.*?```|`[^`\n]*`|\$\$.+?\$\$|\$[^$\n]+?\$|!?\[[^\]\n]*\]\([^)\n]*\)|^#.*?$|<[^>\n]+>"
)
REFERENCE = re.compile(
    r"(?<![\w\]])(?P<equation>\(\d{1,2}\))|(?P<section>§\d(?:\.\d)?)|(?P<appendix>App(?:\.|endix) "
    r"[ABC])\b"
    r"|(?P<note>\bnotes? \d+)|(?P<lesson>\b[Ll]esson (?:\d\d|[A-Z])\b)"
)
_LESSON_LINK = re.compile(
    r"\[(?P<text>[^\]]*)\]\((?P<page>[^:()#]+\.ipynb)(?:#(?P<heading>[^()]+))?\)"
)
_IN_MARKDOWN = re.compile(f"(?P<kept>{_NOT_LINKED})|{REFERENCE.pattern}", re.DOTALL | re.MULTILINE)


def anchor_of(number: str) -> str:
    """Return the anchor on the page of equations: eq-9 for "(9)", sec-2-1 for "§2.1"."""
    if number.startswith("App"):
        return f"app-{number[-1].lower()}"
    return (
        f"sec-{number[1:].replace('.', '-')}"
        if number.startswith("§")
        else f"eq-{number.strip('()')}"
    )


def is_known(number: str) -> bool:
    """Whether "(9)", "§2.1" or "App. A" has a place on the page of equations."""
    return number in _NUMBERS | _SECTIONS


def target_of(match: re.Match[str]) -> str:
    """Return the anchor for a match of `REFERENCE`, or "" for a lesson or an unknown number."""
    if match["note"]:
        return NOTES_ANCHOR
    named = match["equation"] or match["section"] or (match["appendix"] or "").replace("endix", ".")
    return anchor_of(named) if is_known(named) else ""


def add_links(markdown: str, lessons: Mapping[str, str]) -> str:
    """Add links to equations and lessons; links to lessons that are not on the site become text."""
    names = {Path(address).name for address in lessons.values()}

    def link(match: re.Match[str]) -> str:
        if match["kept"]:
            to_lesson = _LESSON_LINK.fullmatch(match[0])
            return _site_link(to_lesson, names) if to_lesson else match[0]
        address = (
            lessons.get(match["lesson"].split()[1], "")
            if match["lesson"]
            else f"#{target_of(match)}"
        )
        return f"[{match[0]}]({address})" if len(address) > 1 else match[0]

    return _IN_MARKDOWN.sub(link, markdown)


def _site_link(link: re.Match[str], names: set[str]) -> str:
    """Return a link to a lesson with the anchor that MyST gives its heading."""
    if Path(link["page"]).name not in names:
        return link["text"]
    anchor = re.sub(r"[^\w-]", "", unquote(link["heading"] or "").lower())
    return f"[{link['text']}]({link['page']}{anchor and '#'}{anchor})"
