"""First- and second-order sensor filters, exact for straight lines between samples."""

from __future__ import annotations

from functools import cache

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.model.sensing import SensorChain


def apply_filters(chain: SensorChain, values: FloatArray, step: float) -> FloatArray:
    """What is left of (c, k) values `step` s apart behind the chain's mount and filters.

    Before the first sample there is rest.
    """
    from scipy.signal import lfilter

    for b, a in _transfer_functions(chain):
        numerator, denominator = _first_order_hold(tuple(b), tuple(a), step)
        values = lfilter(numerator, denominator, values, axis=-1)
    return values


def _transfer_functions(chain: SensorChain) -> list[tuple[list[float], list[float]]]:
    """Numerators and denominators in s, highest power first."""
    found = []
    if chain.mount is not None and np.isfinite(chain.mount[0]):
        w, zeta = 2.0 * np.pi * chain.mount[0], chain.mount[1]
        found.append(([w * w], [1.0, 2.0 * zeta * w, w * w]))
    if chain.highpass is not None and chain.highpass > 0.0:
        found.append(([1.0, 0.0], [1.0, 2.0 * np.pi * chain.highpass]))
    if chain.lowpass is not None and np.isfinite(chain.lowpass):
        w = 2.0 * np.pi * chain.lowpass
        found.append(([w], [1.0, w]))
    return found


@cache
def _first_order_hold(
    b: tuple[float, ...], a: tuple[float, ...], step: float
) -> tuple[FloatArray, FloatArray]:
    from scipy.signal import cont2discrete

    numerator, denominator, _ = cont2discrete((list(b), list(a)), step, method="foh")
    return np.atleast_1d(np.squeeze(numerator)), denominator
