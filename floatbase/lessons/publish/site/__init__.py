"""The course as a web site: runs the lessons, prepares the pages, and builds them with Sphinx.

`build` is the entry point. `outputs` prepares lessons, `references` links equation numbers and
lessons, `reference` writes the API reference, and `mathml` draws formulas. `conf` configures
Sphinx. The text of the pages is in the folder `docs`. Building the site needs the extra `site`.
"""

from floatbase.lessons.publish.site import lecture, mathml, recall
from floatbase.lessons.publish.site.addresses import PACKAGES, exported
from floatbase.lessons.publish.site.answers import exercise_form, prediction_form, results
from floatbase.lessons.publish.site.build import SITE, build, replace_site
from floatbase.lessons.publish.site.outputs import prepare_lesson, run_lessons
from floatbase.lessons.publish.site.references import add_links

__all__ = [
    "PACKAGES",
    "SITE",
    "add_links",
    "build",
    "exercise_form",
    "exported",
    "lecture",
    "mathml",
    "prediction_form",
    "prepare_lesson",
    "recall",
    "replace_site",
    "results",
    "run_lessons",
]
