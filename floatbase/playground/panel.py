"""The controls of the playground's page: what each of them sets, and where they stand for given settings."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any

from floatbase.playground.cards import CARDS
from floatbase.playground.equation import EQUATION
from floatbase.playground.settings import GAITS, IDEAL, Settings
from floatbase.playground.terms import MEANINGS

if TYPE_CHECKING:
    from floatbase.playground.page import Playground

_HARDEST = 2.5  # times the weight: a push that asks for steps
_PAIRS = {  # name: (attribute, low, high, step)
    "friction": ("friction", 0.05, 1.5, 0.05),
    "slope [°]": ("slope", -30.0, 30.0, 1.0),
    "mass [×]": ("mass", 0.5, 2.0, 0.05),
    "motors [Hz]": ("bandwidth", 1.0, IDEAL, 1.0),
}
_WEIGHTS = ("motion", "posture", "effort")
_FREE = "play freely"


class Panel:
    """The controls of a playground, added to its page when this is made."""

    def __init__(self, playground: Playground):
        self._play = playground
        self._add()

    def _add(self) -> None:
        view, weight, s = self._play.view, self._play.robot.weight, self._play.session.settings
        view.add_button("run", self._play.run.start)
        view.add_button("pause", self._play.run.pause)
        view.add_button("reset", self._play.run.reset)
        view.add_button("push", self._play.push)
        view.add_button("all as at first", self._play.undo)
        view.add_slider("speed", self._play.run.set_time_scale, 1.0, 0.05, 1.0, 0.05)
        view.add_slider("push [N]", partial(setattr, self._play, "force"), self._play.force, 0.0, _HARDEST * weight, 1.0)
        view.add_slider("towards [°]", partial(setattr, self._play, "towards"), self._play.towards, -180.0, 180.0, 5.0)
        if not self._play.robot.is_floating:
            return
        self._add_cards()
        for name, (attribute, low, high, step) in _PAIRS.items():
            for i, column in enumerate(("believed", "true")):
                value, changed = getattr(s, attribute)[i], partial(self._set_part, attribute, i)
                word = "perfect" if high == IDEAL else ""
                view.add_slider(f"{name} {column}", changed, value, low, high, step, "believed and true", column, word)
        self._add_stance()
        self._add_walk()
        where = "its quadratic program"
        view.add_slider("facets", lambda n: self._play.set(facets=round(n)), s.facets, 3, 16, 1, where)
        view.add_slider("torque limits [×]", lambda x: self._play.set(torque=x), s.torque, 0.05, 1.0, 0.05, where)
        view.add_slider("least force [N]", lambda x: self._play.set(least_force=x), s.least_force, 0.0, 100.0, 5.0, where)
        for i, name in enumerate(_WEIGHTS):
            changed = partial(self._set_weight, i)
            view.add_slider(f"{name} ×10^", changed, 0.0, -3.0, 3.0, 0.5, where)
        self._add_terms()

    def _add_cards(self) -> None:
        if self._play.robot.name in {card.robot for card in CARDS}:
            titles = [_FREE, *(f"{i + 1}. {card.title}" for i, card in enumerate(CARDS))]
            self._play.view.add_dropdown("challenge", lambda i: self._play.choose(CARDS[i - 1] if i else None), titles)

    def _add_stance(self) -> None:
        view = self._play.view
        for foot in self._play.robot.feet:
            view.add_checkbox(f"on {foot.frame}", partial(self._stand_on, foot.frame), True, "its stance")
        for i, axis in enumerate("xyz"):
            view.add_slider(f"CoM {axis} [m]", partial(self._set_part, "shift", i), 0.0, -0.08, 0.08, 0.005, "its stance")
        view.add_slider("nod and turn", self._play.nod, 0.0, 0.0, 0.35, 0.01, "its stance")

    def _add_walk(self) -> None:
        view, gaits = self._play.view, self._gaits
        if not gaits:
            return
        view.add_dropdown("gait", self._walk, ["stand", "step when pushed", *gaits], 0, "its steps")
        view.add_slider("forwards [m/s]", partial(self._set_part, "velocity", 0), 0.0, -0.3, 0.5, 0.05, "its steps")
        view.add_slider("to the left [m/s]", partial(self._set_part, "velocity", 1), 0.0, -0.2, 0.2, 0.05, "its steps")
        view.add_slider("turn [rad/s]", partial(self._set_part, "velocity", 2), 0.0, -0.5, 0.5, 0.05, "its steps")

    def _add_terms(self) -> None:
        view = self._play.view
        for name, (colour, meaning) in MEANINGS.items():
            view.add_legend_entry(f"term {name}", colour, meaning)
        for term in EQUATION:
            show = partial(self._play.show_term, term.name)
            view.add_toggle(f"show {term.name}", show, self._play.shown[term.name], term.symbol, "shown")
            if term.believed:
                view.add_toggle(term.believed, partial(self._switch, "believed_off", term.name), True, term.symbol, "believed")
            if term.true:
                view.add_toggle(term.true, partial(self._switch, "true_off", term.name), True, term.symbol, "world")

    @property
    def _gaits(self) -> list[str]:
        return list(GAITS.get(len(self._play.robot.feet), {}))

    def _set_part(self, attribute: str, i: int, value: float) -> None:
        values = list(getattr(self._play.wanted, attribute))
        values[i] = value
        self._play.set(**{attribute: tuple(values)})

    def _set_weight(self, i: int, exponent: float) -> None:
        self._set_part("weights", i, 10.0**exponent)

    def _stand_on(self, foot: str, stands: bool) -> None:
        lifted = [name for name in self._play.wanted.lifted if name != foot]
        self._play.set(lifted=tuple(lifted if stands else [*lifted, foot]))

    def _walk(self, number: int) -> None:
        gait = ["", "", *self._gaits][number] or None
        self._play.set(gait=gait, catches=number == 1, begin=self._play.session.sim.time)

    def _switch(self, attribute: str, term: str, on: bool) -> None:
        off = tuple(name for name in getattr(self._play.wanted, attribute) if name != term)
        self._play.set(**{attribute: off if on else (*off, term)}, leg=self._play.robot.feet[0].frame)

    def follow_looks(self, speed: float) -> None:
        """Show the push, the speed (simulated over real time) and the shown terms at their controls."""
        play = self._play
        values: dict[str, Any] = {"speed": speed, "push [N]": play.force, "towards [°]": play.towards}
        if play.robot.is_floating:
            values |= {f"show {term.name}": play.shown[term.name] for term in EQUATION}
        for name, value in values.items():
            play.view.set_control_value(name, value)

    def follow(self, s: Settings) -> None:
        """Show settings at the controls, which only a floating robot has."""
        if not self._play.robot.is_floating:
            return
        view = self._play.view
        values: dict[str, Any] = {"facets": s.facets, "nod and turn": s.nod, "torque limits [×]": s.torque}
        values["least force [N]"] = s.least_force
        for name, (attribute, *_) in _PAIRS.items():
            values |= dict(zip((f"{name} believed", f"{name} true"), getattr(s, attribute), strict=True))
        values |= {f"on {foot.frame}": foot.frame not in s.lifted for foot in self._play.robot.feet}
        values |= {f"CoM {axis} [m]": value for axis, value in zip("xyz", s.shift, strict=True)}
        values |= {f"{name} ×10^": math.log10(value) for name, value in zip(_WEIGHTS, s.weights, strict=True)}
        if self._gaits:
            values["gait"] = 1 if s.catches else 0 if s.gait is None else 2 + self._gaits.index(s.gait)
            names = ("forwards [m/s]", "to the left [m/s]", "turn [rad/s]")
            values |= dict(zip(names, s.velocity, strict=True))
        for term in EQUATION:
            values |= {term.believed: term.name not in s.believed_off} if term.believed else {}
            values |= {term.true: term.name not in s.true_off} if term.true else {}
        for name, value in values.items():
            view.set_control_value(name, value)
