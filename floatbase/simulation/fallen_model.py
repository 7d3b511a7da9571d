"""A robot's two MuJoCo models: upright, where only feet touch the ground, and lying, where links
do, too.

The lying one is made at the first fall: a simulation without a fall costs nothing for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from floatbase.robots import Robot
from floatbase.simulation.build import HULL_PREFIX, Ground, build_model
from floatbase.simulation.hulls import link_hulls

_STATE_SPEC = int(mujoco.mjtState.mjSTATE_INTEGRATION)  # all that the next step depends on
_GEOM_FIELD_PREFIX = "geom_"  # so begin the names of a model's arrays with a row for each geom


@dataclass(frozen=True, eq=False)
class FallenModel:
    """The model in which links touch, its data, and how its geoms are numbered.

    from_upright: its number of each of the upright model's geoms, which are the ground's planes and
        the feet's balls.
    to_upright: the other way round, -1 for the hull of a link.
    shared_fields: names of the arrays that mean the same in both models: masses, gains, frictions.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    from_upright: npt.NDArray[np.int_]
    to_upright: npt.NDArray[np.int_]
    shared_fields: tuple[str, ...]

    def copy_from_upright(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Go on where the upright robot is, with all that was changed in its model by hand."""
        _copy_fields(self.shared_fields, model, slice(None), self.model, self.from_upright)
        _copy_state(data, self.model, self.data)

    def copy_to_upright(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """The other way: the upright robot goes on."""
        _copy_fields(self.shared_fields, self.model, self.from_upright, model, slice(None))
        _copy_state(self.data, model, data)


def build_fallen_model(robot: Robot, ground: Ground, timestep: float) -> FallenModel | None:
    """A robot's lying model; None for one without links that could touch, such as an arm that is
    bolted to the ground.
    """
    if not link_hulls(robot):
        return None
    upright_model, model = (
        build_model(robot, ground, timestep),
        build_model(robot, ground, timestep, link_collisions=True),
    )
    is_hull = np.array([model.geom(i).name.startswith(HULL_PREFIX) for i in range(model.ngeom)])
    from_upright = np.flatnonzero(~is_hull)
    to_upright = np.where(is_hull, -1, np.cumsum(~is_hull) - 1)
    fields = tuple(
        name
        for name in dir(upright_model)
        if _is_shared_field(name, upright_model, model, from_upright)
    )
    return FallenModel(model, mujoco.MjData(model), from_upright, to_upright, fields)


def _is_shared_field(
    name: str,
    upright_model: mujoco.MjModel,
    model: mujoco.MjModel,
    from_upright: npt.NDArray[np.int_],
) -> bool:
    """Whether an attribute is an array that has the same numbers in both models as they were built."""
    upright = getattr(upright_model, name)
    if name.startswith("_") or not isinstance(upright, np.ndarray) or not upright.size:
        return False
    fallen = getattr(model, name)
    return np.array_equal(
        upright, fallen[from_upright] if name.startswith(_GEOM_FIELD_PREFIX) else fallen
    )


def _copy_fields(
    fields: tuple[str, ...],
    source: mujoco.MjModel,
    source_geoms: Any,
    target: mujoco.MjModel,
    target_geoms: Any,
) -> None:
    """Copy fields and options; source_geoms and target_geoms: of the geoms that both models have."""
    for name in fields:
        a, b = getattr(source, name), getattr(target, name)
        if name.startswith(_GEOM_FIELD_PREFIX):
            b[target_geoms] = a[source_geoms]
        else:
            b[...] = a
    for name in (name for name in dir(source.opt) if not name.startswith("_")):
        value = getattr(source.opt, name)
        if isinstance(value, np.ndarray):
            getattr(target.opt, name)[...] = value
        else:
            setattr(target.opt, name, value)


def _copy_state(source: mujoco.MjData, model: mujoco.MjModel, target: mujoco.MjData) -> None:
    """Put the source's state into the target, whose model this is, with contacts and all that
    follows from the state.
    """
    state = np.empty(mujoco.mj_stateSize(model, _STATE_SPEC))
    mujoco.mj_getState(model, source, state, _STATE_SPEC)
    mujoco.mj_resetData(model, target)
    mujoco.mj_setState(model, target, state, _STATE_SPEC)
    mujoco.mj_forward(model, target)
