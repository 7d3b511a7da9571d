"""`Viewer(robot)`: the picture of a state, its contacts, forces and friction cones, in the page; still or moving."""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from floatbase._arrays import positive, unit_vector
from floatbase.dynamics import Contacts
from floatbase.errors import InputError, ViewerError
from floatbase.friction import FrictionPolyhedron
from floatbase.robots import Robot, State
from floatbase.viewer import page, recording, wire
from floatbase.viewer.camera import PRESETS, View, eye_and_target
from floatbase.viewer.canvas import ROOT, Canvas
from floatbase.viewer.colours import BACKGROUNDS, GHOST_NAME, LEGEND, hexadecimal
from floatbase.viewer.ground import STEEPEST, Plane
from floatbase.viewer.painter import Painter, kinds
from floatbase.viewer.place import kernel_is_remote
from floatbase.viewer.shapes import Item, Picture
from floatbase.viewer.window import Window

if TYPE_CHECKING:
    from floatbase.simulation import Rollout

UP = (0.0, 0.0, 1.0)
# the browser finds out whether it reaches the live page; the signs in the kernel's environment may have missed something
_PROBE = """<script>fetch("URL", {mode: "no-cors"}).catch(() => {
  const frame = document.querySelector('iframe[src="URL"]');
  if (frame) frame.srcdoc = "<p style='font-family: sans-serif'>The viewer that drew this is gone: its kernel was restarted " +
    "or has stopped. Run the notebook again. If this is a fresh picture, the kernel runs on another machine: for still ones, " +
    "import os; os.environ['FLOATBASE_VIEWER'] = 'static', and run this cell again.</p>";
});</script>"""


