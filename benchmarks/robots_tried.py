"""Try robot files from installed packages: loading, standing, a push, walking.

    python benchmarks/robots_tried.py                     -> docs/robots_that_were_tried.md
    python benchmarks/robots_tried.py --packages FOLDER   packages installed in another folder
    python benchmarks/robots_tried.py --only mjlab t1     some of the files; writes no page

robots_tried.toml lists the files, with the arguments that a file needs. Nothing is downloaded:
packages that are not installed are named in the page.

Robot files of packages on PyPI, none of them made for floatbase, were loaded and tried by
`python benchmarks/robots_tried.py`, which wrote this page. Robots in the catalogue and of
example-robot-data are not listed. See [Your own robot](your_own_robot.md).

- **arguments** is what `fb.load_urdf` or `fb.load_mjcf` needs besides the path. With none, a robot
  needs one line. Arguments are used only if the robot cannot be loaded, stand or walk without them.
- **M, h** is the largest relative difference from MuJoCo in three random states. A robot that is
  alone in its MJCF is compared with the file, without what a warning names. Any other robot is
  compared with its simulation.
- **stands** is how far the centre of mass is from its place after 1 s. For a robot with a fixed
  base, it is the norm of the errors of all joints.
- **push** gives the largest and the last distance of the centre of mass in the 2 s after the
  beginning of a push. The push is 2 N per kilogram of mass and lasts 0.1 s.
- **force / weight** is the planned vertical force at rest, as a fraction of the weight.
- **walks** is the distance walked in 4 s at 0.2 m/s. The first second is spent standing, so 0.6 m
  is expected. Bipeds walk and quadrupeds trot, both with the default settings.
- **warnings** are the first sentences of warnings, shortened.
"""

import textwrap
import tomllib
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from importlib.metadata import Distribution
from pathlib import Path
from typing import Any

import harness
import mujoco
import numpy as np

import floatbase as fb
from floatbase.behaviours import Gait, Walk
from floatbase.errors import FloatbaseError
from floatbase.robots import Foot
from floatbase.simulation._conversion import Conversion

PAGE = Path(__file__).parents[1] / "docs" / "robots_that_were_tried"
HEADER = (
    "package | file | mass | joints | arguments | M, h | feet | stands | push | force / weight | "
    "walks | warnings"
)
STANDS = 5  # cells between the columns "file" and "stands"
MAX_DRIFT = 20.0  # mm or mrad that a robot may move in 1 s if it stands
PERIOD = 0.002  # s


def found(folder: str | None) -> Iterator[tuple[str, str, str | None, dict[str, Any]]]:
    """Yield package, name, path and arguments of each file; the path is None if it is missing."""
    where = {"path": [folder]} if folder else {}
    packages = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
    for package, files in packages.items():
        installed = next(Distribution.discover(name=package, **where), None)
        title = f"{package} {installed.version}" if installed else package
        paths = (installed.files if installed else None) or []
        for end, arguments in files.items():
            matching = (str(path.locate()) for path in paths if str(path).endswith(end))
            yield title, end, next(matching, None), arguments


def kind_of(foot: Foot) -> str:
    """Return whether a foot is a sole, a wheel, a ball or a point."""
    if foot.is_flat:
        return "sole"
    return "wheel" if foot.axis is not None else "ball" if foot.radius else "point"


def difference(robot: fb.Robot, path: str) -> float:
    """Return the largest relative difference of M and h from those of MuJoCo."""
    model = fb.Simulation(robot).model
    with suppress(ValueError):  # not an MJCF
        original = mujoco.MjModel.from_xml_path(path)
        names = {original.joint(i).name for i in range(original.njnt)}
        if original.nv == robot.nv and names >= set(robot.joint_names):
            model = original
            model.opt.gravity, model.body_gravcomp[:] = (0.0, 0.0, -robot.gravity), 0.0
            model.dof_armature[: robot.nv - robot.d] = 0.0  # a warning names it
    errors, data, conversion = [], mujoco.MjData(model), Conversion(robot, model)
    for state in map(robot.random_state, range(3)):
        for theirs, ours in zip(conversion.dynamics(data, state), (state.M, state.h), strict=True):
            errors.append(np.abs(theirs - ours).max() / np.abs(ours).max())
    return max(errors)


