"""Compiled: residuals in units of their noise, and samples near jumps."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from numba import njit

from picchio.measurement.noise.whiten_kernel import whiten


@njit(cache=True, nogil=True)
def whitened(measured, predicted, offset, unknown, filler, predictors, deviation, room, out):
    """What the colour of the noise does not predict of measured less predicted, in its units.

    measured and predicted are (m,) or longer; `offset` is subtracted, too. Where unknown (m,) or
    (0,) holds, the difference counts as none before the filter, and `filler` stands after it.
    predictors (p + 1, p) and deviation (p + 1,) are as in `whiten`; room is (m,). Into `out` (m,).
    """
    masked = unknown.size > 0
    for i in range(out.size):
        room[i] = measured[i] - predicted[i] - offset
        if masked and unknown[i]:
            room[i] = 0.0
    whiten(room, predictors, deviation, out)
    if masked:
        for i in range(out.size):
            if unknown[i]:
                out[i] = filler[i]


@njit(cache=True, nogil=True)
def near_edges(start, step, rate, delay, edges, near, out):
    """Which samples stand within `near` s of an edge, into `out` (m,).

    Sample i is of the time (start + step i) (1 + rate) - delay; edges (k,) ascend, k > 0.
    """
    place = 0
    for i in range(out.size):
        time = (start + step * i) * (1.0 + rate) - delay
        while place < edges.size and edges[place] < time:
            place += 1
        distance = abs(time - edges[max(place - 1, 0)])
        distance = min(distance, abs(time - edges[min(place, edges.size - 1)]))
        out[i] = distance < near