class Viewer:
    """A robot in a meshcat window of this process.

    height: of the picture in a notebook, pixels. background: "white", "light" or "dark". scale: metres drawn for a newton,
    shared by forces and cones; by default such that the robot's weight is about twice as long as its centre of mass is high.
    facets: draw friction cones as polyhedra with so many facets; None for round cones. inside: see `FrictionPolyhedron`.
    ground: (3,), world, normal of the ground, a plane through the origin; by default the plane that the contacts stand on, when
    they share a normal, else level. port: of the window; a free one by default.
    Raises `InputError` for arguments that cannot be, and `ViewerError` when the port is taken.

    In a notebook a viewer as the last line of a cell shows itself: the live page, or, where the kernel is on another machine
    and its page cannot be reached, the scene as it is now. Elsewhere open `viewer.url` in a browser. Displayed again further
    down, a viewer is live there, and the picture above is kept as it was: an interactive part gets a `Viewer` of its own.
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
        ground: npt.ArrayLike | None = None,
        port: int = 0,
    ):
        if not isinstance(robot, Robot):
            raise InputError(f"Viewer needs a Robot, as in fb.Viewer(fb.load('go2')), not {type(robot).__name__}.")
        if background not in BACKGROUNDS:
            raise InputError(f"background is {background!r}; it must be one of {', '.join(BACKGROUNDS)}.")
        if facets is not None:
            FrictionPolyhedron(np.array(UP), 1.0, facets)  # says what is wrong with the number
        self.robot, self.background = robot, background
        self.height = int(positive("height", height, "pixels"))
        asked = None if scale is None else positive("scale", scale, "m/N")
        paper, _, lines, text = BACKGROUNDS[background]
        self.painter = Painter(robot, asked, facets, inside, _plane(ground), lines, text, paper)
        self.window = Window(port)
        self.canvas = Canvas(self.window)
        self._moving = False
        self._last: State | None = None
        self._controls: dict[str, Callable[[Any], None]] = {}
        self._set_stage(background)

    @property
    def url(self) -> str:
        """Address of the live page, on the kernel's machine."""
        return self.window.web_url

    @property
    def scale(self) -> float:
        """Metres drawn for a newton, for forces and cones alike."""
        return self.painter.scale

    def show(
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
        title: str | None = None,
        ghost_name: str = GHOST_NAME,
    ) -> Viewer:
        """Draw this and nothing else; drawing the same again sends nothing.

        forces, planned: shape (3 n,) or (n, 3) for the n points of `contacts`, N, world-aligned, what the ground does to the
        robot: measured, and as a controller plans them. Cones are judged by `forces`, else by `planned`.
        com: the centre of mass and its projection on the ground. support: the region that the contact points span.
        wrench: shape (6,), force (N) and moment (N·m) at the centre of mass, world; the moment's ring has the radius that the
        force would have which makes it at a lever as long as the robot's half diagonal. push: frame and force, (3,), N, world.
        ghost: another state of the robot, drawn as a veil; the legend calls it ghost_name. frames: names of frames to draw.
        labels: names of the contacts. extra: more items by path, from `floatbase.viewer.shapes`, `marks` or `props`. title: a
        line in the corner.
        Raises `InputError` for a state of another robot, a wrong number of forces, forces without contacts, and NaN;
        `ViewerError` when the window is closed.
        """
        picture = self.painter.picture(
            state, contacts, forces, planned, com=com, cones=cones, support=support, wrench=wrench, push=push,
            ghost=ghost, frames=frames, labels=labels, extra=extra,
        )  # fmt: skip
        self.draw(picture, title, ghost_name)
        if self._last is None:
            self._last = state
            self.canvas.set(*self._looking(View(), follow=False))
        self._last = state
        return self

    def draw(self, picture: Picture, title: str | None = None, ghost_name: str = GHOST_NAME) -> None:
        """Draw a picture, from `painter.picture` or your own items, and nothing else."""
        if self._moving:
            self.window.put(wire.end_animation())
            self._moving = False
        self.canvas.draw(picture)
        self._caption(kinds(picture), title, ghost_name)

    def play(
        self,
        rollout: Rollout,
        *,
        speed: float = 1.0,
        rate: float = 30.0,
        planned: bool = True,
        com: bool = True,
        cones: bool = True,
        support: bool = False,
        ghost: State | None = None,
        follow: bool = True,
        paused: bool = False,
        title: str | None = None,
        ghost_name: str = GHOST_NAME,
    ) -> Viewer:
        """Play a record in the page, over and over, with a slider to seek and a choice of speeds; this call returns at once.

        A contact that the controller's stance does not have just then has no cone; what the physics measures there is drawn.
        speed: 1 for real time, 0.25 for slow motion. rate: pictures a second of the record. planned: the planned forces
        too. com, cones, support, ghost, ghost_name: as for `show`. follow: the camera goes with the robot. paused: wait for
        the reader to press play. A page whose view the reader has turned is left so when a record is played again.
        Raises `InputError` for a record of another robot or without rows.
        """
        if rollout.robot.name != self.robot.name:
            raise InputError(f"this viewer shows {self.robot.name}, but the record is one of {rollout.robot.name}.")
        if not len(rollout.time):
            raise InputError("the record has no rows, so there is nothing to play.")
        rows = recording.thinned(rollout.time, positive("rate", rate, "1/s"))
        pictures = [
            self.painter.picture(
                State(self.robot, rollout.q[i], rollout.v[i]),
                rollout.contacts,
                rollout.measured[i],
                rollout.planned[i] if planned and np.isfinite(rollout.planned[i]).all() else None,
                com=com, cones=cones, support=support, ghost=ghost, push=recording.push_at(rollout, i),
                lifted=recording.lifted_at(rollout, i),
            )
            for i in rows
        ]  # fmt: skip
        self.play_pictures(rollout.time[rows], pictures, speed=speed, paused=paused, title=title, ghost_name=ghost_name)
        self._last = State(self.robot, rollout.q[rows[0]], rollout.v[rows[0]])
        self.canvas.set(*self._looking(View(), follow))
        return self

    def play_pictures(
        self, times: npt.ArrayLike, pictures: Sequence[Picture], *, speed: float = 1.0, paused: bool = False,
        title: str | None = None, ghost_name: str = GHOST_NAME,
    ) -> Viewer:  # fmt: skip
        """Play pictures, from `painter.picture` or your own items, picture i from times[i], s, on."""
        moving = recording.animate(times, pictures, ROOT, positive("speed", speed), paused)
        self.draw(moving.first, title)
        self._caption(set[str]().union(*map(kinds, pictures)), title, ghost_name)
        self.window.put([moving.command])
        self._moving = True
        return self

    def camera(self, view: str | View = "default", follow: bool = False) -> Viewer:
        """Look from a preset ("default", "front", "back", "left", "right", "top", "feet") or from a `View`.

        follow: go with the robot when it walks away. Every call moves the pages there, also those whose view the reader has
        turned: what is called at every move of a slider should leave the camera alone. Raises `InputError` for another name.
        """
        if isinstance(view, str) and view in PRESETS:
            view = PRESETS[view]
        if not isinstance(view, View):
            raise InputError(f"camera view is {view!r}; it must be one of {', '.join(PRESETS)}, or a View.")
        self.canvas.set_again(*self._looking(view, follow))
        return self

    def _looking(self, view: View, follow: bool) -> tuple[wire.Update, wire.Update]:
        """The page's settings for a view of the robot where it is now."""
        low, high = self.painter.feet_box if view.feet else self.painter.box
        moved = np.zeros(3)
        if self._last is not None:
            moved[:2] = self._last.com[:2] - self.painter.home.com[:2]
        target, eye = eye_and_target(view, low + moved, high + moved)
        base = f"{ROOT}robot/{self.robot.model.names[1]}" if follow and self.robot.is_floating else ""
        return wire.set_camera(eye, target, view.angle), wire.page_command("set_follow", node=base)

    def save(self, path: str | Path, title: str | None = None) -> Path:
        """Write the scene, still or moving, as one HTML file that needs neither server nor network; return its path.

        Raises `ViewerError` when nothing is drawn yet, for a name that is not one of a web page, and when it cannot be written.
        """
        target = Path(path)
        if self.window.scene.is_empty:
            raise ViewerError("nothing is drawn yet, so there is nothing to save; call show(state) or play(rollout) first.")
        if target.suffix.lower() not in (".html", ".htm"):
            raise ViewerError(f"cannot save {target.name!r}: the scene is saved as a web page; end the name in .html.")
        try:
            target.write_text(self.static_html(title), encoding="utf-8")
        except OSError as error:
            raise ViewerError(f"cannot write {target} ({error.strerror}); choose a folder that exists.") from None
        return target

    def static_html(self, title: str | None = None) -> str:
        """The scene as it is now, as a page that needs neither server nor network."""
        return page.file_page(self.window.scene.file_commands(), title or self.robot.name)

    def slider(
        self, name: str, changed: Callable[[float], None], value: float, low: float, high: float, step: float = 0.01
    ) -> None:
        """A slider in the page's own panel; `changed(value)` is called, in the window's thread, when it is moved."""
        self._control(name, changed, value=float(value), min=float(low), max=float(high), step=float(step))

    def button(self, name: str, pressed: Callable[[], None]) -> None:
        """A button in the page's own panel; `pressed()` is called, in the window's thread."""
        self._control(name, lambda _: pressed())

    def checkbox(self, name: str, changed: Callable[[bool], None], value: bool) -> None:
        """A box to tick in the page's own panel; `changed(value)` is called, in the window's thread."""
        self._control(name, changed, value=bool(value))

    def close(self) -> None:
        """Close the window: its thread ends and its port is free."""
        self.window.close()

    def _repr_html_(self) -> str:
        name, style = html.escape(self.robot.name), f"width: 100%; height: {self.height}px; border: 0; border-radius: 6px"
        frame = f'title="{name}" style="{style}"'
        if kernel_is_remote() or not self.window.is_open:
            return f'<iframe srcdoc="{html.escape(self.static_html())}" {frame}></iframe>'
        address = self.window.open_display()
        return f'<iframe src="{address}" {frame}></iframe>' + _PROBE.replace("URL", address)

    def __repr__(self) -> str:
        return f"Viewer({self.robot.name}, {self.url}{'' if self.window.is_open else ', closed'})"

    def _control(self, name: str, used: Callable[[Any], None], **range_of_values: float) -> None:
        self._controls[name] = used
        controls = self._controls  # not self: the window must not keep its viewer alive
        self.window.on_control(lambda which, value: controls[which](value) if which in controls else None)
        self.window.put([wire.set_control(name, **range_of_values)])

    def _set_stage(self, background: str) -> None:
        """Background; the page's own grid and axes go."""
        top, bottom = BACKGROUNDS[background][:2]
        self.canvas.set(
            wire.set_property("/Background", "top_color", list(top)),
            wire.set_property("/Background", "bottom_color", list(bottom)),
            wire.set_property("/Grid", "visible", False),
            wire.set_property("/Axes", "visible", False),
            wire.page_command("set_theme", name=background),
        )

    def _caption(self, shown: set[str], title: str | None, ghost_name: str) -> None:
        """Title, and what the colours in the picture mean."""
        own = {"push": self.painter.text}
        items = [
            [hexadecimal(own.get(kind, colour)), ghost_name if kind == "ghost" else text]
            for kind, colour, text in LEGEND
            if kind in shown
        ]
        self.canvas.set(wire.page_command("set_title", text=title or ""), wire.page_command("set_legend", items=items))


def _plane(ground: npt.ArrayLike | None) -> Plane | None:
    """The plane through the origin with this normal."""
    if ground is None:
        return None
    x, y, z = (float(c) for c in unit_vector("ground", ground))
    if z < STEEPEST:
        raise InputError(f"ground is {[x, y, z]}; the normal of the ground must point up, not along it or down.")
    return Plane((x, y, z))
