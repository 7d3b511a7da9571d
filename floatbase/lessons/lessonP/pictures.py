"""Lesson P, Playground: outcomes for what is believed and what is true, and how far a push moves a robot with slow motors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from floatbase.simulation import Rollout
from floatbase.viewer import GREYS, hexadecimal

_FALLEN = 1e3  # mm that stand for a fall, above all others


def plot_outcomes(records: Mapping[tuple[float, float], Rollout], name: str) -> Axes:
    """A table of squares: dark where a robot fell, with the time in s, light where it stood.

    records: (believed, true) -> record. name: of what is believed.
    """
    believed, true = (sorted({pair[i] for pair in records}) for i in (0, 1))
    _, axis = plt.subplots(figsize=(4.6, 3.6), layout="constrained")
    fell = np.array([[records[b, t].outcome != "completed" for t in true] for b in believed])
    axis.imshow(fell, cmap="Greys", vmin=0.0, vmax=2.0, origin="lower")
    for i, b in enumerate(believed):
        for j, t in enumerate(true):
            words = f"down at {records[b, t].time[-1]:.1f} s" if fell[i, j] else "stands"
            axis.text(j, i, words, ha="center", va="center", fontsize="x-small")
    axis.set_xticks(range(len(true)), [f"{x:g}" for x in true])
    axis.set_yticks(range(len(believed)), [f"{x:g}" for x in believed])
    axis.set(xlabel=f"{name}, true", ylabel=f"{name}, believed")
    return axis


def plot_gains(gains: Sequence[float], moved: Sequence[float], border: float) -> Axes:
    """How far a push moves a robot, mm, for gains, 1/s²; a cross at the top is a fall, a dashed line the border."""
    _, axis = plt.subplots(figsize=(6.0, 3.2), layout="constrained")
    x, y = np.asarray(gains, dtype=float), np.asarray(moved, dtype=float)
    stands = np.isfinite(y)
    axis.loglog(x[stands], y[stands], "o-", color=hexadecimal(GREYS[0]), label="stands")
    if not stands.all():
        axis.plot(x[~stands], np.full((~stands).sum(), _FALLEN), "x", color=hexadecimal(GREYS[0]), ms=9, label="falls")
    axis.axvline(border, color=hexadecimal(GREYS[1]), linestyle="--", label="4 ω²")
    axis.set(xlabel="kp [1/s²]", ylabel="farthest aside [mm]", ylim=(4.0, 2.0 * _FALLEN))
    axis.grid(alpha=0.25)
    axis.legend(fontsize="small")
    return axis
