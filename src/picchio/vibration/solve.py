"""The exact response of every mode to a force in pieces."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import ComplexArray
from picchio.core.errors import InputError
from picchio.excitation import Excitation, PiecewiseForce
from picchio.vibration.modes import Modes
from picchio.vibration.response import Response

# |1 - exp(pole T)| below this: the blows keep step with a mode that nothing damps.
_RESONANCE = 1e-10


def steady_state(modes: Modes, excitation: Excitation | PiecewiseForce) -> Response:
    """The exact periodic response, no Fourier sum: paper eq. 13 without truncation.

    Between the jumps of the force each mode is a free decay about a particular solution; the
    state that repeats after one period follows from one division.

    Args:
        modes: the system.
        excitation: the blows; of a `PiecewiseForce`, one period.

    Returns:
        the response over one period.

    Raises:
        InputError: an undamped mode in resonance with the blows: no steady state exists.
    """
    force = excitation.one_period() if isinstance(excitation, Excitation) else excitation
    if not np.isfinite(force.end):
        raise InputError("a steady state needs a force with a finite period")
    zero = np.zeros(modes.poles.size, dtype=complex)
    after_one_period = _propagate(modes.poles, force, zero)[:, -1]
    remaining = -np.expm1(modes.poles * force.end)  # 1 - exp(pole T)
    undamped = modes.poles.real >= 0.0
    stuck = undamped & (np.abs(remaining) < _RESONANCE)
    if stuck.any():
        frequency = float(np.abs(modes.poles[stuck][0].imag)) / (2.0 * np.pi)
        raise InputError(
            f"the mode at {frequency:.6g} Hz has no damping and is in resonance with blows every "
            f"{force.end:g} s: its vibration grows without end",
            key="damping_ratio",
            value=0.0,
            hint="give the joints a damping ratio above 0, or another period",
        )
    states = _propagate(modes.poles, force, after_one_period / remaining)
    return Response(modes, force, states[:, :-1], periodic=True)


def response_from_rest(
    modes: Modes, excitation: Excitation | PiecewiseForce, hits: int | None = None
) -> Response:
    """The exact response to a burst from rest, ring-down included.

    Args:
        modes: the system.
        excitation: the blows, or a force history (whose last piece may be endless).
        hits: how many blows, for an `Excitation`.

    Returns:
        the response from the first blow on.

    Raises:
        InputError: hits below 1, or none given for an excitation.
    """
    if isinstance(excitation, Excitation):
        if hits is None:
            raise InputError("how many hits the burst has must be given", key="hits")
        force = excitation.burst(hits)
    else:
        force = excitation
    rest = np.zeros(modes.poles.size, dtype=complex)
    return Response(modes, force, _propagate(modes.poles, force, rest)[:, :-1], periodic=False)


def _propagate(poles: ComplexArray, force: PiecewiseForce, state: ComplexArray) -> ComplexArray:
    """Modal states at every piece's start and at the end: (p, m + 1)."""
    duration = np.where(np.isfinite(force.duration), force.duration, 0.0)
    index = np.arange(duration.size)
    gained = force.convolve(poles, index, duration)
    kept = np.exp(poles[:, None] * duration)
    states = np.empty((poles.size, duration.size + 1), dtype=complex)
    states[:, 0] = state
    for i in index:
        states[:, i + 1] = kept[:, i] * states[:, i] + gained[:, i]
    return states
