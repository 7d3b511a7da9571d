"""Plots with matplotlib, in the colours of the 3-D scene.

The plots show rollouts and, in `push_recovery_plots`, push-recovery maps.
"""

from floatbase.viewer.plots import push_recovery_plots, run_plots
from floatbase.viewer.plots.run_plots import (
    friction_used,
    plot_com,
    plot_forces,
    plot_friction,
    plot_run,
    plot_torques,
)

__all__ = [
    "friction_used",
    "plot_com",
    "plot_forces",
    "plot_friction",
    "plot_run",
    "plot_torques",
    "push_recovery_plots",
    "run_plots",
]
