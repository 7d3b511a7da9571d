"""A robot in a foreign MuJoCo scene, with other robots, another order and other names."""

from __future__ import annotations

from collections.abc import Callable

import judges
import mujoco
import numpy as np
import pytest
from messages import raises

import floatbase as fb
from floatbase.control import Command
from floatbase.errors import InputError, SimulationWarning, UnknownNameError
from floatbase.simulation import MujocoAdapter

LEG = """
<body name="{leg}_hip" pos="{x} {y} 0">
  <joint name="{leg}_slide" type="slide" axis="1 0 0" range="-1 1"/>
  <inertial pos="0 0 0" mass="0.5" diaginertia="1e-3 1e-3 1e-3"/>
  <body name="{leg}_thigh" pos="0 {y} 0" quat="0.98 0 0.199 0">
    <joint name="{leg}_pitch" axis="0 1 0" pos="0 0 0.02" range="-2 2"/>
    <inertial pos="0 0 -0.1" mass="0.7" diaginertia="2e-3 3e-3 1e-3"/>
    <geom name="{leg}_foot" size="0.02" pos="0 0 -0.25" mass="0"/>
  </body>
</body>
"""
PLACES = {"FR": (0.2, -0.1), "RL": (-0.2, 0.1), "FL": (0.2, 0.1), "RR": (-0.2, -0.1)}
LEGS = "".join(LEG.format(leg=leg, x=x, y=y) for leg, (x, y) in PLACES.items())
MOTORS = "".join(
    f'<motor name="{leg}_{joint}" joint="{leg}_{joint}" gear="{gear}" ctrlrange="-9 9"/>'
    for joint, gear in (("pitch", -3.0), ("slide", 2.0))
    for leg in PLACES
)
DOG = f"""
<mujoco><worldbody>
  <body name="trunk" pos="0 0 0.3">
    <freejoint name="root"/>
    <inertial pos="0.01 0 0" mass="5" diaginertia="0.05 0.1 0.12"/>
    <geom type="box" size="0.2 0.1 0.05" mass="0"/>
    {LEGS}
  </body>
</worldbody><actuator>{MOTORS}</actuator></mujoco>
"""


@pytest.fixture(scope="module")
def dog(tmp_path_factory) -> fb.Robot:
    path = tmp_path_factory.mktemp("dog") / "dog.xml"
    path.write_text(DOG, encoding="utf-8")
    return fb.load_mjcf(path)


def scene(*prefixes: str, change: Callable[[mujoco.MjSpec], None] | None = None) -> mujoco.MjModel:
    """A ball and a hinged door, and then dogs with these prefixes."""
    spec = mujoco.MjSpec()
    ball = spec.worldbody.add_body(name="ball", pos=[1.0, 0.0, 2.0])
    ball.add_freejoint(name="ball")
    ball.add_geom(size=[0.1, 0.0, 0.0])
    door = spec.worldbody.add_body(name="door")
    door.add_joint(name="door")
    door.add_geom(size=[0.1, 0.0, 0.0])
    for prefix in prefixes:
        child = mujoco.MjSpec.from_string(DOG)
        if change is not None:
            change(child)
        spec.worldbody.add_frame().attach_body(child.body("trunk"), prefix, "")
    return spec.compile()


def test_feet_and_kinetic_energy_of_the_robot_in_the_scene_are_those_of_the_state(dog):
    model = scene("a/", "b/")
    adapter = MujocoAdapter(dog, model, [f"b/{name}" for name in dog.joint_names])
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    other = MujocoAdapter(dog, model, [f"a/{name}" for name in dog.joint_names])
    other.set_state(data, dog.standing())
    for _ in range(100):
        state = dog.random_state(rng, 0.7)
        adapter.set_state(data, state)
        mujoco.mj_forward(model, data)
        assert np.allclose(adapter.q(data), state.q, atol=1e-12)
        assert np.allclose(adapter.v(data), state.v, atol=1e-12)
        assert np.array_equal(adapter.state(data).q, adapter.q(data))
        for foot in dog.feet:
            place = data.geom(f"b/{foot.frame}").xpos
            assert np.allclose(state.point(foot.frame, foot.centre), place, atol=1e-12)
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        energy = 0.5 * data.qvel @ M @ data.qvel
        assert energy == pytest.approx(0.5 * state.v @ state.M @ state.v, rel=1e-9)
    assert np.allclose(other.q(data), dog.standing().q)
    assert np.allclose(data.body("ball").xpos, [1.0, 0.0, 2.0])


