"""The viewer: draws, plays, plots and saves a robot's states, forces and friction cones.

`Viewer` draws in a web page; `PictureOptions` describes what it can draw, and `View` where it looks
from. `shapes` and `markers` make additional items for a picture, in the `colours` of all pictures;
`prefixed` puts several items below a common path. `plots` makes figures of rollouts and of push
recovery.
"""

from floatbase.errors import MissingDependencyError, explain_arguments

try:
    from floatbase.viewer import plots
    from floatbase.viewer.camera import PRESETS, View
    from floatbase.viewer.live import PUSH_DISPLAY_TIME, status_message
    from floatbase.viewer.scene import colours, markers, shapes
    from floatbase.viewer.scene.options import PictureOptions
    from floatbase.viewer.scene.shapes import Item, Picture, prefixed
    from floatbase.viewer.viewer import Viewer
except ModuleNotFoundError as error:
    if str(error.name).startswith("floatbase"):
        raise
    raise MissingDependencyError(
        f"The viewer needs {error.name}, which is not installed. Install it with "
        'pip install "floatbase[viewer]".'
    ) from None

__all__ = [
    "PRESETS",
    "PUSH_DISPLAY_TIME",
    "Item",
    "Picture",
    "PictureOptions",
    "View",
    "Viewer",
    "colours",
    "markers",
    "plots",
    "prefixed",
    "shapes",
    "status_message",
]

explain_arguments(globals())
