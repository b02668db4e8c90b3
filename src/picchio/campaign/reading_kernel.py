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
    for s in range(x.shape[0]):
        for r in range(3):
            total = 0.0
            for i in range(n):
                total += jacobian[r, i] * a[s, i]
                for k in range(n):
                    total += gradient[k, r, i] * (x[s, k] * a[s, i] + v[s, k] * v[s, i])
            out[r, s] = total


@njit(cache=True, nogil=True)
def felt(jacobian, gradient, rotation, gravity, x, acceleration, out):
    """What a sensor of gravity feels, less its value at rest: R^T (a - g), (3, k) into `out`.

    To second order R^T f = R0^T exp(-[turn]) f, where turn is how the frame has turned since
    rest, as a rotation vector in the world. rotation is R0 (3, 3), acceleration (3, k).
    """
    n = jacobian.shape[1]
    turn, f, once, seen = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for s in range(x.shape[0]):
        for r in range(3):
            total = 0.0
            for i in range(n):
                total += jacobian[3 + r, i] * x[s, i]
                for k in range(n):
                    total += 0.5 * gradient[k, 3 + r, i] * x[s, k] * x[s, i]
            turn[r] = total
            f[r] = acceleration[r, s] - gravity[r]
        for r in range(3):
            p, q = (r + 1) % 3, (r + 2) % 3
            once[r] = turn[p] * f[q] - turn[q] * f[p]
        for r in range(3):
            p, q = (r + 1) % 3, (r + 2) % 3
            twice = turn[p] * once[q] - turn[q] * once[p]
            seen[r] = f[r] - once[r] + 0.5 * twice + gravity[r]
        for r in range(3):
            out[r, s] = (
                rotation[0, r] * seen[0] + rotation[1, r] * seen[1] + rotation[2, r] * seen[2]
            )