CRANE = """
<mujoco><worldbody>
  <body name="trolley">
    <joint name="along" type="slide" axis="1 0 0"/>
    <joint name="up" type="slide" axis="0 0 1" ref="1.3"/>
    <joint name="turn" axis="0 0 1" pos="0 0.1 0"/>
    <geom size="0.1"/>
    <body name="arm" pos="0.2 0 0">
      <joint name="reach" type="slide" axis="1 0 0" pos="0.05 0 0"/>
      <geom size="0.1" pos="0.1 0 0"/>
      <body name="tip" pos="0.3 0 0"><joint name="wrist" axis="0 1 0"/><geom size="0.1"/></body>
    </body>
  </body>
</worldbody></mujoco>
"""


def test_sliding_joints_and_several_joints_of_one_body_are_found_where_they_are(tmp_path):
    (tmp_path / "crane.xml").write_text(CRANE)
    crane = fb.load_mjcf(tmp_path / "crane.xml", floating=False)
    model = mujoco.MjModel.from_xml_string(CRANE)
    adapter, data = MujocoAdapter(crane, model), mujoco.MjData(model)
    for seed in range(10):
        adapter.set_state(data, state := crane.random_state(seed))
        mujoco.mj_kinematics(model, data)
        assert np.allclose(data.body("tip").xpos, state.point("tip"), atol=1e-12)
    other = CRANE.replace('"reach" type="slide" axis="1 0 0"', '"reach" type="slide" axis="0 1 0"')
    with raises(InputError, "reach"):
        MujocoAdapter(crane, mujoco.MjModel.from_xml_string(other))


def test_torques_reach_the_joints_of_their_names_through_gears_of_any_sign(dog):
    model = scene("dog_")
    adapter, data = MujocoAdapter(dog, model), mujoco.MjData(model)
    tau = np.random.default_rng(1).uniform(-5.0, 5.0, dog.d)
    adapter.set_torques(data, tau)
    mujoco.mj_forward(model, data)
    for name, torque in zip(dog.joint_names, tau, strict=True):
        dof = model.joint(f"dog_{name}").dofadr[0]
        assert data.qfrc_actuator[dof] == pytest.approx(torque)


def with_servo(spec: mujoco.MjSpec) -> None:
    spec.actuator("RL_slide").set_to_position(kp=10.0)


def without_motor(spec: mujoco.MjSpec) -> None:
    spec.delete(spec.actuator("RL_slide"))


def with_two_motors(spec: mujoco.MjSpec) -> None:
    spec.add_actuator(target="RL_slide", trntype=mujoco.mjtTrn.mjTRN_JOINT)


@pytest.mark.parametrize("change", [with_servo, without_motor, with_two_motors])
def test_a_joint_without_its_own_torque_motor_is_named(dog, change):
    model = scene("a/", change=change)
    with raises(InputError, "a/RL_slide"):
        MujocoAdapter(dog, model).set_torques(mujoco.MjData(model), np.zeros(dog.d))


def other_axis(spec: mujoco.MjSpec) -> None:
    spec.joint("FL_pitch").axis = [0.0, -1.0, 0.0]


def other_zero(spec: mujoco.MjSpec) -> None:
    spec.body("FL_thigh").quat = [1.0, 0.0, 0.0, 0.0]


def other_length(spec: mujoco.MjSpec) -> None:
    spec.body("FL_thigh").pos = [0.0, 0.13, 0.0]


@pytest.mark.parametrize("change", [other_axis, other_zero, other_length])
def test_a_joint_that_moves_its_link_differently_is_named(dog, change):
    with raises(InputError, "FL_pitch"):
        MujocoAdapter(dog, scene("dog/", change=change))


