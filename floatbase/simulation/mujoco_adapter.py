"""`MujocoAdapter`: a robot in a MuJoCo scene that was made elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import numpy.typing as npt
import pinocchio as pin

from floatbase._validation import (
    Array,
    as_array,
    as_instance,
    as_strings,
    cached_property,
    refuse_new_attributes,
)
from floatbase.errors import InputError, SimulationWarning, unknown_name, warn
from floatbase.robots import Robot, State
from floatbase.robots._mujoco_motors import gear, is_torque_motor, largest_torque, motors_of
from floatbase.simulation._conversion import Conversion, free_joint

_N_STATES = 2  # random states at which the kinematics of both models are compared
# rad and m, between the same link in both models: files round to fewer digits than this
_LARGEST_DIFFERENCE = 5e-3
# relative, of masses, gravity and torque limits: a controller does not notice a smaller difference
_TOLERANCE = 0.01


class MujocoAdapter:
    """A robot in your own MuJoCo scene, whose states and torques it converts.

    Joints are found by name, in a scene with any number of other robots and objects. The
    constructor compares the two models once. After that, a conversion takes microseconds. It reads
    and writes only the robot's own entries of qpos, qvel and ctrl.

    Parameters
    ----------
    robot : Robot
        The robot of the controller.
    model : mujoco.MjModel
        Model of the scene.
    joint_names : sequence of str, optional
        Names of the robot's joints in the scene, in the order of `robot.joint_names`. By default
        they have the same names, or all have the same prefix or suffix, such as
        "robot/FL_hip_joint".

    Raises
    ------
    InputError
        If the base floats in only one of the two models, if several robots in the scene have joints
        of these names, or if a link is in another place because an axis, a zero or a length
        differs.
    UnknownNameError
        If the scene lacks a joint.

    Warns
    -----
    SimulationWarning
        If mass, gravity, joints or motor limits differ, or if a fixed base is elsewhere.

    Examples
    --------
    >>> from floatbase.simulation import MujocoAdapter
    >>> sim = fb.Simulation(fb.load("go2"))
    >>> adapter = MujocoAdapter(sim.robot, sim.model)
    >>> adapter.set_state(sim.data, sim.robot.standing())
    >>> adapter.state(sim.data)
    State(go2, com=[-0.001, 0.0, 0.316], at rest)
    """

    __setattr__ = refuse_new_attributes

    def __init__(
        self, robot: Robot, model: mujoco.MjModel, joint_names: Sequence[str] | None = None
    ):
        self._robot = as_instance("robot", robot, Robot)
        self._model = as_instance(
            "model", model, mujoco.MjModel, "mujoco.MjModel.from_xml_path(…), or physics.model.ptr"
        )
        self._joints = _find_joints(robot, model, joint_names)
        self._root = _find_root(robot, model, self._joints)
        self._conversion = Conversion(robot, model, self._joints)
        mount = self._check_places()
        if differences := self._differences(mount):
            warn(
                f"{robot.name} in the scene differs from the robot of the controller: it "
                f"{'; it '.join(differences)}. Load the robot from the file of the scene with "
                f"fb.load_mjcf, or allow for the difference.",
                SimulationWarning,
            )

    @property
    def robot(self) -> Robot:
        """The robot of the controller."""
        return self._robot

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the robot's joints in the scene, in the order of `robot.joint_names`."""
        return tuple(self._model.joint(i).name for i in self._joints)

    def q(self, data: mujoco.MjData) -> Array:
        """Return the robot's configuration in the package's convention.

        Parameters
        ----------
        data : mujoco.MjData
            Data of the scene.

        Returns
        -------
        ndarray, shape (nq,)
            Base position [m], base quaternion x y z w, joints [rad or m].
        """
        return self._conversion.q(self._checked(data).qpos)

    def v(self, data: mujoco.MjData) -> Array:
        """Return the robot's velocity in the package's convention.

        Parameters
        ----------
        data : mujoco.MjData
            Data of the scene.

        Returns
        -------
        ndarray, shape (nv,)
            Linear [m/s] and angular [rad/s] base velocity in the base frame, then joints.
        """
        return self._conversion.v(self._checked(data).qpos, data.qvel)

    def state(self, data: mujoco.MjData) -> State:
        """Return the robot's state.

        Parameters
        ----------
        data : mujoco.MjData
            Data of the scene.

        Returns
        -------
        State
            The state.
        """
        return State(self.robot, self.q(data), self.v(data))

    def set_state(self, data: mujoco.MjData, state: State) -> None:
        """Write a state into qpos and qvel. To update all other data, call `mujoco.mj_forward`.

        Parameters
        ----------
        data : mujoco.MjData
            Data of the scene.
        state : State
            The state; its robot may have other masses.
        """
        if not self.robot.has_joints_of(as_instance("state", state, State).robot):
            raise InputError(f"state must be a state of {self.robot.name}, not {state!r}.")
        qpos, qvel = self._conversion.to_mujoco(state.q, state.v)
        places, velocities = self._conversion.qpos_of_q, self._conversion.qvel_of_v
        self._checked(data).qpos[places], data.qvel[velocities] = qpos[places], qvel[velocities]

    def set_torques(self, data: mujoco.MjData, tau: npt.ArrayLike) -> None:
        """Write joint torques into ctrl, divided by the gears of the motors.

        Parameters
        ----------
        data : mujoco.MjData
            Data of the scene.
        tau : array_like, shape (d,)
            Joint torques [N·m], such as `command.tau`. MuJoCo clips them to its limits.

        Raises
        ------
        InputError
            If a joint has no torque motor or several of them, or if a torque is not finite.
        """
        controls, torque_per_control = self._motors
        torques = as_array("torques", tau, (self.robot.d,), "N·m")
        self._checked(data).ctrl[controls] = torques / torque_per_control

    def _checked(self, data: mujoco.MjData) -> mujoco.MjData:
        """Return the data of the scene; raise `InputError` for data of another model."""
        if data.qpos.size != self._model.nq:
            raise InputError(
                f"data has {data.qpos.size} entries in qpos, but the model of this adapter has "
                f"{self._model.nq}. Make a new adapter for another model."
            )
        return data

    @cached_property
    def _motors(self) -> tuple[npt.NDArray[np.int64], Array]:
        """Entries of ctrl, and the torque that one unit of each applies to its joint."""
        model, found, wrong = self._model, list[int](), dict[str, str]()
        for joint, name in zip(self._joints, self.joint_names, strict=True):
            motors = motors_of(model, joint)
            found += motors
            if len(motors) != 1:
                wrong[name] = f"{len(motors) or 'no'} actuators"
            elif not is_torque_motor(model, motors[0]):
                wrong[name] = "a servo, or a motor whose gear is zero"
        if wrong:
            name, reason = next(iter(wrong.items()))
            raise InputError(
                f"Cannot write torques for {', '.join(wrong)}. {name} has {reason}, but it needs "
                f"one torque motor. Load the scene with mujoco.MjSpec.from_file. Before you "
                f"compile it, call set_to_motor() for each of spec.actuators and set its "
                f"ctrllimited to False, or add missing ones with spec.add_actuator(target=…, "
                f"trntype=mujoco.mjtTrn.mjTRN_JOINT)."
            )
        scale = gear(model, found) * model.actuator_gainprm[found, 0]
        return model.actuator_ctrladr[found], scale

    def _check_places(self) -> pin.SE3:
        """Raise `InputError` unless the robot's links are in the same places in both models.

        Returns the placement of the base, relative to a floating base of the robot or to the world.
        """
        robot, model, data = self.robot, self._model, mujoco.MjData(self._model)
        mount = pin.SE3.Identity() if robot.is_floating else None
        for seed in range(_N_STATES):
            state = robot.random_state(seed)
            self.set_state(data, state)
            mujoco.mj_kinematics(model, data)
            for joint, name in zip(self._joints, robot.joint_names, strict=True):
                body = model.jnt_bodyid[joint]
                if joint + 1 < model.body_jntadr[body] + model.body_jntnum[body]:
                    continue  # the last joint of a body places it
                R = data.xmat[body].reshape(3, 3)
                theirs = pin.SE3(R, data.xpos[body] + R @ model.jnt_pos[joint])
                ours = pin.SE3(state.joint_transforms[robot.model.getJointId(name)])
                if mount is None:
                    mount = theirs * ours.inverse()
                difference = (mount * ours).actInv(theirs)
                angle = float(np.linalg.norm(pin.log3(difference.rotation)))
                distance = float(np.linalg.norm(difference.translation))
                if max(angle, distance) > _LARGEST_DIFFERENCE:
                    raise InputError(
                        f"{model.joint(joint).name} in the scene is not the joint {name} of "
                        f"{robot.name}: for equal joint positions its link is {distance:.3g} m and "
                        f"{angle:.3g} rad away. Its axis, its zero or a length before it differs, "
                        f"or the base is displaced from the body with the free joint. Load the "
                        f"robot from the file of the scene with fb.load_mjcf."
                    )
        return mount or pin.SE3.Identity()

    def _differences(self, mount: pin.SE3) -> list[str]:
        """Return the differences that are no reason to refuse the scene."""
        robot, model, root = self.robot, self._model, self._root
        is_moving = (model.body_rootid == root) & (model.body_weldid > 0)
        mass = sum(inertia.mass for inertia in robot.model.inertias[1:])
        theirs = float(model.body_mass[is_moving].sum())
        known = [*self._joints, *([free_joint(model, self._joints)] if robot.is_floating else [])]
        moved = np.flatnonzero(is_moving[model.jnt_bodyid]).tolist()
        others = [model.joint(i).name or f"number {i}" for i in moved if i not in known]
        limits = [largest_torque(model, joint) for joint in self._joints]
        is_weaker = np.array(limits) < (1.0 - _TOLERANCE) * robot.torque_limits
        weaker = np.array(robot.joint_names)[is_weaker].tolist()
        motors = [motor for joint in self._joints for motor in motors_of(model, joint)]
        has_springs = model.jnt_stiffness[self._joints].any()
        place, gravity = mount.translation.round(3), mount.rotation.T @ model.opt.gravity
        pull = np.abs(gravity - robot.model.gravity.linear).max()
        differences = {
            f"weighs {theirs:.4g} kg instead of {mass:.4g} kg": abs(theirs / mass - 1) > _TOLERANCE,
            f"also has the joints {', '.join(others)}": bool(others),
            f"has weaker motors at {', '.join(weaker)}": bool(weaker),
            "has motors that follow ctrl late (actuator_dyntype)": model.actuator_dyntype[
                motors
            ].any(),
            "has springs at its joints": has_springs,
            f"is under a gravity of {gravity.round(3)} m/s²": pull > _TOLERANCE * robot.gravity,
            f"has its base at {place} m, but targets are relative to it": not mount.isIdentity(
                _LARGEST_DIFFERENCE
            ),
        }
        return [difference for difference, applies in differences.items() if applies]


