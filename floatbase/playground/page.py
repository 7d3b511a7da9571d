"""`Playground`: the page of `floatbase view`, also shown in notebooks."""

from __future__ import annotations

import math
import time
from contextlib import suppress
from dataclasses import asdict, replace
from typing import Any

import numpy as np

import floatbase as fb
from floatbase._locks import InterruptibleLock
from floatbase._validation import as_bool, as_instance, as_number, as_positive
from floatbase.errors import FloatbaseError, ViewerError, unknown_name
from floatbase.live.settings import SETTINGS, push_settings
from floatbase.playground import build
from floatbase.playground.challenges import Challenge, Judge
from floatbase.playground.equation import EQUATION
from floatbase.playground.limits import limit_text
from floatbase.playground.panel import Panel
from floatbase.playground.real_time_factor import RealTimeFactor
from floatbase.playground.session import PERIOD, Session
from floatbase.playground.settings import SETTING_NAMES, Settings
from floatbase.playground.term_arrows import term_arrows
from floatbase.robots import Robot
from floatbase.simulation import ACTIVE_STATUSES, LiveSimulation
from floatbase.viewer import PUSH_DISPLAY_TIME, Picture, status_message
from floatbase.viewer.export.display_mode import MIMEBUNDLES, display_mode
from floatbase.viewer.export.recording import joint_limits_at, push_at

_SITE_NOTE = "The playground runs only in the live lesson. Here its robot stands still."
_AIRBORNE_HEIGHT = 1.2  # times the height of the standing centre of mass
_SAME_CHANGE_TIME = 1.0  # s between two changes of the same fields that `undo` treats as one
_MAX_HISTORY = 100  # changes that `undo` remembers


