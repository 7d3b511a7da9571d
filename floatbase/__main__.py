"""`python -m floatbase view go2`: a robot on the physics under the controller, live in a browser, without a notebook."""

from __future__ import annotations

import argparse
import signal
import sys
import threading
from collections.abc import Sequence

import floatbase as fb
from floatbase.objectives.tasks import Task
from floatbase.robots.robot import Robot
from floatbase.simulation.live import Live


class Playground:
    """A robot that stands on the physics, and the controls in the page that change what its controller wants.

    friction: of the ground; the controller's own belief about it is a control.
    """

    def __init__(self, robot: Robot, *, friction: float = 0.7, background: str = "light", port: int = 0):
        self.robot = robot
        self.sim = fb.Simulation(robot, friction)
        self.view = fb.Viewer(robot, background=background, port=port, facets=4 if robot.feet else None)
        self.mu, self.facets = friction, 4
        self.stance = {foot.frame: True for foot in robot.feet}
        self.shift = [0.0, 0.0, 0.0]  # m, of the centre of mass
        self.force = 0.1 * robot.weight  # N, of a push
        self.note = ""
        self.run = Live(self.sim, self._controller(), self._show)
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
        view.button("pause", self._pause)
        view.button("reset", self.run.reset)
        view.slider("speed", self.run.slow_motion, 1.0, 0.05, 1.0, 0.05)
        view.slider("push [N]", self._set_force, self.force, 0.0, 0.5 * weight, 1.0)
        for name, direction in (("push forwards", 0), ("push left", 1)):
            view.button(name, lambda axis=direction: self._push(axis))  # type: ignore[misc]
        if not self.robot.is_floating:
            return
        for axis, name in enumerate("xyz"):
            view.slider(f"CoM {name} [m]", lambda x, axis=axis: self._move(axis, x), 0.0, -0.08, 0.08, 0.005)  # type: ignore[misc]
        view.slider("friction believed", self._believe, self.mu, 0.1, 1.5, 0.05)
        view.slider("facets", self._cut, self.facets, 3, 16, 1)
        for foot in self.stance:
            view.checkbox(f"on {foot}", lambda on, foot=foot: self._stand(foot, on), True)  # type: ignore[misc]

    def _controller(self) -> fb.WholeBodyController:
        """The controller for what the controls ask for."""
        standing = self.robot.standing()
        tasks: tuple[Task, ...] = (fb.PostureTask(standing.q),)
        if self.robot.is_floating:
            rotation = standing.frame_pose("base").rotation
            tasks = (fb.CoMTask(standing.com + self.shift), fb.OrientationTask("base", rotation), *tasks)
        return fb.WholeBodyController(self.robot, self._contacts(), tasks, facets=self.facets)

    def _contacts(self) -> fb.Contacts:
        feet = [foot for foot in self.robot.feet if self.stance[foot.frame]]
        frames = [foot.frame for foot in feet]
        if not feet:
            return fb.Contacts.none()
        make = fb.Contacts.flat_feet if feet[0].is_flat else fb.Contacts.points
        return make(self.robot, mu=self.mu, frames=frames)

    def _change(self) -> None:
        """Hand a new controller to the run, or say why there is none."""
        try:
            self.run.use(self._controller())
            self.note = ""
        except fb.FloatbaseError as error:
            self.note = str(error)

    def _set_force(self, force: float) -> None:
        self.force = force

    def _push(self, axis: int) -> None:
        self.run.push([self.force if i == axis else 0.0 for i in range(3)])

    def _pause(self) -> None:
        self.run.pause()

    def _move(self, axis: int, distance: float) -> None:
        self.shift[axis] = distance
        self._change()

    def _believe(self, mu: float) -> None:
        self.mu = mu
        self._change()

    def _cut(self, facets: float) -> None:
        self.facets = round(facets)
        self.view.painter = self.view.painter.with_facets(self.facets)
        self._change()

    def _stand(self, foot: str, on: bool) -> None:
        self.stance[foot] = on
        self._change()

    def _show(self, record: fb.Rollout) -> None:
        """Draw the last row of a slice, with what stopped the run, if anything did."""
        push = next(((p.frame, p.force) for p in record.pushes if p.acts_at(float(record.time[-1]))), None)
        outcome = "" if record.outcome == "completed" else f"{record.outcome}: press reset"
        title = "\n".join(part for part in (f"{self.robot.name}, {record.time[-1]:.1f} s", outcome, self.note) if part)
        self.view.show(
            record.final, record.contacts, record.measured[-1], record.planned[-1], push=push, support=True, title=title
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="floatbase", description="Controlling floating-based robots.")
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("robots", help="list the robots and what they are for")
    view = commands.add_parser("view", help="a live robot in the browser; end it with Ctrl-C")
    view.add_argument("robot", help="a name that `robots` lists")
    view.add_argument("--friction", type=float, default=0.7, help="coefficient of friction of the ground (0.7)")
    view.add_argument("--background", default="light", help="white, light or dark (light)")
    view.add_argument("--port", type=int, default=0, help="port of the page (a free one)")
    view.add_argument("--no-browser", action="store_true", help="print the address and open nothing")
    asked = parser.parse_args(arguments)
    if asked.command == "robots":
        print("\n".join(f"{name:14} {text}" for name, text in fb.robots().items()))
        return 0
    try:
        return _view(asked)
    except fb.FloatbaseError as error:
        print(f"floatbase: {error}", file=sys.stderr)
        return 2


def _view(asked: argparse.Namespace) -> int:
    """Run until Ctrl-C or a polite kill."""
    ended = threading.Event()
    playground = Playground(fb.load(asked.robot), friction=asked.friction, background=asked.background, port=asked.port)
    before = {number: signal.signal(number, lambda *_: ended.set()) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        playground.start()
        print(f"{asked.robot} at {playground.view.url} (end with Ctrl-C)", flush=True)
        if not asked.no_browser:
            playground.view.window.open()
        while not ended.wait(timeout=0.5):
            pass
    finally:
        playground.close()
        for number, handler in before.items():
            signal.signal(number, handler)
    return 0


if __name__ == "__main__":
    sys.exit(main())
