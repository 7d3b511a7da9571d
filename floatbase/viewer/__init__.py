"""The viewer: draws a robot's states, forces and friction cones in a web page; plays, plots and
saves them.

`Viewer` draws; `PictureOptions` explains what. `View` says from where it looks. `shapes` and
`markers` make further items for a picture, in the `colours` of all pictures; `prefixed` puts
several items below one path. `plots` makes figures of a rollout and of push recovery.
"""

from floatbase.errors import ViewerError

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
    raise ViewerError(f'The viewer needs {error.name}: pip install "floatbase[viewer]".') from None

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
