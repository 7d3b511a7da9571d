"""Helpers and exercises of lesson 04, One cost, many spaces."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

import floatbase as fb
from floatbase._arrays import Array
from floatbase.dynamics import EquationsOfMotion, FeasibleSpace
from floatbase.lessons import Exercise, Numeric, Shaped, Verdict
from floatbase.lessons.lesson03 import ConstantTorques, standing_go2, tilted_squeeze
from floatbase.linear_algebra import rank
from floatbase.robots import Robot
from floatbase.simulation import Rollout
from floatbase.viewer import ALARM, COM, Viewer, hexadecimal, shapes

WANTED = np.array([0.0, 0.5, 0.0])  # m/s², world: to the left
ARROW = 0.5  # m drawn for 1 m/s²
LEVELS = (0.02, 0.125, 0.4, 1.0, 2.0)  # of a cost above its least value
VALLEY = 0.02  # a direction that is so many times less curved than another counts as the floor of a valley
RISE_TIME = 0.02  # s in which the engine's soft contact settles


class LeastCost:
    """A controller: in every tick the torques of least cost. cost: a function eom -> `Quadratic` on the torques."""

    def __init__(self, robot: Robot, contacts: fb.Contacts, cost: Callable[[EquationsOfMotion], fb.Quadratic]):
        self.robot, self.contacts, self.cost = robot, contacts, cost

    def __call__(self, q: Array, v: Array, t: float) -> ConstantTorques:
        """The torques for configuration q and velocity v."""
        eom = fb.equations_of_motion(fb.State(self.robot, q, v), self.contacts)
        return ConstantTorques(self.cost(eom).minimiser())


def measured_acceleration(record: Rollout) -> Array:
    """Mean acceleration of the centre of mass, shape (3,), m/s², from its velocities in a record of the physics."""
    first = int(np.searchsorted(record.time, RISE_TIME))
    change = record.final.com_velocity - record.state(first).com_velocity
    return change / (record.time[-1] - record.time[first])


def show_torques(view: Viewer, eom: EquationsOfMotion, tau: npt.ArrayLike, length: float = ARROW) -> Array:
    """Draw the forces that torques bring about and the acceleration of the centre of mass, which is returned, (3,), m/s².

    length: m drawn for 1 m/s².
    """
    state = eom.state
    a = state.com_jacobian @ fb.accelerations_from_torques(eom)(tau) + state.com_drift
    arrow = {}
    if np.linalg.norm(a) > 1e-6:
        arrow["acceleration"] = shapes.arrow(state.com, length * a, COM, view.painter.size)
    view.show(state, contacts=eom.contacts, planned=fb.forces_from_torques(eom)(tau), extra=arrow)
    return a


def slices(**costs: tuple[fb.Quadratic, str, str, float]) -> Figure:
    """Level curves of costs over two numbers: title=(cost, name of x, name of y, half the width of the picture).

    Yellow is cheap. A dot marks the least point of a cost that has one, and no valley.
    """
    figure, axes = plt.subplots(1, len(costs), figsize=(3.6 * len(costs), 3.5), layout="constrained", squeeze=False)
    for ax, (title, (cost, x_name, y_name, half)) in zip(axes[0], costs.items(), strict=True):
        x, y = np.meshgrid(np.linspace(-half, half, 80), np.linspace(-half, half, 80))
        points = np.stack([x.ravel(), y.ravel()])
        height = 0.5 * np.sum(points * (cost.H @ points), axis=0) + cost.g @ points + cost.c
        height = (height - height.min()).reshape(x.shape)
        ax.contourf(x, y, np.sqrt(height), levels=14, cmap="viridis_r")
        ax.contour(x, y, height, levels=LEVELS, colors="white", linewidths=0.8)
        flat, curved = np.linalg.eigvalsh(cost.H)
        if flat > VALLEY * curved:
            ax.plot(*cost.minimiser(), "o", color=hexadecimal(ALARM), markeredgecolor="white", markersize=8)
        ax.set(xlabel=x_name, ylabel=y_name, title=title.replace("_", " "), aspect="equal")
    plt.close(figure)
    return figure


def level_curves(cost: fb.Quadratic, point: npt.ArrayLike, half: float, x_name: str, y_name: str) -> str:
    """The same as `slices` for one cost, as quick SVG with a dot at `point`, shape (2,): for pictures with sliders."""
    values, vectors = np.linalg.eigh(cost.H)
    values = np.maximum(values, 1e-9 * values[-1])
    centre = -vectors @ ((vectors.T @ cost.g) / values)
    turn = -np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
    s = 130.0 / half  # pixels for 1
    x, y = (np.array([1, -1]) * s * np.asarray(point)) + 130
    at = f'transform="translate({130 + s * centre[0]:.1f} {130 - s * centre[1]:.1f}) rotate({turn:.2f})"'
    rings = "".join(
        f'<ellipse rx="{s * (2 * level / values[1]) ** 0.5:.1f}" ry="{s * (2 * level / values[0]) ** 0.5:.1f}" {at} '
        'fill="#0072B2" fill-opacity="0.12" stroke="#0072B2"/>'
        for level in LEVELS
    )
    return (
        f'<svg width="330" height="290" viewBox="-40 0 310 290"><svg x="0" y="0" width="260" height="260">'
        f'<rect width="260" height="260" fill="#f4f6f9"/>{rings}'
        f'<path d="M0 130H260M130 0V260" stroke="#aaa" stroke-dasharray="3 3"/>'
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="6" fill="#D55E00" stroke="white"/></svg>'
        f'<text x="130" y="278" text-anchor="middle" font-size="13">{x_name}, ± {half:g}</text>'
        f'<text transform="translate(-10 130) rotate(-90)" text-anchor="middle" font-size="13">{y_name}, ± {half:g}</text>'
        "</svg>"
    )


def counted_in(space: FeasibleSpace, newtons: float) -> FeasibleSpace:
    """The same motions, but β chosen when forces are counted in units of so many newtons; q̈, τ, λ come out as before."""
    units = np.ones(space.map.n_out)
    units[space.map.blocks["forces"]] = 1.0 / newtons
    V = np.linalg.qr(units[:, None] * space.map.A)[0]
    v = units * space.map.b
    v = v - V @ (V.T @ v)
    return FeasibleSpace(space.eom, fb.Affine(V / units[:, None], v / units, space.map.blocks))


def effort_picture(curves: Mapping[str, tuple[npt.ArrayLike, npt.ArrayLike]]) -> Figure:
    """Curves of effort over the acceleration to the left: name -> (accelerations, efforts)."""
    figure, ax = plt.subplots(figsize=(6.5, 3.6), layout="constrained")
    styles = (("#D55E00", "-"), ("#E69F00", "--"), ("#0072B2", "-"))
    for (name, (x, y)), (colour, style) in zip(curves.items(), styles, strict=False):
        ax.plot(x, y, style, color=colour, label=name, linewidth=2)
    ax.set(xlabel="acceleration of the base to the left [m/s²]", ylabel="½‖τ‖² [(N·m)²]", ylim=(0, None))
    ax.grid(alpha=0.3)
    ax.legend()
    plt.close(figure)
    return figure


@cache
def tilted() -> EquationsOfMotion:
    """go2 on four feet, tilted and moving."""
    return tilted_squeeze()[0]


def _gradient_by_newton() -> Array:
    """By the forces, a_c = Σ f / m + g with λ = ζ(τ): no Jacobian of the centre of mass, no drift of it."""
    eom = tilted()
    zeta, mass = fb.forces_from_torques(eom), eom.robot.mass
    sums = np.tile(np.eye(3), 4) / mass
    return (sums @ zeta.A).T @ (sums @ zeta.b + eom.robot.model.gravity.linear - WANTED)


def _gradients() -> dict[str, Callable[[], Any]]:
    def gradient(
        drift: float = 1.0, offset: float = 1.0, turned: int = 0, back: Callable[[Array], Array] = np.transpose
    ) -> Callable[[], Array]:
        def value() -> Array:
            eom = tilted()
            state, eta = eom.state, fb.accelerations_from_torques(eom)
            R = state.frame_pose("base").rotation
            wanted = (WANTED, R @ WANTED, R.T @ WANTED)[turned]
            J = state.com_jacobian
            return back(eta.A) @ J.T @ (offset * J @ eta.b + drift * state.com_drift - wanted)

        return value

    right = gradient()
    return {
        "There is nothing there yet: at a minimum the gradient is zero, but τ = 0 is none.": lambda: np.zeros(12),
        "The sign: residual = actual - wanted, and the gradient points uphill.": lambda: -right(),
        "The drift is forgotten: the centre of mass accelerates by J q̈ + J̇ q̇.": gradient(drift=0.0),
        "The drift has the wrong sign.": gradient(drift=-1.0),
        "η has an offset: with the motors off the robot accelerates too, by b.": gradient(offset=0.0),
        "The offset of η and the drift are both forgotten.": gradient(drift=0.0, offset=0.0),
        "The frame: `wanted` is in world axes, as are J and the drift; do not turn it.": gradient(turned=1),
        "The frame: `wanted` is in world axes already; the base's rotation takes it out of them.": gradient(turned=2),
        "A gradient comes back by the transpose of A. A pseudo-inverse would bring back points.": gradient(back=np.linalg.pinv),
        "This is the cost of the standing robot: J and the drift of the moving one are other numbers.": _gradient_of_standing,
        "The cost has a ½ in front, so the square's 2 cancels.": lambda: 2 * right(),
    }


def _gradient_of_standing() -> Array:
    """The lesson's own cost, made where the robot stands, pulled back through η of the moving robot."""
    state = standing_go2().state
    cost = fb.Quadratic.from_residual(state.com_jacobian, WANTED - state.com_drift)
    return cost.pullback(fb.accelerations_from_torques(tilted())).g


