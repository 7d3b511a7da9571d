"""A robot's two MuJoCo models: upright, where only feet touch the ground, and lying, where links do, too.

The lying one is made at the first fall: a simulation without a fall costs nothing for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from floatbase.robots import Robot
from floatbase.simulation.build import LINK, Ground, build_model
from floatbase.simulation.shapes import link_hulls

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)  # all that the next step depends on
_PER_GEOM = "geom_"  # so begin the names of a model's arrays with a row for each geom


@dataclass(frozen=True, eq=False)
class Lying:
    """The model in which links touch, its data, and how its geoms are numbered.

    geoms: its number of each of the upright model's geoms, which are the ground's planes and the feet's balls.
    upright: the other way round, -1 for the hull of a link.
    fields: names of the arrays that mean the same in both models: masses, gains, frictions.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    geoms: npt.NDArray[np.int_]
    upright: npt.NDArray[np.int_]
    fields: tuple[str, ...]

    def take_over(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Go on where the upright robot is, with all that was changed in its model by hand."""
        _copy(self.fields, model, slice(None), self.model, self.geoms)
        _move(data, self.model, self.data)

    def hand_over(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """The other way: the upright robot goes on."""
        _copy(self.fields, self.model, self.geoms, model, slice(None))
        _move(self.data, model, data)


def lying(robot: Robot, ground: Ground, timestep: float) -> Lying | None:
    """A robot's lying model; None for one without links that could touch, such as an arm that is bolted to the ground."""
    if not link_hulls(robot):
        return None
    plain, model = build_model(robot, ground, timestep), build_model(robot, ground, timestep, links=True)
    hulls = np.array([model.geom(i).name.startswith(LINK) for i in range(model.ngeom)])
    geoms = np.flatnonzero(~hulls)
    upright = np.where(hulls, -1, np.cumsum(~hulls) - 1)
    fields = tuple(name for name in dir(plain) if _agrees(name, plain, model, geoms))
    return Lying(model, mujoco.MjData(model), geoms, upright, fields)


def _agrees(name: str, plain: mujoco.MjModel, model: mujoco.MjModel, geoms: npt.NDArray[np.int_]) -> bool:
    """Whether an attribute is an array that has the same numbers in both models as they were built."""
    ours = getattr(plain, name)
    if name.startswith("_") or not isinstance(ours, np.ndarray) or not ours.size:
        return False
    theirs = getattr(model, name)
    return np.array_equal(ours, theirs[geoms] if name.startswith(_PER_GEOM) else theirs)


def _copy(fields: tuple[str, ...], source: mujoco.MjModel, rows: Any, target: mujoco.MjModel, places: Any) -> None:
    """Copy fields and options; rows and places: of the geoms that both models have."""
    for name in fields:
        a, b = getattr(source, name), getattr(target, name)
        if name.startswith(_PER_GEOM):
            b[places] = a[rows]
        else:
            b[...] = a
    for name in (name for name in dir(source.opt) if not name.startswith("_")):
        value = getattr(source.opt, name)
        if isinstance(value, np.ndarray):
            getattr(target.opt, name)[...] = value
        else:
            setattr(target.opt, name, value)


def _move(source: mujoco.MjData, model: mujoco.MjModel, target: mujoco.MjData) -> None:
    """Put the source's state into the target, whose model this is, with contacts and all that follows from the state."""
    state = np.empty(mujoco.mj_stateSize(model, _STATE))
    mujoco.mj_getState(model, source, state, _STATE)
    mujoco.mj_resetData(model, target)
    mujoco.mj_setState(model, target, state, _STATE)
    mujoco.mj_forward(model, target)
