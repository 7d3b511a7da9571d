"""Print digests of the controller's answers, to check that a code change changes no number.

    python benchmarks/answers.py > before.txt        again after the change, and compare

Compare only digests from the same machine. The digests cover every bit of the torques,
accelerations and forces from both backends, for every robot in the catalogue and every stance. They
also cover the records of rollouts, walks and a jump.
"""

import hashlib
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pinocchio as pin

import floatbase as fb
from floatbase.behaviours import MPC, Gait, Jump, Stand, Walk
from floatbase.errors import FloatbaseError

ALONG = np.array([1.0, 0.0])  # of x


def digest(*arrays: np.ndarray) -> str:
    found = hashlib.sha256()
    for array in arrays:
        found.update(np.ascontiguousarray(array, dtype=float).tobytes())
    return found.hexdigest()[:16]


def line(*words: object) -> None:
    print(*words, flush=True)


def stances(robot: fb.Robot) -> dict[str, fb.Contacts]:
    feet = fb.Contacts.feet(robot)
    found = {"all feet": feet}
    for name in feet.names if len(feet.names) > 1 else ():
        found[f"without {name}"] = feet.only(*(one for one in feet.names if one != name))
    return found


def answers(name: str) -> None:
    robot = fb.load(name)
    rng, standing = np.random.default_rng(0), robot.standing()
    states = [standing]
    for _ in range(5):
        dv, v = 0.1 * rng.standard_normal((2, robot.nv))
        states.append(fb.State(robot, pin.integrate(robot.model, standing.q, dv), v))
    for stance, contacts in stances(robot).items():
        for backend in ("auto", "reference"):
            rows = []
            controller = fb.WholeBodyController(
                robot, contacts, fb.standing_tasks(standing), backend=backend
            )
            for state in states:
                try:
                    command = controller(state.q, state.v)
                    rows.append(np.concatenate([command.tau, command.qdd, command.forces]))
                except FloatbaseError as error:
                    rows.append(np.array([len(str(error))]))
            line(name, stance, backend, digest(*rows))


def main() -> None:
    for name in fb.catalogue():
        if fb.load(name).feet:
            answers(name)
    for name in ("go2", "solo12", "talos", "g1"):
        robot = fb.load(name)
        contacts = fb.Contacts.feet(robot)
        push = fb.Push([20.0, 60.0, 0.0], start=0.3, duration=0.1)
        gait = Gait.trot(robot) if len(robot.feet) == 4 else Gait.walk(robot)
        behaviours = {
            "stand": Stand(robot, contacts, stepping_gait=gait),
            "walk": Walk(robot, contacts, gait, 0.2 * ALONG),
        }
        if name == "go2":
            behaviours["MPC"] = MPC(robot, contacts, gait, 0.3 * ALONG)
            behaviours["jump"] = Jump(robot, contacts, 0.2)
        for what, behaviour in behaviours.items():
            run = fb.rollout(fb.Simulation(robot), behaviour, 1.5, [push])
            line(name, what, run.outcome, digest(run.q, run.v, run.tau, run.tau_desired))


if __name__ == "__main__":
    main()