def _flat_on_three_feet() -> int:
    """By counting singular values of what both costs see, in τ; β on three feet is as long as τ and J has full rank."""
    contacts = fb.Contacts.points(standing_go2().robot).without("FL_foot")
    state = standing_go2().state
    eta = fb.accelerations_from_torques(fb.equations_of_motion(state, contacts))
    return eta.n_in - rank(np.vstack([state.com_jacobian, state.frame_jacobian("base")[3:]]) @ eta.A)


def _first_costs() -> dict[str, Any]:
    """η and the lesson's three costs: on q̈ the centre of mass and the turning of the base, on τ the effort."""
    eom = standing_go2()
    J, drift = eom.state.frame_jacobian("base")[3:], eom.state.frame_drift("base")[3:]
    return {
        "eta": fb.accelerations_from_torques(eom),
        "com": fb.Quadratic.from_residual(eom.state.com_jacobian, WANTED - eom.state.com_drift),
        "turn": fb.Quadratic.from_residual(J, -drift),
        "effort": fb.Quadratic.from_residual(np.eye(12), np.zeros(12)),
    }


def _judge_design(answer: Any) -> Verdict:
    """Any cost on torques whose least point does what was asked for."""
    eom = standing_go2()
    if answer is None or answer is Ellipsis:
        return Verdict(False, "There is no answer yet: replace the placeholder by your expression.")
    if not isinstance(answer, fb.Quadratic):
        return Verdict(False, f"Give the cost, an fb.Quadratic on torques, not its minimiser or {type(answer).__name__}.")
    if answer.n != eom.d:
        return Verdict(False, f"This is a cost on {answer.n} numbers; on torques it has 12. Pull it back through η.")
    try:
        tau = answer.minimiser()
    except fb.FloatbaseError as error:
        return Verdict(False, f"It has no least point: {error}")
    eta, zeta = fb.accelerations_from_torques(eom), fb.forces_from_torques(eom)
    a = eom.state.com_jacobian @ eta(tau)
    turning = np.linalg.norm(eta(tau)[3:6])
    friction = np.linalg.norm(zeta(tau).reshape(4, 3)[:, :2], axis=1).max()
    if np.linalg.norm(a + WANTED) < 0.05:
        return Verdict(False, "The sign: this accelerates to the right.")
    if np.linalg.norm(a - WANTED) > 0.01:
        return Verdict(False, f"The centre of mass accelerates by {_rounded(a)} m/s², not {_rounded(WANTED)}: weigh that more.")
    if turning > 0.05:
        return Verdict(
            False, f"The centre of mass is right, but the base turns at {turning:.1f} rad/s². Which cost is missing?"
        )
    if friction > 6.0:
        return Verdict(
            False, f"It moves as wanted, but one foot leans on friction with {friction:.1f} N. Effort does not mind; who would?"
        )
    return Verdict(True, "Three costs, each in the space where it is easy to say, added in the space where the motors are.")


