"""The equations of motion under springs, dampers, dry friction, blows and contacts."""

from __future__ import annotations

import numpy as np
from numba import njit

from .arm import dynamics, jacobian_column, kinematics, push

# Elements between coordinate a and coordinate b (-1: the ground): column 0 of their table.
BACKLASH, CUBIC, HYSTERESIS, COULOMB, QUADRATIC_DAMPER, BILINEAR, QUADRATIC, DELAYED = range(8)
SMOOTHED = 8
# Elements between a point of a body and the world: column 0 of theirs.
TETHER, CONTACT = range(2)
OUTPUTS = 13  # accelerometer, acceleration, velocity, displacement (3 each), force; then joints
EDGE = 1e-9  # s


@njit(cache=True)
def _history(t, times, values, count):
    """Linear in what was stored; zero before it began."""
    if count == 0 or t <= times[0]:
        return 0.0
    low, high = 0, count - 1
    if t >= times[high]:
        return values[high]
    while high - low > 1:
        mid = (low + high) // 2
        if times[mid] <= t:
            low = mid
        else:
            high = mid
    share = (t - times[low]) / (times[high] - times[low])
    return values[low] + share * (values[high] - values[low])


@njit(cache=True)
def _element(row, x, v, z, mode, t, past_t, past_x, count):
    """Torque that resists, and the rate of the inner state, of one joint element."""
    kind = int(row[0])
    a, b = int(row[1]), int(row[2])
    u, du = x[a], v[a]
    if b >= 0:
        u -= x[b]
        du -= v[b]
    p0, p1, p2 = row[3], row[4], row[5]
    if kind == 0:  # k, gap, torque carried: the whole spring's torque
        carried = p2 if abs(p2) > 1e-9 else 0.0
        at = u + carried / p0 + np.sign(carried) * 0.5 * p1
        return p0 * (at - min(max(at, -0.5 * p1), 0.5 * p1)) - carried, 0.0
    if kind == 1:
        return p0 * u * u * u, 0.0
    if kind == 2:
        return p0 * z, (du - 0.5 * (abs(du) * z + du * abs(z))) / p1
    if kind == 3:  # ideal: +-torque where it slides; where it sticks, see `rates`
        return p0 * mode, 0.0
    if kind == 4:
        return p0 * abs(du) * du, 0.0
    if kind == 5:  # a further stiffness where the deflection is positive
        return p0 * max(u, 0.0), 0.0
    if kind == 6:
        return p0 * u * abs(u), 0.0
    if kind == 8:  # friction, linear in the speed far below p1
        return p0 * np.tanh(du / p1), 0.0
    return p0 * _history(t - p1, past_t, past_x, count), 0.0


@njit(cache=True)
def _blow(t, row):
    """N, of a blow that is on at t: a trapezium, or a half-sine in the middle of it."""
    rise = row[7]
    phase = min(max((t - row[0] - 0.5 * rise) / (row[1] - rise), 0.0), 1.0)
    flat = 1.0
    if rise > 0.0:
        flat = max(min(1.0, (t - row[0]) / rise, (row[0] + row[1] - t) / rise), 0.0)
    return row[2] * ((1.0 - row[3]) * flat + row[3] * np.sin(np.pi * phase))


@njit(cache=True)
def _solve(factor, inertia, bodies, acc):
    """Forces to accelerations, in place; `factor` is the mass matrix's, lower triangle."""
    for i in range(bodies):
        for k in range(i):
            acc[i] -= factor[i, k] * acc[k]
        acc[i] /= factor[i, i]
    for i in range(bodies - 1, -1, -1):
        for k in range(i + 1, bodies):
            acc[i] -= factor[k, i] * acc[k]
        acc[i] /= factor[i, i]
    for i in range(bodies, acc.size):
        acc[i] /= inertia[i]


