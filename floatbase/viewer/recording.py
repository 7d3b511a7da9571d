"""Animations: a list of pictures as one command, which the page plays, seeks and slows down."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import umsgpack

from floatbase._validation import Array, as_array, as_bool, as_instance, as_integer, as_positive, as_string, short_repr
from floatbase.dynamics import Contacts
from floatbase.errors import InputError
from floatbase.viewer import wire
from floatbase.viewer.shapes import Item, Picture, tidy

if TYPE_CHECKING:
    from floatbase.simulation import Rollout

REPETITIONS = 10_000  # meshcat's default is 1: it plays once and returns to the start
_MOST_PICTURES = 1e4  # a second: more than any record has rows
STILL = 1e-7  # m, and 1 for colours and quaternions: what changes less gets no track; single precision would not show it
SMOOTH = 0.3  # s, standard deviation of the weights over which a followed place is a mean
_SMOOTH, _STEP = 2301, 2300  # three.js: linear and discrete interpolation


@dataclass(frozen=True, eq=False)
class Animation:
    """Pictures in time.

    first: every item that ever appears, as it first appears. command: the command that moves them. duration: s.
    """

    first: Picture
    command: wire.Update
    duration: float


@dataclass(frozen=True, eq=False)
class _Course:
    """One item in n pictures.

    item: as it first appears. present: (n,), whether the picture shows it. matrices: (n, 4, 4). colours: (n, 4), or None.
    Where it is not present, matrices and colours are those of the last picture before that shows it, else of the first.
    """

    item: Item
    present: npt.NDArray[np.bool_]
    matrices: Array
    colours: Array | None


def animate(
    times: npt.ArrayLike, pictures: Sequence[Picture], root: str, speed: float = 1.0, paused: bool = False
) -> Animation:
    """The animation of some pictures.

    times: (n,), s; picture i is shown from times[i] on.
    pictures: n pictures, path -> item each.
    root: the path below which all items lie.
    speed: 1 for real time.
    paused: whether the reader must press play first.
    """
    if not isinstance(pictures, Sequence) or not all(isinstance(picture, dict) for picture in pictures) or not pictures:
        raise InputError(f"pictures must be a list of one picture or more, path -> item each, not {short_repr(pictures)}.")
    t, root = as_array("times", times, (len(pictures),), "s"), as_string("root", root)
    t, speed, paused = t - t[0], as_positive("speed", speed), as_bool("paused", paused)
    courses = _courses(list(pictures))
    clips = []
    for path, course in courses.items():
        tracks = list(_tracks(course, t))
        if tracks:
            clips.append({"path": root + path, "clip": {"fps": 1, "name": "default", "tracks": tracks}})
    options = {"play": True, "repetitions": REPETITIONS, "speed": speed, "paused": paused}
    command = wire.encode({"type": "set_animation", "path": "", "animations": clips, "options": options})
    return Animation({path: course.item for path, course in courses.items()}, command, float(t[-1]))


def thinned(times: npt.ArrayLike, rate: float) -> npt.NDArray[np.int64]:
    """The rows of a record to draw: the first, the last, and `rate` rows a second between. times: (n,), s, of all rows."""
    t, rate = as_array("times", times, (None,), "s"), as_positive("rate", rate, "1/s", maximum=_MOST_PICTURES)
    if not t.size:
        raise InputError("times holds no time, so there is nothing to draw.")
    ticks = np.append(np.arange(t[0], t[-1], 1.0 / rate), t[-1])
    return np.unique(np.clip(np.searchsorted(t, ticks - 1e-9), 0, len(t) - 1))


def smoothed(times: npt.ArrayLike, places: npt.ArrayLike) -> Array:
    """Places without what lasts less than a stride: weighted means over about a second around each time; straight ways stay.

    times: (n,), s, evenly spaced. places: (n, 3), m, world.
    """
    t, x = as_array("times", times, (None,), "s"), as_array("places", places, (None, 3), "m")
    if len(x) != len(t):
        raise InputError(f"there are {len(t)} times and {len(x)} places; each place needs one time.")
    if len(t) < 3 or not t[-1] > t[0]:
        return x
    width = SMOOTH * (len(t) - 1) / (t[-1] - t[0])  # in places
    reach = max(1, min(int(3.0 * width), len(t) - 1))
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    wide = np.pad(x, ((reach, reach), (0, 0)), mode="reflect", reflect_type="odd")
    return np.stack([np.convolve(column, weights / weights.sum(), mode="valid") for column in wide.T], axis=1)


def checked_rollout(rollout: Rollout) -> Rollout:
    """The record, after checking that it is one."""
    from floatbase.simulation import Rollout  # loads the physics, which pictures do without

    return as_instance("rollout", rollout, Rollout)


def push_at(rollout: Rollout, row: int, seen: float = 0.0) -> tuple[str, Array] | None:
    """Frame and force (N, world) of the push that acts at a row of a record; None without one. Of several, the newest.

    seen: s that a push is still shown after its end.
    """
    now = float(checked_rollout(rollout).time[as_integer("row", row, -len(rollout), len(rollout) - 1)])
    seen = as_positive("seen", seen, "s", allow_zero=True)
    for push in sorted(rollout.pushes, key=lambda push: push.start, reverse=True):
        if push.acts_at(now) or 0.0 <= now - push.start < push.duration + seen - 1e-9:
            return push.frame, push.force
    return None


def drawn_contacts(contacts: Contacts) -> tuple[Contacts, npt.NDArray[np.bool_]]:
    """Those whose forces act at points, and which columns of λ, (k,), are theirs; the others cannot be drawn."""
    as_instance("contacts", contacts, Contacts)
    drawn = np.array([contact.k == 3 * len(contact.point_names) for contact in contacts], dtype=bool)
    names = [contact.name for contact, there in zip(contacts, drawn, strict=True) if there]
    return contacts.only(*names), np.repeat(drawn, np.array([contact.k for contact in contacts], dtype=int))


def lifted_at(rollout: Rollout, row: int) -> frozenset[str]:
    """Names of the feet that swing at a row of a record: its contacts that the controller does not have then."""
    return frozenset(rollout.contacts.names).difference(rollout.contacts_at(row).names)


def _courses(pictures: list[Picture]) -> dict[str, _Course]:
    """Every item in time. A path that shows several shapes in turn becomes several items."""
    seen: dict[str, dict[int, Item]] = {}
    for i, picture in enumerate(pictures):
        for path, item in tidy(picture).items():
            seen.setdefault(path, {})[i] = item
    courses = {}
    for path, items in seen.items():
        shapes = list(dict.fromkeys(item.shape for item in items.values()))
        for k, shape in enumerate(shapes):
            own = {i: item for i, item in items.items() if item.shape is shape}
            courses[f"{path}~{k}" if k else path] = _course(own, len(pictures))
    return courses


def _course(items: dict[int, Item], n: int) -> _Course:
    rows = np.array(sorted(items))
    held = rows[np.clip(np.searchsorted(rows, np.arange(n), side="right") - 1, 0, None)]
    matrices = np.array([items[i].matrix for i in rows])[np.searchsorted(rows, held)]
    first = items[rows[0]]
    colours = None if first.colour is None else np.array([items[i].colour for i in held])
    return _Course(first, np.isin(np.arange(n), rows), matrices, colours)


def _tracks(course: _Course, t: Array) -> Iterator[dict[str, Any]]:
    """A track for each property that changes."""
    # scale has its own track, because a scaled matrix has no quaternion
    scales = np.linalg.norm(course.matrices[:, :3, :3], axis=1)
    quaternions = _quaternions(course.matrices[:, :3, :3] / scales[:, None, :])
    yield from _track("position", "vector3", t, course.matrices[:, :3, 3])
    yield from _track("quaternion", "quaternion", t, quaternions)
    yield from _track("scale", "vector3", t, scales)
    if not course.present.all():
        yield {"name": ".visible", "type": "bool", "times": t.tolist(), "values": course.present.tolist()}
    if course.colours is not None:
        yield from _track("shape.material.color", "color", t, course.colours[:, :3], _STEP)
        yield from _track("shape.material.opacity", "number", t, course.colours[:, 3:], _STEP)


def _track(name: str, kind: str, t: Array, values: Array, interpolation: int = _SMOOTH) -> Iterator[dict[str, Any]]:
    if np.ptp(values, axis=0).max() < STILL:
        return
    yield {
        "name": name if "." in name else f".{name}",
        "type": kind,
        "times": _floats(t),
        "values": _floats(values),
        "interpolation": interpolation,
    }


def _floats(values: Array) -> umsgpack.Ext:
    return umsgpack.Ext(0x17, np.ascontiguousarray(values, dtype="<f4").tobytes())


def _quaternions(rotations: Array) -> Array:
    """Rotations (n, 3, 3) as quaternions x y z w, shape (n, 4); of q and -q the one that is nearer to the one before."""
    from scipy.spatial.transform import Rotation

    quaternions = Rotation.from_matrix(rotations).as_quat()
    flips = np.sign(np.sum(quaternions[1:] * quaternions[:-1], axis=1))
    quaternions[1:] *= np.cumprod(np.where(flips < 0, -1.0, 1.0))[:, None]
    return np.asarray(quaternions)
