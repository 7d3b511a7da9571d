"""The picture of a robot for its live page: every item that may ever be seen, and what moves it.

The page only moves, colours, shows and hides these items.
"""

from __future__ import annotations

import gzip
from typing import Any

import numpy as np

from floatbase.dynamics import UP, Contacts
from floatbase.friction import FrictionPolyhedron
from floatbase.live.robots import FACETS
from floatbase.live.settings import TERMS
from floatbase.robots import Robot
from floatbase.viewer import Viewer
from floatbase.viewer.export import thumbnail
from floatbase.viewer.scene import colours, geometry, protocol, shapes, threejs, unit_shapes
from floatbase.viewer.scene.painter import MIN_FORCE, Painter
from floatbase.viewer.scene.shapes import Item, Picture, path_part, prefixed

IMAGE_HEIGHT = 480  # pixels
# what the arrows are that the page draws, by term of eq. (7)
TERM_ARROWS = {row["name"]: row["arrow"] for row in TERMS if row.get("page_arrow")}


def scene_files(robot: Robot) -> tuple[bytes, bytes, dict[str, Any]]:
    """Return the scene of a standing robot, an image of it, and what a page needs to move it."""
    view = Viewer(robot)
    try:
        standing, contacts = robot.standing(), Contacts.feet(robot, 0.7)
        weight_share = np.tile([0.0, 0.0, robot.weight / contacts.n_points], contacts.n_points)
        view.show(standing, contacts, weight_share, com=True, joint_limits=False)
        image = thumbnail.render_png(view.renderer.picture, view.window.scene, IMAGE_HEIGHT)
        picture = view.painter.picture(
            standing,
            contacts,
            weight_share,
            weight_share,
            com=True,
            cones=False,
            joint_limits=False,
        )
        picture |= _cones(view.painter, contacts)
        outline = geometry.surface_of_revolution(unit_shapes.ARROW)
        push = threejs.mesh(*outline, colours.PUSH, on_top=True)
        picture["push/arrow"] = Item(push, shapes.transform(standing.com, scale=0.1))
        for name, meaning in TERM_ARROWS.items():
            arrow = threejs.mesh(*outline, colours.COM)
            picture[f"term/{name}"] = Item(arrow, shapes.transform(standing.com, scale=0.1))
            words = meaning.split(",")[0]
            picture[f"word/{name}"] = shapes.label(standing.com, words, 0.06 * view.painter.size)
        view.draw(picture)
        # the camera follows the base
        view.camera(follow=True)
        commands = view.window.scene.file_commands()
    finally:
        view.close()
    scene = gzip.compress(protocol.frame(commands), 9, mtime=0)
    return scene, image, _drawing(view.painter, contacts)


def _cones(painter: Painter, contacts: Contacts) -> Picture:
    """Return the friction polyhedra of all points for μ = 1, with all of their facets."""
    picture: Picture = {}
    for facets in FACETS:
        polyhedron = FrictionPolyhedron(np.array(UP), 1.0, facets)
        for name in contacts.point_names:
            cone = shapes.friction_polyhedron(
                np.zeros(3), polyhedron, painter.cone_height(contacts), "inside", range(facets)
            )
            picture |= prefixed(f"cone/{path_part(name)}/{facets}", cone)
    return picture


def _drawing(painter: Painter, contacts: Contacts) -> dict[str, Any]:
    """Return the paths of what moves, and the sizes of arrows and cones."""
    return {
        "links": [[joint, f"robot/{name}"] for joint, name in painter.paths],
        "points": [path_part(name) for name in contacts.point_names],
        "scale": painter.scale,  # m/N
        "size": painter.size,  # m
        "coneHeight": painter.cone_height(contacts),  # m
        "patchRadius": painter.patch_radius,  # m
        "slenderness": shapes.ARROW_SLENDERNESS,
        "arrowLength": shapes.ARROW_LENGTH,  # m
        "leastForce": MIN_FORCE * painter.robot.weight,  # N
        "coneColours": {status: list(shapes.cone_colour(status)) for status in colours.CONE},
        "comRadius": 0.04 * painter.size,  # m
        "joints": list(painter.robot.joint_names),
        "legend": [
            [colours.hex_code(colour), text, colours.LEGEND_SYMBOLS.get(kind, "patch")]
            for kind, colour, text in colours.LEGEND
            if kind in ("measured", "planned", "com", "push", "inside cone", "active cone")
        ],
    }
