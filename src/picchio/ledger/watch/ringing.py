"""How an arm rings after its blows: frequencies and damping, read in the silence after them."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from picchio.campaign.channels import kinds
from picchio.core.arrays import FloatArray, IndexArray
from picchio.ledger.samples import Samples
from picchio.ledger.store import Stream, pieces
from picchio.model.model import Model
from picchio.studies.rivet.pose import ModelAtPose

# s: a shorter silence tells no frequency, in a longer one there is nothing left to see.
_SHORTEST, _LONGEST = 0.4, 2.0
_LATER = 0.01  # s after the last sample of a blow
_EACH = 20  # ring-downs of a stretch: more make no reading much better
_SAMPLES = 800  # of one
_STILL = 2e-3  # rad or m
TOLD = 0.02  # relative: a frequency that is known no better says nothing


def ring_downs(samples: Samples, stream: Stream, model: Model) -> list[tuple[str, int, float]]:
    """Frequencies and damping ratios after the blows of a stretch.

    Args:
        samples: with further channels that read vibration.
        stream: that tells blows.
        model: where the frequencies are looked for.

    Returns:
        (name, ns, value): "f<i>" Hz, "e<i>" its relative standard deviation, "z<i>" damping ratio
        of mode i, "q<k>" the pose; those of one ring-down have the same time.
    """
    known = {kind.name for kind in kinds() if kind.derivative is not None and kind.of}
    known -= {"position", "motor_position"}
    read = [v for name, v in samples.others.items() if name.partition(".")[0] in known]
    if not read or not samples.pose_stamps.size or samples.kind not in ("force", "acceleration"):
        return []
    found: list[tuple[str, int, float]] = []
    count = 0
    size = stream.size(samples.values)
    for piece in pieces(samples.stamps, stream.gap):
        stamps = samples.stamps[piece]
        for begin, end in silences(stamps[size[piece] > stream.foot], int(stamps[-1])):
            told = _ring(read, begin, end, samples, model)
            if told is not None:
                found += told
                count += 1
            if count >= _EACH:
                return found
    return found


def silences(active: IndexArray, last: int) -> Iterator[tuple[int, int]]:
    """The time after blows in which a structure rings and nothing else happens, at most 2 s each.

    Args:
        active: (m,) ns, ascending, of samples while a blow lasts.
        last: ns, of the last sample.

    Yields:
        ns, where one begins and ends.
    """
    after = np.append(active[1:], last)
    for begin, end in zip(active.tolist(), after.tolist(), strict=active.size > 0):
        if end - begin > _SHORTEST * 1e9:
            begin += round(_LATER * 1e9)
            yield begin, min(end, begin + round(_LONGEST * 1e9))


def temperatures(samples: Samples) -> list[tuple[str, int, float]]:
    """The mean of the temperatures of a stretch, over its joints.

    Args:
        samples: of a log.

    Returns:
        none, or ("temperature", ns, deg C).
    """
    read = [
        v for name, v in samples.others.items() if name.startswith("temperature.") and v[0].size
    ]
    if not read:
        return []
    mean = float(np.mean([values.mean() for _, values in read]))
    return [("temperature", int(np.median(read[0][0])), mean)]


def _ring(
    read: list[tuple[FloatArray, FloatArray]], begin: int, end: int, samples: Samples, model: Model
) -> list[tuple[str, int, float]] | None:
    at = (samples.pose_stamps >= begin) & (samples.pose_stamps <= end)
    poses = samples.poses[at]
    if len(poses) < 2 or np.ptp(poses, axis=0).max() > _STILL:
        return None
    pose = np.median(poses, axis=0)
    rows, clock = [], None
    for stamps, values in read:
        own = (stamps >= begin) & (stamps < end)
        if own.sum() < 50:
            continue
        if clock is None:
            clock = stamps[own]
        if own.sum() == clock.size:
            rows.append(values[own])
    if clock is None:
        return None
    step = max(1, clock.size // _SAMPLES)
    time = (clock[::step] - begin) * 1e-9
    modes = ModelAtPose(model, pose).modes
    nominal = modes.natural_frequencies[: len(model.robot.flexible_joints)]
    # A mode beyond a third of the samples' rate is not seen.
    seen = nominal[nominal < 0.33 / float(np.median(np.diff(time)))]
    if not seen.size:
        return None
    fitted = decaying(time, np.array([row[::step] for row in rows]), seen,
                      np.full(seen.size, float(np.median(model.robot.damping_ratio))))  # fmt: skip
    if fitted is None:
        return None
    frequency, error, damping = fitted
    told: list[tuple[str, int, float]] = []
    for i in np.flatnonzero(error < TOLD):
        told += [(f"f{i}", begin, float(frequency[i])), (f"e{i}", begin, float(error[i])),
                 (f"z{i}", begin, float(damping[i]))]  # fmt: skip
    if told:
        told += [(f"q{k}", begin, float(angle)) for k, angle in enumerate(pose)]
    return told or None


def decaying(
    time: FloatArray, values: FloatArray, frequency: FloatArray, damping: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Decaying oscillations through readings, common frequencies and damping (separable fit).

    Args:
        time: (m,) s.
        values: (c, m).
        frequency: (p,) Hz, undamped, to begin with.
        damping: (p,) ratios, likewise.

    Returns:
        frequencies, their relative standard deviations, damping ratios; None where none fit.

    Source: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413-432.
    """
    from scipy.optimize import least_squares

    p = frequency.size
    scale = np.maximum(values.std(axis=1, keepdims=True), 1e-300)
    wanted = values / scale
    start = np.concatenate([np.log(frequency), np.log(damping)])

    def basis(x: FloatArray) -> FloatArray:
        omega, ratio = 2.0 * math.pi * np.exp(x[:p]), np.minimum(np.exp(x[p:]), 0.9)
        decay = np.exp(-np.outer(ratio * omega, time))
        angle = np.outer(omega * np.sqrt(1.0 - ratio**2), time)
        return np.vstack([decay * np.cos(angle), decay * np.sin(angle), np.ones_like(time)])

    def left(x: FloatArray) -> FloatArray:
        table = basis(x)
        weights = np.linalg.lstsq(table.T, wanted.T, rcond=None)[0]
        return np.asarray((wanted.T - table.T @ weights).ravel())

    lower = start - np.concatenate([np.full(p, 0.3), np.full(p, 2.0)])
    upper = start + np.concatenate([np.full(p, 0.3), np.full(p, 2.0)])
    fit = least_squares(left, start, bounds=(lower, upper), max_nfev=40, xtol=1e-7)
    spread = float((fit.fun**2).sum()) / max(fit.fun.size - 4 * p, 1)
    try:
        covariance = np.linalg.inv(fit.jac.T @ fit.jac) * spread
    except np.linalg.LinAlgError:
        return None
    error = np.sqrt(np.maximum(np.diag(covariance)[:p], 0.0))
    # At a bound nothing was found.
    stuck = (np.abs(fit.x - lower) < 1e-6) | (np.abs(fit.x - upper) < 1e-6)
    error = np.where(stuck[:p], np.inf, np.maximum(error, 1e-5))
    return np.exp(fit.x[:p]), error, np.exp(fit.x[p:])
