"""The problems of the comparison with TSID and placo, stated so that each library can express them.

Common to all: keep standing on all feet (centre of mass, base orientation, posture, with the gains
and weights of `fb.standing_tasks`, except for the posture's weight, 0.1), four friction facets
|f_x|, |f_y| ≤ μ f_z, unilateral contacts, and torque limits. What a peer cannot express is left
out:

- Contacts are at the origins of the foot frames, not at the lowest points of the balls. Normals
  point up.
- The peers' friction pyramids lie outside the cone (`inner_approximation=False`) and turn with a
  flat foot, so the soles of talos are level and straight in every state, as they are on level
  ground.
- TSID (from Python) has no torque regularization. For flat feet it regularizes the wrench of the
  foot instead of the corner forces. It adds 1e-8 to the diagonal of its Hessian, which acts as a
  force regularization, and on flat feet as the only one.
- placo's flat feet also have a force at each corner: points without weight carry the forces, and
  the frame of the foot does not move. placo's own flat foot carries a wrench without a limit on
  the moment about the normal, which is an easier problem.
- Joint limits are off; TSID and floatbase are compared with joint limits separately.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import count, islice
from typing import Any

import harness
import numpy as np
import pinocchio as pin

import floatbase as fb
from floatbase.control import JointLimits
from floatbase.robots import Foot

MU = 0.7
# weight; with that of standing_tasks, 1e-3, the peers' solver loses the digits in which torques are
# compared
POSTURE = 0.1
HESSIAN = 1e-8  # DEFAULT_HESSIAN_REGULARIZATION of TSID
# TSID with joint limits: largest acceleration, with which joints also brake [rad/s²]; inf for that
# of `JointLimits.of`. The tasks demand more than 20 in most states that are not easy.
LIMITED = {"tsid limits": np.inf, "tsid tight limits": 20.0}


@dataclass(frozen=True)
class Regularization:
    """Weights of ‖λ‖² and ‖τ‖² in the peer, and in floatbase for the same optimum."""

    peer_force: float
    peer_torque: float
    hessian: float
    force: float
    torque: float


REGULARISATION = {
    ("tsid", "points"): Regularization(1e-5, 0.0, HESSIAN, 1e-5 + HESSIAN, 0.0),
    ("tsid", "flat"): Regularization(0.0, 0.0, HESSIAN, HESSIAN, 0.0),
    ("placo", "points"): Regularization(1e-5, 1e-5, HESSIAN, 1e-5 + HESSIAN, 1e-5),
    ("placo", "flat"): Regularization(1e-5, 1e-5, HESSIAN, 1e-5 + HESSIAN, 1e-5),
}


@dataclass(frozen=True)
class Problem:
    """One robot's problem as one peer can state it."""

    robot: fb.Robot
    peer: str

    @property
    def is_flat(self) -> bool:
        """Whether the feet are flat."""
        return all(foot.is_flat for foot in self.robot.feet)

    @property
    def regularization(self) -> Regularization:
        """Weights of forces and torques."""
        peer = "tsid" if self.peer in LIMITED else self.peer
        return REGULARISATION[peer, "flat" if self.is_flat else "points"]

    @property
    def contacts(self) -> fb.Contacts:
        """All feet."""
        return (fb.Contacts.flat_feet if self.is_flat else fb.Contacts.points)(self.robot, mu=MU)

    @property
    def tasks(self) -> tuple[Any, ...]:
        """Standing, and what regularises."""
        weights, at = self.regularization, self.robot.standing()
        return (
            *fb.standing_tasks(at)[:2],
            fb.PostureTask(at.q, weight=POSTURE),
            fb.ForceTask(weight=weights.force),
            fb.TorqueTask(weight=weights.torque),
        )

    @property
    def joint_limits(self) -> JointLimits | None:
        """Hard joint limits without reserve, as in TSID, or none."""
        if self.peer not in LIMITED:
            return None
        most = np.minimum(JointLimits.of(self.robot).braking, LIMITED[self.peer])
        return JointLimits.of(self.robot, acceleration=most, braking=most, weight=None)

    def is_viable(self, q: np.ndarray, v: np.ndarray) -> bool:
        """Whether all joints are within their limits, and can stop there."""
        limits = self.joint_limits
        if limits is None:
            return True
        q, v = q[-self.robot.d :], v[-self.robot.d :]
        gap = np.where(v > 0.0, limits.upper - q, q - limits.lower)
        inside = (limits.lower <= q) & (q <= limits.upper)
        slow = np.abs(v) <= limits.speeds
        return bool(np.all(inside & slow & (v**2 <= 2.0 * limits.braking * gap)))

    def controller(self, backend: str) -> fb.WholeBodyController:
        """floatbase's answer to it."""
        options = {"facets": 4, "inner_approximation": False, "joint_limits": self.joint_limits}
        return fb.WholeBodyController(
            self.robot, self.contacts, self.tasks, backend=backend, **options
        )

    def states(self, label: str, n: int) -> list[tuple[np.ndarray, np.ndarray]]:
        """Random configurations and velocities, the same ones every time."""
        drawn = (self.robot.random_state(seed, harness.SPREADS[label]) for seed in count())
        pairs = (
            (level_soles(self.robot, s.q) if self.is_flat else np.array(s.q), np.array(s.v))
            for s in drawn
        )
        return list(islice((pair for pair in pairs if self.is_viable(*pair)), n))

    @property
    def description(self) -> dict[str, Any]:
        """The problem in numbers and names, for a process without floatbase."""
        robot, (com, base, posture) = self.robot, self.tasks[:3]
        return {
            "robot": robot.name,
            "peer": self.peer,
            "urdf": robot.urdf,
            "joints": list(robot.joint_names),
            "armature": robot.model.armature[6:].tolist(),
            "torque_limits": robot.torque_limits.tolist(),
            "joint_limits": _plain_limits(self.joint_limits),
            "base": robot.base,
            "com": _told(com, com.position),
            "orientation": _told(base, base.rotation),
            "posture": _told(posture, np.asarray(posture.q)[7:]),
            "force_weight": self.regularization.peer_force,
            "hessian": self.regularization.hessian,
            "torque_weight": self.regularization.peer_torque,
            "contacts": [
                {"frame": foot.frame, "corners": _plain(foot.corners), "mu": MU}
                for foot in robot.feet
            ],
        }


