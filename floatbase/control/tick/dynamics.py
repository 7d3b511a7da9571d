"""Poses, Jacobians, momentum, M and h from (q, v), over the tree of joints: eq. (1).

A Newton-Euler pass and a composite-rigid-body pass [Featherstone2008]_. All quantities are in world
axes about the world's origin, so that nothing has to be transformed from one body to the next.
Joint 0 is the world itself.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from floatbase.control.tick.jit import jit, jit_inline
from floatbase.control.tick.vectors import (
    cross,
    dot,
    minus,
    plus,
    rotate,
    rotation_in,
    row_part,
    times,
    transpose,
    write_row,
)
from floatbase.control.tick.workspace import clear, take_matrix, take_vector

FLOATING = 6  # entries of v of the floating base
# entries of `Model.terms` after gravity: multiples of M and h, of the part of h that depends on the
# velocity, and of b in eq. (5). The controller assumes them, but tasks use the exact model
MASS_FACTOR, VELOCITY_FACTOR, DRIFT_FACTOR, N_TERMS = 3, 4, 5, 6
# columns of `Model.links` and `Bodies.carried`, after the inertia column by column
COM, MASS, RATE = 9, 12, 13


class Model(NamedTuple):
    """Constant numbers of n joints and of the links that they carry."""

    # (n, 6), parent, first index in v, count in v, first index in q, count in q, 1 if prismatic
    tree: Any
    joints: Any  # (n, 15), pose in the parent's joint at q = 0 (12), axis in the joint's frame
    # (n, 13), inertia about the CoM column by column, position of the CoM in the joint, mass
    links: Any
    armature: Any  # (nv,), inertia of the rotors
    terms: Any  # (6,), gravity in the world, then MASS_FACTOR, ...


class Bodies(NamedTuple):
    """The robot in one state."""

    tree: Any  # of `Model`
    v: Any  # (nv,), the velocity
    poses: Any  # (n, 12), rotation column by column, then position
    # (nv, 6), spatial velocity about the world's origin for each entry of v: linear, then angular
    J: Any
    velocity: Any  # (n, 6), of each joint
    drift: Any  # (n, 6), its derivative at q̈ = 0
    # (n, 19), of each joint with all links that it carries: inertia about the world's origin column
    # by column, mass × position of the CoM, mass, then the rate of the momentum about the world's
    # origin at q̈ = 0, linear and angular
    carried: Any
    Ag: Any  # (nv, 6), centroidal momentum for each entry of v: linear, then angular
    M: Any  # (nv, nv), of eq. (1), as the controller assumes it
    h: Any  # (nv,), likewise


@jit_inline
def take_bodies(model: Model, v, workspace):
    """Return `Bodies` with memory of a workspace, uninitialized."""
    n, nv = model.tree.shape[0], v.size
    return Bodies(
        model.tree, v, take_matrix(workspace, n, 12), take_matrix(workspace, nv, 6),
        take_matrix(workspace, n, 6), take_matrix(workspace, n, 6),
        take_matrix(workspace, n, RATE + 6), take_matrix(workspace, nv, 6),
        take_matrix(workspace, nv, nv), take_vector(workspace, nv),
    )  # fmt: skip


def bodies_size(n, nv):
    """Return how many numbers `take_bodies` takes for n joints and nv velocities."""
    return (12 + 6 + 6 + RATE + 6) * n + (6 + 6 + nv + 1) * nv


@jit
def compute_dynamics(model: Model, bodies: Bodies, q):
    """Fill `bodies` for q (nq,) and `bodies.v`."""
    forward_positions(model, bodies, q)
    forward_velocities(bodies)
    link_momentum(model, bodies)
    composite_bodies(model, bodies)


@jit
def forward_positions(model: Model, bodies: Bodies, q):
    """Fill poses and J from the root to the leaves."""
    tree, joints, poses, J = model.tree, model.joints, bodies.poses, bodies.J
    for k in range(12):
        poses[0, k] = 1.0 if k in (0, 4, 8) else 0.0
    for i in range(1, tree.shape[0]):
        parent, c, at = tree[i, 0], tree[i, 1], tree[i, 3]
        R, (x, y, z) = rotation_in(poses, parent), rotation_in(joints, i)
        p = plus(row_part(poses, parent, 9), rotate(R, row_part(joints, i, 9)))
        R = (rotate(R, x), rotate(R, y), rotate(R, z))
        axis, sine, versine = rotate(R, row_part(joints, i, 12)), 0.0, 0.0
        if tree[i, 2] == FLOATING:
            p = plus(p, rotate(R, (q[at], q[at + 1], q[at + 2])))
            # a unit quaternion: the same formula with the vector part as the axis
            axis = rotate(R, (q[at + 3], q[at + 4], q[at + 5]))
            sine, versine = 2.0 * q[at + 6], 2.0
        elif tree[i, 5] == 1:
            p = plus(p, times(q[at], axis))
            write_row(J, c, 0, axis)
            write_row(J, c, 3, (0.0, 0.0, 0.0))
        else:
            sine, versine = np.sin(q[at]), 1.0 - np.cos(q[at])
            if tree[i, 4] == 2:  # joints without limits are (cos, sin) in q
                sine, versine = q[at + 1], 1.0 - q[at]
            write_row(J, c, 0, cross(p, axis))
            write_row(J, c, 3, axis)
        R = (
            turned(R[0], axis, sine, versine),
            turned(R[1], axis, sine, versine),
            turned(R[2], axis, sine, versine),
        )
        for k in range(3):
            write_row(poses, i, 3 * k, R[k])
            if tree[i, 2] == FLOATING:  # its velocity is in its own axes
                write_row(J, c + k, 0, R[k])
                write_row(J, c + k, 3, (0.0, 0.0, 0.0))
                write_row(J, c + 3 + k, 0, cross(p, R[k]))
                write_row(J, c + 3 + k, 3, R[k])
        write_row(poses, i, 9, p)


@jit
def turned(a, axis, sine, versine):
    """Return the vector a turned about a unit axis; versine: 1 - cosine of the angle."""
    moved = cross(axis, a)
    return plus(a, plus(times(sine, moved), times(versine, cross(axis, moved))))


@jit
def forward_velocities(bodies: Bodies):
    """Fill velocity and drift from the root to the leaves.

    A joint's columns of J move with it, so its drift is that of its parent + velocity × (J v of the
    joint alone).
    """
    tree, v, velocity, drift = bodies.tree, bodies.v, bodies.velocity, bodies.drift
    for r in range(6):
        velocity[0, r], drift[0, r] = 0.0, 0.0
    for i in range(1, tree.shape[0]):
        parent, first = tree[i, 0], tree[i, 1]
        joint_linear, joint_angular = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for c in range(first, first + tree[i, 2]):
            joint_linear = plus(joint_linear, times(v[c], row_part(bodies.J, c, 0)))
            joint_angular = plus(joint_angular, times(v[c], row_part(bodies.J, c, 3)))
        linear = plus(row_part(velocity, parent, 0), joint_linear)
        angular = plus(row_part(velocity, parent, 3), joint_angular)
        a = plus(cross(angular, joint_linear), cross(linear, joint_angular))
        write_row(velocity, i, 0, linear)
        write_row(velocity, i, 3, angular)
        write_row(drift, i, 0, plus(row_part(drift, parent, 0), a))
        write_row(drift, i, 3, plus(row_part(drift, parent, 3), cross(angular, joint_angular)))


@jit
def point_velocity(bodies: Bodies, joint, p):
    """Return velocity and drift of the point p, world, of a joint's body."""
    angular = row_part(bodies.velocity, joint, 3)
    linear = plus(row_part(bodies.velocity, joint, 0), cross(angular, p))
    a = plus(row_part(bodies.drift, joint, 0), cross(row_part(bodies.drift, joint, 3), p))
    return linear, plus(a, cross(angular, linear))


