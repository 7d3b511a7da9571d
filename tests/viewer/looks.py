"""Screenshots for the browser tests, kept in build/screenshots, and access to the page's scene."""

import io

import numpy as np
from browsers import SCREENSHOTS
from PIL import Image
from waiting import until

SIZE = {"width": 900, "height": 600}
SMALL = {"width": 450, "height": 300}  # where few pixels do: the tests draw without a graphics card
# WebGL contexts of the tests' browser: an ordinary one has 16, which take many displays to use up
CONTEXTS = 4

# world position of a node, in our coordinates
WHERE = """(path) => {
  const node = viewer.scene_tree.find(path.split("/")).object, at = new MeshCat.THREE.Vector3();
  node.getWorldPosition(at);
  return [at.x, -at.z, at.y];
}"""
DRAWN = "window.viewer && viewer.num_messages_received > 0 && !viewer.needs_render"


def control(page, name, call):
    """Use a control of the page: `setValue(0.5)` of a slider, `fire()` of a button."""
    page.evaluate(f"viewer.gui_controllers['{name}'].{call}")


def eventually(page, condition):
    """Wait until a condition holds, while the page works."""
    until(condition, lambda: page.wait_for_timeout(20))


def settle(page, title=None):
    """Wait until the page has drawn, with this title if one is given."""
    titled = (
        "" if title is None else f" && document.getElementById('title').textContent == '{title}'"
    )
    page.wait_for_function(DRAWN + titled)


def picture(page, name):
    """Take and keep a screenshot, shape (height, width, 3)."""
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    data = page.screenshot(path=str(SCREENSHOTS / f"{name}.png"))
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)


def hue_pixels(image, colour):
    """Count the pixels with the colour's hue, whatever the light."""
    expected = np.array(colour) - np.mean(colour)
    have = image - image.mean(axis=2, keepdims=True)
    length = np.linalg.norm(have, axis=2)
    aligned = (have @ expected) / np.maximum(length * np.linalg.norm(expected), 1e-9)
    return int(np.sum((aligned > 0.97) & (length > 25)))


def vertices(item):
    """Return the vertices of an item, (n, 3), in the world frame [m]."""
    (packed,) = item.shape.data["geometries"]
    raw = packed["data"]["attributes"]["position"]
    kind = "<f4" if raw["type"] == "Float32Array" else "<i2"
    unit = np.frombuffer(raw["array"].data, kind).reshape(-1, 3)
    size = item.shape.data["object"]["matrix"][0]
    return size * unit @ item.matrix[:3, :3].T + item.matrix[:3, 3]
