"""The nonlinear elements' forces, compiled; what each is: `picchio.model.elements`."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import math

from numba import njit


@njit(cache=True, nogil=True)
def element_force(kind, parameters, d, rate, state):
    """Force along the element's row, beside what the linear equations have.

    Args:
        kind: an `ElementKind`.
        parameters: (6,).
        d: rad or m, along the row.
        rate: its rate.
        state: the element's inner state.
    """
    if kind == 0:  # backlash: the linear spring is taken out, the dead zone put in
        stiffness, gap, rest, torque = parameters[0], parameters[1], parameters[2], parameters[3]
        total = d + rest
        beyond = total - min(max(total, -0.5 * gap), 0.5 * gap)
        return stiffness * d - (stiffness * beyond - torque)
    if kind == 1:
        return -parameters[0] * d * d * d
    if kind == 2:
        return -parameters[0] * state
    if kind == 4:  # contact: unilateral
        push = parameters[2] - parameters[0] * d - parameters[1] * rate
        return max(push, 0.0) - parameters[2]
    return 0.0


@njit(cache=True, nogil=True)
def advance_state(parameters, change, z):
    """Bouc-Wen's z after the deflection has changed: exact, piece by piece.

    z' = (x' - (|x'| z + x' |z|) / 2) / d: with x rising z relaxes to 1 where it is positive and
    grows as x where it is negative; the mirror image with x falling.
    """
    if change == 0.0:
        return z
    sign = 1.0 if change > 0.0 else -1.0
    z *= sign
    left = abs(change) / parameters[1]
    if z < 0.0:
        used = min(left, -z)
        z += used
        left -= used
    if left > 0.0:
        z = 1.0 - (1.0 - z) * math.exp(-left)
    return sign * z


_POINTS = 16


@njit(cache=True, nogil=True)
def kink_correction(kind, parameters, d0, rate0, d1, rate1, length, out):
    """What the best straight line through a force with a kink has above its two ends' values.

    Over a step the force is taken as a straight line in time. Where the path from (d0, rate0) to
    (d1, rate1), a cubic, crosses a kink, the line with the force's own mean and first moment is
    better than the one through its ends. Into `out` (2,): to be added at start and end.
    """
    f0 = element_force(kind, parameters, d0, rate0, 0.0)
    f1 = element_force(kind, parameters, d1, rate1, 0.0)
    mean = 0.0
    moment = 0.0
    for i in range(_POINTS):
        s = (i + 0.5) / _POINTS
        a, b = (1.0 - s) * (1.0 - s), s * s
        path = (
            a * ((1.0 + 2.0 * s) * d0 + s * length * rate0)
            + b * ((3.0 - 2.0 * s) * d1 - (1.0 - s) * length * rate1)
        )  # fmt: skip
        rate = (
            6.0 * s * (1.0 - s) * (d1 - d0) / length
            + (1.0 - s) * (1.0 - 3.0 * s) * rate0
            + s * (3.0 * s - 2.0) * rate1
        )
        above = element_force(kind, parameters, path, rate, 0.0) - f0 - (f1 - f0) * s
        mean += above / _POINTS
        moment += above * s / _POINTS
    out[0] = 4.0 * mean - 6.0 * moment
    out[1] = 6.0 * moment - 2.0 * mean