@njit(cache=True)
def _stick(elements, mode, factor, inertia, bodies, acc, held):
    """Friction that sticks takes whatever torque keeps its two sides from moving apart."""
    count = 0
    for i in range(elements.shape[0]):
        held[i] = 0.0
        if int(elements[i, 0]) == 3 and mode[i] == 0.0:
            count += 1
    if count == 0:
        return
    which = np.empty(count, np.int64)
    moves = np.zeros((count, acc.size))
    k = 0
    for i in range(elements.shape[0]):
        if int(elements[i, 0]) == 3 and mode[i] == 0.0:
            which[k] = i
            moves[k, int(elements[i, 1])] = 1.0
            if int(elements[i, 2]) >= 0:
                moves[k, int(elements[i, 2])] = -1.0
            _solve(factor, inertia, bodies, moves[k])
            k += 1
    left, right = np.empty((count, count)), np.empty(count)
    for k in range(count):
        a, b = int(elements[which[k], 1]), int(elements[which[k], 2])
        right[k] = acc[a] - (acc[b] if b >= 0 else 0.0)
        for j in range(count):
            left[k, j] = moves[j, a] - (moves[j, b] if b >= 0 else 0.0)
    for k in range(count):  # Gauss; the matrix is positive definite
        for j in range(k + 1, count):
            share = left[j, k] / left[k, k]
            for c in range(k, count):
                left[j, c] -= share * left[k, c]
            right[j] -= share * right[k]
    for k in range(count - 1, -1, -1):
        for j in range(k + 1, count):
            right[k] -= left[k, j] * right[j]
        right[k] /= left[k, k]
        held[which[k]] = right[k]
        for c in range(acc.size):
            acc[c] -= right[k] * moves[k, c]


