r"""The equations of the course text, written out, each with a sentence of our own; its sections and
notes in a line each.

The map (`equations`) shows them beside the functions, so that who has no other text can read the
lessons. Formulas are LaTeX, in the notation of the lessons: M, h, S, J, A, b, λ = forces of the
ground, τ = torques, q̈ = accelerations.
"""

from __future__ import annotations

from typing import NamedTuple


class Section(NamedTuple):
    """A section of the course text. number: "§2.1" or "App. A". summary: what it is about, in a
    sentence or two.
    """

    number: str
    title: str
    summary: str


class Formula(NamedTuple):
    """An equation of the course text.

    number: "(9)" or "App. A".
    section: the number of the section that it stands in.
    title: what it is, in a few words.
    latex: the formula without its number.
    meaning: what it says, with its symbols, as Markdown.
    """

    number: str
    section: str
    title: str
    latex: str
    meaning: str


SECTIONS = (
    Section(
        "§1", "What a floating base is",
        "A robot that is bolted down can push as it likes: the bolts answer for it. Figure 1 sets "
        "such an arm beside "
        "a quadruped, whose base is held by nothing: from outside only its weight and the forces "
        "of the ground act on it.",
    ),
    Section(
        "§2", "The space of dynamic variables",
        "Which accelerations, torques and contact forces go together. It begins with the "
        "coordinates: a base that has"
        " no motors, and joints that have.",
    ),
    Section(
        "§2.1", "What the ground demands",
        "Contacts enter as conditions on accelerations, and their forces as unknowns.",
    ),
    Section(
        "§2.2", "How q̈, τ and λ hang together",
        "The equations of motion are linear in all three, so whatever they leave free is a flat "
        "space. Where the contacts "
        "are independent it has as many directions as there are motors.",
    ),
    Section(
        "§3", "Costs, moved between spaces",
        "A quadratic cost on one of q̈, τ, λ is a quadratic cost on each of the others.",
    ),
    Section(
        "§3.1", "Steering the centre of mass",
        "The worked example, with the quadruped of Figure 2: forces at the feet that add up to "
        "what the centre of "
        "mass needs, and what to do with the choice that is left.",
    ),
    Section(
        "§4", "Quadratic programming for control",
        "Costs cannot say *never*. Inequalities can, and a solver handles both, in less than a "
        "millisecond.",
    ),
    Section(
        "§4.1", "Control as a quadratic program",
        "All unknowns at once, the equations of motion as constraints, wishes as costs, limits as "
        "inequalities.",
    ),
    Section(
        "§4.2", "Contact forces and friction cones",
        "What friction can hold, as Figure 3 draws it, and how a cone becomes linear rows.",
    ),
    Section(
        "App. A", "Fictitious forces",
        "Where a part of h comes from: coordinates that turn.",
    ),
    Section(
        "App. B", "Torque is an abstraction",
        "What stands behind a torque that a controller asks for.",
    ),
    Section(
        "App. C", "Quadratic programming",
        "What the solver solves, and how an active set finds the answer.",
    ),
)  # fmt: skip

