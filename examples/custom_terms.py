"""Your own task and your own constraint in the whole-body controller.

    python examples/custom_terms.py

A quadruped moves up and down. A user-defined task takes load off one foot. A user-defined
constraint limits the mechanical power of the motors. See docs/whole_body_controller.md.
"""

import numpy as np

import floatbase as fb
from floatbase.control import LinearInequality


class FootLoadTask:
    """Give a foot a vertical force [N]. Any object with these four members is a task."""

    name, block, weight = "load of a foot", "forces", 0.1

    def __init__(self, foot, load):
        self.foot, self.load = foot, load

    def residual(self, eom, t=0.0):
        """Return the vertical force of the foot minus the desired one, as A λ + b."""
        A = np.zeros((1, eom.k))
        A[0, 3 * eom.contacts.names.index(self.foot) + 2] = 1.0
        return fb.Affine(A, [-self.load])


def power_limit(watts):
    """Limit the power q̇ᵀ τ of all motors. The velocity is known, so the power is linear in τ."""
    return LinearInequality("power", "tau", lambda eom, t: (eom.state.v[None, 6:], [watts]))


def main(duration=2.0, watts=10.0):
    """Move up and down, first without and then with the task and the constraint."""
    robot = fb.load("go2")
    state = robot.standing()

    def up_and_down(t):  # 3 cm, twice a second
        return state.com + [0.0, 0.0, 0.03 * np.sin(4.0 * np.pi * t)]

    tasks = [fb.CoMTask(up_and_down), *fb.standing_tasks(state)[1:]]
    for extra_tasks, extra_limits in (
        ([], []),
        ([FootLoadTask("FL_foot", 20.0)], [power_limit(watts)]),
    ):
        controller = fb.WholeBodyController(
            robot, fb.Contacts.points(robot), [*tasks, *extra_tasks], inequalities=extra_limits
        )
        run = fb.rollout(fb.Simulation(robot), controller, duration)
        power = np.sum(run.tau * run.v[:, 6:], axis=1).max()
        load = run.force("FL_foot")[:, 2].mean()
        print(f"{run.outcome}: power of at most {power:.1f} W, {load:.0f} N on the front left foot")


if __name__ == "__main__":
    main()
