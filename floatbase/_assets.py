"""Location of the data files of the package."""

from __future__ import annotations

from pathlib import Path


def assets_root() -> Path:
    """Return `assets/`: inside an installed package, or else at the top of the repository."""
    package = Path(__file__).parent
    installed = package / "_assets"
    return installed if installed.is_dir() else package.parent / "assets"
