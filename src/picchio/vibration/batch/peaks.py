"""Peaks at many poses at once, in compiled code: the kernel behind envelopes and maps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.processes import on_threads
from picchio.excitation.excitation import Excitation
from picchio.excitation.piecewise import PiecewiseForce
from picchio.model.linear_system import LinearSystem, modal_damping_matrix
from picchio.vibration.closed_form.modes import modal_analysis
from picchio.vibration.closed_form.response import response_from_rest, steady_state, unit_vector


@dataclass(frozen=True, eq=False)
class BatchPeaks:
    """Peaks at p poses of n joints.

    Attributes:
        natural_frequencies: (p, n) Hz; NaN where the mass matrix is not positive definite.
        peak_deflection: (p, n) rad, over time and, if asked, over all directions.
        direction: (p, n, 3) unit vector that gives it; either sign.
    """

    natural_frequencies: FloatArray
    peak_deflection: FloatArray
    direction: FloatArray


def batch_peaks(
    mass_matrix: FloatArray,
    jacobian: FloatArray,
    stiffness: FloatArray,
    damping_ratio: ArrayLike,
    excitation: Excitation | PiecewiseForce,
    *,
    hits: int | None = None,
    direction: ArrayLike | None = None,
    compiled: bool = True,
) -> BatchPeaks:
    """Largest deflection of every joint at many poses, exact in time and in direction.

    Modal damping only; over-damped and undamped modes take the exact NumPy path, pose by pose.

    Args:
        mass_matrix: (p, n, n) kg m^2.
        jacobian: (p, 3, n) m.
        stiffness: (n,) or (p, n) N m/rad.
        damping_ratio: scalar or (n,), one for each joint.
        excitation: the blows, or their force: one period of the steady state, or a burst.
        hits: of a burst from rest; None for the steady state. Only where blows are given.
        direction: (3,) or (p, 3); None for the worst of all directions.
        compiled: False takes the NumPy path throughout: the oracle.

    Returns:
        the peaks; a relative error of 1e-9 or less.

    Raises:
        InputError: a direction of length zero, no hits, a resonance without damping.
    """
    poses, n = mass_matrix.shape[0], mass_matrix.shape[1]
    springs = _plain(np.broadcast_to(stiffness, (poses, n)))
    ratios = _plain(np.broadcast_to(damping_ratio, (n,)))
    along = _directions(direction, poses)
    if isinstance(excitation, PiecewiseForce):
        force = excitation
    else:
        force = excitation.one_period() if hits is None else excitation.burst(hits)
    periodic = bool(np.isfinite(force.end))
    found = BatchPeaks(
        np.full((poses, n), np.nan), np.full((poses, n), np.nan), np.full((poses, n, 3), np.nan)
    )
    if compiled:
        from picchio.vibration.batch.peak_kernel import SPAN, peaks

        on_threads(
            peaks, poses, SPAN,
            periodic, force.start, force.duration, force.constant, force.slope,
            force.amplitude, force.angular_frequency, _plain(mass_matrix), _plain(jacobian),
            springs, ratios, along,
            found.natural_frequencies, found.peak_deflection, found.direction,
        )  # fmt: skip
        left = np.isnan(found.peak_deflection[:, 0]) & ~np.isnan(found.natural_frequencies[:, 0])
    else:
        left = np.ones(poses, dtype=bool)
    for s in np.flatnonzero(left):
        row = along[s] if len(along) else None
        _exactly(mass_matrix[s], jacobian[s], springs[s], ratios, force, row, found, int(s))
    return found


def _plain(values: ArrayLike) -> FloatArray:
    """A contiguous, writable array: the kernel would be compiled again for read-only ones."""
    return np.require(values, np.float64, ("C", "W"))


def _directions(direction: ArrayLike | None, poses: int) -> FloatArray:
    if direction is None:
        return np.empty((0, 3))
    given = np.asarray(direction, dtype=float)
    if given.ndim == 1:
        return np.tile(unit_vector(given), (poses, 1))
    if given.shape != (poses, 3):
        raise InputError(f"must be (3,) or ({poses}, 3)", key="direction", value=given.shape)
    return np.array([unit_vector(row) for row in given]).reshape(poses, 3)


def _exactly(
    mass: FloatArray,
    jacobian: FloatArray,
    springs: FloatArray,
    ratios: FloatArray,
    force: PiecewiseForce,
    along: FloatArray | None,
    found: BatchPeaks,
    s: int,
) -> None:
    """One pose by the path that takes every damping."""
    n = len(springs)
    damping = modal_damping_matrix(mass, springs, ratios)
    names = tuple(str(j) for j in range(n))
    system = LinearSystem(mass, damping, np.diag(springs), jacobian.T, np.eye(n), names)
    modes = modal_analysis(system)
    periodic = np.isfinite(force.end)
    response = steady_state(modes, force) if periodic else response_from_rest(modes, force)
    found.natural_frequencies[s] = modes.natural_frequencies
    if along is None:
        for j, worst in enumerate(response.worst_directions()):
            found.peak_deflection[s, j], found.direction[s, j] = worst.value, worst.direction
    else:
        found.direction[s] = along
        found.peak_deflection[s] = [abs(peak.value) for peak in response.peaks(along)]
