"""Whole-body control of a legged robot: the whole idea in one file.

A quadruped stands on the ground. Nothing holds its base, so its motors can accelerate its centre of
mass only by making the ground push back. Every 2 ms, a small optimization problem gives the twelve
motor torques. The robot stands in the simulator MuJoCo, is pushed away, and returns.

    pip install numpy pin daqp mujoco example-robot-data-loaders
    python examples/wbc.py

Read from top to bottom. (7) means equation 7 of the course text *Controlling Floating-Based
Robots*, and (k, nv) is a shape. The controller in section 8 uses sections 2 and 4 to 7. Section 3
and the pullback in section 5 explain it. Equations (19) and (22) to (25) are not used.

Symbols: configuration q, velocity v (q̇ in the text), acceleration q̈ (`qdd`), joint torques τ
(`tau`), and forces λ (`forces`) of the ground on the feet. SI units throughout.
"""

import daqp
import example_robot_data
import mujoco
import numpy as np
import pinocchio as pin

# === 1. The robot =================================================================================
# The configuration of a floating-base robot is the pose of its base and its d joint angles, (2).
# Pinocchio writes the pose as a position and a quaternion x y z w, so q has 7 + d entries. The
# velocity v has 6 + d: the base's linear velocity, its angular velocity, and the joint velocities.
# Both velocities of the base are in the base's own axes. The acceleration q̈ is the derivative of v.

robot, _, URDF_FILE, _ = example_robot_data.load_full("go2")  # a quadruped of 16 kg
model, data = robot.model, robot.data

FEET = ["FL_foot", "FR_foot", "RL_foot", "RR_foot"]  # frames at the centres of the ball feet
RADIUS = 0.022  # of the balls [m]
MU = 0.7  # coefficient of friction that the controller relies on; MuJoCo's ground has 1

nv = model.nv  # 18 entries of v and q̈
d = nv - 6  # 12 entries of τ
k = 3 * len(FEET)  # 12 entries of λ: a force in world axes for each foot
n = nv + d + k  # 42 unknowns

Q_GOAL = robot.q0.copy()  # a standing posture, shifted until the feet touch the ground z = 0
pin.framesForwardKinematics(model, data, Q_GOAL)
Q_GOAL[2] += RADIUS - min(data.oMf[model.getFrameId(foot)].translation[2] for foot in FEET)


# === 2. Equations of motion =======================================================================
# A robot whose base is bolted to the ground obeys M q̈ + h = τ, (1). Here M is the inertia matrix,
# and h holds gravity, Coriolis and centrifugal forces. For any q̈, (1) gives the torques that
# produce it. A floating base adds six equations without motors, so S has zeros in six rows, (3).
# Contact forces take the place of the bolts. They enter through the Jacobian J of the contact
# points, (4). A foot may roll but not slip: at its lowest point, the ball's velocity J v is zero.
# Differentiating gives J q̈ + J̇ v = 0, which is linear in q̈, (5), (6). In all:
#
#     M q̈ + h = S τ + Jᵀ λ
#         J q̈ = b   with   b = -J̇ v                                                            (7)
def equations_of_motion(q, v):
    """Return M (nv, nv), h (nv,), S (nv, d), J (k, nv) and b (k,) of (7)."""
    M = pin.crba(model, data, q)
    h = pin.nonLinearEffects(model, data, q, v)
    S = np.vstack([np.zeros((6, d)), np.eye(d)])
    _, J, drift = contact_points(q, v)
    return M, h, S, J, -drift


