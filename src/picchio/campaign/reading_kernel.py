"""What an accelerometer feels, sample by sample, to second order in the deflection."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def frame_acceleration(jacobian, gradient, x, v, a, out):
    """World acceleration of a frame's origin, (3, k) into `out`.

    jacobian is (6, n), gradient (n, 6, n) its change with each coordinate; x, v, a are (k, n).
    """
    n = jacobian.shape[1]
    bent = np.empty((n, n, 3))
    for i in range(n):
        for k in range(n):
            for r in range(3):
                bent[i, k, r] = gradient[k, r, i]
    for s in range(x.shape[0]):
        to_x, to_y, to_z = 0.0, 0.0, 0.0
        for i in range(n):
            to_x += jacobian[0, i] * a[s, i]
            to_y += jacobian[1, i] * a[s, i]
            to_z += jacobian[2, i] * a[s, i]
            for k in range(n):
                both = x[s, k] * a[s, i] + v[s, k] * v[s, i]
                to_x += bent[i, k, 0] * both
                to_y += bent[i, k, 1] * both
                to_z += bent[i, k, 2] * both
        out[0, s], out[1, s], out[2, s] = to_x, to_y, to_z


@njit(cache=True, nogil=True)
def felt(jacobian, gradient, rotation, gravity, x, acceleration, out):
    """What a sensor of gravity feels, less its value at rest: R^T (a - g), (3, k) into `out`.

    To second order R^T f = R0^T exp(-[turn]) f, where turn is how the frame has turned since
    rest, as a rotation vector in the world. rotation is R0 (3, 3), acceleration (3, k).
    """
    n = jacobian.shape[1]
    bent = np.zeros((n, n, 3))  # a pair of coordinates once
    for i in range(n):
        for k in range(n):
            for r in range(3):
                bent[max(i, k), min(i, k), r] += 0.5 * gradient[k, 3 + r, i]
    for s in range(x.shape[0]):
        t0, t1, t2 = 0.0, 0.0, 0.0  # the turn
        for i in range(n):
            t0 += jacobian[3, i] * x[s, i]
            t1 += jacobian[4, i] * x[s, i]
            t2 += jacobian[5, i] * x[s, i]
            for k in range(i + 1):
                both = x[s, i] * x[s, k]
                t0 += bent[i, k, 0] * both
                t1 += bent[i, k, 1] * both
                t2 += bent[i, k, 2] * both
        f0 = acceleration[0, s] - gravity[0]
        f1 = acceleration[1, s] - gravity[1]
        f2 = acceleration[2, s] - gravity[2]
        once0, once1, once2 = t1 * f2 - t2 * f1, t2 * f0 - t0 * f2, t0 * f1 - t1 * f0
        f0 += 0.5 * (t1 * once2 - t2 * once1) - once0 + gravity[0]
        f1 += 0.5 * (t2 * once0 - t0 * once2) - once1 + gravity[1]
        f2 += 0.5 * (t0 * once1 - t1 * once0) - once2 + gravity[2]
        for r in range(3):
            out[r, s] = rotation[0, r] * f0 + rotation[1, r] * f1 + rotation[2, r] * f2
