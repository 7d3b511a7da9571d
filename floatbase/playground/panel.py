"""Controls of the playground's page."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from floatbase.playground.challenges import CHALLENGES
from floatbase.playground.equation import EQUATION
from floatbase.playground.settings import GAITS, IDEAL_BANDWIDTH, Settings
from floatbase.playground.term_arrows import TERM_LEGEND

if TYPE_CHECKING:
    from floatbase.playground.page import Playground

_MAX_PUSH = 2.5  # times the weight: such a push requires steps
_PAIRED = "model and reality"  # section of sliders with one column for each
_STANCE = "stance"
WALKING = "walking"
_QP = "quadratic program"


class _Slider(NamedTuple):
    """Slider for a number of `Settings`: an entry of a field, or the field itself."""

    name: str
    field: str
    entry: int | None
    low: float
    high: float
    step: float
    section: str
    column: str = ""
    exponent: bool = False  # whether the slider sets the power of ten

    def shown(self, settings: Settings) -> float:
        """Return the slider's value for these settings, limited to its range."""
        value = getattr(settings, self.field)
        value = value if self.entry is None else value[self.entry]
        value = math.log10(value) if self.exponent else value
        return min(max(value, self.low), self.high)


_PAIRED_SLIDERS = tuple(
    _Slider(f"{name} {column}", field, index, low, high, step, _PAIRED, column)
    for name, field, low, high, step in (
        ("friction", "friction", 0.05, 1.5, 0.05),
        ("slope [°]", "slope", -30.0, 30.0, 1.0),
        ("mass [×]", "mass", 0.5, 2.0, 0.05),
        ("motors [Hz]", "bandwidth", 1.0, IDEAL_BANDWIDTH, 1.0),
    )
    for index, column in enumerate(("model", "reality"))
)
_STANCE_SLIDERS = tuple(
    _Slider(f"CoM {axis} [m]", "com_shift", index, -0.08, 0.08, 0.005, _STANCE)
    for index, axis in enumerate("xyz")
)
_NOD_SLIDER = _Slider("nodding [rad]", "nod", None, 0.0, 0.35, 0.01, _STANCE)
_STEP_SLIDERS = (
    _Slider("forwards [m/s]", "velocity", 0, -0.3, 0.5, 0.05, WALKING),
    _Slider("to the left [m/s]", "velocity", 1, -0.2, 0.2, 0.05, WALKING),
    _Slider("turn left [rad/s]", "velocity", 2, -0.5, 0.5, 0.05, WALKING),
)
_QP_SLIDERS = (
    _Slider("facets", "facets", None, 3, 16, 1, _QP),
    _Slider("torque limits [×]", "torque_fraction", None, 0.05, 1.0, 0.05, _QP),
    _Slider("min. force [N]", "min_normal_force", None, 0.0, 100.0, 5.0, _QP),
    *(
        _Slider(f"{name} ×10^", "weights", index, -3.0, 3.0, 0.5, _QP, exponent=True)
        for index, name in enumerate(("motion", "posture", "effort"))
    ),
)
_SWITCH_WORDS = {"assumed_off": "model", "actual_off": "reality"}  # texts on the switches
_FREE_PLAY = "free play"


