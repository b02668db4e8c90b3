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
