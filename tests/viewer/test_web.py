"""The built JavaScript matches its sources."""

import hashlib

from floatbase.viewer.web import pages

WEB = pages.DIST.parent


def test_the_built_pages_are_up_to_date():
    """As build.mjs computes it."""
    digest = hashlib.sha256()
    files = (path for path in (WEB / "src").rglob("*") if path.is_file())
    sources = sorted(path.relative_to(WEB).as_posix() for path in files)
    tables = sorted(f"../../live/{path.name}" for path in (WEB / "../../live").glob("*.json"))
    for name in ("build.mjs", "package-lock.json", *tables, *sources):
        data = (WEB / name).read_bytes()
        digest.update(f"{name} {len(data)}\n".encode() + data)
    is_current = (pages.DIST / "sources.sha256").read_text().strip() == digest.hexdigest()
    assert is_current, "dist/ is older than src/: run `make web` and commit what it builds"
