"""Records as tables of named columns."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array
from floatbase.dynamics import FrictionContact
from floatbase.errors import require

if TYPE_CHECKING:
    from pandas import DataFrame

    from floatbase.simulation.record import Rollout

_Block = tuple[list[str], npt.NDArray[Any]]  # names of columns, and their rows


def as_table(run: Rollout) -> DataFrame:
    """Return the table of a run; see `Rollout.table`."""
    pandas = require("pandas", "sweep")
    blocks = [_block(["time"], [""], "s", run.time[:, None])]
    blocks += [*_base_columns(run), *_joint_columns(run), *_contact_columns(run)]
    frames = [pandas.DataFrame(rows, columns=names) for names, rows in blocks]
    return pandas.concat(frames, axis="columns")


def _base_columns(run: Rollout) -> Iterator[_Block]:
    """Yield pose, velocity and planned acceleration of the base, and the centre of mass."""
    if run.robot.is_floating:
        qdd = _planned_qdd(run)
        yield _block(["base position"], "xyz", "m", run.q[:, :3])
        yield _block(["base quaternion"], "xyzw", "-", run.q[:, 3:7])
        yield _block(["base velocity"], "xyz", "m/s", run.v[:, :3])
        yield _block(["base angular velocity"], "xyz", "rad/s", run.v[:, 3:6])
        yield _block(["base planned acceleration"], "xyz", "m/s²", qdd[:, :3])
        yield _block(["base planned angular acceleration"], "xyz", "rad/s²", qdd[:, 3:6])
    yield _block(["CoM position"], "xyz", "m", run.com)


def _joint_columns(run: Rollout) -> Iterator[_Block]:
    """Yield positions, velocities, planned accelerations and torques of the joints."""
    first = run.robot.nv - run.robot.d
    joints = list(run.robot.model.joints)[2 if run.robot.is_floating else 1 :]
    slides = [joint.shortname().startswith("JointModelP") for joint in joints]  # prismatic
    positions = np.empty((len(run), run.robot.d))
    for column, joint in zip(positions.T, joints, strict=True):
        column[:] = run.q[:, joint.idx_q]
        if joint.nq == 2:  # cosine and sine of a joint without limits
            column[:] = np.arctan2(run.q[:, joint.idx_q + 1], column)
    for quantity, units, rows in (
        ("position", ("rad", "m"), positions),
        ("velocity", ("rad/s", "m/s"), run.v[:, first:]),
        ("planned acceleration", ("rad/s²", "m/s²"), _planned_qdd(run)[:, first:]),
        ("torque", ("N·m", "N"), run.tau),
        ("desired torque", ("N·m", "N"), run.tau_desired),
    ):
        names = zip(run.robot.joint_names, slides, strict=True)
        yield [f"{joint} {quantity} [{units[is_slide]}]" for joint, is_slide in names], rows


def _contact_columns(run: Rollout) -> Iterator[_Block]:
    """Yield stance, forces and positions of the contacts."""
    positions = iter(run.foot_positions.swapaxes(0, 1))
    for contact in run.contacts:
        in_stance = [contact.name in run.contacts_at(i).names for i in range(len(run))]
        yield [f"{contact.name} in stance"], np.array(in_stance, dtype=bool)[:, None]
        part = run.contacts.force_slice(contact.name)
        if not isinstance(contact, FrictionContact):
            multipliers = run.planned[:, part]
            yield _block([f"{contact.name} multiplier"], contact.row_names, "SI", multipliers)
            continue
        points = contact.point_names
        for kind, forces in (("measured", run.measured), ("planned", run.planned)):
            if len(points) > 1:
                resultant = run.contacts.force_of(forces, contact.name)
                yield _block([f"{contact.name} {kind} force"], "xyz", "N", resultant)
            yield _block([f"{point} {kind} force" for point in points], "xyz", "N", forces[:, part])
        for point in points:
            yield _block([f"{point} position"], "xyz", "m", next(positions))


def _planned_qdd(run: Rollout) -> Array:
    """Return the planned accelerations, NaN if there are none."""
    return np.full_like(run.v, np.nan) if run.planned_qdd is None else run.planned_qdd


def _block(subjects: list[str], parts: Iterable[str], unit: str, rows: Array) -> _Block:
    """Return a column for each part of each subject."""
    names = [f"{subject} {part}".strip() for subject in subjects for part in parts]
    return [f"{name} [{unit}]" for name in names], rows
