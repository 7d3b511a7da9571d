"""The page of `python -m floatbase view`: a robot on the physics under the controller, live, without a notebook."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin

import floatbase as fb
from floatbase.behaviours import Gait, Stand, Walk
from floatbase.errors import ViewerError
from floatbase.robots import Robot
from floatbase.simulation import SEEN, Controller, Live, advice
from floatbase.viewer import push_at

GAITS = {4: {"trot": Gait.trot, "crawl": Gait.crawl}, 2: {"walk": Gait.walk}}  # by number of feet
STEPS = {4: partial(Gait.trot, swing=0.2), 2: partial(Gait.walk, swing=0.4)}  # with which a robot catches itself
_HARDEST = 2.5  # times the weight: a push that asks for steps
_AHEAD = 1.0  # s from a control to the first step
PERIODS = (2e-3, 3e-3, 4e-3, 5e-3, 6e-3, 8e-3, 10e-3)  # s between ticks of the controller: with each, robots stand a push


class Playground:
    """A robot that stands on the physics, and the controls in the page that change its controller.

    robot: as from `fb.load`.
    friction: coefficient of the ground; what the controller takes it for is a control.
    background: "white", "light" or "dark".
    port: of the page; 0 for a free one.
    """

    def __init__(self, robot: Robot, *, friction: float = 0.7, background: str = "light", port: int = 0):
        self.robot = robot
        self.sim = fb.Simulation(robot, friction)
        facets = 4 if robot.feet else None
        self.view = fb.Viewer(robot, background=background, port=port, facets=facets, follow=True)
        self.mu, self.facets = friction, 4
        self.stance = {foot.frame: True for foot in robot.feet}
        self.shift = [0.0, 0.0, 0.0]  # m, of the centre of mass
        self.velocity = [0.0, 0.0, 0.0]  # m/s forwards and to the left, rad/s to the left, of a walk
        self.gait: str | None = None  # among those of `GAITS`; None stands
        self.catches = False  # whether it steps when it must
        self.force = 0.1 * robot.weight  # N, of a push
        self.towards = 0.0  # degrees, of a push: 0 forwards, 90 to the left
        self.pushed = "base" if robot.is_floating else robot.model.frames[-1].name  # of an arm its tip
        self.note = self.outcome = ""
        self.last: fb.Rollout | None = None
        self._drawing = threading.Lock()  # the run draws, and so does who pauses it
        self.controller = self._controller()
        self.period = control_period(self.sim, self.controller)
        self.run = Live(self.sim, self.controller, self._show, control_period=self.period, after_reset=self._renew)
        self.run.on_status(self._tell)
        self.pace = Pace()
        self._add_controls()

    def start(self) -> None:
        """Show the robot and let it run."""
        self.view.show(self.robot.standing())
        self.run.start()

    def close(self) -> None:
        """End the run and close the window."""
        self.run.close()
        self.view.close()

    def _add_controls(self) -> None:
        view, weight = self.view, self.robot.weight
        view.button("run", self.run.start)
        view.button("pause", self.run.pause)
        view.button("reset", self.run.reset)
        view.slider("speed", self.run.slow_motion, 1.0, 0.05, 1.0, 0.05)
        view.slider("push [N]", partial(setattr, self, "force"), self.force, 0.0, _HARDEST * weight, 1.0)
        view.slider("push towards [°]", partial(setattr, self, "towards"), self.towards, -180.0, 180.0, 5.0)
        view.button("push", self._push)
        if not self.robot.is_floating:
            return
        for axis, name in enumerate("xyz"):
            view.slider(f"CoM {name} [m]", partial(self._change, self.shift, axis), 0.0, -0.08, 0.08, 0.005)
        view.slider("friction believed", partial(self._change, vars(self), "mu"), self.mu, 0.1, 1.5, 0.05)
        view.slider("facets", self._cut, self.facets, 3, 16, 1)
        for foot in self.stance:
            view.checkbox(f"on {foot}", partial(self._change, self.stance, foot), True)
        gaits = GAITS.get(len(self.stance), {})
        for name in gaits:
            view.checkbox(name, partial(self._walk, name), False)
        if gaits:
            view.slider("forwards [m/s]", partial(self._go, 0), 0.0, -0.3, 0.5, 0.05)
            view.slider("to the left [m/s]", partial(self._go, 1), 0.0, -0.2, 0.2, 0.05)
            view.slider("turn [rad/s]", partial(self._go, 2), 0.0, -0.5, 0.5, 0.05)
            view.checkbox("step when pushed", partial(self._change, vars(self), "catches"), False)

    def _controller(self) -> fb.WholeBodyController | Walk:
        """The controller that the controls request."""
        contacts = fb.Contacts.feet(self.robot, self.mu)
        if self.gait is not None:
            return Walk(self.robot, contacts, self._gait(self.gait), self.velocity[:2], self.velocity[2], facets=self.facets)
        if self.catches:
            return Stand(self.robot, contacts, STEPS[len(self.stance)](self.robot), facets=self.facets)
        standing = self._standing_here(contacts)
        _, level, posture = fb.standing_tasks(standing)
        tasks = (fb.CoMTask(standing.com + self.shift), level, posture)
        lifted = [frame for frame, stands in self.stance.items() if not stands]
        return fb.WholeBodyController(self.robot, contacts.without(*lifted), tasks, facets=self.facets)

    def _standing_here(self, contacts: fb.Contacts) -> fb.State:
        """The standing posture where the feet are now: on the same place, turned as the robot is."""
        standing = self.robot.standing()
        if self.last is None or not self.robot.is_floating or not len(contacts):
            return standing
        present = self.last.final
        R, R0 = (state.frame_pose("base").rotation for state in (present, standing))
        turn = pin.exp3(np.array([0.0, 0.0, math.atan2(*(R @ R0.T)[[1, 0], 0])]))
        q = np.array(standing.q)
        q[3:7] = pin.Quaternion(turn @ R0).coeffs()
        turned = standing.replace(q=q)
        q[:2] += (contacts.positions(present) - contacts.positions(turned)).mean(axis=0)[:2]
        return turned.replace(q=q)

    def _walk(self, gait: str, wanted: bool) -> None:
        """Walk by a gait, or stand where the feet come down."""
        if wanted and isinstance(self.controller, Walk) and self.gait is not None:
            self.gait, self.controller.gait = gait, self._gait(gait)
        elif wanted:
            self._change(vars(self), "gait", gait)
        elif self.gait == gait and isinstance(self.controller, Walk):
            self.gait = None
            self.controller.gait = replace(self.controller.gait, stop=self.sim.time)

    def _gait(self, name: str) -> Gait:
        """A gait of `GAITS`, from a second on."""
        return GAITS[len(self.stance)][name](self.robot, start=self.sim.time + _AHEAD)

    def _go(self, i: int, value: float) -> None:
        """Set a part of the velocity; who walks goes on with it."""
        self.velocity[i] = value
        walk = self.controller
        if isinstance(walk, Walk):
            walk.velocity, walk.yaw_rate = self.velocity[:2], self.velocity[2]

    def _renew(self) -> None:
        """After a reset: a schedule counts from the clock's new beginning."""
        self.last = None
        self.controller = self._controller()
        self.run.use(self.controller)

    def _change(self, values: Any, key: Any, value: Any) -> None:
        """Set one of the values, and hand a new controller to the run, or say why there is none."""
        values[key] = value
        try:
            self.controller = self._controller()
            self.run.use(self.controller)
            self.note = ""
        except fb.FloatbaseError as error:
            self.note = str(error)

    def _push(self) -> None:
        angle = math.radians(self.towards)
        self.run.push([self.force * math.cos(angle), self.force * math.sin(angle), 0.0], frame=self.pushed)

    def _cut(self, facets: float) -> None:
        self.view.painter = self.view.painter.replace(round(facets))
        self._change(vars(self), "facets", round(facets))

    def _tell(self, status: str) -> None:
        """Show what stopped the run, if anything did, over the last picture."""
        self.outcome = "" if status == "running" else advice(status)
        with suppress(ViewerError):  # the window may be closed already
            if self.last is not None:
                self._show(self.last)

    def _show(self, record: fb.Rollout) -> None:
        """Draw the last row of a slice, under the time, the part of real time that this machine reaches, and messages."""
        self.last, now = record, float(record.time[-1])
        with self._drawing:
            speed = self.pace.update(now)
            pace = "" if speed is None else f", {speed:.0%} of real time"
            gait = f", {self.gait}" if self.gait else ""
            headline = f"{self.robot.name}{gait}, {now:.1f} s{pace}, control every {1e3 * self.period:g} ms"
            self.view.show(
                record.final, record.contacts, record.measured[-1], record.planned[-1], push=push_at(record, -1, SEEN),
                support=True, title="\n".join(filter(None, [headline, self.outcome, self.note])),
                extra=self.view.walking(self.controller, record.final) if isinstance(self.controller, Walk) else None,
            )  # fmt: skip


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


def control_period(sim: fb.Simulation, controller: Controller, share: float = 0.5) -> float:
    """The shortest of `PERIODS`, s, of which physics and controller need at most `share` on this machine; else the longest.

    The rest of the time is for pictures. Leaves the simulation reset.
    """
    ticks, clock = 10, [time.perf_counter()]
    for _ in range(4):  # the first one warms up, and the best of the others is this machine when it is not interrupted
        fb.rollout(sim, controller, ticks * PERIODS[0], control_period=PERIODS[0])
        clock.append(time.perf_counter())
    sim.reset()
    tick = min(end - begin for begin, end in pairwise(clock[1:])) / ticks
    return next((period for period in PERIODS if tick <= share * period), PERIODS[-1])
