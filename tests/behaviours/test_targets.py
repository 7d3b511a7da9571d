"""The compiled targets of a walk against the functions that define them, and those by differences.

The plans belong to random states, paths, phases, slopes and desired motions.
"""

from __future__ import annotations

from typing import NamedTuple

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase.behaviours import Gait
from floatbase.behaviours.active_plan import ActivePlan
from floatbase.behaviours.path import DesiredMotion, Path
from floatbase.behaviours.plan import StepOptions, StepPlan, first_footing, make_plan
from floatbase.behaviours.posture import WalkingPosture
from floatbase.behaviours.swing import Swing
from floatbase.behaviours.targets import BodyPose

REACH, N_PLANS, N_STEPS = 0.2, 15, 12
ROBOTS = {"go2": Gait.trot, "hyq": Gait.crawl, "talos": Gait.walk}


class Slope(NamedTuple):
    """A plane as a terrain."""

    gradient: np.ndarray
    level: float

    def height(self, xy: np.ndarray) -> float:
        return float(self.gradient @ xy + self.level)

    def normal(self, xy: np.ndarray) -> np.ndarray:
        normal = np.array([*-self.gradient, 1.0])
        return normal / np.linalg.norm(normal)


class Case(NamedTuple):
    """A plan with what else determines its targets."""

    posture: WalkingPosture
    plan: StepPlan
    desired: DesiredMotion
    pose: BodyPose
    state: fb.State

    def active(self, compiled: bool) -> tuple[ActivePlan, np.ndarray]:
        """Return the plan in use, and an array for its targets."""
        names = ["centre of mass", "orientation of base"]
        names += [f"position of {foot}" for foot in self.plan.planned_swings]
        names += [f"orientation of {foot}" for foot in self.posture.flat_feet]
        entries = {name: slice(20 * i, 20 * i + size(name)) for i, name in enumerate(names)}
        plan = ActivePlan(
            self.posture, self.plan, self.desired, self.pose, REACH, entries, None, compiled
        )
        return plan, np.zeros(20 * len(names))


def size(name: str) -> int:
    return 15 if name.startswith("orientation") else 9


def cases(name: str, known_ground: bool) -> list[Case]:
    rng, robot = np.random.default_rng(1), judges.load(name)
    posture = WalkingPosture(fb.Contacts.feet(robot, mu=0.6), robot.standing())
    gait, found = ROBOTS[name](robot, start=0.0), []
    for state in judges.states(name, N_PLANS, 0.05):
        ground = Slope(rng.normal(0.0, 0.15, 2), rng.normal(0.0, 0.1)) if known_ground else None
        t = float(rng.uniform(1.0, 3.0)) * gait.period
        while len(gait.stance(t)) == len(gait.feet):
            t += 0.05
        motion = rng.uniform(-1.0, 1.0, (3, 3))
        path = Path(t, rng.normal(0.0, 0.3, 2), float(rng.uniform(-3.0, 3.0)), motion[0])
        acceleration = rng.uniform(0.5, 2.0, 3)
        desired = DesiredMotion(motion[1], motion[2], t + 0.05, t + 0.02, acceleration)
        plan = make_plan(
            posture,
            StepOptions(0.05, ground, Swing),
            state,
            path,
            gait,
            gait.stance(t),
            first_footing(posture, state),
            lambda foot, touchdown, state=state: state.point(foot)[:2] + rng.normal(0.0, 0.1, 2),
            lambda time, path=path: path.yaw + float(rng.normal(0.0, 0.2)),
        )
        pose = BodyPose(float(rng.normal(0.0, 0.02)), float(rng.normal(0.0, 0.1)))
        found.append(Case(posture, plan, desired, pose, state))
    return found


@pytest.mark.parametrize("known_ground", [False, True])
@pytest.mark.parametrize("name", ROBOTS)
def test_one_compiled_function_writes_what_the_definitions_say(
    name: str, known_ground: bool
) -> None:
    rng = np.random.default_rng(2)
    for case in cases(name, known_ground):
        (fast, fast_out), (slow, slow_out) = case.active(True), case.active(False)
        first = min(swing.lift_off for swing in case.plan.swings.values())
        last = max(swing.touchdown for swing in case.plan.swings.values())
        for t in np.sort(rng.uniform(max(first, case.plan.time), last + 0.02, N_STEPS)):
            com = case.state.com + rng.normal(0.0, 0.05, 3)
            com_velocity = rng.normal(0.0, 0.3, 3)  # a push
            for plan, out in ((fast, fast_out), (slow, slow_out)):
                plan.write(float(t), com, com_velocity, out)
            assert np.abs(slow_out).max() > 0.1
            assert np.allclose(fast_out, slow_out, rtol=0.0, atol=1e-9)
            assert np.allclose(fast.path.position, slow.path.position, rtol=0.0, atol=1e-9)
            for foot, swing in slow.swings.items():
                assert np.allclose(fast.swings[foot].end, swing.end, rtol=0.0, atol=1e-9)
        changed, changed_out = fast.changed(case.desired, case.pose), np.zeros_like(fast_out)
        for plan, out in ((fast, fast_out), (changed, changed_out)):
            plan.write(float(t) + 0.01, com, com_velocity, out)
        assert np.allclose(fast_out, changed_out, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["go2", "talos"])
def test_velocities_and_accelerations_are_the_derivatives_of_the_targets(name: str) -> None:
    """By central differences, while the capture point follows its plan."""
    step = 1e-5
    for case in cases(name, known_ground=True)[:5]:
        swing = next(iter(case.plan.swings.values()))
        t = case.plan.time + 0.5 * (swing.touchdown - case.plan.time)
        values = []
        for time in (t - step, t, t + step):
            plan, out = case.active(True)
            com, velocity = (np.append(part, 0.0) for part in case.plan.plan(t)[:2])
            plan.write(time, com, velocity, out)
            values.append(out.copy())
        before, now, after = values
        rate = (after - before) / (2.0 * step)
        com = now[:9]
        assert np.allclose(rate[:3], com[3:6], atol=1e-6)
        assert np.allclose(rate[3:6], com[6:9], atol=1e-5)
        for first in range(20, now.size, 20):
            block, change = now[first : first + 15], rate[first : first + 15]
            if not block[9:12].any():  # a position
                continue
            R, dR = block[:9].reshape(3, 3), change[:9].reshape(3, 3)
            spin = dR @ R.T
            omega = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
            assert np.allclose(omega, block[9:12], atol=0.05 * np.abs(omega).max() + 1e-6)
