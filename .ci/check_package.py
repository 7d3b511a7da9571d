"""Install a wheel or an sdist into an environment of its own, and check that it works there.

`python .ci/check_package.py dist/floatbase-0.1.0-py3-none-any.whl`; of the repository, only the
README and the lock are used. The base install must print what the README says, have the notebooks
of the course, use the compiled controller, and not compile what the wheel contains compiled.
"""

import re
import shutil
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
COMMANDS = ("lab --help", "robots", "doctor")
LESSONS = """
from pathlib import Path
import floatbase
print(*sorted(path.name for path in Path(floatbase.__file__).parent.glob("_notebooks/*.ipynb")))
"""


def install(package: Path, place: Path) -> Path:
    """Make an environment with a package, with uv if it is there; return its folder of programs."""
    programs = place / "bin"
    if uv := shutil.which("uv"):
        subprocess.run([uv, "venv", "-q", "--python", sys.executable, str(place)], check=True)
        installer = [uv, "pip", "install", "--python", str(programs / "python")]
    else:
        venv.create(place, with_pip=True)
        installer = [str(programs / "python"), "-m", "pip", "install"]
    lock = str(ROOT / "environment.txt")
    subprocess.run([*installer, "-q", "-c", lock, str(package)], check=True)
    return programs


def faults_of(package: Path) -> list[str]:
    """What is wrong with a package; what it prints is printed."""
    with tempfile.TemporaryDirectory() as folder:
        programs, place = install(package, Path(folder) / "venv"), Path(folder) / "empty"
        place.mkdir()

        def printed(program: str, *arguments: str) -> str:
            command = [str(programs / program), *arguments]
            return subprocess.run(
                command, cwd=place, check=True, stdout=subprocess.PIPE, text=True
            ).stdout

        lessons = printed("python", "-I", "-c", LESSONS).split()
        for command in COMMANDS:
            print(answer := printed("floatbase", *command.split()))
        uses_compiled = "compiled backend" in answer  # of the doctor
        example = printed("python", "-I", "-c", block("python"))
        print(f"{package.name}, {package.stat().st_size / 1e6:.2f} MB, prints\n{example}", end="")
        code = ["_compiled" in file.parts for file in programs.parent.rglob("*.nbc")]
    expected = sorted(path.name for path in (ROOT / "notebooks").glob("*.ipynb"))
    faults = [f"{package.name} has the lessons {lessons}"] if lessons != expected else []
    if example != block("text"):
        faults.append(f"{package.name} does not print what the README says")
    if not uses_compiled or len(set(code)) > 1:  # code of the wheel, and code compiled here
        faults.append(f"{package.name} does not use compiled code, or compiles it again")
    return faults


def block(language: str) -> str:
    """The first block of a language in the README."""
    readme = (ROOT / "README.md").read_text("utf-8")
    found = re.search(rf"^```{language}\n(.*?)^```$", readme, flags=re.MULTILINE | re.DOTALL)
    assert found, language
    return found.group(1)


def main() -> int:
    """The command; 1 when something is wrong."""
    faults = [fault for package in sys.argv[1:] for fault in faults_of(Path(package).resolve())]
    print(*faults, sep="\n")
    return 1 if faults or len(sys.argv) < 2 else 0


if __name__ == "__main__":
    sys.exit(main())
