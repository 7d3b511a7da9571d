"""Lesson X: recordings and instants of black boxes, and commanded and required torques."""

from __future__ import annotations

from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from floatbase._validation import Array
from floatbase.lessons import svg
from floatbase.lessons.lessonX.black_box import BlackBox
from floatbase.lessons.lessonX.diagnostics import lagged
from floatbase.simulation import Rollout
from floatbase.viewer import Viewer
from floatbase.viewer.scene.colours import GREYS, hex_code

WIDTH, HEIGHT, EDGE = 620, 240, 40  # px: size of a drawing, and width of its margin
_MIN_TOLERANCE = 1.0  # N: smaller forces are shown as zero


def play_box(view: Viewer, box: BlackBox, speed: float = 0.25, title: str | None = None) -> Viewer:
    """Play a box with measured and planned forces, and with the controller's assumed cones."""
    places = np.array([box.contacts.positions(box.state(i)) for i in range(len(box))])
    record = Rollout(
        box.robot, box.contacts, box.time, box.q, box.v, np.full_like(box.tau, np.nan), box.tau,
        box.planned, box.measured,
        places, (), "fell" if box.fell else "completed",
    )  # fmt: skip
    return view.play(record, speed=speed, com=False, title=title)


def show_instant(view: Viewer, box: BlackBox, missed: Array, time: float) -> str:
    """Draw one row of a box."""
    i = int(np.clip(np.searchsorted(box.time, time), 0, len(missed) - 1))
    view.show(box.state(i), box.contacts, box.measured[i], box.planned[i], com=False)
    gaps = np.linalg.norm((box.measured[i] - box.planned[i]).reshape(-1, 3), axis=1)
    gap_text = ", ".join(
        f"{name[:2]} {gap:.0f}" for name, gap in zip(box.contacts.names, gaps, strict=True)
    )
    left = float(np.linalg.norm(missed[i, :3]))
    return (
        f"planned and measured forces differ by {gap_text} N; "
        f"{left if left >= _MIN_TOLERANCE else 0:.0f} N is missing from (7) on the base"
    )


def plot_residual_force(box: BlackBox, missed: npt.ArrayLike) -> Figure:
    """Plot the force on the base that is missing from (7), with the weight for comparison."""
    forces = np.linalg.norm(np.asarray(missed)[:, :3], axis=1)
    figure, ax = plt.subplots(figsize=(7, 2.8), layout="constrained")
    ax.axhline(box.robot.weight, color=hex_code(GREYS[1]), linestyle="--", label="weight")
    ax.plot(box.time[: len(forces)], forces, color=hex_code(GREYS[0]), label="missing on the base")
    ax.set(xlabel="time [s]", ylabel="force [N]", ylim=(0, None))
    ax.legend(loc="center left")
    ax.grid(alpha=0.3)
    plt.close(figure)
    return figure


def draw_torque_comparison(box: BlackBox, got: Array, joint: int, ms: float) -> str:
    """Draw the required torque of a joint and the command after a first-order lag."""
    times, period = box.time[: len(got)], float(box.time[1] - box.time[0])
    commanded = box.tau[: len(got)]
    orders = lagged(commanded, period, ms)
    both = np.concatenate([got[:, joint], commanded[:, joint], [0.0]])
    frame = _PlotFrame(float(times[0]), float(times[-1]), float(both.min()), float(both.max()))
    drawn = frame.ticks()
    drawn += frame.curve(times, got[:, joint], stroke=hex_code(GREYS[2]), stroke_width=6)
    drawn += frame.curve(times, orders[:, joint], stroke="currentColor", stroke_width="1.5")
    off = float(np.median(np.abs(orders - got)))
    words = (
        f"{box.robot.joint_names[joint]}, from {frame.low:.0f} to {frame.high:.0f} N·m",
        f"thick: required; thin: commanded, {ms:.0f} ms late; median difference of all joints: "
        f"{off:.2f} N·m",
    )
    # not in the drawing, which shrinks on a narrow page
    text = "".join(f"<div>{line}</div>" for line in words)
    return svg.drawing(drawn, WIDTH, f"0 0 {WIDTH} {HEIGHT + 32}") + text


@dataclass(frozen=True)
class _PlotFrame:
    """Positions of times [s] and torques [N·m] on a drawing."""

    begin: float
    end: float
    low: float
    high: float

    def across(self, times: npt.ArrayLike) -> Array:
        """Return the horizontal positions of times [px]."""
        return np.asarray(
            EDGE + (WIDTH - 2 * EDGE) * (np.asarray(times) - self.begin) / (self.end - self.begin)
        )

    def up(self, torques: npt.ArrayLike) -> Array:
        """Return the vertical positions of torques [px]."""
        return np.asarray(
            10 + (HEIGHT - 20) * (self.high - np.asarray(torques)) / (self.high - self.low)
        )

    def curve(self, times: Array, torques: Array, **style: str | float) -> str:
        """Draw torques over time."""
        return svg.polyline(np.column_stack([self.across(times), self.up(torques)]), **style)

    def ticks(self) -> str:
        """Draw lines at round torques, thicker at zero, and at the tenths of a second."""
        drawn = svg.text((EDGE - 6, HEIGHT + 27), "N·m", 11, "end")
        for torque in np.asarray(MaxNLocator(5).tick_values(self.low, self.high)).tolist():
            if self.low <= torque <= self.high:
                y, width = float(self.up(torque)), "0.2" if torque else "0.5"
                drawn += svg.line((EDGE, y), (WIDTH - EDGE, y), stroke_width=width)
                drawn += svg.text((EDGE - 6, y + 4), f"{torque:g}", 11, "end")
        for tenth in range(int(np.ceil(10 * self.begin)), int(10 * self.end) + 1):
            x = float(self.across(tenth / 10))
            drawn += svg.line((x, 5), (x, HEIGHT), stroke_width="0.2")
            drawn += svg.text((x, HEIGHT + 12), f"{tenth / 10:.1f} s", 11)
        return drawn
