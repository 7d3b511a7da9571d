"""Controls of the playground's page."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from floatbase.live.settings import SETTINGS, Setting
from floatbase.playground.challenges import CHALLENGES
from floatbase.playground.equation import EQUATION
from floatbase.playground.limits import foot_name
from floatbase.playground.settings import GAITS, Settings, six_digits
from floatbase.playground.term_arrows import TERM_LEGEND
from floatbase.robots import Foot

if TYPE_CHECKING:
    from floatbase.playground.page import Playground


class _Slider(NamedTuple):
    """Slider for a number of `Settings`: an entry of a field, or the field itself."""

    setting: Setting
    field: str
    entry: int | None = None
    column: str = ""
    exponent: bool = False  # whether the slider sets the power of ten

    @property
    def name(self) -> str:
        """Name of the control."""
        return f"{self.setting.label} {self.column}".strip()

    def shown(self, settings: Settings) -> float:
        """Return the slider's value for these settings, limited to its range."""
        value = getattr(settings, self.field)
        value = value if self.entry is None else value[self.entry]
        value = math.log10(value) if self.exponent else six_digits(value / self.setting.scale)
        return min(max(value, self.setting.low), self.setting.high)

    def number(self, shown: float) -> float:
        """Return the number in `Settings` for a value of the slider."""
        return 10.0**shown if self.exponent else self.setting.scale * shown


