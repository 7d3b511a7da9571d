"""Sphinx configuration of the web site, which `floatbase.lessons.publish.site.build` builds."""

from __future__ import annotations

from typing import Any

import floatbase
from floatbase.lessons.publish.site.mathml import visit_displaymath, visit_math
from floatbase.lessons.publish.site.reference import (
    hide_protocol_signature,
    link_equations,
    resolve_short_name,
)
from floatbase.viewer.web import pages

project = "floatbase"
author = "The floatbase authors"
copyright = "the floatbase authors, BSD 3-Clause licence"
version = release = floatbase.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_design",
]
root_doc = "index"
exclude_patterns = [".doctrees"]
add_module_names = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings give types with shapes and units
autosummary_generate = False  # `reference` writes the pages
napoleon_google_docstring = False
napoleon_use_param = False  # a shape such as (nv,) in a type is no link
napoleon_use_rtype = False
napoleon_use_ivar = True
default_role = "py:obj"  # `name` in a docstring links to that name
python_use_unqualified_type_names = True
maximum_signature_line_length = 90
toc_object_entries_show_parents = "hide"

# lessons are run before Sphinx reads them
nb_execution_mode = "off"
nb_merge_streams = True
nb_ipywidgets_js: dict[str, Any] = {}
myst_enable_extensions = ["colon_fence", "dollarmath", "amsmath"]
myst_heading_anchors = 4
suppress_warnings = [
    "myst.header",  # a lesson may begin a part with a small heading
    "ref.citation",  # not every reference is cited by a docstring
    "ref.python",  # the d of a type "shape (d,)" has the name of several attributes
]

html_context = {"default_mode": "auto"}
html_theme = "sphinx_book_theme"
html_favicon = "static/icon.svg"
html_title = "floatbase"
html_math_renderer = "mathml"
html_static_path = ["static", str(pages.DIST / "pictures.js")]
html_css_files = ["site.css", "pictures.css"]
html_js_files = [
    ("pictures.js", {"defer": "defer"}),
    ("search.js", {"defer": "defer"}),
    ("due.js", {"defer": "defer"}),
    ("answers.js", {"defer": "defer"}),
]
html_show_sphinx = False
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "show_toc_level": 2,
    "use_download_button": False,
    "navbar_persistent": [],  # search is in the side bar
    "use_fullscreen_button": False,
    "show_navbar_depth": 1,
    "navigation_depth": 2,
    "home_page_in_toc": True,
}


def setup(app: Any) -> dict[str, Any]:
    """Connect our handlers; Sphinx calls this first."""
    app.add_html_math_renderer("mathml", (visit_math, None), (visit_displaymath, None))
    app.connect("autodoc-process-docstring", link_equations)
    app.connect("autodoc-process-signature", hide_protocol_signature)
    app.connect("missing-reference", resolve_short_name)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
