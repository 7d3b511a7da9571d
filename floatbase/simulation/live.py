"""A rollout that goes on in the background at the speed of real time, for pages and sliders."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy.typing as npt

from floatbase._arrays import positive
from floatbase.simulation.physics import Push, Simulation
from floatbase.simulation.rollout import Actuators, Controller, Rollout, rollout

FRAME = 1.0 / 30.0  # s between pictures, about
SEEN = 0.4  # s for which a slice still lists a push that is over: a tenth of a second is too short for the eye


def advice(status: str) -> str:
    """A status of `Live` as a line for who watches: what stopped the run, and what to do about it."""
    return status if status in ("running", "paused") else f"{status}: press reset, or push again"


class Live:
    """Runs `rollout` in slices of a 30th of a second in a thread of its own and hands each slice to `show`.

    show: called with each slice, in that thread; its `pushes` are those that act and those that ended less than `SEEN` s ago.
    control_period: s. actuators: as for `rollout`. after_reset: called after each reset, in that thread, to let begin anew
    what has a memory of its own, as `actuators.reset(…)`. idle: s without a word from outside after which the run pauses by
    itself, so that a forgotten page costs nothing. A fall or a failed controller pauses it too; `status` says why, and
    `on_status` tells at once. Everything that has to do with the simulation happens between slices; but for `close`, no call
    here waits for physics or pictures. While it is paused there is no thread.
    """

    def __init__(
        self,
        sim: Simulation,
        controller: Controller,
        show: Callable[[Rollout], None],
        *,
        control_period: float = 2e-3,
        actuators: Actuators | None = None,
        after_reset: Callable[[], None] | None = None,
        idle: float = 120.0,
    ):
        self._sim = sim
        self._show = show
        self._period = positive("control_period", control_period, "s")
        self._frame = max(1, round(FRAME / self._period)) * self._period  # s, a whole number of ticks
        self._actuators, self._after_reset = actuators, after_reset
        self._idle = positive("idle", idle, "s")
        self._lock = threading.Lock()
        self._controller = controller
        self._pushes: tuple[Push, ...] = ()
        self._asked: list[Push] = []
        self._reset = False
        self._speed = 1.0
        self._status = "paused"
        self._told: Callable[[str], None] | None = None
        self.error: Exception | None = None
        self._touched = time.monotonic()
        self._stop: threading.Event | None = None  # of the present thread; set or None while paused
        self._thread: threading.Thread | None = None

    @property
    def status(self) -> str:
        """ "running", "paused", or why it stopped: "fell", "diverged", "controller failed: …", "stopped: …"."""
        return self._status

    def on_status(self, told: Callable[[str], None] | None) -> None:
        """Call `told(status)` whenever the status changes, in the thread that changed it."""
        self._told = told

    def start(self) -> None:
        """Run, or go on after a pause; a fallen robot is put back on its feet."""
        self._go()

    def pause(self) -> None:
        """Stop after the present slice; `start` goes on from there. What has stopped already stays as it is."""
        with self._lock:
            self._halt()
            changed = self._status == "running" and self._become("paused")
        self._tell(changed)

    def reset(self) -> None:
        """Put the robot back on its feet and run; pushes asked for before are forgotten."""
        self._go(anew=True)

    def push(self, force: npt.ArrayLike, duration: float = 0.1, frame: str = "base") -> None:
        """Push now: force (3,) N, world, for `duration` s, at a frame of the robot.

        Starts the run where it stands still. A fallen robot is put back on its feet first: the push begins with it, at 0 s.
        """
        self._go(pushes=(Push(force, 0.0, duration, frame),))  # type: ignore[arg-type]

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
        """Pause, and wait until the present slice is done and its thread has ended."""
        self.pause()
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(timeout=5.0)

    def _go(self, anew: bool = False, pushes: tuple[Push, ...] = ()) -> None:
        """Run with these pushes, on fresh feet where asked or needed: all in one step, so that no slice comes between."""
        with self._lock:
            self._touch()
            if anew or self._status not in ("running", "paused"):
                self._reset, self._asked = True, []
            self._asked.extend(pushes)
            if self._stop is None or self._stop.is_set():
                self._stop = threading.Event()
                self._thread = threading.Thread(
                    target=self._loop, args=(self._stop, self._thread), name="floatbase-live", daemon=True
                )
                self._thread.start()
            changed = self._become("running")
        self._tell(changed)

    def _touch(self) -> None:
        self._touched = time.monotonic()

    def _halt(self) -> None:
        if self._stop is not None:
            self._stop.set()

    def _become(self, status: str) -> bool:
        """Take a status; whether it is another one."""
        before, self._status = self._status, status
        return before != status

    def _tell(self, changed: bool) -> None:
        """Never under the lock: who is told may well call back."""
        if changed and self._told is not None:
            self._told(self._status)

    def _loop(self, stop: threading.Event, before: threading.Thread | None) -> None:
        """Slice after slice until `stop`, once the thread before has ended."""
        if before is not None:
            before.join()
        due = time.monotonic()
        while not stop.is_set():
            self._slice(stop)
            # a slow machine falls behind, it does not race
            due = max(due + self._frame / self._speed, time.monotonic() - FRAME)
            stop.wait(max(0.0, due - time.monotonic()))

    def _slice(self, stop: threading.Event) -> None:
        """One slice of physics and its picture."""
        with self._lock:
            controller, asked, reset = self._controller, self._asked, self._reset
            self._asked, self._reset = [], False
        try:
            if reset:
                self._start_anew()
            record = rollout(self._sim, controller, self._frame, self._with(asked), self._period, self._actuators)
            if len(record):
                self._show(record)
            outcome = record.outcome if record.error is None else f"{record.outcome}: {record.error}"
        except Exception as error:  # whatever a learner's controller raises must show, or the picture just stands still
            outcome, self.error = f"stopped: {type(error).__name__}: {error}", error
        self._judge(outcome, stop)

    def _start_anew(self) -> None:
        self._sim.reset()
        self._pushes = ()
        if self._after_reset is not None:
            self._after_reset()

    def _with(self, asked: list[Push]) -> tuple[Push, ...]:
        """The pushes of the next slice: those asked for begin now."""
        now = self._sim.time
        going_on = tuple(p for p in self._pushes if now < p.start + p.duration + SEEN)
        self._pushes = going_on + tuple(Push(p.force, now, p.duration, p.frame) for p in asked)
        return self._pushes

    def _judge(self, outcome: str, stop: threading.Event) -> None:
        """Go on, or pause for what came out of a slice or because nobody looks."""
        with self._lock:
            changed = False
            if self._reset:  # what came out is about a robot that is put back next
                pass
            elif outcome != "completed" and stop is not self._stop:  # paused and started again meanwhile
                self._reset = True
            elif outcome != "completed":
                stop.set()
                changed = self._become(outcome)
            elif not stop.is_set() and time.monotonic() - self._touched > self._idle:
                stop.set()
                changed = self._become("paused")
        self._tell(changed)
