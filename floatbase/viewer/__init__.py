"""The viewer: draws a robot's states, forces and friction cones in a web page; plays, plots and
saves them.

`Viewer` draws; `PictureOptions` explains what. `View` says from where it looks. `shapes` and
`markers` make further items for a picture, in the `colours` of all pictures; `prefixed` puts
several items below one path. `plots` makes figures of a rollout and of push recovery.
"""

from floatbase.viewer import plots
from floatbase.viewer.camera import PRESETS, View
from floatbase.viewer.scene import colours, markers, shapes
from floatbase.viewer.scene.options import PictureOptions
from floatbase.viewer.scene.painter import prefixed
from floatbase.viewer.scene.shapes import Item, Picture
from floatbase.viewer.viewer import Viewer

__all__ = [
    "PRESETS",
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
]
