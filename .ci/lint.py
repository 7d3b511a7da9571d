"""Check the files that no test runs: lock, container, hub, workflows, README, the pages that the
code writes, and the size of the code.

`python .ci/lint.py` prints the sizes and what is wrong, and exits with 1 if anything is. It builds
nothing and needs no network.
"""

import ast
import json
import os
import re
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator
from importlib.metadata import packages_distributions
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parent.parent
Faults = Iterator[str]


def text(path: str) -> str:
    """The text of a file, with its continued lines joined."""
    return (ROOT / path).read_text(encoding="utf-8").replace("\\\n", " ")


PROJECT = tomllib.loads(text("pyproject.toml"))["project"]
PYTHONS = re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["classifiers"]))
TARGETS = re.findall(r"^([a-z-]+)(?: [a-z-]+)*:(?!=)", text("Makefile"), flags=re.M)
TARGETS += re.findall(r"^[a-z-]+ ([a-z-]+):(?!=)", text("Makefile"), flags=re.M)


def lock() -> Faults:
    """Every dependency is pinned to one version within its range, on every platform."""
    lines = [
        line for line in text("environment.txt").splitlines() if line and not line.startswith("#")
    ]
    pins = {canonicalize_name(pin.name): pin for pin in map(Requirement, lines)}
    if len(pins) < len(lines):
        yield "a package is pinned twice"
    for pin in pins.values():
        if pin.url or [spec.operator for spec in pin.specifier] != ["=="]:
            yield f"{pin} is not an exact version"
    extras = PROJECT["optional-dependencies"].values()
    required_lines = {line for lines in (PROJECT["dependencies"], *extras) for line in lines}
    for required in map(Requirement, sorted(required_lines)):
        if required.name == PROJECT["name"]:
            continue  # one extra contains another
        pin = pins.get(canonicalize_name(required.name))
        if pin is None or pin.marker:
            yield f"{required.name} is not pinned for every platform; run `make lock`"
        elif not required.specifier.contains(next(iter(pin.specifier)).version, prereleases=True):
            yield f"{pin} is not within {required}; run `make lock`"


# distributions that pip's record of top-level modules does not tell
DISTRIBUTIONS = packages_distributions() | {
    "coal": ["coal"],
    "example_robot_data": ["example-robot-data"],
    "mujoco": ["mujoco"],
    "pinocchio": ["pin"],
}
# the extra without which the modules of a folder cannot be imported; the library needs none
EXTRAS = {
    "floatbase/viewer": "viewer",
    "floatbase/playground": "viewer",
    "floatbase/lessons": "course",
    "floatbase/lessons/publish/site": "site",
    "tests": "test",
    "benchmarks": "test",
    "examples": "test",
    ".ci": "test",
    "assets": "test",
}
# declared, and not imported by name
TOOLS = {
    "build", "editables", "example-robot-data-loaders", "hatchling", "jupyterhub", "jupyterlab",
    "mypy", "myst-nb", "nbval", "pycollada", "pytest-timeout", "pytest-xdist", "ruff",
    "sphinx-book-theme", "sphinx-design", "uv", "voila",
}  # fmt: skip
# benchmarks/peers.py makes environments of their own for these
PEERS = {"placo", "tsid"}


def imports() -> Faults:
    """The base install suffices to import the library, an extra to import what is built on it; all
    that is imported anywhere is declared, and all that is declared is used.
    """
    used, declared = set(), _declared("test")
    for path in sorted(path for folder in ("floatbase", *EXTRAS) for path in _sources(folder)):
        place = path.relative_to(ROOT)
        extra = next((EXTRAS[str(up)] for up in place.parents if str(up) in EXTRAS), None)
        if place.name == "conftest.py" or place.parts[0] != "floatbase":
            extra = "test"
        for line, module, at_once in sorted(_imports(path)):
            found = set(map(canonicalize_name, DISTRIBUTIONS.get(module, [module])))
            used |= found
            if not found & (_declared(extra) if at_once else declared):
                where = f"the extra {extra}" if at_once and extra else "the dependencies"
                yield f"{place}:{line} imports {module}, which is not in {where}"
    yield from (f"{name} is declared and not used" for name in declared - used - TOOLS)


