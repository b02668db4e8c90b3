"""A tree of rigid bodies with one coordinate each: dynamics by recursion, in world axes.

Newton-Euler for what gravity, Coriolis and centrifugal terms ask of the joints, composite bodies
for the mass matrix; no spatial vectors and nothing of pinocchio's but the numbers of the URDF.
A `chain` here is `Chain.arrays()`. Index 0 of the bodies' arrays is the world (or the floor), body
i is at i + 1.
"""

from __future__ import annotations

import numpy as np
from numba import njit

GRAVITY = np.array([0.0, 0.0, -9.81])


@njit(cache=True)
def _cross(a0, a1, a2, b0, b1, b2):
    return a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0


@njit(cache=True)
def workspace(n):
    """Arrays that `kinematics` and `dynamics` fill, for n coordinates."""
    m = n + 1
    turn = np.zeros((m, 3, 3))
    for k in range(3):
        turn[0, k, k] = 1.0
    return (
        turn,  # 0 rotation of each body in the world
        np.zeros((m, 3)),  # 1 origin
        np.zeros((m, 3)),  # 2 axis
        np.zeros((m, 3)),  # 3 angular velocity
        np.zeros((m, 3)),  # 4 velocity of the origin
        np.zeros((m, 3)),  # 5 angular acceleration, coordinates' accelerations left out
        np.zeros((m, 3)),  # 6 acceleration of the origin, likewise
        np.zeros((m, 3)),  # 7 force
        np.zeros((m, 3)),  # 8 moment about the origin
        np.zeros(m),  # 9 composite mass
        np.zeros((m, 3)),  # 10 composite first moment
        np.zeros((m, 3, 3)),  # 11 composite inertia about the origin
        np.zeros((n, n)),  # 12 mass matrix
        np.zeros(n),  # 13 bias
        np.zeros(n),  # 14 positions
    )


@njit(cache=True)
def kinematics(chain, q, v, work):
    """Places, velocities, and accelerations at coordinates q, v whose accelerations are zero.

    The world's own velocity and acceleration (`work[4][0]`, `work[6][0]`) are taken as they are.
    """
    parent, rotation, offset, prismatic, axis = chain[0], chain[1], chain[2], chain[3], chain[4]
    turn, place, line, spin, speed, dspin, dspeed = work[:7]
    a = np.empty((3, 3))
    for i in range(parent.size):
        p, b = parent[i], i + 1
        for r in range(3):
            for c in range(3):
                a[r, c] = (
                    turn[p, r, 0] * rotation[i, 0, c]
                    + turn[p, r, 1] * rotation[i, 1, c]
                    + turn[p, r, 2] * rotation[i, 2, c]
                )
        x, y, z = axis[i, 0], axis[i, 1], axis[i, 2]
        l0 = a[0, 0] * x + a[0, 1] * y + a[0, 2] * z
        l1 = a[1, 0] * x + a[1, 1] * y + a[1, 2] * z
        l2 = a[2, 0] * x + a[2, 1] * y + a[2, 2] * z
        o0, o1, o2 = offset[i, 0], offset[i, 1], offset[i, 2]
        r0 = turn[p, 0, 0] * o0 + turn[p, 0, 1] * o1 + turn[p, 0, 2] * o2
        r1 = turn[p, 1, 0] * o0 + turn[p, 1, 1] * o1 + turn[p, 1, 2] * o2
        r2 = turn[p, 2, 0] * o0 + turn[p, 2, 1] * o1 + turn[p, 2, 2] * o2
        if prismatic[i]:
            r0 += l0 * q[i]
            r1 += l1 * q[i]
            r2 += l2 * q[i]
            for r in range(3):
                for c in range(3):
                    turn[b, r, c] = a[r, c]
        else:
            s, k = np.sin(q[i]), np.cos(q[i])
            u = 1.0 - k
            t00, t01, t02 = k + u * x * x, u * x * y - s * z, u * x * z + s * y
            t10, t11, t12 = u * x * y + s * z, k + u * y * y, u * y * z - s * x
            t20, t21, t22 = u * x * z - s * y, u * y * z + s * x, k + u * z * z
            for r in range(3):
                turn[b, r, 0] = a[r, 0] * t00 + a[r, 1] * t10 + a[r, 2] * t20
                turn[b, r, 1] = a[r, 0] * t01 + a[r, 1] * t11 + a[r, 2] * t21
                turn[b, r, 2] = a[r, 0] * t02 + a[r, 1] * t12 + a[r, 2] * t22
        place[b, 0], place[b, 1], place[b, 2] = place[p, 0] + r0, place[p, 1] + r1, place[p, 2] + r2
        line[b, 0], line[b, 1], line[b, 2] = l0, l1, l2
        w0, w1, w2 = spin[p, 0], spin[p, 1], spin[p, 2]
        d0, d1, d2 = dspin[p, 0], dspin[p, 1], dspin[p, 2]
        c0, c1, c2 = _cross(w0, w1, w2, r0, r1, r2)
        e0, e1, e2 = _cross(d0, d1, d2, r0, r1, r2)
        f0, f1, f2 = _cross(w0, w1, w2, c0, c1, c2)
        g0, g1, g2 = _cross(w0, w1, w2, l0 * v[i], l1 * v[i], l2 * v[i])
        slide = 1.0 if prismatic[i] else 0.0
        rotate = 1.0 - slide
        spin[b, 0] = w0 + rotate * l0 * v[i]
        spin[b, 1] = w1 + rotate * l1 * v[i]
        spin[b, 2] = w2 + rotate * l2 * v[i]
        speed[b, 0] = speed[p, 0] + c0 + slide * l0 * v[i]
        speed[b, 1] = speed[p, 1] + c1 + slide * l1 * v[i]
        speed[b, 2] = speed[p, 2] + c2 + slide * l2 * v[i]
        dspin[b, 0], dspin[b, 1], dspin[b, 2] = d0 + rotate * g0, d1 + rotate * g1, d2 + rotate * g2
        dspeed[b, 0] = dspeed[p, 0] + e0 + f0 + slide * 2.0 * g0
        dspeed[b, 1] = dspeed[p, 1] + e1 + f1 + slide * 2.0 * g1
        dspeed[b, 2] = dspeed[p, 2] + e2 + f2 + slide * 2.0 * g2
        for r in range(3):
            work[7][b, r] = 0.0
            work[8][b, r] = 0.0


