"""Series with stamps of their own onto one even clock."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from picchio.campaign.clock import TOLERANCE, not_seconds
from picchio.campaign.importing.mapping import TimeTable
from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.campaign.units import conversion
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError

# A hole of more usual steps than this is a dropout, over which nothing may be drawn.
_LARGEST_GAP = 5.0
# Straight lines between stamps hold nothing that is this many times as fast.
_FASTER = 20.0


def common_clock(
    raw: RawFile, asked: TimeTable, series: list[RawChannel], mapping: Path | None
) -> tuple[FloatArray, list[FloatArray]]:
    """One even clock for all series, and their values on it.

    Series that share an even clock pass unchanged, bit for bit. Others are drawn by straight
    lines between their stamps onto a clock of the rate asked for, over the time they have in
    common; that acts as a low-pass: at a tenth of the stamps' rate it takes up to 3 %, and noise is
    thinned.

    Args:
        raw: the file.
        asked: the mapping's `[time]`.
        series: those of the file that are imported.
        mapping: its file, for messages.

    Raises:
        InputError: stamps that differ, are uneven or out of order and no resampling is asked
            for; no stamps, or a rate that is missing; a dropout; no time in common.
    """
    file, rate = raw.path, asked.rate
    stamps, scale = _stamps(raw, asked, series, mapping)
    for stamp, entry in zip(stamps, series, strict=True):
        if stamp.size < 2:
            raise InputError("holds fewer than two samples", file=file, key=entry.name)
        if not np.isfinite(stamp).all() or not (np.diff(stamp) > 0.0).all():
            bad = int(np.flatnonzero(~(np.diff(stamp) > 0.0))[0]) + 1
            raise InputError(f"the stamps do not ascend (sample {bad + 1})", file=file,
                             key=entry.name)  # fmt: skip
        if problem := not_seconds(stamp[0] - asked.zero, float(np.median(np.diff(stamp))), scale):
            raise InputError(problem, file=file, key=asked.series or entry.name)
    first = stamps[0]
    same = all(stamp is first or np.array_equal(stamp, first) for stamp in stamps)
    if asked.resample is None:
        if not same:
            raise InputError("the series have stamps of their own", file=file,
                             hint=_advice(stamps))  # fmt: skip
        if (jitter := _jitter(first)) > TOLERANCE:
            raise InputError(f"the clock is not even (by {jitter:.2g} steps)", file=file,
                             hint=_advice(stamps))  # fmt: skip
        return first - asked.zero, [entry.values for entry in series]
    if rate is None:
        raise InputError("resampling needs a rate", file=file, key="time.rate",
                         hint=_advice(stamps))  # fmt: skip
    for stamp, entry in zip(stamps, series, strict=True):
        steps = np.diff(stamp)
        if steps.max() > _LARGEST_GAP * np.median(steps):
            raise InputError(
                f"is missing for {steps.max():.3g} s from {stamp[int(steps.argmax())]:.6g} s on",
                file=file, key=entry.name,
            )  # fmt: skip
    usual = _usual(stamps)
    if rate > _FASTER * usual:
        raise InputError(f"is more than {_FASTER:g} times the stamps' own {usual:.6g} Hz",
                         file=mapping, key="time.rate", value=rate)  # fmt: skip
    begin, end = max(s[0] for s in stamps), min(s[-1] for s in stamps)
    samples = int(np.floor((end - begin) * rate * (1.0 + 1e-12))) + 1
    if end <= begin or samples < 2:
        raise InputError("the series have no time in common", file=file)
    clock = begin + np.arange(samples) / rate
    values = [np.interp(clock, s, e.values) for s, e in zip(stamps, series, strict=True)]
    return clock - asked.zero, values


def _stamps(
    raw: RawFile, asked: TimeTable, series: list[RawChannel], mapping: Path | None
) -> tuple[list[FloatArray], float]:
    """The time of every sample of each series, s; and the unit it is stored in, s."""
    scale = 1.0
    own: list[FloatArray | None] = [s.time for s in series]
    if asked.series is not None:
        clock = raw.channel(asked.series, mapping=mapping, key="time.series").values
        try:
            _, convert = conversion(asked.unit, ("s",))
        except InputError as error:
            raise error.placed(file=mapping, key="time.unit") from None
        scale = convert.scale
        own = [convert(clock)] * len(series)
    elif asked.rate is not None and any(s.time is None for s in series):
        own = [np.arange(s.values.size) / asked.rate for s in series]
    stamps: list[FloatArray] = []
    for entry, stamp in zip(series, own, strict=True):
        if stamp is None:
            raise InputError("this file has no clock of its own", file=mapping, key="time",
                             hint="give [time] series (which holds the time) or rate")  # fmt: skip
        if stamp.size != entry.values.size:
            raise InputError(f"has {entry.values.size} samples and its clock {stamp.size}",
                             file=raw.path, key=entry.name)  # fmt: skip
        stamps.append(stamp)
    return stamps, scale


def _jitter(time: FloatArray) -> float:
    """The largest departure from a straight line, in steps."""
    step = (time[-1] - time[0]) / (time.size - 1)
    return float(np.abs((time - time[0]) / step - np.arange(time.size)).max())


def _usual(stamps: list[FloatArray]) -> float:
    """Hz, at which the fastest of the series come."""
    return max(1.0 / float(np.median(np.diff(stamp))) for stamp in stamps)


def _advice(stamps: list[FloatArray]) -> str:
    usual = _usual(stamps)
    return f'say [time] resample = "linear" and a rate (the stamps come at about {usual:.6g} Hz)'
