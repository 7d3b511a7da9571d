"""The largest push that a standing quadruped survives, in each direction.

    python examples/push_recovery_map.py

The program writes a polar plot. See docs/push_recovery.md.
"""

import numpy as np

import floatbase as fb
from floatbase.viewer.plots import push_recovery_plots


def main(directions=8, resolution=10.0, workers=None, picture="push_recovery_map.png"):
    """Find the pushes in several processes, print them, and plot them."""
    robot = fb.load("go2")
    contacts = fb.Contacts.points(robot, mu=0.7)
    controller = fb.WholeBodyController(robot, contacts, fb.standing_tasks(robot.standing()))
    result = fb.push_recovery(
        controller, directions=directions, resolution=resolution, workers=workers
    )
    for angle, push in zip(np.rad2deg(result.directions), result.pushes, strict=True):
        print(f"{angle:4.0f}°  {push:4.0f} N")
    axes = push_recovery_plots.plot(result)
    axes.figure.savefig(picture)
    print(f"The map is in {picture}.")


if __name__ == "__main__":
    main()
