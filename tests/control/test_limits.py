"""User-defined inequalities and bounds of normal forces on both backends.

They are respected, named when they conflict, and refused if they do not fit.
"""

import judges
import numpy as np
import pytest
from messages import raises

import floatbase as fb
from floatbase.control import LinearInequality
from floatbase.dynamics import EquationsOfMotion, PointContact
from floatbase.errors import InfeasibleError, InputError, UnknownNameError

# rows ---------------------------------------------------------------------------------------------


def user_inequalities(robot: fb.Robot, contacts: fb.Contacts) -> list[LinearInequality]:
    """Return limits of joint accelerations, of the total normal force and of a torque combination.

    The last one shrinks with time.
    """
    E, up = np.eye(robot.nv)[robot.nv - robot.d :], np.zeros((1, contacts.k))
    up[0, contacts.point_force_indices[2::3]] = 1.0
    turns = np.resize([1.0, -1.0], (1, robot.d))
    sides = [f"{joint} {side}" for side in ("upper", "lower") for joint in robot.joint_names]
    accelerations = (np.vstack([E, -E]), np.full(2 * robot.d, 30.0))

    def joined(eom: EquationsOfMotion, t: float) -> tuple[np.ndarray, np.ndarray]:
        return np.vstack([turns, -turns]), np.full(2, (0.01 - 0.002 * t) * robot.weight)

    return [
        LinearInequality("acceleration limit", "qdd", accelerations, sides),
        LinearInequality("total force", "forces", (up, [1.05 * robot.weight])),
        LinearInequality("joined torques", "tau", joined),
    ]


@pytest.mark.parametrize("robot", ["go2", "talos"], indirect=True)
def test_user_defined_inequalities_hold_and_have_their_names_on_both_backends(robot):
    contacts = judges.stance(robot)
    inequalities = user_inequalities(robot, contacts)
    compiled, reference = judges.pair(robot, contacts, inequalities=inequalities)
    kinds: set[str] = set()
    for i, state in enumerate(judges.near_and_far(robot.name, 6)):
        t = 0.1 * i
        assert judges.difference(compiled, reference, state, t) < judges.agreement(robot)
        try:
            command, expected = compiled(state.q, state.v, t), reference(state.q, state.v, t)
        except InfeasibleError:
            continue
        eom = fb.equations_of_motion(state, contacts)
        for each in inequalities:
            G, h = each.at(eom, t)
            assert np.all(G @ command.solution[each.block] <= h + 1e-6)
        if robot.name != "talos":  # four corners share one wrench: rows can be dependent
            assert command.active == expected.active
        kinds |= {row.kind for row in command.active} | {row.owner for row in command.active}
    assert {"acceleration limit", "total force", "joined torques"} <= kinds


def test_conflicting_inequalities_are_reported_by_name(go2):
    light = LinearInequality("light feet", "forces", (np.tile([0.0, 0.0, 1.0], (1, 4)), [0.0]))
    options = {"inequalities": [light], "min_normal_force": 10.0}
    for controller in judges.pair(go2, judges.stance(go2), [], **options):
        with raises(InfeasibleError, "light feet") as caught:
            controller(go2.standing().q, np.zeros(18))
        conflict = caught.value.constraints
        row = next(row for row in conflict if row == "light feet")
        assert (row.kind, row.owner, row.number) == ("inequality", "light feet", 0)
        assert judges.is_smallest_conflict(controller.qp(go2.standing()), conflict)


# forces over time ---------------------------------------------------------------------------------


def test_a_foot_is_unloaded_by_a_bound_that_falls_with_time(go2):
    share = 0.25 * go2.weight
    windows = {
        "min_normal_force": {"RR_foot": 12.0, "RL_foot": lambda t: 5.0 * t},
        "max_normal_force": {"FL_foot": lambda t: share * (1.0 - t), "RR_foot": 2.0 * share},
    }
    contacts = judges.stance(go2)
    both = judges.pair(go2, contacts, **windows)
    for t in (0.0, 0.25, 0.5, 1.0):
        command = both[0](go2.standing().q, np.zeros(18), t)
        normal = dict(zip(contacts.point_names, command.forces.reshape(-1, 3)[:, 2], strict=True))
        assert normal["FL_foot"] <= share * (1.0 - t) + 1e-6 and normal["RR_foot"] >= 12.0 - 1e-6
        assert normal["RL_foot"] >= 5.0 * t - 1e-6
        assert t == 0.0 or "FL_foot largest normal force" in command.active
        assert command.active == both[1](go2.standing().q, np.zeros(18), t).active
        gap = judges.largest_difference(both, judges.near_and_far("go2", 3), t)
        assert gap < judges.agreement(go2)
    row = next(row for row in command.active if row.endswith("largest normal force"))
    assert (row.kind, row.owner) == ("largest normal force", "FL_foot")


