"""The conventions of floatbase: symbols, frames, signs and units, the same in every function.

Symbols
-------
    d           number of actuated joints
    nq, nv      lengths of q and v; nv = d + 6 with a floating base, nv = d with a fixed base
    k           length of λ: three for each contact point, one for each row of a `LinearConstraint`
    m           number of constraint rows of the contacts
    q           configuration: base position (world frame, m), base quaternion x y z w, then joints
                (rad or m); a joint without limits is given by its cosine and
                sine
    v           velocity: base linear (m/s) and angular (rad/s) velocity, both in the base frame,
                then joints
    q̈, qdd      acceleration: the time derivative of v
    τ, tau      joint torques (N·m) or forces of prismatic joints (N), shape (d,)
    λ, forces   contact forces of the ground on the robot (N), world axes, stacked point by point,
                shape (k,); those of a `LinearConstraint` are in the units of its rows
    M, h, S     inertia matrix, bias forces (Coriolis, centrifugal, gravity), actuation matrix:
                M q̈ + h = S τ + Jᵀ λ   (1)-(4)
    J, b, A     Jacobian of the contact points (k, nv); A q̈ = b, with A (m, nv): the motion that
                contacts allow         (5)-(7)
    ζ, η        affine maps τ -> λ (9) and τ -> q̈ (14)
    C, B        matrices of (10) and (12); β: coordinates of their null spaces, (11) (13) (17)
    G_f, G_τ    matrices of the net force and the net moment of the contact forces about the centre
                of mass                (20) (21)
    μ           friction coefficient; in quadratic programs also the multipliers of inequality
                constraints
    c, ξ, ω     for walking: centre of mass, its divergent component ξ = c + ċ / ω (the capture
                point), and ω = √(g / height)
    p           zero-moment point (ZMP), the centre of pressure of all feet: c̈ = ω² (c - p)
    H, g, c     the cost ½ xᵀ H x + gᵀ x + c of a quadratic program with the constraints A x = b and
                G x ≤ h

Frames and order
----------------
The z axis of the world points up. Twists and wrenches have the linear part first, then the angular
part. Contact forces and their Jacobian J are in world axes at the contact points. So are A and b,
except for a flat foot, whose rows refer to the origin of its frame. `State.frame_velocity` is in
world axes at the origin of the frame. The base velocity in v is the exception: it is in the base
frame, as in Pinocchio. Quaternions are ordered x y z w. MuJoCo has other conventions, and
`MujocoAdapter` converts them. Rotation matrices map vectors from the frame to the world. Where the
frame could be in doubt, the name gives it: `p_world`, `J_foot_world`.

Signs
-----
A residual is actual - desired. A task minimizes (weight / 2) ‖residual‖². Its feedback is
-kp e - kd ė with e = actual - desired. A normal points from the ground to the robot, so a contact
force pushes if normal · f > 0. Gravity acts along -z.
Multipliers of inequality constraints are ≥ 0. A constraint with a positive multiplier is active.
The multiplier is the decrease of the optimal objective per unit increase of h.

Units
-----
SI: m, rad, s, kg, N, N·m, W. Gains: kp 1/s², kd 1/s. Weights make squared residuals comparable;
their units are 1/(m/s²)², 1/N² and 1/(N·m)². The weight of a soft constraint multiplies the
violation itself, so its unit is 1/(rad/s²), 1/N or 1/(N·m).

Immutable objects
-----------------
Objects such as `State`, `Contacts`, `QP` and `Solution` are immutable and hold read-only float64
arrays. To change one, make a copy with its method `replace(…)` or with `dataclasses.replace(…)`.
Arrays that a call computes may be modified. Exceptions of the package derive from
`fb.FloatbaseError`. Their messages say what is wrong, what is expected, and what to do.

Importing
---------
`import floatbase as fb` has the names that most programs need. Import everything else from its
package: `floatbase.robots`, `floatbase.dynamics`, `floatbase.objectives`, `floatbase.friction`,
`floatbase.qp`, `floatbase.control`, `floatbase.actuators`, `floatbase.simulation`,
`floatbase.behaviours`, `floatbase.viewer`, `floatbase.lessons`, `floatbase.playground`, and the
small modules `floatbase.affine`, `floatbase.linear_algebra` and `floatbase.errors`.
"""
