"""Text as a picture, for the labels in a scene."""

from __future__ import annotations

import re
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from floatbase.viewer.colours import RGB

LETTER = 28  # height of a letter, pixels
_LOWERED = 0.68  # size of a subscript, over that of the text


def text_picture(text: str, plate: bool, colour: RGB) -> npt.NDArray[np.uint8]:
    """Grey and alpha of a line of text, shape (height, width, 2), 0-255.

    text: the text; braces make a subscript: "f{c}". plate: whether a plate lies behind it. colour: RGB.
    """
    # re.split with a group returns text and subscripts in turn
    parts = [(part, i % 2 == 1) for i, part in enumerate(re.split(r"\{([^}]*)\}", text)) if part]
    widths = [font(lowered).getlength(part) for part, lowered in parts]
    margin = LETTER // 3
    size = (round(sum(widths)) + 2 * margin, round(1.3 * LETTER) + 2 * margin)
    picture = Image.new("LA", size, (255, 0))
    draw = ImageDraw.Draw(picture)
    grey = round(255 * sum(colour) / 3)
    if plate:
        draw.rounded_rectangle((0, 0, size[0] - 1, size[1] - 1), margin, fill=(255 if grey < 128 else 30, 215))
    x = float(margin)
    for (part, lowered), width in zip(parts, widths, strict=True):
        base = margin + LETTER + (0.25 * LETTER if lowered else 0.0)
        draw.text((x, base), part, font=font(lowered), fill=(grey, 255), anchor="ls")
        x += width
    return np.asarray(picture)


@cache
def font(lowered: bool = False) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """matplotlib's DejaVu Sans, which has Greek letters and mathematical signs; without it, Pillow's font."""
    size = LETTER * (_LOWERED if lowered else 1.0)
    spec = find_spec("matplotlib")
    if spec is not None and spec.submodule_search_locations:
        font = Path(spec.submodule_search_locations[0]) / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf"
        if font.is_file():
            return ImageFont.truetype(str(font), size)
    return ImageFont.load_default(size)
