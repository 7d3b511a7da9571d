"""Where the files that come with the package lie."""

from __future__ import annotations

from pathlib import Path


def assets_root() -> Path:
    """The folder `assets/`: inside an installed package, else at the top of the repository."""
    package = Path(__file__).parent
    installed = package / "_assets"
    return installed if installed.is_dir() else package.parent / "assets"
