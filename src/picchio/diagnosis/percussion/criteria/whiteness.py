"""Is what is left noise? Tests of residuals where the arm answers: by band, pose and record."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem
from picchio.diagnosis.percussion.fit.least_squares import Fit

_BANDS = 8
# So many times the highest natural frequency still belongs to where the arm answers.
_ANSWERS = 3.0
# A second-order model is exact to about this share of the noise's power at 40 dB.
_MODEL_FLOOR = 0.01
# Relative error of what the noise's spectrum has above white noise, where it was fitted to this
# many quiet samples of a group or more; from fewer it is known less well.
_COLOUR_ERROR = 0.12
_PLENTY = 8000.0
# Samples that say as much of a noise's slow part as one of white noise says of all; and where
# colour was not worth its two numbers: up to 2.4 standard deviations of it may hide there.
_SLOW = 12.0
_SLOW_UNSEEN = 50.0
BAND_LIMIT = 4.5
POSE_LIMIT = 5.0
# Standard deviations below noise at which the noise was not that of the records.
_OVERSTATED = -6.0


@dataclass(frozen=True)
class Level:
    """The residual's power in one part of the data, 1 where it is noise.

    Attributes:
        group: channel group.
        part: "3-9 Hz", "pose 2".
        power: mean.
        z: how many standard deviations above 1, of a normal variable as likely.
        samples: how many it is the mean of.
    """

    group: str
    part: str
    power: float
    z: float
    samples: int = 0


@dataclass(frozen=True)
class Evidence:
    """Whether a residual is noise.

    Attributes:
        bands: by group and frequency.
        poses: by group and pose.
        chi_square: per sample, all together.
        pose_inconsistency: by how many standard deviations the unknowns differ from pose to pose.
        groups: by group alone.
    """

    bands: tuple[Level, ...]
    poses: tuple[Level, ...]
    chi_square: float
    pose_inconsistency: float = 0.0
    groups: tuple[Level, ...] = ()

    @property
    def overstated(self) -> tuple[str, ...]:
        """Groups that hold less than the noise of their quiet time: it was not quiet."""
        return tuple(level.group for level in self.groups if level.z < _OVERSTATED)

    @property
    def is_noise(self) -> bool:
        """No part stands out, and what was fitted is the same at every pose."""
        return (
            self.worst_band < BAND_LIMIT
            and self.worst_pose < POSE_LIMIT
            and self.pose_inconsistency < BAND_LIMIT
        )

    @property
    def worst_band(self) -> float:
        """Largest z of the bands."""
        return max((level.z for level in self.bands), default=0.0)

    @property
    def excess(self) -> float:
        """Chi-square above that of noise, of the bands that stand out alone.

        Where noise is overstated all others are below it, and a sum of all would hide these.
        """
        standing = [level for level in self.bands if level.z >= BAND_LIMIT]
        return sum((level.power - 1.0) * level.samples for level in standing)

    @property
    def worst_pose(self) -> float:
        """Largest z of the poses."""
        return max((level.z for level in self.poses), default=0.0)


def whiteness_test(problem: Problem, found: Fit) -> Evidence:
    """Test what a fit leaves of every one of its records.

    Periodogram ordinates of white noise of unit variance have mean 1 and variance 1; to the
    scatter of their mean comes that of the noise level itself, which was estimated.

    Args:
        problem: the data.
        found: the fit whose residual is tested.

    Returns:
        the residual's power by band and by pose, and whether it is what noise leaves.
    """
    top = float(problem.natural_frequencies.max()) * _ANSWERS
    powers: dict[str, list[tuple[int, FloatArray, FloatArray]]] = {}
    errors: dict[str, list[float]] = {}
    total, count = 0.0, 0
    for record, residual in zip(found.records, found.residuals, strict=True):
        first = int(np.searchsorted(record.setup.samples.times, 0.0))
        frequency = np.fft.rfftfreq(residual.shape[1] - first, record.setup.samples.step)[1:-1]
        for channel, row in zip(record.channels, residual, strict=True):
            spectrum = np.abs(np.fft.rfft(row[first:])[1:-1]) ** 2 / (row.size - first)
            powers.setdefault(channel.group, []).append((record.pose, frequency, spectrum))
            errors.setdefault(channel.group, []).append(record.noise[channel.name].error)
            total += float((row[first:] ** 2).sum())
            count += row.size - first
    bands: list[Level] = []
    poses: list[Level] = []
    groups: list[Level] = []
    for group, entries in powers.items():
        error = 2.0 * float(np.mean(errors[group])) / np.sqrt(_channels_of(problem, group))
        edges = _edges(top, [f for _, f, _ in entries])
        high = float(edges[-1])
        groups += _level(group, "all", [spectrum for _, _, spectrum in entries], error)
        colour = _colour(problem, group)
        for low, up in zip(edges[:-1], edges[1:], strict=True):
            picked = [s[(f > low) & (f <= up)] for _, f, s in entries]
            unsure = float(np.hypot(error, colour(0.5 * (low + up))))
            bands += _level(group, f"{low:.3g}-{up:.3g} Hz", picked, unsure)
        for pose in sorted({p for p, _, _ in entries}):
            picked = [s[f <= high] for p, f, s in entries if p == pose]
            unsure = float(np.hypot(error, colour(0.5 * high)))
            poses += _level(group, f"pose {pose + 1}", picked, unsure)
    chi_square = total / max(count, 1)
    return Evidence(tuple(bands), tuple(poses), chi_square, groups=tuple(groups))


def _edges(top: float, frequencies: Sequence[FloatArray]) -> FloatArray:
    """(bands + 1,) Hz: from nothing to where the arm no longer answers, or the records end."""
    lowest = min(float(f[0]) for f in frequencies)
    high = min(top, max(float(f[-1]) for f in frequencies))
    edges = np.geomspace(max(lowest, 0.5), high, _BANDS + 1)
    edges[0] = 0.0
    return np.asarray(edges)


def excess_by_band(
    problem: Problem, records: Sequence[MeasuredRecord], residuals: Sequence[FloatArray]
) -> dict[str, float]:
    """By how much chi-square is above that of noise, in each band of frequencies.

    Args:
        problem: the data.
        records: some of its records.
        residuals: (channels, m) of each, whitened.

    Returns:
        such as "3.1-9.4 Hz" -> the excess, at least 0; its sum is by and large that of all samples.
    """
    spectra = []
    for record, residual in zip(records, residuals, strict=True):
        frequency = np.fft.rfftfreq(residual.shape[1], record.setup.samples.step)[1:-1]
        power = np.abs(np.fft.rfft(residual, axis=1)[:, 1:-1]) ** 2 / residual.shape[1]
        spectra.append((frequency, 2.0 * (power - 1.0).sum(axis=0)))
    top = float(problem.natural_frequencies.max()) * _ANSWERS
    edges = _edges(top, [f for f, _ in spectra])
    return {
        f"{low:.3g}-{up:.3g} Hz": max(
            sum(float(own[(f > low) & (f <= up)].sum()) for f, own in spectra), 0.0
        )
        for low, up in zip(edges[:-1], edges[1:], strict=True)
    }


def _colour(problem: Problem, group: str) -> Callable[[float], float]:
    """How unsure the noise's spectrum is at a frequency, relative: it was fitted, too."""
    record = next(r for r in problem.records if group in r.setup.groups)
    name = next(c.name for c in record.setup.channels if c.group == group)
    noise = record.noise[name]
    samples = _channels_of(problem, group) / (2.0 * max(noise.error, 1e-6) ** 2)
    # Colour that so few samples did not show may be there all the same.
    slow = _SLOW_UNSEEN if noise.white else _SLOW
    unseen = float(np.sqrt(max(slow / samples - slow / _PLENTY, 0.0)))
    if noise.white:
        return lambda frequency: unseen
    white = float(np.median(noise.psd))
    share = _COLOUR_ERROR * max(1.0, float(np.sqrt(_PLENTY / samples)))

    def unsure(frequency: float) -> float:
        here = float(np.interp(frequency, noise.frequency, noise.psd))
        colour = share * abs(1.0 - white / here) if here > 0.0 else 0.0
        return max(colour, unseen)

    return unsure


def _level(group: str, part: str, picked: Sequence[FloatArray], error: float) -> list[Level]:
    """The level of one part; none where there is too little."""
    values = np.concatenate(picked) if picked else np.zeros(0)
    if values.size < 8:
        return []
    power = float(values.mean())
    scatter = float(np.sqrt(1.0 / values.size + error**2 + _MODEL_FLOOR**2))
    z = standard_deviations(power, scatter)
    return [Level(group, part, power, z, 2 * values.size)]


def standard_deviations(power: float, scatter: float) -> float:
    """By how many standard deviations a mean of squares stands above 1.

    A mean of few squares has a longer upper than lower tail: its cube root is nearly normal (Wilson
    and Hilferty, PNAS 17 (1931) 684, doi:10.1073/pnas.17.12.684).

    Args:
        power: the mean, 1 expected.
        scatter: its standard deviation.
    """
    return float(3.0 / scatter * (np.cbrt(max(power, 0.0)) - 1.0 + scatter**2 / 9.0))


def _channels_of(problem: Problem, group: str) -> int:
    return max(
        1, len({c.name for r in problem.records for c in r.setup.channels if c.group == group})
    )
