"""The one colour code, in 3-D and in plots: colour-blind safe (Okabe and Ito), RGB from 0 to 1.

Dark blue is what was measured, light blue what was planned. A friction cone is green while its force is inside, orange when
a facet or the cone's surface is reached, vermilion when the force is outside, and a faint grey where there is no force.
"""

from __future__ import annotations

RGB = tuple[float, float, float]
RGBA = tuple[float, float, float, float]


def _rgb(code: str) -> RGB:
    red, green, blue = (int(code[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return red, green, blue


MEASURED = _rgb("#0072B2")
PLANNED = _rgb("#56B4E9")
COM = _rgb("#AA3377")
CALM = _rgb("#009E73")
WARNING = _rgb("#E69F00")
ALARM = _rgb("#D55E00")
IDLE = _rgb("#8A8F98")
SUPPORT = CALM  # veiled, on the ground
PUSH = _rgb("#222222")  # on a dark background, the colour of its text
LIMIT = _rgb("#888888")
ROBOT = _rgb("#9EA3AB")
GHOST = _rgb("#7A86A8")
PATCH = _rgb("#444444")

X_AXIS = _rgb("#D55E00")
Y_AXIS = _rgb("#009E73")
Z_AXIS = _rgb("#0072B2")

GHOST_NAME = "wanted posture"  # unless it is called something else

# part of a picture, its colour, and what it is: the legend, in this order
LEGEND: tuple[tuple[str, RGB, str], ...] = (
    ("measured", MEASURED, "measured force"),
    ("planned", PLANNED, "planned force"),
    ("wrench", COM, "wrench at the centre of mass"),
    ("com", COM, "centre of mass"),
    ("push", PUSH, "push"),
    ("cone", CALM, "friction cone: force inside"),
    ("cone", WARNING, "friction cone: surface reached"),
    ("cone", ALARM, "friction cone: force outside"),
    ("idle cone", IDLE, "friction cone: no force"),
    ("support", SUPPORT, "support region"),
    ("ghost", GHOST, GHOST_NAME),
)

# cone status -> colour, in the order of growing worry; and how opaque
CONE = {"idle": IDLE, "inside": CALM, "active": WARNING, "outside": ALARM}
CONE_ALPHA = {"idle": 0.12, "inside": 0.28, "active": 0.28, "outside": 0.28}

# background -> (top, bottom) of the page, colour of the ground's lines, colour of text
BACKGROUNDS: dict[str, tuple[RGB, RGB, RGB, RGB]] = {
    "white": (_rgb("#FFFFFF"), _rgb("#FFFFFF"), _rgb("#DDDDDD"), _rgb("#222222")),
    "light": (_rgb("#FBFCFE"), _rgb("#DFE5EC"), _rgb("#BCC5CF"), _rgb("#222222")),
    "dark": (_rgb("#1E2227"), _rgb("#33393F"), _rgb("#59616A"), _rgb("#F2F2F2")),
}


def hexadecimal(colour: RGB) -> str:
    """The colour as "#rrggbb"."""
    return "#" + "".join(f"{round(255 * part):02X}" for part in colour)


def with_alpha(colour: RGB, alpha: float) -> RGBA:
    """The colour, so opaque: 0 is not seen, 1 hides what is behind."""
    return (*colour, alpha)
