"""A rollout that goes on in the background at the speed of real time, for pages and sliders."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from types import EllipsisType
from typing import Literal

import numpy.typing as npt

from floatbase._validation import as_callable, as_instance, as_positive
from floatbase.simulation.after_fall import is_at_rest, settling_rollout
from floatbase.simulation.physics import Simulation
from floatbase.simulation.push import Push, active_pushes
from floatbase.simulation.record import Outcome, Rollout
from floatbase.simulation.rollout import Actuators, Controller, check_actuators, rollout

_SLICE_DURATION = (
    1.0 / 30.0
)  # s of simulated time in a slice, about: as often as a picture is drawn
_JOIN_TIMEOUT = 5.0  # s that `close` waits for a slice: far longer than one takes
_MAX_SETTLING_TIME = 1.5  # s after a fall in which a robot comes to lie, at most
Status = Literal["running", "paused", "idle", "fell", "diverged", "controller failed", "stopped"]
ACTIVE_STATUSES = ("running", "paused", "idle")  # of a run that nothing has ended


class LiveSimulation:
    """Runs `rollout` in slices of a 30th of a second, in a thread of its own, and hands each slice
    to `show`.

    sim, controller, control_period (s), actuators: as for `rollout`.
    show: called with each slice's record, in that thread.
    after_reset: called after each reset, in that thread, to reset what has a memory of its own,
        such as the actuators.
    idle_timeout: s without any call here after which the run pauses by itself, so that a forgotten
        page costs nothing.
    push_memory: s for which the `pushes` of a slice still have those that are over.

    `status` is "running", "paused", "idle" after `idle_timeout`, or why the run stopped: "fell",
    "diverged", "controller failed", or "stopped" by an exception, which `error` holds. `reason` is
    the message of the error. A fall or a failure is reported at once; slices go on with the
    controller off, as `settling_time` of `rollout` says, until the robot lies still, or for 1.5 s
    at most. Calls act between slices, and none but `close` waits.
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
        push_memory: float = 0.0,
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
        self._push_memory = as_positive("push_memory", push_memory, "s", allow_zero=True)
        self._time_scale = 1.0
        self._lock = threading.Lock()  # over all that follows
        self._pushes: tuple[Push, ...] = ()  # of the last slice
        self._requested_pushes: list[Push] = []  # for the next one
        self._reset_requested = False
        self._calls: list[Callable[[], None]] = []
        self._status: Status = "paused"
        self._reason = ""
        # the last slice where the controller is off; only the thread has to do with it
        self._last_record: Rollout | None = None
        self._listener: Callable[[Status], None] | None = None
        self._last_call = time.monotonic()
        self._stop = threading.Event()  # ends the present thread; set while paused
        self._stop.set()
        self._thread: threading.Thread | None = None

    @property
    def status(self) -> Status:
        """ "running", "paused", "idle", or why it stopped: see the class."""
        return self._status

    @property
    def reason(self) -> str:
        """The message of the error that ended the run; "" if none did."""
        return self._reason

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

    def on_status(self, listener: Callable[[Status], None] | None) -> None:
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
        """Use another controller from the next slice on, and what else is given.

        controller, sim, actuators: as for `rollout`; without actuators the present ones stay, and
            None removes them.
        control_period: s.
        """
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

    def _set_status(self, status: Status, reason: str = "") -> bool:
        """Take a status; whether it differs from the one before."""
        previous, self._status, self._reason = self._status, status, reason
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
        """Run what was called for, simulate a slice and show it, and go on or stop."""
        try:
            self._run_calls()
            record = self._simulate_slice(self._start_of_slice())
            self._last_record = record if record.controller_off_time is not None else None
            if len(record):
                self._show(record)
            outcome: Outcome | Literal["stopped"] = record.outcome
            reason = "" if record.error is None else str(record.error)
        except Exception as error:
            # whatever a learner's controller raises must show, or the picture just stands still
            outcome, reason = "stopped", f"{type(error).__name__}: {error}"
            self.error, self._last_record = error, None
        self._end_slice(stop, outcome, reason)

    def _run_calls(self) -> None:
        """Make the calls of `call_soon`."""
        with self._lock:
            calls, self._calls = self._calls, []
        for call in calls:
            call()

    def _start_of_slice(self) -> list[Push]:
        """Reset the robot if that is requested; returns the pushes that begin now."""
        with self._lock:
            requested, reset = self._requested_pushes, self._reset_requested
            self._requested_pushes, self._reset_requested = [], False
        if reset:
            self.sim.reset()
            self._pushes, self._last_record = (), None
            if self._after_reset is not None:
                self._after_reset()
        return requested

    def _simulate_slice(self, requested: list[Push]) -> Rollout:
        """Run one slice of physics, with the controller or after a fall without."""
        with self._lock:
            sim, controller, actuators = self.sim, self._controller, self._actuators
            period, duration = self._period, self._slice_duration
        now = sim.time
        self._pushes = tuple(
            p for p in self._pushes if now < p.start + p.duration + self._push_memory
        )
        self._pushes += tuple(replace(push, start=now) for push in requested)
        active = active_pushes(self._pushes, now, now + duration)
        if self._last_record is None:
            record = rollout(sim, controller, duration, active, period, actuators)
        else:
            ticks, substeps = round(duration / period), round(period / sim.timestep)
            record = settling_rollout(sim, self._last_record, ticks, substeps, active)
        return replace(record, pushes=self._pushes)

    def _end_slice(
        self, stop: threading.Event, outcome: Outcome | Literal["stopped"], reason: str
    ) -> None:
        """Take the status that follows from a slice, and stop where it ends the run."""
        with self._lock:
            if self._reset_requested:  # the outcome is about a robot that is put back next
                return
            status: Status
            if outcome != "completed":
                status = outcome
                if stop is not self._stop:  # paused and started again meanwhile
                    self._reset_requested = True
                    return
            elif stop.is_set() or time.monotonic() - self._last_call <= self._idle_timeout:
                return
            else:
                status = "idle"
            if self._last_record is None or self._has_settled:
                stop.set()
            changed = self._set_status(status, reason)
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