@jit
def link_momentum(model: Model, bodies: Bodies):
    """Fill `carried` with the numbers of each link alone."""
    links, carried = model.links, bodies.carried
    for i in range(1, links.shape[0]):
        mass, R = links[i, MASS], rotation_in(bodies.poses, i)
        p = plus(row_part(bodies.poses, i, 9), rotate(R, row_part(links, i, COM)))
        x, y, z = rotation_in(links, i)
        half, rows = (rotate(R, x), rotate(R, y), rotate(R, z)), transpose(R)
        inertia = (rotate(half, rows[0]), rotate(half, rows[1]), rotate(half, rows[2]))
        _, acceleration = point_velocity(bodies, i, p)
        angular, alpha = row_part(bodies.velocity, i, 3), row_part(bodies.drift, i, 3)
        force = times(mass, acceleration)
        moment = plus(rotate(inertia, alpha), cross(angular, rotate(inertia, angular)))
        square = dot(p, p)
        units = ((square, 0.0, 0.0), (0.0, square, 0.0), (0.0, 0.0, square))
        for k in range(3):  # Steiner's theorem
            shift = times(mass, minus(units[k], times(p[k], p)))
            write_row(carried, i, 3 * k, plus(inertia[k], shift))
        write_row(carried, i, COM, times(mass, p))
        carried[i, MASS] = mass
        write_row(carried, i, RATE, force)
        write_row(carried, i, RATE + 3, plus(moment, cross(p, force)))


