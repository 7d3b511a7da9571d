"""The 3-D pictures of the site; so far each is the image that its output holds beside it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any


class Pictures:
    """What the pictures of the site are drawn from. folder: where `write` puts what they share."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def place(self, data: Mapping[str, Any]) -> str | None:
        """HTML for an output's data; None leaves the output as it is."""
        return None

    def write(self) -> None:
        """Write what the pictures share."""
