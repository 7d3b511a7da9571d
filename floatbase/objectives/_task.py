"""Tasks: the goals of a controller, as weighted affine residuals (actual - desired) in q̈, τ or λ.

A motion task requests the acceleration a = a_ff - kp e - kd ė, where e and ė are the errors of
position and velocity. Its residual is J q̈ + J̇ q̇ - a. Its cost (weight / 2) ‖residual‖² is a term
of ψ in eq. (26).

A target is a value or a function of the time t [s]. The function of a motion task returns
`(position, velocity, acceleration)`, or the position alone, which is differentiated numerically.
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
    cached_property,
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
# s, of finite differences: at 10 Hz, the error is 3 %, and rounding adds 1e-9 m/s². Targets that
# jump up to a thousand times a second count as targets at rest
_TIME_STEP = 5e-4
_AT_REST = 1e-12  # m or rad: a target that moves less in a time step is at rest, up to rounding


@runtime_checkable
class Task(Protocol):
    """A weighted residual on one block of x = (q̈, τ, λ).

    A user-defined object with the attributes `name`, `weight` and `block` and the method `residual`
    is a task for both backends. `block` is "qdd", "tau" or "forces".

    Examples
    --------
    This task controls the height of the centre of mass. Its desired acceleration is
    100 (h - z) - 20 ż [m/s²].

    >>> class Height:
    ...     name, weight, block = "height", 10.0, "qdd"
    ...
    ...     def __init__(self, height):
    ...         self.height = height
    ...
    ...     def residual(self, eom, t=0.0):
    ...         s = eom.state
    ...         desired = 100.0 * (self.height - s.com[2:]) - 20.0 * s.com_velocity[2:]
    ...         return fb.Affine(s.com_jacobian[2:], s.com_drift[2:] - desired)
    >>> isinstance(Height(0.3), Task)
    True
    """

    block: ClassVar[Block]

    @property
    def name(self) -> str:
        """Name in messages and tables."""

    @property
    def weight(self) -> float:
        """Weight of ½‖residual‖² in the objective, per squared unit of the residual."""

    def residual(self, eom: EquationsOfMotion, t: float = 0.0) -> Affine:
        """Compute the residual as an affine map of the task's block.

        Parameters
        ----------
        eom : EquationsOfMotion
            Equations of motion at the current state.
        t : float, optional
            Time [s].

        Returns
        -------
        Affine
            Map from the block (q̈, τ or λ) to the residual, actual - desired.
        """


class TargetTask(Value):
    """Base of the tasks of this package: dataclasses that declare their targets.

    A derived class defines its fields, `block`, `target_shapes` and `residual`. `target_shapes`
    maps the field of each target to its shape, whose entries are numbers, "nq", "d" or "k". The
    first target may be a function of time; the others are its derivatives. A derived class whose
    derivatives have another shape also defines `_displacement`. `compiled_as` names the form of
    this task in the compiled tick (see `control.tick.problem_arrays`). Without it, the compiled
    tick calls `residual`. Derived classes do not inherit `compiled_as`, since their residual may
    differ.
    """

    target_shapes: ClassVar[Shapes]
    compiled_as: ClassVar[str] = ""
    block: ClassVar[Block]
    weight: float

    @property
    def name(self) -> str:
        """Name in messages and tables, a field or a property of each task."""
        raise NotImplementedError

    def __post_init__(self) -> None:
        """Check gains and weight, and copy constant targets; the default of kd is 2 √kp."""
        for field in ("frame", "reference"):  # first, because the name may contain them
            as_string(f"{field} of a task", getattr(self, field, ""))
        as_string("name of a task", self.name)
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
                    f"{label} cannot be a function. Make {first} a function that returns "
                    f"{self._all_hint}."
                )
            elif target is not None or getattr(type(self), name, ...) is not None:
                # None is valid only as the default
                array = self._as_target(label, target, shape)
                fields[name] = array if name != first else self._checked(array, None)
                if time_varying and np.any(array):
                    raise InputError(
                        f"{label} must be left out, because {first} is a function. Let the "
                        f"function return {self._all_hint}."
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
        """Example of a function that returns the target with its derivatives."""
        return f"all of them, as in lambda t: ({', '.join(self.target_shapes)})"

    def shapes_for(self, robot: Robot, k: int) -> dict[str, tuple[int, ...]]:
        """Return the shape of each target by the name of its field."""
        sizes = {"nq": robot.nq, "d": robot.d, "k": k}
        return {
            name: tuple(sizes[n] if isinstance(n, str) else n for n in shape)
            for name, shape in self.target_shapes.items()
        }

    @cached_property
    def _constant_targets(self) -> dict[tuple[Robot, int], list[Array]]:
        """Targets that do not depend on time, by the robot and the length of λ."""
        return {}

    def targets_at(self, robot: Robot, k: int, t: float) -> list[Array]:
        """Return the targets at a time, in the order of `target_shapes`."""
        known = {} if self.is_time_varying else self._constant_targets
        if (robot, k) not in known:
            known[robot, k] = self._checked_targets(robot, k, t)
        return known[robot, k]

    def _checked_targets(self, robot: Robot, k: int, t: float) -> list[Array]:
        """Return the targets at a time after checking them."""
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
            for (name, shape), value in zip(shapes.items(), values, strict=False)
        ]
        targets[0] = self._checked(targets[0], robot)
        if len(targets) < len(shapes):
            targets += self._differentiate(robot, shapes, t, targets[0])
        return targets

    def _differentiate(
        self, robot: Robot, shapes: Mapping[str, tuple[int, ...]], t: float, target: Array
    ) -> list[Array]:
        """Return the derivatives of a target by finite differences of its function.

        The differences come from the side of t on which the function is smoother, so that jumps and
        kinks have no effect. A side on which the function is not defined is left out. A target that
        has the same value one step away is at rest. So is a target that does not depend on t alone.
        """
        (name, shape), *rates = shapes.items()

        def displacement(time: float) -> Array:
            value, *_ = self._split(getattr(self, name)(time), *shapes.values())
            end = self._checked(as_array(f"{name} of {self.name}", value, shape), robot)
            return self._displacement(target, end, robot)

        sides, failure = list[tuple[Array, Array]](), Exception()
        for step in (-_TIME_STEP, _TIME_STEP):
            try:
                with np.errstate(all="ignore"):  # of a function that is not defined on this side
                    near, far = displacement(t + step), displacement(t + 2.0 * step)
            except Exception as error:
                failure = error
                continue
            is_repeatable = np.abs(displacement(t)).max() <= _AT_REST
            if not is_repeatable or np.abs(near).max() <= _AT_REST:
                return [_zeros(shape) for _, shape in rates]
            sides.append(((4.0 * near - far) / (2.0 * step), (far - 2.0 * near) / step**2))
        if not sides:
            raise InputError(
                f"The target function of {self.name} cannot be differentiated at {t:g} s: it "
                f"raised {type(failure).__name__} nearby. Let it return {self._all_hint}."
            ) from failure
        smoothest = min(sides, key=lambda side: float(np.linalg.norm(side[1])))
        return list(smoothest[: len(rates)])

    def _displacement(self, start: Array, end: Array, robot: Robot) -> Array:
        """Return the displacement between two targets whose time derivative is the second one."""
        return end - start

    def _targets(self, eom: EquationsOfMotion, t: float) -> list[Array]:
        """Return the targets of a residual after checking its arguments."""
        as_instance("eom", eom, EquationsOfMotion)
        return self.targets_at(eom.robot, eom.k, as_number("t", t, "s"))

    def _as_target(self, label: str, target: Any, shape: Shape) -> Array:
        """Return a constant target, checked as far as possible without a robot."""
        return as_array(label, target, tuple(None if isinstance(n, str) else n for n in shape))

    def _checked(self, target: Array, robot: Robot | None) -> Array:
        """Return the first target after checking its values; `robot` is None at construction."""
        return target

    def _split(
        self, value: Any, shape: tuple[int, ...], *derivative_shapes: tuple[int, ...]
    ) -> list[Any]:
        """Return the result of a target function as a list: the target, or all targets."""
        is_sequence = (
            derivative_shapes
            and (isinstance(value, Sequence) or (isinstance(value, np.ndarray) and value.ndim))
            and len(value) > 1
        )
        first = numeric_copy(value[0]) if is_sequence else None
        if first is None or first.ndim != len(shape):
            return [value]
        if len(value) == 1 + len(derivative_shapes):
            return list(value)
        raise InputError(
            f"The target function of {self.name} returned {len(value)} values. It must return the "
            f"target alone, or {self._all_hint}."
        )


@lru_cache(maxsize=64)
def _zeros(shape: tuple[int, ...]) -> Array:
    """Return a read-only array of zeros."""
    return frozen(np.zeros(shape))