@njit(cache=True)
def push(work, body, x, y, z, f0, f1, f2):
    """A force on body `body` (index + 1) at a world point; between kinematics and dynamics."""
    place, force, moment = work[1], work[7], work[8]
    m0, m1, m2 = _cross(
        x - place[body, 0], y - place[body, 1], z - place[body, 2], f0, f1, f2
    )  # fmt: skip
    force[body, 0] -= f0
    force[body, 1] -= f1
    force[body, 2] -= f2
    moment[body, 0] -= m0
    moment[body, 1] -= m1
    moment[body, 2] -= m2


@njit(cache=True)
def dynamics(chain, gravity, work):
    """Mass matrix and bias: what motion, gravity and pushes ask of the coordinates."""
    parent, prismatic = chain[0], chain[3]
    mass, com, inertia, rotor = chain[5], chain[6], chain[7], chain[8]
    turn, place, line, spin, _, dspin, dspeed, force, moment, cm, cc, ci, matrix, bias, _ = work
    n = parent.size
    t = np.empty((3, 3))
    w = np.empty((3, 3))
    for i in range(n):
        b = i + 1
        m = mass[i]
        for r in range(3):
            for c in range(3):
                t[r, c] = (
                    turn[b, r, 0] * inertia[i, 0, c]
                    + turn[b, r, 1] * inertia[i, 1, c]
                    + turn[b, r, 2] * inertia[i, 2, c]
                )
        for r in range(3):
            for c in range(3):
                w[r, c] = (
                    t[r, 0] * turn[b, c, 0] + t[r, 1] * turn[b, c, 1] + t[r, 2] * turn[b, c, 2]
                )
        c0 = turn[b, 0, 0] * com[i, 0] + turn[b, 0, 1] * com[i, 1] + turn[b, 0, 2] * com[i, 2]
        c1 = turn[b, 1, 0] * com[i, 0] + turn[b, 1, 1] * com[i, 1] + turn[b, 1, 2] * com[i, 2]
        c2 = turn[b, 2, 0] * com[i, 0] + turn[b, 2, 1] * com[i, 1] + turn[b, 2, 2] * com[i, 2]
        w0, w1, w2 = spin[b, 0], spin[b, 1], spin[b, 2]
        d0, d1, d2 = dspin[b, 0], dspin[b, 1], dspin[b, 2]
        e0, e1, e2 = _cross(d0, d1, d2, c0, c1, c2)
        s0, s1, s2 = _cross(w0, w1, w2, c0, c1, c2)
        s0, s1, s2 = _cross(w0, w1, w2, s0, s1, s2)
        f0 = m * (dspeed[b, 0] + e0 + s0 - gravity[0])
        f1 = m * (dspeed[b, 1] + e1 + s1 - gravity[1])
        f2 = m * (dspeed[b, 2] + e2 + s2 - gravity[2])
        # angular momentum about the CoM, the rotor's with it
        k = rotor[i]
        h0 = w[0, 0] * w0 + w[0, 1] * w1 + w[0, 2] * w2
        h1 = w[1, 0] * w0 + w[1, 1] * w1 + w[1, 2] * w2
        h2 = w[2, 0] * w0 + w[2, 1] * w1 + w[2, 2] * w2
        h0 += turn[b, 0, 0] * k[0] + turn[b, 0, 1] * k[1] + turn[b, 0, 2] * k[2]
        h1 += turn[b, 1, 0] * k[0] + turn[b, 1, 1] * k[1] + turn[b, 1, 2] * k[2]
        h2 += turn[b, 2, 0] * k[0] + turn[b, 2, 1] * k[1] + turn[b, 2, 2] * k[2]
        g0, g1, g2 = _cross(w0, w1, w2, h0, h1, h2)
        n0, n1, n2 = _cross(c0, c1, c2, f0, f1, f2)
        force[b, 0] += f0
        force[b, 1] += f1
        force[b, 2] += f2
        moment[b, 0] += n0 + g0 + w[0, 0] * d0 + w[0, 1] * d1 + w[0, 2] * d2
        moment[b, 1] += n1 + g1 + w[1, 0] * d0 + w[1, 1] * d1 + w[1, 2] * d2
        moment[b, 2] += n2 + g2 + w[2, 0] * d0 + w[2, 1] * d1 + w[2, 2] * d2
        square = m * (c0 * c0 + c1 * c1 + c2 * c2)
        cm[b] = m
        cc[b, 0], cc[b, 1], cc[b, 2] = m * c0, m * c1, m * c2
        for r in range(3):
            for c in range(3):
                ci[b, r, c] = w[r, c] - cc[b, r] * (c0 if c == 0 else c1 if c == 1 else c2)
            ci[b, r, r] += square
    for i in range(n - 1, -1, -1):
        b, p = i + 1, parent[i]
        z0, z1, z2 = line[b, 0], line[b, 1], line[b, 2]
        if prismatic[i]:
            bias[i] = z0 * force[b, 0] + z1 * force[b, 1] + z2 * force[b, 2]
            f0, f1, f2 = cm[b] * z0, cm[b] * z1, cm[b] * z2
            n0, n1, n2 = _cross(cc[b, 0], cc[b, 1], cc[b, 2], z0, z1, z2)
        else:
            bias[i] = z0 * moment[b, 0] + z1 * moment[b, 1] + z2 * moment[b, 2]
            f0, f1, f2 = _cross(z0, z1, z2, cc[b, 0], cc[b, 1], cc[b, 2])
            n0 = ci[b, 0, 0] * z0 + ci[b, 0, 1] * z1 + ci[b, 0, 2] * z2
            n1 = ci[b, 1, 0] * z0 + ci[b, 1, 1] * z1 + ci[b, 1, 2] * z2
            n2 = ci[b, 2, 0] * z0 + ci[b, 2, 1] * z1 + ci[b, 2, 2] * z2
        for j in range(n):
            matrix[i, j] = 0.0 if j < i else matrix[i, j]
        j = i
        while True:
            at = j + 1
            if prismatic[j]:
                value = line[at, 0] * f0 + line[at, 1] * f1 + line[at, 2] * f2
            else:
                value = line[at, 0] * n0 + line[at, 1] * n1 + line[at, 2] * n2
            matrix[i, j] = value
            up = parent[j]
            if up == 0:
                break
            r0 = place[at, 0] - place[up, 0]
            r1 = place[at, 1] - place[up, 1]
            r2 = place[at, 2] - place[up, 2]
            m0, m1, m2 = _cross(r0, r1, r2, f0, f1, f2)
            n0, n1, n2 = n0 + m0, n1 + m1, n2 + m2
            j = up - 1
        if p > 0:
            r0 = place[b, 0] - place[p, 0]
            r1 = place[b, 1] - place[p, 1]
            r2 = place[b, 2] - place[p, 2]
            m0, m1, m2 = _cross(r0, r1, r2, force[b, 0], force[b, 1], force[b, 2])
            force[p, 0] += force[b, 0]
            force[p, 1] += force[b, 1]
            force[p, 2] += force[b, 2]
            moment[p, 0] += moment[b, 0] + m0
            moment[p, 1] += moment[b, 1] + m1
            moment[p, 2] += moment[b, 2] + m2
            m = cm[b]
            dot = 2.0 * (r0 * cc[b, 0] + r1 * cc[b, 1] + r2 * cc[b, 2])
            dot += m * (r0 * r0 + r1 * r1 + r2 * r2)
            for r in range(3):
                rr = r0 if r == 0 else r1 if r == 1 else r2
                for c in range(3):
                    rc = r0 if c == 0 else r1 if c == 1 else r2
                    ci[p, r, c] += ci[b, r, c] - cc[b, r] * rc - rr * cc[b, c] - m * rr * rc
                ci[p, r, r] += dot
            cm[p] += m
            cc[p, 0] += cc[b, 0] + m * r0
            cc[p, 1] += cc[b, 1] + m * r1
            cc[p, 2] += cc[b, 2] + m * r2
    for i in range(n):
        for j in range(i):
            matrix[j, i] = matrix[i, j]


@njit(cache=True)
def jacobian_column(chain, work, i, body, x, y, z):
    """(3,) velocity of a world point of body `body` (index + 1) per velocity of coordinate i."""
    parent, prismatic = chain[0], chain[3]
    place, line = work[1], work[2]
    at = body
    while at > 0 and at != i + 1:
        at = parent[at - 1]
    if at == 0:
        return 0.0, 0.0, 0.0
    if prismatic[i]:
        return line[at, 0], line[at, 1], line[at, 2]
    return _cross(
        line[at, 0], line[at, 1], line[at, 2],
        x - place[at, 0], y - place[at, 1], z - place[at, 2],
    )  # fmt: skip
