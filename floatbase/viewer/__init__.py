"""The viewer: the picture of a state in the page, played, plotted and saved."""

from floatbase.viewer import geometry, marks, page, plots, props, recording, shapes, wire
from floatbase.viewer.camera import PRESETS, View
from floatbase.viewer.canvas import Canvas
from floatbase.viewer.colours import (
    ALARM,
    BACKGROUNDS,
    CALM,
    COM,
    CONE,
    CONE_ALPHA,
    IDLE,
    LEGEND,
    MEASURED,
    PLANNED,
    WARNING,
    X_AXIS,
    hexadecimal,
)
from floatbase.viewer.displays import Displays
from floatbase.viewer.figures import FIGURES
from floatbase.viewer.lowering import code
from floatbase.viewer.meshes import robot_meshes
from floatbase.viewer.painter import below, nice
from floatbase.viewer.recording import push_at
from floatbase.viewer.shapes import Item, Picture
from floatbase.viewer.text import text_picture
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
    "IDLE",
    "LEGEND",
    "MEASURED",
    "PLANNED",
    "PRESETS",
    "WARNING",
    "X_AXIS",
    "Canvas",
    "Displays",
    "Item",
    "Picture",
    "Piece",
    "View",
    "Viewer",
    "Window",
    "below",
    "code",
    "geometry",
    "hexadecimal",
    "marks",
    "nice",
    "page",
    "plots",
    "props",
    "push_at",
    "recording",
    "robot_meshes",
    "shapes",
    "text_picture",
    "urdf_visuals",
    "wire",
]
