"""Thousands of pushed robots: states and the controller's torques; see docs/demonstrations.md."""

from time import perf_counter

import numpy as np
from mujoco import MjData, rollout
from scipy.spatial.transform import Rotation

import floatbase as fb


def main(robots=4096, steps=100, threads=2):
    """Return q, v and τ of all robots, shape (steps, robots, …), and print the speed."""
    go2 = fb.load("go2")
    tasks, sim = fb.standing_tasks(go2.standing()), fb.Simulation(go2)
    controller = fb.WholeBodyController(go2, fb.Contacts.feet(go2), tasks)
    model, joints = sim.model, [sim.model.joint(name) for name in go2.joint_names]
    qpos = [0, 1, 2, 4, 5, 6, 3, *(joint.qposadr[0] for joint in joints)]
    qvel = model.nq + np.array([*range(6), *(joint.dofadr[0] for joint in joints)])
    motors = [model.actuator(name).id for name in go2.joint_names]
    x = np.tile(np.concatenate([[0.0], sim.data.qpos, sim.data.qvel]), (robots, 1))  # time first
    x[:, 1 + qvel[:2]] = np.random.default_rng(0).uniform(-0.5, 0.5, (robots, 2))  # the push, m/s
    data, torques = [MjData(model) for _ in range(threads)], np.zeros((robots, 1, go2.d))
    samples, simulation, begin = [], 0.0, perf_counter()
    with rollout.Rollout(nthread=threads) as pool:
        for _ in range(steps):
            q, v = x[:, 1:][:, qpos], x[:, 1:][:, qvel]
            v[:, :3] = Rotation.from_quat(q[:, 3:7]).inv().apply(v[:, :3])  # in the base frame
            samples.append((q, v, controller.batch(q, v, threads=threads).tau))
            torques[:, 0, motors] = np.nan_to_num(samples[-1][2])  # NaN: no solution
            before = perf_counter()
            x = pool.rollout(model, data, x, torques, nstep=2)[0][:, -1]
            simulation += perf_counter() - before
    took, n = perf_counter() - begin, robots * steps / threads
    print(f"{n / took:.0f} states per second and core, {simulation / took:.0%} of it in MuJoCo")
    return [np.array(each) for each in zip(*samples, strict=True)]


if __name__ == "__main__":
    main()
