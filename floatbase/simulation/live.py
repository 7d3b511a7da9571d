"""`LiveSimulation`: a rollout that runs in the background in real time, for pages and sliders."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from types import EllipsisType
from typing import Literal

import numpy.typing as npt

from floatbase._locks import InterruptibleLock
from floatbase._validation import as_callable, as_instance, as_positive
from floatbase.simulation.after_fall import is_at_rest, settling_rollout
from floatbase.simulation.physics import Simulation
from floatbase.simulation.push import Push, active_pushes
from floatbase.simulation.record import Outcome, Rollout
from floatbase.simulation.rollout import Actuators, Controller, check_actuators, rollout

# s of simulated time in a slice, roughly: as often as a picture is drawn
_SLICE_DURATION = 1.0 / 30.0
_JOIN_TIMEOUT = 5.0  # s that `close` waits for a slice: far longer than one takes
_MAX_SETTLING_TIME = 1.5  # s, at most, after a fall until the robot lies still
Status = Literal["running", "paused", "idle", "fell", "diverged", "controller failed", "stopped"]
ACTIVE_STATUSES = ("running", "paused", "idle")  # of a run that has not ended


class LiveSimulation:
    """A rollout that runs in the background, in real time, in slices of a 30th of a second.

    The run has its own thread, which passes the record of each slice to `show`. Calls take effect
    between slices, and only `close` waits.

    A fall or a failure is reported immediately. The simulation then continues with the controller
    off, as with `settling_time` of `rollout`, until the robot lies still, but for at most 1.5 s.

    Parameters
    ----------
    sim : Simulation
        The simulation, as for `rollout`.
    controller : Controller
        The controller, as for `rollout`.
    show : callable
        Called as show(record) in the run's thread, with the `Rollout` of each slice.
    control_period : float, optional
        Time between two calls of the controller [s].
    actuators : Actuators, optional
        Model that converts the controller's torques, as for `rollout`.
    after_reset : callable, optional
        Called as after_reset() in the run's thread after each reset, to reset other objects with a
        state, such as the actuators.
    idle_timeout : float, optional
        Time without a method call after which the run pauses by itself [s], so that a
        forgotten page uses no computing time.
    push_memory : float, optional
        Time for which the `pushes` of a slice still include pushes that are over [s].

    Attributes
    ----------
    error : Exception or None
        The exception that stopped the run.
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
        self._controller = controller
        self._show = show
        self._actuators = actuators
        self._after_reset = after_reset
        self._period = as_positive("control_period", control_period, "s")
        self._slice_duration = _slice_duration_for(self._period)  # s
        self._idle_timeout = as_positive("idle_timeout", idle_timeout, "s")
        self._push_memory = as_positive("push_memory", push_memory, "s", allow_zero=True)
        self._time_scale = 1.0
        self._lock = InterruptibleLock()  # protects all attributes below
        self._pushes: tuple[Push, ...] = ()  # of the last slice
        self._requested_pushes: list[Push] = []  # for the next one
        self._reset_requested = False
        self._calls: list[Callable[[], None]] = []
        self._status: Status = "paused"
        self._reason = ""
        # the last slice, if the controller is off; used only by the thread
        self._last_record: Rollout | None = None
        self._listener: Callable[[Status], None] | None = None
        self._last_call = time.monotonic()
        self._stop = threading.Event()  # ends the present thread; is set while paused
        self._stop.set()
        self._thread: threading.Thread | None = None

    @property
    def status(self) -> Status:
        """Status of the run.

        The status is "running", "paused", "idle" (paused after `idle_timeout`), or the reason why
        the run ended: "fell", "diverged", "controller failed", or "stopped" by the exception in
        `error`.
        """
        return self._status

    @property
    def reason(self) -> str:
        """Message of the error that ended the run, or ""."""
        return self._reason

    @property
    def controller(self) -> Controller:
        """The present controller."""
        return self._controller

    @property
    def is_simulating(self) -> bool:
        """Whether the thread is simulating: while running, and briefly after a fall or failure."""
        return not self._stop.is_set()

    def on_status(self, listener: Callable[[Status], None] | None) -> None:
        """Register a function that is called when the status changes.

        Parameters
        ----------
        listener : callable or None
            Called as listener(status) in the thread that changed the status. It replaces the
            previous listener; None removes it.
        """
        if listener is not None:
            as_callable("listener", listener, "listener(status)")
        self._listener = listener

    def start(self) -> None:
        """Run, or continue after a pause; a fallen robot is reset to standing first."""
        self._request_run()

    def pause(self) -> None:
        """Pause after the present slice; `start` continues from there.

        The status of a run that has ended does not change, but a robot that is still falling stops
        in mid-fall.
        """
        with self._lock:
            self._stop.set()
            changed = self._status == "running" and self._set_status("paused")
        self._notify(changed)

    def reset(self) -> None:
        """Reset the robot to standing and run; pushes requested before are discarded."""
        self._request_run(reset=True)

    def push(self, force: npt.ArrayLike, duration: float = 0.1, frame: str = "base") -> None:
        """Push the robot now, and run.

        A fallen robot is reset to standing first; the push then begins at time 0.

        Parameters
        ----------
        force : array_like, shape (3,)
            Force in the world frame, applied at the origin of `frame` [N].
        duration : float, optional
            Duration of the push [s].
        frame : str, optional
            Name of a frame of the robot; "base" is the base link.
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
        """Replace the controller, and optionally other parts of the run, from the next slice on.

        Parameters
        ----------
        controller : Controller
            The controller, as for `rollout`.
        sim : Simulation, optional
            The simulation; by default the present one.
        actuators : Actuators or None, optional
            Model that converts the controller's torques; by default the present one. None removes
            it.
        control_period : float, optional
            Time between two calls of the controller [s]; by default the present one.
        """
        as_callable("the controller", controller, "controller(q, v, t)")
        if actuators is not ...:
            check_actuators(actuators)
        period = self._period if control_period is None else control_period
        period = as_positive("control_period", period, "s")
        with self._lock:
            self._last_call, self._controller = time.monotonic(), controller
            if sim is not None and sim is not self.sim and self._status != "running":
                self._stop.set()  # a fall in the former simulation is not one in the new one
            self.sim = self.sim if sim is None else as_instance("sim", sim, Simulation)
            self._actuators = self._actuators if actuators is ... else actuators
            self._period, self._slice_duration = period, _slice_duration_for(period)

    def call_soon(self, call: Callable[[], None]) -> None:
        """Call a function in the run's thread before the next slice.

        Nothing else uses the simulation at that time. An exception ends the run, like one of the
        controller.

        Parameters
        ----------
        call : callable
            Called as call().
        """
        as_callable("call", call, "call()")
        with self._lock:
            self._last_call = time.monotonic()
            self._calls.append(call)

    def set_time_scale(self, scale: float) -> None:
        """Set the ratio of simulated time to real time, which is 1 by default.

        Parameters
        ----------
        scale : float
            Simulated time per real time, positive [-].
        """
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
        """Run, after a reset if requested or needed.

        Everything happens under one lock, so that no slice runs in between.
        """
        with self._lock:
            self._last_call = time.monotonic()
            if reset or self._status not in ACTIVE_STATUSES:
                self._reset_requested, self._requested_pushes = True, []
            if push is not None:
                self._requested_pushes.append(push)
            if self._stop.is_set():
                self._stop = threading.Event()
                loop = partial(self._loop, self._stop, self._thread)
                self._thread = threading.Thread(target=loop, name="floatbase-live", daemon=True)
                self._thread.start()
            changed = self._set_status("running")
        self._notify(changed)

    def _set_status(self, status: Status, reason: str = "") -> bool:
        """Set the status, and return whether it changed."""
        previous, self._status, self._reason = self._status, status, reason
        return previous != status

    def _notify(self, changed: bool) -> None:
        """Call the listener. The lock must not be held, because the listener may call methods."""
        if changed and self._listener is not None:
            self._listener(self._status)

    def _loop(self, stop: threading.Event, previous: threading.Thread | None) -> None:
        """Run slices until `stop` is set, after the previous thread has ended."""
        if previous is not None:
            previous.join()
        due = time.monotonic()
        while not stop.is_set():
            self._run_slice(stop)
            # a computer that falls behind catches up by at most one slice
            due = max(
                due + self._slice_duration / self._time_scale, time.monotonic() - _SLICE_DURATION
            )
            stop.wait(max(0.0, due - time.monotonic()))

    def _run_slice(self, stop: threading.Event) -> None:
        """Make the requested calls, simulate and show a slice, then continue or stop."""
        try:
            self._run_calls()
            record = self._simulate_slice(self._start_of_slice())
            self._last_record = record if record.controller_off_time is not None else None
            if len(record):
                self._show(record)
            outcome: Outcome | Literal["stopped"] = record.outcome
            reason = "" if record.error is None else str(record.error)
        except Exception as error:
            # show every exception of a learner's controller, or the picture just freezes
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
        """Reset the robot if requested, and return the pushes that begin now."""
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
        """Simulate one slice, with the controller or, after a fall, without it."""
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
        """Set the status that follows from a slice, and stop if the run has ended."""
        with self._lock:
            if self._reset_requested:  # the outcome no longer matters: the robot is reset next
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
        """Whether a robot with its controller off lies still, or its settling time is over."""
        off = None if self._last_record is None else self._last_record.controller_off_time
        return is_at_rest(self.sim) or self.sim.time - (off or 0.0) >= _MAX_SETTLING_TIME


def _slice_duration_for(period: float) -> float:
    """Return the duration of a slice [s], a whole number of control periods [s]."""
    return max(1, round(_SLICE_DURATION / period)) * period
