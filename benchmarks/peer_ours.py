"""floatbase's side of the comparison: what its users write. Started by `peers.py`; the argument is
a backend.
"""

import sys

import peer_problems
from peer_wire import Contender, serve

from floatbase.errors import InfeasibleError


def build(description: dict) -> Contender:
    """The controller of a problem."""
    controller = peer_problems.problem(description["robot"], description["peer"]).controller(
        sys.argv[1]
    )

    def tick(q, v):
        try:
            return controller(q, v).tau
        except InfeasibleError:
            return None

    return tick


if __name__ == "__main__":
    serve(build)
