"""`StanceControllers`: one whole-body controller for each stance of a walk."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any

from floatbase.behaviours.walk.active_plan import compile_targets
from floatbase.behaviours.walk.gait import Gait, can_keep_flat
from floatbase.behaviours.walk.options import WalkOptions
from floatbase.behaviours.walk.plan import StepPlan
from floatbase.behaviours.walk.posture import WalkingPosture
from floatbase.behaviours.walk.targets import UNBOUNDED, normal_force_bound
from floatbase.control import JointLimits, WholeBodyController
from floatbase.objectives import CoMTask, ForceTask, FrameTask, OrientationTask, PostureTask, Task

_RAMP_LOAD_FACTOR = 2.0  # times its share of the weight: the normal force at which a ramp begins
# per rad/s²: the weight of a task. A knee that touches its stop is better than a fall: of 24
# pushes of 200 to 300 N, go2 survives 24 with this weight, 22 with 200 and 13 with 10 000
_JOINT_LIMIT_WEIGHT = 10.0
# of the contacts of legs that cannot keep a sole flat: as for tasks, so that the body can sway
_ROLLING_SOLE_WEIGHT = 10.0


class StanceControllers:
    """Whole-body controllers of a walk, one for each set of standing feet."""

    def __init__(
        self, posture: WalkingPosture, options: WalkOptions, force_weight: float | None = None
    ):
        self._posture = posture
        self._options = options
        self.plan = None
        self._force_weight = force_weight
        self._controllers: dict[tuple[str, ...], WholeBodyController] = {}
        robot, contacts = posture.state.robot, posture.contacts
        full_load = _RAMP_LOAD_FACTOR * robot.weight / len(contacts)
        self._full_loads = {
            name: (contacts.only(name), full_load / len(contacts.only(name).point_names))
            for name in contacts.names
        }
        flat = can_keep_flat(robot, tuple(posture.flat_feet))
        self._soft_soles = {} if flat else {"contact_weight": _ROLLING_SOLE_WEIGHT}
        # reports wrong options and tasks
        controller = WholeBodyController(robot, contacts, options.tasks, **options.controller)
        self.limits = controller.limits

    plan: StepPlan | None

    @property
    def by_feet(self) -> Mapping[tuple[str, ...], WholeBodyController]:
        """The controllers made so far, by stance."""
        return MappingProxyType(self._controllers)

    @property
    def full_loads(self) -> dict[str, float]:
        """Normal force at which the ramp of each contact begins [N]."""
        return {name: load for name, (_, load) in self._full_loads.items()}

    def prepare(self, gait: Gait) -> None:
        """Make the controllers of all stances of a gait, since that takes milliseconds."""
        gait = replace(gait, stop=None)
        lift_offs = [gait.start + (1.0 + offset) * gait.period for offset in gait.offsets.values()]
        changes = [lift_off + time for lift_off in lift_offs for time in (0.0, gait.swing)]
        names = self._posture.contacts.names
        for standing in (gait.feet, *(gait.stance(t) for t in changes)):
            self[tuple(name for name in names if name in standing or name not in gait.feet)]

    def __getitem__(self, stance: tuple[str, ...]) -> WholeBodyController:
        """Return the controller of a stance, which is made when first needed."""
        controller = self._controllers.get(stance)
        if controller is None:
            robot = self._posture.state.robot
            torques = self._options.controller.get("torque_limits")
            joints = JointLimits.of(robot, torque_limits=torques, weight=_JOINT_LIMIT_WEIGHT)
            arguments: dict[str, Any] = {
                "max_normal_force": self._normal_force_bounds(stance),
                "on_infeasible": "soften",  # torques and friction may be unable to hold the feet
                "joint_limits": joints,
                **self._soft_soles,
                **self._options.controller,
            }
            contacts = self._posture.contacts.only(*stance)
            controller = WholeBodyController(robot, contacts, self._tasks(stance), **arguments)
            if controller.compiled is not None:
                compile_targets()
            self._controllers[stance] = controller
        return controller

    def _tasks(self, stance: Sequence[str]) -> list[Task]:
        """Return the tasks of a stance; `ActivePlan.write` replaces the targets of most of them."""
        gains, state = self._options.gains, self._posture.state
        (com, com_weight), (base, base_weight) = gains.com, gains.base
        (swing, swing_weight), (posture, posture_weight) = gains.swing, gains.posture
        tasks: list[Task] = [
            CoMTask(state.com, kp=com, weight=com_weight),
            OrientationTask("base", self._posture.rotation("base"), kp=base, weight=base_weight),
            PostureTask(state.q, kp=posture, weight=posture_weight),
        ]
        for foot in [name for name in self._posture.contacts.names if name not in stance]:
            tasks.append(FrameTask(foot, state.point(foot), kp=swing, weight=swing_weight))
            if foot in self._posture.flat_feet:
                rotation = self._posture.rotation(foot)
                tasks.append(OrientationTask(foot, rotation, kp=swing, weight=swing_weight))
        if self._force_weight is not None:
            tasks.append(ForceTask(weight=self._force_weight))
        return [*tasks, *self._options.tasks]

    def _normal_force_bounds(self, stance: Sequence[str]) -> dict[str, Any] | None:
        """Return ramps for the normal force of each point if all feet stand, otherwise None."""
        names = self._posture.contacts.names
        if self._options.ramp == 0.0 or len(stance) < len(names) or len(stance) < 2:
            return None
        return {foot: partial(self._normal_force_bound, foot) for foot in names}

    def _normal_force_bound(self, foot: str, t: float) -> float:
        """Return the upper bound of the normal force of each point of a foot at t [s], in N."""
        if self.plan is None:  # a controller is being made
            return UNBOUNDED
        contact, full_load = self._full_loads[foot]
        bound = normal_force_bound(self.plan, foot, t, self._options.ramp, full_load)
        if bound == UNBOUNDED:
            return bound
        return max(float(self.limits.normal_forces(contact, t)[0].max()), bound)