def _declared(extra: str | None) -> set[str]:
    """Distributions of the base install and of an extra with those that it contains."""
    lines, found = [*PROJECT["dependencies"]], set()
    if extra:
        lines += PROJECT["optional-dependencies"][extra]
    for required in map(Requirement, lines):
        if required.name == PROJECT["name"]:
            found |= set().union(*map(_declared, required.extras))
        else:
            found.add(canonicalize_name(required.name))
    return found


def _sources(folder: str) -> Iterator[Path]:
    inner = [ROOT / name for name in EXTRAS if name.startswith(folder + "/")]
    for path in (ROOT / folder).rglob("*.py"):
        if "node_modules" not in path.parts and not any(up in inner for up in path.parents):
            yield path


def _imports(path: Path) -> set[tuple[int, str, bool]]:
    """Line and name of each imported package, and whether it loads with the module."""
    folders = path.parent, ROOT / "tests", ROOT / "benchmarks"
    own = {"floatbase", *PEERS, *(file.stem for one in folders for file in one.glob("*.py"))}
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        match node:
            case ast.Import(names=names):
                modules = [alias.name for alias in names]
            case ast.ImportFrom(module=str(module), level=0):
                modules = [module]
            case ast.Call(
                func=ast.Name(id=called) | ast.Attribute(attr=called),
                args=[ast.Constant(value=str(module)), *_],
            ) if called in ("require", "import_module", "find_spec", "importorskip"):
                modules = [module]
            case _:
                continue
        tops = {module.partition(".")[0] for module in modules}
        at_once = node.col_offset == 0 and not isinstance(node, ast.Call)
        found |= {(node.lineno, top, at_once) for top in tops - own - sys.stdlib_module_names}
    return found


def private_names() -> Faults:
    """A numba with a private option that the code uses is not newer than the one that is tested."""
    (numba,) = (one for one in map(Requirement, PROJECT["dependencies"]) if one.name == "numba")
    (locked,) = re.findall(r"^numba==(\d+)\.(\d+)", text("environment.txt"), flags=re.M)
    upper_bound = f"<{locked[0]}.{int(locked[1]) + 1}"
    if "_nrt" in text("floatbase/control/tick/jit.py") and upper_bound not in str(numba):
        yield f"{numba} needs the upper bound {upper_bound}, because jit.py uses a private option"


def version() -> Faults:
    """The version is the same everywhere."""
    (number,) = re.findall(r'^__version__ = "(.+)"', text("floatbase/__init__.py"), flags=re.M)
    lines = {
        "CITATION.cff": f"version: {number}",
        "CHANGELOG.md": f"## [{number}]",
        "docs/references.rst": f"{{{number}}}",
    }
    yield from (f"{path} has no {line}" for path, line in lines.items() if line not in text(path))


def container() -> Faults:
    """Images install from the lock, compile for any processor, and do not run as root."""
    docker = text("Dockerfile")
    for path in ("Dockerfile", ".binder/postBuild"):
        installed = [line for line in text(path).splitlines() if "pip install" in line]
        if not installed or any(
            part.count("-c environment.txt") < part.count("pip install") for part in installed
        ):
            yield f"{path} installs without -c environment.txt"
        if not re.search(
            r"NUMBA_CPU_NAME=generic.*pip install.*^(?:RUN )?floatbase compile$",
            text(path),
            flags=re.S | re.M,
        ):
            yield f"{path} does not compile for a generic processor after it installs"
    images = re.findall(r"^FROM (\S+)", docker, flags=re.M)
    for image in [*images, json.loads(text(".devcontainer/devcontainer.json"))["image"]]:
        if not re.fullmatch(r"\S+@sha256:[0-9a-f]{64}", image):
            yield f"the image {image} is not pinned by its digest"
    if (
        not re.search(r"^USER learner$(?!.*^(?:USER|RUN) ).*^CMD ", docker, flags=re.M | re.S)
        or "allow-root" in docker
    ):
        yield "the container runs as root"
    command, subcommand, folder, *_ = json.loads(re.findall(r"^CMD (.+)$", docker, flags=re.M)[-1])
    if [command, subcommand] != ["floatbase", "lab"]:
        yield "the container does not start `floatbase lab`"
    if f":/home/learner/{folder} " not in docker:
        yield f"the lessons in {folder} are not in the volume"


