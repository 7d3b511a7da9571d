"""Lesson C: the table, a game of active sets, the path of a solver, and its iterations."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from itertools import product
from typing import Any

import ipywidgets as widgets
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

import floatbase as fb
from floatbase._validation import Array
from floatbase.lessons import qp_plots, static_export
from floatbase.lessons.lessonC.helpers import corner_table, table_top
from floatbase.lessons.panels import Panel
from floatbase.lessons.rounding import rounded
from floatbase.qp import QP
from floatbase.viewer.export.display_mode import display_mode
from floatbase.viewer.export.thumbnail import panel_bundle
from floatbase.viewer.scene.colours import GREYS

_BESIDE = (-4.2, 3.4, -2.3, 3.2)  # visible range of the table and its walls
_COLOURS = 48
_NEAR = 1e-9  # rounding: smaller violations and less negative multipliers count as zero
# lowest points of the bowls in the game
PUZZLES = ((0.5, -1.0), (2.5, 2.0), (-4.0, 1.5), (-1.5, -1.5), (-4.0, -1.0))
_STYLES = ("-", "--", ":")


def show_table(lowest: float) -> str:
    """Draw the table of the course text and a bowl, with the marble and the multiplier."""
    qp = table_top((0.5, lowest), (1.0, 2.0))
    solution = fb.solve(qp)
    price = float(solution.inequality_multipliers[0])
    axis = _flat_axis(qp, (-2.5, 3.0, -2.2, 2.2), solution.active, solution.x)
    axis.plot(0.5, lowest, "x", color=GREYS[1], markersize=9)
    rests = "rests on the table" if solution.x[1] < _NEAR else "does not touch the table"
    return (
        _image(axis)
        + f"<div>the marble {rests}; multiplier of the constraint: <b>{rounded(price)}</b></div>"
    )


class ActiveSetGame(Panel):
    """Game in which you solve a QP in the plane by hand."""

    def __init__(self, puzzles: Sequence[tuple[float, float]] = PUZZLES):
        self._puzzles, self._at = tuple(puzzles), 0
        self._picture, self._message = widgets.HTML(), widgets.HTML()
        self.rows = {str(name): self._button(str(name)) for name in corner_table().inequality_names}
        self.next = widgets.Button(
            description="next bowl", layout=widgets.Layout(width="8em", flex="0 0 auto")
        )
        self.next.on_click(self._next_puzzle)
        buttons = widgets.HBox(
            [*self.rows.values(), self.next], layout=widgets.Layout(flex_flow="row wrap")
        )
        super().__init__([self._picture, buttons, self._message])
        self._start_puzzle()

    @property
    def qp(self) -> QP:
        """The QP of the present bowl."""
        return corner_table(self._puzzles[self._at])

    @property
    def message(self) -> str:
        """Comment on the constraints that are on, as HTML."""
        return str(self._message.value)

    def _button(self, name: str) -> widgets.Button:
        made = widgets.Button(description=name, layout=widgets.Layout(width="8em", flex="0 0 auto"))
        made.on_click(lambda _: self._click(name))
        return made

    def _start_puzzle(self) -> None:
        self.working: tuple[str, ...] = ()
        self.clicks = 0
        self._show()

    def _next_puzzle(self, _: object) -> None:
        self._at = (self._at + 1) % len(self._puzzles)
        self._start_puzzle()

    def _click(self, name: str) -> None:
        on = set(self.working) ^ {name}
        self.working = tuple(row for row in self.rows if row in on)
        self.clicks += 1
        self._show()

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        return self._site_bundle() if display_mode() == "site" else panel_bundle(self)

    def _site_bundle(self) -> dict[str, Any]:
        """Return the mimebundle for a static page: every set of constraints with every bowl."""
        bowls = tuple(str(i + 1) for i in range(len(self._puzzles)))
        pack = static_export.StaticExport([], words="In the live lesson the clicks are counted.")
        switches = list(product((0, 1), repeat=len(self.rows)))
        for self._at, on in product(range(len(bowls)), switches):
            self.working = tuple(row for row, is_on in zip(self.rows, on, strict=True) if is_on)
            picture, faults = self._current_view()
            pack.add_sample((self._at, *on), f"{picture}<div>{_describe_faults(faults)}</div>")
        self._at = 0
        self._start_puzzle()
        rows = [static_export.Control(row, ("off", "on"), 0, kind="switch") for row in self.rows]
        return pack.bundle([static_export.Control("bowl", bowls, 0, kind="choice"), *rows])

    def _current_view(self) -> tuple[str, list[str]]:
        """Return the picture as HTML, with what is wrong with the chosen constraints."""
        x, faults = check_active_set(self.qp, self.working)
        axis = _flat_axis(self.qp, _BESIDE, self.working, x)
        axis.plot(*self._puzzles[self._at], "x", color=GREYS[1], markersize=9)
        return _image(axis), faults

    def _show(self) -> None:
        for name, button in self.rows.items():
            button.icon, button.style.font_weight = (
                ("check", "bold") if name in self.working else ("", "normal")
            )
        self._picture.value, faults = self._current_view()
        self.solved = not faults
        clicks = f"{self.clicks} click{'' if self.clicks == 1 else 's'}"
        self._message.value = (
            f"bowl {self._at + 1} of {len(self._puzzles)}, {clicks}: {_describe_faults(faults)}"
        )


def _describe_faults(faults: Sequence[str]) -> str:
    return (
        "; ".join(faults)
        if faults
        else "<b>solved</b>: every constraint is satisfied, and no multiplier is negative"
    )


def check_active_set(qp: QP, working: Sequence[str]) -> tuple[Array | None, list[str]]:
    """Find the minimum with some constraints as equalities, and say what is wrong with it."""
    rows = [qp.inequality_names.index(name) for name in working]
    G, k = qp.G[rows], len(rows)
    if k and np.linalg.matrix_rank(G) < k:
        return None, [f"{' and '.join(working)}: no point in common, or dependent on one another"]
    found = np.linalg.solve(
        np.block([[qp.H, G.T], [G, np.zeros((k, k))]]), np.concatenate([-qp.g, qp.h[rows]])
    )
    x, prices = found[: qp.n], found[qp.n :]
    over = qp.G @ x - qp.h
    broken = [
        f"{name} is violated by {rounded(d)}"
        for name, d in zip(qp.inequality_names, over, strict=True)
        if d > _NEAR
    ]
    pulls = [
        f"{name} pulls: its multiplier is {rounded(p)}"
        for name, p in zip(working, prices, strict=True)
        if p < -_NEAR
    ]
    return x, broken + pulls


def plot_problem(qp: QP, start: npt.ArrayLike) -> Axes:
    """Plot a problem in the plane, with the start of a solver as a dot."""
    return qp_plots.plot(qp, _hexagon_example(), point=start)


def show_solver_path(qp: QP, ways: Sequence[tuple[Array, Sequence[int]]], rounds: float) -> str:
    """Draw the path of a solver in the plane after some iterations."""
    whole = min(int(rounds), len(ways) - 1)
    x, W = ways[whole]
    if rounds > whole:
        x = x + (rounds - whole) * (ways[whole + 1][0] - x)
    names = [str(qp.inequality_names[i]) for i in W]
    axis = _flat_axis(qp, _hexagon_example(), names, x)
    passed = [point for point, _ in ways[: whole + 1]]
    axis.plot(*np.transpose([*passed, x]), "o-", color=GREYS[0], markersize=4, linewidth=1.5)
    return (
        _image(axis) + f"<div>W: {', '.join(names) or 'no constraint'}; objective "
        f"{rounded(qp.objective(x), digits=3)}</div>"
    )


def _hexagon_example() -> tuple[float, float, float, float]:
    return (-3.2, 3.2, -2.9, 4.3)


def _flat_axis(
    qp: QP, box: tuple[float, float, float, float], working: Sequence[str], x: Array | None
) -> Axes:
    """Plot a problem on its own small figure, which pyplot does not manage."""
    figure = Figure(figsize=(4.6, 3.8), dpi=80)
    FigureCanvasAgg(figure)
    # few ticks, since they take most of the time
    axis = figure.add_axes((0.07, 0.07, 0.91, 0.91), xticks=(-2, 0, 2), yticks=(-2, 0, 2))
    return qp_plots.plot(qp, box, working, x, axis)


def _image(axis: Axes) -> str:
    """Return the figure of an axis as HTML; few colours save two thirds of the size."""
    canvas, data = FigureCanvasAgg(axis.figure), io.BytesIO()  # type: ignore[arg-type]
    canvas.draw()
    Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB").quantize(_COLOURS).save(
        data, "png", optimize=True
    )
    text = base64.b64encode(data.getvalue()).decode()
    return (
        f'<img src="data:image/png;base64,{text}" style="max-width: 100%" alt="a quadratic '
        f'program in the plane">'
    )