class Playground:
    """A live simulated robot with controls for its model, its physics and its controller.

    The playground also offers challenges. In a notebook, it displays itself as the last line of a
    cell. Elsewhere, open `playground.url` in a browser.

    Parameters
    ----------
    robot : Robot
        Robot, as from `fb.load`.
    settings : Settings, optional
        Initial settings.
    background : {"white", "light", "dark"}, optional
        Background of the picture.
    height : int, optional
        Height of the picture in a notebook [pixels].
    port : int, optional
        Port of the page; 0 selects a free one when `url` is first read.

    Raises
    ------
    FloatbaseError
        If an argument has the wrong type, or if the settings do not fit the robot.
    """

    def __init__(
        self,
        robot: Robot,
        settings: Settings | None = None,
        *,
        background: str = "light",
        height: int = 640,
        port: int = 0,
    ):
        self.robot = as_instance("robot", robot, Robot)
        facets = 4 if robot.feet else None
        self.view = fb.Viewer(
            robot, background=background, port=port, facets=facets, follow=True, height=height
        )
        self.session = Session(robot, settings)
        self._initial_settings = self.session.settings
        self.push_settings = push_settings(robot.weight)
        # N; degrees: 0 is forwards, 90 to the left; s
        self.force, self.towards, self.duration = self._first_push
        # of an arm, its tip
        self.pushed_frame = "base" if robot.is_floating else robot.model.frames[-1].name
        self.outcome = ""
        self.challenge: Challenge | None = None
        self.judge: Judge | None = None
        self.last_push: fb.Push | None = None
        self.shown_terms = {term.name: term.is_shown for term in EQUATION}
        self._pause_after_slice = False  # then the user must press run
        self._history: list[Settings] = []  # what `undo` restores, the last one first
        self._last_change: tuple[frozenset[str], float] = (frozenset(), -math.inf)  # fields, time
        self._requested: dict[str, Any] = {}
        self._applying: dict[str, Any] = {}  # what is being applied now
        self._lock = InterruptibleLock()  # protects the requests
        self._drawing_lock = InterruptibleLock()  # the run and a thread that pauses it both draw
        session = self.session
        self.run = LiveSimulation(
            session.sim, session.controller, self._on_slice, control_period=PERIOD,
            actuators=session.actuators,
            after_reset=self._after_reset, push_memory=PUSH_DISPLAY_TIME,
        )  # fmt: skip
        self.run.on_status(self._on_status)
        self.real_time_factor = RealTimeFactor()
        self.view.set_ground(session.sim.ground)
        self._panel = Panel(self)
        self._update_text()

    @property
    def url(self) -> str:
        """Address of the page. The page has no port before this is read."""
        return self.view.url

    def start(self) -> Playground:
        """Show the robot and start the run.

        Returns
        -------
        Playground
            The playground itself.
        """
        self.view.show(self.session.sim.state)
        self.run.start()
        return self

    def close(self) -> None:
        """Stop the run and close the page."""
        self.run.close()
        self.view.close()

    def push(
        self,
        force: float | None = None,
        towards: float | None = None,
        duration: float | None = None,
    ) -> None:
        """Push the robot, by default with the values that were set last.

        Parameters
        ----------
        force : float, optional
            Horizontal force [N].
        towards : float, optional
            Direction of the push [degrees]: 0 is forward, 90 to the left.
        duration : float, optional
            Duration of the push [s].

        Raises
        ------
        InputError
            If an argument is not a number, or if the duration is not positive.
        """
        size = as_number("force", self.force if force is None else force, "N")
        angle = as_number("towards", self.towards if towards is None else towards, "degrees")
        lasting = as_positive("duration", self.duration if duration is None else duration, "s")
        self.force, self.towards, self.duration = size, angle, lasting
        self.last_push = fb.Push.horizontal(size, angle, duration=lasting, frame=self.pushed_frame)
        self.run.push(self.last_push.force, lasting, self.pushed_frame)
        self._update_text()

    def set(self, **changes: Any) -> None:
        """Change settings; the run adopts them before its next slice.

        Parameters
        ----------
        **changes
            New values of fields of `Settings`.

        Raises
        ------
        UnknownNameError
            If a name is not a setting, or a value is not a known name.
        InputError
            If a value is not allowed.
        """
        for name in changes:
            if name not in SETTING_NAMES:
                raise unknown_name("setting", name, SETTING_NAMES)
        replace(self.session.settings, **changes)
        self._remember_before(frozenset(changes))
        self._request(changes)

    def undo(self) -> None:
        """Undo the last change of the settings since the last reset of everything.

        Changes of the same fields in quick succession, as while a slider moves, are one change.
        """
        present = self.pending_settings
        while self._history:
            former = self._history.pop()
            self._last_change = (frozenset(), -math.inf)
            if former != present:
                self._request(asdict(former))
                self._panel.show_settings(former)
                return

    @property
    def _first_push(self) -> tuple[float, ...]:
        """Initial force, direction and duration of a push."""
        return tuple(row.first for row in self.push_settings.values())

    def _remember_before(self, fields: frozenset[str]) -> None:
        """Store the settings before a change of these fields, unless the change continues one."""
        now = time.monotonic()
        last_fields, last_time = self._last_change
        if fields != last_fields or now - last_time > _SAME_CHANGE_TIME:
            self._history = [*self._history, self.pending_settings][-_MAX_HISTORY:]
        self._last_change = (fields, now)

    def _request(self, changes: dict[str, Any]) -> None:
        """Let the run apply changes before its next slice, or now if it is not running."""
        with self._lock:
            waiting = bool(self._requested)
            self._requested |= changes
        if not self.run.is_simulating:
            self.run.close()  # its last slice may still be running
            self._apply_requested()
        elif not waiting:
            self.run.call_soon(self._apply_requested)

    def set_nodding(self, size: float) -> None:
        """Move the base on an ellipse in pitch and yaw; a motion under way keeps its phase.

        Parameters
        ----------
        size : float
            Half the width of the ellipse [rad]; 0 stops the motion.
        """
        pending = self.pending_settings
        self.set(nod=size, start_time=pending.start_time if pending.nod else self.session.sim.time)

    def start_challenge(self, challenge: Challenge | None) -> None:
        """Start a challenge, or return to free play.

        Parameters
        ----------
        challenge : Challenge or None
            Challenge to start; None for free play.

        Raises
        ------
        InputError
            If the challenge has the wrong type.
        """
        if challenge is not None:
            as_instance("challenge", challenge, Challenge, "CHALLENGES[0]")
        self.challenge, self.judge = challenge, None if challenge is None else challenge.judge()
        self._restart_with(self._initial_settings if challenge is None else challenge.start)
        self._update_text()

    def reset_all(self) -> None:
        """Restore the initial settings, push, speed and displayed terms, and reset the robot.

        During a challenge, its initial settings are restored.
        """
        self.force, self.towards, self.duration = self._first_push
        self.last_push = None
        self.shown_terms |= {term.name: term.is_shown for term in EQUATION}
        self.run.set_time_scale(1.0)
        self._panel.show_view_settings(1.0)
        self._restart_with(
            self._initial_settings if self.challenge is None else self.challenge.start
        )

    def _restart_with(self, settings: Settings) -> None:
        """Put the robot back on its feet with these settings."""
        with self._lock:
            self._requested = {}
        self._history, self._last_change = [], (frozenset(), -math.inf)
        self.run.call_soon(lambda: self._start_with(settings))
        self.run.reset()

    def _start_with(self, settings: Settings) -> None:
        """Apply these settings and show them at the controls."""
        with self._lock:
            self._applying = asdict(settings)
        self._change()
        self._panel.show_settings(self.pending_settings)
        self._update_run()
        self._update_text()

    def _apply_requested(self) -> None:
        """Apply the requested changes and pass them to the run."""
        with self._lock:
            if not self._requested:
                return
            self._applying, self._requested = self._requested, {}
        restarted = self._change()
        self._update_run()
        self._update_text()
        if restarted:
            self.run.reset()

    def _change(self) -> bool:
        """Change the session, and return whether the robot was put back on its feet."""
        session = self.session
        try:
            wanted = replace(session.settings, **self._applying)
            self.view.set_ground(build.ground(wanted))  # before anything else changes
            return session.change(**self._applying)
        except FloatbaseError as error:
            session.refusal = str(error)
            return False
        finally:
            with self._lock:
                self._applying = {}

    def _update_run(self) -> None:
        """Pass the session's controller, simulation and ground to the run and the viewer."""
        session = self.session
        self.run.set_controller(
            session.controller, sim=session.sim, actuators=session.actuators, control_period=PERIOD
        )
        self.view.set_ground(session.sim.ground)  # the actual one, whatever the controller assumes
        if self.view.painter.facets not in (None, session.settings.facets):
            self.view.painter = self.view.painter.replace(facets=session.settings.facets)

    def _after_reset(self) -> None:
        """Update session and judge after a reset of the simulation, in the run's thread."""
        self.session.after_reset()
        self._pause_after_slice = self.challenge is not None and self.challenge.paused
        challenge = self.challenge
        if challenge is not None:
            self.judge = challenge.judge()
        self._update_run()

    @property
    def pending_settings(self) -> Settings:
        """Settings including changes that are requested or being applied."""
        with self._lock:
            return replace(self.session.settings, **self._applying | self._requested)

    def show_term(self, term: str, shown: bool) -> None:
        """Show or hide the arrows of a term.

        Parameters
        ----------
        term : str
            Name of a term of `EQUATION`.
        shown : bool
            Whether to draw it.

        Raises
        ------
        UnknownNameError
            If there is no such term.
        """
        if not isinstance(term, str) or term not in self.shown_terms:
            raise unknown_name("term", term, self.shown_terms)
        self.shown_terms[term] = as_bool("shown", shown)
        if self.run.status != "running":
            self._redraw()

    def _update_text(self) -> None:
        """Update the text in the panel: the challenge and the program."""
        judge = self.judge  # another thread may change the challenge
        with suppress(ViewerError):
            if judge is not None:
                self.view.add_text("challenge", f"{judge.challenge.text}\n{judge.message}")
            elif self.robot.is_floating:
                self.view.add_text("challenge", "")
            if self._panel.has_gaits:
                section = SETTINGS["gait"].section
                self.view.add_text("speed limit", self.session.speed_limit, section)
            self.view.add_text(
                "code", self.session.code(self.last_push), "Python program", code=True
            )

    def _on_status(self, status: str) -> None:
        """Show the reason why the run stopped, over the last picture."""
        shown = "left the ground" if status == "fell" and self._is_airborne else status
        self.outcome = "" if status == "running" else status_message(shown, self.run.reason)
        judge = self.judge
        if judge is not None and status not in ACTIVE_STATUSES:
            judge.run_ended(": ".join(filter(None, [status, self.run.reason])), self.session)
            self._update_text()
        self._redraw()

    @property
    def _is_airborne(self) -> bool:
        """Whether the robot is above its standing height and nothing touches the ground."""
        last = self.session.last
        if last is None or not len(last) or last.measured[-1].any():
            return False
        ground = self.view.painter.drawn_ground
        height, standing = (
            state.com[2] - ground.height(state.com) for state in (last.final, self.session.home)
        )
        return bool(height > _AIRBORNE_HEIGHT * standing)

    def _redraw(self) -> None:
        """Draw the last record again."""
        with suppress(ViewerError):  # the window may be closed already
            if self.session.last is not None:
                self._draw(self.session.last)

    def _on_slice(self, record: fb.Rollout) -> None:
        """Draw and judge a slice of the run."""
        self.session.observe(record)
        judge = self.judge  # another thread may change the challenge
        if judge is not None and self.run.status == "running":  # after a fall, only draw
            before = judge.message
            judge.observe(record, self.session)
            if judge.message != before:
                self._update_text()
        self._draw(record)
        if self._pause_after_slice:
            self._pause_after_slice = False
            self.run.pause()
        if self.robot.is_floating:
            name, unit = SETTINGS["force_error"].name, SETTINGS["force_error"].unit
            error = mean_force_error(record)
            self.view.add_plot_point(name, float(record.time[-1]), error, unit)

    def _draw(self, record: fb.Rollout) -> None:
        """Draw the last row of a slice, and say in the title what limits the robot."""
        now, session = float(record.time[-1]), self.session
        with self._drawing_lock:
            factor = self.real_time_factor.update(now)
            rate = "" if factor is None else f", {factor:.2f} × real time"
            self.view.add_text(
                "state", f"{self.robot.name}, {now:.1f} s{rate}, control step {1e3 * PERIOD:g} ms"
            )
            said = [self.outcome or limit_text(record, session.settings), session.refusal]
            self.view.show(
                record.final, record.contacts, record.measured[-1], _last_planned_forces(record),
                push=push_at(record, -1, PUSH_DISPLAY_TIME), **joint_limits_at(record, -1),
                cones=self.shown_terms["cones"], arrows=self.shown_terms["forces"], support=True,
                extra=self._term_arrows(record),
                title="\n".join(filter(None, said)),
            )  # fmt: skip

    def _term_arrows(self, record: fb.Rollout) -> Picture:
        """Return the arrows of the displayed terms, and the overlay of a walk."""
        picture: Picture = {}
        settings = self.session.settings
        for term, shown in self.shown_terms.items():
            if shown:
                picture |= term_arrows(
                    term,
                    record,
                    self.view.scale,
                    self.view.painter.size,
                    settings.actual_off,
                    settings.mass[1],
                )
        walk = self.session.walk
        return (
            picture if walk is None else picture | dict(self.view.walk_overlay(walk, record.final))
        )

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        if (bundle := MIMEBUNDLES.get(display_mode())) is not None:
            self.view.show(self.session.sim.state, self.session.sim.feet)
            return bundle(self.view, words=_SITE_NOTE)
        return self.start().view._repr_mimebundle_(**kwargs)

    def __repr__(self) -> str:
        address = f", {self.url}" if self.view.window.is_listening else ""
        return f"Playground({self.robot.name}{address})"


