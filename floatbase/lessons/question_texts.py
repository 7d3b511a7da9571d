"""Texts for questions that cannot be understood outside their lesson.

Most questions need no other text. A context replaces the paragraph before a question, and a text
replaces the question.
"""

from __future__ import annotations

CONTEXTS = {
    "06.i": "The **support region** (Bretl and Lall, 2008) holds all positions of the centre "
    "of mass, seen from above, for which the feet can carry the weight, each within its "
    "friction cone. On level ground it is the hull of the feet for every μ.",
    "08.a": "go2 stands on four feet. To lift a foot, a controller removes this foot from the "
    "contacts, and a task moves the foot up.",
    "00.a": "go2 stands at rest. Its centre of mass is 19 mm ahead of the middle of its four feet.",
    "00.c": "go2 is pushed sideways. On good ground, the contact forces then push sideways with "
    "up to 30 N. Ice allows only 0.05 of the weight, 8 N. The controller assumes good "
    "ground.",
    "00.d": "On ice, go2 falls after a push of 30 N, because the controller assumes more friction "
    "than there is: the plan needs over eight times as much friction as ice has.",
    "01.a": "An arm presses on a wall. When its shoulder-lift joint turns, the tool moves along "
    "x by 0.51 m per radian. A force f on the tool adds $J_{tool}^T f$ to the right-hand side "
    "of (1), so at rest $\\tau = h - J_{tool}^T f$.",
    "01.b": "An arm presses on a wall and stands on bolts. The six rows of its base are forces "
    "along x, y and z, then moments about x, y and z. No motor acts in these rows. If the "
    "base is to stay put, something outside must balance them.",
    "02.a": "The equations of motion of go2 are $M\\ddot q + h = S\\tau + J^T\\lambda$. The first "
    "entry of $\\ddot q$ is the acceleration of the base along x.",
    "02.d": "go2 stands still. Its front feet carry 43 N each, its rear feet 35 N. Among all "
    "accelerations with $J\\ddot q = b$, the robot has the one that minimizes $\\tfrac12 "
    "(\\ddot q - \\ddot q_{free})^T M (\\ddot q - \\ddot q_{free})$, and λ is the "
    "multiplier of the constraint.",
    "02.k": "A disc stands upright on the floor and rolls without slipping. It can also turn on "
    "the spot. These constraints limit its velocities.",
    "03.i": "go2 has 12 motors. The motions that satisfy (7) form a space with 12 dimensions. "
    "Some of its directions move the robot, the others change only internal forces.",
    "03.m": "A straight leg can no longer push the base up, roll it or pitch it. But its knee may "
    "now buckle while the foot stays in place.",
    "04.a": "A quadratic cost Q asks the centre of mass of go2 for one acceleration, three "
    "numbers. With n variables there are n - rank H independent directions along which a "
    "cost is flat.",
    "04.d": "One cost of the torques asks for an acceleration of the centre of mass, another that "
    "the base does not turn. We plot both against the torques of the hips (all alike) and "
    "of the knees (left against right). Each cost alone is a valley there, and the two "
    "valleys have different directions.",
    "04.g": "A cost asks go2's centre of mass to accelerate to the left at 0.5 m/s². A second, "
    "small cost penalizes effort. On MuJoCo, the centre of mass does accelerate at 0.5 "
    "m/s².",
    "05.e": "A cost asks for contact forces that carry go2's weight, with 5 N to the left and no "
    "moment. The centre of mass is 0.32 m above the ground.",
    "06.b": "A friction pyramid with N facets lies inside the round cone with μ = 0.7. Only its "
    "edges touch the cone.",
    "06.e": "The contact forces of go2 carry the weight, exert no moment, and push sideways as "
    "hard as the friction constraints allow. With four facets inside the cone of μ = 0.7, "
    "that is 49.5 percent of the weight.",
    "06.j": "go2 stands at rest in a valley with sides of 40° and μ = 1. The right feet are low "
    "on one side, and the left feet are higher up on the other side. Its centre of mass "
    "is *beyond* all its feet, 19 mm to the left of the left ones.",
    "08.b": "go2's centre of mass is 19 mm ahead of the middle of its feet. On three feet, the "
    "loads follow from the weight and its two moments, so there is no choice. And the "
    "ground only pushes: all three loads must be positive.",
    "08.f": "A robot on two point feet falls about the line between them like a **linear inverted "
    "pendulum** (Kajita and others, 2001). If it starts at rest at a distance d from the "
    "line, its distance is $d \\cosh \\omega t$, with $\\omega^2 = g / h$.",
    "08.i": "go2 stands on four feet. A short push of F for Δt seconds gives the velocity F Δt / "
    "m, so the capture point jumps by F Δt / (m ω). The robot survives if the capture "
    "point stays inside the feet. The left feet are 163 mm away, and the push lasts 0.1 "
    "s.",
    "09.c": "Talos stands on two flat feet. The contact of each sole is modelled by point "
    "contacts at its four corners.",
    "09.f": "If the body does not start to turn or to rise, the centre of pressure is at $p = c - "
    "\\ddot c\\, h / g$, as for a pendulum with $\\omega^2 = g / h$. To accelerate "
    "forwards, the ground has to push *behind* $x_c$.",
    "A.c": "A rod turns at a constant θ̇, and a mass m slides outwards on it at a constant ṙ.",
    "A.d": "An arm moves with the joint velocities v. The velocity part of h is h(q, v) - h(q, 0).",
    "A.e": "A floating robot glides and turns. In the base's axes, h is the force for which "
    "$v_{lin}$ and ω stay constant while the axes turn: the robot moves in a circle "
    "or a helix. That takes the force $m\\,\\omega\\times v_{lin}$.",
    "B.f": "go2 is pushed to the left with 30 N for 0.1 s. With perfect torques it sways by 6.6 "
    "mm. With hydraulic motors and a torque loop of 50 Hz it sways by 6.4 mm. Now reduce "
    "the bandwidth to 5 Hz, a tenth.",
    "C.a": "A bowl over a table: x = (along, up), with one constraint, up ≥ 0. The bowl is ψ = ½ "
    "(along - 0.5)² + ½ · 2 (up - lowest)², so its lowest point is at the height "
    "`lowest`. A solver treats the constraints in a set W as active.",
    "C.b": "A marble lies in a bowl, and a table with the constraint up ≥ 0 cuts the bowl.",
    "P.f": "go2 stands in MuJoCo. At 0.5 s it is pushed to the left with 0.9 of its weight. It "
    "survives this push if the controller's model is right.",
    "P.g": "go2 stands in MuJoCo. At 0.5 s it is pushed to the left with 0.9 of its weight. It "
    "survives this push if the controller's model is right.",
    "P.h": "go2 stands in MuJoCo. At 0.5 s it is pushed to the left with 0.9 of its weight. It "
    "survives this push if the controller's model is right.",
    "X.g": "After a crash, the commanded torques differ from the torques that the equations of "
    "motion require. Suppose the cables of two motors are swapped, so that each gets the "
    "other's commands.",
}
TEXTS = {
    "A.c": "The motor of the rod must supply the rate of change of the angular momentum. With m = "
    "2 kg, r = 0.5 m, ṙ = 1 m/s and θ̇ = 2 rad/s, how many N·m?",
    "00.a": "How much of the weight does each *front* foot carry?",
    "06.e": "With 16 facets, how large can this force to the *left* be, in percent of the weight? "
    "$x_c$ is 0.316 m above the ground, and the left feet are 0.163 m to its left.",
    "08.i": "What is the largest push to the left by this rule? (m = 16.1 kg, ω = 5.57 1/s.)",
    "09.f": "Talos is to accelerate forwards at 0.5 m/s², and $x_c$ is 0.88 m high. According "
    "to the pendulum, how far does the centre of pressure move, in mm? (Minus is backwards.)",
    "C.b": "The lowest point of the bowl lies *exactly* on the table. What is the constraint then?",
}
