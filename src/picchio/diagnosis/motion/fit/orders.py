"""Which harmonics of the motor's angle a torque's residual holds: found, not given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.motion.data.system import System
from picchio.diagnosis.motion.fit.state import State
from picchio.model.motion import RIPPLE, TORQUE

# A torque's residual over the order: cycles a turn, each record against its own noise.

_FINE = 0.5  # of a radian of the highest order, between the grid's angles
_FASTEST = 0.4  # of the sampling rate
_OVERSAMPLED = 4  # lines of the grid for each one that the longest record can tell apart
_NEIGHBOURS = 50  # independent lines on either side that tell the local level
_FEWEST_NEIGHBOURS = 16
# The median of m lines tells their level as well as the mean of about half as many.
_MEDIAN = 0.48
_FEWEST = 50  # lines of the grid
_CLEANED = 4  # lines that are taken out before the noise is told
_CLEAR = 10.0  # evidence of such a line

Piece = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class Lines:
    """One record's residual over the order.

    Attributes:
        angle: (m,) rad or m.
        values: (m,) residual, N m or N.
        level: (k,) what its power is where there is no line; infinite where the record can't tell.
        ratio: (k,) power over level.
        evidence: (k,) minus the logarithm of the chance that noise makes as much.
    """

    angle: FloatArray
    values: FloatArray
    level: FloatArray
    ratio: FloatArray
    evidence: FloatArray

    @property
    def travel(self) -> float:
        """Rad or m: lines closer than 2 pi over it can't be told apart."""
        return float(np.ptp(self.angle))

    def power(self, at: int) -> float:
        """Of one line; 0 where the record can't tell."""
        level = float(self.level[at])
        return float(self.ratio[at]) * level if np.isfinite(level) else 0.0


@dataclass(frozen=True, eq=False)
class Spectrum:
    """A joint's residual over the order.

    Attributes:
        orders: (k,) rad^-1 of the joint (m^-1).
        records: each record's lines at these orders.
        step: between orders, about.
        ratio: motor turns a joint turn; 1 where it is not known.
    """

    orders: FloatArray
    records: tuple[Lines, ...]
    step: float
    ratio: float

    @property
    def strength(self) -> FloatArray:
        """(k,) power over its neighbourhood's, in the record in which it is most."""
        return np.asarray(np.max([lines.ratio for lines in self.records], axis=0))

    def noise(self, order: float) -> float:
        """Power of a sample's noise as a line at this order sees it, N^2 m^2 or N^2.

        Args:
            order: cycles a motor turn.
        """
        at = int(np.argmin(np.abs(self.orders - order * self.ratio)))
        worth = samples = 0.0
        for r in self.records:
            density = r.level[at] * float(r.values @ r.values) / r.values.size
            worth += r.values.size / density
            samples += r.values.size
        return samples / worth if worth > 0.0 else np.inf


def order_spectrum(
    system: System, residual: FloatArray, joint: str, state: State
) -> Spectrum | None:
    """A joint's residual over the order, record by record; None where there is too little.

    Args: as `picchio.diagnosis.motion.fit.orders.find_orders`.
    """
    pieces = _pieces(system, residual, joint, state)
    travel = max((float(np.ptp(angle)) for angle, _ in pieces), default=0.0)
    if travel == 0.0:
        return None
    rate = min(log.rate for log in system.logs)
    ranges = [_range(angle, rate) for angle, _ in pieces]
    lowest, highest = min(low for low, _ in ranges), max(high for _, high in ranges)
    step = 2.0 * np.pi / travel / _OVERSAMPLED
    if highest <= lowest + _FEWEST * step:
        return None
    found = []
    orders = np.zeros(0)
    for piece, inside in zip(pieces, ranges, strict=True):
        orders, power = power_spectrum(piece, lowest, highest, step)
        within = (orders >= inside[0]) & (orders <= inside[1])
        if np.count_nonzero(within) > _FEWEST:
            found.append(_cleaned(piece, orders, power, within, (lowest, highest, step)))
    if not found:
        return None
    return Spectrum(orders, tuple(found), step, system.predictors[0].nominal.gear_ratio[joint])


def _cleaned(piece: Piece, orders: FloatArray, power: FloatArray, within: FloatArray,
             grid: tuple[float, float, float]) -> Lines:  # fmt: skip
    """A record's lines against the noise that is left once the strongest are taken out.

    Where a joint goes to and fro, a line's own side lobes are far above the noise, and would be
    taken for its neighbourhood's.
    """
    angle, left = piece
    spacing = 2.0 * np.pi / max(float(np.ptp(angle)), 1e-12) / float(orders[1] - orders[0])
    scale = float(left @ left) or 1.0
    top, place = power, np.arange(orders.size)
    lines = _lines(piece, power, top, within, spacing)
    taken = np.zeros(orders.size, dtype=bool)
    for _ in range(_CLEANED):
        at = int(np.argmax(np.where(taken, 0.0, lines.evidence)))
        if lines.evidence[at] <= _CLEAR or taken[at]:
            break
        taken |= np.abs(place - at) <= spacing
        left = _without(angle, left, orders[at], grid[2])
        power = power_spectrum((angle, left), *grid)[1] * (float(left @ left) / scale)
        top = np.where(taken, np.maximum(top, power), power)
        lines = _lines(piece, power, top, within, spacing)
    return lines


def _without(angle: FloatArray, values: FloatArray, order: float, step: float) -> FloatArray:
    """The values less the wave of an order, or of one within a step of it that takes more."""
    near = order + step * np.linspace(-1.0, 1.0, 21)
    best = near[int(np.argmax(power_at((angle, values), near)))]
    waves = np.column_stack([np.cos(best * angle), np.sin(best * angle)])
    return np.asarray(values - waves @ np.linalg.solve(waves.T @ waves, waves.T @ values))


