"""Display mode of a viewer in a notebook: a live picture, or a stored form of the picture."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

VARIABLE = "FLOATBASE_VIEWER"  # in the environment
# display mode -> function that returns a viewer's mimebundle, with `words` below it; programs that
# publish notebooks add their own
MIMEBUNDLES: dict[str, Callable[..., dict[str, Any]]] = {}


def display_mode() -> str:
    """Return the display mode from the environment variable FLOATBASE_VIEWER."""
    return os.environ.get(VARIABLE) or "live"
