"""A rollout that goes on in the background at the speed of real time, for pages and sliders."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy.typing as npt

from floatbase._arrays import positive
from floatbase.simulation.physics import Push, Simulation
from floatbase.simulation.rollout import Controller, Rollout, rollout

FRAME = 1.0 / 30.0  # s between pictures, about


class Live:
    """Runs `rollout` in slices of a 30th of a second in a thread of its own and hands each slice to `show`.

    show: called with each slice, in that thread. control_period: s. idle: s without a word from outside after which the
    run pauses by itself, so that a forgotten page costs nothing. A fall or a failed controller pauses it too; `status`
    says why. Everything that has to do with the simulation happens between slices; no call here waits for physics or
    pictures.
    """

    def __init__(
        self,
        sim: Simulation,
        controller: Controller,
        show: Callable[[Rollout], None],
        *,
        control_period: float = 2e-3,
        idle: float = 120.0,
    ):
        self._sim = sim
        self._show = show
        self._period = positive("control_period", control_period, "s")
        self._frame = max(1, round(FRAME / self._period)) * self._period  # s, a whole number of ticks
        self._idle = positive("idle", idle, "s")
        self._lock = threading.Lock()
        self._wake = threading.Event()
        self._controller = controller
        self._pushes: tuple[Push, ...] = ()
        self._asked: list[Push] = []
        self._reset = False
        self._running = False
        self._closing = False
        self._speed = 1.0
        self._status = "paused"
        self.error: Exception | None = None
        self._touched = time.monotonic()
        self._thread: threading.Thread | None = None

    @property
    def status(self) -> str:
        """ "running", "paused", or why it stopped: "fell", "diverged", "controller failed: …"."""
        return self._status

    def start(self) -> None:
        """Run, or go on after a pause; a fallen robot is put back on its feet."""
        with self._lock:
            self._touch()
            if self._status not in ("running", "paused"):
                self._reset = True
            self._running, self._status = True, "running"
            if self._thread is None or not self._thread.is_alive():
                self._closing = False
                self._thread = threading.Thread(target=self._loop, name="floatbase-live", daemon=True)
                self._thread.start()
        self._wake.set()

    def pause(self) -> None:
        """Stop after the present slice; `start` goes on from there."""
        with self._lock:
            self._running, self._status = False, "paused"

    def reset(self) -> None:
        """Put the robot back on its feet and run."""
        with self._lock:
            self._reset = True
        self.start()

    def push(self, force: npt.ArrayLike, duration: float = 0.1, frame: str = "base") -> None:
        """Push now: force (3,) N, world, for `duration` s, at a frame of the robot."""
        push = Push(force, 0.0, duration, frame)  # type: ignore[arg-type]
        with self._lock:
            self._touch()
            self._asked.append(push)

    def use(self, controller: Controller) -> None:
        """Go on under another controller from the next slice."""
        with self._lock:
            self._touch()
            self._controller = controller

    def slow_motion(self, speed: float) -> None:
        """Speed as a part of real time, 1 by default."""
        with self._lock:
            self._touch()
            self._speed = positive("speed", speed)

    def close(self) -> None:
        """End the thread; waits until the present slice is done."""
        with self._lock:
            self._running, self._closing, self._status = False, True, "paused"
            thread = self._thread
        self._wake.set()
        if thread is not None and thread is not threading.current_thread():
            thread.join(timeout=5.0)

    def _touch(self) -> None:
        self._touched = time.monotonic()

    def _loop(self) -> None:
        due = time.monotonic()
        while True:
            if not self._running:
                if self._closing:
                    return
                self._wake.wait(timeout=1.0)
                self._wake.clear()
                due = time.monotonic()
                continue
            self._slice()
            due = max(
                due + self._frame / self._speed, time.monotonic() - FRAME
            )  # a slow machine falls behind, it does not race
            time.sleep(max(0.0, due - time.monotonic()))

    def _slice(self) -> None:
        """One slice of physics and its picture."""
        with self._lock:
            controller, asked, reset = self._controller, self._asked, self._reset
            self._asked, self._reset = [], False
        if reset:
            self._sim.reset()
            self._pushes, asked = (), []
        now = self._sim.time
        self._pushes = tuple(p for p in self._pushes if now < p.start + p.duration) + tuple(
            Push(p.force, now, p.duration, p.frame) for p in asked
        )
        try:
            record = rollout(self._sim, controller, self._frame, self._pushes, self._period)
            if len(record):
                self._show(record)
            outcome = record.outcome if record.error is None else f"{record.outcome}: {record.error}"
        except Exception as error:  # whatever a learner's controller raises must show, or the picture just stands still
            outcome, self.error = f"stopped: {type(error).__name__}: {error}", error
        with self._lock:
            if outcome != "completed" and self._running:
                self._running, self._status = False, outcome
            elif self._running and time.monotonic() - self._touched > self._idle:
                self._running, self._status = False, "paused"
