"""Series with stamps of their own onto even clocks, a stretch between dropouts at a time."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from picchio.campaign.clock import TOLERANCE, not_seconds
from picchio.campaign.importing import detect
from picchio.campaign.importing.mapping import FilterTable, TimeTable
from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.core.arrays import BoolArray, FloatArray
from picchio.core.errors import InputError, warn_user
from picchio.core.units import conversion

# A hole of more usual steps than this is a dropout, over which nothing may be drawn.
_LARGEST_GAP = 5.0
# Straight lines between stamps hold nothing that is this many times as fast.
_FASTER = 20.0
# A stated rate that is off by more than this from the stamps' is told.
_OFF = 0.01
_A_DATE = 1e8  # s from 1970: a zero beyond is a date
Piece = tuple[FloatArray, list[FloatArray]]


def clocked(
    raw: RawFile, asked: TimeTable, mapping: Path | None = None, names: set[str] | None = None
) -> RawFile:
    """The file with a time for every series, s, and what its clock is.

    Args:
        raw: the file.
        asked: the mapping's `[time]`.
        mapping: its file, for messages.
        names: of the series that need one; all where None.

    Raises:
        InputError: no clock, an unknown series or unit, stamps that do not ascend.
    """
    wanted = set(raw.channels) if names is None else names & set(raw.channels)
    own = all(raw.channels[name].time is not None for name in wanted)
    lines, epoch = list(raw.detected), raw.epoch
    time: FloatArray | None = None
    found = None if own and asked.series is None else detect.clock(raw, asked.series)
    needed = asked.rate is None and not own
    if asked.series is not None:
        raw.channel(asked.series, mapping=mapping, key="time.series")
    elif found is not None and asked.rate is not None and asked.resample is None:
        # A column without a name that ascends may be anything.
        rate = 1.0 / (_step(raw, found) or np.inf)
        if abs(rate / asked.rate - 1.0) > _OFF and not found.series.isdigit():
            warn_user(f"{raw.path}: [time] rate is {asked.rate:g} Hz, the stamps in "
                      f"{found.series!r} tell {rate:.6g} Hz")  # fmt: skip
        found = None
    if asked.series is not None or needed or found is not None:
        if asked.unit is None or asked.series is None:
            found = detect.require(found, raw)
        name = asked.series or (found.series if found else "")
        if asked.unit is None:
            assert found is not None
            unit, dates = found.unit, found.dates
            lines.append(f"time in {name!r}, unit {unit}, {found.why}")
        else:
            try:
                scale = conversion(asked.unit, ("s",))[1].scale
            except InputError as error:
                raise error.placed(file=mapping, key="time.unit") from None
            unit = min(detect.SCALES, key=lambda u: abs(np.log(detect.SCALES[u] / scale)))
            if not np.isclose(detect.SCALES[unit], scale, rtol=1e-6):
                raise InputError("is no unit of stamps", file=mapping, key="time.unit",
                                 value=asked.unit, choices=detect.SCALES)  # fmt: skip
            dates = _counts(raw.channels[name], unit)
        stamps = raw.channels[name].values
        if stamps.size < 2:
            raise InputError("holds fewer than two samples", file=raw.path, key=name)
        known = np.isfinite(stamps) if stamps.dtype.kind == "f" else np.ones(stamps.size, bool)
        rises = np.diff(stamps) > 0
        if not known.all() or not rises.all():
            bad = int(np.flatnonzero(~(rises & known[1:] & known[:-1]))[0]) + 1
            raise InputError(f"the stamps do not ascend (sample {bad + 1})", file=raw.path,
                             key=name, value=float(stamps[bad]))  # fmt: skip
        if dates:
            ns = detect.ns_of(stamps, unit)
            epoch = int(ns[0])
            time = (ns - ns[0]) * 1e-9
            lines += detect.told(raw, ns, True)
        else:
            scale = detect.SCALES[unit]
            time = stamps * 1.0 if scale == 1.0 else stamps * scale
            step = float(np.median(np.diff(time)))
            if problem := not_seconds(time[0], step, scale):
                raise InputError(problem, file=raw.path, key=name)
            lines += detect.told(raw, np.rint((time - time[0]) * 1e9).astype(np.int64), False)
    if asked.start is not None and epoch is None:
        epoch = detect.nanoseconds(asked.start)
    channels = dict(raw.channels)
    for name in wanted:
        entry = channels[name]
        stamp = time if time is not None else entry.time
        if stamp is None:
            assert asked.rate is not None
            stamp = (raw.before + np.arange(entry.values.size)) / asked.rate
        if stamp.size != entry.values.size:
            raise InputError(f"has {entry.values.size} samples and its clock {stamp.size}",
                             file=raw.path, key=name)  # fmt: skip
        channels[name] = replace(entry, time=stamp)
    taken = raw.taken
    if taken is None and epoch is not None and asked.start is None:
        taken = datetime.fromtimestamp(epoch / 1e9, UTC)
    return replace(raw, channels=channels, taken=taken, epoch=epoch, detected=tuple(lines))


def _step(raw: RawFile, found: detect.FoundClock) -> float:
    """s, the usual step of a clock."""
    return float(np.median(np.diff(raw.channels[found.series].values))) * detect.SCALES[found.unit]


def _counts(channel: RawChannel, unit: str) -> bool:
    """Whether stamps in this unit count from 1970."""
    # Whole numbers without end: stamps in ms that are said to be s are beyond what 64 bits hold.
    first = channel.values[:1].tolist()
    factor = round(detect.SCALES[unit] * 1e9)
    return bool(first) and math.isfinite(first[0]) and (
        detect._DATES[0] <= first[0] * factor <= detect._DATES[1]
    )  # fmt: skip


def taken_samples(
    raw: RawFile, series: RawChannel, asked: TimeTable, filters: list[FilterTable],
    mapping: Path | None,
) -> BoolArray:  # fmt: skip
    """(m,) whether each sample lies in the window and passes the filters.

    A filter's series on another clock holds its last sample until the next.

    Args:
        raw: the file, clocked.
        series: one of it.
        asked: `[time]`.
        filters: all must hold.
        mapping: for messages.

    Raises:
        InputError: an unknown series; a date for a file without one.
    """
    assert series.time is not None
    kept = np.isfinite(series.values) if series.values.dtype.kind == "f" else np.ones(
        series.values.size, bool
    )  # fmt: skip
    for key, after in (("begin", True), ("end", False)):
        moment = getattr(asked, key)
        if moment is None:
            continue
        if isinstance(moment, datetime):
            if raw.epoch is None:
                raise InputError("the file states no date; give s in its own time", file=mapping,
                                 key=f"time.{key}", value=str(moment))  # fmt: skip
            moment = (detect.nanoseconds(moment) - raw.epoch) * 1e-9
        # To the nanosecond: a block of a log counts from its own beginning.
        ns, limit = np.rint(series.time * 1e9), np.rint(moment * 1e9)
        kept = kept & ((ns >= limit) if after else (ns <= limit))
    for i, entry in enumerate(filters):
        other = raw.channel(entry.series, mapping=mapping, key=f"filter[{i}].series")
        held = entry.passes(other.values)
        if other.time is series.time or np.array_equal(other.time, series.time):  # type: ignore[arg-type]
            kept = kept & held
        else:
            assert other.time is not None
            at = np.searchsorted(other.time, series.time, side="right") - 1
            kept = kept & np.where(at >= 0, held[np.maximum(at, 0)], False)
    return kept


def common_clock(
    raw: RawFile,
    asked: TimeTable,
    series: list[RawChannel],
    mapping: Path | None,
    filters: list[FilterTable] | None = None,
) -> list[Piece]:
    """One even clock for all series, and their values on it, for each stretch without a dropout.

    Series that share an even clock pass unchanged, bit for bit. Others are drawn by straight
    lines between their stamps onto a clock of the rate asked for, over the time they have in
    common; that acts as a low-pass: at a tenth of the stamps' rate it takes up to 3 %, and noise is
    thinned.

    Args:
        raw: the file, clocked.
        asked: the mapping's `[time]`.
        series: those of the file that are imported.
        mapping: its file, for messages.
        filters: which samples are taken.

    Raises:
        InputError: stamps that differ, are uneven or out of order and no resampling is asked
            for; no stamps, or a rate that is missing; a dropout that is to be refused; no time in
            common.
    """
    file, rate = raw.path, asked.rate
    zero = asked.zero
    if raw.epoch is not None and zero > _A_DATE:
        zero -= raw.epoch * 1e-9
    whole, kept = [], []
    for entry in series:
        assert entry.time is not None
        take = taken_samples(raw, entry, asked, filters or [], mapping)
        stamp, values = entry.time, entry.values
        if not take.all():
            stamp, values = stamp[take], values[take]
        if stamp.size < 2:
            raise InputError("holds fewer than two samples", file=file, key=entry.name)
        if not np.isfinite(stamp).all() or not (np.diff(stamp) > 0.0).all():
            bad = int(np.flatnonzero(~(np.diff(stamp) > 0.0))[0]) + 1
            raise InputError(f"the stamps do not ascend (sample {bad + 1})", file=file,
                             key=entry.name)  # fmt: skip
        if problem := not_seconds(stamp[0] - zero, float(np.median(np.diff(stamp)))):
            raise InputError(problem, file=file, key=asked.series or entry.name)
        whole.append(stamp)
        kept.append(values)
    same = all(stamp is whole[0] or np.array_equal(stamp, whole[0]) for stamp in whole)
    if asked.resample is None and not same:
        raise InputError("the series have stamps of their own", file=file, hint=_advice(whole))
    if asked.resample is not None and rate is None:
        raise InputError("resampling needs a rate", file=file, key="time.rate",
                         hint=_advice(whole))  # fmt: skip
    usual = _usual(whole)
    if asked.resample is not None and rate is not None and rate > _FASTER * usual:
        raise InputError(f"is more than {_FASTER:g} times the stamps' own {usual:.6g} Hz",
                         file=mapping, key="time.rate", value=rate)  # fmt: skip
    stretches = _stretches(whole, series, asked, file)
    pieces: list[Piece] = []
    for begin, end in stretches:
        rows = [(s >= begin) & (s <= end) for s in whole]
        cut = whole if len(stretches) == 1 else [s[r] for s, r in zip(whole, rows, strict=True)]
        parts = kept if len(stretches) == 1 else [v[r] for v, r in zip(kept, rows, strict=True)]
        if min(s.size for s in cut) < 2:
            warn_user(f"{file}: the samples between {begin:.6g} s and {end:.6g} s are left out: "
                      "fewer than two lie between dropouts")  # fmt: skip
            continue
        if asked.resample is None:
            if (jitter := _jitter(cut[0])) > TOLERANCE:
                raise InputError(f"the clock is not even (by {jitter:.2g} steps)", file=file,
                                 hint=_advice(whole))  # fmt: skip
            pieces.append((cut[0] - zero, [v.astype(np.float64) for v in parts]))
            continue
        assert rate is not None
        first, last = max(s[0] for s in cut), min(s[-1] for s in cut)
        samples = int(np.floor((last - first) * rate * (1.0 + 1e-12))) + 1
        if last <= first or samples < 2:
            continue
        clock = first + np.arange(samples) / rate
        drawn = [np.interp(clock, s, v) for s, v in zip(cut, parts, strict=True)]
        pieces.append((clock - zero, drawn))
    if not pieces:
        raise InputError("the series have no time in common", file=file)
    return pieces


def _stretches(
    stamps: list[FloatArray], series: list[RawChannel], asked: TimeTable, file: Path
) -> list[tuple[float, float]]:
    """The times, s, over which no series has a dropout."""
    found = [(-np.inf, np.inf)]
    for stamp, entry in zip(stamps, series, strict=True):
        if stamp is stamps[0] and entry is not series[0]:
            continue
        steps = np.diff(stamp)
        gaps = np.flatnonzero(steps > _LARGEST_GAP * np.median(steps))
        # What a clock is uneven by is no dropout where no resampling is asked for.
        if stamp.size < 10:
            gaps = gaps[:0]
        if gaps.size and asked.gaps == "refuse":
            worst = int(steps.argmax())
            raise InputError(f"is missing for {steps[worst]:.3g} s from {stamp[worst]:.6g} s on",
                             file=file, key=entry.name)  # fmt: skip
        edges = [stamp[0], *np.ravel([(stamp[k], stamp[k + 1]) for k in gaps]), stamp[-1]]
        own = list(zip(edges[::2], edges[1::2], strict=True))
        found = [(max(a, c), min(b, d)) for a, b in found for c, d in own if max(a, c) <= min(b, d)]
    return found


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
