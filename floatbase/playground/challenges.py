"""Ten challenges, each with a start, what may not be changed, and a judge that watches the run."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

import floatbase as fb
from floatbase._validation import Array
from floatbase.friction import FrictionPolyhedron
from floatbase.playground.session import Session
from floatbase.playground.settings import Settings

_MIN_LOAD = 5.0  # N: a foot with more carries something
_LIFTED_HEIGHT = 0.02  # m over the ground, and higher is lifted
_FACET_TOLERANCE = 1e-4  # of the normal force: closer to a facet is on it
_SLIDE_DISTANCE = 0.3  # m, twice as far as it comes with what it believes at first
_TRAVEL_DISTANCE = 0.012  # m that every foot of the seventh challenge is to travel
_MAX_SLIP = 0.004  # m, that creeps under a foot which rolls
_FORCE_ROUNDING = 1e-9  # N, of a force that is made of its size and its direction
_ONE_PUSH_ONLY = "That was more than one push: reset, and push once."
_SURVIVAL_TIME = 2.0  # s that a robot must stay on its feet after a push
_MAX_TOPPLING_IMPULSE = 19.2  # N·s: forwards it takes 19.5, sideways less, backwards 22.5
_CHOICE_TIME = 1.0  # s that a number must stay: a slider on its way passes all of them


class Judge:
    """Watches a run from one reset to the next: `observe` gets every slice, `run_ended` why it
    stopped. `message` is the state of play.

    `pushes` are those seen so far. `violation` says what was changed that may not be: there is
    nothing to win any more.
    """

    def __init__(self, challenge: Challenge):
        self.challenge = challenge
        self.won = False
        self.message = self.violation = ""
        self.pushes: list[fb.Push] = []
        self.memory: dict[str, Any] = {}

    @property
    def largest_push(self) -> float | None:
        """The largest force of a push, N; None before the first one."""
        return max((float(np.linalg.norm(push.force)) for push in self.pushes), default=None)

    def observe(self, record: fb.Rollout, session: Session) -> None:
        """A slice has been run."""
        self.pushes += [
            push for push in record.pushes if all(push is not seen for seen in self.pushes)
        ]
        self._apply_verdict(self.challenge.watch(self, record, session), session)

    def run_ended(self, status: str, session: Session) -> None:
        """The run has stopped by itself."""
        if self.challenge.end is not None:
            self._apply_verdict(self.challenge.end(self, status, session), session)

    def _apply_verdict(self, verdict: bool | str, session: Session) -> None:
        """True wins, a text tells the state of the play. Who has won has won."""
        if self.won:
            return
        if violations := self.challenge.violations(session.settings):
            self.violation = (
                f"{' and '.join(violations)} may not be changed in this challenge: "
                f'press "all as at first".'
            )
        if self.violation:
            self.message = self.violation
        elif verdict is True:
            self.won, self.message = True, f"Solved. {self.memory.get('score', '')}".strip()
        elif isinstance(verdict, str):
            self.message = verdict


Watch = Callable[[Judge, fb.Rollout, Session], bool | str]


@dataclass(frozen=True)
class Challenge:
    """A challenge.

    title, text: what the reader sees.
    watch: looks at each slice; True when it is solved, else the state of the play.
    start: settings to begin with.
    locked: names of settings that may not be changed.
    locked_actual: names of pairs of settings of which the true one may not be changed.
    paused: whether the reader must press run first.
    end: looks at why a run stopped, where that may solve it.
    """

    robot: ClassVar[str] = "go2"
    title: str
    text: str
    watch: Watch
    start: Settings = field(default_factory=Settings)
    locked: tuple[str, ...] = ()
    locked_actual: tuple[str, ...] = ()
    end: Callable[[Judge, str, Session], bool | str] | None = None
    paused: bool = False

    def judge(self) -> Judge:
        """A new judge."""
        return Judge(self)

    def violations(self, settings: Settings) -> list[str]:
        """What differs from the start and may not, in words."""
        locked = [
            name for name in self.locked if getattr(settings, name) != getattr(self.start, name)
        ]
        return locked + [
            f"true {name}"
            for name in self.locked_actual
            if getattr(settings, name)[1] != getattr(self.start, name)[1]
        ]


def _normals(record: fb.Rollout) -> dict[str, Array]:
    """Measured normal force of each foot through a record, N, on level ground."""
    return {name: record.force(name)[:, 2] for name in record.contacts.names}


def _heights(session: Session) -> dict[str, float]:
    """How far each foot is over the ground now, m."""
    clearances = session.sim.ground.clearances(session.sim.contact_positions()).min(axis=1)
    return dict(zip(session.sim.point_names, clearances.tolist(), strict=True))


def _time_held(judge: Judge, record: fb.Rollout, holds: bool) -> float:
    """s for which something has held without a break."""
    span = len(record) * float(record.time[-1] - record.time[0]) / max(len(record) - 1, 1)
    judge.memory["held"] = judge.memory.get("held", 0.0) + span if holds else 0.0
    return float(judge.memory["held"])


def _two_feet(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    lifted = {name for name, height in _heights(session).items() if height > _LIFTED_HEIGHT / 2}
    held = _time_held(judge, record, lifted == {"FR_foot", "RL_foot"})
    return held >= 1.0 or f"{held:.1f} s on FL and RR, the others in the air."


def _survive(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    if (size := judge.largest_push) is None:
        return "Push it with 300 N, in any direction."
    if size < 300.0 - _FORCE_ROUNDING:
        return f"{size:.0f} N is not enough."
    held = _time_held(judge, record, True)
    return held >= _SURVIVAL_TIME or f"On its feet for {held:.1f} s."


def _icy_slope(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    start = judge.memory.setdefault("start", np.array(session.sim.state.com))
    way = float(np.linalg.norm(session.sim.state.com - start))
    return way >= _SLIDE_DISTANCE or f"{100 * way:.0f} of {100 * _SLIDE_DISTANCE:.0f} cm."


def _on_an_edge(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    found = {}
    contacts = record.contacts_at(-1)
    for i, name in enumerate(contacts.names):
        cone = FrictionPolyhedron(contacts.normals[i], contacts.mus[i], session.settings.facets)
        force = record.force(name, "planned")[-1]
        if np.isfinite(force).all() and force @ contacts.normals[i] > _MIN_LOAD:
            found[name] = int(
                np.sum(
                    cone.face_matrix @ force
                    > -_FACET_TOLERANCE * float(force @ contacts.normals[i])
                )
            )
    most = max(found.values(), default=0)
    return most >= 2 or f"{most} active facet{'s' if most != 1 else ''} at a foot."


def _no_answer(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    return "The quadratic program has an answer at every tick."


def _infeasible(judge: Judge, status: str, session: Session) -> bool | str:
    return (
        True
        if "infeasible" in status or "conflict" in status
        else f"Not that: {status.splitlines()[0][:80]}"
    )


def _quick_foot(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    """From the last time that all four carry to a front foot in the air."""
    normals, heights = _normals(record), _heights(session)
    front = max(heights["FL_foot"], heights["FR_foot"])
    if "up" not in judge.memory:
        if (
            len(normals) == len(heights)
            and min(float(force[-1]) for force in normals.values()) > _MIN_LOAD
        ):
            judge.memory["all"] = float(record.time[-1])
        if front <= _LIFTED_HEIGHT or "all" not in judge.memory:
            return "Lift a front foot 2 cm, and stay on the other three for a second."
        judge.memory["up"] = float(record.time[-1]) - judge.memory["all"]
    held = _time_held(judge, record, front > _LIFTED_HEIGHT)
    if held == 0.0:
        del judge.memory["up"]
        return "It came down again."
    if judge.memory["up"] >= 0.5:
        return f"It took {judge.memory['up']:.2f} s: reset, and lean first."
    judge.memory["score"] = f"{judge.memory['up']:.2f} s."
    return held >= 1.0 or f"Up in {judge.memory['up']:.2f} s, for {held:.1f} s."


def _feet_that_travel(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    normals = _normals(record)
    if (
        len(normals) < len(session.sim.point_names)
        or min(float(force.min()) for force in normals.values()) < _MIN_LOAD
    ):
        judge.memory.clear()
        return "A foot was lifted: it begins anew."
    places, rolled = record.foot_positions, record.rolling_displacement()
    slid = (
        judge.memory.get("slid", np.zeros(places.shape[1:]))
        + (places - rolled)[-1]
        - (places - rolled)[0]
    )
    judge.memory["slid"] = slid
    start = judge.memory.setdefault("places", np.array(places[0]))
    way = np.linalg.norm((places[-1] - start)[:, :2], axis=1)
    slip = float(np.linalg.norm(slid[:, :2], axis=1).max())
    if slip > _MAX_SLIP:
        return f"A foot slipped by {1e3 * slip:.0f} mm: reset, and more gently."
    return (
        float(way.min()) >= _TRAVEL_DISTANCE
        or f"The feet are {', '.join(f'{1e3 * x:.0f}' for x in way)} mm from where they stood."
    )


def _on_ice(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    feet, size = session.sim.contact_positions(), judge.largest_push
    start = judge.memory.setdefault("feet", feet)
    if size is None or size < 10.0 - _FORCE_ROUNDING:
        judge.memory["feet"] = feet
        return "Push it with 10 N." if size is None else "10 N, at least."
    moved = float(np.linalg.norm(feet - start, axis=1).max())
    if moved > 0.01:
        return f"A foot has slipped by {1e3 * moved:.0f} mm: reset."
    held = _time_held(judge, record, True)
    return held >= _SURVIVAL_TIME or f"All feet within {1e3 * moved:.1f} mm for {held:.1f} s."


def _how_many_facets(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    n = session.settings.facets
    if judge.memory.get("facets") != n:
        judge.memory = {"facets": n}
    lost = 1.0 - math.cos(math.pi / n)
    if lost > 0.03:
        return f"{n} facets: the weakest direction has lost {100 * lost:.1f} % of its friction."
    if 1.0 - math.cos(math.pi / (n - 1)) <= 0.03:
        return f"{n} facets lose {100 * lost:.1f} %; fewer would do."
    return (
        _time_held(judge, record, True) >= _CHOICE_TIME
        or f"{n} facets lose {100 * lost:.1f} %: leave it there for a second."
    )


def _topple(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    return (
        _ONE_PUSH_ONLY if len(judge.pushes) > 1 else "One push, with as little force as topples it."
    )


def _toppled(judge: Judge, status: str, session: Session) -> bool | str:
    if not status.startswith("fell") or not judge.pushes:
        return "It must fall by a push."
    if len(judge.pushes) > 1:
        return _ONE_PUSH_ONLY
    (push,) = judge.pushes
    impulse = float(np.linalg.norm(push.force)) * push.duration
    judge.memory["score"] = f"{impulse:.1f} N·s."
    return (
        impulse <= _MAX_TOPPLING_IMPULSE
        or f"{impulse:.1f} N·s topple it; {_MAX_TOPPLING_IMPULSE:.0f} do, from the right side."
    )


_LOCKED_PHYSICS = ("mass", "actual_off", "assumed_off", "slope")
_LOCKED_STANCE = ("com_shift", "lifted_feet", "nod", "gait", "steps_when_pushed")
_LOCKED_QP = ("facets", "torque_fraction", "min_normal_force", "weights")
CHALLENGES = (
    Challenge(
        "Stand on two feet",
        "Lift FR and RL, and stand on FL and RR for a second.",
        _two_feet, locked=_LOCKED_PHYSICS,
    ),
    Challenge(
        "Survive 300 N",
        "Push it with 300 N from any side; 2 s later it must be on its feet.",
        _survive, locked=_LOCKED_PHYSICS,
    ),
    Challenge(
        "Down an icy slope",
        "The ground falls by 20° and is slippery. Press run, and slide 30 cm without falling.",
        _icy_slope, Settings(slope=(0.0, 20.0), friction=(0.7, 0.2)),
        locked=("mass", "actual_off", "assumed_off"), locked_actual=("slope", "friction"),
        paused=True,
    ),
    Challenge(
        "On an edge",
        "Bring a foot's planned force onto an edge of its polyhedron: two active facets.",
        _on_an_edge, locked=_LOCKED_PHYSICS,
    ),
    Challenge(
        "No answer",
        "Find settings for which the quadratic program has no solution.",
        _no_answer, locked=("actual_off", "assumed_off"), end=_infeasible,
    ),
    Challenge(
        "Quick foot",
        "From four feet that carry to a front foot 2 cm in the air in less than 0.5 s; stay so for "
        "1 s.",
        _quick_foot, locked=_LOCKED_PHYSICS,
    ),
    Challenge(
        "Feet that travel",
        "No foot is lifted, none slips, and all four end 12 mm away from where they stood.",
        _feet_that_travel, locked=_LOCKED_PHYSICS,
    ),
    Challenge(
        "On ice",
        "The ground has a friction of 0.05. Push with 10 N; no foot may slip by 1 cm for 2 s.",
        _on_ice, Settings(friction=(0.7, 0.05)),
        locked=(*_LOCKED_PHYSICS, "gait"), locked_actual=("friction",),
    ),
    Challenge(
        "How many facets?",
        "The fewest facets with which no direction loses more than 3 % of the cone's friction.",
        _how_many_facets, locked=_LOCKED_PHYSICS,
    ),
    Challenge(
        "The weakest side",
        "Topple the standing robot with one push of at most 19 N·s.",
        _topple,
        locked=(*_LOCKED_PHYSICS, "friction", "bandwidth", *_LOCKED_STANCE, *_LOCKED_QP),
        end=_toppled,
    ),
)  # fmt: skip