@njit(cache=True)
def rates(t, x, v, aux, on, mode, system, work, past, acc, daux, held, out, write):
    """Accelerations and inner states' rates; with `write`, what the sensors are at as well.

    `mode` says of each friction element whether it slides (+-1) or sticks (0); `held` is the torque
    that it takes to make those stick. `past` is (times, values, count in an array of one).
    """
    (chain, gravity, tool, rest, inertia, hold, stiffness, damper, joints, elements, points, blows,
     floor) = system  # fmt: skip
    body, turn_t, off_t, off_f = tool
    n, bodies = hold.size, chain[0].size
    past_t, past_x, count = past[0], past[1], past[2][0]
    turn, place, spin, speed, dspin, dspeed = (
        work[0], work[1], work[3], work[4], work[5], work[6]
    )  # fmt: skip
    swing = 0.0
    if floor[4] > 0.0:
        w = 2.0 * np.pi * floor[3]
        ramp = min(max((t - floor[5]) / floor[6], 0.0), 1.0)
        swing = ramp * np.sin(w * t + floor[4])
        for k in range(3):
            dspeed[0, k] = floor[k] * swing
            speed[0, k] = -floor[k] * ramp * np.cos(w * t + floor[4]) / w
    q = work[14]
    for i in range(bodies):
        q[i] = rest[i] + x[i]
    kinematics(chain, q, v, work)

    # the blows
    total = 0.0
    f0 = f1 = f2 = 0.0
    for i in range(blows.shape[0]):
        if on[i]:
            size = _blow(t, blows[i])
            total += size
            f0 += size * blows[i, 4]
            f1 += size * blows[i, 5]
            f2 += size * blows[i, 6]
    r = np.empty(3)
    if f0 != 0.0 or f1 != 0.0 or f2 != 0.0:
        for k in range(3):
            r[k] = place[body, k]
            for j in range(3):
                r[k] += turn[body, k, j] * off_f[j]
        push(work, body, r[0], r[1], r[2], f0, f1, f2)

    # springs between a point and the world
    for i in range(points.shape[0]):
        at = int(points[i, 1])
        for k in range(3):
            r[k] = turn[at, k, 0] * points[i, 2] + turn[at, k, 1] * points[i, 3]
            r[k] += turn[at, k, 2] * points[i, 4]
        u0 = speed[at, 0] + spin[at, 1] * r[2] - spin[at, 2] * r[1]
        u1 = speed[at, 1] + spin[at, 2] * r[0] - spin[at, 0] * r[2]
        u2 = speed[at, 2] + spin[at, 0] * r[1] - spin[at, 1] * r[0]
        p0, p1, p2 = place[at, 0] + r[0], place[at, 1] + r[1], place[at, 2] + r[2]
        d0, d1, d2 = p0 - points[i, 5], p1 - points[i, 6], p2 - points[i, 7]
        k, c = points[i, 8], points[i, 9]
        if int(points[i, 0]) == 0:
            push(work, at, p0, p1, p2, -k * d0 - c * u0, -k * d1 - c * u1, -k * d2 - c * u2)
        else:
            n0, n1, n2 = points[i, 11], points[i, 12], points[i, 13]
            along, fast = n0 * d0 + n1 * d1 + n2 * d2, n0 * u0 + n1 * u1 + n2 * u2
            size = max(0.0, points[i, 10] - k * along - c * fast) - points[i, 10]
            push(work, at, p0, p1, p2, size * n0, size * n1, size * n2)

    dynamics(chain, gravity, work)
    matrix, bias = work[12], work[13]
    for i in range(n):
        value = hold[i]
        if i < bodies:
            value -= bias[i]
        for j in range(n):
            value -= stiffness[i, j] * x[j] + damper[i, j] * v[j]
        acc[i] = value
    for i in range(elements.shape[0]):
        inner = int(elements[i, 8])
        z = aux[inner] if inner >= 0 else 0.0
        torque, rate = _element(elements[i], x, v, z, mode[i], t, past_t, past_x, count)
        a, b = int(elements[i, 1]), int(elements[i, 2])
        acc[a] -= torque
        if b >= 0:
            acc[b] += torque
        if inner >= 0:
            daux[inner] = rate

    # Cholesky, in place
    for i in range(bodies):
        matrix[i, i] += inertia[i]
    for i in range(bodies):
        for j in range(i + 1):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            if i == j:
                matrix[i, i] = np.sqrt(value)
            else:
                matrix[i, j] = value / matrix[j, j]
    _solve(matrix, inertia, bodies, acc)
    _stick(elements, mode, matrix, inertia, bodies, acc, held)

    if write:
        for k in range(3):
            r[k] = 0.0
            for j in range(3):
                r[k] += turn[body, k, j] * off_t[j]
        x0, x1, x2 = place[body, 0] + r[0], place[body, 1] + r[1], place[body, 2] + r[2]
        w0, w1, w2 = spin[body, 0], spin[body, 1], spin[body, 2]
        e0, e1, e2 = dspin[body, 0], dspin[body, 1], dspin[body, 2]
        c0, c1, c2 = w1 * r[2] - w2 * r[1], w2 * r[0] - w0 * r[2], w0 * r[1] - w1 * r[0]
        a0 = dspeed[body, 0] + e1 * r[2] - e2 * r[1] + w1 * c2 - w2 * c1
        a1 = dspeed[body, 1] + e2 * r[0] - e0 * r[2] + w2 * c0 - w0 * c2
        a2 = dspeed[body, 2] + e0 * r[1] - e1 * r[0] + w0 * c1 - w1 * c0
        for i in range(bodies):
            j0, j1, j2 = jacobian_column(chain, work, i, body, x0, x1, x2)
            a0 += j0 * acc[i]
            a1 += j1 * acc[i]
            a2 += j2 * acc[i]
        g0, g1, g2 = a0 - gravity[0], a1 - gravity[1], a2 - gravity[2]
        for k in range(3):
            # column k of the tool's rotation
            s0 = s1 = s2 = 0.0
            for j in range(3):
                s0 += turn[body, 0, j] * turn_t[j, k]
                s1 += turn[body, 1, j] * turn_t[j, k]
                s2 += turn[body, 2, j] * turn_t[j, k]
            out[k] = s0 * g0 + s1 * g1 + s2 * g2
        out[3], out[4], out[5] = a0, a1, a2
        out[6], out[7], out[8] = speed[body, 0] + c0, speed[body, 1] + c1, speed[body, 2] + c2
        out[9], out[10], out[11] = x0, x1, x2
        if floor[4] > 0.0:
            square = (2.0 * np.pi * floor[3]) ** 2
            for k in range(3):
                out[9 + k] -= floor[k] * swing / square
        out[12] = total
        for i in range(joints.shape[0]):
            value = 0.0
            for j in range(n):
                value += joints[i, j] * x[j]
            out[13 + i] = value
