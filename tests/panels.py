"""What every panel of sliders must do, claimed of the panels of a lesson without a browser."""

import gc
import re
from pathlib import Path
from typing import Any

from floatbase.lessons import SliderPanel, slider_samples

# lowest, first and highest value of a slider, and the step that it gets
RANGES = [
    (-6.0, 2.0, 6.0, 0.2), (-40.0, 30.0, 40.0, 1.0), (-1.5, -0.7, 1.5, 0.05), (0.0, 1.5, 4.0, 0.05),
    (0, 60, 80, 1.0), (0, 22, 25, 0.5), (0.0, 0.5, 1.0, 0.02), (0.0, 60.0, 120.0, 2.0),
    (-8, 0.5, 8, 0.1), (-5, -5, 0, 0.1), (0, 0.003, 0.01, 0.0002), (3, 4, 53, 1.0),
    (1, 3, 24, 0.2), (0, 0, 5, 0.1), (0, 250, 5000, 50.0), (-180.0, 0.0, 180.0, 5.0),
]  # fmt: skip
_MADE = re.compile(r"\b(?!push_)\w+_panel\(")


def assert_every_slider_answers(panel: SliderPanel) -> None:
    """Moved to its ends and its middle, each slider changes the picture or the note; one of them
    the picture, if any.
    """
    moves = []
    for name, slider in panel.sliders.items():
        first, seen = slider.value, []
        for value in (slider.min, (slider.min + slider.max) / 2, slider.max):
            slider.value = value
            seen.append((_drawn(panel), panel.note.value))
        slider.value = first
        assert any(other != seen[0] for other in seen), f"the slider {name} changes nothing"
        moves += [any(picture != seen[0][0] for picture, _ in seen)]
    assert any(moves) or panel.view is None, (
        f"none of the sliders {list(panel.sliders)} changes the picture"
    )


def assert_every_slider_has_samples(panel: SliderPanel) -> None:
    """A site has samples of each slider, from end to end through where it begins, few enough to be
    computed.
    """
    found = slider_samples.panel_samples(panel)
    for name, slider in panel.sliders.items():
        assert {slider.min, slider.value, slider.max} <= set(found[name]), (
            f"the samples of {name} are {found[name]}"
        )
        assert 5 <= len(found[name]) <= 25, f"{len(found[name])} samples of {name}"
    where, together = slider_samples.combinations(
        [len(values) for values in found.values()], [0] * len(found)
    )
    assert len(where) <= slider_samples.MAX_COMBINATIONS and (together or len(found) > 2)


def moved_sliders(notebook: Any) -> str:
    """The source of a cell that asks this of all panels of a notebook, after it ran, and raises
    where one does not.
    """
    code = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    count = sum(len(_MADE.findall(source)) for source in code)
    return (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})\nimport panels\n"
        f"panels.judge_all({count})"
    )


def judge_all(count: int) -> None:
    """Ask it of all panels of this process, which must be so many."""
    found = [thing for thing in gc.get_objects() if type(thing) is SliderPanel]
    assert len(found) == count, f"{len(found)} panels of sliders, not {count}"
    for panel in found:
        assert_every_slider_answers(panel)
        assert_every_slider_has_samples(panel)


def _drawn(panel: SliderPanel) -> Any:
    picture = panel.view.renderer.picture if panel.view else {}
    return {path: (item.matrix.tolist(), item.colour) for path, item in picture.items()}
