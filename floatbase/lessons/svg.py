"""Drawings of the lessons as SVG, fast enough for a slider. Text has the colour of the page."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from floatbase._validation import Array


def element(tag: str, content: str = "", /, **attributes: str | float) -> str:
    """Write an SVG element."""
    written = "".join(
        f' {name.replace("_", "-")}="{f"{value:.1f}" if isinstance(value, float) else value}"'
        for name, value in attributes.items()
    )
    return f"<{tag}{written}>{content}</{tag}>" if content else f"<{tag}{written}/>"


def polygon(corners: Array, **style: str | float) -> str:
    """Draw a closed line through corners, shape (n, 2), in pixels."""
    return element("polygon", points=_coordinates(corners), **style)


def polyline(points: Array, **style: str | float) -> str:
    """Draw a line through points, shape (n, 2), in pixels."""
    return element("polyline", points=_coordinates(points), fill="none", **style)


def line(start: npt.ArrayLike, end: npt.ArrayLike, **style: str | float) -> str:
    """Draw a straight line between two points, shape (2,), in pixels."""
    (x1, y1), (x2, y2) = np.asarray([start, end], dtype=np.float64).tolist()
    return element("line", x1=x1, y1=y1, x2=x2, y2=y2, **{"stroke": "currentColor", **style})


def circle(centre: npt.ArrayLike, radius: float, **style: str | float) -> str:
    """Draw a circle; centre, shape (2,), and radius in pixels."""
    x, y = np.asarray(centre, dtype=np.float64).tolist()
    return element("circle", cx=x, cy=y, r=float(radius), **style)


def text(at: npt.ArrayLike, words: str, size: int = 13, anchor: str = "middle") -> str:
    """Draw a line of text at a point, shape (2,), in pixels: its "start", "middle" or "end"."""
    x, y = np.asarray(at, dtype=np.float64).tolist()
    return element("text", words, x=x, y=y, font_size=size, text_anchor=anchor)


def upright_text(at: npt.ArrayLike, words: str, size: int = 13) -> str:
    """Draw a line of text that reads upwards, with its middle at a point, shape (2,), in pixels."""
    x, y = np.asarray(at, dtype=np.float64).tolist()
    turned = f"translate({x:g} {y:g}) rotate(-90)"
    return element("text", words, transform=turned, font_size=size, text_anchor="middle")


def drawing(content: str, width: float, view_box: str) -> str:
    """Draw a picture that shrinks on a narrow page; view_box: left, top, width, height [px]."""
    style = {"style": "max-width: 100%", "fill": "currentColor"}
    return element("svg", content, width=width, viewBox=view_box, **style)


def captioned(content: str, size: tuple[int, int], margin: int, *lines: str) -> str:
    """Draw a picture, clipped to its size, with lines of text below."""
    width, height = size
    box = element("svg", content, x=0, y=0, width=width, height=height)
    words = "".join(text((width / 2, height + 18 * i), each) for i, each in enumerate(lines, 1))
    total = width + 2 * margin
    return drawing(box + words, total, f"{-margin} 0 {total} {height + 18 * len(lines) + 10}")


def from_above(points: Array, middle: tuple[float, float], scale: float) -> Array:
    """Convert points to a drawing from above, with x upwards and y to the left."""
    return np.asarray(np.array(middle) - scale * points[:, 1::-1])


def _coordinates(points: Array) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
