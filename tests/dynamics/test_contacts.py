"""Contacts: Jacobians against MuJoCo, drifts by finite differences, names, selection, stacking."""

from dataclasses import dataclass

import judges
import numpy as np
import pytest
from messages import refused

import floatbase as fb
from floatbase.dynamics import FlatFootContact, PointContact
from floatbase.errors import InputError
from floatbase.robots import Foot

N = 10


robot = judges.every_floating_robot


def tilted(name: str, seed: int) -> fb.Contacts:
    """Make a robot's contacts on grounds with random inclinations."""
    robot = judges.load(name)
    normals = judges.random_normals(len(robot.feet), seed)
    make = fb.Contacts.flat_feet if name in judges.FLAT else fb.Contacts.points
    return make(robot, normals=normals)


def owners(contacts: fb.Contacts) -> list[str]:
    return [contact.name for contact in contacts.friction_contacts for _ in contact.point_names]


@dataclass
class Pad:
    """A user-defined contact with a == comparison that fails for arrays."""

    name: str
    normal: np.ndarray
    mu = 1.0
    k = 3
    row_names = ("x", "y", "z")

    @property
    def point_names(self) -> tuple[str, ...]:
        return (self.name,)

    def positions(self, state: fb.State) -> np.ndarray:
        return state.point(self.name)[None]

    def jacobian(self, state: fb.State, t: float = 0.0) -> np.ndarray:
        return state.frame_jacobian(self.name)[:3]

    def constraint(self, state: fb.State, t: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        return self.jacobian(state), -state.frame_drift(self.name)[:3]


def test_user_defined_contacts_are_selected_by_name():
    pads = [Pad(foot, np.array([0.0, 0.0, 1.0])) for foot in ("FL_foot", "FR_foot")]
    contacts = fb.Contacts(pads)
    assert contacts.force_slice("FR_foot") == slice(3, 6)
    assert contacts.only("FR_foot").names == contacts.without("FL_foot").names == ("FR_foot",)
    state = judges.load("go2").standing()
    eom = fb.equations_of_motion(state, contacts)
    feet = [PointContact(name) for name in contacts.names]
    assert np.allclose(eom.J, fb.equations_of_motion(state, fb.Contacts(feet)).J, atol=1e-12)


def test_contact_points_are_where_the_physics_has_them_for_any_normal(robot):
    for seed, state in enumerate(judges.states(robot.name, 3)):
        leaning, level = judges.random_normals(1, seed)[0], np.array([0.0, 0.0, 1.0])
        normal = leaning if robot.name in judges.BALLS else level
        sim = fb.Simulation(robot, fb.Ground(normal=normal))
        if robot.name in judges.FLAT:
            # corners are balls' lowest points, so only level soles can be compared
            state = robot.standing()
        sim.reset(state)
        make = fb.Contacts.flat_feet if robot.name in judges.FLAT else fb.Contacts.points
        contacts = make(robot, normals=normal)
        assert contacts.point_names == sim.point_names
        assert np.allclose(contacts.positions(state), sim.contact_positions(), atol=1e-9)


def test_the_contact_jacobian_is_mujocos_at_the_contact_point(robot):
    judge = judges.mujoco_of(robot.name)
    for seed, state in enumerate(judges.states(robot.name, N)):
        contacts = tilted(robot.name, seed)
        judge.move_to(state)
        points = zip(owners(contacts), contacts.positions(state), strict=True)
        expected = np.vstack([judge.jacobian(frame, point)[0] for frame, point in points])
        assert np.allclose(contacts.jacobian(state), expected, atol=1e-9)


def test_b_is_minus_the_change_of_a_v_along_v(robot):
    for seed, state in enumerate(judges.states(robot.name, N, spread=0.6)):
        contacts = tilted(robot.name, seed)
        expected = -judges.drift_of(lambda s, c=contacts: c.constraint(s)[0], state)
        assert np.max(np.abs(expected)) > 1e-3
        assert np.allclose(contacts.constraint(state)[1], expected, atol=1e-6)


@pytest.mark.parametrize("name", judges.FLAT)
def test_corner_forces_make_the_wrench_of_their_generators(name):
    rng = np.random.default_rng(0)
    for state in judges.states(name, N):
        for contact in judges.stance(state.robot):
            forces = rng.normal(size=(len(contact.corners), 3))
            origin = state.point(contact.frame)
            moment = np.cross(contact.positions(state) - origin, forces).sum(axis=0)
            wrench = contact.force_generator_matrix(state) @ forces.ravel()
            assert np.allclose(wrench, np.concatenate([forces.sum(axis=0), moment]), atol=1e-12)
            A, b = contact.constraint(state)
            assert isinstance(contact, FlatFootContact)
            assert (A.shape, b.shape) == ((6, state.robot.nv), (6,))
            assert np.allclose(contact.jacobian(state).T @ forces.ravel(), A.T @ wrench, atol=1e-12)


# names, choices, order ----------------------------------------------------------------------------


def test_all_feet_touch_by_default_in_the_robots_order(robot):
    contacts = judges.stance(robot)
    assert contacts.names == tuple(foot.frame for foot in robot.feet)
    assert len(contacts) == len(robot.feet)
    assert contacts.k == 3 * contacts.n_points == len(contacts.jacobian(robot.standing()))


def test_each_contact_has_its_own_slice_of_forces_and_rows(robot):
    state = robot.random_state(0)
    contacts = judges.stance(state.robot)
    J, stop = contacts.jacobian(state), 0
    for contact in contacts:
        part = contacts.force_slice(contact.name)
        assert part == slice(stop, stop + contact.k)
        assert np.array_equal(J[part], contact.jacobian(state))
        stop = part.stop
    assert stop == contacts.k


def test_only_and_without_keep_the_order_and_plus_puts_contacts_behind():
    contacts = fb.Contacts.points(judges.load("go2"))
    a, b, c, d = contacts.names
    assert contacts.only(c, a).names == (a, c) and contacts.without(b).names == (a, c, d)
    assert contacts.without(*contacts.names).names == ()
    assert (contacts.only(d) + contacts.only(a, b)).names == (d, a, b)
    assert (fb.Contacts.none() + contacts).names == contacts.names
    assert contacts.names == (a, b, c, d) and contacts["FR_foot"].name == "FR_foot"
    assert "FR_foot" in repr(contacts)


def test_normals_can_be_one_for_all_one_for_each_or_by_name(go2):
    names = fb.Contacts.points(go2).names
    lean = judges.random_normals(4, 0)
    assert np.allclose(fb.Contacts.points(go2).normals, [[0.0, 0.0, 1.0]] * 4)
    assert np.allclose(fb.Contacts.points(go2, normals=5.0 * lean[0]).normals, [lean[0]] * 4)
    assert np.allclose(fb.Contacts.points(go2, normals=lean).normals, lean)
    assert np.allclose(fb.Contacts.points(go2, frames=names[::-1], normals=lean).normals, lean)
    by_name = fb.Contacts.points(go2, normals={names[2]: lean[2]})
    assert np.allclose(by_name.normals, [[0, 0, 1], [0, 0, 1], lean[2], [0, 0, 1]])


def test_friction_is_that_of_each_contact_at_each_of_its_points(talos):
    left, right = (foot.frame for foot in talos.feet)
    sole = fb.Contacts.flat_feet(talos, mu=0.4, frames=[left])
    mixed = sole + fb.Contacts.points(talos, mu=0.9, frames=[right])
    assert np.array_equal(mixed.mus, [0.4, 0.4, 0.4, 0.4, 0.9])
    assert mixed.point_names == (*(f"{left} corner {i}" for i in range(4)), right)
    assert mixed.k == 15


def test_a_flat_foot_taken_as_a_point_touches_in_the_middle_of_its_corners(talos):
    state = talos.random_state(0)
    points = fb.Contacts.points(talos).positions(state)
    corners = fb.Contacts.flat_feet(talos).positions(state).reshape(2, 4, 3)
    assert np.allclose(points, corners.mean(axis=1), atol=1e-12)


def test_a_frame_that_is_no_foot_can_touch_at_its_origin():
    robot = judges.load("anymal_kinova")
    hand = robot.frames[-1]
    state = robot.random_state(0)
    contacts = fb.Contacts.points(robot, frames=[hand])
    assert np.allclose(contacts.positions(state), [state.point(hand)])


def test_no_contacts_give_empty_rows():
    state = judges.load("go2").random_state(0)
    none = fb.Contacts([])
    assert none.jacobian(state).shape == (0, 18) and none.constraint(state)[0].shape == (0, 18)
    assert none.constraint(state)[1].shape == (0,) and none.normals.shape == (0, 3)
    assert none.positions(state).shape == (0, 3)
    assert none.k == none.n_points == len(none) == len(fb.Contacts.none()) == 0


def test_each_foot_may_have_its_own_friction(talos):
    robot, mu = judges.load("go2"), (0.3, 0.4, 0.5, 0.6)
    assert np.array_equal(fb.Contacts.points(robot, mu=mu).mus, [0.3, 0.4, 0.5, 0.6])
    turned = fb.Contacts.points(robot, mu, frames=judges.stance(robot).names[::-1])
    assert turned["RR_foot"].mu == 0.3
    assert np.array_equal(fb.Contacts.points(robot, mu={"RL_foot": 0.2}).mus, [0.7, 0.7, 0.2, 0.7])
    assert np.array_equal(fb.Contacts.flat_feet(talos, mu=mu[:2]).mus, [0.3] * 4 + [0.4] * 4)


def test_the_force_of_a_contact_is_its_own_part_of_lambda_or_the_resultant_of_its_corners():
    rng = np.random.default_rng(0)
    for name in judges.FLOATING:
        contacts = judges.stance(judges.load(name))
        forces = rng.normal(size=(5, contacts.k))
        each = [contacts.force_of(forces, contact) for contact in contacts.names]
        assert all(force.shape == (5, 3) for force in each)
        assert np.allclose(sum(each), forces.reshape(5, -1, 3).sum(axis=1))
        assert np.allclose(contacts.force_of(forces[2], contacts.names[1]), each[1][2])
        if name in judges.BALLS:
            assert np.array_equal(each[1], forces[:, 3:6])


def test_feet_are_taken_as_they_are_flat_or_round(talos):
    for name in judges.ROBOTS:
        robot = judges.load(name)
        contacts = fb.Contacts.feet(robot, mu=0.4)
        assert contacts.names == tuple(foot.frame for foot in robot.feet)
        numbers = [12 if foot.is_flat else 3 for foot in robot.feet]
        assert [contact.k for contact in contacts] == numbers
        assert np.all(contacts.mus == 0.4)
    plate = Foot("base", corners=[[1, 0, 0], [0, 1, 0], [-1, 0, 0]])
    mixed = fb.load("go2", feet=[Foot("FL_foot", 0.02), plate])
    assert [contact.k for contact in fb.Contacts.feet(mixed)] == [3, 9]
    mixed = fb.Contacts.feet(talos, mu={"left_sole_link": 0.3})
    assert np.array_equal(mixed.mus, [0.3] * 4 + [0.7] * 4)


def test_a_floating_robot_without_feet_gets_a_hint_and_a_fixed_one_no_contacts(go2):
    legs = fb.load_urdf(go2.urdf, feet=[], posture=go2.posture)
    refused(lambda: fb.Contacts.feet(legs), InputError, "Contacts.points", "feet")
    assert len(fb.Simulation(legs).feet) == 0
    assert len(fb.Contacts.feet(judges.load("ur5"))) == 0


def test_a_ball_foots_contact_is_one_radius_below_the_frame_that_a_task_follows(go2, standing):
    sole = fb.Contacts.points(go2).positions(standing)[0]
    expected = [0.0, 0.0, go2.foot("FL_foot").radius]
    assert np.allclose(standing.point("FL_foot") - sole, expected, atol=1e-12)
    here = fb.FrameTask("FL_foot", standing.point("FL_foot"))
    eom = fb.equations_of_motion(standing, fb.Contacts.none())
    # no error to correct
    assert np.allclose(here.residual(eom).b, standing.frame_drift("FL_foot")[:3])
    # kp times the radius, m/s²
    assert np.linalg.norm(fb.FrameTask("FL_foot", sole).residual(eom).b) > 5.0


def test_a_user_defined_constraint_needs_no_friction_and_an_incomplete_one_is_refused(go2):
    class Rail:
        name, k, row_names = "rail", 1, ("across",)

        def jacobian(self, state: fb.State, t: float = 0.0) -> np.ndarray:
            return self.constraint(state, t)[0]

        def constraint(self, state: fb.State, t: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
            return np.eye(18)[6:7], np.zeros(1)

    contacts = fb.Contacts.points(go2, frames=["FL_foot"]) + fb.Contacts([Rail()])
    assert contacts.k == 4 and contacts.point_names == ("FL_foot",)
    assert [contact.name for contact in contacts.friction_contacts] == ["FL_foot"]
    assert fb.equations_of_motion(go2.standing(), contacts).A.shape == (4, 18)
    Rail.mu = 0.5
    refused(lambda: fb.Contacts([Rail()]), InputError, "rail", "normal", "point_names")
