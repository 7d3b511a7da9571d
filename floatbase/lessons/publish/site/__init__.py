"""The course as a web site: `make site` runs the lessons, prepares all pages for Sphinx, and builds
them into build/site.

`build` does it. `outputs` prepares the lessons, `references` links what texts name, `reference` and
`docstrings` make the pages of the library, `mathml` draws formulas; `conf` is Sphinx's, and the
texts of the site's own pages stand beside it. This needs the extra `site`.
"""

from floatbase.lessons.publish.site import docstrings, mathml
from floatbase.lessons.publish.site.build import SITE, build
from floatbase.lessons.publish.site.outputs import prepare_lesson, run_lessons
from floatbase.lessons.publish.site.references import add_links

__all__ = ["SITE", "add_links", "build", "docstrings", "mathml", "prepare_lesson", "run_lessons"]
