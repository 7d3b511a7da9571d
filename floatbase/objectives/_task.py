"""Tasks: what a controller should bring about, each a weighted affine residual, actual - desired,
in q̈, τ or λ.

A motion task asks for the acceleration a = a_ff - kp e - kd ė, where e and ė are the errors of
position and velocity. Its residual is J q̈ + J̇ q̇ - a, its cost (weight / 2) ‖residual‖², a term
of ψ in (26).

A target is a value, or a function of the time t in s that gives one. That of a motion task gives
the position alone, and the target's velocity and acceleration count as zero, or all three together:
`lambda t: (position, velocity, acceleration)`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any, ClassVar, Protocol, TypeAlias, runtime_checkable

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_callable,
    as_instance,
    as_number,
    as_positive,
    as_string,
    frozen,
    numeric_copy,
)
from floatbase.affine import Affine
from floatbase.dynamics import Block, EquationsOfMotion
from floatbase.errors import InputError
from floatbase.robots import Robot

Target: TypeAlias = npt.ArrayLike | Callable[[float], npt.ArrayLike | tuple[npt.ArrayLike, ...]]

Shape: TypeAlias = tuple[int | str, ...]
Shapes: TypeAlias = Mapping[str, Shape]


@runtime_checkable
class Task(Protocol):
    """A weighted residual on one block of x = (q̈, τ, λ).

    name: in messages and tables. weight: of ½‖residual‖² in the objective.

    A user-defined object of this form is a task on both backends. This one controls the height of
    the centre of mass; its desired acceleration is 100 (h - z) - 20 ż, m/s².

        class Height:
            name, weight, block = "height", 10.0, "qdd"

            def __init__(self, height):
                self.height = height

            def residual(self, eom, t=0.0):
                s = eom.state
                desired = 100.0 * (self.height - s.com[2:]) - 20.0 * s.com_velocity[2:]
                return fb.Affine(s.com_jacobian[2:], s.com_drift[2:] - desired)
    """

    block: ClassVar[Block]

    @property
    def name(self) -> str: ...
    @property
    def weight(self) -> float: ...
    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """The residual as an `Affine` of the task's block at time t."""


