"""Make the pictures of `assets/pictures/`: `python assets/build_pictures.py [name …]`. Needs
playwright and a Chromium.

They show the course text's figures, every robot in the catalogue with its forces and friction
cones, go2 with four-sided cones, and the feet of talos. The animation shows go2 stepping after a
push; it also needs the extra `video`. So does `docs/priorities.png`, which shows weighted tasks
beside strict priorities.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import sync_playwright

import floatbase as fb
from floatbase.lessons import FIGURES
from floatbase.lessons.figures import stepping
from floatbase.viewer import Viewer

OUT = Path(__file__).parent / "pictures"
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
SIZE = {"width": 1000, "height": 640}
FILM, PRIORITIES = "go2_steps", "priorities"


def standing(name: str, facets: int | None = None) -> Viewer:
    """A standing robot with forces that carry its weight. The first two forces lean, the second up
    to its cone.
    """
    robot = fb.load(name)
    state = robot.standing()
    view = Viewer(robot, background="white", facets=facets)
    if not robot.feet:
        return view.show(state)
    contacts = (fb.Contacts.flat_feet if robot.feet[0].is_flat else fb.Contacts.points)(
        robot, mu=0.6
    )
    forces = np.zeros((contacts.n_points, 3))
    forces[:, 2] = robot.weight / contacts.n_points
    forces[0, 0], forces[1, 1] = (
        0.25 * forces[0, 2],
        0.6 * np.cos(np.pi / 4 if facets else 0.0) * forces[1, 2],
    )
    return view.show(state, contacts, forces, support=True)


SCENES: dict[str, Callable[[], Viewer]] = {
    **FIGURES,
    **{name: partial(standing, name) for name in fb.catalogue()},
    "go2_facets": partial(standing, "go2", 4),
    "talos_feet": lambda: standing("talos").camera("feet"),
}


def film() -> None:
    """Save the animation."""
    view = stepping()
    path = view.save(OUT / f"{FILM}.gif", size=(480, 300))
    view.close()
    print(f"{FILM}: {path.stat().st_size / 1000:.0f} KB")


def priorities() -> None:
    """Draw the example of docs/constraints.md: weighted tasks beside strict priorities."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    robot, angle = fb.load("go2"), 0.2
    state, contacts = robot.standing(), fb.Contacts.points(robot, mu=0.7)
    c, s = np.cos(angle), np.sin(angle)
    pitched = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    trunk = [
        fb.standing_tasks(state)[0],
        fb.OrientationTask("base", pitched, kp=100.0, weight=10.0),
    ]
    posture = [fb.PostureTask(state.q, kp=100.0, weight=1.0)]
    figure, axes = plt.subplot_mosaic(
        [["weighted", "strict"], ["pitch", "posture"]],
        figsize=(9.0, 6.2),
        height_ratios=[1.25, 1.0],
        layout="constrained",
    )
    for name, tasks, colour in (
        ("weighted", [*trunk, *posture], "tab:orange"),
        ("strict", [trunk, posture], "tab:blue"),
    ):
        controller = fb.WholeBodyController(robot, contacts, tasks)
        run = fb.rollout(fb.Simulation(robot), controller, 1.0, control_period=4e-3)
        with tempfile.TemporaryDirectory() as folder:
            view = Viewer(robot, background="white").show(
                run.final, contacts, run.measured[-1], cones=False
            )
            view.camera("right")
            axes[name].imshow(plt.imread(view.save(Path(folder) / "robot.png", size=(640, 400))))
            view.close()
        axes[name].set_title({"weighted": "Weighted tasks", "strict": "Strict priorities"}[name])
        axes[name].axis("off")
        rotations = [run.state(i).frame_pose("base").rotation for i in range(len(run))]
        pitch = [np.arctan2(R[0, 2], R[2, 2]) for R in rotations]
        errors = np.abs(run.q[:, 7:] - state.q[7:]).max(axis=1)
        axes["pitch"].plot(run.time, pitch, colour, label=name)
        axes["posture"].plot(run.time, errors, colour, label=name)
    axes["pitch"].axhline(angle, color="black", linestyle=":", label="target")
    axes["pitch"].set(xlabel="time [s]", ylabel="pitch of the trunk [rad]")
    axes["posture"].set(xlabel="time [s]", ylabel="largest posture error [rad]")
    for name in ("pitch", "posture"):
        axes[name].legend()
        axes[name].grid(alpha=0.3)
    path = OUT.parents[1] / "docs" / f"{PRIORITIES}.png"
    figure.savefig(path, dpi=100)
    print(f"{PRIORITIES}: {path.stat().st_size / 1000:.0f} KB")


def main(names: list[str]) -> None:
    """Draw each scene, take a screenshot of its page, and save it with 255 colours."""
    OUT.mkdir(exist_ok=True)
    if PRIORITIES in names:
        priorities()
        names = [name for name in names if name != PRIORITIES]
    if FILM in names:
        film()
        names = [name for name in names if name != FILM]
    browser_path = (
        shutil.which("chromium")
        or shutil.which("chromium-browser")
        or shutil.which("google-chrome")
    )
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path, args=FLAGS)
        for name in names:
            view = SCENES[name]()
            page = browser.new_page(viewport=SIZE)
            page.goto(view.url)
            page.wait_for_function(
                "window.viewer && viewer.num_messages_received > 0 && !viewer.needs_render"
            )
            page.add_style_tag(content=".dg { display: none; }")
            page.screenshot(path=str(OUT / f"{name}.png"))
            page.close()
            view.close()
            with Image.open(OUT / f"{name}.png") as picture:
                picture.convert("RGB").quantize(255, Image.Quantize.MAXCOVERAGE).save(
                    OUT / f"{name}.png", optimize=True
                )
            print(f"{name}: {(OUT / f'{name}.png').stat().st_size / 1000:.0f} KB")
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1:] or [FILM, PRIORITIES, *SCENES])
