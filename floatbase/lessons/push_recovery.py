"""The push roses that end lessons from 05 on: measured by a command, kept with the course, drawn
over the former lesson's.

`python -m floatbase.lessons.publish push-recovery 05` measures that of lesson 05 anew, which takes
a minute or two, and writes it into push_recovery.json beside this file, where the lessons read it.
A lesson that has one offers `make_controller()`, which makes its controller. What lies in grey
below is the rose of the lesson before; or, where the robot is another one, a second rose of the
lesson's own: "09 standing" is that of `make_standing_controller()` in the package of lesson 09.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from floatbase._validation import as_string
from floatbase.errors import InputError
from floatbase.simulation import PushRecovery, Simulation, push_recovery
from floatbase.viewer import Picture
from floatbase.viewer.plots import push_recovery_plots

_FILE = Path(__file__).with_name("push_recovery.json")
_DIRECTIONS = 8
_STEP, _DURATION = 5.0, 0.1  # N, s
# s after a push, in which who stands on the spot has fallen; a lesson with steps says
# `PUSH_RECOVERY_WATCH_TIME`, more
_WATCH_TIME = 1.5


def measured_push_recovery(lesson: str) -> PushRecovery:
    """The rose of that lesson's controller, such as "05", or of a second one, "09 standing", as it
    was measured last.

    Raises `InputError` for a lesson without one.
    """
    kept = _stored_pushes()
    if as_string("lesson", lesson) not in kept:
        raise InputError(f"lesson {lesson!r} has no push rose; these have: {', '.join(kept)}.")
    controller = controller_factory(lesson)()
    angles = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    start = Simulation(controller.robot).state
    return PushRecovery(
        angles, np.array(kept[lesson]), _STEP, _DURATION, "base", start, controller.contacts
    )


def plot_push_recovery(lesson: str, axis: Axes | None = None) -> Axes:
    """The rose of that lesson, over the former lesson's in grey. axis: polar axes to plot on; None
    for a new figure.
    """
    return push_recovery_plots.plot(
        measured_push_recovery(lesson), axis, theory=False, previous=_former_push_recovery(lesson)
    )


def draw_push_recovery(lesson: str, scale: float | None = None) -> Picture:
    """What `plot_push_recovery` plots, on the ground below the robot: items for `extra` of
    `Viewer.show`.

    scale: length of a drawn push, m/N; None makes the widest rose half as wide again as the stance.
    """
    return push_recovery_plots.picture(
        measured_push_recovery(lesson), scale, theory=False, previous=_former_push_recovery(lesson)
    )


def controller_factory(lesson: str) -> Callable[[], Any]:
    """The function that makes the controller of that lesson's rose, such as "05" or "09 standing".

    Raises `InputError` where there is none.
    """
    second = as_string("lesson", lesson).partition(" ")[2]
    try:
        make: Callable[[], Any] = getattr(
            _lesson_package(lesson), f"make_{second}_controller" if second else "make_controller"
        )
    except (ModuleNotFoundError, AttributeError) as error:
        raise InputError(
            f"lesson {lesson!r} has no controller to push: lessons from 05 to 09 have."
        ) from error
    return make


def measure_push_recovery(lesson: str) -> PushRecovery:
    """Measure the rose of that lesson and keep it."""
    make, watch = (
        controller_factory(lesson),
        getattr(_lesson_package(lesson), "PUSH_RECOVERY_WATCH_TIME", _WATCH_TIME),
    )
    recovery = push_recovery(
        make, directions=_DIRECTIONS, resolution=_STEP, duration=_DURATION, observation_time=watch
    )
    kept = {**_stored_pushes(), lesson: recovery.pushes.tolist()}
    lines = [f"{json.dumps(name)}: {json.dumps(kept[name])}" for name in sorted(kept)]
    _FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    return recovery


def _lesson_package(lesson: str) -> ModuleType:
    """Where the controllers of that lesson, or of its second rose, are."""
    return import_module(f"floatbase.lessons.lesson{lesson.partition(' ')[0]}")


def _former_push_recovery(lesson: str) -> PushRecovery | None:
    """The lesson's own second rose, else the rose of the lesson before, if there is one."""
    if " " in lesson:
        return None
    kept = _stored_pushes()
    second = [name for name in kept if name.startswith(f"{lesson} ")]
    earlier = [name for name in kept if name < lesson and " " not in name]
    return measured_push_recovery(max(second or earlier)) if second or earlier else None


def _stored_pushes() -> dict[str, list[float]]:
    """For each lesson its largest pushes, N."""
    kept: dict[str, list[float]] = json.loads(_FILE.read_text(encoding="utf-8"))
    return kept
