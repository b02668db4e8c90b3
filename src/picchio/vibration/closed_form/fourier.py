"""The paper's truncated Fourier solution, kept to compare."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.excitation.excitation import Excitation
from picchio.excitation.piecewise import PiecewiseForce
from picchio.vibration.closed_form.modes import Modes


def truncated_fourier_response(
    modes: Modes,
    excitation: Excitation | PiecewiseForce,
    direction: ArrayLike,
    time: ArrayLike,
    harmonics: int,
) -> FloatArray:
    """The steady state as a Fourier sum of `harmonics` terms: paper eqs. 12 and 13.

    Eq. 13 is written here in complex form, where amplitude and phase are those of
    H(i j w) (a_j - i b_j); its arctangent thereby takes the right quadrant, which the plain
    tan^-1 of the paper does not above resonance.

    Args:
        modes: the system.
        excitation: the blows; of a `PiecewiseForce`, one period.
        direction: (3,) the force's direction, taken as it is.
        time: (k,) s.
        harmonics: number of terms after the mean.

    Returns:
        (m, k) deflection, rad.
    """
    force = excitation.one_period() if isinstance(excitation, Excitation) else excitation
    coefficients = force.fourier_coefficients(harmonics)
    omega = 2.0 * np.pi / force.end * np.arange(harmonics + 1)
    transfer = np.einsum(
        "mdk,d->mk", modes.frequency_response(omega), np.asarray(direction, dtype=float)
    )
    spectrum = transfer * coefficients
    spectrum[:, 1:] *= 2.0  # the negative frequencies
    t = np.asarray(time, dtype=float)
    total = np.zeros((spectrum.shape[0], t.size))
    for first in range(0, harmonics + 1, 2048):  # bounded memory for long sums
        part = slice(first, first + 2048)
        total += (spectrum[:, part] @ np.exp(1j * np.outer(omega[part], t))).real
    return total
