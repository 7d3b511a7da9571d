"""Lesson 06: cones and forces, facets from above, compass plots, slopes and support regions."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull

import floatbase as fb
from floatbase._validation import Array
from floatbase.friction import FrictionCone, FrictionPolyhedron, WrenchSet, decompose, wrench_set
from floatbase.lessons import svg
from floatbase.lessons.lesson05 import friction_ratios
from floatbase.viewer import View, Viewer, prefixed, shapes
from floatbase.viewer.plots import push_recovery_plots
from floatbase.viewer.scene.colours import GREYS, MEASURED, PLANNED, hex_code

FORCE_SCALE = 0.01  # m drawn for 1 N at a single foot
CONE_HEIGHT = 0.7  # m: height of a single cone
SINGLE_FOOT_VIEW = View(25.0, 20.0, 1.0, around=((0.0, 0.0, 0.36), 0.52))  # of a single foot
DRAWING_SIZE = (250, 250)  # pixels of a drawing from above


def show_force(view: Viewer, force: npt.ArrayLike, mu: float) -> str:
    """Draw a round cone about the vertical with a force at its tip."""
    cone, f = FrictionCone(np.array([0.0, 0.0, 1.0]), mu), np.asarray(force, dtype=np.float64)
    tip, status = np.zeros(3), cone.status(f)
    drawn = {"/surface": shapes.friction_cone(tip, cone.normal, mu, CONE_HEIGHT, status)}
    if status == "outside":
        polyhedron = FrictionPolyhedron(cone.normal, mu, 4)  # only its normal and friction count
        drawn["/rim"] = shapes.cone_rim(tip, polyhedron, CONE_HEIGHT, is_round=True)
    picture = prefixed("cone", drawn)
    picture["patch"] = shapes.contact_patch(tip, cone.normal, 0.05)
    view.add_legend_entry("force", MEASURED, "force f")
    if np.any(f):
        picture["force"] = shapes.arrow(tip, FORCE_SCALE * f, MEASURED, view.painter.size)
    view.draw(view.painter.ground_only() | picture)
    parts, margin = decompose(f, cone.normal), cone.margin(f)
    sizes = (
        f"α⊥ = {parts.alpha_perp:.0f} N, α∥ = {parts.alpha_par:.0f} N, μ α⊥ - α∥ = {margin:.0f} N: "
    )
    if margin < 0:
        return sizes + "friction cannot provide this force"
    return sizes + f"{margin:.0f} N more is possible sideways"


def show_polyhedron(view: Viewer, mu: float, facets: int) -> str:
    """Draw a cone, the polyhedron inside it, and a force that leans as far forwards as possible."""
    inner, outer = (
        FrictionPolyhedron(np.array([0.0, 0.0, 1.0]), mu, facets, inside)
        for inside in (True, False)
    )
    # N: facet 0 lets a force lean forwards as far as this
    most = 45.0 * np.array([inner.mu_facet, 0.0, 1.0])
    picture = prefixed(
        "cone", shapes.friction_polyhedron(np.zeros(3), inner, CONE_HEIGHT, inner.status(most))
    )
    picture["planned"] = shapes.arrow(np.zeros(3), FORCE_SCALE * most, PLANNED, view.painter.size)
    picture["round"] = shapes.friction_cone(np.zeros(3), inner.normal, mu, CONE_HEIGHT, "idle")
    picture["patch"] = shapes.contact_patch(np.zeros(3), inner.normal, 0.05)
    view.draw(view.painter.ground_only() | picture)
    rays = {"inside": (inner.rays, ""), "outside": (outer.rays, "6 4")}
    half = DRAWING_SIZE[0] / 2
    s = 0.64 * half / mu  # pixels for 1: a triangle outside reaches 2 μ, and its corners may be cut
    drawn = "".join(
        _polygon(svg.from_above(corners, (half, half), s), dashes)
        for corners, dashes in rays.values()
    )
    drawn += svg.circle((half, half), s * mu, fill="none", stroke="currentColor", stroke_width=2)
    areas = " · ".join(
        f"{name} {100 * cone.area_ratio:.0f} %"
        for name, cone in (("inside", inner), ("outside", outer))
    )
    weakest = (
        f"weakest {inner.mu_facet:.2f} inside, strongest "
        f"{np.linalg.norm(outer.rays[0, :2]):.2f} outside"
    )
    title = f"{facets} facets from above; forwards is up"
    return svg.captioned(drawn, DRAWING_SIZE, 25, title, f"area: {areas}", weakest)


def compass_row(**stances: WrenchSet) -> Figure:
    """Plot horizontal force limits of some stances side by side, with the same scale."""
    polar = {"projection": "polar"}
    figure, grid = plt.subplots(1, len(stances), figsize=(4 * len(stances), 5.0), subplot_kw=polar)
    axes = np.atleast_1d(grid)
    for axis, (title, wrenches) in zip(axes, stances.items(), strict=True):
        push_recovery_plots.plot_horizontal_force_limits(wrenches, axis, n=48).set_title(
            title.replace("_", " "), pad=14
        )
    most = max(axis.get_rmax() for axis in axes)
    for axis in axes:
        axis.set_rlim(0.0, most)
        # the last label would overlap that of the next plot
        axis.set_xticks(np.pi / 2 * np.arange(4), ["x", "y", "-x", ""])
        axis.get_legend().remove()
    figure.subplots_adjust(left=0.05, right=0.97, bottom=0.14, top=0.84, wspace=0.25)
    figure.supxlabel(
        "largest horizontal force with the full weight and no moment [N], from above",
        fontsize="medium",
    )
    plt.close(figure)
    return figure


def show_slope(view: Viewer, slope: float, believed: float, facets: int = 4) -> str:
    """Draw a robot on a slope, and the planned forces of a controller that assumes another."""
    robot, n = view.robot, slope_normal(slope)
    start = fb.Simulation(robot, fb.Ground(normal=n)).state
    contacts = fb.Contacts.points(robot, normals=slope_normal(believed))
    controller = fb.WholeBodyController(robot, contacts, fb.standing_tasks(start), facets=facets)
    planned = controller(start.q, start.v).forces
    actual = fb.Contacts.points(robot, normals=n)
    front, rear = friction_ratios(actual, planned)[[0, 2]]
    picture = view.painter.picture(start, actual, planned=planned, cones=False)
    drawn = view.painter.picture(start, contacts, planned=planned)
    view.draw(
        picture | {path: item for path, item in drawn.items() if path.split("/")[0] == "cone"}
    )
    return (
        f"planned tangential over normal force on the actual slope: front {front:.2f}, rear "
        f"{rear:.2f}; the ground allows 0.70"
    )


def show_region(view: Viewer, slope: float, mu: float, facets: int = 8) -> str:
    """Draw a robot on a slope, and from above the region in which its centre of mass may be."""
    robot, n = view.robot, slope_normal(slope)
    start = fb.Simulation(robot, fb.Ground(normal=n)).state
    contacts = fb.Contacts.points(robot, mu, normals=n)
    view.draw(view.painter.picture(start, contacts))
    region = wrench_set(start, contacts, facets=facets).support_region()
    return region_picture(start, contacts.positions(start), region)


def slope_normal(degrees: float) -> Array:
    """Return the unit normal of a slope [°] that rises towards x, shape (3,)."""
    angle = np.deg2rad(degrees)
    return np.array([-np.sin(angle), 0.0, np.cos(angle)])


def region_picture(state: fb.State, feet: Array, region: Array) -> str:
    """Draw from above the region of the centre of mass, the hull of the feet, and the centre."""
    middle, (width, height) = feet[:, :2].mean(axis=0), DRAWING_SIZE

    def seen(points: Array) -> Array:
        return svg.from_above(points - middle, (width / 2, height / 2), width / 0.6)

    words = "filled: where the CoM may be" if len(region) else "nowhere: the feet cannot carry it"
    drawn = _polygon(seen(feet[ConvexHull(feet[:, :2]).vertices, :2]), "6 4")
    if len(region) > 2:
        drawn += _polygon(seen(region), "", 0.35)
    for foot in seen(feet[:, :2]):
        drawn += svg.circle(foot, 3.5, fill="currentColor")
    com = seen(state.com[None, :2])[0]
    drawn += svg.circle(com, 7, fill=hex_code(GREYS[1]), stroke="currentColor")
    lines = "from above; forwards is up", words, "dashed: the feet's hull, dot: the CoM"
    return svg.captioned(drawn, DRAWING_SIZE, 25, *lines)


def _polygon(corners: Array, dashes: str, opacity: float = 0.12) -> str:
    style = {"fill_opacity": f"{0 if dashes else opacity}", "stroke_dasharray": dashes}
    grey = hex_code(GREYS[1])
    return svg.polygon(corners, fill=grey, stroke=grey, stroke_width=2, **style)
