"""What a viewer displays in a notebook: a live picture, or what a program that stores notebooks
asks for.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

VARIABLE = "FLOATBASE_VIEWER"  # in the environment
# display mode -> what makes the mimebundle of a viewer in that mode, with `words` below it;
# programs that publish notebooks add theirs
MIMEBUNDLES: dict[str, Callable[..., dict[str, Any]]] = {}


def display_mode() -> str:
    """What displays are to be: "live" by default; "static" scenes that need no kernel; or a key of
    `MIMEBUNDLES`.
    """
    return os.environ.get(VARIABLE) or "live"
