"""The peak of every joint in many force directions at once, as exact as one by one.

All directions share one curve g_j(t). It is sampled once; only where a direction's deflection may
exceed its own largest sample is its slope solved for zero on the closed form.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray, IndexArray
from picchio.vibration.closed_form.extrema import Grid, refine_roots
from picchio.vibration.closed_form.response import Response

_CELLS = 2_000_000
"""Directions times samples that are evaluated together: 16 MB."""


def peak_deflections(response: Response, directions: ArrayLike) -> FloatArray:
    """Largest absolute deflection of every output for each force direction.

    Args:
        response: steady or from rest.
        directions: (d, 3) unit vectors.

    Returns:
        (m, d) rad.
    """
    wanted = np.atleast_2d(np.asarray(directions, dtype=float))
    poles, residues = response.modes.poles, response.modes.residues
    grid = Grid.of(poles, response.force, response.horizon)
    modal = response._modal(grid.index, grid.local)
    value = np.einsum("mpd,pk->mdk", residues, modal).real
    rate = np.einsum("mpd,p,pk->mdk", residues, poles, modal).real
    speed = np.linalg.norm(rate, axis=1)
    step = np.diff(grid.local)
    # Neighbours in time that belong to different pieces of the force span no interval.
    step[grid.index[1:] != grid.index[:-1]] = -np.inf
    rise = step * np.maximum(speed[:, 1:], speed[:, :-1])  # how far a peak may stand out
    result = np.empty((len(residues), len(wanted)))
    block = max(1, _CELLS // grid.local.size)
    for j in range(len(residues)):
        for first in range(0, len(wanted), block):
            part = slice(first, first + block)
            size = np.abs(wanted[part] @ value[j])
            best = size.max(axis=1)
            hopeful = np.maximum(size[:, 1:], size[:, :-1]) + rise[j] > best[:, None]
            row, interval = np.nonzero(hopeful)
            along = wanted[part] @ residues[j].T
            np.maximum.at(best, *_peaks_within(response, grid, along, row, interval))
            result[j, part] = best
    return result


def _peaks_within(
    response: Response, grid: Grid, along: np.ndarray, row: IndexArray, interval: IndexArray
) -> tuple[IndexArray, FloatArray]:
    """Rows and absolute values of the peaks inside some intervals between samples.

    Args:
        response: whose.
        grid: the samples.
        along: (b, p) complex, residues along each direction.
        row: (c,) which direction.
        interval: (c,) from which sample to the next.
    """
    poles, piece = response.modes.poles, grid.index[interval]

    def slope(which: IndexArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        weighted = (along[row[which]] * poles).T
        modal = response._modal(piece[which], u)
        second = (weighted * poles[:, None] * modal).sum(axis=0).real
        jump = weighted.sum(axis=0).real * response.force.in_piece(piece[which], u)
        return (weighted * modal).sum(axis=0).real, second + jump

    # Each interval as a piece of its own, with its two ends.
    ends = Grid(np.repeat(np.arange(len(row)), 2),
                grid.local[np.stack([interval, interval + 1], axis=1)].ravel())  # fmt: skip
    which, u = refine_roots(ends, slope(ends.index, ends.local), slope)
    value = (along[row[which]].T * response._modal(piece[which], u)).sum(axis=0).real
    return row[which], np.abs(value)
