"""The painter: makes a picture of a robot from its state, contacts and forces. It has no effect on
any page.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Unpack

import numpy as np
import numpy.typing as npt
from scipy.spatial.distance import pdist

from floatbase._validation import (
    Array,
    as_array,
    as_instance,
    cached_property,
    numeric_copy,
    short_repr,
)
from floatbase.dynamics import Contacts, FlatFootContact
from floatbase.errors import InputError
from floatbase.friction import FrictionCone, FrictionPolyhedron
from floatbase.robots import Robot, State
from floatbase.viewer.scene import markers, shapes, threejs
from floatbase.viewer.scene.colours import GHOST, MEASURED, PLANNED, RGB
from floatbase.viewer.scene.ground import LEVEL, Plane, Planes, plane_under
from floatbase.viewer.scene.meshes import JointMesh, robot_meshes
from floatbase.viewer.scene.options import PictureKeywords, PictureOptions
from floatbase.viewer.scene.shapes import Item, Picture

# radius of a cone at a corner of a flat foot, over the distance to the next corner: they do not
# meet
CORNER_RADIUS = 0.48
MIN_FORCE = 1e-3  # of the robot's weight: a smaller force is neither drawn nor judged


@dataclass(frozen=True, eq=False)
class Forces:
    """Forces of the ground on the robot at n contact points, measured and planned: shape (n, 3)
    each, N, world, or None.
    """

    measured: Array | None
    planned: Array | None

    @property
    def kinds(self) -> list[tuple[str, Array | None, RGB]]:
        """Name, forces and colour of the measured and of the planned forces."""
        return [("measured", self.measured, MEASURED), ("planned", self.planned, PLANNED)]

    @property
    def cone_forces(self) -> Array | None:
        """The forces that colour the cones: the measured ones if there are any."""
        return self.planned if self.measured is None else self.measured


@dataclass(frozen=True, eq=False)
class Painter:
    """Draws a robot.

    robot: the robot.
    requested_scale: length of a drawn force, m/N; None for one that fits the robot.
    facets: number of facets of the friction polyhedra; None draws round cones.
    inner_approximation, facet_rotation: as for `FrictionPolyhedron`.
    ground: the ground; None for the plane that the contacts stand on.
    line_colour, text_colour, background_colour: of the ground's lines, of text, and of the
        background.
    """

    robot: Robot
    requested_scale: float | None
    facets: int | None
    inner_approximation: bool
    facet_rotation: float
    ground: Plane | Planes | None
    line_colour: RGB
    text_colour: RGB
    background_colour: RGB

    def picture(
        self,
        state: State,
        contacts: Contacts | None = None,
        forces: npt.ArrayLike | None = None,
        planned: npt.ArrayLike | None = None,
        **options: Unpack[PictureKeywords],
    ) -> Picture:
        """The picture, path -> item, of everything that the arguments ask for.

        state, contacts, forces, planned: as for `Viewer.show`. options: see `PictureOptions`.
        """
        chosen = PictureOptions(**options)
        self._check_state(state)
        if contacts is not None:
            as_instance("contacts", contacts, Contacts)
        both = Forces(_forces("forces", forces, contacts), _forces("planned", planned, contacts))
        positions = np.zeros((0, 3)) if contacts is None else contacts.positions(state)
        ground = self._ground(contacts, positions)
        picture = {"ground": ground.lines(self.line_colour, state.com)} | self._robot(
            state, "robot", self._shapes
        )
        if contacts is not None and contacts.n_points:
            stands = [
                contact.name not in chosen.swing_feet
                for contact in contacts.friction_contacts
                for _ in contact.point_names
            ]
            picture |= self._contacts(
                contacts, positions, both, chosen.cones, stands, chosen.arrows
            )
            if chosen.support:
                picture |= prefixed(
                    "support", markers.support_region(positions[stands], 0.004 * self.size, ground)
                )
            if chosen.labels:
                picture |= self._labels(state, contacts, positions)
        if chosen.com:
            picture |= prefixed(
                "com", shapes.centre_of_mass(state.com, ground.height(state.com), self.size)
            )
        if chosen.wrench is not None:
            picture |= self._wrench(state, np.asarray(chosen.wrench, dtype=np.float64))
        if chosen.push is not None:
            frame, force = chosen.push
            picture |= self._push(state, frame, np.asarray(force, dtype=np.float64))
        if chosen.ghost is not None:
            self._check_state(chosen.ghost)
            picture |= self._robot(chosen.ghost, "ghost", self._ghost_shapes)
        for name in chosen.frames:
            pose = state.frame_pose(name).homogeneous
            picture |= prefixed(
                f"frame/{path_part(name)}", markers.frame_axes(pose, 0.25 * self.size, name)
            )
        if any(
            path.split("/")[0] in ("measured", "planned", "cone", "push", "wrench")
            for path in picture
        ):
            picture |= self._scale_bar(ground)
        return picture | dict(chosen.extra or {})

    def replace(self, **changes: Any) -> Painter:
        """A painter with other facets or another ground. It shares what this one has computed for
        the robot.
        """
        other = replace(self, **changes)
        computed = {"standing", "box", "feet_box", "size", "scale", "_meshes", "_shapes"}
        computed |= {"_ghost_shapes", "_scale_bars"}
        other.__dict__.update({name: self.__dict__[name] for name in computed & set(self.__dict__)})
        return other

    def ground_only(self) -> Picture:
        """A picture of the ground alone."""
        return {"ground": self.drawn_ground.lines(self.line_colour)}

    @property
    def drawn_ground(self) -> Plane | Planes:
        """The ground that was given, or level ground."""
        return self.ground or LEVEL

    @cached_property
    def standing(self) -> State:
        """The robot's standing state."""
        return self.robot.standing()

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Lowest and highest corner of the standing robot's bounding box, m, world."""
        poses = self.standing.joint_transforms
        points = [
            mesh.vertices @ poses[mesh.joint][:3, :3].T + poses[mesh.joint][:3, 3]
            for mesh in self._meshes
        ]
        together = np.vstack(points)
        return np.min(together, axis=0), np.max(together, axis=0)

    @cached_property
    def feet_box(self) -> tuple[Array, Array]:
        """Lowest and highest corner of a box around the standing robot's feet and their cones, m,
        world.

        A robot without feet has the box of the whole robot.
        """
        feet = [(foot, self.standing.frame_pose(foot.frame)) for foot in self.robot.feet]
        points = [
            pose.act(p)
            for foot, pose in feet
            for p in ([foot.centre] if foot.corners is None else foot.corners)
        ]
        if not points:
            return self.box
        around = 0.2 * self.size * np.array([1.0, 1.0, 0.0])
        return np.min(points, axis=0) - around, np.max(points, axis=0) + around + [
            0.0,
            0.0,
            0.35 * self.size,
        ]

    @cached_property
    def size(self) -> float:
        """Size of the standing robot, m: half the diagonal of its bounding box."""
        low, high = self.box
        return 0.5 * float(np.linalg.norm(high - low))

    @cached_property
    def scale(self) -> float:
        """Length of a drawn force, m/N: as requested, else 1, 2 or 5 times a power of ten that
        makes the weight about twice as long as the centre of mass is high.
        """
        if self.requested_scale is not None:
            return self.requested_scale
        return round_1_2_5(
            2.0
            * max(float(self.standing.com[2] - self.box[0][2]), 0.6 * self.size)
            / self.robot.weight
        )

    def cone_height(self, contacts: Contacts) -> float:
        """Height of the friction cones, m: that of 1.5 times the normal force at rest, but not so
        high that the cones hide the robot, or that cones at the corners of one foot meet.
        """
        height = min(
            self.scale * 1.5 * self.robot.weight / max(contacts.n_points, 2), 0.55 * self.size
        )
        feet = (
            contact
            for contact in contacts
            if isinstance(contact, FlatFootContact) and contact.mu > 0
        )
        return min(
            [height] + [CORNER_RADIUS * float(pdist(foot.corners).min()) / foot.mu for foot in feet]
        )

    @cached_property
    def _meshes(self) -> list[JointMesh]:
        return robot_meshes(self.robot)

    @cached_property
    def _shapes(self) -> list[threejs.Shape]:
        return [
            threejs.mesh(mesh.vertices, mesh.faces, colours=mesh.colours) for mesh in self._meshes
        ]

    @cached_property
    def _ghost_shapes(self) -> list[threejs.Shape]:
        return [
            threejs.mesh(mesh.vertices, mesh.faces, GHOST, opacity=0.3, hide_back=True)
            for mesh in self._meshes
        ]

    @cached_property
    def _paths(self) -> list[tuple[int, str]]:
        """For every mesh, the number of its joint, and the joint's name as part of a path."""
        return [
            (mesh.joint, path_part(self.robot.model.names[mesh.joint])) for mesh in self._meshes
        ]

    def _robot(self, state: State, root: str, shapes_of_joints: list[threejs.Shape]) -> Picture:
        poses = state.joint_transforms
        return {
            f"{root}/{name}": Item(shape, poses[joint])
            for (joint, name), shape in zip(self._paths, shapes_of_joints, strict=True)
        }

    def _contacts(
        self,
        contacts: Contacts,
        positions: Array,
        forces: Forces,
        cones: bool,
        stands: list[bool],
        arrows: bool,
    ) -> Picture:
        """Forces at every point, and patches and cones at the points that stand on the ground."""
        picture: Picture = {}
        height = self.cone_height(contacts)
        rows = zip(contacts.point_names, positions, contacts.normals, contacts.mus, strict=True)
        for i, (name, position, normal, mu) in enumerate(rows):
            at = path_part(name)
            if stands[i]:
                picture[f"patch/{at}"] = shapes.contact_patch(position, normal, self._patch_radius)
            if cones and stands[i]:
                force = None if forces.cone_forces is None else forces.cone_forces[i]
                picture |= prefixed(
                    f"cone/{at}", self._cone(position, normal, float(mu), height, force)
                )
            for kind, vectors, colour in forces.kinds if arrows else ():
                if vectors is not None and not self._is_negligible(vectors[i]):
                    vector = self.scale * vectors[i]
                    picture[f"{kind}/{at}"] = shapes.arrow(
                        position, vector, colour, self.size, halo=kind == "planned"
                    )
        return picture

    def _cone(
        self, position: Array, normal: Array, mu: float, height: float, force: Array | None
    ) -> Picture:
        """A cone or polyhedron in the colour that the force gives it; without a force it is grey
        and faint.
        """
        judged_force = None if force is None or self._is_negligible(force) else force
        if self.facets is None:
            status = (
                "idle"
                if judged_force is None
                else _friction_cone(tuple(normal.tolist()), mu).status(judged_force)
            )
            made = {"/surface": shapes.friction_cone(position, normal, mu, height, status)}
            return made | self._outside_rim(
                position, _polyhedron(tuple(normal.tolist()), mu, 4, True, 0.0), height, status
            )
        polyhedron = _polyhedron(
            tuple(normal.tolist()), mu, self.facets, self.inner_approximation, self.facet_rotation
        )
        status = "idle" if judged_force is None else polyhedron.status(judged_force)
        status = (
            "inside" if status == "active" else status
        )  # an active facet has a colour of its own
        active = () if judged_force is None else polyhedron.active_facets(judged_force)
        made = shapes.friction_polyhedron(position, polyhedron, height, status, active)
        return made | self._outside_rim(position, polyhedron, height, status)

    def _outside_rim(
        self, position: Array, polyhedron: FrictionPolyhedron, height: float, status: str
    ) -> Picture:
        """What tells a force outside its cone from others by more than a hue."""
        if status != "outside":
            return {}
        return {"/rim": shapes.cone_rim(position, polyhedron, height, is_round=self.facets is None)}

    def _is_negligible(self, force: Array) -> bool:
        """Whether a force is too small to be drawn or judged."""
        return float(force @ force) < self._negligible_force

    @cached_property
    def _negligible_force(self) -> float:
        return (MIN_FORCE * self.robot.weight) ** 2

    def _labels(self, state: State, contacts: Contacts, positions: Array) -> Picture:
        """The name of every contact, beside it and away from the robot; of a flat foot also the
        numbers of its corners.
        """
        picture: Picture = {}
        for contact in contacts.friction_contacts:
            rows = [list(contacts.point_names).index(name) for name in contact.point_names]
            middle = positions[rows].mean(axis=0)
            away = (middle - state.com) * [1.0, 1.0, 0.0]
            towards = away / max(float(np.linalg.norm(away)), 1e-6)
            beyond = 0.12 * self.size + float(
                np.linalg.norm(positions[rows] - middle, axis=1).max()
            )
            picture[f"label/{path_part(contact.name)}"] = shapes.label(
                middle + beyond * towards, contact.name, 0.06 * self.size
            )
            for i, row in enumerate(rows if len(rows) > 1 else ()):
                at = positions[row] + 0.25 * (positions[row] - middle)
                picture[f"label/{path_part(contacts.point_names[row])}"] = shapes.label(
                    at, str(i), 0.035 * self.size
                )
        return picture

    def _wrench(self, state: State, six: Array) -> Picture:
        drawn = markers.wrench(
            state.com, self.scale * six[:3], self.scale / self.size * six[3:], self.size
        )
        return prefixed("wrench", drawn)

    def _push(self, state: State, frame: str, force: Array) -> Picture:
        if self._is_negligible(force):
            return {}
        at = state.frame_pose(frame).translation
        return {
            "push": markers.push(
                at, self.scale * force, self.size, self.text_colour, self.background_colour
            )
        }

    @cached_property
    def _patch_radius(self) -> float:
        return max([1.3 * foot.radius for foot in self.robot.feet] + [0.02 * self.size])

    def _scale_bar(self, ground: Plane | Planes) -> Picture:
        if ground not in self._scale_bars:
            self._scale_bars[ground] = self._scale_bar_on(ground)
        return self._scale_bars[ground]

    @cached_property
    def _scale_bars(self) -> dict[Plane | Planes, Picture]:
        return {}

    def _scale_bar_on(self, ground: Plane | Planes) -> Picture:
        """A bar as long as a force of about a quarter of the weight is drawn, on the ground at the
        left of the feet.

        It starts behind a tall robot, because the picture of one shows little ground in front.
        """
        force = round_1_2_5(self.robot.weight / 4)
        low, high = self.box
        length = self.scale * force
        start = min(low[0], 0.5 * (low[0] + high[0] - length) - 0.5 * self.size)
        at = np.array([start, self.feet_box[1][1] + 0.12 * self.size, 0.0])
        at[2] = ground.height(at + [0.5 * length, 0.0, 0.0]) + 0.01 * self.size
        return prefixed("scale", shapes.scale_bar(at, force, length, self.size, self.text_colour))

    def _ground(self, contacts: Contacts | None, positions: Array) -> Plane | Planes:
        if self.ground is not None or contacts is None:
            return self.drawn_ground
        return plane_under(contacts.normals, positions)

    def _check_state(self, state: Any) -> None:
        self.check_robot("state", as_instance("state", state, State).robot)

    def check_robot(self, what: str, robot: Robot) -> None:
        """Raise `InputError` where `what` belongs to a robot of another name or, as with joints
        locked, with other joints.
        """
        identities = [(one.name, one.is_floating, one.joint_names) for one in (self.robot, robot)]
        if identities[0] != identities[1]:
            raise InputError(
                f"this viewer shows {self.robot}, but the {what} is one of {robot}; make a Viewer "
                f"for that robot."
            )


