"""The conventions of floatbase: symbols, frames, signs and units, the same in every function.

Symbols
-------
    d           number of driven joints
    nq, nv      lengths of q and v; nv = d + 6 with a floating base, nv = d without
    k           length of λ: three for each contact point, one for each row of a `LinearConstraint`
    m           number of motion rows of the contacts
    q           configuration: base position (world, m), base quaternion x y z w, then joints (rad
                or m); cos and sin for a joint without limits
    v           velocity: base linear (m/s) and angular (rad/s) velocity, both in the base frame,
                then joints
    q̈, qdd      acceleration: the derivative of v
    τ, tau      joint torques (N·m) or forces of prismatic joints (N), shape (d,)
    λ, forces   what the ground does to the robot, N, world axes, stacked point by point, shape
                (k,); a `LinearConstraint`'s in the units of its rows
    M, h, S     inertia matrix, bias forces (Coriolis, centrifugal, gravity), actuation matrix:
                M q̈ + h = S τ + Jᵀ λ   (1)-(4)
    J, b, A     Jacobian of the contact points (k, nv); A q̈ = b, with A (m, nv): the motion that
                contacts allow         (5)-(7)
    ζ, η        affine maps τ -> λ (9) and τ -> q̈ (14)
    C, B        matrices of (10) and (12); β: coordinates of their null spaces, (11) (13) (17)
    G_f, G_τ    net force and net moment about the centre of mass of the contact forces
                (20) (21)
    μ           friction coefficient; also the multipliers of inequality rows, where a quadratic
                program is solved
    c, ξ, ω     centre of mass, its divergent component ξ = c + ċ / ω (the capture point),
                ω = √(g / height), where it walks
    p           zero-moment point (ZMP), the centre of pressure of all feet: c̈ = ω² (c - p)
    H, g, c     the cost ½ xᵀ H x + gᵀ x + c; rows A x = b and G x ≤ h of a quadratic program

Frames and order
----------------
The world's z axis points up. Twists and wrenches have the linear part first, then the angular part.
Contact forces and their Jacobian J are in world axes at the contact points; so are A and b, but
those of a flat foot at its frame's origin. `State.frame_velocity` is in world axes at the frame's
origin. The base velocity inside v is the exception: it is in the base frame, as in Pinocchio.
Quaternions are x y z w. Rotation matrices take vectors of the frame to the world. A frame that
could be doubted stands in the name: `p_world`, `J_foot_world`.

Signs
-----
A residual is actual - desired. A task minimises (weight / 2) ‖residual‖², and its feedback is
-kp e - kd ė with e = actual - desired. A normal points from the ground to the robot, so a contact
force pushes where normal · f > 0. Gravity acts along -z.
Multipliers of inequality rows are ≥ 0; a row with a positive multiplier is active. The multiplier
is what one unit more in h would lower the optimal objective by.

Units
-----
SI: m, rad, s, kg, N, N·m, W. Gains: kp 1/s², kd 1/s. Weights bring squared residuals to one unit:
per (m/s²)², N² or (N·m)².

Values
------
Values (`State`, `Contacts`, `QP`, `Solution`, …) do not change: they hold read-only arrays,
float64. A changed copy comes from `replace(…)`, a method or that of `dataclasses`. An array that a
call computes may be written to. Errors of the package are `fb.FloatbaseError`, and say what was
wrong, what would be right, and what to do.

Importing
---------
`import floatbase as fb` has the names that most programs need. Everything else is imported from its
package: `floatbase.robots`, `floatbase.dynamics`, `floatbase.objectives`, `floatbase.friction`,
`floatbase.qp`, `floatbase.control`, `floatbase.actuators`, `floatbase.simulation`,
`floatbase.behaviours`, `floatbase.viewer`, `floatbase.lessons`, `floatbase.playground`, and the
small `floatbase.affine`, `floatbase.linear_algebra` and `floatbase.errors`.
"""
