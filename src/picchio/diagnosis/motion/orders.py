"""Which harmonics of the motor's angle a torque's residual holds: found, not given."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.motion.system import System
from picchio.model.motion import RIPPLE, TORQUE

_FALSE_ALARM = 1e-4
_FINE = 0.5  # of a radian of the highest order, between the grid's angles
_MOST = 6
_FASTEST = 0.4  # of the sampling rate
_WIDTH = 400  # orders about each that tell the local level


def find_orders(system: System, residual: FloatArray, joint: str) -> list[float]:
    """Orders whose line stands out of its neighbourhood, the strongest first.

    The residual, band and above together, is held against exp(i order angle) for all orders that
    the record's speed and rate allow. Its local median tells what no ripple would leave; a line
    must be above that by more than chance makes of so many.

    Args:
        system: the training equations.
        residual: (rows,).
        joint: whose torque.

    Returns:
        cycles a turn of the motor (of the joint, where the gear ratio is not known).
    """
    pieces = _pieces(system, residual, joint)
    if not pieces:
        return []
    ratio = system.predictors[0].nominal.gear_ratio[joint]
    travel = max(float(np.ptp(angle)) for angle, _ in pieces)
    rates = [s.rate for s in system.logs]
    fastest = max(float(np.abs(np.diff(angle)).max()) * min(rates) for angle, _ in pieces)
    highest = 2.0 * np.pi * _FASTEST * min(rates) / fastest
    step = 0.25 * 2.0 * np.pi / travel
    lowest = 6.0 * np.pi / travel  # three periods in the record
    if travel == 0.0 or highest <= lowest + 50 * step:
        return []
    orders, power = _spectrum(pieces, lowest, highest, step)
    return [_finer(pieces, orders[i], step) / ratio for i in _peaks(power)]


def _pieces(
    system: System, residual: FloatArray, joint: str
) -> list[tuple[FloatArray, FloatArray]]:
    """Angle and residual of every record in which the joint moves, at the ripple's samples."""
    pieces = []
    for record, predictor in enumerate(system.predictors):
        of = {s.group: s for s in system.segments if s.record == record}
        ripple, torque = of.get((RIPPLE, joint)), of.get((TORQUE, joint))
        if torque is None:
            continue
        fine = torque if ripple is None else ripple
        values = residual[fine.rows].copy()
        if ripple is not None:
            values += np.interp(ripple.samples, torque.samples, residual[torque.rows])
        pieces.append((predictor.nominal.angle[joint][fine.samples], values - values.mean()))
    return pieces


def _spectrum(pieces: list[tuple[FloatArray, FloatArray]], lowest: float, highest: float,
              step: float) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Power at orders from lowest to highest, rad^-1: values spread over a grid of angles, FFT."""
    spacing = _FINE / highest
    size = 1 << int(np.ceil(np.log2(2.0 * np.pi / (step * spacing))))
    orders = np.arange(size // 2 + 1) * (2.0 * np.pi / (size * spacing))
    # Linear spreading is a convolution with a triangle, whose transform is sinc^2.
    response = np.sinc(orders * spacing / (2.0 * np.pi)) ** 2
    power = np.zeros(orders.size)
    for angle, values in pieces:
        place = (angle - angle.min()) / spacing
        cell = np.floor(place).astype(np.intp)
        part = place - cell
        grid = np.bincount(cell, (1.0 - part) * values, size) + (
            np.bincount(cell + 1, part * values, size)
        )  # fmt: skip
        scale = float(values @ values) or 1.0
        power += np.abs(np.fft.rfft(grid[:size]) / response) ** 2 / scale
    inside = (orders >= lowest) & (orders <= highest)
    return orders[inside], power[inside]


def _power(pieces: list[tuple[FloatArray, FloatArray]], orders: FloatArray) -> FloatArray:
    """The same at few orders, exactly."""
    power = np.zeros(orders.size)
    for angle, values in pieces:
        scale = float(values @ values) or 1.0
        power += np.abs(np.exp(-1j * np.outer(orders, angle)) @ values) ** 2 / scale
    return power


def _peaks(power: FloatArray) -> list[int]:
    from scipy.ndimage import median_filter

    width = min(_WIDTH, power.size // 2) | 1
    level = median_filter(power, width, mode="nearest") / np.log(2.0)
    ratio = power / np.maximum(level, 1e-300)
    threshold = np.log(power.size / _FALSE_ALARM)
    inner = (ratio[1:-1] >= ratio[:-2]) & (ratio[1:-1] > ratio[2:]) & (ratio[1:-1] > threshold)
    found = np.flatnonzero(inner) + 1
    kept: list[int] = []
    for i in found[np.argsort(-ratio[found])]:
        if all(abs(i - other) > 12 for other in kept):
            kept.append(int(i))
    return kept[:_MOST]


def _finer(pieces: list[tuple[FloatArray, FloatArray]], order: float, step: float) -> float:
    near = order + np.linspace(-step, step, 41)
    return float(near[int(np.argmax(_power(pieces, near)))])
