"""What the browser tests look with: screenshots, kept in build/screenshots, and the page's own scene."""

from __future__ import annotations

import io

import numpy as np
from browsers import SCREENSHOTS
from PIL import Image

from floatbase.viewer import Viewer

# world position of a node, in our coordinates
WHERE = """(path) => {
  const node = viewer.scene_tree.find(path.split("/")).object, at = new MeshCat.THREE.Vector3();
  node.getWorldPosition(at);
  return [at.x, -at.z, at.y];
}"""


def settle(page, viewer: Viewer, frames: int = 1) -> None:
    """Wait until the page has drawn."""
    page.wait_for_function(f"window.viewer && viewer.num_messages_received >= {frames}")
    page.wait_for_function("!viewer.needs_render")


def picture(page, name: str) -> np.ndarray:
    """A screenshot, kept, as (height, width, 3)."""
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    data = page.screenshot(path=str(SCREENSHOTS / f"{name}.png"))
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)


def hue_pixels(image: np.ndarray, colour: tuple[float, float, float]) -> int:
    """How many pixels have the colour's hue, whatever the light."""
    wanted = np.array(colour) - np.mean(colour)
    have = image - image.mean(axis=2, keepdims=True)
    length = np.linalg.norm(have, axis=2)
    aligned = (have @ wanted) / np.maximum(length * np.linalg.norm(wanted), 1e-9)
    return int(np.sum((aligned > 0.97) & (length > 25)))