def playground(robot: Robot | str = "go2", settings: Settings | None = None) -> Playground:
    """Make a playground for a notebook.

    Parameters
    ----------
    robot : Robot or str, optional
        Robot as from `fb.load`, or its name.
    settings : Settings, optional
        Initial settings.

    Returns
    -------
    Playground
        The playground, which displays itself.

    Raises
    ------
    FloatbaseError
        If an argument has the wrong type, or if there is no such robot.
    """
    return Playground(fb.load(robot) if isinstance(robot, str) else robot, settings)


def mean_force_error(record: fb.Rollout) -> float:
    """Return the mean difference between planned and measured contact forces of a record.

    Parameters
    ----------
    record : Rollout
        Record of a run.

    Returns
    -------
    float
        Length of the difference, summed over the contact points and averaged over time [N].
    """
    if not len(as_instance("record", record, fb.Rollout)) or not record.planned.size:
        return 0.0
    off = np.linalg.norm(
        (record.planned - record.measured).reshape(len(record), -1, 3), axis=2
    ).sum(axis=1)
    return float(np.nanmean(off)) if np.isfinite(off).any() else 0.0


def _last_planned_forces(record: fb.Rollout) -> Any:
    """Return the planned forces of the last row, or None if there are none."""
    return record.planned[-1] if np.isfinite(record.planned[-1]).all() else None
