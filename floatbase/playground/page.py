"""`Playground`: the page of `python -m floatbase view`, and the same in a notebook."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, replace
from functools import partial
from typing import Any

import numpy as np

import floatbase as fb
from floatbase.errors import ViewerError
from floatbase.playground.cards import CARDS, Card, Judge
from floatbase.playground.session import Session
from floatbase.playground.settings import GAITS, IDEAL, Settings
from floatbase.playground.terms import SYMBOLS, arrows
from floatbase.robots import Robot
from floatbase.simulation import SEEN, Live, advice
from floatbase.viewer import Picture, published, push_at

_HARDEST = 2.5  # times the weight: a push that asks for steps
_PAIRS = {  # name: (attribute, low, high, step)
    "friction": ("friction", 0.05, 1.5, 0.05),
    "slope [°]": ("slope", -30.0, 30.0, 1.0),
    "mass [×]": ("mass", 0.5, 2.0, 0.05),
    "motors [Hz]": ("bandwidth", 1.0, IDEAL, 1.0),
}
_OFF = {  # term: (switch in the belief, switch in the world)
    "gravity": ("gravity believed", "gravity in the world"),
    "velocity": ("Coriolis and centrifugal forces believed", "Coriolis and centrifugal forces in the world"),
    "drift": ("drift of the contacts believed", ""),
    "forces": ("force of one leg believed", "force of one leg in the world"),
    "zeros": ("zeros of S believed", "zeros of S in the world"),
    "cones": ("feet that cannot pull believed", "feet that cannot pull in the world"),
}
_WEIGHTS = ("motion", "posture", "effort")
_FREE = "play freely"
_STILL = "The playground needs the live lesson: here its robot stands still."


class Playground:
    """A robot on the physics, everything about it that a controller may know or mistake, and challenges to solve with it.

    In a notebook, as the last line of a cell, it displays itself. Elsewhere, open `playground.url` in a browser.

    robot: as from `fb.load`.
    settings: those at first.
    background: "white", "light" or "dark".
    height: of the picture in a notebook, pixels.
    port: of the page; 0 for a free one.
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
        self.force, self.towards = 0.1 * robot.weight, 0.0  # N, and degrees: 0 forwards, 90 to the left
        self.pushed = "base" if robot.is_floating else robot.model.frames[-1].name  # of an arm its tip
        self.outcome = ""
        self.card: Card | None = None
        self.judge: Judge | None = None
        self._last_push: fb.Push | None = None
        self._shown: dict[str, bool] = dict.fromkeys(SYMBOLS, False) | {"forces": True, "cones": True}
        self._requested: dict[str, Any] = {}
        self._lock = threading.Lock()  # over what is requested
        self._drawing = threading.Lock()  # the run draws, and so does who pauses it
        session = self.session
        self.run = Live(
            session.sim, session.controller, self._show, control_period=session.period, actuators=session.actuators,
            after_reset=self._restart,
        )  # fmt: skip
        self.run.on_status(self._tell)
        self.pace = Pace()
        self.view.stand_on(session.sim.ground)
        self._add_controls()
        self._write()

    @property
    def url(self) -> str:
        """Address of the page."""
        return self.view.url

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
        if not self.run.moves:
            self.run.close()  # its last slice may still go on
            self._take_over()
        elif not waiting:
            self.run.soon(self._take_over)

    def choose(self, card: Card | None) -> None:
        """Begin a challenge, or play freely."""
        self.card, self.judge = card, None if card is None else card.judge()
        self._restart_with(self._first if card is None else card.start)
        self._write()

    def undo(self) -> None:
        """Set everything as it was at first, and put the robot back on its feet."""
        self._restart_with(self._first if self.card is None else self.card.start)

    def _restart_with(self, settings: Settings) -> None:
        """Put the robot back on its feet under these settings."""
        with self._lock:
            self._requested = {}
        self.run.soon(lambda: self._begin(settings))
        self.run.reset()

    def _begin(self, settings: Settings) -> None:
        self.session.change(**asdict(settings))
        self._follow_settings()
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
        self.run.use(session.controller, sim=session.sim, actuators=session.actuators, control_period=session.period)
        self.view.stand_on(session.sim.ground)  # the true one, whatever the controller believes
        if self.view.painter.facets not in (None, session.settings.facets):
            self.view.painter = self.view.painter.replace(facets=session.settings.facets)

    def _restart(self) -> None:
        """After a reset of the simulation, in the run's thread."""
        self.session.restart()
        card = self.card
        if card is not None:
            self.judge = card.judge()
        self._hand_over()

    def _add_controls(self) -> None:
        view, weight, s = self.view, self.robot.weight, self.session.settings
        view.button("run", self.run.start)
        view.button("pause", self.run.pause)
        view.button("reset", self.run.reset)
        view.button("push", self.push)
        view.button("all as at first", self.undo)
        view.slider("speed", self.run.slow_motion, 1.0, 0.05, 1.0, 0.05)
        view.slider("push [N]", partial(setattr, self, "force"), self.force, 0.0, _HARDEST * weight, 1.0)
        view.slider("towards [°]", partial(setattr, self, "towards"), self.towards, -180.0, 180.0, 5.0)
        if not self.robot.is_floating:
            return
        self._add_cards()
        for name, (attribute, low, high, step) in _PAIRS.items():
            for i, column in enumerate(("believed", "true")):
                value, changed = getattr(s, attribute)[i], partial(self._set_part, attribute, i)
                view.slider(f"{name} {column}", changed, value, low, high, step, "believed and true", column)
        self._add_stance()
        self._add_walk()
        where = "its quadratic program"
        view.slider("facets", lambda n: self.set(facets=round(n)), s.facets, 3, 16, 1, where)
        view.slider("torque limits [×]", lambda x: self.set(torque=x), s.torque, 0.05, 1.0, 0.05, where)
        view.slider("least force [N]", lambda x: self.set(least_force=x), s.least_force, 0.0, 100.0, 5.0, where)
        for i, name in enumerate(_WEIGHTS):
            changed = partial(self._set_weight, i)
            view.slider(f"{name} ×10^", changed, 0.0, -3.0, 3.0, 0.5, where)
        self._add_terms()

    def _add_cards(self) -> None:
        if self.robot.name in {card.robot for card in CARDS}:
            titles = [_FREE, *(f"{i + 1}. {card.title}" for i, card in enumerate(CARDS))]
            self.view.choice("challenge", lambda i: self.choose(CARDS[i - 1] if i else None), titles)

    def _add_stance(self) -> None:
        view = self.view
        for foot in self.robot.feet:
            view.checkbox(f"on {foot.frame}", partial(self._stand_on, foot.frame), True, "its stance")
        for i, axis in enumerate("xyz"):
            view.slider(f"CoM {axis} [m]", partial(self._set_part, "shift", i), 0.0, -0.08, 0.08, 0.005, "its stance")
        view.slider("nod and turn", lambda x: self.set(nod=x, begin=self.session.sim.time), 0.0, 0.0, 0.35, 0.01, "its stance")

    def _add_walk(self) -> None:
        view, gaits = self.view, self._gaits
        if not gaits:
            return
        view.choice("gait", self._walk, ["stand", "step when pushed", *gaits], 0, "its steps")
        view.slider("forwards [m/s]", partial(self._set_part, "velocity", 0), 0.0, -0.3, 0.5, 0.05, "its steps")
        view.slider("to the left [m/s]", partial(self._set_part, "velocity", 1), 0.0, -0.2, 0.2, 0.05, "its steps")
        view.slider("turn [rad/s]", partial(self._set_part, "velocity", 2), 0.0, -0.5, 0.5, 0.05, "its steps")

    def _add_terms(self) -> None:
        view = self.view
        for term, symbol in SYMBOLS.items():
            view.term(f"show {term}", partial(self._show_term, term), self._shown[term], symbol, "shown")
            believed, true = _OFF.get(term, ("", ""))
            if believed:
                view.term(believed, partial(self._switch, "believed_off", term), True, symbol, "believed")
            if true:
                view.term(true, partial(self._switch, "true_off", term), True, symbol, "world")

    @property
    def _gaits(self) -> list[str]:
        return list(GAITS.get(len(self.robot.feet), {}))

    @property
    def _wanted(self) -> Settings:
        """The settings with what is still requested."""
        with self._lock:
            return replace(self.session.settings, **self._requested)

    def _set_part(self, attribute: str, i: int, value: float) -> None:
        values = list(getattr(self._wanted, attribute))
        values[i] = value
        self.set(**{attribute: tuple(values)})

    def _set_weight(self, i: int, exponent: float) -> None:
        self._set_part("weights", i, 10.0**exponent)

    def _stand_on(self, foot: str, stands: bool) -> None:
        lifted = [name for name in self._wanted.lifted if name != foot]
        self.set(lifted=tuple(lifted if stands else [*lifted, foot]))

    def _walk(self, number: int) -> None:
        gait = ["", "", *self._gaits][number] or None
        self.set(gait=gait, catches=number == 1, begin=self.session.sim.time)

    def _switch(self, attribute: str, term: str, on: bool) -> None:
        off = tuple(name for name in getattr(self._wanted, attribute) if name != term)
        self.set(**{attribute: off if on else (*off, term)}, leg=self.robot.feet[0].frame)

    def _show_term(self, term: str, shown: bool) -> None:
        self._shown[term] = shown
        if self.run.status != "running":
            self._draw_again()

    def _follow_settings(self) -> None:
        """Show the session's settings at the controls, which only a floating robot has."""
        if not self.robot.is_floating:
            return
        s, view = self.session.settings, self.view
        values: dict[str, Any] = {"facets": s.facets, "nod and turn": s.nod, "torque limits [×]": s.torque}
        values["least force [N]"] = s.least_force
        for name, (attribute, *_) in _PAIRS.items():
            values |= dict(zip((f"{name} believed", f"{name} true"), getattr(s, attribute), strict=True))
        values |= {f"on {foot.frame}": foot.frame not in s.lifted for foot in self.robot.feet}
        values |= {f"CoM {axis} [m]": value for axis, value in zip("xyz", s.shift, strict=True)}
        values |= {f"{name} ×10^": math.log10(value) for name, value in zip(_WEIGHTS, s.weights, strict=True)}
        if self._gaits:
            values["gait"] = 1 if s.catches else 0 if s.gait is None else 2 + self._gaits.index(s.gait)
            names = ("forwards [m/s]", "to the left [m/s]", "turn [rad/s]")
            values |= dict(zip(names, s.velocity, strict=True))
        for term, (believed, true) in _OFF.items():
            values |= {believed: term not in s.believed_off} | ({true: term not in s.true_off} if true else {})
        for name, value in values.items():
            view.move(name, value)

    def _write(self) -> None:
        """The texts of the panel: the challenge, and the program."""
        judge = self.judge  # a challenge may be chosen meanwhile
        with suppress(ViewerError):
            if judge is not None:
                self.view.note("card", f"{judge.card.text}\n{judge.says}")
            elif self.robot.is_floating:
                self.view.note("card", "")
            code = self.session.settings.code(self.robot, self.session.period, self._last_push)
            self.view.note("code", code, "as Python", code=True)

    def _tell(self, status: str) -> None:
        """Show what stopped the run, if anything did, over the last picture."""
        self.outcome = "" if status == "running" else advice(status)
        judge = self.judge
        if judge is not None and status not in ("running", "paused"):
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
        if self.robot.is_floating:
            self.view.strip("planned and measured forces differ by", float(record.time[-1]), gap(record), "N")

    def _draw(self, record: fb.Rollout) -> None:
        """The last row of a slice, under the time, the part of real time that this machine reaches, and messages."""
        now, session = float(record.time[-1]), self.session
        with self._drawing:
            speed = self.pace.update(now)
            pace = "" if speed is None else f", {speed:.0%} of real time"
            gait = f", {session.settings.gait}" if session.settings.gait else ""
            headline = f"{self.robot.name}{gait}, {now:.1f} s{pace}, control every {1e3 * session.period:g} ms"
            forces = self._shown["forces"]
            self.view.show(
                record.final, record.contacts, record.measured[-1] if forces else None,
                _planned(record) if forces else None, push=push_at(record, -1, SEEN), cones=self._shown["cones"],
                support=True, extra=self._extra(record),
                title="\n".join(filter(None, [headline, self.outcome, session.note])),
            )  # fmt: skip

    def _extra(self, record: fb.Rollout) -> Picture:
        """Arrows of the terms, and marks of a walk."""
        picture: Picture = {}
        for term, shown in self._shown.items():
            if shown:
                picture |= arrows(term, record, self.view.scale, self.session.settings.true_off)
        walk = self.session.walk
        return picture if walk is None else picture | dict(self.view.walking(walk, record.final))

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        if published.display() == "site":
            self.view.show(self.session.sim.state, self.session.sim.feet)
            return published.Pack([self.view], words=_STILL).bundle()
        return self.start().view._repr_mimebundle_(**kwargs)

    def __repr__(self) -> str:
        return f"Playground({self.robot.name}, {self.url})"


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


class Pace:
    """Simulated time per real time. clock: gives real time, s. over: s of real time, back from now, that count."""

    def __init__(self, clock: Callable[[], float] = time.monotonic, over: float = 2.0):
        self._clock, self._over = clock, over
        self._seen: deque[tuple[float, float]] = deque()  # clock and simulated time, s

    def update(self, simulated: float) -> float | None:
        """The pace when the simulation's clock has come to `simulated` s; None for half a second after a start or a pause."""
        now = self._clock()
        if self._seen and (simulated < self._seen[-1][1] or now - self._seen[-1][0] > self._over):
            self._seen.clear()
        self._seen.append((now, simulated))
        while now - self._seen[0][0] > self._over:
            self._seen.popleft()
        since, start = self._seen[0]
        return (simulated - start) / (now - since) if now - since > 0.5 else None
