"""`Viewer(robot)`: draws a robot with its contacts, forces and friction cones in a web page, still
or moving.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Unpack

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    as_array,
    as_bool,
    as_instance,
    as_integer,
    as_positive,
    as_string,
    short_repr,
    unit_vector,
)
from floatbase.behaviours import StepPlan, Walk
from floatbase.dynamics import Contacts
from floatbase.errors import InputError
from floatbase.friction import FrictionPolyhedron
from floatbase.qp import Solution
from floatbase.robots import Robot, State
from floatbase.viewer.camera import FOLLOWED, PRESETS, ROBOT, FollowingCamera, View
from floatbase.viewer.controls import Controls
from floatbase.viewer.export import recording
from floatbase.viewer.output import Output
from floatbase.viewer.scene import gait_overlay, legend, markers, protocol, shapes
from floatbase.viewer.scene.colours import BACKGROUNDS, GHOST_NAME, RGB
from floatbase.viewer.scene.diff import ROOT, DiffRenderer
from floatbase.viewer.scene.ground import MIN_VERTICAL, Plane, Planes
from floatbase.viewer.scene.options import PictureKeywords
from floatbase.viewer.scene.painter import Painter, legend_kinds, prefixed
from floatbase.viewer.scene.shapes import Picture
from floatbase.viewer.transport.window import Window

if TYPE_CHECKING:
    from floatbase.simulation import Ground, Rollout

UP = (0.0, 0.0, 1.0)
_MOST_PIXELS = 10_000  # of a picture's height


class Viewer(Controls, Output):
    """Draws a robot in a web page that this process serves.

    robot: the robot to draw.
    height: height of the picture in a notebook, pixels.
    background: "white" or "light", both of which are dark where the page around the picture is, or
        the browser; or "dark".
    scale: length of a drawn force, m/N, the same for forces and cones; None makes the robot's
        weight about twice as long as its centre of mass is high.
    facets: number of facets of the friction polyhedra that are drawn; None draws round cones.
    inner_approximation, facet_rotation: as for `FrictionPolyhedron`.
    ground: a simulation's `Ground`, or its normal, (3,), world, for a plane through the origin;
        None takes the plane that the contacts stand on when they share a normal, else a level
        ground.
    follow: whether the camera goes with the robot where it walks; `play` and `camera` may have it
        otherwise.
    port: port of the page; 0 takes a free one once `url` is asked for, so a picture in a notebook
        has none.
    Raises `InputError` for an impossible argument and `ViewerError` when the port is taken.

    In a notebook, a viewer as the last line of a cell displays itself, wherever the kernel runs:
    its frames come as a slider's values do. Elsewhere, open `viewer.url` in a browser. The newest
    display in a notebook is live; earlier ones show the image with which they opened. So give each
    interactive part its own `Viewer`.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        height: int = 480,
        background: str = "light",
        scale: float | None = None,
        facets: int | None = None,
        inner_approximation: bool = True,
        facet_rotation: float = 0.0,
        ground: Ground | npt.ArrayLike | None = None,
        follow: bool = False,
        port: int = 0,
    ):
        as_instance("robot", robot, Robot)
        if not isinstance(background, str) or background not in BACKGROUNDS:
            raise InputError(
                f"background is {short_repr(background)}; it must be one of "
                f"{', '.join(BACKGROUNDS)}."
            )
        # raises for wrong ones
        polyhedron = FrictionPolyhedron(
            np.array(UP), 1.0, 4 if facets is None else facets, inner_approximation, facet_rotation
        )
        self.robot, self.background = robot, background
        self.height = as_integer("height", height, 1, _MOST_PIXELS, "pixels")
        requested = None if scale is None else as_positive("scale", scale, "m/N")
        background_colour, _, line_colour, text_colour = BACKGROUNDS[background]
        self.painter = Painter(
            robot,
            requested,
            facets,
            polyhedron.inner_approximation,
            polyhedron.facet_rotation,
            _ground(ground),
            line_colour,
            text_colour,
            background_colour,
        )
        self.window = Window(port)
        self.renderer = DiffRenderer(self.window)
        self._camera = FollowingCamera(robot, as_bool("follow", follow))
        self._is_playing = False
        self._last: State | None = None
        self._legend_entries: dict[
            str, tuple[RGB, str]
        ] = {}  # kinds of items that the legend explains beside its own
        super().__init__()
        self._set_stage(background)

    @property
    def url(self) -> str:
        """Address of the live page. It can be opened on the machine of this process only, by every
        user of it.

        The page has no port before this is asked for. Raises `ViewerError` when the viewer was
        closed before.
        """
        return self.window.web_url

    @property
    def scale(self) -> float:
        """Length of a drawn force, m/N, the same for forces and cones."""
        return self.painter.scale

    def set_ground(self, ground: Ground | npt.ArrayLike | None) -> None:
        """Draw another ground from the next picture on. ground: as for the viewer."""
        self.painter = self.painter.replace(ground=_ground(ground))

    def show(
        self,
        state: State,
        contacts: Contacts | None = None,
        forces: npt.ArrayLike | None = None,
        planned: npt.ArrayLike | None = None,
        *,
        title: str | None = None,
        ghost_name: str = GHOST_NAME,
        **options: Unpack[PictureKeywords],
    ) -> Viewer:
        """Draw the robot and what the arguments ask for, and remove everything else. Returns this
        viewer.

        state: the state of the robot.
        contacts: its contacts; each gets a patch and a friction cone.
        forces: measured forces of the ground on the robot, shape (3 n,) or (n, 3) for the n points
            of `contacts`, N, world.
        planned: the same as a controller plans them. A cone's colour says where its force lies, of
            `forces` if given, else of `planned`.
        title: a line in the corner.
        ghost_name: what the legend calls the ghost.
        options: what else is drawn: com, cones, arrows, support, wrench, push, ghost, frames,
            labels, extra, swing_feet; `PictureOptions` explains them.
        Raises `InputError` for a state of another robot, a wrong number of forces, forces without
        contacts, and NaN; `ViewerError` when the window is closed.
        """
        _check_texts(title=title, ghost_name=ghost_name)
        picture = self.painter.picture(state, contacts, forces, planned, **options)
        self.draw(picture, title, ghost_name)
        if self._last is None:
            self.renderer.set(*self._camera.commands(self.painter, View(), state))
        self._last = state
        return self

    def add_legend_entry(self, kind: str, colour: RGB, meaning: str) -> None:
        """Let the legend explain user-defined items, from the next picture on that has any.

        kind: first part of their paths. colour: RGB, from 0 to 1. meaning: what the legend says.
        """
        red, green, blue = np.clip(as_array("colour", colour, (3,)), 0.0, 1.0).tolist()
        self._legend_entries[as_string("kind", kind)] = (
            (red, green, blue),
            as_string("meaning", meaning),
        )

    def multiplier_labels(self, state: State, contacts: Contacts, solution: Solution) -> Picture:
        """Labels for `extra` of `show`: the multiplier of each active friction facet at its middle,
        of a normal force on top.

            labels = view.multiplier_labels(state, contacts, command.solution)
            view.show(state, contacts, planned=command.forces, extra=labels)

        A multiplier is what one newton more of room would lower the objective by; two significant
        digits are shown.
        state, contacts: those that the controller was given.
        solution: its answer: `command.solution`, or that of `solve(controller.qp(state))`.
        Raises `InputError` for a solution of other contacts.
        """
        self.painter.check_robot("state", as_instance("state", state, State).robot)
        positions, height = (
            as_instance("contacts", contacts, Contacts).positions(state),
            self.painter.cone_height(contacts),
        )
        drawn = markers.multiplier_labels(
            positions,
            contacts,
            as_instance("solution", solution, Solution),
            height,
            self.painter.size,
        )
        return prefixed("multiplier", drawn)

    def walk_overlay(self, walk: Walk, state: State) -> Picture:
        """Marks for `extra` of `show`: planned footholds, swing paths, the capture point, and the
        planned ZMP of a `Walk`.

            view.show(state, walk.contacts, extra=view.walk_overlay(walk, state))

        walk: the behaviour, after a tick; before its first one there is nothing to draw. state: of
            the robot, then.
        Raises `InputError` for those of another robot.
        """
        self.painter.check_robot("walk", as_instance("walk", walk, Walk).robot)
        self.painter.check_robot("state", as_instance("state", state, State).robot)
        return gait_overlay.walk_overlay(walk, state, self._overlay_style)

    def step_overlay(self, step: StepPlan, t: float, state: State) -> Picture:
        """The same marks of a stored step, an entry of `walk.history`, as it was planned. t: s.
        state: of the robot, then.
        """
        self.painter.check_robot("state", as_instance("state", state, State).robot)
        return gait_overlay.step_overlay(step, t, state, self._overlay_style)

    @property
    def _overlay_style(self) -> gait_overlay.Style:
        return gait_overlay.Style(
            self.painter.size, self.painter.drawn_ground, self.painter.text_colour
        )

    def draw(
        self, picture: Picture, title: str | None = None, ghost_name: str = GHOST_NAME
    ) -> None:
        """Draw a picture (path -> item), made by `painter.picture` or of your own items, and remove
        everything else.
        """
        if self._is_playing:
            follow = self._camera.follow_command(self.painter, ROBOT)
            self.window.put([follow, *protocol.end_animation()])
            self._is_playing = False
        settings = (
            *self._caption(legend_kinds(picture), title, ghost_name),
            protocol.set_ground(self.painter.drawn_ground.planes),
        )
        self.renderer.draw(picture, *settings)  # at once: a second frame would wait

    def play(
        self,
        rollout: Rollout,
        *,
        speed: float = 1.0,
        rate: float = 30.0,
        planned: bool = True,
        steps: Iterable[StepPlan] = (),
        follow: bool = True,
        paused: bool = False,
        title: str | None = None,
        ghost_name: str = GHOST_NAME,
        **options: Unpack[PictureKeywords],
    ) -> Viewer:
        """Play a rollout in the page, again and again, with a time slider and a choice of speeds.
        Returns at once.

        A foot that swings, which is not among the controller's contacts just then, has no cone; its
        measured force is drawn.
        rollout: the record to play.
        speed: 1 for real time, 0.25 for slow motion.
        rate: pictures drawn for each second of the record.
        planned: whether to draw the planned forces too.
        title, ghost_name, options: as for `show`. The record says where pushes act and which feet
            swing, in place of the options for these.
        steps: `walk.history` of the `Walk` that was recorded; its marks are drawn as `step_overlay`
            makes them.
        follow: whether the camera goes with the robot, smoothly and at one height over the viewer's
            ground; afterwards, too.
        paused: whether the reader must press play first.
        Raises `InputError` for a record of another robot or without rows.
        """
        self.painter.check_robot("record", recording.as_rollout(rollout).robot)
        if not len(rollout.time):
            raise InputError("the record has no rows, so there is nothing to play.")
        for name, flag in {"planned": planned, "follow": follow, "paused": paused}.items():
            as_bool(name, flag)
        _check_texts(title=title, ghost_name=ghost_name)
        rows, planned_steps = (
            recording.sampled_rows(rollout.time, as_positive("rate", rate, "1/s")),
            gait_overlay.as_steps(steps),
        )
        states = [State(self.robot, rollout.q[i], rollout.v[i]) for i in rows]
        times = rollout.time[rows].tolist()
        contacts, columns = recording.point_force_contacts(rollout.contacts)
        pictures = []
        for i, t, state in zip(rows, times, states, strict=True):
            overlay: Picture = dict(options.get("extra") or {})
            if (step := gait_overlay.step_at(planned_steps, t)) is not None:
                overlay |= self.step_overlay(step, t, state)
            plan = rollout.planned[i, columns]
            chosen: PictureKeywords = {**options, "extra": overlay}
            chosen["push"] = recording.push_at(rollout, i)
            chosen["swing_feet"] = recording.swing_feet_at(rollout, i)
            pictures.append(
                self.painter.picture(
                    state,
                    contacts,
                    rollout.measured[i, columns],
                    plan if planned and np.isfinite(plan).all() else None,
                    **chosen,
                )
            )
        if follow and self.robot.is_floating:
            places = recording.smoothed(
                times, np.array([state.joint_transforms[1][:3, 3] for state in states])
            )
            pictures = [
                picture | {FOLLOWED: shapes.invisible_point(at)}
                for picture, at in zip(pictures, places, strict=True)
            ]
        self.play_pictures(
            times, pictures, speed=speed, paused=paused, title=title, ghost_name=ghost_name
        )
        self._last, self._camera.follows = states[0], follow
        self.renderer.set(*self._camera.commands(self.painter, View(), states[0], FOLLOWED))
        return self

    def play_pictures(
        self, times: npt.ArrayLike, pictures: Sequence[Picture], *, speed: float = 1.0,
        paused: bool = False,
        title: str | None = None, ghost_name: str = GHOST_NAME,
    ) -> Viewer:  # fmt: skip
        """Play pictures, made by `painter.picture` or of your own items. Returns at once.

        times: (n,), s; picture i is shown from times[i] on.
        pictures: n pictures, path -> item each.
        speed, paused, title, ghost_name: as for `play`.
        """
        moving = recording.animate(times, pictures, ROOT, as_positive("speed", speed), paused)
        self.draw(moving.first, title)
        self.renderer.set(
            *self._caption(set[str]().union(*map(legend_kinds, pictures)), title, ghost_name)
        )
        self.window.put([moving.command])
        self._is_playing = True
        return self

    def camera(self, view: str | View = "default", follow: bool | None = None) -> Viewer:
        """Look from a preset ("default", "front", "back", "left", "right", "top", "feet") or from a
        `View`.

        follow: whether the camera goes with the robot when it walks away, smoothly and at one
            height over the viewer's ground; None leaves it so.
        Every call undoes how the reader has turned the view, so do not call it each time a slider
        moves. Raises `InputError` for another name.
        """
        if isinstance(view, str) and view in PRESETS:
            view = PRESETS[view]
        if not isinstance(view, View):
            raise InputError(
                f"camera view is {short_repr(view)}; it must be one of {', '.join(PRESETS)}, or a "
                f"View."
            )
        if follow is not None:
            self._camera.follows = as_bool("follow", follow)
        followed = FOLLOWED if self._is_playing else ROBOT
        self.renderer.force_set(*self._camera.commands(self.painter, view, self._last, followed))
        return self

    def set_disconnect_message(self, words: str) -> None:
        """What the page says when this viewer has been closed. words: the text."""
        self.renderer.set(
            protocol.page_command("set_disconnect_message", text=as_string("words", words))
        )

    def close(self) -> None:
        """Close the page: its thread ends and its port is free."""
        self.window.close()

    def __repr__(self) -> str:
        address = f", {self.url}" if self.window.is_listening else ""
        return f"Viewer({self.robot.name}{address}{'' if self.window.is_open else ', closed'})"

    def _set_stage(self, background: str) -> None:
        """Set the background, and hide meshcat's own grid and axes."""
        top, bottom = BACKGROUNDS[background][:2]
        self.renderer.set(
            protocol.set_property("/Background", "top_color", list(top)),
            protocol.set_property("/Background", "bottom_color", list(bottom)),
            protocol.set_property("/Grid", "visible", False),
            protocol.set_property("/Axes", "visible", False),
            protocol.page_command("set_theme", name=background),
        )

    def _caption(
        self, shown: set[str], title: str | None, ghost_name: str
    ) -> tuple[protocol.Update, protocol.Update]:
        """The commands for the title, and for the legend of the colours in the picture."""
        return protocol.page_command("set_title", text=title or ""), legend.command(
            frozenset(shown),
            ghost_name,
            self.painter.text_colour,
            tuple((kind, *entry) for kind, entry in self._legend_entries.items()),
        )


def _check_texts(**texts: str | None) -> None:
    for name, value in texts.items():
        as_string(name, "" if value is None and name == "title" else value)


def _ground(ground: Ground | npt.ArrayLike | None) -> Plane | Planes | None:
    """The ground as it is drawn; None for None."""
    if ground is None:
        return None
    from floatbase.simulation import (
        Ground,
    )  # loads MuJoCo, which no picture of a level ground needs

    made = ground if isinstance(ground, Ground) else Ground(normal=unit_vector("ground", ground))
    planes = []
    for (x, y, z), offset in zip(made.normals.tolist(), made.offsets.tolist(), strict=True):
        if z < MIN_VERTICAL:
            raise InputError(
                f"ground is {[x, y, z]}; the normal of the ground must point upwards, as [0, 0, 1] "
                f"does."
            )
        planes.append(Plane((x, y, z), offset))
    return planes[0] if len(planes) == 1 else Planes(tuple(planes))
