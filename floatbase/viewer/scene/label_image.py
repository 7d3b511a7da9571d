"""Text rendered as images, for the labels in a scene."""

from __future__ import annotations

import re
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from floatbase.viewer.scene.colours import RGB

FONT_SIZE = 28  # pixels, height of a letter
_SUBSCRIPT_SCALE = 0.68  # size of a subscript, as a fraction of that of the text


def text_image(text: str, plate: bool, colour: RGB) -> npt.NDArray[np.uint8]:
    """Render a line of text."""
    # re.split with a group returns text and subscripts alternately
    parts = [(part, i % 2 == 1) for i, part in enumerate(re.split(r"\{([^}]*)\}", text)) if part]
    widths = [font(is_subscript).getlength(part) for part, is_subscript in parts]
    margin = FONT_SIZE // 3
    size = (round(sum(widths)) + 2 * margin, round(1.3 * FONT_SIZE) + 2 * margin)
    image = Image.new("LA", size, (255, 0))
    draw = ImageDraw.Draw(image)
    grey = round(255 * sum(colour) / 3)
    if plate:
        draw.rounded_rectangle(
            (0, 0, size[0] - 1, size[1] - 1), margin, fill=(255 if grey < 128 else 30, 215)
        )
    x = float(margin)
    for (part, is_subscript), width in zip(parts, widths, strict=True):
        base = margin + FONT_SIZE + (0.25 * FONT_SIZE if is_subscript else 0.0)
        draw.text((x, base), part, font=font(is_subscript), fill=(grey, 255), anchor="ls")
        x += width
    return np.asarray(image)


@cache
def font(is_subscript: bool = False) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Load the font of the labels."""
    size = FONT_SIZE * (_SUBSCRIPT_SCALE if is_subscript else 1.0)
    spec = find_spec("matplotlib")
    if spec is not None and spec.submodule_search_locations:
        folder = Path(spec.submodule_search_locations[0])
        font = folder / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf"
        if font.is_file():
            return ImageFont.truetype(str(font), size)
    return ImageFont.load_default(size)
