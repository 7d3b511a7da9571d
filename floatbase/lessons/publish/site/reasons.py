"""Reasons for the results of lecture questions, where those of the lesson need its pictures."""

from __future__ import annotations

REASONS = {
    "00.c": "At rest, the plan needs less friction than ice has. During the push, it needs over "
    "eight times as much. The feet slide away, and the controller pushes harder to bring the "
    "body back. The robot brings itself down.",
    "01.g": "The linear law $m \\dot x_c = 0$ can be integrated: $x_c$ stays where it is. The "
    "angular law cannot. At every moment it fixes how fast the base turns for given joint "
    "speeds. If the joints return by a different path, the rotations of the base need not "
    "cancel.",
    "03.h": "Two of the 12 rows of J repeat others, so r = 10. The space has d + k - r = 8 + 12 - "
    "10 dimensions.",
    "03.j": "Eight horizontal components must satisfy three conditions: two sums and one moment. "
    "So one of the six pairs is redundant: a square frame with both diagonals can be "
    "pre-stressed. The sixth internal force is the wobble of a café table: one diagonal "
    "pair of legs carries more, the other less.",
    "06.b": "In the middle of a facet, the ratio of tangential to normal force can be μ cos 45° = "
    "0.495 instead of 0.7. Only at an edge is it μ. The area of the cross-section is "
    "another number: a square in its circle covers 64 %.",
    "08.a": "At rest, three feet can carry the weight only if the centre of mass is above their "
    "triangle. One side of each triangle is a diagonal of the four feet, and go2's centre "
    "of mass is in front of both diagonals. Without a hind foot it is above the triangle "
    "of the other three. Without a front foot it is outside, and the robot tips over.",
    "08.g": "The capture point has unlimited time to come to rest. A quarter of a second requires "
    "harder braking, so p must be further out: 61 mm.",
    "A.g": "With τ = g only the weight is carried, and no other real force does work. One joint "
    "gains what another loses, and the energy stays constant. To keep all speeds constant, "
    "the motors must do 5.9 J of work besides carrying the weight. So the energy rises.",
    "B.f": "Trapped oil is stiff, and a slow valve leaves it trapped. That explanation fails: a "
    "push to the *right* makes go2 sway by 12 mm. A little oil leaks past each piston and "
    "stretches the cylinders, so go2 drifts to the right even without a push. The sway to "
    "the left only seems smaller.",
    "B.h": "The two rates balance at (6.3 · (-12) + 3.4 · 15)/9.7 ≈ -2.5 N·m, a fifth of what "
    "was commanded. The integral would remove this offset, but its corner is at 0.05 Hz, "
    "and go2 does not have that much time.",
    "P.h": "At rest every foot pushes, so the wrong model does no harm. During the push, the "
    "plan needs the right feet to pull on the ground. The real ground does not hold them, so the "
    "robot does not move as planned. The plan asks for larger and larger forces, and within 0.1 s "
    "the robot is thrown over.",
}
