r"""The sections, equations and notes of the course text, each with an explanatory sentence.

The page of equations shows them beside the functions, so that readers without the text can follow.
Formulas are LaTeX in the notation of the lessons: M, h, S, J, A, b, λ = contact forces,
τ = torques, q̈ = accelerations.
"""

from __future__ import annotations

from typing import NamedTuple


class Section(NamedTuple):
    """A section of the course text, such as "§2.1" or "App. A", with a summary."""

    number: str
    title: str
    summary: str


class Formula(NamedTuple):
    """An equation of the course text."""

    number: str
    section: str
    title: str
    latex: str
    meaning: str


SECTIONS = (
    Section(
        "§1", "What a floating base is",
        "An arm that is bolted to the ground can push as hard as its motors allow, because the "
        "bolts push back. Figure 1 compares such an arm with a quadruped. Nothing holds the "
        "quadruped's base: the only external forces on it are its weight and the contact forces.",
    ),
    Section(
        "§2", "The space of dynamic variables",
        "Which accelerations, torques and contact forces are compatible. The section begins with "
        "the coordinates: a base without motors, and joints with motors.",
    ),
    Section(
        "§2.1", "Constraints from contacts",
        "A contact constrains the accelerations of the robot. Its force is an unknown.",
    ),
    Section(
        "§2.2", "Relations between q̈, τ and λ",
        "The equations of motion are linear in q̈, τ and λ, so their solutions form an affine "
        "space. If the contacts are independent, its dimension is the number of motors.",
    ),
    Section(
        "§3", "Pullback of costs",
        "A quadratic cost on one of q̈, τ and λ defines a quadratic cost on each of the others.",
    ),
    Section(
        "§3.1", "Controlling the centre of mass",
        "The worked example, with the quadruped of Figure 2: choose contact forces whose "
        "resultant moves the centre of mass as desired, and use the remaining freedom.",
    ),
    Section(
        "§4", "Quadratic programming for control",
        "A cost cannot forbid anything. Inequality constraints can, and a solver handles both in "
        "less than a millisecond.",
    ),
    Section(
        "§4.1", "Control as a quadratic program",
        "All unknowns are optimized at once. The equations of motion are equality constraints, "
        "tasks are costs, and limits are inequality constraints.",
    ),
    Section(
        "§4.2", "Contact forces and friction cones",
        "Which forces friction allows, as in Figure 3, and how a cone is approximated by linear "
        "inequalities.",
    ),
    Section(
        "App. A", "Fictitious forces",
        "The part of h that comes from rotating coordinates.",
    ),
    Section(
        "App. B", "Torque is an abstraction",
        "How an actuator produces the torque that a controller requests.",
    ),
    Section(
        "App. C", "Quadratic programming",
        "What a QP solver solves, and how an active-set method finds the solution.",
    ),
)  # fmt: skip