class TargetTask(Value):
    """Base of the tasks of this package: dataclasses that declare their targets.

    A new one needs this class, its fields, `block`, `target_shapes` and `residual`.

    target_shapes: shape of each target by the name of its field, in numbers or "nq", "d" and "k";
        the first may be a function of time, the others are its derivatives.
    compiled_as: the form of the compiled tick that computes this task, as in
        `control.tick.problem_arrays`; without one its `residual` is called there. A derived class
        does not inherit it, since its residual may be another.
    """

    target_shapes: ClassVar[Shapes]
    compiled_as: ClassVar[str] = ""
    block: ClassVar[Block]
    weight: float

    @property
    def name(self) -> str:
        """In messages and tables; a field or a property of each task."""
        raise NotImplementedError

    def __post_init__(self) -> None:
        """Check gains and weight, and copy the targets that do not move; kd is critically damped,
        2 √kp, by default.
        """
        as_string("name of a task", self.name)
        as_string("frame of a task", getattr(self, "frame", ""))
        fields: dict[str, object] = {
            "weight": as_positive(f"weight of {self.name}", self.weight, allow_zero=True)
        }
        kp, kd = getattr(self, "kp", None), getattr(self, "kd", ...)
        if hasattr(self, "kp"):
            kp = fields["kp"] = as_positive(f"kp of {self.name}", kp, "1/s²", allow_zero=True)
        if kd is not ...:
            kd = 2.0 * kp**0.5 if kd is None and kp is not None else kd
            fields["kd"] = as_positive(f"kd of {self.name}", kd, "1/s", allow_zero=True)
        first, *_ = self.target_shapes
        time_varying = self.is_time_varying
        for name, shape in self.target_shapes.items():
            target, label = getattr(self, name), f"{name} of {self.name}"
            if name == first and time_varying:
                as_callable(label, target, f"{name}(t)")
            elif name != first and callable(target):
                raise InputError(
                    f"{label} cannot be a function: let {first} be one, and give {self._all_hint}."
                )
            elif (
                target is not None or getattr(type(self), name, ...) is not None
            ):  # None counts where it is the default
                array = self._as_target(label, target, shape)
                fields[name] = array if name != first else self._checked(array, None)
                if time_varying and np.any(array):
                    raise InputError(
                        f"{label} must be left out, for {first} is a function: let it give "
                        f"{self._all_hint}."
                    )
        for name, value in fields.items():
            object.__setattr__(self, name, value)

    @property
    def is_time_varying(self) -> bool:
        """Whether the target is a function of time."""
        target = getattr(self, next(iter(self.target_shapes)))
        return callable(target) and not isinstance(target, type)

    @property
    def _all_hint(self) -> str:
        return f"all together, as in lambda t: ({', '.join(self.target_shapes)})"

    def shapes_for(self, robot: Robot, k: int) -> dict[str, tuple[int, ...]]:
        """Shape of each target by the name of its field, for a robot with k contact forces."""
        sizes = {"nq": robot.nq, "d": robot.d, "k": k}
        return {
            name: tuple(sizes[n] if isinstance(n, str) else n for n in shape)
            for name, shape in self.target_shapes.items()
        }

    def targets_at(self, robot: Robot, k: int, t: float) -> list[Array]:
        """The targets at time t in s, in the order of `target_shapes`, with k contact forces.

        Raises `InputError` for a function's value that has another shape, or is no rotation or
        configuration.
        """
        shapes = self.shapes_for(robot, k)
        values = [getattr(self, name) for name in shapes]
        if self.is_time_varying:
            values = self._split(values[0](t), *shapes.values())
        else:
            values = [
                _zeros(shape) if value is None else value
                for value, shape in zip(values, shapes.values(), strict=True)
            ]
        targets = [
            value
            if type(value) is np.ndarray and value.shape == shape and not value.flags.writeable
            else as_array(f"{name} of {self.name}", value, shape)
            for (name, shape), value in zip(shapes.items(), values, strict=True)
        ]
        return [self._checked(targets[0], robot), *targets[1:]]

    def _targets(self, eom: EquationsOfMotion, t: float) -> list[Array]:
        """The targets that a residual is asked for with."""
        as_instance("eom", eom, EquationsOfMotion)
        return self.targets_at(eom.robot, eom.k, as_number("t", t, "s"))

    def _as_target(self, label: str, target: Any, shape: Shape) -> Array:
        """A target that does not move, checked as far as it can be without a robot."""
        return as_array(label, target, tuple(None if isinstance(n, str) else n for n in shape))

    def _checked(self, target: Array, robot: Robot | None) -> Array:
        """The first target, after checking what its shape does not say; robot: None when the task
        is made.
        """
        return target

    def _split(
        self, value: Any, shape: tuple[int, ...], *derivative_shapes: tuple[int, ...]
    ) -> list[Any]:
        """What a function of time gave, with zeros for its derivatives unless it gave them all."""
        is_sequence = (
            derivative_shapes
            and (isinstance(value, Sequence) or (isinstance(value, np.ndarray) and value.ndim))
            and len(value) > 1
        )
        first = numeric_copy(value[0]) if is_sequence else None
        if first is None or first.ndim != len(shape):
            return [value, *map(_zeros, derivative_shapes)]
        if len(value) == 1 + len(derivative_shapes):
            return list(value)
        raise InputError(
            f"the function of {self.name} gave {len(value)} targets; it must give one, or "
            f"{self._all_hint}."
        )


@lru_cache(maxsize=64)
def _zeros(shape: tuple[int, ...]) -> Array:
    return frozen(np.zeros(shape))
