"""How a linear system's motion changes with its matrices, to first order, without integrating.

In the modes of the state matrix A the response is a sum of y_k, y_k' = pole_k y_k + F. A change of
A, P in those modes, adds (y_j - y_i) / (pole_j - pole_i) for every pair of modes and dy_i/dpole_i
for every mode (Nelson, AIAA J. 14 (1976) 1201, doi:10.2514/3.7211, has the same for modes alone):
two series a mode serve every change there is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.model.system import VibratingSystem
from picchio.vibration.integration.integrate import Plan

# Poles nearer to each other than this share are one: their difference quotient is a derivative.
_ALIKE = 1e-7


@dataclass(frozen=True, eq=False)
class MotionChanges:
    """Changes of a motion as weights on common series.

    Attributes:
        series: (S, count) at the samples.
        position, velocity, acceleration: (changes, N, S) weights: rad, rad/s, rad/s^2.
    """

    series: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


def motion_changes(
    system: VibratingSystem,
    plan: Plan,
    count: int,
    pairs: Sequence[tuple[VibratingSystem, VibratingSystem]],
    louder: FloatArray | None = None,
) -> MotionChanges | None:
    """By how much the motion from rest changes between systems that differ little.

    Args:
        system: about which; its terms of second order are left out.
        plan: the steps, as `follow` takes them.
        count: of samples.
        pairs: (before, after) of each change, with the same coordinates.
        louder: (changes,) by what share of the plan's the force changes as well.

    Returns:
        one change a pair; None where a system is not linear or its modes are not independent.
    """
    from picchio.vibration.integration.series_kernel import modal_series

    if system.elements or any(s.coordinates != system.coordinates for p in pairs for s in p):
        return None
    n = len(system.coordinates)
    inverse = np.linalg.inv(system.mass)
    held = inverse @ np.hstack([system.stiffness, system.damping])
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-held]])
    poles, modes = np.linalg.eig(state)
    if not np.isfinite(modes).all() or np.linalg.cond(modes) > 1e10:
        return None
    back = np.linalg.inv(modes)
    driven = back[:, n:] @ (inverse @ system.force)

    # What changes of M^-1 [K C] and of M^-1 b, and that in the modes.
    mass = np.array([after.mass - before.mass for before, after in pairs])
    springs = np.array([
        np.hstack([after.stiffness - before.stiffness, after.damping - before.damping])
        for before, after in pairs
    ])  # fmt: skip
    force = np.array([after.force - before.force for before, after in pairs])
    held_change = inverse @ (springs - mass @ held)
    push = (force - mass @ (inverse @ system.force)) @ inverse.T
    among = -back[:, n:] @ held_change @ modes

    apart = poles[None, :] - poles[:, None]  # [i, j]: pole_j - pole_i
    alike = np.abs(apart) < _ALIKE * np.abs(poles).max()
    quotient = np.where(alike, 0.0, among * driven / np.where(alike, 1.0, apart))
    weights = quotient.astype(complex)
    index = np.arange(2 * n)
    weights[:, index, index] += push @ back[:, n:].T - quotient.sum(axis=2)
    if louder is not None:
        weights[:, index, index] += louder[:, None] * driven
    on_series = modes @ weights
    on_slopes = modes @ np.where(alike, among * driven, 0.0)

    # Of a conjugate pair one is enough, twice its real part.
    kept = np.flatnonzero(poles.imag >= 0.0)
    twice = np.where(poles[kept].imag > 0.0, 2.0, 1.0)
    y = np.zeros((count, kept.size), dtype=complex)
    slope, pushed = np.zeros_like(y), np.zeros(count)
    modal_series(
        poles[kept], plan.lengths, plan.force0, plan.force1, plan.sample, plan.force_after,
        y, slope, pushed,
    )  # fmt: skip

    def rows(first: np.ndarray, second: np.ndarray, straight: FloatArray) -> FloatArray:
        one, two = first[..., kept] * twice, second[..., kept] * twice
        return np.concatenate([one.real, -one.imag, two.real, -two.imag, straight], axis=-1)

    none = np.zeros((len(pairs), n, 1))
    moving, moving_slope = on_series[:, n:], on_slopes[:, n:]
    return MotionChanges(
        np.concatenate([y.real.T, y.imag.T, slope.real.T, slope.imag.T, pushed[None]]),
        rows(on_series[:, :n], on_slopes[:, :n], none),
        rows(moving, moving_slope, none),
        # y' = pole y + F, and (dy/dpole)' = pole dy/dpole + y.
        rows(moving * poles + moving_slope, moving_slope * poles,
             moving.sum(axis=2).real[..., None]),
    )  # fmt: skip