def _pieces(system: System, residual: FloatArray, joint: str, state: State) -> list[Piece]:
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
        nominal, group = predictor.nominal, predictor.log.group[joint]
        late = _delay(state, TORQUE) - _delay(state, group)
        angle = nominal.angle[joint] - late * nominal.velocity[joint]
        pieces.append((angle[fine.samples], values - values.mean()))
    return pieces


def _delay(state: State, group: str) -> float:
    return sum(e.values["delay"] for e in state.every if e.late and e.target == group)


def _range(angle: FloatArray, rate: float) -> tuple[float, float]:
    """Orders, rad^-1, of three periods in the record up to what its rate resolves."""
    travel, fastest = float(np.ptp(angle)), float(np.abs(np.diff(angle)).max()) * rate
    return 6.0 * np.pi / max(travel, 1e-12), 2.0 * np.pi * _FASTEST * rate / max(fastest, 1e-12)


def power_spectrum(piece: Piece, lowest: float, highest: float,
              step: float) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Power at orders from lowest to highest, rad^-1: values spread over a grid of angles, FFT."""
    spacing = _FINE / highest
    size = 1 << int(np.ceil(np.log2(2.0 * np.pi / (step * spacing))))
    orders = np.arange(size // 2 + 1) * (2.0 * np.pi / (size * spacing))
    # Linear spreading is a convolution with a triangle, whose transform is sinc^2.
    response = np.sinc(orders * spacing / (2.0 * np.pi)) ** 2
    angle, values = piece
    place = (angle - angle.min()) / spacing
    cell = np.floor(place).astype(np.intp)
    part = place - cell
    grid = np.bincount(cell, (1.0 - part) * values, size) + (
        np.bincount(cell + 1, part * values, size)
    )  # fmt: skip
    scale = float(values @ values) or 1.0
    power = np.abs(np.fft.rfft(grid[:size]) / response) ** 2 / scale
    inside = (orders >= lowest) & (orders <= highest)
    return orders[inside], power[inside]


def power_at(piece: Piece, orders: FloatArray) -> FloatArray:
    """The same at few orders, exactly."""
    angle, values = piece
    scale = float(values @ values) or 1.0
    return np.asarray(np.abs(np.exp(-1j * np.outer(orders, angle)) @ values) ** 2 / scale)


def _lines(piece: Piece, power: FloatArray, top: FloatArray, within: FloatArray,
           spacing: float) -> Lines:  # fmt: skip
    """A record's lines against its own noise.

    Args:
        piece: angle and residual.
        power: (k,) from which the noise is told.
        top: (k,) of the lines.
        within: (k,) whether the record can tell.
        spacing: lines of the grid for each one that this record can tell apart.
    """
    first, last = np.flatnonzero(within)[[0, -1]]
    own = power[first : last + 1]
    widest = int(_NEIGHBOURS * spacing)
    fewest = int(_FEWEST_NEIGHBOURS * spacing)
    # Noise falls with the order: the median of as many below as above is the line's own level.
    half = np.clip(np.arange(first, last + 1), fewest, max(widest, fewest))
    level, neighbours = _local_median(own, half)
    known = _MEDIAN * neighbours / spacing
    level = np.maximum(level / np.log(2.0), 1e-300)
    # An exponential over a level that `known` lines tell: Fisher's F with 2 and 2 known.
    chance = known * np.log1p(top[first : last + 1] / level / known)
    whole, evidence = np.full(power.size, np.inf), np.zeros(power.size)
    whole[first : last + 1], evidence[first : last + 1] = level, chance
    return Lines(*piece, whole, top / whole, evidence)


def _local_median(x: FloatArray, half: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Median of x[i - half : i + half], and of how many; widths in steps of a quarter octave."""
    from scipy.ndimage import median_filter

    steps = np.unique(np.round(4.0 * np.log2(half)))
    level, count = np.empty(x.size), np.empty(x.size)
    for n in steps:
        width = int(min(2.0 ** (n / 4.0), x.size // 2 - 1))
        here = np.round(4.0 * np.log2(half)) == n
        level[here] = median_filter(x, 2 * width + 1, mode="reflect")[here]
        count[here] = 2.0 * width
    return level, count


_FALSE_ALARM = 1e-4  # of one search of one joint
_MOST = 6
_SIDE_LOBES = 4.0  # times those of an even sweep
_APART = 3.0  # independent lines between two that are found at once


def find_orders(
    system: System, residual: FloatArray, joint: str, state: State
) -> list[tuple[float, float]]:
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

    Returns:
        cycles a turn of the motor (of the joint, where the gear ratio is not known), and
        `Spectrum.noise` there.
    """
    spectrum = order_spectrum(system, residual, joint, state)
    if spectrum is None:
        return []
    known = [e.values["order"] for e in state.every if e.periodic and e.target == joint]
    found = [_finer(spectrum, i) / spectrum.ratio for i in _peaks(spectrum, known)]
    return [(order, spectrum.noise(order)) for order in found]


def _together(evidence: list[FloatArray]) -> FloatArray:
    """(k,) of all records: the strongest alone, or all by Fisher's rule; less for having chosen."""
    from scipy.stats import gamma

    every = np.array(evidence)
    if len(every) == 1:
        return every[0]
    tried = np.sum(every > 0.0, axis=0)
    summed = -gamma.logsf(every.sum(axis=0), np.maximum(tried, 1))
    return np.asarray(np.maximum(every.max(axis=0), summed) - np.log(tried + 1.0))


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
    power = sum(power_at((r.angle, r.values), near) / r.level[peak] for r in spectrum.records)
    return float(near[int(np.argmax(power))])
