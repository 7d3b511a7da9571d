"""Animations: lists of pictures as one command, which the page can play, seek and slow down."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    as_array,
    as_bool,
    as_instance,
    as_integer,
    as_positive,
    as_string,
    short_repr,
)
from floatbase.errors import InputError
from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.shapes import Item, Picture, with_normal_paths
from floatbase.viewer.scene.threejs import packed_array

if TYPE_CHECKING:
    from floatbase.simulation import Rollout

REPETITIONS = 10_000  # meshcat's default, 1, plays once and returns to the start
_MAX_RATE = 1e4  # 1/s: more rows per second than any rollout has
# m, and dimensionless for colours and quaternions: smaller changes get no track, because single
# precision does not resolve them
MIN_CHANGE = 1e-7
SMOOTHING_TIME = 0.3  # s, standard deviation of the weights of the mean of a followed position
_LINEAR, _DISCRETE = 2301, 2300  # three.js: linear and discrete interpolation


@dataclass(frozen=True, eq=False)
class Animation:
    """A sequence of pictures in time."""

    first: Picture
    command: protocol.Update
    duration: float


@dataclass(frozen=True, eq=False)
class _ItemHistory:
    """One item in n pictures."""

    item: Item
    present: npt.NDArray[np.bool_]
    matrices: Array
    colours: Array | None


def animate(
    times: npt.ArrayLike,
    pictures: Sequence[Picture],
    root: str,
    speed: float = 1.0,
    paused: bool = False,
) -> Animation:
    """Make an animation of pictures."""
    if (
        not isinstance(pictures, Sequence)
        or not all(isinstance(picture, dict) for picture in pictures)
        or not pictures
    ):
        raise InputError(
            f"pictures must be a list of at least one picture (items by path), not "
            f"{short_repr(pictures)}."
        )
    t, root = as_array("times", times, (len(pictures),), "s"), as_string("root", root)
    t, speed, paused = t - t[0], as_positive("speed", speed), as_bool("paused", paused)
    histories = _item_histories(list(pictures))
    clips = []
    for path, history in histories.items():
        tracks = list(_tracks(history, t))
        if tracks:
            clip = {"fps": 1, "name": "default", "tracks": tracks}
            clips.append({"path": root + path, "clip": clip})
    options = {"play": True, "repetitions": REPETITIONS, "speed": speed, "paused": paused}
    command = protocol.page_command("set_animation", animations=clips, options=options)
    first = {path: history.item for path, history in histories.items()}
    return Animation(first, command, float(t[-1]))


def sampled_rows(times: npt.ArrayLike, rate: float) -> npt.NDArray[np.int64]:
    """Choose the rows of a rollout to draw: the first, the last, and `rate` per second between."""
    t = as_array("times", times, (None,), "s")
    rate = as_positive("rate", rate, "1/s", maximum=_MAX_RATE)
    if not t.size:
        raise InputError(
            "times is empty, so there is nothing to draw; it must have at least one entry."
        )
    ticks = np.append(np.arange(t[0], t[-1], 1.0 / rate), t[-1])
    return np.unique(np.clip(np.searchsorted(t, ticks - 1e-9), 0, len(t) - 1))


def smoothed(times: npt.ArrayLike, places: npt.ArrayLike) -> Array:
    """Remove motion that is shorter than a stride from positions; straight paths do not change."""
    t, x = as_array("times", times, (None,), "s"), as_array("places", places, (None, 3), "m")
    if len(x) != len(t):
        raise InputError(
            f"times has {len(t)} entries and places has {len(x)}; their lengths must be equal."
        )
    if len(t) < 3 or not t[-1] > t[0]:
        return x
    width = SMOOTHING_TIME * (len(t) - 1) / (t[-1] - t[0])  # in places
    reach = max(1, min(int(3.0 * width), len(t) - 1))
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    wide = np.pad(x, ((reach, reach), (0, 0)), mode="reflect", reflect_type="odd")
    return np.stack(
        [np.convolve(column, weights / weights.sum(), mode="valid") for column in wide.T], axis=1
    )


def as_rollout(rollout: Rollout) -> Rollout:
    """Return the rollout, after checking its type."""
    from floatbase.simulation import Rollout  # loads the physics, which pictures do not need

    return as_instance("rollout", rollout, Rollout)


def push_at(rollout: Rollout, row: int, linger: float = 0.0) -> tuple[str, Array] | None:
    """Find the push that acts at a row of a rollout; if there are several, the newest."""
    now = float(as_rollout(rollout).time[as_integer("row", row, -len(rollout), len(rollout) - 1)])
    linger = as_positive("linger", linger, "s", allow_zero=True)
    for push in sorted(rollout.pushes, key=lambda push: push.start, reverse=True):
        if push.acts_at(now) or 0.0 <= now - push.start < push.duration + linger - 1e-9:
            return push.frame, push.force
    return None


def swing_feet_at(rollout: Rollout, row: int) -> frozenset[str]:
    """Find the swing feet at a row of a rollout: contacts that the controller does not use."""
    return frozenset(rollout.contacts.names).difference(rollout.contacts_at(row).names)


def joint_limits_at(rollout: Rollout, row: int) -> dict[str, Any]:
    """Return the options that draw the joint limits of the controller at a row of a rollout."""
    limits, rows = as_rollout(rollout).joint_limits, rollout.planned_qdd
    if limits is None or rows is None:
        return {}
    planned = rows[as_integer("row", row, -len(rows), len(rows) - 1)]
    return {"joint_limits": limits, "qdd": planned} if np.isfinite(planned).all() else {}


def _item_histories(pictures: list[Picture]) -> dict[str, _ItemHistory]:
    """Return every item over time; a path whose shape changes becomes several items."""
    appearances: dict[str, dict[int, Item]] = {}
    for i, picture in enumerate(pictures):
        for path, item in with_normal_paths(picture).items():
            appearances.setdefault(path, {})[i] = item
    histories = {}
    for path, items in appearances.items():
        shapes = list(dict.fromkeys(item.shape for item in items.values()))
        for k, shape in enumerate(shapes):
            of_shape = {i: item for i, item in items.items() if item.shape is shape}
            histories[f"{path}~{k}" if k else path] = _item_history(of_shape, len(pictures))
    return histories


def _item_history(items: dict[int, Item], n: int) -> _ItemHistory:
    """Return one item in n pictures, from the pictures that show it."""
    rows = np.array(sorted(items))
    shown_rows = rows[np.clip(np.searchsorted(rows, np.arange(n), side="right") - 1, 0, None)]
    matrices = np.array([items[i].matrix for i in rows])[np.searchsorted(rows, shown_rows)]
    first = items[rows[0]]
    colours = None if first.colour is None else np.array([items[i].colour for i in shown_rows])
    return _ItemHistory(first, np.isin(np.arange(n), rows), matrices, colours)


def _tracks(history: _ItemHistory, t: Array) -> Iterator[dict[str, Any]]:
    """Yield a track for each property that changes."""
    # scale has its own track, because a scaled matrix has no quaternion
    scales = np.linalg.norm(history.matrices[:, :3, :3], axis=1)
    quaternions = _quaternions(history.matrices[:, :3, :3] / scales[:, None, :])
    yield from _track("position", "vector3", t, history.matrices[:, :3, 3])
    yield from _track("quaternion", "quaternion", t, quaternions)
    yield from _track("scale", "vector3", t, scales)
    if not history.present.all():
        shown = {"times": t.tolist(), "values": history.present.tolist()}
        yield {"name": ".visible", "type": "bool", **shown}
    if history.colours is not None:
        yield from _track("shape.material.color", "color", t, history.colours[:, :3], _DISCRETE)
        yield from _track("shape.material.opacity", "number", t, history.colours[:, 3:], _DISCRETE)


def _track(
    name: str, kind: str, t: Array, values: Array, interpolation: int = _LINEAR
) -> Iterator[dict[str, Any]]:
    """Yield the track of one property, if it changes."""
    if np.ptp(values, axis=0).max() < MIN_CHANGE:
        return
    yield {
        "name": name if "." in name else f".{name}",
        "type": kind,
        "times": packed_array("Float32Array", t),
        "values": packed_array("Float32Array", values),
        "interpolation": interpolation,
    }


def _quaternions(rotations: Array) -> Array:
    """Return rotations (n, 3, 3) as quaternions x y z w, shape (n, 4)."""
    from scipy.spatial.transform import Rotation

    quaternions = Rotation.from_matrix(rotations).as_quat()
    flips = np.sign(np.sum(quaternions[1:] * quaternions[:-1], axis=1))
    quaternions[1:] *= np.cumprod(np.where(flips < 0, -1.0, 1.0))[:, None]
    return np.asarray(quaternions)
