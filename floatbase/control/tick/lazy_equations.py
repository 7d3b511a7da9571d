"""One moment of the compiled tick, as tasks, constraints and user-defined rows see it: only what
they ask for is computed.
"""

from __future__ import annotations

from typing import Any

from floatbase._validation import Array, frozen
from floatbase.control.tick.problem_arrays import Dynamics
from floatbase.dynamics import Contacts, EquationsOfMotion
from floatbase.robots import State


class TickState(State):
    """The state of a tick, which checks nothing, since the tick does.

    dynamics: of the robot.
    q, v: (nq,), (nv,), which nobody else may write to.
    """

    def __init__(self, dynamics: Dynamics, q: Array, v: Array):
        self.__dict__.update(robot=dynamics.robot, q=frozen(q.view()), v=frozen(v.view()))

    def __reduce__(self) -> tuple[Any, ...]:
        return State, (self.robot, self.q, self.v)


class TickEquations(EquationsOfMotion):
    """(7) in a tick: `equations_of_motion(state, contacts, t)`, of which M, h, J, A and b are made
    when they are asked for.
    """

    def __init__(self, state: TickState, contacts: Contacts, t: float):
        self.__dict__.update(state=state, contacts=contacts, S=state.robot.S, _t=t)

    def __getattr__(self, name: str) -> Any:
        if name in ("M", "h"):
            return getattr(self.state, name)
        if name == "J":
            self.__dict__["J"] = self.contacts.jacobian(self.state, self.__dict__["_t"])
        elif name in ("A", "b"):
            self.__dict__["A"], self.__dict__["b"] = self.contacts.constraint(
                self.state, self.__dict__["_t"]
            )
        else:
            raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")
        return self.__dict__[name]

    @property
    def nv(self) -> int:
        """Length of q̈."""
        return self.state.robot.nv

    @property
    def d(self) -> int:
        """Length of τ."""
        return self.state.robot.d

    @property
    def k(self) -> int:
        """Length of λ."""
        return self.contacts.k

    def __reduce__(self) -> tuple[Any, ...]:
        return EquationsOfMotion, (
            self.state,
            self.contacts,
            self.M,
            self.h,
            self.S,
            self.J,
            self.A,
            self.b,
        )
