"""Eq. 12: the Fourier series of the pulse train, as it is written."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import ComplexArray
from picchio.excitation import PulseTrain


def printed_series(blows: PulseTrain, harmonics: int) -> ComplexArray:
    """Eq. 12: a0, then a_j - i b_j, (harmonics + 1,) N."""
    j = np.arange(1, harmonics + 1)
    share = blows.width / blows.period
    a = blows.force / (j * np.pi) * np.sin(2.0 * np.pi * j * share)
    b = blows.force / (j * np.pi) - blows.force / (j * np.pi) * np.cos(2.0 * np.pi * j * share)
    return np.concatenate([[blows.force * share], a - 1j * b])
