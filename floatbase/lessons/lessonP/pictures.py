"""Lesson P: outcomes for assumed and actual values, and how far a push moves a slow robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from floatbase.simulation import Rollout
from floatbase.viewer.scene.colours import GREYS, hex_code


def plot_outcomes(records: Mapping[tuple[float, float], Rollout], name: str) -> Axes:
    """Plot outcomes as a table: dark squares where a robot fell, with the time of the fall."""
    assumed, actual = (sorted({pair[i] for pair in records}) for i in (0, 1))
    _, axis = plt.subplots(figsize=(4.6, 3.6), layout="constrained")
    fell = np.array([[records[b, t].outcome != "completed" for t in actual] for b in assumed])
    axis.imshow(fell, cmap="Greys", vmin=0.0, vmax=2.0, origin="lower")
    for i, b in enumerate(assumed):
        for j, t in enumerate(actual):
            words = f"{records[b, t].time[-1]:.1f} s" if fell[i, j] else "stands"
            axis.text(j, i, words, ha="center", va="center", fontsize="small")
    axis.set_xticks(range(len(actual)), [f"{x:g}" for x in actual])
    axis.set_yticks(range(len(assumed)), [f"{x:g}" for x in assumed])
    axis.set(xlabel=f"{name}, actual", ylabel=f"{name}, assumed")
    return axis


def plot_gains(gains: Sequence[float], moved: Sequence[float], border: float) -> Axes:
    """Plot how far a push moves a robot for some gains; crosses at the top are falls."""
    _, axis = plt.subplots(figsize=(6.0, 3.2), layout="constrained")
    x, y = np.asarray(gains, dtype=float), np.asarray(moved, dtype=float)
    stands = np.isfinite(y)
    top = 1.3 * y[stands].max(initial=1.0)
    dark = hex_code(GREYS[0])
    axis.semilogx(x[stands], y[stands], "o-", label="stands", color=dark)
    if not stands.all():
        axis.plot(x[~stands], 0.0 * x[~stands] + top, "x", ms=9, label="falls", color=dark)
    axis.axvline(border, color=hex_code(GREYS[1]), linestyle="--", label="4 ω²")
    axis.set_xticks(x, [f"{gain:g}" for gain in x])
    axis.minorticks_off()
    axis.set(xlabel="kp [1/s²]", ylabel="largest displacement [mm]", ylim=(0.0, 1.1 * top))
    axis.grid(alpha=0.25)
    axis.legend(fontsize="small", loc="lower left")
    return axis
