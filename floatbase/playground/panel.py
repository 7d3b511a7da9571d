"""The controls of the playground's page: what each of them sets, and where they stand for given
settings.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any

from floatbase.playground.challenges import CHALLENGES
from floatbase.playground.equation import EQUATION
from floatbase.playground.settings import GAITS, IDEAL_BANDWIDTH, Settings
from floatbase.playground.term_arrows import TERM_LEGEND

if TYPE_CHECKING:
    from floatbase.playground.page import Playground

_MAX_PUSH = 2.5  # times the weight: a push that asks for steps
_PAIRED_SLIDERS = {  # name: (attribute, low, high, step)
    "friction": ("friction", 0.05, 1.5, 0.05),
    "slope [°]": ("slope", -30.0, 30.0, 1.0),
    "mass [×]": ("mass", 0.5, 2.0, 0.05),
    "motors [Hz]": ("bandwidth", 1.0, IDEAL_BANDWIDTH, 1.0),
}
_WEIGHTS = ("motion", "posture", "effort")
_FREE_PLAY = "play freely"


class Panel:
    """The controls of a playground, added to its page when this is made."""

    def __init__(self, playground: Playground):
        self._playground = playground
        self._add()

    def _add(self) -> None:
        view, weight, s = (
            self._playground.view,
            self._playground.robot.weight,
            self._playground.session.settings,
        )
        view.add_button("run", self._playground.run.start)
        view.add_button("pause", self._playground.run.pause)
        view.add_button("reset", self._playground.run.reset)
        view.add_button("push", self._playground.push)
        view.add_button("all as at first", self._playground.reset_all)
        view.add_slider("speed", self._playground.run.set_time_scale, 1.0, 0.05, 1.0, 0.05)
        view.add_slider(
            "push [N]",
            partial(setattr, self._playground, "force"),
            self._playground.force,
            0.0,
            _MAX_PUSH * weight,
            1.0,
        )
        view.add_slider(
            "towards [°]",
            partial(setattr, self._playground, "towards"),
            self._playground.towards,
            -180.0,
            180.0,
            5.0,
        )
        if not self._playground.robot.is_floating:
            return
        self._add_challenges()
        for name, (attribute, low, high, step) in _PAIRED_SLIDERS.items():
            for i, column in enumerate(("believed", "true")):
                value, changed = getattr(s, attribute)[i], partial(self._set_entry, attribute, i)
                word = "perfect" if high == IDEAL_BANDWIDTH else ""
                view.add_slider(
                    f"{name} {column}",
                    changed,
                    value,
                    low,
                    high,
                    step,
                    "believed and true",
                    column,
                    word,
                )
        self._add_stance()
        self._add_walk()
        where = "its quadratic program"
        view.add_slider(
            "facets", lambda n: self._playground.set(facets=round(n)), s.facets, 3, 16, 1, where
        )
        view.add_slider(
            "torque limits [×]",
            lambda x: self._playground.set(torque_fraction=x),
            s.torque_fraction,
            0.05,
            1.0,
            0.05,
            where,
        )
        view.add_slider(
            "least force [N]",
            lambda x: self._playground.set(min_normal_force=x),
            s.min_normal_force,
            0.0,
            100.0,
            5.0,
            where,
        )
        for i, name in enumerate(_WEIGHTS):
            changed = partial(self._set_weight, i)
            view.add_slider(f"{name} ×10^", changed, 0.0, -3.0, 3.0, 0.5, where)
        self._add_terms()

    def _add_challenges(self) -> None:
        if self._playground.robot.name in {challenge.robot for challenge in CHALLENGES}:
            titles = [
                _FREE_PLAY,
                *(f"{i + 1}. {challenge.title}" for i, challenge in enumerate(CHALLENGES)),
            ]
            self._playground.view.add_dropdown(
                "challenge",
                lambda i: self._playground.start_challenge(CHALLENGES[i - 1] if i else None),
                titles,
            )

    def _add_stance(self) -> None:
        view = self._playground.view
        for foot in self._playground.robot.feet:
            view.add_checkbox(
                f"on {foot.frame}", partial(self._set_foot_contact, foot.frame), True, "its stance"
            )
        for i, axis in enumerate("xyz"):
            view.add_slider(
                f"CoM {axis} [m]",
                partial(self._set_entry, "com_shift", i),
                0.0,
                -0.08,
                0.08,
                0.005,
                "its stance",
            )
        view.add_slider(
            "nod and turn", self._playground.set_nodding, 0.0, 0.0, 0.35, 0.01, "its stance"
        )

    def _add_walk(self) -> None:
        view, gaits = self._playground.view, self._gait_names
        if not gaits:
            return
        view.add_dropdown(
            "gait", self._set_gait, ["stand", "step when pushed", *gaits], 0, "its steps"
        )
        view.add_slider(
            "forwards [m/s]",
            partial(self._set_entry, "velocity", 0),
            0.0,
            -0.3,
            0.5,
            0.05,
            "its steps",
        )
        view.add_slider(
            "to the left [m/s]",
            partial(self._set_entry, "velocity", 1),
            0.0,
            -0.2,
            0.2,
            0.05,
            "its steps",
        )
        view.add_slider(
            "turn [rad/s]",
            partial(self._set_entry, "velocity", 2),
            0.0,
            -0.5,
            0.5,
            0.05,
            "its steps",
        )

    def _add_terms(self) -> None:
        view = self._playground.view
        for name, (colour, meaning) in TERM_LEGEND.items():
            view.add_legend_entry(f"term {name}", colour, meaning)
        for term in EQUATION:
            show = partial(self._playground.show_term, term.name)
            view.add_toggle(
                f"show {term.name}",
                show,
                self._playground.shown_terms[term.name],
                term.symbol,
                "shown",
            )
            if term.assumed_switch:
                view.add_toggle(
                    term.assumed_switch,
                    partial(self._set_term, "assumed_off", term.name),
                    True,
                    term.symbol,
                    "believed",
                )
            if term.actual_switch:
                view.add_toggle(
                    term.actual_switch,
                    partial(self._set_term, "actual_off", term.name),
                    True,
                    term.symbol,
                    "world",
                )

    @property
    def _gait_names(self) -> list[str]:
        return list(GAITS.get(len(self._playground.robot.feet), {}))

    def _set_entry(self, attribute: str, i: int, value: float) -> None:
        values = list(getattr(self._playground.pending_settings, attribute))
        values[i] = value
        self._playground.set(**{attribute: tuple(values)})

    def _set_weight(self, i: int, exponent: float) -> None:
        self._set_entry("weights", i, 10.0**exponent)

    def _set_foot_contact(self, foot: str, stands: bool) -> None:
        lifted = [name for name in self._playground.pending_settings.lifted_feet if name != foot]
        self._playground.set(lifted_feet=tuple(lifted if stands else [*lifted, foot]))

    def _set_gait(self, number: int) -> None:
        gait = ["", "", *self._gait_names][number] or None
        self._playground.set(
            gait=gait, steps_when_pushed=number == 1, start_time=self._playground.session.sim.time
        )

    def _set_term(self, attribute: str, term: str, on: bool) -> None:
        off = tuple(
            name for name in getattr(self._playground.pending_settings, attribute) if name != term
        )
        self._playground.set(
            **{attribute: off if on else (*off, term)}, leg=self._playground.robot.feet[0].frame
        )

    def show_view_settings(self, speed: float) -> None:
        """Show the push, the speed (simulated over real time) and the shown terms at their
        controls.
        """
        play = self._playground
        values: dict[str, Any] = {
            "speed": speed,
            "push [N]": play.force,
            "towards [°]": play.towards,
        }
        if play.robot.is_floating:
            values |= {f"show {term.name}": play.shown_terms[term.name] for term in EQUATION}
        for name, value in values.items():
            play.view.set_control_value(name, value)

    def show_settings(self, s: Settings) -> None:
        """Show settings at the controls, which only a floating robot has."""
        if not self._playground.robot.is_floating:
            return
        view = self._playground.view
        values: dict[str, Any] = {
            "facets": s.facets,
            "nod and turn": s.nod,
            "torque limits [×]": s.torque_fraction,
        }
        values["least force [N]"] = s.min_normal_force
        for name, (attribute, *_) in _PAIRED_SLIDERS.items():
            values |= dict(
                zip((f"{name} believed", f"{name} true"), getattr(s, attribute), strict=True)
            )
        values |= {
            f"on {foot.frame}": foot.frame not in s.lifted_feet
            for foot in self._playground.robot.feet
        }
        values |= {f"CoM {axis} [m]": value for axis, value in zip("xyz", s.com_shift, strict=True)}
        values |= {
            f"{name} ×10^": math.log10(value)
            for name, value in zip(_WEIGHTS, s.weights, strict=True)
        }
        if self._gait_names:
            values["gait"] = (
                1
                if s.steps_when_pushed
                else 0
                if s.gait is None
                else 2 + self._gait_names.index(s.gait)
            )
            names = ("forwards [m/s]", "to the left [m/s]", "turn [rad/s]")
            values |= dict(zip(names, s.velocity, strict=True))
        for term in EQUATION:
            values |= (
                {term.assumed_switch: term.name not in s.assumed_off} if term.assumed_switch else {}
            )
            values |= (
                {term.actual_switch: term.name not in s.actual_off} if term.actual_switch else {}
            )
        for name, value in values.items():
            view.set_control_value(name, value)