def pythons() -> Faults:
    """Every file names Pythons that the package supports."""
    named = {
        "Dockerfile": re.findall(r"^FROM python:(3\.\d+)", text("Dockerfile"), flags=re.M),
        ".binder/runtime.txt": re.findall(r"python-(3\.\d+)", text(".binder/runtime.txt")),
        ".devcontainer/devcontainer.json": re.findall(
            r"python:\d-(3\.\d+)", text(".devcontainer/devcontainer.json")
        ),
        ".github/workflows/test.yml": re.findall(r'"(3\.\d+)"', text(".github/workflows/test.yml")),
    }
    for path, found in named.items():
        if not found or not set(found) <= set(PYTHONS):
            yield f"{path} names Python {found}, and the package supports {PYTHONS}"


def scripts() -> Faults:
    """Scripts are executable and have no syntax error."""
    for path in (
        ".binder/postBuild", ".binder/start", ".ci/bounds", ".ci/compile_for_wheel", ".ci/run",
    ):  # fmt: skip
        if (
            not os.access(ROOT / path, os.X_OK)
            or subprocess.run(["bash", "-n", ROOT / path]).returncode
        ):
            yield f"{path} cannot be run"


def hub() -> Faults:
    """Root cannot log in to the hub, and no kernel listens on a port."""
    configuration = text(".binder/jupyterhub_config.py")
    ast.parse(configuration)
    for needed in ('\nc.Authenticator.blocked_users = {"root"}\n', "--KernelManager.transport=ipc"):
        if needed not in configuration:
            yield f"the hub's configuration has no {needed.strip()}"


def workflows() -> Faults:
    """A release is tested before it is published, by scripts that exist, and without a password."""
    tests, publish = (text(f".github/workflows/{name}.yml") for name in ("test", "publish"))
    release = publish[publish.index("  pypi:") : publish.index("  site:")]
    for needed, there in {
        "needs: [package, tests]": release,
        "id-token: write": release,
        "workflow_call:": tests,
    }.items():
        if needed not in there:
            yield f"a workflow has no {needed}"
    for script in re.findall(r"\.ci/\w+(?:\.py)?", tests + publish):
        if not (ROOT / script).exists():
            yield f"a workflow runs {script}, which does not exist"
    for action in re.findall(r"uses: (.+)", tests + publish):
        if not re.fullmatch(r"\./\S+|[\w./-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", action):
            yield f"{action} is not pinned by its commit, with the version as a comment"
    if "secrets." in publish:
        yield "publish.yml has a password"
    if (tests + publish).count("persist-credentials: false") < (tests + publish).count("checkout@"):
        yield "a checkout keeps its credentials"
    if not re.search(rf"compile_for_wheel {re.escape(' '.join(PYTHONS))}$", publish, flags=re.M):
        yield "publish.yml does not compile the controller for every Python of the package"
    if "python -m build --no-isolation --sdist --wheel" not in publish:
        yield "publish.yml builds with versions that are not in environment.txt"


def commands() -> Faults:
    """Make targets and files that texts name exist."""
    readme = text("README.md")
    named = re.findall(
        r'(?:[`"]|    )make ([a-z-]+)', readme + text(".devcontainer/devcontainer.json")
    )
    yield from (f"there is no target make {name}" for name in set(named) - set(TARGETS))
    links = {link for link in re.findall(r"\]\(([^)#]+)\)", readme) if "://" not in link}
    yield from (
        f"the README links to {link}, which does not exist"
        for link in links
        if not (ROOT / link).exists()
    )


