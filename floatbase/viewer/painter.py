"""What is drawn for a state: a pure function from robot, state, contacts and forces to a picture."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.distance import pdist

from floatbase._arrays import Array, checked
from floatbase.dynamics import Contacts, FlatFootContact
from floatbase.errors import InputError
from floatbase.friction import FrictionCone, FrictionPolyhedron
from floatbase.robots import Robot, State
from floatbase.viewer import lowering, marks, shapes
from floatbase.viewer.colours import GHOST, MEASURED, PLANNED, RGB
from floatbase.viewer.ground import LEVEL, Plane, plane_under
from floatbase.viewer.meshes import JointMesh, robot_meshes
from floatbase.viewer.shapes import Item, Picture

CORNER_RADIUS = 0.48  # of a cone at a corner of a flat foot, over the distance to the next corner


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


@dataclass(frozen=True, eq=False)
class Painter:
    """Draws a robot.

    scale: m drawn for a newton; None for one that fits the robot. facets, inside: of the friction polyhedra; None for round
    cones. ground: None for the one that the contacts stand on. lines, text, paper: colours of the ground's lines, of text and
    of what is behind them.
    """

    robot: Robot
    asked_scale: float | None
    facets: int | None
    inside: bool
    ground: Plane | None
    lines: RGB
    text: RGB
    paper: RGB

    def picture(
        self,
        state: State,
        contacts: Contacts | None = None,
        forces: npt.ArrayLike | None = None,
        planned: npt.ArrayLike | None = None,
        *,
        com: bool = True,
        cones: bool = True,
        support: bool = False,
        wrench: npt.ArrayLike | None = None,
        push: tuple[str, npt.ArrayLike] | None = None,
        ghost: State | None = None,
        frames: Sequence[str] = (),
        labels: bool = False,
        extra: Mapping[str, Item] | None = None,
        lifted: Collection[str] = (),
    ) -> Picture:
        """Everything that was asked for, as path -> item; the arguments are those of `Viewer.show`, and lifted: names of
        contacts that do not stand just now, which have no patch, no cone and no part in the support region."""
        self._check_state(state)
        both = Forces(_forces("forces", forces, contacts), _forces("planned", planned, contacts))
        positions = np.zeros((0, 3)) if contacts is None else contacts.positions(state)
        ground = self._ground(contacts, positions)
        picture = {"ground": ground.lines(self.lines)} | self._robot(state, "robot", self._shapes)
        if contacts is not None and contacts.n_points:
            stands = [contact.name not in lifted for contact in contacts for _ in contact.point_names]
            picture |= self._contacts(contacts, positions, both, cones, stands)
            if support:
                picture |= below("support", marks.support_region(positions[stands], 0.004 * self.size, ground))
            if labels:
                picture |= self._labels(state, contacts, positions)
        if com:
            picture |= below("com", shapes.centre_of_mass(state.com, ground.height(state.com), self.size))
        if wrench is not None:
            picture |= self._wrench(state, wrench)
        if push is not None:
            picture |= self._push(state, *push)
        if ghost is not None:
            self._check_state(ghost)
            picture |= self._robot(ghost, "ghost", self._ghosts)
        for frame in frames:
            pose = state.frame_pose(frame).homogeneous
            picture |= below(f"frame/{plain(frame)}", marks.frame_axes(pose, 0.25 * self.size, frame))
        if any(path.split("/")[0] in ("measured", "planned", "cone", "push", "wrench") for path in picture):
            picture |= self._scale_bar(ground)
        return picture | dict(extra or {})

    def replace(self, facets: int | None) -> Painter:
        """The same with other friction polyhedra; what was computed for the robot is kept."""
        other = replace(self, facets=facets)
        for name in ("home", "box", "feet_box", "size", "scale", "_meshes", "_shapes", "_ghosts", "_scale_bars"):
            if name in self.__dict__:
                other.__dict__[name] = self.__dict__[name]
        return other

    def stage(self) -> Picture:
        """The ground alone."""
        return {"ground": (self.ground or LEVEL).lines(self.lines)}

    @cached_property
    def home(self) -> State:
        """The robot as it stands."""
        return self.robot.standing()

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Lowest and highest corner of the robot where it stands, m, world."""
        poses = self.home.joint_transforms
        points = [mesh.vertices @ poses[mesh.joint][:3, :3].T + poses[mesh.joint][:3, 3] for mesh in self._meshes]
        together = np.vstack(points)
        return np.min(together, axis=0), np.max(together, axis=0)

    @cached_property
    def feet_box(self) -> tuple[Array, Array]:
        """Lowest and highest corner of a box around the feet and what they stand in, m, world; a robot without feet is all
        feet."""
        feet = [(foot, self.home.frame_pose(foot.frame)) for foot in self.robot.feet]
        points = [pose.act(p) for foot, pose in feet for p in ([foot.centre] if foot.corners is None else foot.corners)]
        if not points:
            return self.box
        around = 0.2 * self.size * np.array([1.0, 1.0, 0.0])
        return np.min(points, axis=0) - around, np.max(points, axis=0) + around + [0.0, 0.0, 0.35 * self.size]

    @cached_property
    def size(self) -> float:
        """How large the robot is when it stands, m: half the diagonal of its box."""
        low, high = self.box
        return 0.5 * float(np.linalg.norm(high - low))

    @cached_property
    def scale(self) -> float:
        """Metres drawn for a newton: 1, 2 or 5 times a power of ten, so that the weight is about twice as long as the
        centre of mass is high."""
        if self.asked_scale is not None:
            return self.asked_scale
        return nice(2.0 * max(float(self.home.com[2] - self.box[0][2]), 0.6 * self.size) / self.robot.weight)

    def cone_height(self, contacts: Contacts) -> float:
        """m: for half as much again as each point carries at rest, but not so high as to hide the robot, nor as to make the
        cones of one foot's corners grow into each other by much."""
        height = min(self.scale * 1.5 * self.robot.weight / max(contacts.n_points, 2), 0.55 * self.size)
        feet = (contact for contact in contacts if isinstance(contact, FlatFootContact) and contact.mu > 0)
        return min([height] + [CORNER_RADIUS * float(pdist(foot.corners).min()) / foot.mu for foot in feet])

    @cached_property
    def _meshes(self) -> list[JointMesh]:
        return robot_meshes(self.robot)

    @cached_property
    def _shapes(self) -> list[lowering.Shape]:
        return [lowering.mesh(mesh.vertices, mesh.faces, colours=mesh.colours) for mesh in self._meshes]

    @cached_property
    def _ghosts(self) -> list[lowering.Shape]:
        return [lowering.mesh(mesh.vertices, mesh.faces, GHOST, opacity=0.3, veil=True) for mesh in self._meshes]

    @cached_property
    def _paths(self) -> list[tuple[int, str]]:
        """Joint of every mesh, and its name as a part of a path."""
        return [(mesh.joint, plain(self.robot.model.names[mesh.joint])) for mesh in self._meshes]

    def _robot(self, state: State, root: str, looks: list[lowering.Shape]) -> Picture:
        poses = state.joint_transforms
        return {f"{root}/{name}": Item(look, poses[joint]) for (joint, name), look in zip(self._paths, looks, strict=True)}

    def _contacts(self, contacts: Contacts, positions: Array, forces: Forces, cones: bool, stands: list[bool]) -> Picture:
        """Forces at every point, and patches and cones at those that stand."""
        picture: Picture = {}
        height = self.cone_height(contacts)
        rows = zip(contacts.point_names, positions, contacts.normals, contacts.mus, strict=True)
        for i, (name, position, normal, mu) in enumerate(rows):
            at = plain(name)
            if stands[i]:
                picture[f"patch/{at}"] = shapes.contact_patch(position, normal, self._patch_radius)
            if cones and stands[i]:
                force = None if forces.judged is None else forces.judged[i]
                picture |= below(f"cone/{at}", self._cone(position, normal, float(mu), height, force))
            for kind, vectors, colour in forces.kinds:
                if vectors is not None and not self._is_quiet(vectors[i]):
                    vector = self.scale * vectors[i]
                    picture[f"{kind}/{at}"] = shapes.arrow(position, vector, colour, self.size, halo=kind == "planned")
        return picture

    def _cone(self, position: Array, normal: Array, mu: float, height: float, force: Array | None) -> Picture:
        """A cone or polyhedron in the colour that the force gives it; where there is none, it stands there grey and faint."""
        judged = None if force is None or self._is_quiet(force) else force
        if self.facets is None:
            status = "idle" if judged is None else _friction_cone(tuple(normal.tolist()), mu).status(judged)
            return {"/surface": shapes.friction_cone(position, normal, mu, height, status)}
        polyhedron = _polyhedron(tuple(normal.tolist()), mu, self.facets, self.inside)
        status = "idle" if judged is None else polyhedron.status(judged)
        status = "inside" if status == "active" else status  # the facets that are reached light up instead
        active = () if judged is None else polyhedron.active_facets(judged)
        return shapes.friction_polyhedron(position, polyhedron, height, status, active)

    def _is_quiet(self, force: Array) -> bool:
        """Whether a force is too small to be seen or judged: below a thousandth of the weight."""
        return float(force @ force) < self._quiet

    @cached_property
    def _quiet(self) -> float:
        return (1e-3 * self.robot.weight) ** 2

    def _labels(self, state: State, contacts: Contacts, positions: Array) -> Picture:
        """The name of every point, below and outside of it."""
        picture: Picture = {}
        for name, position in zip(contacts.point_names, positions, strict=True):
            away = (position - state.com) * [1.0, 1.0, 0.0]
            at = position + 0.12 * self.size * away / max(float(np.linalg.norm(away)), 1e-6)
            picture[f"label/{plain(name)}"] = shapes.label(at, name, 0.06 * self.size)
        return picture

    def _wrench(self, state: State, value: npt.ArrayLike) -> Picture:
        six = checked("wrench", value, (6,), "N and N·m")
        drawn = marks.wrench(state.com, self.scale * six[:3], self.scale / self.size * six[3:], self.size)
        return below("wrench", drawn)

    def _push(self, state: State, frame: str, value: npt.ArrayLike) -> Picture:
        force = checked("force of the push", value, (3,), "N")
        if self._is_quiet(force):
            return {}
        at = state.frame_pose(frame).translation
        return {"push": marks.push(at, self.scale * force, self.size, self.text, self.paper)}

    @cached_property
    def _patch_radius(self) -> float:
        return max([1.3 * foot.radius for foot in self.robot.feet] + [0.02 * self.size])

    def _scale_bar(self, ground: Plane) -> Picture:
        if ground not in self._scale_bars:
            self._scale_bars[ground] = self._scale_bar_on(ground)
        return self._scale_bars[ground]

    @cached_property
    def _scale_bars(self) -> dict[Plane, Picture]:
        return {}

    def _scale_bar_on(self, ground: Plane) -> Picture:
        """A bar for a round force of about a quarter of the weight, on the ground to the left of the feet, and behind a tall
        robot, whose picture shows less of the ground in front."""
        force = nice(self.robot.weight / 4)
        low, high = self.box
        length = self.scale * force
        start = min(low[0], 0.5 * (low[0] + high[0] - length) - 0.5 * self.size)
        at = np.array([start, self.feet_box[1][1] + 0.12 * self.size, 0.0])
        at[2] = ground.height(at + [0.5 * length, 0.0, 0.0]) + 0.01 * self.size
        return below("scale", shapes.scale_bar(at, force, length, self.size, self.text))

    def _ground(self, contacts: Contacts | None, positions: Array) -> Plane:
        if self.ground is not None or contacts is None:
            return self.ground or LEVEL
        return plane_under(contacts.normals, positions)

    def _check_state(self, state: Any) -> None:
        if not isinstance(state, State):
            raise InputError(f"show needs a State, as in robot.standing(), not {type(state).__name__}.")
        if state.robot is not self.robot and state.robot.name != self.robot.name:
            raise InputError(
                f"this viewer shows {self.robot.name}, but the state is one of {state.robot.name}; "
                "make a Viewer for that robot."
            )


