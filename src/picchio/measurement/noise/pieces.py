"""Parts of a record that hold only noise, and how they were obtained."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.measurement.noise.periodic import find_period, not_periodic
from picchio.measurement.noise.repeats import overlap
from picchio.measurement.noise.ringdown import fit_ring_down
from picchio.measurement.noise.window import Window

# From the surest down.
METHODS = {
    "quiet": "quiet time before the first blow",
    "rung down": "after it has rung down",
    "not periodic": "what is not periodic in a steady record",
    "repeats": "differences between repeats",
    "ring-down": "what damped waves leave of the ring-down",
    "fast changes": "changes faster than the motion: a rough floor",
}
_FEWEST = 16
_BLOCKS = 8


@dataclass(frozen=True, eq=False)
class Piece:
    """Noise of one channel over one stretch of time.

    Attributes:
        method: a key of `METHODS`.
        record: the file.
        time: (m,) s.
        values: (m,) in the channel's unit, of the noise's own variance.
        samples: how many independent numbers were left after what was fitted.
        gain: what a sine's amplitude was divided by on the way.
        mean_removed: the mean of `values` was subtracted.
    """

    method: str
    record: str
    time: FloatArray
    values: FloatArray
    samples: float
    gain: float = 1.0
    mean_removed: bool = False


def quiet_pieces(window: Window) -> Iterator[tuple[str, Piece]]:
    """What was recorded before the first blow, and at the end if all has rung down."""
    before, after = window.quiet(), window.after()
    for name, values in window.arrays.items():
        part = values[before]
        if part.size >= _FEWEST:
            yield name, _without_mean("quiet", window.record.file, window.time[before], part)
        end = _rung_down(values[after])
        if end is not None:
            where = slice(after.start + end, after.stop)
            yield name, _without_mean("rung down", window.record.file, window.time[where],
                                      values[where])  # fmt: skip


def _without_mean(method: str, record: str, time: FloatArray, part: FloatArray) -> Piece:
    return Piece(method, record, time, part - part.mean(), part.size - 1, mean_removed=True)


def _rung_down(values: FloatArray) -> int | None:
    """Where the last part begins, over which the power no longer falls; None if it still falls."""
    size = values.size // _BLOCKS
    if size < 64:
        return None
    blocks = values[values.size - size * _BLOCKS :].reshape(_BLOCKS, size)
    power = blocks.var(axis=1)
    if power[-1] == 0.0:
        return None
    # Slow noise has fewer independent samples; a tenth is on the safe side.
    slack = 1.0 + 4.0 * np.sqrt(2.0 / (size / 10.0))
    level = float(np.median(power[-3:]))
    first = _BLOCKS
    while first > 0 and level / slack < power[first - 1] < level * slack:
        first -= 1
    if _BLOCKS - first < 4:
        return None
    # Within the stretch the first half must not be louder than the second.
    halves = power[first:].reshape(-1)[: (_BLOCKS - first) // 2 * 2].reshape(2, -1).mean(axis=1)
    if halves[0] > halves[1] * (1.0 + 3.0 * np.sqrt(4.0 / (size / 10.0 * (_BLOCKS - first)))):
        return None
    if _has_wave(values[values.size - size * (_BLOCKS - first) :]):
        return None
    return values.size - size * (_BLOCKS - first)


def _has_wave(values: FloatArray) -> bool:
    """Whether one frequency stands out, which noise has no reason for (a hum has: see `hum`)."""
    power = np.abs(np.fft.rfft((values - values.mean()) * np.hanning(values.size))) ** 2
    power = power[2:]
    reach = max(8, power.size // 50)
    peak = int(power.argmax())
    around = np.concatenate([power[max(0, peak - reach) : max(0, peak - 3)],
                             power[peak + 4 : peak + reach]])  # fmt: skip
    return bool(around.size and power[peak] > 30.0 * np.median(around))


def steady_period(window: Window) -> tuple[float, float] | None:
    """(programmed, found) period of a steady record, s; None where there is none to find.

    Found on the channel that repeats best, and taken for the programmed one unless it leaves
    clearly less.
    """
    blows = window.blows
    if blows is None or not window.steady:
        return None
    programmed = float(blows.period)
    found = programmed
    best = 0.75
    for values in _largest(window):
        if not values.any():
            continue
        stated = not_periodic(window.time, values, programmed)
        trial = find_period(window.time, values, programmed)
        other = not_periodic(window.time, values, trial)
        if stated is None or other is None or not stated.std > 0.0:
            continue
        if other.std < best * stated.std:
            best, found = other.std / stated.std, trial
    return programmed, found


def _largest(window: Window, most: int = 3) -> list[FloatArray]:
    """The channels whose signal is largest against their own fast changes."""

    def strength(values: FloatArray) -> float:
        fast = float(np.std(np.diff(values, n=2)))
        return float(np.std(values)) / fast if fast > 0.0 else 0.0

    return sorted(window.arrays.values(), key=strength, reverse=True)[:most]


def steady_pieces(window: Window, period: float) -> Iterator[tuple[str, Piece]]:
    """What is not periodic in a steady record."""
    if not window.steady:
        return
    for name, values in window.arrays.items():
        found = not_periodic(window.time, values, period)
        if found is not None and found.used.mean() > 0.5:
            share = 1.0 / float(np.mean(found.scale**2))
            kept = np.where(found.used, found.residual, 0.0) / np.sqrt(found.used.mean())
            yield name, Piece(
                "not periodic", window.record.file, window.time, kept,
                values.size * share * float(found.used.mean()), float(found.scale.mean()),
            )  # fmt: skip


def ring_down_pieces(window: Window) -> Iterator[tuple[str, Piece]]:
    """What fitted damped sines leave after a burst."""
    after = window.after()
    names = [name for name, channel in window.channels.items() if not channel.kind.of_force]
    if after.stop - after.start < 200 or not names:
        return
    found = fit_ring_down(np.stack([window.arrays[name][after] for name in names]), window.rate)
    if found is None:
        return
    m = found.residual.shape[1]
    kept = m - found.parameters
    for name, left in zip(names, found.residual, strict=True):
        if left.any():
            time = window.time[after][:m]
            scaled = left * np.sqrt(m / kept)
            yield name, Piece("ring-down", window.record.file, time, scaled, kept)


def repeat_pieces(one: Window, other: Window) -> Iterator[tuple[str, Piece]]:
    """Half the difference between two records of the same thing, over sqrt(2)."""
    a, b = overlap(one, other)
    time = one.time[a]
    if time.size < _FEWEST:
        return
    for name in (name for name in one.arrays if name in other.arrays):
        difference = (other.arrays[name][b] - one.arrays[name][a]) / np.sqrt(2.0)
        yield name, _without_mean("repeats", f"{one.record.file}, {other.record.file}", time,
                                  difference)  # fmt: skip


def fast_pieces(window: Window) -> Iterator[tuple[str, Piece]]:
    """The part of a motion record that changes faster than a machine moves: a rough floor."""
    for name, values in window.arrays.items():
        if values.size >= 64:
            # Fourth differences pass white noise times sqrt(70) and nearly nothing of a motion.
            fast = np.diff(values, n=4) / np.sqrt(70.0)
            # Stops and starts show in them: the middle of their distribution counts.
            spread = 1.4826 * float(np.median(np.abs(fast)))
            kept = np.clip(fast, -4.0 * spread, 4.0 * spread) if spread > 0.0 else fast
            yield name, Piece("fast changes", window.record.file, window.time[2:-2], kept,
                              values.size / 4.0)  # fmt: skip
