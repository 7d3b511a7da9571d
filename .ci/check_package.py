"""Install a wheel or an sdist into an environment of its own and let it print what the README says.

`python .ci/check_package.py dist/floatbase-0.1.0-py3-none-any.whl`; nothing of the repository but
the README is used.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def printed_by(package: Path, folder: Path) -> str:
    """What the README's first program prints with this package, run in an empty folder."""
    venv.create(folder / "venv", with_pip=True)
    python, place = folder / "venv" / "bin" / "python", folder / "empty"
    pip = [
        str(python),
        "-m",
        "pip",
        "--disable-pip-version-check",
        "install",
        "-q",
        "-c",
        str(ROOT / "environment.txt"),
    ]
    subprocess.run([*pip, str(package)], check=True)
    place.mkdir()
    program = _block("python")
    return subprocess.run(
        [python, "-I", "-c", program], check=True, capture_output=True, text=True, cwd=place
    ).stdout


def _block(language: str) -> str:
    found = re.search(
        rf"^```{language}\n(.*?)^```$",
        (ROOT / "README.md").read_text("utf-8"),
        flags=re.MULTILINE | re.DOTALL,
    )
    assert found, language
    return found.group(1)


def main() -> int:
    """The command; 1 when something else is printed."""
    wrong = 0
    for package in map(Path, sys.argv[1:]):
        with tempfile.TemporaryDirectory() as folder:
            printed = printed_by(package.resolve(), Path(folder))
        wrong += printed != _block("text")
        print(f"{package.name}, {package.stat().st_size / 1e6:.2f} MB:\n{printed}", end="")
    return 1 if wrong or len(sys.argv) < 2 else 0


if __name__ == "__main__":
    sys.exit(main())
