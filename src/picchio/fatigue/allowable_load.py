"""Allowable load for a target life."""

from __future__ import annotations

from collections.abc import Callable

from picchio.core.errors import InputError


def largest_factor(spent: Callable[[float], float], limit: float, tolerance: float = 0.0) -> float:
    """The largest factor whose damage is within a limit, by bisection.

    Args:
        spent: damage at a factor, never falling; an InputError (above the static strength)
            counts as endless damage.
        limit: what may be spent.
        tolerance: relative, of the factor; 0: to the last bit.

    Raises:
        InputError: even a vanishing factor spends more, so what does not scale breaks the part.
    """

    def too_much(factor: float) -> bool:
        try:
            return spent(factor) > limit
        except InputError:
            return True

    low, high = 1.0, 1.0
    while too_much(low):
        high, low = low, low / 2.0
        if low < 1e-12:
            raise InputError("the steady stress alone breaks the part", key="steady_stress")
    while not too_much(high):
        low, high = high, high * 2.0
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high) or high - low <= tolerance * high:
            return low
        low, high = (low, middle) if too_much(middle) else (middle, high)
