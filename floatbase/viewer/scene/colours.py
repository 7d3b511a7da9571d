"""Colours of all 3-D pictures and plots, RGB from 0 to 1, safe for colour-blind readers.

The colours are from the palette of Okabe and Ito. Measured forces are dark blue, planned forces
light blue. A friction cone is green when its force is inside, orange when the force reaches a facet
or the surface, vermilion when it is outside, and a faint grey when there is no force. The ring of a
joint is orange near a position limit, and vermilion when a limit is active. Everything else is
grey, such as a curve, a position or a matrix entry, because all readers can tell greys apart by
their lightness.
"""

from __future__ import annotations

RGB = tuple[float, float, float]
RGBA = tuple[float, float, float, float]


def _rgb(code: str) -> RGB:
    """Convert "#rrggbb" to RGB from 0 to 1."""
    red, green, blue = (int(code[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return red, green, blue


MEASURED = _rgb("#0072B2")
PLANNED = _rgb("#56B4E9")
COM = _rgb("#AA3377")
CALM = _rgb("#009E73")
WARNING = _rgb("#E69F00")
ALARM = _rgb("#D55E00")
IDLE = _rgb("#8A8F98")
SUPPORT = CALM
# of a push, the ZMP and multipliers; on a dark background they are light, like text
PUSH = _rgb("#222222")
LIMIT = _rgb("#888888")
ROBOT = _rgb("#9EA3AB")
GHOST = _rgb("#7A86A8")
PATCH = _rgb("#444444")
# dark, middle, light; the middle one is visible on any background
GREYS = (_rgb("#2B3440"), _rgb("#6F7885"), _rgb("#959EAA"))

X_AXIS = _rgb("#D55E00")
Y_AXIS = _rgb("#009E73")
Z_AXIS = _rgb("#0072B2")

GHOST_NAME = "desired posture"  # in the legend, unless `show` is given another name

# entries of the legend, in order: first part of the item's path, or status and "cone"; colour,
# meaning
LEGEND: tuple[tuple[str, RGB, str], ...] = (
    ("measured", MEASURED, "measured force"),
    ("planned", PLANNED, "planned force"),
    ("wrench", COM, "wrench at the centre of mass"),
    ("com", COM, "centre of mass"),
    ("push", PUSH, "push"),
    ("inside cone", CALM, "friction cone: force inside"),
    ("active cone", WARNING, "friction cone: surface reached"),
    ("outside cone", ALARM, "friction cone: force outside (rim)"),
    ("idle cone", IDLE, "friction cone: no force"),
    ("near_limit", WARNING, "joint near a position limit"),
    ("active_limit", ALARM, "active joint limit"),
    ("multiplier", PUSH, "multiplier (shadow price)"),
    ("support", SUPPORT, "support polygon"),
    ("dcm", COM, "capture point"),
    ("zmp", PUSH, "planned ZMP"),
    ("foothold", GREYS[1], "planned foothold"),
    ("swing", GREYS[1], "swing path"),
    ("push_recovery", MEASURED, "largest push survived"),
    ("previous", LIMIT, "largest push survived, previous run"),
    ("capture_point_bound", CALM, "capture-point bound (theory)"),
    ("static_bound", WARNING, "static bound (theory)"),
    ("horizontal_force", COM, "maximum horizontal force"),
    ("ghost", GHOST, GHOST_NAME),
)

# status of a friction cone -> its colour and its opacity
CONE = {"idle": IDLE, "inside": CALM, "active": WARNING, "outside": ALARM}
CONE_ALPHA = {"idle": 0.12, "inside": 0.28, "active": 0.28, "outside": 0.28}

# symbols in the legend other than a patch of colour: kind of item -> class of the page's style
LEGEND_SYMBOLS = {
    "com": "disc", "dcm": "ring", "zmp": "diamond", "foothold": "ring", "swing": "line",
    "near_limit": "ring", "active_limit": "ring", "support": "tile", "wrench": "curl",
    **{f"{status} cone": "cone" for status in CONE},
}  # fmt: skip

# background -> colours of the page's top and bottom, of the ground's lines, and of text
BACKGROUNDS: dict[str, tuple[RGB, RGB, RGB, RGB]] = {
    "white": (_rgb("#FFFFFF"), _rgb("#FFFFFF"), _rgb("#DDDDDD"), _rgb("#222222")),
    "light": (_rgb("#FBFCFE"), _rgb("#DFE5EC"), _rgb("#BCC5CF"), _rgb("#222222")),
    "dark": (_rgb("#1E2227"), _rgb("#282C32"), _rgb("#4B525A"), _rgb("#F2F2F2")),
}

# colour -> its shade on a dark background, for colours with too little contrast there
DARK_SHADES = {
    MEASURED: _rgb("#3F9FE5"),
    PLANNED: _rgb("#A9DBF9"),
    COM: _rgb("#CD5A9B"),
    PATCH: _rgb("#C4C9CF"),
    GREYS[0]: _rgb("#DDE3EA"),
}


def hex_code(colour: RGB) -> str:
    """Convert a colour, RGB from 0 to 1, to "#rrggbb"."""
    return "#" + "".join(f"{round(255 * part):02X}" for part in colour)


def with_alpha(colour: RGB, alpha: float) -> RGBA:
    """Add an opacity, from 0 (invisible) to 1 (opaque), to a colour."""
    return (*colour, alpha)