def _find_joints(robot: Robot, model: mujoco.MjModel, names: Sequence[str] | None) -> list[int]:
    """Return the robot's joints in the scene, whose names may share a prefix or a suffix."""
    known = {model.joint(i).name: i for i in range(model.njnt)}
    own = robot.joint_names
    if names is None and not set(own) <= set(known):
        parts = [name.partition(own[0]) for name in known if own[0] in name]
        found = [[f"{prefix}{name}{suffix}" for name in own] for prefix, _, suffix in parts]
        found = [candidate for candidate in found if set(candidate) <= set(known)]
        if len(found) > 1:
            raise InputError(
                f"The scene has {len(found)} robots with the joints of {robot.name}: "
                f"{', '.join(candidate[0] for candidate in found)}, …. Choose one with "
                f"joint_names=[…], such as [{found[0][0]!r}, …], in the order of robot.joint_names."
            )
        names = found[0] if found else None
    names = as_strings("joint_names", own if names is None else names)
    if not len(names) == len(set(names)) == robot.d:
        raise InputError(
            f"joint_names must be {robot.d} different names in the order of robot.joint_names, "
            f"{', '.join(own[:3])}, …."
        )
    if missing := [name for name in names if name not in known]:
        hint = "If they have other names, pass joint_names=[…] in the order of robot.joint_names."
        raise unknown_name("joint of the scene", missing[0], filter(None, known), hint)
    return [known[name] for name in names]


def _find_root(robot: Robot, model: mujoco.MjModel, joints: list[int]) -> int:
    """Return the root body of the robot in the scene; check that it floats if the robot does."""
    free = free_joint(model, joints)  # -1 if the root of the tree has no joint
    is_free = free >= 0 and model.jnt_type[free] == mujoco.mjtJoint.mjJNT_FREE
    if is_free != robot.is_floating:
        raise InputError(
            f"The base of {robot.name} {'floats' if robot.is_floating else 'is fixed'}, but in the "
            f"scene it {'floats' if is_free else 'has no free joint'}. Load the robot with "
            f"floating={is_free}, or change the scene."
        )
    return int(model.body_rootid[model.jnt_bodyid[joints[0] if joints else free]])
