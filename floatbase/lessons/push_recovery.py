"""Push-recovery maps at the end of the lessons from 05 on, each over the map of the lesson before.

`python -m floatbase.lessons.publish push-recovery 05` measures the map of lesson 05 again, which
takes a minute or two, and writes it to push_recovery.json beside this file, where the lessons read
it. The package of such a lesson has `make_controller()`, which returns its controller. The grey map
below is that of the lesson before. If that lesson used another robot, a lesson can have a separate
second map instead: "09 standing" is the map of `make_standing_controller()` in the package of
lesson 09.
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

from floatbase._files import write_whole
from floatbase._validation import as_string, short_repr
from floatbase.errors import InputError
from floatbase.simulation import PushRecovery, Simulation, push_recovery
from floatbase.viewer.plots import push_recovery_plots

_FILE = Path(__file__).with_name("push_recovery.json")
_DIRECTIONS = 8
_STEP, _DURATION = 5.0, 0.1  # N, s
# s after a push: a robot that cannot step has fallen by then; a lesson with steps sets a longer
# time, PUSH_RECOVERY_WATCH_TIME
_WATCH_TIME = 1.5


def measured_push_recovery(lesson: str) -> PushRecovery:
    """Return the stored push-recovery map of a lesson.

    Parameters
    ----------
    lesson : str
        Name of the lesson, such as "05", or of a second map, such as "09 standing".

    Returns
    -------
    PushRecovery
        The map as it was last measured.

    Raises
    ------
    InputError
        If there is no such map.
    """
    kept = _stored_pushes()
    if as_string("lesson", lesson) not in kept:
        raise InputError(
            f"Lesson {short_repr(lesson)} has no push-recovery map. The maps are {', '.join(kept)}."
        )
    controller = controller_factory(lesson)()
    angles = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    start = Simulation(controller.robot).state
    return PushRecovery(
        angles, np.array(kept[lesson]), _STEP, _DURATION, "base", start, controller.contacts
    )


def plot_push_recovery(lesson: str, axis: Axes | None = None) -> Axes:
    """Plot the push-recovery map of a lesson over the map of the lesson before, which is grey.

    Parameters
    ----------
    lesson : str
        Name of the lesson, such as "05".
    axis : Axes, optional
        Polar axes to plot on; by default a new figure.

    Returns
    -------
    Axes
        The polar axes.
    """
    return push_recovery_plots.plot(
        measured_push_recovery(lesson), axis, theory=False, previous=_former_push_recovery(lesson)
    )


def controller_factory(lesson: str) -> Callable[[], Any]:
    """Return the function that makes the controller of a push-recovery map.

    Parameters
    ----------
    lesson : str
        Name of the lesson, such as "05", or of a second map, such as "09 standing".

    Returns
    -------
    callable
        Function without arguments that returns the controller.

    Raises
    ------
    InputError
        If there is no such controller.
    """
    second = as_string("lesson", lesson).partition(" ")[2]
    try:
        make: Callable[[], Any] = getattr(
            _lesson_package(lesson), f"make_{second}_controller" if second else "make_controller"
        )
    except (ModuleNotFoundError, AttributeError) as error:
        raise InputError(
            f"Lesson {short_repr(lesson)} has no controller to push. Lessons 05 to 10 have one."
        ) from error
    return make


def measure_push_recovery(lesson: str) -> PushRecovery:
    """Measure the push-recovery map of a lesson and store it."""
    make = controller_factory(lesson)
    watch = getattr(_lesson_package(lesson), "PUSH_RECOVERY_WATCH_TIME", _WATCH_TIME)
    recovery = push_recovery(
        make, directions=_DIRECTIONS, resolution=_STEP, duration=_DURATION, observation_time=watch
    )
    kept = {**_stored_pushes(), lesson: recovery.pushes.tolist()}
    lines = [f"{json.dumps(name)}: {json.dumps(kept[name])}" for name in sorted(kept)]
    write_whole(_FILE, ("{\n" + ",\n".join(lines) + "\n}\n").encode())
    return recovery


def _lesson_package(lesson: str) -> ModuleType:
    """Return the package that makes the controllers of a lesson."""
    return import_module(f"floatbase.lessons.lesson{lesson.partition(' ')[0]}")


def _former_push_recovery(lesson: str) -> PushRecovery | None:
    """Return the second map of a lesson, or the map of the lesson before, if there is one."""
    if " " in lesson:
        return None
    kept = _stored_pushes()
    second = [name for name in kept if name.startswith(f"{lesson} ")]
    earlier = [name for name in kept if name < lesson and " " not in name]
    return measured_push_recovery(max(second or earlier)) if second or earlier else None


def _stored_pushes() -> dict[str, list[float]]:
    """Return the largest pushes of each lesson [N]."""
    kept: dict[str, list[float]] = json.loads(_FILE.read_text(encoding="utf-8"))
    return kept