FORMULAS = (
    Formula(
        "(1)", "§1", "fixed-base equations of motion",
        r"M(q)\,\ddot q + h(q,\dot q) = \tau",
        "For a robot that is bolted to the ground: the inertia matrix M times the joint "
        "accelerations, plus the bias forces h (gravity and velocity-dependent terms), equals "
        "the joint torques τ. Each acceleration has its own torque.",
    ),
    Formula(
        "(2)", "§2", "configuration: base and joints",
        r"q = \begin{bmatrix} q_{base} \\ q_{jnt} \end{bmatrix} \in \mathbb{R}^{d+6}",
        "The configuration of a floating-base robot: six numbers for the position and "
        "orientation of its base, and one for each of its d joints.",
    ),
    Formula(
        "(3)", "§2", "actuation matrix S",
        r"S\,\tau = \begin{bmatrix} 0 \\ I \end{bmatrix} \tau = \begin{bmatrix} 0 \\ \tau "
        r"\end{bmatrix}",
        "The matrix S maps the d joint torques to generalized forces. The torques enter the "
        "joint rows, and the six base rows are zero.",
    ),
    Formula(
        "(4)", "§2.1", "floating-base equations of motion with forces at points",
        r"M(q)\,\ddot q + h(q,\dot q) = S\,\tau + J^T \lambda",
        "As eq. (1), for a floating base. In addition to the torques, forces λ act at points of "
        "the robot, and the transposed Jacobian J of these points maps them to generalized "
        "forces. Here λ may be any force, for example that of a thruster.",
    ),
    Formula(
        "(5)", "§2.1", "acceleration constraint A q̈ = b",
        r"A(q,\dot q)\,\ddot q = b(q,\dot q)",
        r"What a contact requires of the accelerations. For a point that does not move, A is its "
        r"Jacobian J and $b = -\dot J \dot q$.",
    ),
    Formula(
        "(6)", "§2.1", "nonholonomic constraints",
        r"\underbrace{\frac{\partial g}{\partial \dot q}}_{A}\,\ddot q = "
        r"\underbrace{-\frac{\partial g}{\partial q}\,\dot q}_{b}",
        r"A constraint $g(q,\dot q) = 0$ on velocities, such as rolling without slipping, has "
        r"the form of eq. (5) after differentiation with respect to time.",
    ),
    Formula(
        "(7)", "§2.1", "constrained equations of motion",
        r"M\,\ddot q + h = S\,\tau + J^T\lambda, \qquad J\,\ddot q = b",
        "The central equations of the course: forces cause motion, and the contacts constrain "
        "it. The contact force λ is now an unknown. Its value is the force that the ground must "
        "exert for the second equation to hold.",
    ),
    Formula(
        "(8)", "§2.2", "forces and torques, before solving",
        r"\left(J M^{-1} J^T\right)\lambda = b + J M^{-1}\left(h - S\,\tau\right)",
        "Both equations of (7) combined, with q̈ eliminated. The matrix on the left-hand side "
        "maps contact forces to the accelerations that they cause at the contacts.",
    ),
    Formula(
        "(9)", "§2.2", "forces from torques, ζ",
        r"\lambda = \underbrace{\left(J M^{-1} J^T\right)^{-1}\left(b + J M^{-1}\left(h - "
        r"S\,\tau\right)\right)}_{\zeta(\tau)}",
        "If the contacts are independent, the torques determine the contact forces through the "
        "affine map ζ.",
    ),
    Formula(
        "(10)", "§2.2", "the matrix C",
        r"\underbrace{\begin{bmatrix} J M^{-1} S & J M^{-1} J^T \end{bmatrix}}_{C} "
        r"\begin{bmatrix} \tau \\ \lambda \end{bmatrix} = b + J M^{-1} h",
        "The condition (8) as one linear system in torques and forces. It holds for any contacts.",
    ),
    Formula(
        "(11)", "§2.2", "all compatible torques and forces",
        r"\begin{bmatrix} \tau \\ \lambda \end{bmatrix} = C^{\dagger}\left(b + J M^{-1} h\right) "
        r"+ V_\perp \beta",
        r"All solutions of eq. (10): the minimum-norm solution, from the pseudoinverse "
        r"$C^\dagger$, plus any linear combination β of the columns of $V_\perp$, which span the "
        r"null space of C.",
    ),
    Formula(
        "(12)", "§2.2", "the matrix B",
        r"\underbrace{\begin{bmatrix} M & -S & -J^T \\ J & 0 & 0 \end{bmatrix}}_{B} "
        r"\begin{bmatrix} \ddot q \\ \tau \\ \lambda \end{bmatrix} = \begin{bmatrix} -h \\ b "
        r"\end{bmatrix}",
        "Both equations of (7) as one linear system in all unknowns: accelerations, torques and "
        "forces.",
    ),
    Formula(
        "(13)", "§2.2", "all possible motions",
        r"\begin{bmatrix} \ddot q \\ \tau \\ \lambda \end{bmatrix} = \underbrace{B^{\dagger} "
        r"\begin{bmatrix} -h \\ b \end{bmatrix}}_{v} + V_\perp \beta",
        r"All solutions of eq. (12): the minimum-norm solution v plus any linear combination β "
        r"of the columns of $V_\perp$, which span the null space of B. If the contacts are "
        r"independent, there are d columns, one per motor.",
    ),
    Formula(
        "(14)", "§3", "accelerations from torques, η",
        r"\ddot q = \underbrace{M^{-1}\left(S\,\tau + J^T \zeta(\tau) - h\right)}_{\eta(\tau)}",
        "With the forces of eq. (9) inserted into eq. (7), the torques determine the "
        "accelerations through the affine map η.",
    ),
    Formula(
        "(15)", "§3", "pullback of a cost",
        r"\widetilde Q(\tau) = Q(\eta(\tau))",
        "The pullback of a quadratic cost Q on accelerations to torques: the cost of a torque is "
        "the cost of the acceleration that it causes.",
    ),
    Formula(
        "(16)", "§3", "blocks of the space of motions",
        r"\begin{bmatrix} \ddot q \\ \tau \\ \lambda \end{bmatrix} = \begin{bmatrix} v^{\ddot q} "
        r"\\ v^{\tau} \\ v^{\lambda} \end{bmatrix} + \begin{bmatrix} V_\perp^{\ddot q} \\ "
        r"V_\perp^{\tau} \\ V_\perp^{\lambda} \end{bmatrix} \beta",
        r"Equation (13) with v and $V_\perp$ split into the rows of q̈, τ and λ.",
    ),
    Formula(
        "(17)", "§3", "q̈, τ and λ from β",
        r"\ddot q = v^{\ddot q} + V_\perp^{\ddot q}\beta, \qquad \tau = v^{\tau} + "
        r"V_\perp^{\tau}\beta, \qquad \lambda = v^{\lambda} + V_\perp^{\lambda}\beta",
        "The block rows of eq. (16): each β gives one motion, with its accelerations, torques "
        "and forces.",
    ),
    Formula(
        "(18)", "§3", "pullback of a cost on q̈, τ and λ to β",
        r"\widetilde Q(\beta) = Q\left(v^{\ddot q} + V_\perp^{\ddot q}\beta,\ v^{\tau} + "
        r"V_\perp^{\tau}\beta,\ v^{\lambda} + V_\perp^{\lambda}\beta\right)",
        "A cost on accelerations, torques and forces becomes a cost on β. The problem in β has "
        "no equality constraints.",
    ),
    Formula(
        "(19)", "§3", "a cost on β as a cost on q̈",
        r"Q^{\ddot q}(\ddot q) = \widetilde Q\left(\left(V_\perp^{\ddot "
        r"q}\right)^{\dagger}\left(\ddot q - v^{\ddot q}\right)\right)",
        "The opposite direction: a cost on β as a cost on accelerations alone. Among the β that "
        "come closest to them, the pseudoinverse selects the one with minimum norm. Likewise for "
        "τ and λ.",
    ),
    Formula(
        "(20)", "§3.1", "net force, G_f",
        r"f_c = \sum_i f_i = \underbrace{\begin{bmatrix} I & I & I & I \end{bmatrix}}_{G_f} "
        r"\lambda",
        "The net contact force is the sum of the forces at the feet, four in this example. The "
        "weight is not part of this sum.",
    ),
    Formula(
        "(21)", "§3.1", "net moment, G_τ",
        r"\tau_c = \sum_i \left(x_i - x_c\right) \times f_i = \underbrace{\begin{bmatrix} "
        r"\mathcal{X}_1 & \mathcal{X}_2 & \mathcal{X}_3 & \mathcal{X}_4 \end{bmatrix}}_{G_\tau} "
        r"\lambda",
        r"The net moment of the contact forces about the centre of mass $x_c$: the sum of the "
        r"cross products of the lever arms with the forces $f_i$. $\mathcal{X}_i$ is the "
        r"cross-product matrix of lever arm i.",
    ),
    Formula(
        "(22)", "§3.1", "desired wrench as a cost",
        r"\tfrac12 \left\| \tilde f_c - G_f\,\lambda(\tau) \right\|^2 + \tfrac12 \left\| "
        r"\tilde\tau_c - G_\tau\,\lambda(\tau) \right\|^2",
        r"The squared error between the desired net force $\tilde f_c$ and net moment "
        r"$\tilde\tau_c$ and those that the torques τ produce.",
    ),
    Formula(
        "(23)", "§3.1", "preference among contact forces",
        r"h_i(f_i) = \tfrac12 \left\| \left(I - n_i n_i^T\right) f_i \right\|^2 + "
        r"\tfrac{\alpha}{2} \left\| n_i n_i^T f_i - a \right\|^2",
        "Many contact forces give the same wrench. This cost selects among them: it penalizes "
        "the tangential force, and the deviation of the normal force from the vector a along the "
        "normal $n_i$. The weight α balances the two terms.",
    ),
    Formula(
        "(24)", "§3.1", "torques and forces as two maps",
        r"\begin{bmatrix} \tau \\ \lambda \end{bmatrix} = C^{\dagger}\left(b + J M^{-1} h\right) "
        r"+ \begin{bmatrix} V_\perp^{\tau} \\ V_\perp^{\lambda} \end{bmatrix} \beta = "
        r"\begin{bmatrix} f^{\tau}(\beta) \\ f^{\lambda}(\beta) \end{bmatrix}",
        "The space of eq. (11) split into torques and forces: two affine maps of the same β.",
    ),
    Formula(
        "(25)", "§3.1", "minimum torques for desired forces",
        r"\min_{\beta}\ \tfrac12 \left\| f^{\tau}(\beta) \right\|^2 \qquad \text{such that} "
        r"\qquad \lambda = f^{\lambda}(\beta)",
        "The minimum-norm torques among those that produce the contact forces λ. The solution is "
        "affine in λ.",
    ),
    Formula(
        "(26)", "§4.1", "control as a QP: objective",
        r"\min_{\ddot q,\ \tau,\ \lambda}\ \psi(\ddot q, \tau, \lambda)",
        "The objective of the controller: a quadratic cost ψ, the sum of its task costs, on "
        "accelerations, torques and forces.",
    ),
    Formula(
        "(27)", "§4.1", "control as a QP: constraints",
        r"\text{such that} \qquad M\,\ddot q + h = S\,\tau + J^T\lambda, \qquad J\,\ddot q = b, "
        r"\qquad G\,x \le u",
        r"The constraints of the controller: the equations of motion (7), and inequalities on $x "
        r"= (\ddot q, \tau, \lambda)$, such as friction cones and the limits of motors and "
        r"joints. Further linear equality constraints may be added.",
    ),
    Formula(
        "(28)", "§4.2", "friction cone",
        r"\alpha_\parallel \le \mu\,\alpha_\perp",
        r"A contact does not slip as long as the tangential force $\alpha_\parallel$ is at most "
        r"μ times the normal force $\alpha_\perp$. The forces that satisfy this condition form a "
        r"cone.",
    ),
    Formula(
        "App. A", "App. A", "fictitious forces",
        r"h(q,\dot q) = \underbrace{C(q,\dot q)\,\dot q}_{\text{Coriolis, centrifugal}} + g(q)",
        "What h contains without friction: gravity g, and the forces that appear because the "
        "coordinates rotate with the robot. They depend on q and q̇, but not on accelerations. "
        "Since h is on the left-hand side of eq. (1), the forces on the robot are −C q̇ and −g. "
        "The appendix has no formula; this one is from the lesson.",
    ),
    Formula(
        "App. B", "App. B", "torque is an abstraction",
        r"\tau_d \ \longrightarrow\ \text{valve} \ \longrightarrow\ \text{pressure} \ "
        r"\longrightarrow\ \tau",
        r"A controller requests $\tau_d$. A faster inner loop opens a valve or sets a current "
        r"until the measured torque τ is close to it. The appendix has no formula; this is its "
        r"signal chain.",
    ),
    Formula(
        "App. C", "App. C", "quadratic programming",
        r"\min_x\ \psi(x) \qquad \text{such that} \qquad g_i(x) = 0, \qquad h_j(x) \le 0",
        "The minimum of a quadratic cost ψ over the points that satisfy linear equality "
        "constraints $g_i$ and inequality constraints $h_j$. At the solution, each inequality "
        "either holds with equality and is *active*, or could be removed without changing the "
        "solution.",
    ),
)  # fmt: skip

NOTES = {
    1: "h combines fictitious forces, gravity and friction.",
    2: "Passive dynamics: the motion of the robot without torques.",
    3: "No fixed point of the base is always the centre of mass, because the centre of mass moves "
    "when the joints move.",
    4: "Joints may also be prismatic. The mathematics is the same.",
    5: "A Jacobian is the matrix of partial derivatives.",
    6: "Constraints may also depend on time.",
    7: "The λ are Lagrange multipliers. They are the forces on the robot; the forces on the ground "
    "have the opposite sign.",
    8: "The singular value decomposition is not the fastest way to compute these spaces, but it is "
    "robust and clear.",
    9: "A point foot exerts a force but no moment. A foot with area, such as that of a humanoid, "
    "exerts both.",
    10: "Internal forces cancel: the motion of the robot as a whole depends only on the sums of "
    "the external forces and of their moments.",
    11: "A normal is a unit vector that points out of the ground.",
    12: "Solvers start from the solution of the previous control step (warm start).",
    13: "The equations can be reduced first to save time. A fast solver does not need this.",
    14: "A polyhedron is the intersection of half-spaces.",
    15: "Anything that does not accelerate is at rest in some inertial frame.",
}
