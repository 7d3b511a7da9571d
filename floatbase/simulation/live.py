"""A rollout that goes on in the background at the speed of real time, for pages and sliders."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from types import EllipsisType

import numpy.typing as npt

from floatbase._validation import as_callable, as_instance, as_positive, as_string
from floatbase.simulation.after_fall import is_at_rest, settling_rollout
from floatbase.simulation.physics import Push, Simulation, active_pushes
from floatbase.simulation.record import Rollout
from floatbase.simulation.rollout import Actuators, Controller, check_actuators, rollout

_SLICE_DURATION = (
    1.0 / 30.0
)  # s of simulated time in a slice, about: as often as a picture is drawn
_JOIN_TIMEOUT = 5.0  # s that `close` waits for a slice: far longer than one takes
_MAX_SETTLING_TIME = 1.5  # s after a fall in which a robot comes to lie, at most
AUTO_PAUSED = "paused by itself, untouched for long"  # a status
ACTIVE_STATUSES = ("running", "paused", AUTO_PAUSED)  # the statuses of a run that nothing has ended
# s for which a slice still lists a push that is over: the eye misses an arrow of a tenth of a
# second
PUSH_DISPLAY_TIME = 0.4


def status_message(status: str) -> str:
    """A status of `LiveSimulation` as a line for who watches: what stopped the run, in a sentence,
    and what to do about it.
    """
    if as_string("status", status) in ACTIVE_STATUSES:
        return status if status != AUTO_PAUSED else f"{AUTO_PAUSED}: press run"
    reason = status.split("\n")[0].split(". ")[0].rstrip(".")
    return f"{reason}: press reset, or push again"


class LiveSimulation:
    """Runs `rollout` in slices of a 30th of a second, in a thread of its own, and hands each slice
    to `show`.

    sim, controller, control_period (s), actuators: as for `rollout`.
    show: called with each slice's record, in that thread; its `pushes` are those that act or ended
        less than `PUSH_DISPLAY_TIME` s ago.
    after_reset: called after each reset, in that thread, to reset what has a memory of its own,
        such as the actuators.
    idle_timeout: s without any call here after which the run pauses by itself, so that a forgotten
        page costs nothing.

    `status` is "running", "paused", `AUTO_PAUSED` where it has paused by itself, or why the run
    stopped: "fell", "diverged", "controller failed: …", "stopped: …" for an exception, which
        `error` holds. A fall or a failure is told at once; slices go
    on with the controller off, as `settling_time` of `rollout` says, until the robot lies still, or
    for 1.5 s at most. Calls act between slices, and none but `close` waits.
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
        idle_timeout: float = 120.0,
    ):
        self.sim = as_instance("sim", sim, Simulation)
        as_callable("the controller", controller, "controller(q, v, t)")
        as_callable("show", show, "show(record)")
        check_actuators(actuators)
        if after_reset is not None:
            as_callable("after_reset", after_reset, "after_reset()")
        self.error: Exception | None = None
        self._controller, self._show, self._actuators, self._after_reset = (
            controller,
            show,
            actuators,
            after_reset,
        )
        self._period = as_positive("control_period", control_period, "s")
        self._slice_duration = _slice_duration_for(self._period)  # s
        self._idle_timeout = as_positive("idle_timeout", idle_timeout, "s")
        self._time_scale = 1.0
        self._lock = threading.Lock()  # over all that follows
        self._pushes: tuple[Push, ...] = ()  # of the last slice
        self._requested_pushes: list[Push] = []  # for the next one
        self._reset_requested = False
        self._calls: list[Callable[[], None]] = []
        self._status = "paused"
        # the last slice where the controller is off; only the thread has to do with it
        self._last_record: Rollout | None = None
        self._listener: Callable[[str], None] | None = None
        self._last_call = time.monotonic()
        self._stop = threading.Event()  # ends the present thread; set while paused
        self._stop.set()
        self._thread: threading.Thread | None = None

    @property
    def status(self) -> str:
        """ "running", "paused", `AUTO_PAUSED`, or why it stopped: see the class."""
        return self._status

    @property
    def controller(self) -> Controller:
        """What gives the torques now."""
        return self._controller

    @property
    def is_simulating(self) -> bool:
        """Whether the thread moves the robot: while the status is "running", and a little longer
        after a fall or failure.
        """
        return not self._stop.is_set()

    def on_status(self, listener: Callable[[str], None] | None) -> None:
        """Call `listener(status)` whenever the status changes, in the thread that changed it."""
        self._listener = (
            None if listener is None else as_callable("listener", listener, "listener(status)")
        )

    def start(self) -> None:
        """Run, or go on after a pause. A fallen robot is put back on its feet."""
        self._request_run()

    def pause(self) -> None:
        """Stop after the present slice; `start` goes on from there. What has stopped already stays
        as it is, or in mid-fall.
        """
        with self._lock:
            self._stop.set()
            changed = self._status == "running" and self._set_status("paused")
        self._notify(changed)

    def reset(self) -> None:
        """Put the robot back on its feet and run. Pushes requested before are forgotten."""
        self._request_run(reset=True)

    def push(self, force: npt.ArrayLike, duration: float = 0.1, frame: str = "base") -> None:
        """Push now, and run: as `Push`. A fallen robot is put back on its feet first, and the push
        begins with it, at 0 s.
        """
        self._request_run(push=Push(force, 0.0, duration, frame))  # type: ignore[arg-type]

    def set_controller(
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
        period = (
            self._period
            if control_period is None
            else as_positive("control_period", control_period, "s")
        )
        with self._lock:
            self._last_call, self._controller = time.monotonic(), controller
            if sim is not None and sim is not self.sim and self._status != "running":
                self._stop.set()  # it is not the other simulation's robot that falls
            self.sim = self.sim if sim is None else as_instance("sim", sim, Simulation)
            self._actuators = self._actuators if actuators is ... else actuators
            self._period, self._slice_duration = period, _slice_duration_for(period)

    def call_soon(self, call: Callable[[], None]) -> None:
        """Call `call()` in the run's thread before its next slice, where nothing else touches the
        simulation.

        An exception of it ends the run, as one of the controller does.
        """
        as_callable("call", call, "call()")
        with self._lock:
            self._last_call = time.monotonic()
            self._calls.append(call)

    def set_time_scale(self, scale: float) -> None:
        """Simulated time per real time, 1 by default."""
        scale = as_positive("scale", scale)
        with self._lock:
            self._last_call, self._time_scale = time.monotonic(), scale

    def close(self) -> None:
        """Pause, and wait until the thread has ended."""
        self.pause()
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(_JOIN_TIMEOUT)

    def _request_run(self, reset: bool = False, push: Push | None = None) -> None:
        """Run, after a reset where it is requested or needed: all under one lock, so that no slice
        comes between.
        """
        with self._lock:
            self._last_call = time.monotonic()
            if reset or self._status not in ACTIVE_STATUSES:
                self._reset_requested, self._requested_pushes = True, []
            if push is not None:
                self._requested_pushes.append(push)
            if self._stop.is_set():
                self._stop = threading.Event()
                args = (self._stop, self._thread)
                self._thread = threading.Thread(
                    target=self._loop, args=args, name="floatbase-live", daemon=True
                )
                self._thread.start()
            changed = self._set_status("running")
        self._notify(changed)

    def _set_status(self, status: str) -> bool:
        """Take a status; whether it differs from the one before."""
        previous, self._status = self._status, status
        return previous != status

    def _notify(self, changed: bool) -> None:
        """Never under the lock: the listener may call back."""
        if changed and self._listener is not None:
            self._listener(self._status)

    def _loop(self, stop: threading.Event, previous: threading.Thread | None) -> None:
        """Slice after slice until `stop`, once the previous thread has ended."""
        if previous is not None:
            previous.join()
        due = time.monotonic()
        while not stop.is_set():
            self._run_slice(stop)
            # a machine that falls behind does not catch up by more than a slice
            due = max(
                due + self._slice_duration / self._time_scale, time.monotonic() - _SLICE_DURATION
            )
            stop.wait(max(0.0, due - time.monotonic()))

    def _run_slice(self, stop: threading.Event) -> None:
        """One slice of physics, shown; then go on, or stop because of its outcome or because nobody
        has called for long.
        """
        with self._lock:
            calls, self._calls = self._calls, []
        try:
            for call in calls:
                call()
            with self._lock:
                requested, reset = self._requested_pushes, self._reset_requested
                self._requested_pushes, self._reset_requested = [], False
            if reset:
                self.sim.reset()
                self._pushes, self._last_record = (), None
                if self._after_reset is not None:
                    self._after_reset()
            with self._lock:
                sim, controller, actuators = self.sim, self._controller, self._actuators
                period, duration = self._period, self._slice_duration
            now = sim.time
            self._pushes = tuple(
                p for p in self._pushes if now < p.start + p.duration + PUSH_DISPLAY_TIME
            )
            self._pushes += tuple(replace(push, start=now) for push in requested)
            active = active_pushes(
                self._pushes, now, now + duration
            )  # the others are only listed, to be seen
            if self._last_record is None:
                record = rollout(sim, controller, duration, active, period, actuators)
            else:
                substeps = round(period / sim.timestep)
                record = settling_rollout(
                    sim, self._last_record, round(duration / period), substeps, active
                )
            record = replace(record, pushes=self._pushes)
            self._last_record = record if record.controller_off_time is not None else None
            if len(record):
                self._show(record)
            outcome = (
                record.outcome if record.error is None else f"{record.outcome}: {record.error}"
            )
        except Exception as error:
            # whatever a learner's controller raises must show, or the picture just stands still
            outcome, self.error, self._last_record = (
                f"stopped: {type(error).__name__}: {error}",
                error,
                None,
            )
        with self._lock:
            if self._reset_requested:  # the outcome is about a robot that is put back next
                return
            if outcome == "completed":
                if stop.is_set() or time.monotonic() - self._last_call <= self._idle_timeout:
                    return
                outcome = AUTO_PAUSED
            elif stop is not self._stop:  # paused and started again meanwhile
                self._reset_requested = True
                return
            if self._last_record is None or self._has_settled:
                stop.set()
            changed = self._set_status(outcome)
        self._notify(changed)

    @property
    def _has_settled(self) -> bool:
        """Whether a robot whose controller is off lies still, or has had its time."""
        since = (
            self.sim.time - (self._last_record.controller_off_time or 0.0)
            if self._last_record is not None
            else 0.0
        )
        return is_at_rest(self.sim) or since >= _MAX_SETTLING_TIME


def _slice_duration_for(period: float) -> float:
    """s of a slice: a whole number of ticks, each of `period` s."""
    return max(1, round(_SLICE_DURATION / period)) * period
