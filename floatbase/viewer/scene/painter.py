"""Painter: makes a picture of a robot from its state, contacts and forces."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Unpack

import numpy as np
import numpy.typing as npt
from scipy.spatial.distance import pdist

from floatbase._validation import Array, as_instance, cached_property
from floatbase.control import JointLimits
from floatbase.dynamics import Contacts, FlatFootContact
from floatbase.dynamics._compiled import connected_frames
from floatbase.errors import InputError, unknown_name
from floatbase.robots import Robot, State
from floatbase.viewer.scene import geometry, markers, shapes, threejs
from floatbase.viewer.scene.colours import GHOST, RGB
from floatbase.viewer.scene.cone_picture import ConeShape, cone_picture
from floatbase.viewer.scene.contact_forces import Forces, as_forces
from floatbase.viewer.scene.ground import LEVEL, DrawnGround, blocks, plane_under
from floatbase.viewer.scene.limit_rings import limit_rings
from floatbase.viewer.scene.meshes import JointMesh, robot_meshes
from floatbase.viewer.scene.options import PictureKeywords, PictureOptions
from floatbase.viewer.scene.shapes import Item, Picture, path_part, prefixed

# radius of a cone at a corner of a flat foot, as a fraction of the distance to the next corner: the
# cones do not meet
CORNER_RADIUS = 0.48
MIN_FORCE = 1e-3  # fraction of the robot's weight: a smaller force is neither drawn nor judged


@dataclass(frozen=True, eq=False)
class Painter:
    """Makes pictures of a robot, without drawing them on a page."""

    robot: Robot
    requested_scale: float | None
    facets: int | None
    inner_approximation: bool
    facet_rotation: float
    ground: DrawnGround | None
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
        """Make the picture of a state."""
        for name in sorted(options.keys() - PictureOptions.__dataclass_fields__.keys()):
            raise unknown_name("option of a picture", name, PictureOptions.__dataclass_fields__)
        chosen = PictureOptions(**options)
        self._check_state(state)
        if contacts is not None:
            as_instance("contacts", contacts, Contacts)
        given = Forces(
            as_forces("forces", forces, contacts), as_forces("planned", planned, contacts)
        )
        positions = np.zeros((0, 3)) if contacts is None else contacts.positions(state)
        moved = np.asarray(chosen.ground_position, dtype=np.float64)
        com = state.com - moved  # on the ground, which may itself move
        ground = self._ground(contacts, positions - moved)
        on_ground = {"ground": ground.lines(self.line_colour, com)}
        on_ground |= blocks(ground, self.line_colour)
        picture = self._robot(state, "robot", self._shapes) if chosen.robot else {}
        if contacts is not None and chosen.arrows:
            picture |= self._connections(state, contacts, given)
        if contacts is not None and contacts.n_points:
            stands = [
                contact.name not in chosen.swing_feet
                for contact in contacts.friction_contacts
                for _ in contact.point_names
            ]
            picture |= self._contacts(
                contacts, positions, given.at_points(contacts), stands, chosen
            )
            if chosen.support:
                at = positions[stands] - moved
                region = markers.support_region(at, 0.004 * self.size, ground)
                on_ground |= prefixed("support", region)
            if chosen.labels:
                picture |= self._labels(state, contacts, positions)
        if chosen.com:
            drawn = shapes.centre_of_mass(com, ground.height(com), self.size)
            on_ground |= prefixed("com", drawn)
        if chosen.joint_limits:
            picture |= self._limit_rings(state, chosen)
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
            axes = markers.frame_axes(pose, 0.25 * self.size, name)
            picture |= prefixed(f"frame/{path_part(name)}", axes)
        kinds = {path.split("/")[0] for path in picture}
        if kinds & {"measured", "planned", "cone", "push", "wrench"}:
            on_ground |= self._scale_bar(ground)
        if moved.any():
            shift = shapes.transform(moved)
            on_ground = {p: Item(s, shift @ matrix, c) for p, (s, matrix, c) in on_ground.items()}
        return on_ground | picture | dict(chosen.extra or {})

    def replace(self, **changes: Any) -> Painter:
        """Return a painter with other facets or another ground."""
        other = replace(self, **changes)
        computed = {"standing", "box", "feet_box", "size", "scale", "_meshes", "_shapes"}
        computed |= {"_ghost_shapes", "_scale_bars", "_joint_limits"}
        kept = {name: value for name, value in self.__dict__.items() if name in computed}
        other.__dict__.update(kept)
        return other

    def ground_only(self) -> Picture:
        """Make a picture of the ground alone."""
        ground = self.drawn_ground
        return {"ground": ground.lines(self.line_colour)} | blocks(ground, self.line_colour)

    @property
    def drawn_ground(self) -> DrawnGround:
        """Given ground, or level ground if none was given."""
        return self.ground or LEVEL

    @cached_property
    def standing(self) -> State:
        """Standing state of the robot."""
        return self.robot.standing()

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Lowest and highest corner of the standing robot's bounding box, world frame [m]."""
        poses = self.standing.joint_transforms
        points = [
            mesh.vertices @ poses[mesh.joint][:3, :3].T + poses[mesh.joint][:3, 3]
            for mesh in self._meshes
        ]
        together = np.vstack(points)
        return np.min(together, axis=0), np.max(together, axis=0)

    @cached_property
    def feet_box(self) -> tuple[Array, Array]:
        """Lowest and highest corner of a box around the standing robot's feet, world frame [m]."""
        feet = [(foot, self.standing.frame_pose(foot.frame)) for foot in self.robot.feet]
        points = [pose.act(p) for foot, pose in feet for p in foot.points]
        if not points:
            return self.box
        around = 0.2 * self.size * np.array([1.0, 1.0, 0.0])
        above = np.array([0.0, 0.0, 0.35 * self.size])
        return np.min(points, axis=0) - around, np.max(points, axis=0) + around + above

    @cached_property
    def size(self) -> float:
        """Size of the standing robot: half the diagonal of its bounding box [m]."""
        low, high = self.box
        return 0.5 * float(np.linalg.norm(high - low))

    @cached_property
    def scale(self) -> float:
        """Length of a drawn force [m/N]."""
        if self.requested_scale is not None:
            return self.requested_scale
        height = max(float(self.standing.com[2] - self.box[0][2]), 0.6 * self.size)
        return geometry.round_1_2_5(2.0 * height / self.robot.weight)

    def cone_height(self, contacts: Contacts) -> float:
        """Return the height of the friction cones."""
        height = self.scale * 1.5 * self.robot.weight / max(contacts.n_points, 2)
        heights = [height, 0.55 * self.size]
        for contact in contacts:
            if isinstance(contact, FlatFootContact) and contact.mu > 0:
                radius = CORNER_RADIUS * float(pdist(contact.corners).min())
                heights.append(radius / contact.mu)
        return min(heights)

    @cached_property
    def _meshes(self) -> list[JointMesh]:
        """Meshes of the robot."""
        return robot_meshes(self.robot)

    @cached_property
    def _shapes(self) -> list[threejs.Shape]:
        """Shape of each mesh."""
        return [
            threejs.mesh(mesh.vertices, mesh.faces, colours=mesh.colours) for mesh in self._meshes
        ]

    @cached_property
    def _ghost_shapes(self) -> list[threejs.Shape]:
        """Translucent shape of each mesh."""
        return [
            threejs.mesh(mesh.vertices, mesh.faces, GHOST, opacity=0.3, hide_back=True)
            for mesh in self._meshes
        ]

    @cached_property
    def paths(self) -> list[tuple[int, str]]:
        """Joint index and joint name, as part of a path, of each mesh."""
        return [
            (mesh.joint, path_part(self.robot.model.names[mesh.joint])) for mesh in self._meshes
        ]

    def _robot(self, state: State, root: str, shapes_of_joints: list[threejs.Shape]) -> Picture:
        """Draw the robot below the path `root`."""
        poses = state.joint_transforms
        return {
            f"{root}/{name}": Item(shape, poses[joint])
            for (joint, name), shape in zip(self.paths, shapes_of_joints, strict=True)
        }

    def _contacts(
        self,
        contacts: Contacts,
        positions: Array,
        forces: Forces,
        stands: list[bool],
        chosen: PictureOptions,
    ) -> Picture:
        """Draw forces at all points, and patches and cones at those on the ground."""
        picture: Picture = {}
        height = self.cone_height(contacts)
        shape = ConeShape(self.facets, self.inner_approximation, self.facet_rotation)
        rows = zip(contacts.point_names, positions, contacts.normals, contacts.mus, strict=True)
        for i, (name, position, normal, mu) in enumerate(rows):
            at = path_part(name)
            if stands[i]:
                picture[f"patch/{at}"] = shapes.contact_patch(position, normal, self.patch_radius)
            if chosen.cones and stands[i]:
                force = None if forces.cone_forces is None else forces.cone_forces[i]
                if force is not None and self._is_negligible(force):
                    force = None
                cone = cone_picture(shape, position, normal, float(mu), height, force)
                picture |= prefixed(f"cone/{at}", cone)
            for kind, vectors, colour in forces.kinds if chosen.arrows else ():
                if vectors is not None and not self._is_negligible(vectors[i]):
                    vector, halo = self.scale * vectors[i], kind == "planned"
                    arrow = shapes.arrow(position, vector, colour, self.size, halo)
                    picture[f"{kind}/{at}"] = arrow
        return picture

    def _connections(self, state: State, contacts: Contacts, given: Forces) -> Picture:
        """Draw the forces of fixed frames and rigid connections at their first frames."""
        picture: Picture = {}
        for contact in contacts:
            for kind, values, colour in given.kinds if connected_frames(contact) else ():
                if values is None or values.shape != (contacts.k,):
                    continue
                force = values[contacts.force_slice(contact.name)][:3]
                if not self._is_negligible(force):
                    start, halo = state.point(connected_frames(contact)[0]), kind == "planned"
                    arrow = shapes.arrow(start, self.scale * force, colour, self.size, halo)
                    picture[f"{kind}/{path_part(contact.name)}"] = arrow
        return picture

    def _is_negligible(self, force: Array) -> bool:
        """Return whether a force is too small to be drawn or judged."""
        return float(force @ force) < self._negligible_force

    @cached_property
    def _negligible_force(self) -> float:
        """Square of the largest negligible force [N²]."""
        return (MIN_FORCE * self.robot.weight) ** 2

    def _labels(self, state: State, contacts: Contacts, positions: Array) -> Picture:
        """Draw the name of each contact, on the side away from the robot."""
        picture: Picture = {}
        for contact in contacts.friction_contacts:
            rows = [list(contacts.point_names).index(name) for name in contact.point_names]
            middle = positions[rows].mean(axis=0)
            away = (middle - state.com) * [1.0, 1.0, 0.0]
            towards = away / max(float(np.linalg.norm(away)), 1e-6)
            radius = float(np.linalg.norm(positions[rows] - middle, axis=1).max())
            at = middle + (0.12 * self.size + radius) * towards
            name = path_part(contact.name)
            picture[f"label/{name}"] = shapes.label(at, contact.name, 0.06 * self.size)
            for i, row in enumerate(rows if len(rows) > 1 else ()):
                at = positions[row] + 0.25 * (positions[row] - middle)
                name = path_part(contacts.point_names[row])
                picture[f"label/{name}"] = shapes.label(at, str(i), 0.035 * self.size)
        return picture

    def _wrench(self, state: State, six: Array) -> Picture:
        """Draw a wrench at the centre of mass."""
        force, moment = self.scale * six[:3], self.scale / self.size * six[3:]
        return prefixed("wrench", markers.wrench(state.com, force, moment, self.size))

    def _push(self, state: State, frame: str, force: Array) -> Picture:
        """Draw a push at a frame, unless it is negligible."""
        if self._is_negligible(force):
            return {}
        at = state.frame_pose(frame).translation
        colours = self.text_colour, self.background_colour
        return {"push": markers.push(at, self.scale * force, self.size, *colours)}

    def _limit_rings(self, state: State, chosen: PictureOptions) -> Picture:
        """Draw rings at joints near their limits, and at joints whose limits are active."""
        limits = chosen.joint_limits
        if not isinstance(limits, JointLimits):
            limits = self._joint_limits
        return limit_rings(state, limits, chosen.qdd, self.size)

    @cached_property
    def _joint_limits(self) -> JointLimits:
        """Limits in the robot's URDF."""
        return JointLimits.of(self.robot)

    @cached_property
    def patch_radius(self) -> float:
        """Radius of the contact patches [m]."""
        balls = [foot.radius for foot in self.robot.feet if foot.axis is None]
        return max([1.3 * radius for radius in balls] + [0.02 * self.size])

    def _scale_bar(self, ground: DrawnGround) -> Picture:
        """Draw the scale bar; it is computed once for each ground."""
        if ground not in self._scale_bars:
            self._scale_bars[ground] = self._scale_bar_on(ground)
        return self._scale_bars[ground]

    @cached_property
    def _scale_bars(self) -> dict[DrawnGround, Picture]:
        """Scale bars by ground."""
        return {}

    def _scale_bar_on(self, ground: DrawnGround) -> Picture:
        """Draw a bar on the ground that shows the length of about a quarter of the weight."""
        force = geometry.round_1_2_5(self.robot.weight / 4)
        low, high = self.box
        length = self.scale * force
        start = min(low[0], 0.5 * (low[0] + high[0] - length) - 0.5 * self.size)
        at = np.array([start, self.feet_box[1][1] + 0.12 * self.size, 0.0])
        at[2] = ground.height(at + [0.5 * length, 0.0, 0.0]) + 0.01 * self.size
        return prefixed("scale", shapes.scale_bar(at, force, length, self.size, self.text_colour))

    def _ground(self, contacts: Contacts | None, positions: Array) -> DrawnGround:
        """Return the ground to draw."""
        if self.ground is not None or contacts is None:
            return self.drawn_ground
        return plane_under(contacts.normals, positions)

    def _check_state(self, state: Any) -> None:
        """Check that a state belongs to this robot."""
        self.check_robot("state", as_instance("state", state, State).robot)

    def check_robot(self, what: str, robot: Robot) -> None:
        """Check that something belongs to this robot."""
        identities = [(one.name, one.is_floating, one.joint_names) for one in (self.robot, robot)]
        if identities[0] != identities[1]:
            raise InputError(
                f"This viewer shows {self.robot}, but the {what} belongs to {robot}. Make a Viewer "
                f"for that robot."
            )