def test_swapped_and_missing_and_ambiguous_names_are_refused(dog):
    swapped = [f"a/{name[0]}{'LR'[name[1] == 'L']}{name[2:]}" for name in dog.joint_names]
    with raises(InputError, "FL_slide", "a/FR_slide"):
        MujocoAdapter(dog, scene("a/"), swapped)
    with raises(UnknownNameError, "FL_slide"):
        MujocoAdapter(dog, scene())
    with raises(InputError, "a/FL_slide", "b/FL_slide"):
        MujocoAdapter(dog, scene("a/", "b/"))
    with raises(InputError, 8):
        MujocoAdapter(dog, scene("a/"), ["a/FL_slide"])
    with raises(InputError, "MjModel"):
        MujocoAdapter(dog, mujoco.MjData(scene("a/")))
    small, large = scene("a/"), scene("a/", "b/")
    with raises(InputError, 38, 23):
        MujocoAdapter(dog, small).q(mujoco.MjData(large))


def test_a_base_that_floats_in_only_one_model_is_refused(dog, tmp_path):
    (tmp_path / "dog.xml").write_text(DOG.replace('<freejoint name="root"/>', ""))
    bolted = fb.load_mjcf(tmp_path / "dog.xml")
    with raises(InputError, "floating=True"):
        MujocoAdapter(bolted, scene("a/"))
    planar = DOG.replace('<freejoint name="root"/>', '<joint name="x" type="slide"/>')
    with raises(InputError, "floating=False"):
        MujocoAdapter(dog, mujoco.MjModel.from_xml_string(planar))
    moved = mujoco.MjModel.from_xml_string(
        DOG.replace('<freejoint name="root"/>', "").replace('pos="0 0 0.3"', 'pos="0 0 0.8"')
    )
    with pytest.warns(SimulationWarning, match=r"0\.5"):
        adapter = MujocoAdapter(bolted, moved)
    data, state = mujoco.MjData(moved), bolted.random_state(0)
    adapter.set_state(data, state)
    assert np.allclose(adapter.q(data), state.q) and np.allclose(adapter.v(data), state.v)


def heavier(spec: mujoco.MjSpec) -> None:
    spec.body("trunk").mass = 6.0


def springy(spec: mujoco.MjSpec) -> None:
    spec.joint("RR_pitch").stiffness[0] = 5.0


def late(spec: mujoco.MjSpec) -> None:
    spec.actuators[0].dyntype, spec.actuators[0].dynprm[0] = mujoco.mjtDyn.mjDYN_FILTER, 0.1


def weaker(spec: mujoco.MjSpec) -> None:
    spec.actuator("RR_pitch").ctrlrange = [-1.0, 1.0]


def armed(spec: mujoco.MjSpec) -> None:
    arm = spec.body("trunk").add_body(name="arm", mass=1e-3, inertia=[1e-5] * 3)
    arm.explicitinertial = True
    arm.add_joint(name="shoulder")


@pytest.mark.parametrize(
    ("change", "sign"),
    [
        (heavier, "10.8 kg"),
        (weaker, "RR_pitch"),
        (springy, "springs"),
        (late, "dyntype"),
        (armed, "dog/shoulder"),
    ],
)
def test_an_adapter_warns_about_differences_that_a_controller_should_know(dog, change, sign):
    with pytest.warns(SimulationWarning, match=sign):
        MujocoAdapter(dog, scene("dog/", change=change))


@pytest.mark.parametrize("yaw", [0.0, 1.5])
def test_a_controller_that_fails_with_mujocos_quaternion_asks_for_its_order(yaw, go2):
    controller, standing = judges.controller_of("go2"), go2.standing()
    q = np.array(standing.q)
    q[3:7] = [0.0, 0.0, np.sin(yaw / 2.0), np.cos(yaw / 2.0)]
    sim = fb.Simulation(go2)
    sim.reset(standing.replace(q=q))

    def confused(q: np.ndarray, v: np.ndarray, t: float) -> Command:
        return controller(np.concatenate([q[:3], q[[6, 3, 4, 5]], q[7:]]), v, t)

    run = fb.rollout(sim, confused, 1.0, control_period=0.002)
    assert run.outcome == "controller failed"
    assert "w x y z" in str(run.error) and run.error.constraints