class Panel:
    """Controls of a playground, added to its page on construction."""

    def __init__(self, playground: Playground):
        self._playground = playground
        self._add()

    def _add(self) -> None:
        """Add all controls."""
        play, view = self._playground, self._playground.view
        view.add_button("run", play.run.start)
        view.add_button("pause", play.run.pause)
        view.add_button("reset", play.run.reset)
        view.add_button("push", play.push)
        if play.robot.is_floating:
            view.add_button("undo", play.undo)
        view.add_button("reset everything", play.reset_all)
        view.add_text("invitation", self._invitation)
        view.add_slider("speed", play.run.set_time_scale, 1.0, 0.05, 1.0, 0.05)
        most = _MAX_PUSH * play.robot.weight
        view.add_slider("push [N]", self._push, play.force, 0.0, most, 1.0, on_release=True)
        towards = partial(setattr, play, "towards")
        view.add_slider("towards [°]", towards, play.towards, -180.0, 180.0, 5.0)
        if not play.robot.is_floating:
            return
        settings = play.session.settings
        self._add_challenges()
        self._add_sliders(_PAIRED_SLIDERS)
        for foot in play.robot.feet:
            changed = partial(self._set_foot_contact, foot.frame)
            stands = foot.frame not in settings.lifted_feet
            view.add_checkbox(f"stand on {foot.frame}", changed, stands, _STANCE)
        self._add_sliders(_STANCE_SLIDERS)
        self._add_slider(_NOD_SLIDER, play.set_nodding)
        if self.has_gaits:
            choices = ["stand", "step when pushed", *self._gait_names]
            number = self._gait_number(settings)
            view.add_dropdown("gait", self._set_gait, choices, number, WALKING)
            self._add_sliders(_STEP_SLIDERS)
        self._add_sliders(_QP_SLIDERS)
        self._add_terms()

    def _add_sliders(self, sliders: Sequence[_Slider]) -> None:
        """Add several sliders that set numbers."""
        for slider in sliders:
            self._add_slider(slider, partial(self._set_number, slider))

    def _add_slider(self, slider: _Slider, changed: Callable[[float], None]) -> None:
        """Add one slider."""
        name, _, _, low, high, step, section, column, _ = slider
        value = slider.shown(self._playground.session.settings)
        at_most = "ideal" if slider.field == "bandwidth" else ""
        self._playground.view.add_slider(
            name, changed, value, low, high, step, section, column, at_most
        )

    def _add_challenges(self) -> None:
        """Add the menu of challenges, if the robot has any."""
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

    def _add_terms(self) -> None:
        """Add the switches and legend entries of the terms of eq. (7)."""
        view = self._playground.view
        for name, (colour, meaning) in TERM_LEGEND.items():
            view.add_legend_entry(f"term {name}", colour, meaning)
        for term in EQUATION:
            show = partial(self._playground.show_term, term.name)
            shown = self._playground.shown_terms[term.name]
            view.add_toggle(f"show {term.name}", show, shown, term.symbol, "shown")
            for field, switch in term.switches.items():
                changed = partial(self._set_term, field, term.name)
                on = term.name not in getattr(self._playground.session.settings, field)
                view.add_toggle(switch, changed, on, term.symbol, _SWITCH_WORDS[field])

    @property
    def _invitation(self) -> str:
        """First sentences of the panel, which say what to do."""
        first = (
            "Push the robot: move and release the slider “push”, or drag the robot with the Shift "
            "key held."
        )
        if not self._playground.robot.is_floating:
            return first
        return (
            f"{first} Then switch off a term of the equation above the picture, in the "
            f"controller's model or in reality. A dark switch is off."
        )

    def _push(self, force: float) -> None:
        """Push the robot with this force [N]; a force of zero is only stored."""
        self._playground.force = force
        if force:
            self._playground.push(force)

    @property
    def has_gaits(self) -> bool:
        """Whether the panel has controls for walking."""
        return self._playground.robot.is_floating and bool(self._gait_names)

    @property
    def _gait_names(self) -> list[str]:
        """Names of the gaits that the robot has."""
        return list(GAITS.get(len(self._playground.robot.feet), {}))

    def _gait_number(self, settings: Settings) -> int:
        """Return the number of the gait among the choices."""
        if settings.gait is not None:
            return 2 + self._gait_names.index(settings.gait)
        return int(settings.steps_when_pushed)

    def _set_number(self, slider: _Slider, value: float) -> None:
        """Set the number of a slider."""
        value = 10.0**value if slider.exponent else value
        if slider.entry is None:
            whole = slider.field == "facets"
            self._playground.set(**{slider.field: round(value) if whole else value})
            return
        values = list(getattr(self._playground.pending_settings, slider.field))
        values[slider.entry] = value
        self._playground.set(**{slider.field: tuple(values)})

    def _set_foot_contact(self, foot: str, stands: bool) -> None:
        """Put a foot on the ground, or lift it."""
        lifted = [name for name in self._playground.pending_settings.lifted_feet if name != foot]
        self._playground.set(lifted_feet=tuple(lifted if stands else [*lifted, foot]))

    def _set_gait(self, number: int) -> None:
        """Select a gait, standing, or stepping when pushed."""
        gait = ["", "", *self._gait_names][number] or None
        self._playground.set(
            gait=gait, steps_when_pushed=number == 1, start_time=self._playground.session.sim.time
        )

    def _set_term(self, attribute: str, term: str, on: bool) -> None:
        """Switch a term on or off."""
        settings, feet = self._playground.pending_settings, self._playground.robot.feet
        off = tuple(name for name in getattr(settings, attribute) if name != term)
        leg = feet[0].frame if feet else ""
        self._playground.set(**{attribute: off if on else (*off, term)}, leg=leg)

    def show_view_settings(self, speed: float) -> None:
        """Show the push, the speed and the displayed terms at their controls."""
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

    def show_settings(self, settings: Settings) -> None:
        """Show settings at the controls; only a robot with a floating base has these controls."""
        if not self._playground.robot.is_floating:
            return
        sliders = [*_PAIRED_SLIDERS, *_STANCE_SLIDERS, _NOD_SLIDER, *_QP_SLIDERS]
        values: dict[str, Any] = {}
        if self._gait_names:
            sliders += _STEP_SLIDERS
            values["gait"] = self._gait_number(settings)
        values |= {slider.name: slider.shown(settings) for slider in sliders}
        for foot in self._playground.robot.feet:
            values[f"stand on {foot.frame}"] = foot.frame not in settings.lifted_feet
        for term in EQUATION:
            for field, switch in term.switches.items():
                values[switch] = term.name not in getattr(settings, field)
        for name, value in values.items():
            self._playground.view.set_control_value(name, value)