def _rounded(a: Array) -> list[float]:
    return [round(float(x), 3) + 0.0 for x in a]


EXERCISES = (
    Exercise(
        name="04.1",
        statement="The gradient at τ = 0 of ½‖J q̈ + J̇ q̇ - wanted‖², seen from the torques.",
        stub="gradient = np.zeros(12)  # replace: from A, b, J, drift and wanted",
        solution="gradient = A.T @ J.T @ (J @ b + drift - wanted)",
        judge=Shaped(
            Numeric(
                right=_gradient_by_newton,
                praise="The chain rule: points go forward by η, slopes come back by its transpose.",
                mistakes=_gradients(),
            ),
            {
                (18,): "18 numbers: that is the slope on q̈. One step is left to come back to the torques.",
                (3,): "3 numbers: that is the residual. Two steps are left to come back to the torques.",
                (12, 1): "This is a matrix with one column; a vector of shape (12,) is asked for.",
                (12, 12): "That is a curvature, shape (12, 12); the gradient is a vector.",
            },
        ),
        explanation="(15) by hand; `pullback(eta).g` of the same cost gives it too.",
    ),
    Exercise(
        name="04.2",
        statement="On three feet: how many directions of β are flat for the sum of both costs?",
        stub="flat = 9  # replace this number by what you find",
        solution='three = fb.feasible_space(fb.equations_of_motion(state, contacts.without("FL_foot")))\n'
        "flat = three.dimension - rank((com + turn).pullback(three.qdd).H)",
        judge=Numeric(
            count=True,
            right=_flat_on_three_feet,
            praise="Again 6, but others: three squeezes, and three ways to move the free foot.",
            mistakes={
                "That is for the centre of mass alone.": lambda: 9,
                "Those are the squeezes. Has the free leg nothing to do?": lambda: 3,
                "That is counted in q̈, where most directions are not possible at all.": lambda: 12,
                "So it would be with effort; these two costs do not see all that three feet can do.": lambda: 0,
            },
        ),
        explanation="β has 12 directions and the two costs bend 6 of them; 9 forces leave 9 - 6 = 3 squeezes.",
    ),
    Exercise(
        name="04.3",
        statement="A cost on torques: 0.5 m/s² to the left, no turning, at most 6 N of friction at every foot.",
        stub="design = com.pullback(eta) + turn.pullback(eta) + 1e-4 * effort  # change or add costs",
        solution="from floatbase.objectives.centroidal import tangential_bias\n\n"
        "friction = tangential_bias(contacts)  # on λ\n"
        "design = com.pullback(eta) + turn.pullback(eta) + 1e-4 * effort + 1e-4 * friction.pullback(zeta)",
        judge=_judge_design,
        names=_first_costs,
        explanation="Friction is easy to say in λ, so say it there and bring it to the torques through ζ. Its weight is small "
        "enough not to spoil the acceleration.",
    ),
)