def test_bounds_of_normal_forces_on_flat_feet_are_those_of_their_corners(talos):
    contacts = fb.Contacts.flat_feet(talos)
    windows = {"min_normal_force": {contacts.names[0]: 40.0}, "max_normal_force": 150.0}
    both = judges.pair(talos, contacts, **windows)
    normal = both[0](talos.standing().q, np.zeros(talos.nv)).forces[2::3]
    assert np.all(normal[:4] >= 40.0 - 1e-6) and np.all(normal <= 150.0 + 1e-6)
    gap = judges.largest_difference(both, judges.near_and_far("talos", 3))
    assert gap < judges.agreement(talos)


class Heel(PointContact):
    """A contact whose name is not the name of a frame."""

    name = "heel"


def test_a_foot_that_lifts_keeps_its_bound_for_when_it_stands_again(backend, go2):
    state = go2.standing()  # each foot carries more than the bound of 20 N
    tasks = list(fb.standing_tasks(state))
    heel = fb.Contacts([Heel("RL_foot", radius=0.022)])
    stand = fb.Contacts.points(go2).without("RL_foot") + heel
    swing = stand.without("FL_foot", "heel")

    def torques(contacts: fb.Contacts, **bounds: object) -> np.ndarray:
        made = fb.WholeBodyController(go2, contacts, tasks, backend=backend, **bounds)
        return made(state.q, state.v, 0.1).tau

    bounds = {
        "min_normal_force": {"heel": 15.0, "RR_foot": 12.0},
        "max_normal_force": {"FL_foot": lambda t: 20.0 + t},
    }
    standing = fb.WholeBodyController(go2, stand, tasks, backend=backend, **bounds)
    lifted = standing.replace(contacts=swing)
    other = lifted.replace(torque_limits=go2.torque_limits)
    alone = torques(swing, min_normal_force={"RR_foot": 12.0})
    for each in (lifted, other):
        assert each.backend == backend
        assert np.array_equal(each(state.q, state.v, 0.1).tau, alone)
        back = each.replace(contacts=stand)(state.q, state.v, 0.1)
        assert np.array_equal(back.tau, standing(state.q, state.v, 0.1).tau)
        assert "FL_foot largest normal force" in back.active
    expected = torques(swing, **bounds | {"min_normal_force": {"RR_foot": 12.0}})
    assert np.array_equal(lifted(state.q, state.v, 0.1).tau, expected)
    with raises(UnknownNameError, "min_normal_force", "heel"):
        # a new controller knows the robot's feet, but no other absent contact
        torques(swing, **bounds)


def test_a_time_varying_bound_is_evaluated_once_at_a_time(backend):
    asked = []
    bound = {"FL_foot": lambda t: asked.append(t) or 50.0}
    controller = judges.controller_of("go2", max_normal_force=bound, backend=backend)
    assert asked == [0.0]
    controller(judges.load("go2").standing().q, np.zeros(18), 0.5)
    assert asked == [0.0, 0.5]
    controller.replace(facets=4)
    assert asked == [0.0, 0.5, 0.0]
    controller.replace(contacts=controller.contacts.without("FL_foot"))
    assert asked == [0.0, 0.5, 0.0]


def test_a_bound_that_goes_wrong_is_reported_on_both_backends(go2):
    bound = {"FL_foot": lambda t: 50.0 if t < 1.0 else np.nan}
    for controller in judges.pair(go2, judges.stance(go2), [], max_normal_force=bound):
        assert controller(go2.standing().q, np.zeros(18)).backend == controller.backend
        with raises(InputError, "max_normal_force", "FL_foot", np.nan):
            controller(go2.standing().q, np.zeros(18), 1.0)


def test_a_replaced_controller_is_checked(backend):
    controller = judges.controller_of("go2", backend=backend)
    short = LinearInequality("r", "tau", (np.eye(3), np.ones(3)))
    with raises(InputError, "r", "tau", 3, 12):
        controller.replace(inequalities=[short])
    with raises(UnknownNameError, "max_normal_force", "FL_fot", "FL_foot"):
        controller.replace(max_normal_force={"FL_fot": 1.0})
    with raises(InputError, "q", "arm", 5):
        controller.replace(tasks=[fb.PostureTask(np.zeros(5), name="arm")])
