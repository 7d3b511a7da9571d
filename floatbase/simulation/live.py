"""A rollout that goes on in the background at the speed of real time, for pages and sliders."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from types import EllipsisType

import numpy.typing as npt

from floatbase._validation import as_callable, as_instance, as_positive, as_string
from floatbase.simulation.physics import Push, Simulation, acting
from floatbase.simulation.record import Rollout
from floatbase.simulation.rollout import Actuators, Controller, check_actuators, rollout
from floatbase.simulation.settling import lies_still, settled

_SLICE = 1.0 / 30.0  # s of simulated time in a slice, about: as often as a picture is drawn
_LONGEST_JOIN = 5.0  # s that `close` waits for a slice: far longer than one takes
_SETTLING = 1.5  # s after a fall in which a robot comes to lie, at most
IDLE = "paused by itself, untouched for long"  # a status
GOES_ON = ("running", "paused", IDLE)  # the statuses of a run that nothing has ended
SEEN = 0.4  # s for which a slice still lists a push that is over: the eye misses an arrow of a tenth of a second


def advice(status: str) -> str:
    """A status of `Live` as a line for who watches: what stopped the run, in a sentence, and what to do about it."""
    if as_string("status", status) in GOES_ON:
        return status if status != IDLE else f"{IDLE}: press run"
    reason = status.split("\n")[0].split(". ")[0].rstrip(".")
    return f"{reason}: press reset, or push again"


class Live:
    """Runs `rollout` in slices of a 30th of a second, in a thread of its own, and hands each slice to `show`.

    sim, controller, control_period (s), actuators: as for `rollout`.
    show: called with each slice's record, in that thread; its `pushes` are those that act or ended less than `SEEN` s ago.
    after_reset: called after each reset, in that thread, to reset what has a memory of its own, such as the actuators.
    idle: s without any call here after which the run pauses by itself, so that a forgotten page costs nothing.

    `status` is "running", "paused", `IDLE` where it has paused by itself, or why the run stopped: "fell", "diverged",
    "controller failed: …", "stopped: …" for an exception, which `error` holds. A fall or a failure is told at once; slices go
    on with the controller off, as `settle` of `rollout` says, until the robot lies still, or for 1.5 s at most. Calls act
    between slices, and none but `close` waits.
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
        self.sim = as_instance("sim", sim, Simulation)
        as_callable("the controller", controller, "controller(q, v, t)")
        as_callable("show", show, "show(record)")
        check_actuators(actuators)
        if after_reset is not None:
            as_callable("after_reset", after_reset, "after_reset()")
        self.error: Exception | None = None
        self._controller, self._show, self._actuators, self._after_reset = controller, show, actuators, after_reset
        self._period = as_positive("control_period", control_period, "s")
        self._duration = _slice_of(self._period)  # s
        self._idle = as_positive("idle", idle, "s")
        self._speed = 1.0
        self._lock = threading.Lock()  # over all that follows
        self._pushes: tuple[Push, ...] = ()  # of the last slice
        self._requested: list[Push] = []  # for the next one
        self._reset_requested = False
        self._calls: list[Callable[[], None]] = []
        self._status = "paused"
        self._last: Rollout | None = None  # the last slice where the controller is off; only the thread has to do with it
        self._listener: Callable[[str], None] | None = None
        self._last_call = time.monotonic()
        self._stop = threading.Event()  # ends the present thread; set while paused
        self._stop.set()
        self._thread: threading.Thread | None = None

    @property
    def status(self) -> str:
        """ "running", "paused", `IDLE`, or why it stopped: see the class."""
        return self._status

    @property
    def controller(self) -> Controller:
        """What gives the torques now."""
        return self._controller

    @property
    def moves(self) -> bool:
        """Whether the thread moves the robot: while the status is "running", and a little longer after a fall or failure."""
        return not self._stop.is_set()

    def on_status(self, listener: Callable[[str], None] | None) -> None:
        """Call `listener(status)` whenever the status changes, in the thread that changed it."""
        self._listener = None if listener is None else as_callable("listener", listener, "listener(status)")

    def start(self) -> None:
        """Run, or go on after a pause. A fallen robot is put back on its feet."""
        self._run()

    def pause(self) -> None:
        """Stop after the present slice; `start` goes on from there. What has stopped already stays as it is, or in mid-fall."""
        with self._lock:
            self._stop.set()
            changed = self._status == "running" and self._become("paused")
        self._tell(changed)

    def reset(self) -> None:
        """Put the robot back on its feet and run. Pushes requested before are forgotten."""
        self._run(reset=True)

    def push(self, force: npt.ArrayLike, duration: float = 0.1, frame: str = "base") -> None:
        """Push now, and run: as `Push`. A fallen robot is put back on its feet first, and the push begins with it, at 0 s."""
        self._run(push=Push(force, 0.0, duration, frame))  # type: ignore[arg-type]

    def use(
        self,
        controller: Controller,
        *,
        sim: Simulation | None = None,
        actuators: Actuators | EllipsisType | None = ...,
        control_period: float | None = None,
    ) -> None:
        """Go on under another controller from the next slice, and where they are given with other things.

        controller, sim, actuators: as for `rollout`; actuators stay where none are given, and None takes them away.
        control_period: s.
        """  # fmt: skip
        as_callable("the controller", controller, "controller(q, v, t)")
        if actuators is not ...:
            check_actuators(actuators)
        period = self._period if control_period is None else as_positive("control_period", control_period, "s")
        with self._lock:
            self._last_call, self._controller = time.monotonic(), controller
            if sim is not None and sim is not self.sim and self._status != "running":
                self._stop.set()  # it is not the other simulation's robot that falls
            self.sim = self.sim if sim is None else as_instance("sim", sim, Simulation)
            self._actuators = self._actuators if actuators is ... else actuators
            self._period, self._duration = period, _slice_of(period)

    def soon(self, call: Callable[[], None]) -> None:
        """Call `call()` in the run's thread before its next slice, where nothing else touches the simulation.

        An exception of it ends the run, as one of the controller does.
        """
        as_callable("call", call, "call()")
        with self._lock:
            self._last_call = time.monotonic()
            self._calls.append(call)

    def slow_motion(self, speed: float) -> None:
        """Simulated time per real time, 1 by default."""
        speed = as_positive("speed", speed)
        with self._lock:
            self._last_call, self._speed = time.monotonic(), speed

    def close(self) -> None:
        """Pause, and wait until the thread has ended."""
        self.pause()
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(_LONGEST_JOIN)

    def _run(self, reset: bool = False, push: Push | None = None) -> None:
        """Run, after a reset where it is requested or needed: all under one lock, so that no slice comes between."""
        with self._lock:
            self._last_call = time.monotonic()
            if reset or self._status not in GOES_ON:
                self._reset_requested, self._requested = True, []
            if push is not None:
                self._requested.append(push)
            if self._stop.is_set():
                self._stop = threading.Event()
                args = (self._stop, self._thread)
                self._thread = threading.Thread(target=self._loop, args=args, name="floatbase-live", daemon=True)
                self._thread.start()
            changed = self._become("running")
        self._tell(changed)

    def _become(self, status: str) -> bool:
        """Take a status; whether it differs from the one before."""
        before, self._status = self._status, status
        return before != status

    def _tell(self, changed: bool) -> None:
        """Never under the lock: the listener may call back."""
        if changed and self._listener is not None:
            self._listener(self._status)

    def _loop(self, stop: threading.Event, before: threading.Thread | None) -> None:
        """Slice after slice until `stop`, once the thread before has ended."""
        if before is not None:
            before.join()
        due = time.monotonic()
        while not stop.is_set():
            self._slice(stop)
            # a machine that falls behind does not catch up by more than a slice
            due = max(due + self._duration / self._speed, time.monotonic() - _SLICE)
            stop.wait(max(0.0, due - time.monotonic()))

    def _slice(self, stop: threading.Event) -> None:
        """One slice of physics, shown; then go on, or stop because of its outcome or because nobody has called for long."""
        with self._lock:
            calls, self._calls = self._calls, []
        try:
            for call in calls:
                call()
            with self._lock:
                requested, reset = self._requested, self._reset_requested
                self._requested, self._reset_requested = [], False
            if reset:
                self.sim.reset()
                self._pushes, self._last = (), None
                if self._after_reset is not None:
                    self._after_reset()
            with self._lock:
                sim, controller, actuators = self.sim, self._controller, self._actuators
                period, duration = self._period, self._duration
            now = sim.time
            self._pushes = tuple(p for p in self._pushes if now < p.start + p.duration + SEEN)
            self._pushes += tuple(replace(push, start=now) for push in requested)
            present = acting(self._pushes, now, now + duration)  # the others are only listed, to be seen
            if self._last is None:
                record = rollout(sim, controller, duration, present, period, actuators)
            else:
                substeps = round(period / sim.timestep)
                record = settled(sim, self._last, round(duration / period), substeps, present)
            record = replace(record, pushes=self._pushes)
            self._last = record if record.off_at is not None else None
            if len(record):
                self._show(record)
            outcome = record.outcome if record.error is None else f"{record.outcome}: {record.error}"
        except Exception as error:  # whatever a learner's controller raises must show, or the picture just stands still
            outcome, self.error, self._last = f"stopped: {type(error).__name__}: {error}", error, None
        with self._lock:
            if self._reset_requested:  # the outcome is about a robot that is put back next
                return
            if outcome == "completed":
                if stop.is_set() or time.monotonic() - self._last_call <= self._idle:
                    return
                outcome = IDLE
            elif stop is not self._stop:  # paused and started again meanwhile
                self._reset_requested = True
                return
            if self._last is None or self._settled:
                stop.set()
            changed = self._become(outcome)
        self._tell(changed)

    @property
    def _settled(self) -> bool:
        """Whether a robot whose controller is off lies still, or has had its time."""
        since = self.sim.time - (self._last.off_at or 0.0) if self._last is not None else 0.0
        return lies_still(self.sim) or since >= _SETTLING


def _slice_of(period: float) -> float:
    """s of a slice: a whole number of ticks, each of `period` s."""
    return max(1, round(_SLICE / period)) * period
