"""Measure how go2 stands and trots through motor drivers, with delays and an unknown load.

    python benchmarks/servo.py    prints the table in docs/real_robot.md

The controller runs at 200 Hz and the drivers at 1 kHz. A delay is that of the measured state, or of
the commands on their way to the drivers. The table has the mean error of the base's height in the
second half of a run, in mm. The damping [N·m·s/rad] is a fortieth of the stiffness [N·m/rad].
"""

from collections import deque
from typing import Any

import floatbase as fb
from floatbase.actuators import JointServo
from floatbase.behaviours import Gait, Walk
from floatbase.simulation import Latency, Observed

PERIOD, DURATION = 0.005, 6.0  # s
DELAYS = 0.0, 0.005, 0.01, 0.02  # s
STIFFNESSES = 0.0, 20.0, 40.0, 80.0  # N·m/rad; 0: torques alone
LOAD = 3.0  # kg on the base, unknown to the controller
LEAKS = 5.0, 20.0  # 1/s

ROBOT = fb.load("go2")
STANDING = ROBOT.standing()
CONTACTS = fb.Contacts.feet(ROBOT, mu=0.6)
CARRIERS = ROBOT, ROBOT.with_payload("base", LOAD, [0.0, 0.0, 0.0])


class LateServo(JointServo):
    """Motor drivers that get the controller's commands late."""

    def __init__(self, stiffness: float, leak: float, delay: float):
        super().__init__(ROBOT, stiffness, stiffness / 40.0, leak)
        self.commands = deque[Any](maxlen=1 + round(delay / PERIOD))

    def receive(self, command: Any) -> None:
        self.commands.append(command)
        super().receive(self.commands[0])


def error(motion: str, carrier: fb.Robot, stiffness: float, leak: float, delays: Any) -> str:
    """The error of the height [mm], or "fell"; delays of the state and of the commands [s]."""
    controller: Any = fb.WholeBodyController(ROBOT, CONTACTS, fb.standing_tasks(STANDING))
    if motion == "trot":
        controller = Walk(ROBOT, CONTACTS, Gait.trot(ROBOT, start=0.2), (0.3, 0.0))
    controller = Observed(controller, Latency(q=delays[0], v=delays[0]))
    sim, servo = fb.Simulation(carrier), LateServo(stiffness, leak, delays[1])
    sim.reset(STANDING)
    run = fb.rollout(sim, controller, DURATION, control_period=PERIOD, actuators=servo)
    height = run.q[len(run) // 2 :, 2].mean() - STANDING.q[2]
    return str(round(1000.0 * height)) if run.outcome == "completed" else "fell"


if __name__ == "__main__":
    print("motion, leak, delay of | ms | no load:", *STIFFNESSES, "| 3 kg:", *STIFFNESSES)
    for motion, leak in (("stand", LEAKS[0]), *(("trot", leak) for leak in LEAKS)):
        for what in ("state", "commands"):
            for delay in DELAYS:
                delays = (delay, 0.0) if what == "state" else (0.0, delay)
                row = [error(motion, c, k, leak, delays) for c in CARRIERS for k in STIFFNESSES]
                print(f"{motion} | {leak:g} | {what} | {1000 * delay:g} |", " | ".join(row))
