"""Falls end on the ground: no link is below it, and nothing before the fall changes.

A live run shows them to the end.
"""

import copy
import pickle
import threading
from collections.abc import Iterator

import judges
import numpy as np
import pinocchio as pin
import pytest
from waiting import until

import floatbase as fb
from floatbase.playground import Perturbation, PerturbedSimulation
from floatbase.simulation import LiveSimulation

# m below the ground, at most: a contact that supports a robot yields by less than a millimetre
DEPTH = 5e-3
PERIOD = 2e-3
SETTLING_TIME = 3.0  # s
SLOW = 0.5  # m/s and rad/s: a leg in the air may still sink against the joint damping
ROW_NAMES = ("time", "q", "v", "tau", "tau_desired", "planned", "measured", "foot_positions")


def pushed(
    name: str,
    force: float,
    towards: float,
    settling_time: float = SETTLING_TIME,
    sim: fb.Simulation | None = None,
) -> fb.Rollout:
    """Simulate a standing robot that is pushed for 0.1 s.

    The direction `towards` is in degrees, from forwards to the left.
    """
    sim = sim or fb.Simulation(judges.load(name))
    push = fb.Push.horizontal(force, towards, start=0.05)
    controller = judges.controller_of(name)
    return fb.rollout(sim, controller, 2.0, [push], PERIOD, settling_time=settling_time)


def lowest(state: fb.State) -> float:
    """Return the lowest corner of the collision shapes [m], by Pinocchio alone."""
    robot = state.robot
    folders = [str(folder) for folder in robot.package_dirs]
    shapes = pin.buildGeomFromUrdfString(
        robot.model, robot.urdf, pin.COLLISION, package_dirs=folders
    )
    data, placed, low = robot.model.createData(), shapes.createData(), np.inf
    pin.updateGeometryPlacements(robot.model, data, shapes, placed, state.q)
    for item, at in zip(shapes.geometryObjects, placed.oMg, strict=True):
        shape = item.geometry
        if hasattr(shape, "halfSide"):
            signs = 2.0 * np.indices((2, 2, 2)).reshape(3, 8).T - 1.0
            corners = np.array(shape.halfSide).ravel() * signs
        elif hasattr(shape, "vertices"):
            corners = np.array(shape.vertices())
        else:  # its axis
            corners = np.outer([-1.0, 1.0], [0.0, 0.0, getattr(shape, "halfLength", 0.0)])
        low = min(low, (corners @ at.rotation.T + at.translation)[:, 2].min())
    return float(low)


@pytest.mark.parametrize(
    ("name", "towards"),
    [("go2", 20.0), ("go2", 110.0), ("go2", 180.0), ("talos", 80.0), ("anymal_kinova", 190.0)],
)
def test_a_robot_that_is_pushed_hard_lies_on_the_ground_at_the_end(name, towards):
    is_go2 = name == "go2"
    force = 400.0 if is_go2 else 4.0 * judges.load(name).weight
    record = pushed(name, force, towards, SETTLING_TIME if is_go2 else 2.5)
    assert record.outcome in ("fell", "controller failed")
    assert lowest(record.final) > (-DEPTH if is_go2 else -2.0 * DEPTH)  # arms may still swing
    assert record.final.com[2] < 0.6 * record.state(0).com[2]
    if is_go2:
        assert record.final.q[2] < 0.5 * record.q[0, 2]
        assert np.abs(record.final.v).max() < SLOW  # at rest


def test_where_links_touch_nothing_the_trunk_goes_into_the_ground():
    sim = fb.Simulation(judges.load("go2"))
    pushed("go2", 400.0, 20.0, settling_time=0.0, sim=sim)
    assert not sim.link_collisions
    run_limp(sim, 1500)
    assert lowest(sim.state) < -10.0 * DEPTH


def run_limp(sim: fb.Simulation, steps: int) -> None:
    for _ in range(steps):
        sim.step(np.zeros(sim.robot.d))


@pytest.mark.parametrize("towards", [20.0, 110.0])
def test_a_rollout_that_settles_is_the_same_up_to_the_fall(towards):
    short, long = (pushed("go2", 400.0, towards, settle) for settle in (0.0, SETTLING_TIME))
    n = len(short)
    assert len(long) == n + round(SETTLING_TIME / PERIOD)
    assert (long.outcome, long.controller_off_time) == (short.outcome, short.controller_off_time)
    for name in ROW_NAMES:
        assert np.array_equal(getattr(long, name)[:n], getattr(short, name), equal_nan=True), name
    assert long.time[n] == pytest.approx(long.controller_off_time)
    assert np.allclose(np.diff(long.time), PERIOD)
    assert np.isnan(long.planned[n:]).all() and np.isfinite(long.planned[:n]).all()


def test_motors_brake_within_their_limits():
    record = pushed("go2", 400.0, 20.0)
    n = int(np.searchsorted(record.time, record.controller_off_time or 0.0))
    power = np.einsum("ij,ij->i", record.tau_desired[n:], record.v[n:, 6:])
    assert power.max() <= 0.0 and power.min() < -1.0
    assert np.all(np.abs(record.tau) <= record.robot.torque_limits + 1e-9)


