"""`Viewer(robot)`: the picture of a state, its contacts, forces and friction cones, in the page."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from floatbase._arrays import Array, checked, positive
from floatbase.control.friction import FrictionPolyhedron
from floatbase.dynamics.contacts import Contacts
from floatbase.errors import InputError
from floatbase.robots.robot import Robot
from floatbase.robots.state import State
from floatbase.viewer import shapes, three, wire
from floatbase.viewer.camera import PRESETS, View, eye_and_target
from floatbase.viewer.canvas import Canvas
from floatbase.viewer.colours import BACKGROUNDS, MEASURED, PLANNED, RGB
from floatbase.viewer.cones import cone_status, polyhedron_status
from floatbase.viewer.meshes import robot_meshes
from floatbase.viewer.shapes import Item, Picture
from floatbase.viewer.window import Window


@dataclass(frozen=True, eq=False)
class Forces:
    """Forces at the points of contacts: shape (n, 3) each, N, world, what the ground does to the robot."""

    measured: Array | None
    planned: Array | None

    @property
    def kinds(self) -> list[tuple[str, Array | None, RGB]]:
        """Name, forces and colour of each kind."""
        return [("measured", self.measured, MEASURED), ("planned", self.planned, PLANNED)]

    @property
    def judged(self) -> Array | None:
        """Those that colour the cones: the measured ones where there are any."""
        return self.planned if self.measured is None else self.measured


class Viewer:
    """A robot in a meshcat window of this process.

    height: of the picture in a notebook, pixels. background: "white", "light" or "dark". scale: metres drawn for a newton,
    shared by forces and cones; by default such that the robot's weight is twice as long as its centre of mass is high.
    facets: draw friction cones as polyhedra with so many facets; None for round cones. inside: see `FrictionPolyhedron`.
    port: of the window; a free one by default. Raises `ViewerError` when the port is taken.

    In a notebook a viewer as the last line of a cell shows itself; elsewhere open `viewer.url` in a browser.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        height: int = 480,
        background: str = "light",
        scale: float | None = None,
        facets: int | None = None,
        inside: bool = True,
        port: int = 0,
    ):
        if not isinstance(robot, Robot):
            raise InputError(f"Viewer needs a Robot, as in fb.Viewer(fb.load('go2')), not {type(robot).__name__}.")
        if background not in BACKGROUNDS:
            raise InputError(f"background is {background!r}; it must be one of {', '.join(BACKGROUNDS)}.")
        self.robot = robot
        self.height = int(positive("height", height, "pixels"))
        self.facets, self.inside = facets, inside
        if facets is not None:
            FrictionPolyhedron(np.array([0.0, 0.0, 1.0]), 1.0, facets)  # says what is wrong with the number
        self._scale = None if scale is None else positive("scale", scale, "m/N")
        self.window = Window(port)
        self.canvas = Canvas(self.window)
        self._placed = False
        self._set_stage(background)

    @property
    def url(self) -> str:
        """Address of the live page, on this machine."""
        return self.window.web_url

    @cached_property
    def size(self) -> float:
        """How large the robot is when it stands, m: the diagonal of the box around its joints, half of it."""
        low, high = self._box
        return 0.5 * float(np.linalg.norm(high - low))

    @cached_property
    def scale(self) -> float:
        """Metres drawn for a newton, for forces and cones alike: 1, 2 or 5 times a power of ten."""
        if self._scale is not None:
            return self._scale
        low, high = self._box
        reach = 2.0 * max(float(self._home.com[2] - low[2]), 0.3 * float(np.linalg.norm(high - low)))
        return nice(reach / self.robot.weight)

    def show(
        self,
        state: State,
        contacts: Contacts | None = None,
        forces: npt.ArrayLike | None = None,
        planned: npt.ArrayLike | None = None,
        *,
        com: bool = True,
        cones: bool = True,
        title: str | None = None,
    ) -> Viewer:
        """Draw this and nothing else; drawing the same again sends nothing.

        forces, planned: shape (3 n,) or (n, 3) for the n points of `contacts`, N, world-aligned, what the ground does to the
        robot: measured, and as a controller plans them. Cones are judged by `forces`, else by `planned`.
        com: draw the centre of mass and its projection on the ground. title: a line of text in the corner.
        Raises `InputError` for a state of another robot, a wrong number of forces, forces without contacts, and NaN;
        `ViewerError` when the window is closed.
        """
        self.canvas.draw(self.picture(state, contacts, forces, planned, com=com, cones=cones))
        self.canvas.set(wire.set_title(title or ""))
        if not self._placed:
            self.camera()
        return self

    def picture(
        self,
        state: State,
        contacts: Contacts | None = None,
        forces: npt.ArrayLike | None = None,
        planned: npt.ArrayLike | None = None,
        *,
        com: bool = True,
        cones: bool = True,
    ) -> Picture:
        """What `show` draws, as a value: path -> item."""
        self._check_state(state)
        both = Forces(_forces("forces", forces, contacts), _forces("planned", planned, contacts))
        picture = self._stage | self._robot(state)
        if contacts is not None and contacts.n_points:
            picture |= self._contacts(state, contacts, both, cones)
            picture |= self._scale_bar
        if com:
            picture |= _below("com", shapes.centre_of_mass(state.com, 0.0, self.size))
        return picture

    def camera(self, view: str | View = "default") -> Viewer:
        """Look from a preset ("default", "front", "back", "left", "right", "top", "feet") or from a `View`."""
        if isinstance(view, str):
            if view not in PRESETS:
                raise InputError(f"camera view is {view!r}; it must be one of {', '.join(PRESETS)}, or a View.")
            view = PRESETS[view]
        low, high = self._box
        self._placed = True
        target, eye = eye_and_target(view, low, high)
        self.canvas.set(wire.set_camera(eye, target, view.angle))
        return self

    def close(self) -> None:
        """Close the window: its thread ends and its port is free."""
        self.window.close()

    def _repr_html_(self) -> str:
        if not self.window.is_open:
            return "<p>This viewer is closed; make a new one to see the robot.</p>"
        return (
            f'<iframe src="{self.url}" title="{self.robot.name}" '
            f'style="width: 100%; height: {self.height}px; border: 0; border-radius: 6px"></iframe>'
        )

    def __repr__(self) -> str:
        return f"Viewer({self.robot.name}, {self.url}{'' if self.window.is_open else ', closed'})"

    # the pieces of a picture

    @cached_property
    def _meshes(self) -> list[tuple[int, str, three.Shape]]:
        """Joint, path and shape of every mesh of the robot."""
        return [
            (
                mesh.joint,
                f"robot/{_plain(self.robot.model.names[mesh.joint])}",
                three.mesh(mesh.vertices, mesh.faces, colours=mesh.colours),
            )
            for mesh in robot_meshes(self.robot)
        ]

    def _robot(self, state: State) -> Picture:
        poses = state.joint_transforms
        return {path: Item(shape, poses[joint]) for joint, path, shape in self._meshes}

    def _contacts(self, state: State, contacts: Contacts, forces: Forces, cones: bool) -> Picture:
        picture: Picture = {}
        rows = zip(contacts.point_names, contacts.positions(state), contacts.normals, contacts.mus, strict=True)
        for i, (name, position, normal, mu) in enumerate(rows):
            at = _plain(name)
            picture[f"patch/{at}"] = shapes.contact_patch(position, normal, self._patch_radius)
            if cones:
                force = None if forces.judged is None else forces.judged[i]
                picture |= _below(f"cone/{at}", self._cone(position, normal, float(mu), force))
            for kind, vectors, colour in forces.kinds:
                if vectors is not None and np.linalg.norm(vectors[i]) > 1e-3 * self.robot.weight:
                    picture[f"{kind}/{at}"] = shapes.arrow(
                        position, self.scale * vectors[i], colour, self.size, halo=kind == "planned"
                    )
        return picture

    def _cone(self, position: Array, normal: Array, mu: float, force: Array | None) -> Picture:
        """A cone or polyhedron in the colour that the force gives it."""
        quiet = force is None or np.linalg.norm(force) < 1e-3 * self.robot.weight
        height = self._cone_height
        if self.facets is None:
            status = "inside" if quiet or force is None else cone_status(force, normal, mu)
            return {"/surface": shapes.friction_cone(position, normal, mu, height, status)}
        polyhedron = FrictionPolyhedron(normal, mu, self.facets, self.inside)
        status, active = ("inside", []) if quiet or force is None else polyhedron_status(force, polyhedron)
        return shapes.friction_polyhedron(position, polyhedron, height, status, active)

    @cached_property
    def _cone_height(self) -> float:
        """m: for half as much again as a foot carries at rest, but not so high as to hide the robot."""
        return min(self.scale * 1.5 * self.robot.weight / max(len(self.robot.feet), 2), 0.55 * self.size)

    @cached_property
    def _patch_radius(self) -> float:
        return max([1.3 * foot.radius for foot in self.robot.feet] + [0.02 * self.size])

    @cached_property
    def _scale_bar(self) -> Picture:
        """A bar for a round force of about a quarter of the weight, on the ground in front of the robot."""
        force = nice(self.robot.weight / 4)
        low, high = self._box
        length = self.scale * force
        at = [high[0] + 0.25 * self.size, 0.5 * (low[1] + high[1]) - length / 2, 0.01 * self.size]
        return _below("scale", shapes.scale_bar(at, force, length, self.size, self._text))

    def _set_stage(self, background: str) -> None:
        """Background and ground; the page's own grid and axes go."""
        top, bottom, grid, self._text = BACKGROUNDS[background]
        self.canvas.set(
            wire.set_property("/Background", "top_color", list(top)),
            wire.set_property("/Background", "bottom_color", list(bottom)),
            wire.set_property("/Grid", "visible", False),
            wire.set_property("/Axes", "visible", False),
        )
        self._stage: Picture = {"ground": shapes.ground(grid)}

    @cached_property
    def _home(self) -> State:
        return self.robot.standing()

    @cached_property
    def _box(self) -> tuple[Array, Array]:
        """Lowest and highest corner of the robot where it stands, m, world."""
        poses = self._home.joint_transforms
        points = [mesh.vertices @ poses[mesh.joint][:3, :3].T + poses[mesh.joint][:3, 3] for mesh in robot_meshes(self.robot)]
        together = np.vstack(points)
        return np.min(together, axis=0), np.max(together, axis=0)

    def _check_state(self, state: Any) -> None:
        if not isinstance(state, State):
            raise InputError(f"show needs a State, as in robot.standing(), not {type(state).__name__}.")
        if state.robot is not self.robot and state.robot.name != self.robot.name:
            raise InputError(
                f"this viewer shows {self.robot.name}, but the state is one of {state.robot.name}; "
                "make a Viewer for that robot."
            )


def nice(value: float) -> float:
    """The number of 1, 2, 5 times a power of ten that is nearest to `value` by ratio."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(min((1.0, 2.0, 5.0, 10.0), key=lambda m: abs(np.log(m * power / value))) * power)


def _forces(name: str, value: npt.ArrayLike | None, contacts: Contacts | None) -> Array | None:
    """Forces as (n, 3), checked against the contacts."""
    if value is None:
        return None
    if contacts is None:
        raise InputError(f"{name} were given without contacts, so it is not known where they act; pass contacts=… too.")
    array = np.asarray(value, dtype=np.float64)
    n = contacts.n_points
    if array.shape not in ((3 * n,), (n, 3)):
        raise InputError(
            f"{name} has shape {array.shape}; {n} contact points ({', '.join(contacts.point_names)}) need shape "
            f"({3 * n},) or ({n}, 3)."
        )
    return checked(name, array.reshape(n, 3), (n, 3), "N")


def _below(path: str, items: Picture) -> Picture:
    return {path + name: item for name, item in items.items()}


def _plain(name: str) -> str:
    """A name as one part of a path."""
    return name.replace("/", "_")
