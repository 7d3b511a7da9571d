"""The viewer: draws a robot's states, forces and friction cones in a web page; plays, plots and saves them.

`Viewer` draws. `View` says from where it looks. `shapes`, `marks` and `props` make further items for a picture, `walks` draws
what a walk plans, `plots` makes figures of a rollout, `programs` of quadratic programs in the plane, `roses` shows push roses
and compasses, and `FIGURES` are the document's figures. `page`, `published` and `wire` are for programs that write web pages.
"""

from floatbase.viewer import geometry, marks, page, plots, programs, props, published, recording, roses, shapes, walks, wire
from floatbase.viewer.camera import PRESETS, View
from floatbase.viewer.cells import hear_at_once
from floatbase.viewer.colours import (
    ALARM,
    BACKGROUNDS,
    CALM,
    COM,
    CONE,
    CONE_ALPHA,
    GHOST,
    GREYS,
    IDLE,
    LEGEND,
    MEASURED,
    NIGHT,
    PLANNED,
    WARNING,
    X_AXIS,
    hexadecimal,
)
from floatbase.viewer.figures import FIGURES
from floatbase.viewer.meshes import appearance, robot_meshes
from floatbase.viewer.painter import below
from floatbase.viewer.recording import push_at
from floatbase.viewer.shapes import Item, Picture
from floatbase.viewer.still import with_image
from floatbase.viewer.viewer import Viewer
from floatbase.viewer.visuals import Piece, urdf_visuals
from floatbase.viewer.window import Window

__all__ = [
    "ALARM",
    "BACKGROUNDS",
    "CALM",
    "COM",
    "CONE",
    "CONE_ALPHA",
    "FIGURES",
    "GHOST",
    "GREYS",
    "IDLE",
    "LEGEND",
    "MEASURED",
    "NIGHT",
    "PLANNED",
    "PRESETS",
    "WARNING",
    "X_AXIS",
    "Item",
    "Picture",
    "Piece",
    "View",
    "Viewer",
    "Window",
    "appearance",
    "below",
    "geometry",
    "hear_at_once",
    "hexadecimal",
    "marks",
    "page",
    "plots",
    "programs",
    "props",
    "published",
    "push_at",
    "recording",
    "robot_meshes",
    "roses",
    "shapes",
    "urdf_visuals",
    "walks",
    "wire",
    "with_image",
]