def legend_kinds(picture: Picture) -> set[str]:
    """What a picture shows, in the words of `LEGEND`: the first part of each path; a cone without a
    force is an "idle cone".
    """
    idle = shapes.cone_colour("idle")
    return {
        "idle cone" if item.colour == idle else path.strip("/").split("/")[0]
        for path, item in picture.items()
    }


@lru_cache(maxsize=256)
def _friction_cone(normal: tuple[float, ...], mu: float) -> FrictionCone:
    """A cone, once: a ground has few."""
    return FrictionCone(np.array(normal), mu)


@lru_cache(maxsize=256)
def _polyhedron(
    normal: tuple[float, ...],
    mu: float,
    facets: int,
    inner_approximation: bool,
    facet_rotation: float,
) -> FrictionPolyhedron:
    """The polyhedron with these values. There are few different ones, so each is made once."""
    return FrictionPolyhedron(np.array(normal), mu, facets, inner_approximation, facet_rotation)


def round_1_2_5(value: float) -> float:
    """1, 2 or 5 times a power of ten, whichever has the ratio to `value` nearest to 1."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(min((1.0, 2.0, 5.0, 10.0), key=lambda m: abs(np.log(m * power / value))) * power)


def prefixed(path: str, items: Mapping[str, Item]) -> Picture:
    """The same items, each path prefixed by `path`."""
    return {path + name: item for name, item in items.items()}


def path_part(name: str) -> str:
    """The name as one part of a path: without slashes."""
    return name.replace("/", "_")


def _forces(name: str, value: npt.ArrayLike | None, contacts: Contacts | None) -> Array | None:
    """Forces as an array of shape (n, 3) for the n contact points. Raises `InputError` for any
    other number of forces.
    """
    if value is None:
        return None
    if contacts is None:
        raise InputError(
            f"{name} were given without contacts, so it is not known where they act; pass "
            f"contacts=… too."
        )
    array = numeric_copy(value)
    n = contacts.n_points
    if array is None:
        raise InputError(
            f"{name} must be numbers of shape ({3 * n},) or ({n}, 3) (N), not {short_repr(value)}."
        )
    if array.shape not in ((3 * n,), (n, 3)):
        raise InputError(
            f"{name} has shape {array.shape}; {n} contact points "
            f"({', '.join(contacts.point_names)}) need shape "
            f"({3 * n},) or ({n}, 3)."
        )
    return as_array(name, array.reshape(n, 3), (n, 3), "N")