def kinds(picture: Picture) -> set[str]:
    """What a picture shows, in the words of `LEGEND`: the first part of every path; a cone without force is an "idle cone"."""
    idle = shapes.cone_colour("idle")
    return {"idle cone" if item.colour == idle else path.split("/")[0] for path, item in picture.items()}


@lru_cache(maxsize=256)
def _friction_cone(normal: tuple[float, ...], mu: float) -> FrictionCone:
    """A cone, once: a ground has few."""
    return FrictionCone(np.array(normal), mu)


@lru_cache(maxsize=256)
def _polyhedron(normal: tuple[float, ...], mu: float, facets: int, inside: bool) -> FrictionPolyhedron:
    """A polyhedron, once: a ground has few."""
    return FrictionPolyhedron(np.array(normal), mu, facets, inside)


def nice(value: float) -> float:
    """The number of 1, 2, 5 times a power of ten that is nearest to `value` by ratio."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(min((1.0, 2.0, 5.0, 10.0), key=lambda m: abs(np.log(m * power / value))) * power)


def below(path: str, items: Mapping[str, Item]) -> Picture:
    """Items under a common path."""
    return {path + name: item for name, item in items.items()}


def plain(name: str) -> str:
    """A name as one part of a path."""
    return name.replace("/", "_")


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