def pages() -> Faults:
    """The pages that the code writes are up to date, and every equation has a function, a test and
    a lesson.
    """
    from floatbase.lessons.publish import (
        NOTEBOOKS,
        README,
        conventions,
        equations,
        lesson_file,
        lesson_notebooks,
        lesson_table,
        read_notebook,
        readme_with_table,
    )

    made = {
        NOTEBOOKS / "equations.md": equations.table(),
        NOTEBOOKS / "conventions.md": conventions.page(),
        README: readme_with_table(README.read_text(encoding="utf-8")),
        **{path: lesson_file(path).decode() for path in lesson_notebooks().values()},
    }
    for path, page in made.items():
        if path.read_text(encoding="utf-8") != page:
            yield f"{path.name} is out of date; run `python -m floatbase.lessons.publish map`"
    entries = equations.entries()
    yield from (f"no test names {entry.path}" for entry in entries if not entry.tests)
    found = {number for entry in entries for number in entry.equations}
    yield from (
        f"{number}: the docstrings and the map do not agree"
        for number in found ^ set(equations.TITLES)
    )
    taught = {
        name: _numbers(row)
        for row in lesson_table().splitlines()
        for name in re.findall(r"notebooks/(\w+\.ipynb)", row)
    }
    yield from (
        f"no lesson teaches {number}"
        for number in set(equations.TITLES) - set().union(*taught.values())
    )
    for name, numbers in taught.items():
        cells = [
            cell.source
            for cell in read_notebook(NOTEBOOKS / name).cells
            if cell.cell_type == "markdown"
        ]
        (source,) = re.findall(r"^\*\*Source\*\*.*$", "\n".join(cells), flags=re.M)
        yield from (
            f"the source line of {name} does not name {number}"
            for number in numbers - _numbers(source)
        )


def _numbers(ranges: str) -> set[str]:
    """The equations of a text such as "(1)-(3), (5), App. A"."""
    spans = re.findall(r"\((\d+)\)(?:-\((\d+)\))?", ranges)
    numbers = {f"({n})" for first, last in spans for n in range(int(first), int(last or first) + 1)}
    return numbers | set(re.findall(r"App\. [ABC]", ranges))


# largest numbers of lines without docstrings, blank lines and comments; and of all docstrings
BUDGETS = {
    "library": 17069, "lessons": 12000, "viewer": 4200, "tests": 23652, "benchmarks": 2345,
    "docstrings": 16081,
}  # fmt: skip


MAX_LINES = 400  # of a module, without docstrings


def sizes() -> Faults:
    """No module is too long, and no part of the code is larger than its budget. The sizes of all
    parts are printed.
    """
    found: Counter[str] = Counter()
    folders = "floatbase", "tests", "benchmarks", "examples", ".ci", "assets"
    for path in (path for folder in folders for path in (ROOT / folder).rglob("*.py")):
        top, *inner = path.relative_to(ROOT).parts[:-1]
        if "node_modules" in inner:
            continue
        part = "library" if top == "floatbase" else top
        if top == "floatbase" and inner and inner[0] in ("lessons", "viewer", "playground", "live"):
            part = inner[0]
        source = path.read_text(encoding="utf-8")
        documented, lines = _docstring_lines(source), source.splitlines()
        if top == "floatbase" and len(lines) - len(documented) > MAX_LINES:
            yield f"{path.relative_to(ROOT)} has more than {MAX_LINES} lines without docstrings"
        if top == "floatbase" and re.search("TODO|FIXME|XXX", source):
            yield f"{path.relative_to(ROOT)} is not finished"
        found["docstrings"] += len(documented)
        found[part] += sum(
            number not in documented and not re.fullmatch(r"\s*(#.*)?", line)
            for number, line in enumerate(lines, 1)
        )
    print("lines of code:", ", ".join(f"{part} {n:,}" for part, n in sorted(found.items())))
    for part, most in BUDGETS.items():
        if found[part] > most:
            yield f"{part}: {found[part]:,} lines are more than the budget of {most:,}"


def _docstring_lines(source: str) -> set[int]:
    """The numbers of the lines of all docstrings of a module."""
    lines: set[int] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(
            node
        ):
            lines.update(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    return lines


def javascript() -> Faults:
    """Lines of JavaScript are at most 100 characters long. Ruff checks those of Python."""
    for path in sorted((ROOT / "floatbase/viewer/web/src").rglob("*.js")):
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            if len(line) > 100:
                yield f"{path.relative_to(ROOT)}:{number} has {len(line)} characters"


CHECKS: tuple[Callable[[], Faults], ...]
CHECKS = (
    lock, imports, private_names, version, container, pythons, scripts, hub, workflows, commands,
    pages, sizes, javascript,
)  # fmt: skip


def main() -> int:
    """Run all checks; 1 when one found a fault."""
    faults = [f"{check.__name__}: {fault}" for check in CHECKS for fault in check()]
    print(*faults, sep="\n", end="\n" if faults else "")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
