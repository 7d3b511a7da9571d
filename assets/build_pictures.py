"""Make the pictures of `assets/pictures/`: `python assets/build_pictures.py [name …]`. Needs
playwright and a Chromium.

They show the course text's figures, every robot of the catalogue with its forces and friction
cones, go2 with four-sided cones, and the feet of talos. The animation shows go2 stepping after a
push; it also needs the extra `video`.
"""

from __future__ import annotations

import shutil
import sys
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
FILM = "go2_steps"


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


def main(names: list[str]) -> None:
    """Draw each scene, take a screenshot of its page, and save it with 255 colours."""
    OUT.mkdir(exist_ok=True)
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
    main(sys.argv[1:] or [FILM, *SCENES])
