"""Ten challenges, each with initial settings, locked settings and a judge that watches the run.

`live/challenges.json` has their texts, settings and limits. The live page has judges of its own for
six of them, which read the same table.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

import floatbase as fb
from floatbase._validation import (
    Array,
    Value,
    as_bool,
    as_callable,
    as_instance,
    as_string,
    as_strings,
    checked,
)
from floatbase.errors import unknown_name
from floatbase.friction import FrictionPolyhedron
from floatbase.live.settings import CHALLENGE_TABLE
from floatbase.playground.session import Session
from floatbase.playground.settings import PAIR_NAMES, SETTING_NAMES, Settings

_LIMITS: dict[str, float] = CHALLENGE_TABLE["limits"]
# settings whose controls have other names
_WORDS: dict[str, str] = CHALLENGE_TABLE["words"]
_MIN_LOAD = _LIMITS["min_load"]  # N: a foot with a larger normal force counts as loaded
_LIFTED_HEIGHT = _LIMITS["lifted_height"]  # m above the ground: a higher foot counts as lifted
_SLIDE_DISTANCE = 0.3  # m, twice as far as the robot slides with the initial settings
_TRAVEL_DISTANCE = 0.012  # m that each foot must travel in the seventh challenge
_MAX_SLIP = 0.004  # m: a rolling foot creeps by less
# N: rounding of a force computed from magnitude and direction
_FORCE_ROUNDING = _LIMITS["force_rounding"]
_ONE_PUSH_ONLY = "That was more than one push. Reset, and push only once."
_SURVIVAL_TIME = _LIMITS["survival_time"]  # s that the robot must remain standing after a push
# N·s: toppling takes 19.5 forwards, less sideways, 22.5 backwards
_MAX_TOPPLING_IMPULSE = _LIMITS["toppling_impulse"]
_CHOICE_TIME = 1.0  # s that a number must be kept: a moving slider passes all of them


class Judge:
    """Judge that watches a run from one reset to the next.

    Call `observe` with each slice of the run, and `run_ended` when the run stops by itself.
    `message` holds the current status, `won` whether the challenge is solved, and `pushes` the
    pushes so far. If a locked setting was changed, `violation` says which one, and the challenge
    can no longer be won.

    Parameters
    ----------
    challenge : Challenge
        Challenge to judge.

    Raises
    ------
    InputError
        If the challenge has the wrong type.
    """

    def __init__(self, challenge: Challenge):
        self.challenge = as_instance("challenge", challenge, Challenge)
        self.won = False
        self.message = self.violation = ""
        self.pushes: list[fb.Push] = []
        self.memory: dict[str, Any] = {}

    @property
    def largest_push(self) -> float | None:
        """Largest force of a push so far [N], without very short ones; None before the first."""
        pushes = (push for push in self.pushes if push.duration >= _LIMITS["push_time"])
        return max((float(np.linalg.norm(push.force)) for push in pushes), default=None)

    def observe(self, record: fb.Rollout, session: Session) -> None:
        """Judge a new slice of the run.

        Parameters
        ----------
        record : Rollout
            Record of the slice.
        session : Session
            Session that ran it.
        """
        as_instance("record", record, fb.Rollout)
        as_instance("session", session, Session)
        self.pushes += [
            push for push in record.pushes if all(push is not seen for seen in self.pushes)
        ]
        self._apply_verdict(self.challenge.watch(self, record, session), session)

    def run_ended(self, status: str, session: Session) -> None:
        """Judge a run that stopped by itself.

        Parameters
        ----------
        status : str
            Status of the run, with the reason.
        session : Session
            Session that ran it.
        """
        as_string("status", status)
        as_instance("session", session, Session)
        if self.challenge.end is not None:
            self._apply_verdict(self.challenge.end(self, status, session), session)

    def _apply_verdict(self, verdict: bool | str, session: Session) -> None:
        """Store a verdict: True wins, a string becomes the message. A won challenge stays won."""
        if self.won:
            return
        if violations := self.challenge.violations(session.settings):
            self.violation = (
                f"{' and '.join(violations)} must not be changed in this challenge. "
                f'Press "reset everything".'
            )
        if self.violation:
            self.message = self.violation
        elif verdict is True:
            self.won, self.message = True, f"Solved. {self.memory.get('score', '')}".strip()
        elif isinstance(verdict, str):
            self.message = verdict


Watch = Callable[[Judge, fb.Rollout, Session], bool | str]
End = Callable[[Judge, str, Session], bool | str]


def _as_settings(name: str, value: Any, known: tuple[str, ...]) -> tuple[str, ...]:
    """Return `value` as a tuple after checking that it contains known names of settings."""
    for setting in (settings := as_strings(name, value)):
        if setting not in known:
            raise unknown_name(f"setting in {name}", setting, known)
    return settings


def _as_end(name: str, value: Any) -> End | None:
    """Return `value` after checking that it is None or can judge the end of a run."""
    return None if value is None else as_callable(name, value, "end(judge, status, session)")


@dataclass(frozen=True)
class Challenge(Value):
    """A challenge of the playground.

    Parameters
    ----------
    title : str
        Title that the user sees.
    text : str
        Description that the user sees.
    watch : callable
        Function `watch(judge, record, session)` that examines each slice. It returns True when the
        challenge is solved, otherwise a status message.
    start : Settings
        Initial settings.
    locked : tuple of str
        Names of settings that must not be changed.
    locked_actual : tuple of str
        Names of paired settings whose actual value must not be changed.
    end : callable or None
        Function `end(judge, status, session)`, called when the run stops by itself, for challenges
        that can be solved in this way. It returns the same as `watch`.
    paused : bool
        Whether the challenge starts paused, so that the user must press run.

    Raises
    ------
    InputError
        If a value has the wrong type.
    UnknownNameError
        If a locked setting does not exist, or is not a pair in `locked_actual`.
    """

    robot: ClassVar[str] = "go2"
    title: str = field(metadata=checked(as_string))
    text: str = field(metadata=checked(as_string))
    watch: Watch = field(metadata=checked(as_callable, "watch(judge, record, session)"))
    start: Settings = field(default_factory=Settings, metadata=checked(as_instance, Settings))
    locked: tuple[str, ...] = field(default=(), metadata=checked(_as_settings, SETTING_NAMES))
    locked_actual: tuple[str, ...] = field(default=(), metadata=checked(_as_settings, PAIR_NAMES))
    end: End | None = field(default=None, metadata=checked(_as_end))
    paused: bool = field(default=False, metadata=checked(as_bool))

    def judge(self) -> Judge:
        """Make a new judge."""
        return Judge(self)

    def violations(self, settings: Settings) -> list[str]:
        """List the locked settings that differ from the initial ones.

        Parameters
        ----------
        settings : Settings
            Current settings.

        Returns
        -------
        list of str
            Names of the settings, for a message.
        """
        as_instance("settings", settings, Settings)
        locked = [
            _WORDS.get(name, name.replace("_", " "))
            for name in self.locked
            if getattr(settings, name) != getattr(self.start, name)
        ]
        return locked + [
            f"{name} in reality"
            for name in self.locked_actual
            if getattr(settings, name)[1] != getattr(self.start, name)[1]
        ]


def _normals(record: fb.Rollout) -> dict[str, Array]:
    """Return the measured normal force of each foot over a record, on level ground [N]."""
    return {name: record.force(name)[:, 2] for name in record.contacts.names}


def _heights(session: Session) -> dict[str, float]:
    """Return the current height of each foot above the ground [m]."""
    clearances = session.sim.ground.clearances(session.sim.contact_positions()).min(axis=1)
    return dict(zip(session.sim.point_names, clearances.tolist(), strict=True))


def _time_held(judge: Judge, record: fb.Rollout, holds: bool) -> float:
    """Return for how long a condition has held without interruption [s]."""
    span = len(record) * float(record.time[-1] - record.time[0]) / max(len(record) - 1, 1)
    judge.memory["held"] = judge.memory.get("held", 0.0) + span if holds else 0.0
    return float(judge.memory["held"])


def _two_feet(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    """Judge whether the robot stands on FL and RR alone for one second."""
    lifted = {name for name, height in _heights(session).items() if height > _LIFTED_HEIGHT / 2}
    held = _time_held(judge, record, lifted == {"FR_foot", "RL_foot"})
    return held >= 1.0 or f"On FL and RR alone for {held:.1f} s."


def _survive(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    """Judge whether the robot survives a push of 300 N."""
    if (size := judge.largest_push) is None:
        return "Push the robot with 300 N in any direction."
    if size < _LIMITS["survived_push"] - _FORCE_ROUNDING:
        return f"{size:.0f} N is not enough."
    held = _time_held(judge, record, True)
    return held >= _SURVIVAL_TIME or f"Standing for {held:.1f} s."


def _icy_slope(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    """Judge whether the robot has slid far enough."""
    start = judge.memory.setdefault("start", np.array(session.sim.state.com))
    way = float(np.linalg.norm(session.sim.state.com - start))
    return way >= _SLIDE_DISTANCE or f"Moved {100 * way:.0f} of {100 * _SLIDE_DISTANCE:.0f} cm."


def _on_an_edge(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    """Judge whether the planned force of a foot lies on an edge of its polyhedron."""
    found = {}
    contacts = record.contacts_at(-1)
    for i, name in enumerate(contacts.names):
        cone = FrictionPolyhedron(contacts.normals[i], contacts.mus[i], session.settings.facets)
        force = record.force(name, "planned")[-1]
        if np.isfinite(force).all() and force @ contacts.normals[i] > _MIN_LOAD:
            found[name] = int(
                np.sum(
                    cone.face_matrix @ force
                    > -_LIMITS["facet_tolerance"] * float(force @ contacts.normals[i])
                )
            )
    most = max(found.values(), default=0)
    return most >= 2 or f"Most active facets at one foot: {most}."


def _no_answer(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    """Return the status while the quadratic program is feasible."""
    return "The quadratic program has been feasible at every control step."


def _infeasible(judge: Judge, status: str, session: Session) -> bool | str:
    """Judge whether the run ended because the quadratic program was infeasible."""
    return (
        True
        if "infeasible" in status or "conflict" in status
        else f"The run ended for another reason: {status.splitlines()[0][:80]}"
    )


def _quick_foot(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    """Judge how fast a front foot is lifted after all four feet last carried load."""
    normals, heights = _normals(record), _heights(session)
    front = max(heights["FL_foot"], heights["FR_foot"])
    if "up" not in judge.memory:
        if (
            len(normals) == len(heights)
            and min(float(force[-1]) for force in normals.values()) > _MIN_LOAD
        ):
            judge.memory["all"] = float(record.time[-1])
        if front <= _LIFTED_HEIGHT or "all" not in judge.memory:
            return "Lift a front foot 2 cm, and stand on the other three for one second."
        judge.memory["up"] = float(record.time[-1]) - judge.memory["all"]
    held = _time_held(judge, record, front > _LIFTED_HEIGHT)
    if held == 0.0:
        del judge.memory["up"]
        return "The foot came down again."
    if judge.memory["up"] >= _LIMITS["lifting_time"]:
        return f"Lifting took {judge.memory['up']:.2f} s. Reset, and lean first."
    judge.memory["score"] = f"{judge.memory['up']:.2f} s."
    return (
        held >= _LIMITS["lifted_time"]
        or f"Lifted in {judge.memory['up']:.2f} s, in the air for {held:.1f} s."
    )


def _feet_that_travel(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    """Judge whether all feet have moved without being lifted and without slipping."""
    normals = _normals(record)
    if (
        len(normals) < len(session.sim.point_names)
        or min(float(force.min()) for force in normals.values()) < _MIN_LOAD
    ):
        judge.memory.clear()
        return "A foot was lifted, so the distances start again from zero."
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
        return f"A foot slipped by {1e3 * slip:.0f} mm. Reset, and move more gently."
    return (
        float(way.min()) >= _TRAVEL_DISTANCE
        or f"The feet have moved {', '.join(f'{1e3 * x:.0f}' for x in way)} mm."
    )


def _on_ice(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    """Judge whether the feet stay in place after a push on ice."""
    feet, size = session.sim.contact_positions(), judge.largest_push
    start = judge.memory.setdefault("feet", feet)
    if size is None or size < _LIMITS["ice_push"] - _FORCE_ROUNDING:
        judge.memory["feet"] = feet
        return "Push the robot with 10 N." if size is None else "Push with at least 10 N."
    moved = float(np.linalg.norm(feet - start, axis=1).max())
    if moved > _LIMITS["ice_slip"]:
        return f"A foot has slipped by {1e3 * moved:.0f} mm. Reset."
    held = _time_held(judge, record, True)
    return (
        held >= _SURVIVAL_TIME
        or f"No foot has slipped more than {1e3 * moved:.1f} mm for {held:.1f} s."
    )


def _how_many_facets(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    """Judge whether the number of facets is the smallest sufficient one."""
    n = session.settings.facets
    if judge.memory.get("facets") != n:
        judge.memory = {"facets": n}
    lost = 1.0 - math.cos(math.pi / n)
    if lost > 0.03:
        return f"{n} facets: the weakest direction loses {100 * lost:.1f} % of its friction."
    if 1.0 - math.cos(math.pi / (n - 1)) <= 0.03:
        return f"{n} facets lose {100 * lost:.1f} %. Fewer are enough."
    return (
        _time_held(judge, record, True) >= _CHOICE_TIME
        or f"{n} facets lose {100 * lost:.1f} %. Keep this number for one second."
    )


def _topple(judge: Judge, record: fb.Rollout, session: Session) -> bool | str:
    """Return the status before the robot falls."""
    return (
        _ONE_PUSH_ONLY
        if len(judge.pushes) > 1
        else "Topple the robot with one push, as small as possible."
    )


def _toppled(judge: Judge, status: str, session: Session) -> bool | str:
    """Judge the impulse of the push that made the robot fall."""
    if not status.startswith("fell") or not judge.pushes:
        return "A push must make the robot fall."
    if len(judge.pushes) > 1:
        return _ONE_PUSH_ONLY
    (push,) = judge.pushes
    impulse = float(np.linalg.norm(push.force)) * push.duration
    judge.memory["score"] = f"{impulse:.1f} N·s."
    return (
        impulse <= _MAX_TOPPLING_IMPULSE
        or f"{impulse:.1f} N·s toppled the robot. From the right side, "
        f"{_MAX_TOPPLING_IMPULSE:.0f} N·s are enough."
    )


_WATCHES: dict[str, Watch] = {
    "two_feet": _two_feet,
    "survive": _survive,
    "icy_slope": _icy_slope,
    "on_an_edge": _on_an_edge,
    "infeasible": _no_answer,
    "quick_foot": _quick_foot,
    "feet_that_travel": _feet_that_travel,
    "on_ice": _on_ice,
    "how_many_facets": _how_many_facets,
    "topple": _topple,
}
_ENDS: dict[str, End] = {"infeasible": _infeasible, "topple": _toppled}
CHALLENGES = tuple(
    Challenge(
        row["title"],
        row["text"],
        _WATCHES[row["judge"]],
        Settings(**row.get("start", {})),
        row["locked"],
        row.get("locked_actual", ()),
        _ENDS.get(row["judge"]),
        row.get("paused", False),
    )
    for row in CHALLENGE_TABLE["challenges"]
)