def contact_points(q, v):
    """Return the contact points (4, 3), J (k, nv) of the balls' material points there, and J̇ v."""
    pin.computeJointJacobians(model, data, q)
    pin.forwardKinematics(model, data, q, v, np.zeros(nv))  # with q̈ = 0, accelerations are J̇ v
    pin.updateFramePlacements(model, data)
    down = np.array([0.0, 0.0, -RADIUS])  # to the lowest point; constant in world axes
    points, jacobians, drifts = [], [], []
    for frame in map(model.getFrameId, FEET):
        J = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        a = pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        points.append(data.oMf[frame].translation + down)
        jacobians.append(J[:3] - pin.skew(down) @ J[3:])  # gives the velocity v + ω × down
        drifts.append(a.linear + np.cross(a.angular, down))  # its derivative, a + α × down
    return np.array(points), np.vstack(jacobians), np.concatenate(drifts)


# === 3. Torques determine contact forces ==========================================================
# We choose the torques, and the ground answers with contact forces. To find these forces, solve the
# first line of (7) for q̈ and insert it into the second line:
#
#     J M⁻¹ S τ + J M⁻¹ Jᵀ λ = b + J M⁻¹ h                                                 (8), (10)
#
# Near standing, J has full rank, so J M⁻¹ Jᵀ has an inverse. Hence the forces are a function of the
# torques, λ = ζ(τ), (9), and by (7) so are the accelerations, q̈ = η(τ), (14). Both are affine; we
# write A x + a as (A, a). (7) assumes that all feet stick, so λ may pull or slip: see section 7.
def zeta(eom):
    """Return ζ of (9), from torques to contact forces, as a pair of shapes (k, d) and (k,)."""
    M, h, S, J, b = eom
    on_tau, on_forces = J @ np.linalg.solve(M, S), J @ np.linalg.solve(M, J.T)
    a = np.linalg.solve(on_forces, b + J @ np.linalg.solve(M, h))
    return -np.linalg.solve(on_forces, on_tau), a


def eta(eom):
    """Return η of (14), from torques to accelerations, as a pair of shapes (nv, d) and (nv,)."""
    M, h, S, J, _ = eom
    Z, z = zeta(eom)
    return np.linalg.solve(M, S + J.T @ Z), np.linalg.solve(M, J.T @ z - h)


# === 4. The space of motions ======================================================================
# (7) is a linear system B x = r for all unknowns x = (q̈, τ, λ), (12). Its solutions are a
# particular solution x₀ (v in the text) plus the null space of B, which V (V_⊥ there) spans:
#
#     x = V β + x₀                                                                       (13), (16)
#
# Each β gives a solution of (7), and each solution has exactly one β. The blocks of V and x₀ give
# q̈, τ and λ separately, (17). β has d entries, one for each motor. (11) solves (10) likewise.
def motion_system(eom):
    """Return the matrix B (nv + k, n) and the right-hand side r (nv + k,) of (12)."""
    M, h, S, J, b = eom
    return np.block([[M, -S, -J.T], [J, np.zeros((k, d + k))]]), np.concatenate([-h, b])


def all_solutions(B, r):
    """Return V and x₀ such that the solutions of B x = r are V β + x₀, as in (13)."""
    U, sigma, Vt = np.linalg.svd(B)
    rank = np.sum(sigma > 1e-10 * sigma[0])
    x0 = Vt[:rank].T @ ((U.T @ r)[:rank] / sigma[:rank])  # the pseudo-inverse of B times r
    return Vt[rank:].T, x0


# === 5. Costs =====================================================================================
# A quadratic cost ½ xᵀ H x + gᵀ x + c, written as (H, g, c), says how undesirable x is. If x is an
# affine function of y, a cost on x is also a cost on y, called the pullback. With η, costs on q̈
# become costs on τ, (15). With (13), costs on q̈, τ and λ become costs on β, (18).
def squared_error(A, target, weight=1.0):
    """Return the cost ½ weight ‖A x - target‖² on x."""
    return weight * A.T @ A, -weight * A.T @ target, 0.5 * weight * target @ target


def value(cost, x):
    """Return the value of a cost at x."""
    H, g, c = cost
    return 0.5 * x @ H @ x + g @ x + c


def pullback(cost, A, a):
    """Return the cost on y that a cost on x = A y + a becomes, (15), (18)."""
    H, g, _ = cost
    return A.T @ H @ A, A.T @ (H @ a + g), value(cost, a)


