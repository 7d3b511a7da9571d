"""Which exercises a learner has tried and solved, stored in a file of the learner's own."""

from __future__ import annotations

import json
import os
from pathlib import Path


def path() -> Path:
    """Where it is stored: progress.json in the folder that FLOATBASE_HOME names, ~/.floatbase by default."""
    return Path(os.environ.get("FLOATBASE_HOME", Path.home() / ".floatbase")) / "progress.json"


def load() -> dict[str, dict[str, int]]:
    """For each exercise that was tried: {"tries": n, "right": m}. Empty when nothing was, or the file was damaged."""
    try:
        return dict(json.loads(path().read_text(encoding="utf-8")))
    except (OSError, ValueError):
        return {}


def record(name: str, right: bool) -> None:
    """Count a try of the exercise `name`. Where the file cannot be written the try is forgotten, without an error."""
    tried = load()
    entry = tried.setdefault(name, {"tries": 0, "right": 0})
    entry["tries"] += 1
    entry["right"] += int(right)
    try:
        path().parent.mkdir(parents=True, exist_ok=True)
        part = path().with_suffix(".part")
        part.write_text(json.dumps(tried, indent=1), encoding="utf-8")
        part.replace(path())
    except OSError:
        pass