def stand(robot: fb.Robot) -> tuple[list[str], bool]:
    """Return how a robot stands, takes a push and bears its weight, and whether it stands."""
    state, sim = robot.standing(), fb.Simulation(robot)
    hold = fb.PostureTask(state.q, weight=10.0)  # for a fixed base
    tasks = fb.standing_tasks(state) if robot.is_floating else (hold,)
    controller = fb.WholeBodyController(robot, fb.Contacts.feet(robot, mu=0.6), tasks)
    run = fb.rollout(sim, controller, 1.0, control_period=PERIOD)
    moved = run.com - state.com if robot.is_floating else run.q - state.q
    distance, unit = 1e3 * np.linalg.norm(moved[-1]), "mm" if robot.is_floating else "mrad"
    if run.outcome != "completed" or distance > MAX_DRIFT:
        return [f"no: {run.outcome}, {distance:.0f} {unit}"], False
    cells = [f"{distance:.1f} {unit}"]
    if robot.is_floating:
        force = run.planned[-1, 2::3].sum()
        push = fb.Push([2.0 * robot.mass, 0.0, 0.0], start=sim.time, duration=0.1)
        run = fb.rollout(sim, controller, 2.0, [push], control_period=PERIOD)
        distances = 1e3 * np.linalg.norm(run.com - state.com, axis=1)
        after = f"{distances.max():.0f}, {distances[-1]:.1f} mm"
        cells.append(after if run.outcome == "completed" else run.outcome)
        cells.append(f"{force / robot.weight:.5f}")
    return cells, True


def walk(robot: fb.Robot) -> tuple[str, bool]:
    """Return how far a robot walks, and whether this is about the distance that was requested."""
    gait = Gait.walk(robot) if len(robot.feet) == 2 else Gait.trot(robot)
    controller = Walk(robot, fb.Contacts.feet(robot, mu=0.6), gait, (0.2, 0.0))
    run = fb.rollout(fb.Simulation(robot), controller, 4.0, control_period=PERIOD)
    distance = run.com[-1, 0] - run.com[0, 0]
    if run.outcome != "completed":
        return f"{run.outcome}, {distance:.2f} m", False
    return f"{distance:.2f} m", abs(distance - 0.6) < 0.2


def attempt(path: str, arguments: dict[str, Any]) -> tuple[list[str], bool]:
    """Return the cells of a robot that is loaded with some arguments, and whether all went well."""
    cells, works = [], False
    try:
        load = fb.load_mjcf if path.endswith(".xml") else fb.load_urdf
        robot = load(path, **arguments)
        given = ", ".join(f"`{name}={value}`" for name, value in arguments.items())
        cells += [f"{robot.mass:.3g} kg", str(robot.d), given or "none"]
        cells.append(f"{difference(robot, path):.0e}")
        kinds = Counter(kind_of(foot) for foot in robot.feet)
        cells.append(", ".join(f"{n} {kind}{'s' * (n > 1)}" for kind, n in kinds.items()))
        results, works = stand(robot)
        cells += results
        if works and len(robot.feet) in (2, 4):
            distance, works = walk(robot)
            cells.append(distance)
    except FloatbaseError as error:
        cells += [""] * (STANDS - len(cells))
        cells.append(f"{type(error).__name__}: {short(error)}")
    return cells, works


def short(message: object) -> str:
    """Return the first sentence of a message, on one line."""
    sentence = str(message).replace("|", "/").partition(". ")[0]
    return textwrap.shorten(sentence, 160, placeholder=" …")


def row(title: str, end: str, path: str | None, needed: dict[str, Any]) -> list[str]:
    """Try a file from its bare path, and with arguments if it needs any."""
    cells, notes, works = [""] * STANDS + ["not installed"], [], path is None
    for arguments in ({}, needed):
        if not works and (needed or arguments is not needed):
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                cells, works = attempt(path, arguments)
            notes = [short(one.message) for one in caught]
    cells += [""] * (HEADER.count("|") - 2 - len(cells))
    return [title, end, *cells, "; ".join(dict.fromkeys(notes))]


def main() -> None:
    parser = harness.command_line(__doc__)
    parser.add_argument("--packages", help="folder with the installed packages")
    parser.add_argument("--only", nargs="*", default=[], help="words that a row must contain")
    options = parser.parse_args()
    files = found(options.packages)
    rows = (row(*file) for file in files if all(word in f"{file[:2]}" for word in options.only))
    table = harness.table(HEADER, rows)
    if not options.only:
        text = __doc__.split("\n\n", 3)[3].strip()
        harness.write(str(PAGE), "Robots that were tried", text, table)


if __name__ == "__main__":
    main()
