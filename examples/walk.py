"""A quadruped trots forwards, turns left, and stops.

    python examples/walk.py

The program writes a page with the animation, which any browser shows. See docs/walking.md.
"""

from dataclasses import replace

import floatbase as fb
from floatbase.behaviours import Gait, Walk


def report(phase, run):
    """Print where the robot is at the end of a rollout."""
    x, y, _ = run.final.com
    print(f"{phase}: {run.outcome}, at x = {x:.2f} m, y = {y:.2f} m")


def main(duration=3.0, page="walk.html"):
    """Walk for three rollouts of `duration` seconds, and write the second one to a page."""
    robot = fb.load("go2")
    walk = Walk(robot, fb.Contacts.feet(robot, mu=0.6), Gait.trot(robot, start=0.3))
    sim = fb.Simulation(robot)  # each rollout continues where the one before ended

    walk.velocity = (0.3, 0.0)  # forwards and to the left [m/s]
    report("forwards", fb.rollout(sim, walk, duration))

    walk.yaw_rate = 0.5  # to the left [rad/s]
    turn = fb.rollout(sim, walk, duration)
    report("turning left", turn)

    walk.gait = replace(walk.gait, stop=walk.time)
    report("stopping", fb.rollout(sim, walk, duration))

    view = fb.Viewer(robot)
    view.play(turn, steps=walk.history)
    view.save(page)
    print(f"The turn is in {page}.")


if __name__ == "__main__":
    main()
