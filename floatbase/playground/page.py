"""`Playground`: the page of `python -m floatbase view`, and the same in a notebook."""

from __future__ import annotations

import math
import threading
from contextlib import suppress
from dataclasses import asdict, replace
from typing import Any

import numpy as np

import floatbase as fb
from floatbase.errors import ViewerError
from floatbase.lessons import static_export
from floatbase.playground.cards import Card, Judge
from floatbase.playground.equation import SYMBOLS
from floatbase.playground.pace import Pace
from floatbase.playground.panel import Panel
from floatbase.playground.session import PERIOD, Session
from floatbase.playground.settings import Settings
from floatbase.playground.terms import arrows
from floatbase.robots import Robot
from floatbase.simulation import ACTIVE_STATUSES, PUSH_DISPLAY_TIME, LiveSimulation, status_message
from floatbase.viewer import Picture
from floatbase.viewer.export.display_mode import display_mode
from floatbase.viewer.export.recording import push_at

_STILL = "The playground needs the live lesson: here its robot stands still."
_SHOWN = ("forces", "cones")  # terms that are drawn at first


class Playground:
    """A robot on the physics, everything about it that a controller may know or mistake, and challenges to solve with it.

    In a notebook, as the last line of a cell, it displays itself. Elsewhere, open `playground.url` in a browser.

    robot: as from `fb.load`.
    settings: those at first.
    background: "white", "light" or "dark".
    height: of the picture in a notebook, pixels.
    port: of the page; 0 for a free one, opened once `url` is asked for.
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
        self.robot = robot
        facets = 4 if robot.feet else None
        self.view = fb.Viewer(robot, background=background, port=port, facets=facets, follow=True, height=height)
        self.session = Session(robot, settings)
        self._first = self.session.settings
        self.force, self.towards = self._gentle, 0.0  # N, and degrees: 0 forwards, 90 to the left
        self.pushed = "base" if robot.is_floating else robot.model.frames[-1].name  # of an arm its tip
        self.outcome = ""
        self.card: Card | None = None
        self.judge: Judge | None = None
        self._last_push: fb.Push | None = None
        self.shown = {term: term in _SHOWN for term in SYMBOLS}
        self._waits = False  # for the reader to press run, after the next slice
        self._requested: dict[str, Any] = {}
        self._lock = threading.Lock()  # over what is requested
        self._drawing = threading.Lock()  # the run draws, and so does who pauses it
        session = self.session
        self.run = LiveSimulation(
            session.sim, session.controller, self._show, control_period=PERIOD, actuators=session.actuators,
            after_reset=self._restart,
        )  # fmt: skip
        self.run.on_status(self._tell)
        self.pace = Pace()
        self.view.set_ground(session.sim.ground)
        self._panel = Panel(self)
        self._write()

    @property
    def url(self) -> str:
        """Address of the page, which has no port before this is asked for."""
        return self.view.url

    @property
    def _gentle(self) -> float:
        """The push at first, N."""
        return 0.1 * self.robot.weight

    def start(self) -> Playground:
        """Show the robot and let it run."""
        self.view.show(self.session.sim.state)
        self.run.start()
        return self

    def close(self) -> None:
        """End the run and close the page."""
        self.run.close()
        self.view.close()

    def push(self, force: float | None = None, towards: float | None = None) -> None:
        """Push the robot for a tenth of a second.

        force: N; towards: degrees, from forwards to the left; both are as set before where they are not given.
        """
        self.force = self.force if force is None else force
        self.towards = self.towards if towards is None else towards
        angle = math.radians(self.towards)
        force_now = self.force * np.array([math.cos(angle), math.sin(angle), 0.0])
        self._last_push = fb.Push(force_now, frame=self.pushed)
        self.run.push(self._last_push.force, frame=self.pushed)
        self._write()

    def set(self, **changes: Any) -> None:
        """Change settings, fields of `Settings`; the run takes them over before its next slice.

        Raises `TypeError` for a name that is none.
        """
        replace(self.session.settings, **changes)
        with self._lock:
            waiting = bool(self._requested)
            self._requested |= changes
        if not self.run.is_simulating:
            self.run.close()  # its last slice may still go on
            self._take_over()
        elif not waiting:
            self.run.call_soon(self._take_over)

    def nod(self, size: float) -> None:
        """Let the base describe an ellipse in pitch and yaw; one under way keeps its phase. size: rad, half its width."""
        wanted = self.wanted
        self.set(nod=size, begin=wanted.begin if wanted.nod else self.session.sim.time)

    def choose(self, card: Card | None) -> None:
        """Begin a challenge, or play freely."""
        self.card, self.judge = card, None if card is None else card.judge()
        self._restart_with(self._first if card is None else card.start)
        self._write()

    def undo(self) -> None:
        """Set everything as it was at first, the push, the speed and what is shown too, and put the robot back on its feet."""
        self.force, self.towards, self._last_push = self._gentle, 0.0, None
        self.shown |= {term: term in _SHOWN for term in SYMBOLS}
        self.run.set_time_scale(1.0)
        self._panel.follow_looks(1.0)
        self._restart_with(self._first if self.card is None else self.card.start)

    def _restart_with(self, settings: Settings) -> None:
        """Put the robot back on its feet under these settings."""
        with self._lock:
            self._requested = {}
        self.run.call_soon(lambda: self._begin(settings))
        self.run.reset()

    def _begin(self, settings: Settings) -> None:
        self.session.change(**asdict(settings))
        self._panel.follow(self.session.settings)
        self._hand_over()
        self._write()

    def _take_over(self) -> None:
        """Change what was requested, and hand it to the run."""
        with self._lock:
            changes, self._requested = self._requested, {}
        if not changes:
            return
        restarted = self.session.change(**changes)
        self._hand_over()
        self._write()
        if restarted:
            self.run.reset()

    def _hand_over(self) -> None:
        session = self.session
        self.run.set_controller(session.controller, sim=session.sim, actuators=session.actuators, control_period=PERIOD)
        self.view.set_ground(session.sim.ground)  # the true one, whatever the controller believes
        if self.view.painter.facets not in (None, session.settings.facets):
            self.view.painter = self.view.painter.replace(facets=session.settings.facets)

    def _restart(self) -> None:
        """After a reset of the simulation, in the run's thread."""
        self.session.restart()
        self._waits = self.card is not None and self.card.paused
        card = self.card
        if card is not None:
            self.judge = card.judge()
        self._hand_over()

    @property
    def wanted(self) -> Settings:
        """The settings with what is still requested."""
        with self._lock:
            return replace(self.session.settings, **self._requested)

    def show_term(self, term: str, shown: bool) -> None:
        self.shown[term] = shown
        if self.run.status != "running":
            self._draw_again()

    def _write(self) -> None:
        """The texts of the panel: the challenge, and the program."""
        judge = self.judge  # a challenge may be chosen meanwhile
        with suppress(ViewerError):
            if judge is not None:
                self.view.add_text("card", f"{judge.card.text}\n{judge.says}")
            elif self.robot.is_floating:
                self.view.add_text("card", "")
            code = self.session.settings.code(self.robot, PERIOD, self._last_push)
            self.view.add_text("code", code, "as Python", code=True)

    def _tell(self, status: str) -> None:
        """Show what stopped the run, if anything did, over the last picture."""
        self.outcome = "" if status == "running" else status_message(status)
        judge = self.judge
        if judge is not None and status not in ACTIVE_STATUSES:
            judge.ended(status, self.session)
            self._write()
        self._draw_again()

    def _draw_again(self) -> None:
        with suppress(ViewerError):  # the window may be closed already
            if self.session.last is not None:
                self._draw(self.session.last)

    def _show(self, record: fb.Rollout) -> None:
        """What the run hands over: draw it, and judge it."""
        self.session.see(record)
        judge = self.judge  # a challenge may be chosen or left meanwhile
        if judge is not None and self.run.status == "running":  # who has fallen is only drawn
            before = judge.says
            judge.see(record, self.session)
            if judge.says != before:
                self._write()
        self._draw(record)
        if self._waits:
            self._waits = False
            self.run.pause()
        if self.robot.is_floating:
            self.view.add_plot_point("planned and measured forces differ by", float(record.time[-1]), gap(record), "N")

    def _draw(self, record: fb.Rollout) -> None:
        """The last row of a slice, under the time, the part of real time that this machine reaches, and messages."""
        now, session = float(record.time[-1]), self.session
        with self._drawing:
            speed = self.pace.update(now)
            pace = "" if speed is None else f", {speed:.0%} of real time"
            gait = f", {session.settings.gait}" if session.settings.gait else ""
            headline = f"{self.robot.name}{gait}, {now:.1f} s{pace}, control every {1e3 * PERIOD:g} ms"
            self.view.show(
                record.final, record.contacts, record.measured[-1], _planned(record), push=push_at(record, -1, PUSH_DISPLAY_TIME),
                cones=self.shown["cones"], arrows=self.shown["forces"], support=True, extra=self._extra(record),
                title="\n".join(filter(None, [headline, self.outcome, session.note])),
            )  # fmt: skip

    def _extra(self, record: fb.Rollout) -> Picture:
        """Arrows of the terms, and marks of a walk."""
        picture: Picture = {}
        settings = self.session.settings
        for term, shown in self.shown.items():
            if shown:
                picture |= arrows(term, record, self.view.scale, self.view.painter.size, settings.true_off, settings.mass[1])
        walk = self.session.walk
        return picture if walk is None else picture | dict(self.view.walk_overlay(walk, record.final))

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        if display_mode() == "site":
            self.view.show(self.session.sim.state, self.session.sim.feet)
            return static_export.StaticExport([self.view], words=_STILL).bundle()
        return self.start().view._repr_mimebundle_(**kwargs)

    def __repr__(self) -> str:
        address = f", {self.url}" if self.view.window.is_listening else ""
        return f"Playground({self.robot.name}{address})"


def playground(robot: Robot | str = "go2", settings: Settings | None = None) -> Playground:
    """A playground for a notebook. robot: as from `fb.load`, or its name. settings: those at first."""
    return Playground(fb.load(robot) if isinstance(robot, str) else robot, settings)


def gap(record: fb.Rollout) -> float:
    """Planned less measured forces: the length of the difference, N, added over the contacts, on average over a record."""
    if not len(record) or not record.planned.size:
        return 0.0
    off = np.linalg.norm((record.planned - record.measured).reshape(len(record), -1, 3), axis=2).sum(axis=1)
    return float(np.nanmean(off)) if np.isfinite(off).any() else 0.0


def _planned(record: fb.Rollout) -> Any:
    """The planned forces at the last row, None where there are none."""
    return record.planned[-1] if np.isfinite(record.planned[-1]).all() else None
