"""Lesson 05, Steering the centre of mass: forces with the wrench that they make, a plan that
pulls.
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

import floatbase as fb
from floatbase._validation import as_forces
from floatbase.lessons.rounding import rounded
from floatbase.objectives import com_wrench_map
from floatbase.simulation import Rollout
from floatbase.viewer import View, Viewer, markers, plots, prefixed, shapes
from floatbase.viewer.scene.colours import GREYS, hex_code

LEAST_FORCE, LEAST_MOMENT = 5e-3, 5e-4  # N, N·m: less is shown as zero
PLOT_RANGE = (-40.0, 100.0)  # N: a plan that has lost its robot asks for thousands


def show_forces(
    view: Viewer,
    state: fb.State,
    contacts: fb.Contacts,
    forces: npt.ArrayLike,
    wish: npt.ArrayLike | None = None,
) -> str:
    """Draw forces at the feet and, above the robot, where it can be seen, their wrench (f_c, τ_c);
    returns it as HTML.

    What carries the weight is left out of the wrench. forces: shape (k,), N, world. wish: shape
    (3,), N, world, the force that was wished for beside the weight: a grey arrow.
    """
    forces = as_forces(forces, contacts.k)
    wrench = com_wrench_map(state, contacts)(forces) - [0, 0, state.robot.weight, 0, 0, 0]
    wrench = np.where(np.abs(wrench) > np.repeat([LEAST_FORCE, LEAST_MOMENT], 3), wrench, 0.0)
    size, scale = view.painter.size, view.scale
    above = np.array([state.com[0], state.com[1], view.painter.box[1][2] + 0.12 * size])
    drawn = prefixed(
        "wrench", markers.wrench(above, scale * wrench[:3], scale / size * wrench[3:], size)
    )
    if wish is not None and np.linalg.norm(wish) > LEAST_FORCE:
        view.add_legend_entry("wish", GREYS[1], "force wished for")
        higher = above + [0.0, 0.0, 0.1 * size]
        drawn["wish"] = shapes.arrow(higher, scale * np.asarray(wish, dtype=float), GREYS[1], size)
    view.show(state, contacts=contacts, planned=forces, extra=drawn)
    f_c, tau_c = np.split(wrench, [3])
    return (
        f"beside the weight: f<sub>c</sub> = <b>{rounded(f_c, 'N')}</b>, τ<sub>c</sub> = "
        f"<b>{rounded(tau_c, 'N·m')}</b>"
    )


def show_moved_com(view: Viewer, now: fb.State, before: fb.State, name: str) -> Viewer:
    """Draw a state and, as a ghost, another; a dark spot marks where on the ground its centre of
    mass was.

    name: what the legend calls the ghost.
    """
    x, y, _ = before.com
    spot = shapes.contact_patch([x, y, 0.0], [0.0, 0.0, 1.0], 0.035 * view.painter.size)
    stem = shapes.rod([x, y, 0.0], np.eye(3), before.com[2], 0.005 * view.painter.size, GREYS[0])
    view.show(
        now, ghost=before, ghost_name=name, extra={"earlier/spot": spot, "earlier/stem": stem}
    )
    return view.camera(View(20.0, 24.0, 0.75))


def plot_planned_pull(record: Rollout, until: float) -> Figure:
    """Normal forces that were planned and measured up to a time in s, N, with a line at zero.
    Beyond `PLOT_RANGE` they are cut.
    """
    figure, axis = plt.subplots(figsize=(8, 3.2), layout="constrained")
    plots.plot_forces(record, axis)
    axis.axhline(0.0, color=hex_code(GREYS[0]), linewidth=1.0)
    axis.set(xlim=(0.0, until), ylim=PLOT_RANGE)
    axis.legend(loc="lower left", fontsize="small")
    plt.close(figure)
    return figure