# === 6. The centre of mass ========================================================================
# Only gravity and the contact forces change the robot's total momentum. The contact forces have a
# sum f_c = G_f λ, (20), and a moment τ_c = G_τ λ about the centre of mass, (21). These are six
# numbers, but λ has twelve. In the other six dimensions, the feet push against each other.
def centre_of_mass(q, v):
    """Return the centre of mass, its velocity, Jacobian (3, nv) and J̇ v (3,), in world axes."""
    J = pin.jacobianCenterOfMass(model, data, q)
    pin.centerOfMass(model, data, q, v, np.zeros(nv))
    return data.com[0].copy(), data.vcom[0].copy(), J, data.acom[0].copy()


def wrench_matrices(q, v):
    """Return G_f (3, k) of (20) and G_τ (3, k) of (21)."""
    arms = contact_points(q, v)[0] - centre_of_mass(q, v)[0]
    return np.hstack([np.eye(3) for _ in arms]), np.hstack([pin.skew(arm) for arm in arms])


# === 7. Friction ==================================================================================
# The ground pushes and never pulls. Friction holds a foot as long as the tangential part of its
# force is at most μ times the normal part, α_∥ ≤ μ α_⊥, (28). Such forces form a cone. A QP needs
# linear inequalities, so we replace the cone with a four-sided pyramid inside it.
def friction_pyramid():
    """Return G (4, 3), where G f ≤ 0 says that a force f on level ground is in the pyramid."""
    slope = MU / np.sqrt(2)  # of the four sides, so that the four edges lie on the cone
    return np.array([[1, 0, -slope], [0, 1, -slope], [-1, 0, -slope], [0, -1, -slope]])


# === 8. The controller ============================================================================
# A quadratic program (QP) finds the least costly motion among the possible ones:
#
#     minimize   ψ(q̈, τ, λ)                                                                    (26)
#     subject to (7), forces in their pyramids, and torques within the limits                   (27)
#
# The goal is to stand. For each error, the desired acceleration is that of a spring and a damper.
# Centre of mass and orientation use all 18 - 12 accelerations that four standing feet leave. The
# joint angles have a small weight: they count if limits prevent the others. The cost on τ and λ
# chooses one of many λ with the same q̈. We solve for 42 entries of x; section 9 for the 12 of β.

COM_GOAL = centre_of_mass(Q_GOAL, np.zeros(nv))[0]
KP, KD = 100.0, 20.0  # stiffness [1/s²] and damping [1/s]; 2 √KP is critical damping


def objective(q, v):
    """Return the cost ψ of (26) on x = (q̈, τ, λ)."""
    com, com_velocity, J, drift = centre_of_mass(q, v)
    com_target = -KP * (com - COM_GOAL) - KD * com_velocity
    qdd_target = -KP * pin.difference(model, Q_GOAL, q) - KD * v  # errors in the order of v
    rows = np.eye(n)  # rows[:nv] @ x is q̈
    costs = [
        squared_error(J @ rows[:nv], com_target - drift, weight=10.0),  # ẍ_c = J q̈ + J̇ v
        squared_error(rows[3:6], qdd_target[3:6], weight=10.0),  # orientation of the base
        squared_error(rows[6:nv], qdd_target[6:], weight=1e-3),  # joint angles
        squared_error(rows[nv:], np.zeros(d + k), weight=1e-5),  # torques and forces
    ]
    return [sum(parts) for parts in zip(*costs, strict=True)]  # all H, all g and all c added


def inequalities():
    """Return G (16 + d, n), lower and upper of lower ≤ G x ≤ upper: pyramids, torque limits."""
    pyramids = np.kron(np.eye(len(FEET)), friction_pyramid())  # (16, k), a block for each foot
    G = np.vstack([np.hstack([np.zeros((16, nv + d)), pyramids]), np.eye(n)[nv : nv + d]])
    limits = model.effortLimit[6:]
    return G, np.append(np.full(16, -np.inf), -limits), np.append(np.zeros(16), limits)


