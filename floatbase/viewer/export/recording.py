"""Animations: a list of pictures as one command, which the page plays, seeks and slows down."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import umsgpack

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
from floatbase.dynamics import Contacts, FrictionContact
from floatbase.errors import InputError
from floatbase.viewer.scene import protocol
from floatbase.viewer.scene.shapes import Item, Picture, with_normal_paths

if TYPE_CHECKING:
    from floatbase.simulation import Rollout

REPETITIONS = 10_000  # meshcat's default is 1: it plays once and returns to the start
_MAX_RATE = 1e4  # a second: more than any record has rows
# m, and 1 for colours and quaternions: what changes less gets no track; single precision would not
# show it
MIN_CHANGE = 1e-7
SMOOTHING_TIME = 0.3  # s, standard deviation of the weights over which a followed place is a mean
_LINEAR, _DISCRETE = 2301, 2300  # three.js: linear and discrete interpolation


@dataclass(frozen=True, eq=False)
class Animation:
    """Pictures in time.

    first: every item that ever appears, as it first appears. command: the command that moves them.
        duration: s.
    """

    first: Picture
    command: protocol.Update
    duration: float


@dataclass(frozen=True, eq=False)
class _ItemHistory:
    """One item in n pictures.

    item: as it first appears. present: (n,), whether the picture shows it. matrices: (n, 4, 4).
        colours: (n, 4), or None.
    Where it is not present, matrices and colours are those of the last picture before that shows
    it, else of the first.
    """

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
    """The animation of some pictures.

    times: (n,), s; picture i is shown from times[i] on.
    pictures: n pictures, path -> item each.
    root: the path below which all items lie.
    speed: 1 for real time.
    paused: whether the reader must press play first.
    """
    if (
        not isinstance(pictures, Sequence)
        or not all(isinstance(picture, dict) for picture in pictures)
        or not pictures
    ):
        raise InputError(
            f"pictures must be a list of one picture or more, path -> item each, not "
            f"{short_repr(pictures)}."
        )
    t, root = as_array("times", times, (len(pictures),), "s"), as_string("root", root)
    t, speed, paused = t - t[0], as_positive("speed", speed), as_bool("paused", paused)
    histories = _item_histories(list(pictures))
    clips = []
    for path, history in histories.items():
        tracks = list(_tracks(history, t))
        if tracks:
            clips.append(
                {"path": root + path, "clip": {"fps": 1, "name": "default", "tracks": tracks}}
            )
    options = {"play": True, "repetitions": REPETITIONS, "speed": speed, "paused": paused}
    command = protocol.encode(
        {"type": "set_animation", "path": "", "animations": clips, "options": options}
    )
    return Animation(
        {path: history.item for path, history in histories.items()}, command, float(t[-1])
    )


def sampled_rows(times: npt.ArrayLike, rate: float) -> npt.NDArray[np.int64]:
    """The rows of a record to draw: the first, the last, and `rate` rows a second between. times:
    (n,), s, of all rows.
    """
    t, rate = (
        as_array("times", times, (None,), "s"),
        as_positive("rate", rate, "1/s", maximum=_MAX_RATE),
    )
    if not t.size:
        raise InputError("times holds no time, so there is nothing to draw.")
    ticks = np.append(np.arange(t[0], t[-1], 1.0 / rate), t[-1])
    return np.unique(np.clip(np.searchsorted(t, ticks - 1e-9), 0, len(t) - 1))


def smoothed(times: npt.ArrayLike, places: npt.ArrayLike) -> Array:
    """Places without what lasts less than a stride: weighted means over about a second around each
    time; straight ways stay.

    times: (n,), s, evenly spaced. places: (n, 3), m, world.
    """
    t, x = as_array("times", times, (None,), "s"), as_array("places", places, (None, 3), "m")
    if len(x) != len(t):
        raise InputError(
            f"there are {len(t)} times and {len(x)} places; each place needs one time."
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
    """The record, after checking that it is one."""
    from floatbase.simulation import Rollout  # loads the physics, which pictures do without

    return as_instance("rollout", rollout, Rollout)


def push_at(rollout: Rollout, row: int, linger: float = 0.0) -> tuple[str, Array] | None:
    """Frame and force (N, world) of the push that acts at a row of a record; None without one. Of
    several, the newest.

    linger: s that a push is still shown after its end.
    """
    now = float(as_rollout(rollout).time[as_integer("row", row, -len(rollout), len(rollout) - 1)])
    linger = as_positive("linger", linger, "s", allow_zero=True)
    for push in sorted(rollout.pushes, key=lambda push: push.start, reverse=True):
        if push.acts_at(now) or 0.0 <= now - push.start < push.duration + linger - 1e-9:
            return push.frame, push.force
    return None


def point_force_contacts(contacts: Contacts) -> tuple[Contacts, npt.NDArray[np.bool_]]:
    """Those whose forces act at points, and which columns of λ, (k,), are theirs; the others cannot
    be drawn.
    """
    as_instance("contacts", contacts, Contacts)
    drawn = np.array([isinstance(c, FrictionContact) for c in contacts], dtype=bool)
    names = [contact.name for contact, there in zip(contacts, drawn, strict=True) if there]
    return contacts.only(*names), np.repeat(
        drawn, np.array([contact.k for contact in contacts], dtype=int)
    )


def swing_feet_at(rollout: Rollout, row: int) -> frozenset[str]:
    """Names of the feet that swing at a row of a record: its contacts that the controller does not
    have then.
    """
    return frozenset(rollout.contacts.names).difference(rollout.contacts_at(row).names)


def _item_histories(pictures: list[Picture]) -> dict[str, _ItemHistory]:
    """Every item in time. A path that shows several shapes in turn becomes several items."""
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
    rows = np.array(sorted(items))
    held = rows[np.clip(np.searchsorted(rows, np.arange(n), side="right") - 1, 0, None)]
    matrices = np.array([items[i].matrix for i in rows])[np.searchsorted(rows, held)]
    first = items[rows[0]]
    colours = None if first.colour is None else np.array([items[i].colour for i in held])
    return _ItemHistory(first, np.isin(np.arange(n), rows), matrices, colours)


def _tracks(history: _ItemHistory, t: Array) -> Iterator[dict[str, Any]]:
    """A track for each property that changes."""
    # scale has its own track, because a scaled matrix has no quaternion
    scales = np.linalg.norm(history.matrices[:, :3, :3], axis=1)
    quaternions = _quaternions(history.matrices[:, :3, :3] / scales[:, None, :])
    yield from _track("position", "vector3", t, history.matrices[:, :3, 3])
    yield from _track("quaternion", "quaternion", t, quaternions)
    yield from _track("scale", "vector3", t, scales)
    if not history.present.all():
        yield {
            "name": ".visible",
            "type": "bool",
            "times": t.tolist(),
            "values": history.present.tolist(),
        }
    if history.colours is not None:
        yield from _track("shape.material.color", "color", t, history.colours[:, :3], _DISCRETE)
        yield from _track("shape.material.opacity", "number", t, history.colours[:, 3:], _DISCRETE)


def _track(
    name: str, kind: str, t: Array, values: Array, interpolation: int = _LINEAR
) -> Iterator[dict[str, Any]]:
    if np.ptp(values, axis=0).max() < MIN_CHANGE:
        return
    yield {
        "name": name if "." in name else f".{name}",
        "type": kind,
        "times": _packed_floats(t),
        "values": _packed_floats(values),
        "interpolation": interpolation,
    }


def _packed_floats(values: Array) -> umsgpack.Ext:
    return umsgpack.Ext(0x17, np.ascontiguousarray(values, dtype="<f4").tobytes())


def _quaternions(rotations: Array) -> Array:
    """Rotations (n, 3, 3) as quaternions x y z w, shape (n, 4); of q and -q the one that is nearer
    to the one before.
    """
    from scipy.spatial.transform import Rotation

    quaternions = Rotation.from_matrix(rotations).as_quat()
    flips = np.sign(np.sum(quaternions[1:] * quaternions[:-1], axis=1))
    quaternions[1:] *= np.cumprod(np.where(flips < 0, -1.0, 1.0))[:, None]
    return np.asarray(quaternions)
