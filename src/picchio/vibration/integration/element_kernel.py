"""The nonlinear elements' forces, compiled; what each is: `picchio.model.system`."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import math

import numpy as np
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
    if kind == 5:  # bilinear: more stiffness, or less, on one side
        return -parameters[0] * max(d, 0.0)
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
def _straight(kind, parameters, d0, rate0, d1, rate1, length, out):
    """Whether the path stays on one side of every kink; `kink_correction` is then known.

    The force is a spring's and a damper's there, and the path a cubic, which lies within the hull
    of its four control points, as its rate lies within that of three.
    """
    a, b = d0 + length * rate0 / 3.0, d1 - length * rate1 / 3.0
    low, high = min(min(d0, d1), min(a, b)), max(max(d0, d1), max(a, b))
    rise = d1 - d0
    spring, damper = 0.0, 0.0
    if kind == 0:
        stiffness, half, rest = parameters[0], 0.5 * parameters[1], parameters[2]
        if low + rest >= -half and high + rest <= half:
            spring = stiffness
        elif not (low + rest >= half or high + rest <= -half):
            return False
    elif kind == 5:
        if low >= 0.0:
            spring = -parameters[0]
        elif high > 0.0:
            return False
    else:
        middle = 3.0 * rise / length - rate0 - rate1
        slow, fast = min(min(rate0, rate1), middle), max(max(rate0, rate1), middle)
        stiffness, damping = parameters[0], parameters[1]
        if parameters[2] - stiffness * high - damping * fast >= 0.0:
            spring, damper = -stiffness, -damping
        elif parameters[2] - stiffness * low - damping * slow > 0.0:
            return False
    mean = spring * length * (rate0 - rate1) / 12.0
    moment = spring * (rise / 60.0 + length * (rate0 / 30.0 - rate1 / 20.0))
    if damper != 0.0:
        average = 0.5 * rise + length * (rate0 - rate1) / 12.0
        mean += damper * (rise / length - 0.5 * (rate0 + rate1))
        moment += damper * ((rise - average) / length - rate0 / 6.0 - rate1 / 3.0)
    _line(mean, moment, out)
    return True


@njit(cache=True, nogil=True)
def _line(mean, moment, out):
    """The straight line on [0, 1] of a mean and first moment: its values at both ends."""
    out[0] = 4.0 * mean - 6.0 * moment
    out[1] = 6.0 * moment - 2.0 * mean


# Gauss's rule of six points on [0, 1]: exact for polynomials up to the eleventh degree.
_AT = 0.5 + 0.5 * np.polynomial.legendre.leggauss(6)[0]
_WEIGHTS = 0.5 * np.polynomial.legendre.leggauss(6)[1]


@njit(cache=True, nogil=True)
def _bent(parameters, d0, rate0, d1, rate1, length, out):
    """As `kink_correction`, of a cubic spring.

    The force on a cubic path is a polynomial of the ninth degree, its first moment exact, too.
    """
    f0, f1 = -parameters[0] * d0 * d0 * d0, -parameters[0] * d1 * d1 * d1
    mean, moment = 0.0, 0.0
    for i in range(6):
        s = _AT[i]
        path, _ = _on_the_way(d0, rate0, d1, rate1, length, s)
        above = -parameters[0] * path * path * path - f0 - (f1 - f0) * s
        mean += _WEIGHTS[i] * above
        moment += _WEIGHTS[i] * above * s
    _line(mean, moment, out)


@njit(cache=True, nogil=True)
def _on_the_way(d0, rate0, d1, rate1, length, s):
    """Deflection and rate at a share of a step, on the cubic path between its ends."""
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
    return path, rate


@njit(cache=True, nogil=True)
def kink_correction(kind, parameters, d0, rate0, d1, rate1, length, out):
    """What the best straight line through a force has above its two ends' values.

    Over a step the force is taken as a straight line in time. Where the path from (d0, rate0) to
    (d1, rate1), a cubic, crosses a kink, or a spring hardens, the line with the force's own mean
    and first moment is better than the one through its ends. Into `out` (2,): to be added at start
    and end. Returns whether the path stays clear of all kinks.
    """
    if kind == 1:
        _bent(parameters, d0, rate0, d1, rate1, length, out)
        return True
    if _straight(kind, parameters, d0, rate0, d1, rate1, length, out):
        return True
    f0 = element_force(kind, parameters, d0, rate0, 0.0)
    f1 = element_force(kind, parameters, d1, rate1, 0.0)
    mean = 0.0
    moment = 0.0
    for i in range(_POINTS):
        s = (i + 0.5) / _POINTS
        path, rate = _on_the_way(d0, rate0, d1, rate1, length, s)
        above = element_force(kind, parameters, path, rate, 0.0) - f0 - (f1 - f0) * s
        mean += above / _POINTS
        moment += above * s / _POINTS
    _line(mean, moment, out)
    return False
