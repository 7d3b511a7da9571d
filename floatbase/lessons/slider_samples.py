"""Slider panels on a static page: pictures computed in advance for some positions of the sliders.

If there are few combinations of positions, all of them are computed. Otherwise one slider at a time
moves, and the others stay in their initial position.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from floatbase.lessons.static_export import Control, StaticExport
from floatbase.simulation import Controller, Push, Rollout, Simulation, rollout

if TYPE_CHECKING:
    from floatbase.lessons.panels import SliderPanel
    from floatbase.viewer import Viewer

MAX_COMBINATIONS = 100  # largest number of combinations that are all computed
# approximate number of positions of a slider; of a slider that is slow to draw
_SAMPLES, _SAMPLES_OF_SLOW = 11, 9
_SAMPLES_OF_TWO = (9, 7, 6, 5)  # of each of two sliders: the first with few enough combinations
_ROUND_STEPS = (1.0, 2.0, 2.5, 5.0)  # times a power of ten: distance between two positions
# fraction of that distance: a round number that is closer to a bound than this is left out
_MIN_GAP = 0.22
# degrees
DIRECTIONS = {"forwards": 0.0, "to the left": 90.0, "backwards": 180.0, "to the right": 270.0}
# s: start of a recorded push, and how long the recording goes on from then
_PUSH_START, _TIME_SEEN = 0.1, 1.5
_FRAME_RATE = 15.0  # pictures per second of a recorded push
_SAMPLED_NOTE = (
    "Computed for these positions only. In the live lesson the sliders move continuously."
)
_ONE_AT_A_TIME_NOTE = (
    " Here one slider moves at a time: the others return to their initial position."
)
_OUTCOME_TEXTS = {
    "completed": "it stands",
    "fell": "it falls",
    "controller failed": "its controller finds no solution, and it falls",
}
RECORDED_NOTE = "Recorded. In the live lesson you can push at any time and in any direction."


def sample_values(
    low: float, first: float, high: float, step: float, count: int = _SAMPLES
) -> tuple[float, ...]:
    """Return rounded values from `low` to `high`: the bounds, `first`, and round values between.

    All values are multiples of `step` above `low`.
    """
    if not high > low:
        return (low,)
    between = min(
        _round_spacings(high - low, step), key=lambda gap: abs((high - low) / gap + 1 - count)
    )
    fixed = sorted({low, first, high})
    inner = between * np.arange(math.ceil(low / between), math.floor(high / between) + 1)
    far = [float(x) for x in inner if min(abs(x - bound) for bound in fixed) > _MIN_GAP * between]
    snapped = {low + step * round((x - low) / step) for x in far}
    digits = max(0, 2 - math.floor(math.log10(step)))
    return tuple(sorted({round(float(x), digits) for x in snapped} | set(map(float, fixed))))


def _round_spacings(width: float, step: float) -> list[float]:
    """Return round numbers between a step and the width, if possible multiples of the step."""
    power = math.floor(math.log10(width))
    gaps = [
        part * 10.0 ** (power - i)
        for i in range(4)
        for part in _ROUND_STEPS
        if step <= part * 10.0 ** (power - i) <= width
    ]
    whole = [gap for gap in gaps if abs(gap / step - round(gap / step)) < 1e-6]
    return whole or gaps or [step]


def panel_samples(panel: SliderPanel) -> dict[str, tuple[float, ...]]:
    """Return the positions of each slider, from the lesson or else round numbers."""
    counts = _SAMPLES_OF_TWO if len(panel.sliders) == 2 else (_SAMPLES,)
    sliders = panel.sliders.items()
    found = [
        {name: _slider_samples(slider, panel.samples.get(name), count) for name, slider in sliders}
        for count in counts
    ]
    return next(
        (samples for samples in found if math.prod(map(len, samples.values())) <= MAX_COMBINATIONS),
        found[0],
    )


def _slider_samples(slider: Any, given: Sequence[float] | None, count: int) -> tuple[float, ...]:
    count = count if slider.continuous_update else min(count, _SAMPLES_OF_SLOW)
    values = (
        sample_values(slider.min, slider.value, slider.max, slider.step, count)
        if given is None
        else given
    )
    return tuple(sorted({*map(float, values), float(slider.value)}))


def combinations(counts: Sequence[int], first: Sequence[int]) -> tuple[list[tuple[int, ...]], bool]:
    """Return the combinations of positions to compute, and whether these are all combinations.

    counts: number of positions of each slider. first: index of the initial position of each.
    """
    if math.prod(counts) <= MAX_COMBINATIONS:
        return list(product(*(range(count) for count in counts))), True
    alone = [
        (*first[:i], sample, *first[i + 1 :])
        for i, count in enumerate(counts)
        for sample in range(count)
    ]
    return list(dict.fromkeys(map(tuple, alone))), False


def precomputed_panel(panel: SliderPanel) -> dict[str, Any]:
    """Return the mimebundle of a slider panel for a static page, leaving the panel as it was."""
    values = panel_samples(panel)
    now = {name: float(slider.value) for name, slider in panel.sliders.items()}
    first = [samples.index(now[name]) for name, samples in values.items()]
    places, together = combinations([len(samples) for samples in values.values()], first)
    words = _SAMPLED_NOTE + ("" if together else _ONE_AT_A_TIME_NOTE)
    panel.draw_at(panel.values())
    pack = StaticExport([panel.view] if panel.view else [], beside=panel.beside, words=words)
    for place in places:
        note = panel.draw_at({name: values[name][i] for name, i in zip(values, place, strict=True)})
        pack.add_sample(place, note)
    panel.draw_at(panel.values())
    controls = [
        _site_control(name, panel.sliders[name], values[name], i)
        for name, i in zip(values, first, strict=True)
    ]
    return pack.bundle(controls, together)


def _site_control(name: str, slider: Any, values: Sequence[float], first: int) -> Control:
    """Return the control on a static page that replaces a slider of a panel."""
    shown = tuple(_format_value(x, slider.readout_format) for x in values)
    return Control(name.replace("_", " "), shown, first, unit=slider.unit)


def recorded_pushes(
    titles: Mapping[str, tuple[Viewer, Simulation, Controller]],
    forces: Iterable[float],
    directions: Sequence[str],
) -> dict[str, Any]:
    """Return the mimebundle of recorded pushes for a static page; without a push, the robots stand.

    titles: viewer, simulation and controller for each picture title. directions: keys of
    `DIRECTIONS`.
    """
    sizes, views = tuple(forces), [view for view, *_ in titles.values()]
    for view, sim, controller in titles.values():
        standing = _record_push(sim, controller, 0.0, 0.0)
        view.show(standing.final, standing.contacts, standing.measured[-1])
    pack = StaticExport(views, words=RECORDED_NOTE, titles=list(titles) if len(titles) > 1 else ())
    for k in range(len(directions)):
        pack.add_sample((0, k))
    for (i, force), (k, direction) in product(enumerate(sizes), enumerate(directions)):
        records = [
            _record_push(sim, controller, force, DIRECTIONS[direction])
            for _, sim, controller in titles.values()
        ]
        for view, record in zip(views, records, strict=True):
            view.play(record, rate=_FRAME_RATE)
        pack.add_sample((i + 1, k), ", ".join(_outcome_texts(titles, records)))
    return pack.bundle(
        [
            Control("push", ("0", *(f"{force:.0f}" for force in sizes)), 0, unit="N"),
            Control("towards", tuple(directions), 0, kind="choice"),
        ]
    )


def _record_push(sim: Simulation, controller: Controller, force: float, towards: float) -> Rollout:
    sim.reset()
    push = Push.horizontal(force, towards, _PUSH_START)
    record = rollout(sim, controller, _PUSH_START + _TIME_SEEN, [push], settling_time=0.5)
    sim.reset()
    return record


def _outcome_texts(titles: Iterable[str], records: Sequence[Rollout]) -> Iterator[str]:
    """Yield the outcome of each record in words."""
    for title, record in zip(titles, records, strict=True):
        fate = _OUTCOME_TEXTS.get(record.outcome, record.outcome)
        yield fate if len(records) == 1 else f"{title}: {fate}"


def _format_value(value: float, form: str) -> str:
    return format(value + 0.0, form).replace("-", "−")