def solve_qp(cost, B, r, G, lower, upper):
    """Return the x of least cost with B x = r and lower ≤ G x ≤ upper."""
    H, g, _ = cost
    kinds = np.repeat([5, 0], [len(B), len(G)]).astype(np.int32)  # 5 is an equality for DAQP
    upper, lower = np.append(r, upper), np.append(r, lower)
    x, _, status, _ = daqp.solve(H, g, np.vstack([B, G]), upper, lower, kinds)
    if status < 1:
        raise RuntimeError(f"The QP has no solution (status {status} of DAQP).")
    return x


def control(q, v):
    """Return the q̈, τ and λ that solve (26) and (27)."""
    B, r = motion_system(equations_of_motion(q, v))
    return np.split(solve_qp(objective(q, v), B, r, *inequalities()), [nv, nv + d])


# === 9. Checks ====================================================================================
# Wrong signs, frames and transposes hide well, so the program tests the equations.
def check(claim, left, right):
    """Print a claim if two arrays agree to six digits, and stop otherwise."""
    np.testing.assert_allclose(left, right, rtol=1e-6, atol=1e-6, err_msg=claim)
    print("  " + claim)


def check_dynamics(q, v, eom, x, tau, beta, dt=1e-6):
    """Check J̇ v by finite differences, (7) for any τ and β, and the laws of Newton and Euler."""
    before, after = pin.integrate(model, q, -dt * v), pin.integrate(model, q, dt * v)
    feet = contact_points(after, v)[1] - contact_points(before, v)[1]
    com = centre_of_mass(after, v)[2] - centre_of_mass(before, v)[2]
    drifts = np.append(contact_points(q, v)[2], centre_of_mass(q, v)[3])
    check("(5), (6)       J̇ v is the change of J v", drifts, np.vstack([feet, com]) @ v / (2 * dt))
    (Z, z), (E, e), (B, r) = zeta(eom), eta(eom), motion_system(eom)
    motion = np.concatenate([E @ tau + e, tau, Z @ tau + z])
    check("(7)-(10), (14) any τ, with λ = ζ(τ) and q̈ = η(τ), satisfies (7)", B @ motion, r)
    V, x0 = all_solutions(B, r)
    check("(12)-(17)      any β gives q̈, τ and λ that satisfy (7)", B @ (V @ beta + x0), r)
    (G_f, G_tau), (qdd, _, forces) = wrench_matrices(q, v), np.split(x, [nv, nv + d])
    weight = pin.computeTotalMass(model) * model.gravity.linear
    rate = pin.computeCentroidalMomentumTimeVariation(model, data, q, v, qdd)
    check("(20)           G_f λ and weight change the momentum", G_f @ forces + weight, rate.linear)
    check("(21)           G_τ λ changes the angular momentum", G_tau @ forces, rate.angular)


def check_costs(eom, psi, x, tau, beta):
    """Check pullbacks, and that x solves the QP in β, which needs no equality constraints."""
    (E, e), (V, x0) = eta(eom), all_solutions(*motion_system(eom))
    cost = squared_error(np.eye(nv), np.ones(nv))
    on_tau, on_beta = pullback(cost, E, e), pullback(psi, V, x0)
    check("(15)           a cost on q̈ is a cost on τ", value(on_tau, tau), value(cost, E @ tau + e))
    check("(18)           ψ is a cost on β", value(on_beta, beta), value(psi, V @ beta + x0))
    (G, lower, upper), no_equality = inequalities(), (np.zeros((0, d)), np.zeros(0))
    best = solve_qp(on_beta, *no_equality, G @ V, lower - G @ x0, upper - G @ x0)
    check("(26), (27)     the QP in β has the same solution", V @ best + x0, x)


