"""Answers and runs of the Python library, which the engine of the web page must repeat."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from scipy.optimize import linprog

import floatbase as fb
from floatbase.behaviours import Walk
from floatbase.control import Command
from floatbase.control.tick import tick
from floatbase.friction import FrictionPolyhedron
from floatbase.live import robots
from floatbase.playground import (
    CHALLENGES,
    PERIOD,
    BaseMotors,
    ModelMismatch,
    Perturbation,
    PerturbedSimulation,
    Session,
)
from floatbase.robots import State

STATES_PER_ROBOT = 200
RUN_TIME = 1.5  # s
PUSH_TIME = 0.2  # s, when a push begins
# friction coefficient, fraction of the torque limits, facets, terms of (7) that are off in the
# model: tight friction, motors so weak that most problems are infeasible, and the page's defaults
SETTINGS: tuple[tuple[float, float, int, tuple[str, ...]], ...] = (
    (0.7, 1.0, 4, ()), (0.7, 1.0, 16, ()), (0.12, 1.0, 4, ()), (0.3, 0.6, 8, ()),
    (0.5, 0.35, 4, ()), (0.05, 0.05, 4, ()), (0.7, 0.5, 4, ("cones", "drift", "velocity")),
    (0.5, 1.0, 8, ("forces", "zeros")),
)  # fmt: skip
# robot, settings of the page, force of the push on the base [N] and its duration [s]
RUNS: tuple[tuple[str, dict[str, Any], tuple[float, float, float], float], ...] = (
    ("go2", {}, (0.0, 0.0, 0.0), 0.1),
    ("go2", {}, (0.0, 30.0, 0.0), 0.1),
    ("go2", {}, (60.0, 0.0, 0.0), 0.1),
    ("go2", {}, (-60.0, 0.0, 0.0), 0.1),
    ("go2", {}, (0.0, -60.0, 0.0), 0.1),
    ("go2", {}, (40.0, 40.0, -40.0), 0.1),
    ("go2", {"actualPayload": 3.0}, (0.0, 30.0, 0.0), 0.1),
    ("go2", {"mu": 0.25, "actualMu": 0.25}, (20.0, 0.0, 0.0), 0.1),
    ("go2", {}, (0.0, 300.0, 0.0), 0.2),
    ("talos", {}, (0.0, 60.0, 0.0), 0.1),
    ("solo12", {"payload": 0.5, "actualPayload": 0.5}, (5.0, 0.0, 0.0), 0.1),
    *(
        ("go2", {side: [term]}, (0.0, 170.0 if term in ("velocity", "drift") else 30.0, 0.0), 0.1)
        for side, terms in (
            ("assumedOff", ("gravity", "velocity", "zeros", "drift")),
            ("actualOff", ("gravity", "velocity", "forces", "cones")),
        )
        for term in terms
    ),
    ("go2", {"assumedOff": ["forces"], "leg": "RR_foot"}, (0.0, 30.0, 0.0), 0.1),
    (
        "go2",
        {"assumedOff": ["zeros", "gravity", "forces"], "actualOff": ["zeros"], "leg": "RL_foot"},
        (0.0, 60.0, 0.0),
        0.1,
    ),
    ("solo12", {"assumedOff": ["zeros", "velocity"], "actualOff": ["zeros"]}, (9.0, 0.0, 0.0), 0.1),
)
# robot, friction coefficient, and for each time [s] the page's settings from then on: gait, speed
# [m/s], yaw rate [rad/s]; a push in between
WALKS: tuple[tuple[str, float, dict[float, tuple[str | None, float, float]]], ...] = (
    ("go2", 0.7, {0.0: ("trot", 0.4, 0.3), 1.5: ("trot", 0.6, -0.8), 2.61: (None, 0.6, -0.8)}),
    ("solo12", 0.7, {0.0: ("walk", *robots.MOST["walk"]), 2.3: ("walk", 0.1, 0.0)}),
)
WALK_TIME = 3.6  # s
# title of a challenge, and settings of the playground or a push [N, °] for times [s] of its run;
# each challenge of the page is solved once
CHALLENGED: tuple[tuple[str, dict[float, dict[str, Any] | tuple[float, float]]], ...] = (
    ("Survive 300 N", {0.0: {"steps_when_pushed": True}, 0.1: (200.0, 90.0), 0.4: (300.0, 90.0)}),
    ("On an edge", {0.0: {"friction": (0.1, 0.7)}, 0.2: (60.0, 45.0)}),
    ("Infeasible", {0.1: {"torque_fraction": 0.1, "min_normal_force": 60.0}}),
    ("Infeasible", {0.1: (400.0, 90.0)}),
    ("Quick foot", {0.2: {"lifted_feet": ("FL_foot",)}}),
    ("Quick foot", {0.0: {"com_shift": (-0.05, -0.03, 0.0)}, 0.8: {"lifted_feet": ("FL_foot",)}}),
    ("On ice", {0.0: {"friction": (0.05, 0.05)}, 0.2: (8.0, 0.0), 0.5: (10.0, 0.0)}),
    ("On ice", {0.2: (14.0, 0.0)}),
    ("The weakest side", {0.1: (190.0, 90.0)}),
    ("The weakest side", {0.1: (240.0, 90.0)}),
)
JUDGED_TIME = 3.0  # s, at most
SLICE = 9 * PERIOD  # s
WALK_PUSH = (0.0, 0.2, 0.0), 2.0, 0.1  # force [fraction of the weight], start and duration [s]


def write(folder: Path) -> None:
    """Write robots, states with their answers, and runs into a folder, for `reference.mjs`."""
    rng, index, numbers = np.random.default_rng(0), [], []
    for name in robots.ROBOTS:
        robot = fb.load(name)
        (folder / f"{name}.json").write_text(robots.robot_json(robot))
        controllers = [
            robots.controller(robot, mu, None, facets, torque, _mismatch(robot, off))
            for mu, torque, facets, off in SETTINGS
        ]
        for i in range(STATES_PER_ROBOT):
            which = i % len(SETTINGS)
            state = _random_state(robot, rng, violent=i % 3 == 2)
            count, arrays = _answer(controllers[which], *state)
            keys = ("mu", "torque", "facets", "assumedOff")
            settings = dict(zip(keys, SETTINGS[which], strict=True))
            index.append({"robot": name, "settings": settings, "count": count,
                          "lengths": [len(array) for array in arrays]})  # fmt: skip
            numbers += arrays
    (folder / "states.bin").write_bytes(np.concatenate(numbers).tobytes())
    (folder / "states.json").write_text(json.dumps(index))
    (folder / "runs.json").write_text(json.dumps([_run(*given) for given in RUNS]))
    walks = [_walk(*given) for given in WALKS]
    (folder / "walks.bin").write_bytes(
        np.concatenate([each.pop("numbers") for each in walks]).tobytes()
    )
    (folder / "walks.json").write_text(json.dumps(walks))
    (folder / "challenges.json").write_text(json.dumps([_judged(*given) for given in CHALLENGED]))
    (folder / "recovery.json").write_text(json.dumps(_recovery("solo12")))


def conflicts(folder: Path, found: list[dict[str, Any]]) -> list[list[bool]]:
    """For each conflict that the page found: whether its rows can hold, and without each row."""
    index, numbers = (
        json.loads((folder / "states.json").read_text()),
        np.fromfile(folder / "states.bin"),
    )
    starts, holds = np.cumsum([0] + [sum(each["lengths"]) for each in index]), []
    for each in found:
        given = index[each["state"]]
        robot, (nq, nv) = fb.load(given["robot"]), given["lengths"][:2]
        q, v = np.split(numbers[starts[each["state"]] :][: nq + nv], [nq])
        mu, torque, facets, off = given["settings"].values()
        made = robots.controller(robot, mu, None, facets, torque, _mismatch(robot, off))
        qp = made.qp(State(robot, q, v))
        names = [(row.kind, row.owner, row.number or 0) for row in qp.inequality_names]
        rows = [names.index(tuple(row)) for row in each["rows"]]
        sets = [rows, *([other for other in rows if other != row] for row in rows)]
        zero = np.zeros(qp.A.shape[1])
        answers = [linprog(zero, qp.G[some], qp.h[some], qp.A, qp.b, (None, None)) for some in sets]
        holds.append([answer.status == 0 for answer in answers])
    return holds


def _mismatch(robot: fb.Robot, off: Any, leg: str = "") -> ModelMismatch | None:
    mismatch = ModelMismatch(
        gravity="gravity" not in off,
        velocity_forces="velocity" not in off,
        drift="drift" not in off,
        underactuated="zeros" not in off,
        cones="cones" not in off,
        ignored_contacts=[leg or robot.feet[0].frame] if "forces" in off else (),
    )
    return None if mismatch.is_exact else mismatch


def _random_state(robot: fb.Robot, rng: Any, violent: bool) -> tuple[Any, Any]:
    scale = 3.0 if violent else 1.0
    q = np.array(robot.standing().q)
    step = scale * rng.normal(0.0, [0.02] * 3 + [0.05] * 3 + [0.05] * robot.d)
    step[3:6] = rng.normal(0.0, 0.1, 3)
    return pin.integrate(robot.model, q, step), scale * rng.normal(0.0, 0.25, robot.nv)


def _answer(made: fb.WholeBodyController, q: Any, v: Any) -> tuple[int, list[Any]]:
    """Number of active rows or code, and q, v, torques, active rows."""
    compiled = made.compiled
    assert compiled is not None
    robot = made.robot
    result, count = compiled.run(q, v, compiled.default_inputs, tick.N_STAGES)
    first = robot.nv + robot.d + made.contacts.k + robot.nv + made.contacts.k
    active = np.sort(result[first : first + max(count, 0)])
    return count, [q, v, result[compiled.tau], active]


def _run(name: str, given: dict[str, Any], force: Any, duration: float) -> dict[str, Any]:
    robot = fb.load(name)
    standing = robot.standing()
    off = given.get("actualOff", ())
    perturbation = Perturbation(
        gravity="gravity" not in off,
        velocity_forces="velocity" not in off,
        disabled_contacts=[robot.feet[0].frame] if "forces" in off else (),
        adhesion_force=float(round(robot.weight)) if "cones" in off else 0.0,
    )
    mismatch = _mismatch(robot, given.get("assumedOff", ()), given.get("leg", ""))
    mu = given.get("actualMu", robots.MU)
    sim = PerturbedSimulation(robot, mu, perturbation=perturbation)
    if "actualPayload" in given:
        sim.model.body_mass[1] += given["actualPayload"]
        mujoco.mj_setConst(sim.model, mujoco.MjData(sim.model))
    sim.reset(standing)
    assumed = _with_payload(robot, given.get("payload", 0.0))
    made = robots.controller(assumed, given.get("mu", robots.MU), modify_qp=mismatch)
    made = made.replace(tasks=fb.standing_tasks(standing))
    push = fb.Push(force, PUSH_TIME, duration)
    # the simulation is of the robot without its payload
    motors = BaseMotors(made, sim, mismatch) if "zeros" in off else made
    run = fb.rollout(sim, lambda q, v, t: motors(q, v, t), RUN_TIME, [push] if any(force) else [])
    model = _with_payload(robot, given.get("actualPayload", 0.0)).model
    data = model.createData()
    com = [pin.centerOfMass(model, data, np.array(q)).tolist() for q in run.q]
    return {"robot": name, "settings": given, "force": force, "duration": duration,
            "start": PUSH_TIME, "time": RUN_TIME, "outcome": run.outcome, "com": com}  # fmt: skip


class _RecordedWalk:
    """A walk that changes as scheduled; `rows` has state, CoM and inputs of each step."""

    def __init__(self, walk: Walk, schedule: dict[float, Any]):
        self.walk, self.schedule, self.rows = walk, schedule, list[Any]()

    @property
    def contacts(self) -> fb.Contacts:
        return self.walk.contacts

    def __call__(self, q: Any, v: Any, t: float = 0.0) -> Command:
        walk, settings = self.walk, self.schedule.get(round(t, 6))
        if settings and t > 0.0:
            if settings[0] is None:
                walk.gait = replace(walk.gait, stop=t)
            walk.velocity, walk.yaw_rate = (settings[1], 0.0), settings[2]
        command = walk(q, v, t)
        compiled = walk.controllers[walk.stance].compiled
        assert compiled is not None and command.backend == "compiled" and not command.softened
        inputs = compiled.user_terms.inputs(command.target_values, q, v, t).packed
        com = pin.centerOfMass(walk.robot.model, walk.robot.model.createData(), q)
        self.rows.append(np.concatenate([q, v, com, inputs]))
        return command


def _walk(name: str, mu: float, schedule: dict[float, Any]) -> dict[str, Any]:
    """A run of a `Walk`; for each step q, v, the centre of mass, and all inputs of the tick."""
    robot = fb.load(name)
    gait, speed, turn = schedule[0.0]
    walk = Walk(robot, fb.Contacts.feet(robot, mu), robots.gaits(robot)[gait], (speed, 0.0), turn)
    sim = fb.Simulation(robot, mu)
    sim.reset(robot.standing())
    force, start, duration = WALK_PUSH
    push = fb.Push(robot.weight * np.array(force), start, duration)
    recorded = _RecordedWalk(walk, schedule)
    run = fb.rollout(sim, recorded, WALK_TIME, [push])
    rows = recorded.rows
    settings = [
        {"time": time, "settings": dict(zip(("gait", "speed", "turn"), each, strict=True))}
        for time, each in schedule.items()
    ]
    return {"robot": name, "mu": mu, "schedule": settings, "outcome": run.outcome,
            "force": push.force.tolist(), "start": start, "duration": duration,
            "lengths": [len(row) for row in rows], "numbers": np.concatenate(rows)}  # fmt: skip


def _judged(title: str, script: dict[float, Any]) -> dict[str, Any]:
    """A run of a challenge: what its judge saw in each slice, and said."""
    (challenge,) = [each for each in CHALLENGES if each.title == title]
    session, judge = Session(fb.load("go2"), challenge.start), challenge.judge()
    waiting, pushes, samples, end = list(script.items()), list[fb.Push](), list[Any](), None

    def verdict() -> dict[str, Any]:
        return {"won": judge.won, "message": judge.message}

    while session.sim.time < JUDGED_TIME and not judge.won and end is None:
        while waiting and session.sim.time >= waiting[0][0] - 1e-9:
            act = waiting.pop(0)[1]
            if isinstance(act, tuple):
                pushes.append(fb.Push.horizontal(*act, session.sim.time))
            else:
                session.change(**act)
        acting = [push for push in pushes if session.sim.time < push.start + push.duration]
        record = fb.rollout(session.sim, session.controller, SLICE, acting, PERIOD)
        if len(record):
            session.observe(record)
            judge.observe(record, session)
            samples.append({"sample": _sample(record, session), "verdict": verdict()})
        if record.outcome != "completed":
            judge.run_ended(f"{record.outcome}: {record.error}", session)
            outcome = "infeasible" if "conflict" in str(record.error) else record.outcome
            end = {"outcome": outcome, "verdict": verdict()}
    given = [
        {"force": push.force.tolist(), "start": push.start, "duration": push.duration}
        for push in pushes
    ]
    return {"title": title, "samples": samples, "pushes": given, "end": end}


def _sample(record: fb.Rollout, session: Session) -> dict[str, Any]:
    """What the page's judges look at, as `sampleOf` in challenges.js."""
    sim, contacts = session.sim, record.contacts_at(-1)
    places = sim.contact_positions()
    heights = sim.ground.clearances(places).min(axis=1)
    feet = []
    for name, at, height in zip(sim.point_names, places.tolist(), heights.tolist(), strict=True):
        stands = name in contacts.names
        measured = record.force(name) if stands else np.zeros((1, 3))
        planned = record.force(name, "planned") if stands else np.zeros((1, 3))
        feet.append({"name": name, "at": at, "height": height, "stands": stands,
                     "load": measured[-1, 2], "planned": planned[-1].tolist()})  # fmt: skip
    facets = FrictionPolyhedron(contacts.normals[0], contacts.mus[0], session.settings.facets)
    return {"time": float(record.time[-1]), "span": len(record) * PERIOD, "feet": feet,
            "facets": facets.face_matrix.tolist()}  # fmt: skip


def _recovery(name: str) -> dict[str, Any]:
    """Largest survived pushes in three directions."""
    robot = fb.load(name)
    found = fb.push_recovery(
        lambda: (fb.Simulation(robot, robots.MU), robots.controller(robot)),
        directions=3, resolution=1.0, workers=1, progress=False,
    )  # fmt: skip
    return {"robot": name, "directions": found.directions.tolist(), "duration": found.duration,
            "resolution": found.resolution, "pushes": found.pushes.tolist()}  # fmt: skip


def _with_payload(robot: fb.Robot, payload: float) -> fb.Robot:
    """The robot with a heavier base; the payload is at the base's centre of mass."""
    model = robot.model.copy()
    base = model.inertias[1]
    model.inertias[1] = pin.Inertia(base.mass + payload, base.lever, base.inertia)
    return replace(robot, model=model)