def test_a_run_that_ends_well_has_no_fall():
    sim = fb.Simulation(judges.load("go2"))
    record = fb.rollout(sim, judges.controller_of("go2"), 0.02, settling_time=0.1)
    assert (record.outcome, record.controller_off_time, len(record)) == ("completed", None, 20)


def test_a_controller_that_fails_at_once_lets_the_robot_lie_down():
    def fails(q: np.ndarray, v: np.ndarray, t: float) -> None:
        raise fb.InfeasibleError("no answer")

    record = fb.rollout(fb.Simulation(judges.load("go2")), fails, 0.1, settling_time=1.5)
    expected = ("controller failed", 0.0, 1500)
    assert (record.outcome, record.controller_off_time, len(record)) == expected
    assert record.final.q[2] < 0.5 * record.q[0, 2] and lowest(record.final) > -DEPTH


def test_an_actuator_that_fails_within_a_tick_leaves_no_half_row(go2):
    """Torques, forces and times are those of complete control steps."""

    class Breaks:
        steps = 0

        def step(self, tau: np.ndarray, q: np.ndarray, v: np.ndarray, dt: float) -> np.ndarray:
            self.steps += 1
            return tau if self.steps < 14 else np.full(12, np.nan)

    options = {"control_period": 5e-3, "actuators": Breaks(), "settling_time": 0.1}
    record = fb.rollout(fb.Simulation(go2), judges.controller_of("go2"), 0.1, **options)
    assert record.outcome == "controller failed" and len(record) == 2 + 20
    assert record.controller_off_time == pytest.approx(0.013)
    assert np.allclose(np.diff(record.time)[2:], 5e-3)
    expected = np.clip(record.tau_desired[2], -go2.torque_limits, go2.torque_limits)
    assert np.allclose(record.tau[2], expected, atol=1e-9)
    assert np.abs(record.tau_desired[2]).max() > 1e-3


def test_links_touch_from_a_fall_to_the_next_reset(go2):
    sim = fb.Simulation(go2)
    once = pushed("go2", 100.0, 90.0, sim=sim)
    sim.reset()
    assert not sim.link_collisions
    pushed("go2", 400.0, 20.0, sim=sim)
    assert sim.link_collisions and copy.deepcopy(sim).link_collisions
    sim.reset()
    again = pushed("go2", 100.0, 90.0, sim=sim)
    assert not sim.link_collisions and once.outcome == again.outcome == "completed"
    assert np.array_equal(once.q, again.q) and np.array_equal(once.measured, again.measured)


def test_forces_are_those_at_the_feet_whatever_else_touches():
    """A lying robot's feet support only part of its weight, as other links touch; none pulls."""
    record = pushed("go2", 400.0, 180.0)
    pressing = record.measured.reshape(len(record), -1, 3)[-1, :, 2]
    assert pressing.min() >= 0.0 and pressing.sum() < 0.9 * record.robot.weight


def test_a_robot_that_begins_to_lie_is_where_it_was():
    """Switching link collisions on and off changes neither state, time, forces nor feet."""
    sim = fb.Simulation(judges.load("go2"))
    for _ in range(50):
        sim.step(np.full(12, 0.5))
    state = sim.state
    before = (sim.time, sim.torques(), sim.contact_positions(), sim.contact_forces())
    for touch in (True, False):
        sim.link_collisions = touch
        assert np.array_equal(sim.q, state.q) and np.array_equal(sim.v, state.v)
        after = sim.time, sim.torques(), sim.contact_positions(), sim.contact_forces()
        assert after[0] == before[0] and np.array_equal(after[1], before[1])
        assert np.allclose(after[2], before[2], atol=2e-3)  # forces are one timestep old
        assert sim.contact_forces().shape == (4, 3) and np.all(sim.contact_forces()[:, 2] >= 0.0)


def test_a_perturbation_is_kept_while_the_robot_lies_and_after_a_reset():
    sim = PerturbedSimulation(judges.load("go2"))
    sim.link_collisions = True
    sim.perturbation = Perturbation(
        mass=1.5, disabled_contacts=["FL_foot"], velocity_forces=False, adhesion_force=5.0
    )
    for _ in range(2):
        run_limp(sim, 1)
        assert not np.any(sim.contact_forces()[0]) and np.any(sim.contact_forces()[1])
        sim.link_collisions = False
        run_limp(sim, 20)
        assert not np.any(sim.contact_forces()[0])
        sim.reset()
    assert sim.model.body_mass.sum() == pytest.approx(1.5 * sim.robot.mass)
    sim.perturbation = Perturbation()
    sim.reset()
    run_limp(sim, 1)
    assert sim.contact_forces()[0, 2] > 0.0


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda sim: pickle.loads(pickle.dumps(sim))])
def test_a_copy_of_a_robot_that_lies_moves_alone(copied):
    sim, fresh = (fb.Simulation(judges.load("go2")) for _ in range(2))
    sim.link_collisions = True
    other = copied(sim)
    run_limp(other, 20)
    assert sim.time == 0.0 and other.link_collisions
    other.reset()
    run_limp(other, 1)
    run_limp(fresh, 1)
    assert np.array_equal(other.q, fresh.q)
    assert np.array_equal(other.contact_forces(), fresh.contact_forces())
    run_limp(sim, 1)
    assert sim.link_collisions and sim.time == pytest.approx(sim.timestep)


