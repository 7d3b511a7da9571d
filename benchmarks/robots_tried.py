"""Try robot files from installed packages: loading, standing, a push, walking.

    python benchmarks/robots_tried.py                     -> docs/robots_that_were_tried.md
    python benchmarks/robots_tried.py --packages FOLDER   packages installed in another folder
    python benchmarks/robots_tried.py --only mjlab t1     some of the files; writes no page

robots_tried.toml lists the files of each package with the arguments that a file needs. The program
first loads each file from its bare path. It uses the arguments only if the robot then cannot be
loaded, or does not stand. Nothing is downloaded: packages that are not installed are named.
"""

from __future__ import annotations

import tomllib
import warnings
from collections import Counter
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
from floatbase.robots.loading import file_loader
from floatbase.simulation._conversion import Conversion
from floatbase.simulation.agreement import dynamics

PAGE = Path(__file__).parents[1] / "docs" / "robots_that_were_tried"
HEADER = (
    "package | file | mass | d | arguments | M, h | feet | stands | push | force / weight | walks "
    "| warnings"
)
N_COLUMNS = len(HEADER.split(" | "))
MAX_DRIFT = 20.0  # mm or mrad that a robot may move in 1 s if it stands
PERIOD = 0.002  # s


def found(folder: str | None) -> tuple[list[tuple[str, str, Path, dict[str, Any]]], list[str]]:
    """Return package, path and arguments of each file, and the packages that are missing."""
    wanted = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
    where, files, missing = {"path": [folder]} if folder else {}, [], []
    for package, arguments in wanted.items():
        distribution = next(Distribution.discover(name=package, **where), None)
        if distribution is None:
            missing.append(package)
            continue
        title = f"{package} {distribution.version}"
        for end, given in arguments.items():
            paths = [path for path in distribution.files or () if str(path).endswith(end)]
            files += [(title, end, Path(str(path.locate())).resolve(), given) for path in paths[:1]]
            missing += [] if paths else [f"{title}: {end}"]
    return files, missing


def feet(robot: fb.Robot) -> str:
    """Count balls, soles, wheels and points."""
    kinds = Counter(
        "sole" if foot.is_flat
        else "wheel" if robot.model.nqs[robot.model.frames[robot.frame_id(foot.frame)].parentJoint] == 2
        else "ball" if foot.radius else "point"
        for foot in robot.feet
    )  # fmt: skip
    return ", ".join(f"{n} {kind}{'s' * (n > 1)}" for kind, n in kinds.items())


def difference(robot: fb.Robot, path: Path) -> str:
    """Return the largest relative difference of M and h from MuJoCo's.

    A file with nothing but the robot is compared as MuJoCo itself compiles it. For other files, it
    is the model of the simulation.
    """
    model = fb.Simulation(robot).model
    with suppress(ValueError):  # not an MJCF, or a part of a scene
        original = mujoco.MjModel.from_xml_path(str(path))
        names = {original.joint(i).name for i in range(original.njnt)}
        if original.nv == robot.nv and names >= set(robot.joint_names):
            model = original
            model.opt.gravity, model.body_gravcomp[:] = (0.0, 0.0, -robot.gravity), 0.0
    errors, data, conversion = [], mujoco.MjData(model), Conversion(robot, model)
    for seed in range(3):
        state = robot.random_state(seed)
        for theirs, ours in zip(dynamics(data, conversion, state), (state.M, state.h), strict=True):
            errors.append(np.abs(theirs - ours).max() / np.abs(ours).max())
    return f"{max(errors):.0e}"


def moved(robot: fb.Robot, run: fb.Rollout) -> np.ndarray:
    """Return how far the CoM, or a joint of an arm, is from the standing posture [mm or mrad]."""
    state = robot.standing()
    if not robot.is_floating:
        return 1e3 * np.abs(run.q - state.q).max(axis=1)
    return 1e3 * np.linalg.norm(run.com - state.com, axis=1)