_PAIRED_SLIDERS = tuple(
    _Slider(SETTINGS[name], name, index, column)
    for name in ("friction", "slope", "mass", "bandwidth")
    for index, column in enumerate(("model", "reality"))
)
_STANCE_SLIDERS = tuple(
    _Slider(SETTINGS[f"com_{axis}"], "com_shift", index) for index, axis in enumerate("xyz")
)
_NOD_SLIDER = _Slider(SETTINGS["nodding"], "nod")
_STEP_SLIDERS = tuple(
    _Slider(SETTINGS[key], "velocity", index)
    for index, key in enumerate(("velocity_x", "velocity_y", "yaw_rate"))
)
_QP_SLIDERS = (
    _Slider(SETTINGS["facets"], "facets"),
    _Slider(SETTINGS["torque_limits"], "torque_fraction"),
    _Slider(SETTINGS["normal_force"], "min_normal_force"),
    *(
        _Slider(SETTINGS[f"{name}_weight"], "weights", index, exponent=True)
        for index, name in enumerate(("motion", "posture", "effort"))
    ),
)
_SPEED, _LIFT, _GAIT, _CHALLENGE = (SETTINGS[key] for key in ("speed", "lift", "gait", "challenge"))
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
        for key, press in {
            "push_button": play.push,
            "run": play.run.start,
            "pause": play.run.pause,
            "reset": play.run.reset,
            "undo": play.undo,
            "reset_all": play.reset_all,
        }.items():
            if key != "undo" or play.robot.is_floating:
                view.add_button(SETTINGS[key].name, press)
        view.add_text("invitation", self._invitation)
        for name, row in play.push_settings.items():
            changed, value = partial(setattr, play, name), getattr(play, name)
            view.add_slider(row.label, changed, value, *row.range, on_release=name == "force")
        view.add_slider(_SPEED.label, play.run.set_time_scale, _SPEED.first, *_SPEED.range)
        if not play.robot.is_floating:
            return
        settings = play.session.settings
        self._add_challenges()
        self._add_sliders(_PAIRED_SLIDERS)
        for foot in play.robot.feet:
            changed = partial(self._lift, foot.frame)
            is_lifted = foot.frame in settings.lifted_feet
            view.add_checkbox(_lift_name(foot), changed, is_lifted, _LIFT.section)
        self._add_sliders(_STANCE_SLIDERS)
        self._add_slider(_NOD_SLIDER, play.set_nodding)
        if self.has_gaits:
            choices = ["stand", "step when pushed", *self._gait_names]
            number = self._gait_number(settings)
            view.add_dropdown(_GAIT.label, self._set_gait, choices, number, _GAIT.section)
            self._add_sliders(_STEP_SLIDERS)
        self._add_sliders(_QP_SLIDERS)
        self._add_terms()

    def _add_sliders(self, sliders: Sequence[_Slider]) -> None:
        """Add several sliders that set numbers."""
        for slider in sliders:
            self._add_slider(slider, partial(self._set_number, slider))

    def _add_slider(self, slider: _Slider, changed: Callable[[float], None]) -> None:
        """Add one slider."""
        setting, value = slider.setting, slider.shown(self._playground.session.settings)
        at_most = "ideal" if slider.field == "bandwidth" else ""
        place = setting.section, slider.column
        self._playground.view.add_slider(
            slider.name, changed, value, *setting.range, *place, at_most
        )

    def _add_challenges(self) -> None:
        """Add the menu of challenges, if the robot has any."""
        if self._has_challenges:
            titles = [_FREE_PLAY, *(challenge.title for challenge in CHALLENGES)]
            self._playground.view.add_dropdown(
                _CHALLENGE.label,
                lambda i: self._playground.start_challenge(CHALLENGES[i - 1] if i else None),
                titles,
            )

    @property
    def _has_challenges(self) -> bool:
        """Whether the panel has a menu of challenges."""
        return self._playground.robot.name in {challenge.robot for challenge in CHALLENGES}

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
            "Drag the robot to push it, or move and release the slider “push”. Dragging elsewhere "
            "turns the view."
        )
        if not self._playground.robot.is_floating:
            return first
        return (
            f"{first} Then switch off a term of the equation above the picture, in the "
            f"controller's model or in reality. A dark switch is off."
        )

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
        value = slider.number(value)
        if slider.entry is None:
            whole = slider.field == "facets"
            self._playground.set(**{slider.field: round(value) if whole else value})
            return
        values = list(getattr(self._playground.pending_settings, slider.field))
        values[slider.entry] = value
        self._playground.set(**{slider.field: tuple(values)})

    def _lift(self, foot: str, lift: bool) -> None:
        """Lift a foot, or put it on the ground."""
        lifted = [name for name in self._playground.pending_settings.lifted_feet if name != foot]
        self._playground.set(lifted_feet=tuple([*lifted, foot] if lift else lifted))

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
        """Show the push, the speed and the displayed terms in their controls."""
        play = self._playground
        values: dict[str, Any] = {
            _SPEED.label: speed,
            **{row.label: getattr(play, name) for name, row in play.push_settings.items()},
        }
        if play.robot.is_floating:
            values |= {f"show {term.name}": play.shown_terms[term.name] for term in EQUATION}
        for name, value in values.items():
            play.view.set_control_value(name, value)

    def show_settings(self, settings: Settings) -> None:
        """Show settings in the controls; only a robot with a floating base has these controls."""
        if not self._playground.robot.is_floating:
            return
        sliders = [*_PAIRED_SLIDERS, *_STANCE_SLIDERS, _NOD_SLIDER, *_QP_SLIDERS]
        values: dict[str, Any] = {}
        if self._gait_names:
            sliders += _STEP_SLIDERS
            values[_GAIT.label] = self._gait_number(settings)
        values |= {slider.name: slider.shown(settings) for slider in sliders}
        if self._has_challenges:
            started = [each is self._playground.challenge for each in CHALLENGES]
            values[_CHALLENGE.label] = 1 + started.index(True) if any(started) else 0
        for foot in self._playground.robot.feet:
            values[_lift_name(foot)] = foot.frame in settings.lifted_feet
        for term in EQUATION:
            for field, switch in term.switches.items():
                values[switch] = term.name not in getattr(settings, field)
        for name, value in values.items():
            self._playground.view.set_control_value(name, value)


def _lift_name(foot: Foot) -> str:
    """Return the name of the control that lifts a foot."""
    return f"{_LIFT.label} {foot_name(foot.frame)}"