# === 10. Simulation ===============================================================================
# MuJoCo reads the same URDF file, but shares no code with the equations above. One ball per foot
# replaces all shapes. As in (7), the joints have no friction, damping or rotor inertia. Unlike in
# (7), the contacts are a little soft.

TIMESTEP = 0.002  # of the simulation and of the controller [s]
PUSH, START, END = 100.0, 0.5, 0.6  # force on the base to the left [N], from when to when [s]


def mujoco_model():
    """Return the robot on level ground."""
    spec = mujoco.MjSpec.from_file(URDF_FILE)
    for part in [*spec.geoms, *spec.meshes]:
        spec.delete(part)
    spec.option.timestep = TIMESTEP
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 100  # stiff friction, so that feet do not creep
    spec.default.geom.solref = [0.004, 1.0]  # the stiffest contacts for this timestep
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    spec.body("base").add_freejoint()
    for foot in FEET:
        spec.body(foot).add_geom(name=foot, size=[RADIUS, 0, 0], mass=0)  # a sphere
    return spec.compile()


def read_state(sim):
    """Return q and v. MuJoCo has the quaternion w x y z and the linear velocity in world axes."""
    q, v = sim.qpos.copy(), sim.qvel.copy()
    q[3:7] = q[[4, 5, 6, 3]]
    v[:3] = pin.XYZQUATToSE3(q[:7]).rotation.T @ v[:3]
    return q, v


def measured_forces(world, sim):
    """Return the contact forces (k,) of MuJoCo's last step, in world axes."""
    forces, force = np.zeros((len(FEET), 3)), np.zeros(6)
    for i, contact in enumerate(sim.contact):
        mujoco.mj_contactForce(world, sim, i, force)  # in the axes of the contact
        foot = world.geom(contact.geom2).name
        forces[FEET.index(foot)] = contact.frame.reshape(3, 3).T @ force[:3]
    return forces.ravel()


def simulate(duration):
    """Return the displacements of the centre of mass (N, 3) [m] and the errors of λ (N, k) [N]."""
    world, path, errors = mujoco_model(), [], []
    sim = mujoco.MjData(world)
    sim.qpos[:] = Q_GOAL
    sim.qpos[3:7] = Q_GOAL[[6, 3, 4, 5]]
    while sim.time < duration:
        q, v = read_state(sim)
        path.append(centre_of_mass(q, v)[0] - COM_GOAL)
        _, tau, forces = control(q, v)
        sim.qfrc_applied[6:] = tau  # both programs have the joints in the same order
        sim.body("base").xfrc_applied[1] = PUSH if START <= sim.time < END else 0.0  # along y
        mujoco.mj_step(world, sim)
        errors.append(measured_forces(world, sim) - forces)
    return np.array(path), np.array(errors)


def main():
    """Check the equations at a random state, then let the robot stand and push it."""
    rng = np.random.default_rng(0)
    q, v = pin.integrate(model, Q_GOAL, 0.1 * rng.normal(size=nv)), 0.5 * rng.normal(size=nv)
    tau, beta = rng.normal(size=(2, d))
    eom, x = equations_of_motion(q, v), np.concatenate(control(q, v))
    print("At a random configuration and velocity:")
    check_dynamics(q, v, eom, x, tau, beta)
    check_costs(eom, objective(q, v), x, tau, beta)
    print(f"\nThe robot stands. {PUSH:.0f} N push it to the left from {START} to {END} s:")
    path, errors = simulate(duration=2.0)
    for i in range(200, 700, 50):
        left = round(1000 * path[i, 1])
        print(f"  {TIMESTEP * i:.1f} s  {left:2d} mm  {'.' * left}o")
    distance, error = 1000 * np.linalg.norm(path, axis=1), np.abs(errors).max(axis=1)
    print(f"Largest displacement: {distance.max():.0f} mm, at the end: {distance[-1]:.1f} mm.")
    print(f"Error of the QP's λ: {error[225]:.3f} N at rest, {error[280]:.1f} N in the push.")


if __name__ == "__main__":
    main()
