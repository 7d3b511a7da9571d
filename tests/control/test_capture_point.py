"""The capture-point inequality in physics; test_independent_qps has its rows."""

import judges
import numpy as np
from messages import refused
from scipy.spatial import ConvexHull

import floatbase as fb
from floatbase.control import capture_point_inequality
from floatbase.errors import InputError


def polygon(state: fb.State, contacts: fb.Contacts) -> np.ndarray:
    """Return the half-planes n · x + d ≤ 0 of the support polygon, shape (e, 3)."""
    return ConvexHull(contacts.positions(state)[:, :2]).equations


def simulate(tasks: list, inequalities: list, duration: float, *pushes: fb.Push) -> fb.Rollout:
    """Simulate go2 with these tasks and inequalities."""
    robot = judges.load("go2")
    contacts = judges.stance(robot)
    controller = fb.WholeBodyController(robot, contacts, tasks, inequalities=inequalities)
    return fb.rollout(fb.Simulation(robot), controller, duration, pushes, control_period=2e-3)


def test_a_target_outside_the_support_polygon_makes_the_robot_fall_only_without_it(go2):
    contacts, standing = judges.stance(go2), go2.standing()
    tasks = [fb.CoMTask(standing.com + [0.0, 0.2, 0.0]), *fb.standing_tasks(standing)[1:]]
    runs = [simulate(tasks, rows, 1.5) for rows in ([], [capture_point_inequality(0.03)])]
    assert runs[0].outcome != "completed" and runs[1].outcome == "completed"
    edges, end = polygon(runs[1].final, contacts), runs[1].final.com
    inside = -np.max(edges[:, :2] @ end[:2] + edges[:, 2])
    assert 0.0 < inside < 0.06 and end[1] > standing.com[1] + 0.05  # it leans towards the target


def test_a_push_that_topples_a_soft_controller_does_not_topple_it_with_the_inequality(go2):
    standing = go2.standing()
    tasks = [fb.CoMTask(standing.com, kp=10.0), *fb.standing_tasks(standing)[1:]]
    push = fb.Push([0.0, 180.0, 0.0], start=0.1, duration=0.1)
    inequality = capture_point_inequality(0.02, horizon=0.02)
    runs = [simulate(tasks, rows, 1.2, push) for rows in ([], [inequality])]
    assert runs[0].outcome != "completed" and runs[1].outcome == "completed"


def test_without_a_support_polygon_or_above_the_centre_of_mass_there_are_no_rows(go2):
    state, inequality = go2.standing(), capture_point_inequality()
    two = fb.Contacts.points(go2, frames=["FL_foot", "RR_foot"])
    for contacts, number in ((two, 2), (fb.Contacts.none(), 0)):
        eom = fb.equations_of_motion(state, contacts)
        refused(lambda eom=eom: inequality.at(eom), InputError, number, 3)
    q = state.q.copy()
    q[3:7] = [1.0, 0.0, 0.0, 0.0]  # on its back
    upside_down = fb.equations_of_motion(state.replace(q=q), fb.Contacts.points(go2))
    refused(lambda: inequality.at(upside_down), InputError, "height")
    refused(lambda: capture_point_inequality(horizon=0.0), InputError, "horizon", 0)