def _plain(array: Any) -> Any:
    return None if array is None else np.asarray(array).tolist()


def _plain_limits(limits: JointLimits | None) -> dict[str, Any] | None:
    """Joint limits in numbers, with the speeds that floatbase's bounds use."""
    if limits is None:
        return None
    return {
        "lower": limits.lower.tolist(),
        "upper": limits.upper.tolist(),
        "velocity": limits.speeds.tolist(),
        "acceleration": limits.acceleration.tolist(),
        "period": limits.period,
    }


def _told(task: Any, target: Any) -> dict[str, Any]:
    return {"target": _plain(target), "kp": task.kp, "kd": task.kd, "weight": task.weight}


@lru_cache
def problem(robot: str, peer: str) -> Problem:
    """The problem of that name. Point feet are taken without their balls: they touch at their
    frames.
    """
    feet = [foot if foot.is_flat else Foot(foot.frame) for foot in fb.load(robot).feet]
    return Problem(fb.load(robot, feet=feet), peer)


def level_soles(robot: fb.Robot, q: np.ndarray) -> np.ndarray:
    """q with its leg joints changed until every foot's frame is that of the world: Newton's method
    with least steps.
    """
    model, data, q = robot.model, robot.model.createData(), np.array(q)
    frames = [robot.frame_id(foot.frame) for foot in robot.feet]
    for _ in range(50):
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        error = np.concatenate([pin.log3(data.oMf[frame].rotation) for frame in frames])
        if np.max(np.abs(error)) < 1e-14:
            break
        jacobians = [pin.getFrameJacobian(model, data, frame, pin.LOCAL) for frame in frames]
        J = np.vstack([jacobian[3:, 6:] for jacobian in jacobians])
        q = pin.integrate(model, q, np.concatenate([np.zeros(6), -np.linalg.pinv(J) @ error]))
    return q