FORMULAS = (
    Formula(
        "(1)", "§1", "fixed-base equations of motion",
        r"M(q)\,\ddot q + h(q,\dot q) = \tau",
        "For a robot that is bolted down: inertia M times the accelerations of the joints, plus "
        "the bias forces h "
        "(gravity, and what "
        "the motion itself does), are the torques τ. Each acceleration has its torque.",
    ),
    Formula(
        "(2)", "§2", "configuration: base and joints",
        r"q = \begin{bmatrix} q_{base} \\ q_{jnt} \end{bmatrix} \in \mathbb{R}^{d+6}",
        "Where a floating robot is: six numbers for the place and orientation of its base, and one "
        "for each of its d joints.",
    ),
    Formula(
        "(3)", "§2", "actuation matrix S",
        r"S\,\tau = \begin{bmatrix} 0 \\ I \end{bmatrix} \tau = \begin{bmatrix} 0 \\ \tau "
        r"\end{bmatrix}",
        "The matrix S says where motors act: the d torques τ enter the rows of the joints, and "
        "nothing enters the six"
        " rows of the base.",
    ),
    Formula(
        "(4)", "§2.1", "floating base, forces at points",
        r"M(q)\,\ddot q + h(q,\dot q) = S\,\tau + J^T \lambda",
        "As (1), for a base that floats: beside the torques, forces λ act at points of the robot, "
        "and the transposed "
        "Jacobian J of these "
        "points says what each of them does to every row. Any λ is allowed here, as from "
        "thrusters.",
    ),
    Formula(
        "(5)", "§2.1", "constraints A q̈ = b",
        r"A(q,\dot q)\,\ddot q = b(q,\dot q)",
        r"What a contact demands of the accelerations. For a point that stays, A is its Jacobian J "
        r"and $b = -\dot J \dot q$.",
    ),
    Formula(
        "(6)", "§2.1", "nonholonomic constraints",
        r"\underbrace{\frac{\partial g}{\partial \dot q}}_{A}\,\ddot q = "
        r"\underbrace{-\frac{\partial g}{\partial "
        r"q}\,\dot q}_{b}",
        r"A condition $g(q,\dot q) = 0$ on velocities, such as that of a wheel that rolls, has the "
        r"form (5) once it is"
        r" differentiated.",
    ),
    Formula(
        "(7)", "§2.1", "constrained equations of motion",
        r"M\,\ddot q + h = S\,\tau + J^T\lambda, \qquad J\,\ddot q = b",
        "The two lines of the course: how forces make motion, and what motion the contacts allow. "
        "Now λ is an "
        "unknown: what the ground "
        "has to do to the robot so that the second line holds.",
    ),
    Formula(
        "(8)", "§2.2", "forces and torques, before solving",
        r"\left(J M^{-1} J^T\right)\lambda = b + J M^{-1}\left(h - S\,\tau\right)",
        "Both lines of (7) in one, without q̈: the matrix on the left says how much a force at the "
        "contacts accelerates them.",
    ),
    Formula(
        "(9)", "§2.2", "forces from torques, ζ",
        r"\lambda = \underbrace{\left(J M^{-1} J^T\right)^{-1}\left(b + J M^{-1}\left(h - "
        r"S\,\tau\right)\right)}_{\zeta(\tau)}",
        "Where the contacts are independent, torques decide the forces of the ground, by an affine "
        "map ζ.",
    ),
    Formula(
        "(10)", "§2.2", "the matrix C",
        r"\underbrace{\begin{bmatrix} J M^{-1} S & J M^{-1} J^T \end{bmatrix}}_{C} \begin{bmatrix} "
        r"\tau \\ \lambda "
        r"\end{bmatrix}"
        r" = b + J M^{-1} h",
        "The same condition (8) as one linear system in torques and forces together, which holds "
        "for any contacts.",
    ),
    Formula(
        "(11)", "§2.2", "all torques and forces that go together",
        r"\begin{bmatrix} \tau \\ \lambda \end{bmatrix} = C^{\dagger}\left(b + J M^{-1} h\right) + "
        r"V_\perp \beta",
        r"All solutions of (10): the smallest one, by the pseudoinverse $C^\dagger$, plus any "
        r"combination β of the "
        r"columns of $V_\perp$, "
        "which span the null space of C.",
    ),
    Formula(
        "(12)", "§2.2", "the matrix B",
        r"\underbrace{\begin{bmatrix} M & -S & -J^T \\ J & 0 & 0 \end{bmatrix}}_{B} "
        r"\begin{bmatrix} \ddot q \\ \tau \\ \lambda \end{bmatrix} = \begin{bmatrix} -h \\ b "
        r"\end{bmatrix}",
        "Both lines of (7) as one linear system in all that is unknown: accelerations, torques, "
        "forces.",
    ),
    Formula(
        "(13)", "§2.2", "all motions that are possible",
        r"\begin{bmatrix} \ddot q \\ \tau \\ \lambda \end{bmatrix} = "
        r"\underbrace{B^{\dagger} \begin{bmatrix} -h \\ b \end{bmatrix}}_{v} + V_\perp \beta",
        r"All solutions of (12): the smallest one, v, and directions, the columns of $V_\perp$, "
        r"which span the null space of "
        "B. Where the contacts are independent there are d, as many as motors. β are the "
        "coordinates of a motion here.",
    ),
    Formula(
        "(14)", "§3", "accelerations from torques, η",
        r"\ddot q = \underbrace{M^{-1}\left(S\,\tau + J^T \zeta(\tau) - h\right)}_{\eta(\tau)}",
        "With the forces of (9) put into (7), torques decide the accelerations, too, by an affine "
        "map η.",
    ),
    Formula(
        "(15)", "§3", "pullback of a cost",
        r"\widetilde Q(\tau) = Q(\eta(\tau))",
        "A quadratic cost Q on accelerations, seen from torques: the cost of torques is the cost "
        "of what they lead to.",
    ),
    Formula(
        "(16)", "§3", "blocks of the space of motions",
        r"\begin{bmatrix} \ddot q \\ \tau \\ \lambda \end{bmatrix} = \begin{bmatrix} v^{\ddot q} "
        r"\\ v^{\tau} \\ "
        r"v^{\lambda} \end{bmatrix}"
        r" + \begin{bmatrix} V_\perp^{\ddot q} \\ V_\perp^{\tau} \\ V_\perp^{\lambda} "
        r"\end{bmatrix} \beta",
        r"The space (13) once more, with v and $V_\perp$ cut into the rows of q̈, of τ and of λ.",
    ),
    Formula(
        "(17)", "§3", "q̈, τ, λ from β",
        r"\ddot q = v^{\ddot q} + V_\perp^{\ddot q}\beta, \qquad \tau = v^{\tau} + "
        r"V_\perp^{\tau}\beta, \qquad "
        r"\lambda = v^{\lambda} + V_\perp^{\lambda}\beta",
        "The rows of (16), one by one: each β is a motion, with its accelerations, torques and "
        "forces.",
    ),
    Formula(
        "(18)", "§3", "a cost on all three, seen from β",
        r"\widetilde Q(\beta) = Q\left(v^{\ddot q} + V_\perp^{\ddot q}\beta,\ v^{\tau} + "
        r"V_\perp^{\tau}\beta,\ "
        r"v^{\lambda} + V_\perp^{\lambda}\beta\right)",
        "A cost on accelerations, torques and forces together is a cost on the numbers β, and "
        "there nothing is left to obey.",
    ),
    Formula(
        "(19)", "§3", "a cost on β, seen from one of them",
        r"Q^{\ddot q}(\ddot q) = \widetilde Q\left(\left(V_\perp^{\ddot "
        r"q}\right)^{\dagger}\left(\ddot q - v^{\ddot "
        r"q}\right)\right)",
        "The way back: the cost that a cost on β is for accelerations alone, by the smallest of "
        "the β that come closest to "
        "them. Likewise for τ and λ.",
    ),
    Formula(
        "(20)", "§3.1", "net force, G_f",
        r"f_c = \sum_i f_i = \underbrace{\begin{bmatrix} I & I & I & I \end{bmatrix}}_{G_f} "
        r"\lambda",
        "The net force of the ground is the sum of the forces at the feet, four of them here. The "
        "weight, which pulls at the "
        "centre of mass, is not among them.",
    ),
    Formula(
        "(21)", "§3.1", "net moment, G_τ",
        r"\tau_c = \sum_i \left(x_i - x_c\right) \times f_i = "
        r"\underbrace{\begin{bmatrix} \mathcal{X}_1 & \mathcal{X}_2 & \mathcal{X}_3 & "
        r"\mathcal{X}_4 "
        r"\end{bmatrix}}_{G_\tau} \lambda",
        r"Their net moment about the centre of mass $x_c$: the cross product of each lever with "
        r"its force $f_i$. "
        r"$\mathcal{X}_i$ is the matrix that does it.",
    ),
    Formula(
        "(22)", "§3.1", "desired wrench as a cost",
        r"\tfrac12 \left\| \tilde f_c - G_f\,\lambda(\tau) \right\|^2 + \tfrac12 \left\| "
        r"\tilde\tau_c - "
        r"G_\tau\,\lambda(\tau) \right\|^2",
        r"How far the torques τ are from producing the net force $\tilde f_c$ and the net moment "
        r"$\tilde\tau_c$ that "
        r"are wanted.",
    ),
    Formula(
        "(23)", "§3.1", "preference among contact forces",
        r"h_i(f_i) = \tfrac12 \left\| \left(I - n_i n_i^T\right) f_i \right\|^2 + "
        r"\tfrac{\alpha}{2} \left\| n_i n_i^T "
        r"f_i - a \right\|^2",
        r"Many forces make the same wrench. This cost chooses: little along the ground, and along "
        r"the normal $n_i$ about the "
        r"force a, a vector along $n_i$. α weighs the two.",
    ),
    Formula(
        "(24)", "§3.1", "torques and forces as two maps",
        r"\begin{bmatrix} \tau \\ \lambda \end{bmatrix} = C^{\dagger}\left(b + J M^{-1} h\right) + "
        r"\begin{bmatrix} V_\perp^{\tau} \\ V_\perp^{\lambda} \end{bmatrix} \beta = "
        r"\begin{bmatrix} f^{\tau}(\beta) \\ f^{\lambda}(\beta) \end{bmatrix}",
        "The space (11), cut into torques and forces: two affine maps of the same β.",
    ),
    Formula(
        "(25)", "§3.1", "smallest torques for desired forces",
        r"\min_{\beta}\ \tfrac12 \left\| f^{\tau}(\beta) \right\|^2 \qquad \text{such that} \qquad "
        r"\lambda = "
        r"f^{\lambda}(\beta)",
        "Of all torques that make the ground push with the forces λ, the smallest. The answer is "
        "affine in λ.",
    ),
    Formula(
        "(26)", "§4.1", "control as a QP: objective",
        r"\min_{\ddot q,\ \tau,\ \lambda}\ \psi(\ddot q, \tau, \lambda)",
        "What the controller wants: a quadratic cost ψ, the sum of its tasks, on accelerations, "
        "torques and forces at once.",
    ),
    Formula(
        "(27)", "§4.1", "control as a QP: constraints",
        r"\text{such that} \qquad M\,\ddot q + h = S\,\tau + J^T\lambda, \qquad J\,\ddot q = b, "
        r"\qquad G\,x \le u",
        r"What it must obey: the equations of motion (7), and inequalities on $x = (\ddot q, \tau, "
        r"\lambda)$, such as "
        r"friction cones and the "
        "limits of motors and joints. Other linear equalities may stand with them.",
    ),
    Formula(
        "(28)", "§4.2", "friction cone",
        r"\alpha_\parallel \le \mu\,\alpha_\perp",
        r"A contact holds as long as the force along the ground, $\alpha_\parallel$, is at most μ "
        r"times the force "
        r"along the normal, "
        r"$\alpha_\perp$. All forces that do so form a cone.",
    ),
    Formula(
        "App. A", "App. A", "fictitious forces",
        r"h(q,\dot q) = \underbrace{C(q,\dot q)\,\dot q}_{\text{Coriolis, centrifugal}} + g(q)",
        "What h holds without friction: gravity g, and the forces that appear only because "
        "coordinates turn with the robot. "
        "Those depend on q and q̇, and never on accelerations. h stands on the left of (1): what "
        "acts on the robot is −C q̇ and "
        "−g. The appendix has no formula; this is the one of the lesson.",
    ),
    Formula(
        "App. B", "App. B", "torque is an abstraction",
        r"\tau_d \ \longrightarrow\ \text{valve} \ \longrightarrow\ \text{pressure} \ "
        r"\longrightarrow\ \tau",
        r"A controller asks for $\tau_d$; a faster loop below it opens a valve or sets a current "
        r"until the measured "
        r"torque τ is about that. "
        "The appendix has no formula; this is its chain.",
    ),
    Formula(
        "App. C", "App. C", "quadratic programming",
        r"\min_x\ \psi(x) \qquad \text{such that} \qquad g_i(x) = 0, \qquad h_j(x) \le 0",
        "The least of a quadratic cost ψ among the points that linear equalities $g_i$ and "
        "inequalities $h_j$ leave. "
        "At the answer each "
        "inequality either holds with equality, and is *active*, or may as well be left out.",
    ),
)  # fmt: skip

NOTES = {
    1: "h takes fictitious forces, gravity and friction together.",
    2: "Passive dynamics: what the robot would do without torques.",
    3: "No fixed point of the base is always the centre of mass, which moves when joints move.",
    4: "Joints may also slide; the mathematics is the same.",
    5: "A Jacobian is the matrix of partial derivatives.",
    6: "Constraints may depend on time as well.",
    7: "λ are Lagrange multipliers: forces on the robot, and minus what the robot does to the "
    "ground.",
    8: "The singular value decomposition is not the fastest way to these spaces, but a robust and "
    "clear one.",
    9: "A point foot gives a force and no moment; feet with area, as a humanoid's, give both.",
    10: "Internal forces cancel: the sum of the external forces and the sum of their moments are "
    "all that moves the whole.",
    11: "A normal has length one and points out of the ground.",
    12: "Solvers begin with the answer of the tick before, a warm start.",
    13: "One may work on the equations first, to be quicker; a fast solver does without.",
    14: "A polyhedron is what several half-spaces have in common.",
    15: "Whatever does not accelerate is at rest in some inertial frame.",
}
