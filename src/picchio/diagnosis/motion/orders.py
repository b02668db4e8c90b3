"""Which harmonics of the motor's angle a torque's residual holds: found, not given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.motion.order_spectrum import Spectrum, order_spectrum, power_at
from picchio.diagnosis.motion.state import State
from picchio.diagnosis.motion.system import System

_FALSE_ALARM = 1e-4  # of one search of one joint
_MOST = 6
_SIDE_LOBES = 4.0  # times those of an even sweep
_APART = 3.0  # independent lines between two that are found at once


@dataclass(frozen=True)
class Line:
    """One that stands out.

    Attributes:
        order: cycles a turn of the motor (of the joint, where the gear ratio is not known).
        noise: power of a sample's noise as this line sees it, N^2 m^2 or N^2.
    """

    order: float
    noise: float


def find_orders(system: System, residual: FloatArray, joint: str, state: State) -> list[Line]:
    """Orders whose line stands out of its neighbourhood, the strongest first.

    The residual of each record, band and above together, is held against exp(i order angle) for
    all orders that its travel, speed and rate allow. A line's power over the median of its
    neighbours tells how likely noise makes it; records, each against its own noise, are put
    together by Fisher's rule. A line must be less likely than one in ten thousand searches, in one
    record or in all together.

    Args:
        system: the training equations.
        residual: (rows,).
        joint: whose torque.
        state: whose delays say where the joint was when a torque was made; what is left close to
            one of its ripples is that ripple's size changing, and no line of its own.
    """
    spectrum = order_spectrum(system, residual, joint, state)
    if spectrum is None:
        return []
    known = [
        e.values["order"] for e in state.every if (e.name, e.target) == ("torque_ripple", joint)
    ]
    found = [_finer(spectrum, i) / spectrum.ratio for i in _peaks(spectrum, known)]
    return [Line(order, spectrum.noise(order)) for order in found]


def _together(evidence: list[FloatArray]) -> FloatArray:
    """(k,) of all records: the strongest alone, or all by Fisher's rule; less for having chosen."""
    from scipy.stats import gamma

    every = np.array(evidence)
    if len(every) == 1:
        return every[0]
    tried = np.sum(every > 0.0, axis=0)
    summed = -gamma.logsf(every.sum(axis=0), np.maximum(tried, 1))
    found: FloatArray = np.maximum(every.max(axis=0), summed) - np.log(tried + 1.0)
    return found


def _peaks(spectrum: Spectrum, known: Sequence[float]) -> list[int]:
    """The lines that noise does not make, by what each is where it is clearest.

    None that another's side lobe may be, and none beside a known one.
    """
    evidence = _together([lines.evidence for lines in spectrum.records])
    threshold = np.log(evidence.size / _FALSE_ALARM)
    inner = (evidence[1:-1] >= evidence[:-2]) & (evidence[1:-1] > evidence[2:])
    found = np.flatnonzero(inner & (evidence[1:-1] > threshold)) + 1
    kept: list[int] = []
    for i in found[np.argsort(-evidence[found])]:
        clearest = max(spectrum.records, key=lambda r: float(r.evidence[i]))
        lines = clearest.travel / (2.0 * np.pi)  # for each rad^-1
        away = np.abs(spectrum.orders[kept] - spectrum.orders[i]) * lines
        beside = np.abs(np.asarray(known) * spectrum.ratio - spectrum.orders[i]) * lines
        if np.any(away <= _APART) or np.any(beside <= _APART):
            continue
        lobes = [_SIDE_LOBES * clearest.power(k) / (np.pi * x) ** 2
                 for k, x in zip(kept, away, strict=True)]  # fmt: skip
        if clearest.power(i) > max(lobes, default=0.0):
            kept.append(int(i))
    return kept[:_MOST]


def _finer(spectrum: Spectrum, peak: int) -> float:
    """The order of a peak, between the grid's lines, rad^-1."""
    near = spectrum.orders[peak] + spectrum.step * np.linspace(-1.0, 1.0, 41)
    power = sum(power_at([(r.angle, r.values)], near) / r.level[peak] for r in spectrum.records)
    return float(near[int(np.argmax(power))])