@jit
def composite_bodies(model: Model, bodies: Bodies):
    """Add up `carried` from the leaves to the root; fill Ag, M and h."""
    tree, terms, J, Ag, M = model.tree, model.terms, bodies.J, bodies.Ag, bodies.M
    carried, gravity = bodies.carried, (terms[0], terms[1], terms[2])
    clear(M)
    for r in range(carried.shape[1]):
        carried[0, r] = 0.0
    for i in range(tree.shape[0] - 1, 0, -1):
        inertia, mass = rotation_in(carried, i), carried[i, MASS]
        moment, force = row_part(carried, i, COM), row_part(carried, i, RATE)
        torque = row_part(carried, i, RATE + 3)
        for c in range(tree[i, 1], tree[i, 1] + tree[i, 2]):
            linear, angular = row_part(J, c, 0), row_part(J, c, 3)
            f = plus(times(mass, linear), cross(angular, moment))
            m = plus(rotate(inertia, angular), cross(moment, linear))
            write_row(Ag, c, 0, f)
            write_row(Ag, c, 3, m)
            h = dot(linear, force) + dot(angular, torque)
            bodies.h[c] = terms[MASS_FACTOR] * (terms[VELOCITY_FACTOR] * h - dot(f, gravity))
            j = i
            while j > 0:
                for e in range(tree[j, 1], min(tree[j, 1] + tree[j, 2], c + 1)):
                    x = dot(row_part(J, e, 0), f) + dot(row_part(J, e, 3), m)
                    M[c, e] = M[e, c] = terms[MASS_FACTOR] * x
                j = tree[j, 0]
            M[c, c] += terms[MASS_FACTOR] * model.armature[c]
        for r in range(carried.shape[1]):
            carried[tree[i, 0], r] += carried[i, r]
    com = times(1.0 / carried[0, MASS], row_part(carried, 0, COM))
    for c in range(Ag.shape[0]):
        write_row(Ag, c, 3, minus(row_part(Ag, c, 3), cross(com, row_part(Ag, c, 0))))


@jit
def angular_momentum(bodies: Bodies):
    """Return the angular momentum about the centre of mass, and its drift."""
    momentum, total = (0.0, 0.0, 0.0), bodies.carried
    for c in range(bodies.v.size):
        momentum = plus(momentum, times(bodies.v[c], row_part(bodies.Ag, c, 3)))
    com = times(1.0 / total[0, MASS], row_part(total, 0, COM))
    return momentum, minus(row_part(total, 0, RATE + 3), cross(com, row_part(total, 0, RATE)))


@jit
def centre_of_mass(bodies: Bodies):
    """Return position, velocity and drift of the centre of mass, and the mass."""
    mass, momentum = bodies.carried[0, MASS], (0.0, 0.0, 0.0)
    for c in range(bodies.v.size):
        momentum = plus(momentum, times(bodies.v[c], row_part(bodies.Ag, c, 0)))
    com, rate = row_part(bodies.carried, 0, COM), row_part(bodies.carried, 0, RATE)
    return times(1.0 / mass, com), times(1.0 / mass, momentum), times(1.0 / mass, rate), mass
