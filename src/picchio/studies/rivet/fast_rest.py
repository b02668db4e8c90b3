"""Compiled turning points of a rivet whose stiffness, damping and blows are varied many times.

A common factor on all stiffnesses, or on all damping ratios, moves the poles and leaves the mode
shapes alone: one modal analysis serves every variation. Importing this module loads numba.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.excitation.piecewise import PiecewiseForce
from picchio.vibration.batch.modal_kernel import coefficients
from picchio.vibration.batch.turning_kernel import most_samples, turning_values
from picchio.vibration.closed_form.modes import Modes
from picchio.vibration.closed_form.response import RING_DOWN_LEVEL

_NEARLY_CRITICAL = 1.0 - 1e-6


class FastRest:
    """The turning points from rest, for one direction; exact to 1e-7 of the largest.

    Attributes:
        omega: (n,) rad/s, undamped.
        ratio: (n,) damping ratios.
        weights: (m, n) deflection of each joint per mode, 1/kg: of a mode whose equation is
            eta'' + 2 zeta omega eta' + omega^2 eta = F.
    """

    def __init__(self, modes: Modes, direction: FloatArray) -> None:
        along = modes.residues @ direction
        self.omega = np.abs(modes.poles)
        self.ratio = -modes.poles.real / self.omega
        self.weights = np.ascontiguousarray(-along.imag * modes.poles.imag)

    @staticmethod
    def suits(modes: Modes) -> bool:
        """Whether every mode is an oscillator of its own that swings and dies."""
        ratio = modes.damping_ratios
        return modes.decoupled and bool(((ratio > 0.0) & (ratio < _NEARLY_CRITICAL)).all())

    def turns(
        self, stiffness: float, damping: float, force: PiecewiseForce
    ) -> list[FloatArray] | None:
        """Every joint's deflection at rest, at its turns and at the end of the ring-down, rad.

        Args:
            stiffness: factor on all stiffnesses.
            damping: factor on all damping ratios.
            force: a burst, its last piece endless.

        Returns:
            m arrays; None where the damping reaches critical.
        """
        ratio = damping * self.ratio
        if ratio.max() >= _NEARLY_CRITICAL:
            return None
        omega = math.sqrt(stiffness) * self.omega
        poles = omega * (-ratio + 1j * np.sqrt(1.0 - ratio**2))
        turns, count = _turns(
            poles, self.weights, force.duration, force.constant, force.slope, force.amplitude,
            force.angular_frequency,
        )  # fmt: skip
        return [row[: int(k)] for row, k in zip(turns, count, strict=True)]


@numba.njit(cache=True, error_model="numpy")
def _turns(
    poles: ComplexArray,
    weights: FloatArray,
    duration: FloatArray,
    constant: FloatArray,
    slope: FloatArray,
    amplitude: ComplexArray,
    wave: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Turning values (m, k) and how many each joint has (m,)."""
    outputs = weights.shape[0]
    rows = np.empty((poles.shape[0], duration.shape[0], 7), dtype=np.complex128)
    coefficients(poles, duration, constant, slope, amplitude, wave, False, rows)
    length = duration.copy()
    length[-1] = -np.log(RING_DOWN_LEVEL) / (-poles.real).min()
    turns, count = np.empty((outputs, most_samples(poles, wave, length))), np.empty(outputs)
    all_of_it = np.full(outputs, -1.0)
    turning_values(
        poles, rows, wave, length, constant, slope, amplitude, weights, all_of_it, turns, count
    )
    return turns, count