def test_a_robot_without_its_meshes_keeps_a_hull_for_every_link():
    """A link without its mesh file has the hull of another shape, or a box with its inertia."""
    robot = judges.load("anymal_kinova")
    bare = fb.load_urdf(robot.urdf, feet=list(robot.feet), posture=robot.posture)
    sims = [fb.Simulation(one) for one in (bare, robot)]
    for sim in sims:
        sim.link_collisions = True
    bare_sizes, sizes = (
        {sim.model.geom(i).name: sim.model.geom_rbound[i] for i in range(sim.model.ngeom)}
        for sim in sims
    )
    assert sims[0].model.nmesh == sims[1].model.nmesh > 0
    # a box of a link's inertia has about its size
    assert all(0.3 * size < bare_sizes[name] < 3.0 * size for name, size in sizes.items() if size)
    assert bare_sizes != sizes


def test_an_arm_that_is_bolted_to_the_ground_has_no_hulls():
    sim = fb.Simulation(judges.load("ur5"))
    sim.link_collisions = True
    assert sim.model.ngeom == 1


# live ---------------------------------------------------------------------------------------------


@pytest.fixture
def slices() -> list[fb.Rollout]:
    return []


@pytest.fixture
def run(slices: list[fb.Rollout]) -> Iterator[LiveSimulation]:
    sim = fb.Simulation(judges.load("go2"))
    live = LiveSimulation(sim, judges.controller_of("go2"), slices.append)
    yield live
    live.close()


FALL = [400.0 * np.cos(0.35), 400.0 * np.sin(0.35), 0.0]


def test_a_live_fall_is_reported_at_once_and_simulated_until_rest(run, slices):
    told: list[tuple[str, int]] = []
    run.on_status(lambda status: told.append((status, len(slices))))
    run.push(FALL)
    until(lambda: not run.is_simulating)
    run.close()
    assert [status for status, _ in told] == ["running", "fell"]
    fell = slices[told[1][1] - 1 :]  # from the report of the fall on
    assert len(fell) > 4
    assert all(record.outcome == "fell" for record in fell)
    assert len({record.controller_off_time for record in fell}) == 1
    assert np.allclose(np.diff(np.concatenate([record.time for record in slices])), PERIOD)
    assert fell[-1].time[-1] - (fell[-1].controller_off_time or 0.0) < 1.6
    assert lowest(fell[-1].final) > -DEPTH
    assert run.status == "fell"


def fall_and_wait(run: LiveSimulation, slices: list[fb.Rollout]) -> int:
    """Push until the robot falls and another slice is shown; return the number of slices."""
    run.push(FALL)
    until(lambda: run.status == "fell")
    count = len(slices)
    until(lambda: len(slices) > count)
    assert run.is_simulating
    return len(slices)


def test_a_push_or_a_reset_in_mid_fall_begins_anew(run, slices):
    for again in (run.reset, lambda: run.push([0.0, 20.0, 0.0])):
        count = fall_and_wait(run, slices)
        again()
        until(lambda count=count: any(record.time[0] == 0.0 for record in slices[count:]))
        assert run.status == "running" and not run.sim.link_collisions
        until(lambda: slices[-1].time[-1] > 0.2)
        assert slices[-1].outcome == "completed"


def test_a_pause_in_mid_fall_stops_the_picture_and_a_start_begins_anew(run, slices):
    fall_and_wait(run, slices)
    run.close()
    count = len(slices)
    assert (run.status, run.is_simulating) == ("fell", False)
    assert not threading.Event().wait(0.1) and len(slices) == count
    run.start()
    until(lambda: len(slices) > count)
    assert slices[count].time[0] == 0.0


def test_another_simulation_in_mid_fall_does_not_fall(run, slices):
    fall_and_wait(run, slices)
    other = fb.Simulation(judges.load("go2"))
    run.set_controller(judges.controller_of("go2"), sim=other)
    run.close()
    assert other.time == 0.0 and not other.link_collisions


def test_an_error_while_a_fall_is_drawn_is_reported():
    fallen: list[fb.Rollout] = []

    def show(record: fb.Rollout) -> None:
        if record.outcome == "fell":
            fallen.append(record)
        if len(fallen) == 3:
            raise ValueError("no window")

    run = LiveSimulation(fb.Simulation(judges.load("go2")), judges.controller_of("go2"), show)
    run.push(FALL)
    until(lambda: "no window" in run.reason)
    until(lambda: not run.is_simulating)
    run.close()