def stand(robot: fb.Robot) -> tuple[list[str], bool]:
    """Return how a robot stands, takes a push and bears its weight, and whether it stands."""
    state, sim = robot.standing(), fb.Simulation(robot)
    tasks = fb.standing_tasks(state) if robot.is_floating else (fb.PostureTask(state.q),)
    controller = fb.WholeBodyController(robot, fb.Contacts.feet(robot, mu=0.6), tasks)
    run = fb.rollout(sim, controller, 1.0, control_period=PERIOD)
    distance = moved(robot, run)[-1]
    if run.outcome != "completed" or distance > MAX_DRIFT:
        how = "sinks" if run.outcome == "completed" else run.outcome
        return [f"no: {how}, {distance:.0f} mm"], False
    if not robot.is_floating:
        return [f"{distance:.1f} mrad", "", ""], True
    ratio = run.planned[-1, 2::3].sum() / robot.weight
    push = fb.Push([2.0 * robot.mass, 0.0, 0.0], start=sim.time, duration=0.1)
    run = fb.rollout(sim, controller, 2.0, [push], control_period=PERIOD)
    distances = moved(robot, run)
    after = f"{distances.max():.0f}, {distances[-1]:.1f} mm"
    return [
        f"{distance:.1f} mm",
        after if run.outcome == "completed" else run.outcome,
        f"{ratio:.5f}",
    ], True


def walk(robot: fb.Robot) -> str:
    """Return how far a robot walks forwards in 4 s, of which the first is spent standing."""
    if len(robot.feet) not in (2, 4):
        return ""
    gait = Gait.walk(robot) if len(robot.feet) == 2 else Gait.trot(robot)
    controller = Walk(robot, fb.Contacts.feet(robot, mu=0.6), gait, (0.2, 0.0))
    run = fb.rollout(fb.Simulation(robot), controller, 4.0, control_period=PERIOD)
    distance = f"{run.com[-1, 0] - run.com[0, 0]:.2f} m"
    return distance if run.outcome == "completed" else f"{run.outcome}, {distance}"


def attempt(path: Path, arguments: dict[str, Any]) -> tuple[list[str], bool]:
    """Return the cells of a robot that is loaded with some arguments, and whether it stands."""
    cells, stands = [], False
    load = file_loader(str(path)) or fb.load_urdf
    try:
        robot = load(path, **arguments)
        cells += [f"{robot.mass:.3g} kg", robot.d, ", ".join(arguments) or "none"]
        cells += [difference(robot, path), feet(robot)]
        found, stands = stand(robot)
        cells += found
        if stands and robot.is_floating:
            cells.append(walk(robot))
    except FloatbaseError as error:
        cells.append(f"{type(error).__name__}: {short(error)}")
    return cells, stands


def short(message: object) -> str:
    """Return the first sentence of a message, on one line."""
    text = " ".join(str(message).split()).replace("|", "/")
    return text.partition(". ")[0][:160]


def row(title: str, end: str, path: Path, given: dict[str, Any]) -> list[object]:
    """Try a file from its bare path, and with the given arguments if it needs any."""
    for arguments in [{}, given] if given else [{}]:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            cells, stands = attempt(path, arguments)
        if stands:
            break
    cells += [""] * (N_COLUMNS - 3 - len(cells))
    notes = dict.fromkeys(short(one.message) for one in caught)
    return [title, end, *cells, "; ".join(notes)]


def main() -> None:
    parser = harness.command_line(__doc__)
    parser.add_argument("--packages", help="folder with the installed packages")
    parser.add_argument("--only", nargs="*", default=[], help="words that a file must contain")
    options = parser.parse_args()
    files, missing = found(options.packages)
    rows = (
        row(title, end, path, given)
        for title, end, path, given in files
        if all(word in f"{title} {path}" for word in options.only)
    )
    table = harness.table(HEADER, rows)
    print("Not found:", ", ".join(missing) or "none")
    if not options.only:
        harness.write(str(PAGE), "Robots that were tried", __doc__, table, missing)


if __name__ == "__main__":
    main()
