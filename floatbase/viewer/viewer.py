"""The `Viewer`: draws a robot with its contacts, forces and friction cones in a web page."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Unpack, cast

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
from floatbase.errors import InputError, require
from floatbase.friction import FrictionPolyhedron
from floatbase.qp import Solution
from floatbase.robots import Robot, State
from floatbase.viewer.camera import FOLLOWED, PRESETS, ROBOT, FollowingCamera, View
from floatbase.viewer.controls import Controls
from floatbase.viewer.export import recording
from floatbase.viewer.output import Output
from floatbase.viewer.scene import gait_overlay, legend, markers, protocol, shapes
from floatbase.viewer.scene.colours import BACKGROUNDS, GHOST_NAME, RGB
from floatbase.viewer.scene.diff import DiffRenderer
from floatbase.viewer.scene.ground import MIN_VERTICAL, DrawnGround, Plane, Planes, Terrain
from floatbase.viewer.scene.options import PictureKeywords
from floatbase.viewer.scene.painter import Painter
from floatbase.viewer.scene.shapes import Picture, prefixed
from floatbase.viewer.transport.window import Window

if TYPE_CHECKING:
    from meshcat import Visualizer

    from floatbase.simulation import Ground, Rollout

UP = (0.0, 0.0, 1.0)
_MAX_HEIGHT = 10_000  # pixels


class Viewer(Controls, Output):
    """A web page in which this process draws a robot.

    In a notebook, a viewer on the last line of a cell displays itself, wherever the kernel runs:
    its frames use the kernel's own connection, as slider values do. Elsewhere, open `viewer.url` in
    a browser. Only the newest display in a notebook is live; earlier ones show the image with which
    they opened. Use a separate `Viewer` for each interactive part.

    Parameters
    ----------
    robot : Robot
        The robot to draw.
    height : int, optional
        Height of the picture in a notebook [pixels].
    background : {"white", "light", "dark"}, optional
        Background of the picture. "white" and "light" turn dark when the surrounding page or the
        browser is dark.
    scale : float, optional
        Length of a drawn force [m/N], the same for forces and cones. By default, the arrow of the
        robot's weight is about twice as long as its centre of mass is high.
    facets : int, optional
        Number of facets of the drawn friction polyhedra. By default, round cones are drawn.
    inner_approximation : bool, optional
        Whether the drawn polyhedra lie inside the friction cones, as for `FrictionPolyhedron`.
    facet_rotation : float, optional
        Rotation of the facets about the normal [rad], as for `FrictionPolyhedron`.
    ground : Ground or array_like, shape (3,), optional
        The ground of a simulation, or the normal, in the world frame, of a plane through the
        origin. By default, the plane of the contacts if they share a normal, else level ground.
    follow : bool, optional
        Whether the camera follows the robot when it walks; `play` and `camera` can change this.
    port : int, optional
        Port of the page; 0 takes a free port when `url` is first read, so a viewer that is only
        displayed in a notebook opens no port.
    meshcat : meshcat.Visualizer, optional
        A visualizer in which to draw too, below its path `floatbase`. Everything else in it stays
        as it is. Pinocchio's `MeshcatVisualizer` has one: its attribute `viewer`.

    Raises
    ------
    InputError
        If an argument is invalid.
    ViewerError
        If the port is already in use.
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
        meshcat: Visualizer | None = None,
    ):
        as_instance("robot", robot, Robot)
        if not isinstance(background, str) or background not in BACKGROUNDS:
            raise InputError(
                f"background is {short_repr(background)}; it must be one of "
                f"{', '.join(BACKGROUNDS)}."
            )
        # raises an error if an argument is invalid
        polyhedron = FrictionPolyhedron(
            np.array(UP), 1.0, 4 if facets is None else facets, inner_approximation, facet_rotation
        )
        self.robot, self.background = robot, background
        if meshcat is not None:
            kind = require("meshcat", "viewer").Visualizer
            as_instance("meshcat", meshcat, kind, "`viewer` of Pinocchio's MeshcatVisualizer")
        self.height = as_integer("height", height, 1, _MAX_HEIGHT, "in pixels")
        requested = None if scale is None else as_positive("scale", scale, "m/N")
        background_colour, _, line_colour, text_colour = BACKGROUNDS[background]
        self.painter = Painter(
            robot, requested, facets, polyhedron.inner_approximation, polyhedron.facet_rotation,
            _ground(ground), line_colour, text_colour, background_colour,
        )  # fmt: skip
        self.window = Window(port)
        self.renderer = DiffRenderer(self.window)
        self._camera = FollowingCamera(robot, as_bool("follow", follow))
        self._view = View()  # of the camera, when a first picture or a recording places it
        self._is_playing = False
        self._last: State | None = None
        # colour and meaning of each user-defined kind of item
        self._legend_entries: dict[str, tuple[RGB, str]] = {}
        super().__init__()
        self._set_stage(background)
        if meshcat is not None:
            self.window.draw_into(meshcat)

    @property
    def url(self) -> str:
        """Address of the live page, which only users of this machine can open.

        Reading it opens the page's port. It raises `ViewerError` if the viewer was closed before
        the first read.
        """
        return self.window.web_url

    @property
    def scale(self) -> float:
        """Length of a drawn force [m/N], the same for forces and cones."""
        return self.painter.scale

    def set_ground(self, ground: Ground | npt.ArrayLike | None) -> None:
        """Change the ground, starting with the next picture.

        Parameters
        ----------
        ground : Ground or array_like, shape (3,), or None
            As for `Viewer`; None restores the default.
        """
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
        """Draw the robot and everything that the arguments ask for; remove everything else.

        Parameters
        ----------
        state : State
            State of the robot.
        contacts : Contacts, optional
            Contacts of the robot; each gets a patch and a friction cone.
        forces : array_like, shape (3 n,), (n, 3) or (k,), optional
            Measured forces of the ground on the robot at the n points of `contacts`, in the world
            frame [N], or all entries of λ. Then fixed frames and rigid connections get an arrow at
            their first frame, too, without the moment.
        planned : array_like, shape (3 n,), (n, 3) or (k,), optional
            The controller's planned forces, in the same form [N]. The colour of a cone shows where
            its force lies: the one in `forces` if given, else the one in `planned`.
        title : str, optional
            Text in the corner of the picture.
        ghost_name : str, optional
            Name of the ghost in the legend.
        **options
            What to draw: robot, com, cones, arrows, support, wrench, push, ghost, frames, labels,
            extra, swing_feet, joint_limits, qdd, ground_position. `PictureOptions` describes them.

        Returns
        -------
        Viewer
            This viewer.

        Raises
        ------
        InputError
            If the state belongs to a different robot, if forces are given without contacts or in
            the wrong number, or if a value is NaN.
        ViewerError
            If the window is closed.

        Examples
        --------
        >>> import floatbase as fb
        >>> robot = fb.load("go2")
        >>> view = fb.Viewer(robot).show(robot.standing(), title="standing")
        >>> view.close()
        """
        _check_texts(title=title, ghost_name=ghost_name)
        picture = self.painter.picture(state, contacts, forces, planned, **options)
        self.draw(picture, title, ghost_name)
        if self._last is None:
            self.renderer.set(*self._camera.commands(self.painter, self._view, state))
        self._last = state
        return self

    def add_legend_entry(self, kind: str, colour: RGB, meaning: str) -> None:
        """Add a legend entry for user-defined items; it appears in pictures that contain them.

        Parameters
        ----------
        kind : str
            First part of the items' paths.
        colour : array_like, shape (3,)
            RGB components from 0 to 1, dimensionless.
        meaning : str
            Text of the entry.
        """
        red, green, blue = np.clip(as_array("colour", colour, (3,)), 0.0, 1.0).tolist()
        entry = (red, green, blue), as_string("meaning", meaning)
        self._legend_entries[as_string("kind", kind)] = entry

    def multiplier_labels(self, state: State, contacts: Contacts, solution: Solution) -> Picture:
        """Make labels for the multipliers of active friction constraints, for `extra` of `show`.

        The multiplier of a friction facet is drawn at the middle of the facet, that of a normal
        force on top of the cone. A multiplier tells by how much the objective would decrease if its
        constraint were relaxed by one newton; two significant digits are shown. To draw the
        labels::

            labels = view.multiplier_labels(state, contacts, command.solution)
            view.show(state, contacts, planned=command.forces, extra=labels)

        Parameters
        ----------
        state : State
            The state that the controller was given.
        contacts : Contacts
            The contacts that the controller was given.
        solution : Solution
            The controller's solution, `command.solution`.

        Returns
        -------
        Picture
            Labels by path.

        Raises
        ------
        InputError
            If the solution belongs to other contacts, or the state to another robot.
        """
        self.painter.check_robot("state", as_instance("state", state, State).robot)
        positions = as_instance("contacts", contacts, Contacts).positions(state)
        height, size = self.painter.cone_height(contacts), self.painter.size
        as_instance("solution", solution, Solution)
        drawn = markers.multiplier_labels(positions, contacts, solution, height, size)
        return prefixed("multiplier", drawn)

    def walk_overlay(self, walk: Walk, state: State) -> Picture:
        """Make markers for the plan of a `Walk`, for `extra` of `show`.

        The markers show the planned footholds, the swing paths, the capture point and the planned
        ZMP. To draw them::

            view.show(state, walk.contacts, extra=view.walk_overlay(walk, state))

        Parameters
        ----------
        walk : Walk
            The behaviour after a control step; before the first one, there is nothing to draw.
        state : State
            State of the robot at that time.

        Returns
        -------
        Picture
            Markers by path.

        Raises
        ------
        InputError
            If the walk or the state belongs to a different robot.
        """
        self.painter.check_robot("walk", as_instance("walk", walk, Walk).robot)
        self.painter.check_robot("state", as_instance("state", state, State).robot)
        return gait_overlay.walk_overlay(walk, state, self._overlay_style)

    def step_overlay(self, step: StepPlan, t: float, state: State) -> Picture:
        """Make the markers of `walk_overlay` for a stored step, as it was planned.

        Parameters
        ----------
        step : StepPlan
            An entry of `walk.history`.
        t : float
            Time [s].
        state : State
            State of the robot at that time.

        Returns
        -------
        Picture
            Markers by path.

        Raises
        ------
        InputError
            If the state belongs to a different robot.
        """
        self.painter.check_robot("state", as_instance("state", state, State).robot)
        return gait_overlay.step_overlay(step, t, state, self._overlay_style)

    @property
    def _overlay_style(self) -> gait_overlay.Style:
        """Size, ground and text colour of the overlays."""
        painter = self.painter
        return gait_overlay.Style(painter.size, painter.drawn_ground, painter.text_colour)

    def draw(
        self, picture: Picture, title: str | None = None, ghost_name: str = GHOST_NAME
    ) -> None:
        """Draw a picture and remove everything else.

        Parameters
        ----------
        picture : Picture
            Items by path, made by `painter.picture` or by yourself.
        title : str, optional
            Text in the corner of the picture.
        ghost_name : str, optional
            Name of the ghost in the legend.
        """
        _check_texts(title=title, ghost_name=ghost_name)
        picture = shapes.with_normal_paths(picture)
        if self._is_playing:
            follow = self._camera.follow_command(self.painter, ROBOT)
            self.window.put([follow, *protocol.end_animation()])
            self._is_playing = False
        ground = self.painter.drawn_ground
        settings = (
            *self._caption(legend.kinds(picture), title, ghost_name),
            protocol.set_ground(
                [plane for plane in ground.planes if plane.normal[2] >= MIN_VERTICAL],
                ground.boxes if isinstance(ground, Terrain) else (),
            ),
        )
        self.renderer.draw(picture, *settings)  # in one frame, because a second one would wait

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
        """Play a rollout in the page repeatedly, with a time slider and a choice of speeds.

        The method returns at once. A swing foot, which is not among the controller's contacts at
        that time, has no cone; its measured force is drawn.

        Parameters
        ----------
        rollout : Rollout
            The rollout to play.
        speed : float, optional
            Playback speed, dimensionless: 1 is real time, 0.25 slow motion.
        rate : float, optional
            Pictures drawn per second of the rollout [1/s].
        planned : bool, optional
            Whether to draw the planned forces too.
        steps : iterable of StepPlan, optional
            `walk.history` of the recorded `Walk`; its markers are drawn as by `step_overlay`.
        follow : bool, optional
            Whether the camera follows the robot, smoothly and at a constant height above the
            viewer's ground. The setting stays in effect afterwards.
        paused : bool, optional
            Whether playback waits until the reader presses play.
        title : str, optional
            Text in the corner of the picture.
        ghost_name : str, optional
            Name of the ghost in the legend.
        **options
            As for `show`. The rollout itself determines `push`, `swing_feet`, `ground_position`
            and, unless they are given, `joint_limits` and `qdd`. Steps, stairs and other boxes of
            its ground are drawn unless the viewer has a ground.

        Returns
        -------
        Viewer
            This viewer.

        Raises
        ------
        InputError
            If the rollout belongs to a different robot or is empty.
        """
        self.painter.check_robot("rollout", recording.as_rollout(rollout).robot)
        if not len(rollout.time):
            raise InputError(
                "The rollout is empty, so there is nothing to play. Record at least one step."
            )
        for name, flag in {"planned": planned, "follow": follow, "paused": paused}.items():
            as_bool(name, flag)
        _check_texts(title=title, ghost_name=ghost_name)
        if self.painter.ground is None and rollout.ground is not None and rollout.ground.boxes:
            self.set_ground(rollout.ground)
        rows = recording.sampled_rows(rollout.time, as_positive("rate", rate, "1/s"))
        planned_steps = gait_overlay.as_steps(steps)
        states = [State(self.robot, rollout.q[i], rollout.v[i]) for i in rows]
        times = rollout.time[rows].tolist()
        pictures = []
        for i, t, state in zip(rows, times, states, strict=True):
            overlay: Picture = dict(options.get("extra") or {})
            if (step := gait_overlay.step_at(planned_steps, t)) is not None:
                overlay |= self.step_overlay(step, t, state)
            # NaN where the simulation has nothing, or in a row without a plan
            measured, plan = np.nan_to_num([rollout.measured[i], rollout.planned[i]])
            chosen: PictureKeywords = {**options, "extra": overlay}
            chosen["push"] = recording.push_at(rollout, i)
            chosen["swing_feet"] = recording.swing_feet_at(rollout, i)
            if rollout.ground_position is not None:
                chosen["ground_position"] = rollout.ground_position[i]
            chosen = cast(PictureKeywords, recording.joint_limits_at(rollout, i) | dict(chosen))
            shown_plan = plan if planned else None
            pictures.append(
                self.painter.picture(state, rollout.contacts, measured, shown_plan, **chosen)
            )
        if follow and self.robot.is_floating:
            bases = np.array([state.joint_transforms[1][:3, 3] for state in states])
            places = recording.smoothed(times, bases)
            pictures = [
                picture | {FOLLOWED: shapes.invisible_point(at)}
                for picture, at in zip(pictures, places, strict=True)
            ]
        self.play_pictures(
            times, pictures, speed=speed, paused=paused, title=title, ghost_name=ghost_name
        )
        self._last, self._camera.follows = states[0], follow
        self.renderer.set(*self._camera.commands(self.painter, self._view, states[0], FOLLOWED))
        return self

    def play_pictures(
        self, times: npt.ArrayLike, pictures: Sequence[Picture], *, speed: float = 1.0,
        paused: bool = False,
        title: str | None = None, ghost_name: str = GHOST_NAME,
    ) -> Viewer:  # fmt: skip
        """Play a sequence of pictures repeatedly; return at once.

        Parameters
        ----------
        times : array_like, shape (n,)
            Times [s]; picture i is shown from `times[i]` on.
        pictures : sequence of Picture
            n pictures, made by `painter.picture` or by yourself.
        speed : float, optional
            Playback speed, dimensionless; 1 is real time.
        paused : bool, optional
            Whether playback waits until the reader presses play.
        title : str, optional
            Text in the corner of the picture.
        ghost_name : str, optional
            Name of the ghost in the legend.

        Returns
        -------
        Viewer
            This viewer.
        """
        _check_texts(title=title, ghost_name=ghost_name)
        moving = recording.animate(
            times, pictures, protocol.ROOT, as_positive("speed", speed), paused
        )
        self.draw(moving.first, title)
        kinds = set[str]().union(*map(legend.kinds, pictures))
        self.renderer.set(*self._caption(kinds, title, ghost_name))
        self.window.put([moving.command])
        self._is_playing = True
        return self

    def camera(self, view: str | View = "default", follow: bool | None = None) -> Viewer:
        """Set the camera to a preset or to a `View`.

        Every call discards how the reader has turned the view, so do not call it each time a slider
        moves.

        Parameters
        ----------
        view : {"default", "front", "back", "left", "right", "top", "feet"} or View, optional
            Where to look from.
        follow : bool, optional
            Whether the camera follows the robot when it walks away, smoothly and at a constant
            height above the viewer's ground. By default, the setting is unchanged.

        Returns
        -------
        Viewer
            This viewer.

        Raises
        ------
        InputError
            If there is no preset of this name.
        """
        if isinstance(view, str) and view in PRESETS:
            view = PRESETS[view]
        if not isinstance(view, View):
            raise InputError(
                f"The camera's view is {short_repr(view)}; it must be one of {', '.join(PRESETS)}, "
                f"or a View."
            )
        if follow is not None:
            self._camera.follows = as_bool("follow", follow)
        followed = FOLLOWED if self._is_playing else ROBOT
        self._view = view
        self.renderer.force_set(*self._camera.commands(self.painter, view, self._last, followed))
        return self

    def set_disconnect_message(self, words: str) -> None:
        """Set the message that the page shows after this viewer has been closed.

        Parameters
        ----------
        words : str
            The message.
        """
        text = as_string("words", words)
        self.renderer.set(protocol.page_command("set_disconnect_message", text=text))

    def close(self) -> None:
        """Close the page: end its thread and free its port."""
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
        """Return the commands for the title and for the legend of the kinds that are shown."""
        entries = tuple((kind, *entry) for kind, entry in self._legend_entries.items())
        colour = self.painter.text_colour
        caption = legend.command(frozenset(shown), ghost_name, colour, entries)
        return protocol.page_command("set_title", text=title or ""), caption


def _check_texts(**texts: str | None) -> None:
    """Check that each argument is a string; only the title may be None."""
    for name, value in texts.items():
        as_string(name, "" if value is None and name == "title" else value)


def _ground(ground: Ground | npt.ArrayLike | None) -> DrawnGround | None:
    """Return the ground as it is drawn, or None for None."""
    if ground is None:
        return None
    # loads MuJoCo, which no picture of a level ground needs
    from floatbase.simulation import Ground

    made = ground if isinstance(ground, Ground) else Ground(normal=unit_vector("ground", ground))
    normals, offsets = made.normals.tolist(), made.offsets.tolist()
    if made.normals[:, 2].max() < MIN_VERTICAL:
        raise InputError(
            f"ground has the normal {normals[0]}; at least one must point upwards, as [0, 0, 1] "
            f"does."
        )
    planes = [Plane(tuple(n), offset) for n, offset in zip(normals, offsets, strict=True)]
    base = planes[0] if len(planes) == 1 else Planes(tuple(planes))
    return Terrain(base, tuple(map(tuple, made.box_bounds.tolist()))) if made.boxes else base
