"""The support function of every joint in many directions at once.

`DirectionEnvelope.support` finds the roots of every direction's closed form one by one. A surface
has thousands of directions that share one curve g_j(t), so here the curve is sampled once, each
direction takes its best sample, and the peak is refined on the closed form.
"""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray, IndexArray
from picchio.vibration import Response

_SAMPLES_PER_CYCLE = 24
_MOST_SAMPLES = 60_000
_BLOCK = 256
_CLOSE = 0.97
# exp(-14) = 8e-7 of what a pole had at the last blow.
_DECAYED = 14.0
_SHRINK = (1.0, 0.2, 0.02, 0.002)


def peaks(response: Response, directions: FloatArray) -> FloatArray:
    """Largest absolute deflection of every joint for each direction.

    Args:
        response: steady or from rest.
        directions: (d, 3) unit vectors.

    Returns:
        (n, d) rad, within some 1e-9 of the exact peak.
    """
    time = _samples(response)
    end = float(time[-1])
    step = np.diff(time, append=time[-1] + (time[-1] - time[-2]))
    curve = response.unit_deflection(time)  # (n, 3, k)
    n, d = len(curve), len(directions)
    which, sample = _candidates(curve, directions)
    at, width = time[sample], step[sample]
    joint, along = which // d, directions[which % d]

    def value(moment: FloatArray) -> FloatArray:
        inside = moment if response.periodic else np.clip(moment, 0.0, end)
        moments, place = np.unique(inside, return_inverse=True)
        g = response.unit_deflection(moments)[joint, :, place.ravel()]  # (c, 3)
        return np.asarray(np.abs((g * along).sum(axis=1)))

    found = value(at)
    for shrink in _SHRINK:
        h = shrink * width
        left, middle, right = value(at - h), value(at), value(at + h)
        bend = left - 2.0 * middle + right
        shift = np.where(bend < 0.0, 0.5 * (left - right) / np.where(bend < 0.0, bend, 1.0), 0.0)
        trial = at + h * np.clip(shift, -1.0, 1.0)
        reached = value(trial)
        better = reached > found
        at, found = np.where(better, trial, at), np.maximum(reached, found)
    best = np.zeros(n * d)
    np.maximum.at(best, which, found)
    return best.reshape(n, d)


def _candidates(curve: FloatArray, directions: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Samples near which a joint may peak: joint and direction as one number, and the sample.

    Between samples a peak hides some hundredths; every turn that comes this close may be it.
    """
    n, d = len(curve), len(directions)
    which, sample = [], []
    for start in range(0, d, _BLOCK):
        block = directions[start : start + _BLOCK]
        for j in range(n):
            size = np.abs(block @ curve[j])
            turns = size >= np.maximum(np.roll(size, 1, axis=1), np.roll(size, -1, axis=1))
            near = turns & (size >= _CLOSE * size.max(axis=1, keepdims=True))
            row, column = np.nonzero(near)
            which.append(j * d + start + row)
            sample.append(column)
    return np.concatenate(which), np.concatenate(sample)


def _samples(response: Response) -> FloatArray:
    """Times (k,) s: fine for every pole while it is alive, up to the end of the ring-down."""
    poles = response.modes.poles
    speed = np.abs(poles) / (2.0 * np.pi)
    if response.periodic:
        return _grid(0.0, float(response.force.end), float(speed.max()))
    last = float(response.force.start[-1])
    parts = [_grid(0.0, last, float(speed.max()))]
    alive_until = np.minimum(last + _DECAYED / -poles.real, response.horizon)
    now = last
    for until in np.unique(alive_until):
        parts.append(_grid(now, float(until), float(speed[alive_until >= until].max())))
        now = float(until)
    return np.concatenate([*parts, [now]])


def _grid(start: float, end: float, fastest: float) -> FloatArray:
    count = int(np.clip((end - start) * fastest * _SAMPLES_PER_CYCLE, 24, _MOST_SAMPLES))
    return np.linspace(start, end, count, endpoint=False)
