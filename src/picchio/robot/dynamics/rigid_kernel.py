"""Compiled mass matrices and Jacobians of a tree of joints: composite bodies, in world axes.

Each composite body is kept about the origin of its own joint, so that a wrist far from the base
loses no digits. Every joint turns about, or slides along, the z axis of its own frame.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

SPAN = 1024  # poses that a thread takes at a time


@njit(cache=True, error_model="numpy", inline="always")
def _place(  # type: ignore[no-untyped-def]
    j, parent, rotation, offset, slides, position, turned, place, step
):
    """World rotation, origin and offset (from its parent) of joint j, from those of its parent."""
    up = parent[j]
    for r in range(3):
        a, b, c = turned[up, r, 0], turned[up, r, 1], turned[up, r, 2]
        x = a * rotation[j, 0, 0] + b * rotation[j, 1, 0] + c * rotation[j, 2, 0]
        y = a * rotation[j, 0, 1] + b * rotation[j, 1, 1] + c * rotation[j, 2, 1]
        turned[j, r, 2] = a * rotation[j, 0, 2] + b * rotation[j, 1, 2] + c * rotation[j, 2, 2]
        step[j, r] = a * offset[j, 0] + b * offset[j, 1] + c * offset[j, 2]
        turned[j, r, 0], turned[j, r, 1] = x, y
    if slides[j]:
        for r in range(3):
            step[j, r] += turned[j, r, 2] * position
    else:
        cosine, sine = math.cos(position), math.sin(position)
        for r in range(3):
            x, y = turned[j, r, 0], turned[j, r, 1]
            turned[j, r, 0], turned[j, r, 1] = cosine * x + sine * y, cosine * y - sine * x
    for r in range(3):
        place[j, r] = place[up, r] + step[j, r]


@njit(cache=True, error_model="numpy", inline="always")
def _body(own, turned, whole):  # type: ignore[no-untyped-def]
    """A body's mass, first moment and inertia about its joint's origin, turned to world axes."""
    whole[0] = own[0]
    x, y, z = own[1], own[2], own[3]
    xx, xy, yy, xz, yz, zz = own[4], own[5], own[6], own[7], own[8], own[9]
    a0, a1, a2 = turned[0, 0], turned[0, 1], turned[0, 2]
    b0, b1, b2 = turned[1, 0], turned[1, 1], turned[1, 2]
    c0, c1, c2 = turned[2, 0], turned[2, 1], turned[2, 2]
    whole[1] = a0 * x + a1 * y + a2 * z
    whole[2] = b0 * x + b1 * y + b2 * z
    whole[3] = c0 * x + c1 * y + c2 * z
    u0 = a0 * xx + a1 * xy + a2 * xz
    u1 = a0 * xy + a1 * yy + a2 * yz
    u2 = a0 * xz + a1 * yz + a2 * zz
    v0 = b0 * xx + b1 * xy + b2 * xz
    v1 = b0 * xy + b1 * yy + b2 * yz
    v2 = b0 * xz + b1 * yz + b2 * zz
    w0 = c0 * xx + c1 * xy + c2 * xz
    w1 = c0 * xy + c1 * yy + c2 * yz
    w2 = c0 * xz + c1 * yz + c2 * zz
    whole[4] = u0 * a0 + u1 * a1 + u2 * a2
    whole[5] = u0 * b0 + u1 * b1 + u2 * b2
    whole[6] = v0 * b0 + v1 * b1 + v2 * b2
    whole[7] = u0 * c0 + u1 * c1 + u2 * c2
    whole[8] = v0 * c0 + v1 * c1 + v2 * c2
    whole[9] = w0 * c0 + w1 * c1 + w2 * c2


@njit(cache=True, error_model="numpy", inline="always")
def _add(part, step, whole):  # type: ignore[no-untyped-def]
    """Add a composite body, about an origin that is `step` away, to another."""
    m, x, y, z = part[0], part[1], part[2], part[3]
    d, e, f = step[0], step[1], step[2]
    # First moments half-way between both origins: what the shift adds is symmetric in them.
    p, q, s = x + 0.5 * m * d, y + 0.5 * m * e, z + 0.5 * m * f
    whole[0] += m
    whole[1] += x + m * d
    whole[2] += y + m * e
    whole[3] += z + m * f
    whole[4] += part[4] + 2.0 * (q * e + s * f)
    whole[5] += part[5] - (p * e + q * d)
    whole[6] += part[6] + 2.0 * (p * d + s * f)
    whole[7] += part[7] - (p * f + s * d)
    whole[8] += part[8] - (q * f + s * e)
    whole[9] += part[9] + 2.0 * (p * d + q * e)


@njit(cache=True, nogil=True, error_model="numpy")
def mass_and_jacobian(  # type: ignore[no-untyped-def]
    first, last, parent, rotation, offset, slides, bodies, rows, tip, point, poses, mass, jacobian,
    origin,
):  # fmt: skip
    """Mass matrices and a point's linear Jacobians at many poses, into arrays of zeros.

    Args:
        first: of the poses.
        last: the one after the last.
        parent: (k + 1,) of the world (which comes first and has none) and of k joints, each after
            its parent.
        rotation: (k + 1, 3, 3) of each joint's frame in its parent's, at position zero.
        offset: (k + 1, 3) m, likewise.
        slides: (k + 1,) one of prismatic joints.
        bodies: (k + 1, 10) kg, kg m, kg m^2: mass, first moment, and xx, xy, yy, xz, yz, zz of the
            inertia about the joint's origin, in its frame.
        rows: (k + 1,) where a joint stands in the result; negative: nowhere.
        tip: the joint that carries the point.
        point: (3,) m in that joint's frame.
        poses: (p, k) rad or m, of all joints.
        mass: (p, n, n) kg m^2, kg m, kg, out; zeros where two joints are not above each other.
        jacobian: (p, 3, n) m or 1, out.
        origin: (p, 3) m, out: where the point is, world.
    """
    count = len(parent)
    turned, place, step = np.empty((count, 3, 3)), np.zeros((count, 3)), np.empty((count, 3))
    whole = np.empty((count, 10))
    for r in range(3):
        for c in range(3):
            turned[0, r, c] = 1.0 if r == c else 0.0
    for s in range(first, last):
        for j in range(1, count):
            _place(j, parent, rotation, offset, slides, poses[s, j - 1], turned, place, step)
            _body(bodies[j], turned[j], whole[j])
        for j in range(count - 1, 0, -1):
            if parent[j] > 0:
                _add(whole[j], step[j], whole[parent[j]])
            if rows[j] < 0:
                continue
            # The momentum of all that joint j carries, per unit of its speed, about its origin.
            m, x, y, z = whole[j, 0], whole[j, 1], whole[j, 2], whole[j, 3]
            a, b, c = turned[j, 0, 2], turned[j, 1, 2], turned[j, 2, 2]
            if slides[j]:
                p, q, r = m * a, m * b, m * c
                k, h, n = y * c - z * b, z * a - x * c, x * b - y * a
            else:
                p, q, r = b * z - c * y, c * x - a * z, a * y - b * x
                k = whole[j, 4] * a + whole[j, 5] * b + whole[j, 7] * c
                h = whole[j, 5] * a + whole[j, 6] * b + whole[j, 8] * c
                n = whole[j, 7] * a + whole[j, 8] * b + whole[j, 9] * c
            i = j
            while True:
                if rows[i] >= 0:
                    a, b, c = turned[i, 0, 2], turned[i, 1, 2], turned[i, 2, 2]
                    value = a * p + b * q + c * r if slides[i] else a * k + b * h + c * n
                    mass[s, rows[j], rows[i]] = mass[s, rows[i], rows[j]] = value
                d, e, f = step[i, 0], step[i, 1], step[i, 2]
                k, h, n = k + (e * r - f * q), h + (f * p - d * r), n + (d * q - e * p)
                i = parent[i]
                if i == 0:
                    break
        x, y, z = place[tip, 0], place[tip, 1], place[tip, 2]
        x += (
            turned[tip, 0, 0] * point[0]
            + turned[tip, 0, 1] * point[1]
            + turned[tip, 0, 2] * point[2]
        )
        y += (
            turned[tip, 1, 0] * point[0]
            + turned[tip, 1, 1] * point[1]
            + turned[tip, 1, 2] * point[2]
        )
        z += (
            turned[tip, 2, 0] * point[0]
            + turned[tip, 2, 1] * point[1]
            + turned[tip, 2, 2] * point[2]
        )
        origin[s, 0], origin[s, 1], origin[s, 2] = x, y, z
        i = tip
        while i > 0:
            if rows[i] >= 0:
                a, b, c = turned[i, 0, 2], turned[i, 1, 2], turned[i, 2, 2]
                if not slides[i]:
                    d, e, f = x - place[i, 0], y - place[i, 1], z - place[i, 2]
                    a, b, c = b * f - c * e, c * d - a * f, a * e - b * d
                jacobian[s, 0, rows[i]], jacobian[s, 1, rows[i]], jacobian[s, 2, rows[i]] = a, b, c
            i = parent[i]
