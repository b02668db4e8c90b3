"""Series with stamps of their own onto even clocks, a stretch between dropouts at a time."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pandas

from picchio.campaign.clock import TOLERANCE, not_seconds
from picchio.campaign.importing import detect
from picchio.campaign.importing.mapping import FilterTable, TimeTable
from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.core.arrays import BoolArray, FloatArray, IndexArray
from picchio.core.dates import nanoseconds
from picchio.core.errors import InputError, warn_user
from picchio.core.tables import Left

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

    A row without a stamp, or with that of the row before, is left out and told.

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
    if raw.clock is not None and raw.clock == asked.series:  # its stamps have been given out
        asked = asked.model_copy(update={"series": None, "unit": None})
    found = None if own and asked.series is None else detect.clock(raw, asked.series)
    single = None if own or asked.series or found else detect.of_scalars(raw.scalars)
    rate, start = asked.rate, 0.0
    if asked.series is not None:
        raw.channel(asked.series, mapping=mapping, key="time.series")
    elif found is not None and rate is not None and asked.resample is None:
        # A column without a name that ascends may be anything.
        stamps = detect.known(raw.channels[found.series].values)
        step = float(np.median(np.diff(stamps))) * detect.UNITS[found.unit][0] * 1e-9
        # Stamps that mostly repeat are too coarse to tell.
        if step > 0.0 and abs(1.0 / step / rate - 1.0) > _OFF and not found.series.isdigit():
            warn_user(f"{raw.path}: [time] rate is {rate:g} Hz, the stamps in "
                      f"{found.series!r} tell {1.0 / step:.6g} Hz")  # fmt: skip
        found = None
    elif single is not None and rate is None:
        rate, start, line = single
        lines.append(line)
    time: FloatArray | None = None
    if asked.series is not None or found is not None or (rate is None and not own):
        if asked.unit is None or asked.series is None:
            found = detect.require(found, raw)
            name, unit = found.series, found.unit
            lines.append(f"time in {name!r}, unit {unit}, {found.why}")
        else:
            name, unit = asked.series, _unit(asked.unit, mapping)
        stamps = raw.channels[name].values
        scale = detect.UNITS[unit][0] * 1e-9
        kept = detect.rising(stamps, raw, name, scale)
        if not kept.all():
            raw = _without(raw, kept)
            stamps = stamps[kept]
        time, begin = _times(stamps, unit)
        if begin is not None:
            epoch = begin
        elif problem := not_seconds(time[0], float(np.median(np.diff(time))), scale):
            raise InputError(problem, file=raw.path, key=name)
        ns = np.rint((time - time[0]) * 1e9).astype(np.int64)
        lines += detect.told(ns + (begin or 0), begin is not None)
    if asked.start is not None and epoch is None:
        epoch = nanoseconds(asked.start)
    channels = dict(raw.channels)
    for name in wanted:
        entry = channels[name]
        stamp = time if time is not None else entry.time
        if stamp is None:
            assert rate is not None
            stamp = start + (raw.before + np.arange(entry.values.size)) / rate
        if stamp.size != entry.values.size:
            raise InputError(f"has {entry.values.size} samples and its clock {stamp.size}",
                             file=raw.path, key=name)  # fmt: skip
        channels[name] = replace(entry, time=stamp)
    taken = raw.taken
    if taken is None and epoch is not None and asked.start is None:
        taken = datetime.fromtimestamp(epoch / 1e9, UTC)
    return replace(raw, channels=channels, taken=taken, epoch=epoch, detected=tuple(lines))


def _unit(asked: str, mapping: Path | None) -> str:
    """The unit of stamps that `[time] unit` names."""
    if (unit := detect.unit_of(asked)) is None:
        raise InputError("is no unit of stamps", file=mapping, key="time.unit", value=asked,
                         choices=detect.UNITS)  # fmt: skip
    return unit


def _without(raw: RawFile, kept: BoolArray) -> RawFile:
    """The rows of a table that have a stamp of their own; the others are told."""
    gone = np.flatnonzero(~kept)
    series = sum(c.time is None for c in raw.channels.values())
    left = Left("no stamp later than the one before", gone.size * series, int(gone[0]) + 1, "",
                gone.size, None, "sample")  # fmt: skip
    return replace(raw.at(kept), left=(*raw.left, left))


def told_apart(raw: RawFile, asked: TimeTable) -> RawFile:
    """A long table as what it is: a series for each sensor that a column names.

    Such a column changes from row to row, or the stamps go back where it changes; those of each
    sensor ascend. A series of it is named `value(sensor)`, and has its stamps.

    Args:
        raw: a table, before its clock is asked for.
        asked: the mapping's `[time]`.
    """
    if any(c.time is not None for c in raw.channels.values()) or raw.rows < 3:
        return raw
    found = detect.clock(raw, asked.series, any_order=True)
    if found is not None and found.other is not None and asked.unit is None:
        return raw
    stamps = None if found is None else raw.channels[found.series].values
    keys = [(name, *pandas.factorize(cells)) for name, cells in raw.texts.items()]
    if stamps is not None and not _rises(stamps):
        keys += [
            (name, *pandas.factorize(c.values)) for name, c in raw.channels.items()
            if c.values.dtype.kind == "f" and (c.values % 1 == 0).all() and c.values is not stamps
        ]  # fmt: skip
    for name, codes, words in keys:
        mixed = 2 * int((codes[1:] != codes[:-1]).sum()) > codes.size
        if not 1 < len(words) <= raw.rows // 2:
            continue
        among = [np.flatnonzero(codes == k) for k in range(len(words))]
        if stamps is not None:
            # Runs one below the other are no sensors, unless they have names.
            stacked = name in raw.texts and not _rises(stamps)
            if not (mixed or stacked) or not all(_rises(stamps[rows]) for rows in among):
                continue
        elif not mixed:
            continue
        return _told_apart(raw, name, [str(w) if isinstance(w, str) else f"{w:g}" for w in words],
                           among, found, asked)  # fmt: skip
    return raw


def _told_apart(
    raw: RawFile, name: str, words: list[str], among: list[IndexArray],
    found: detect.FoundClock | None, asked: TimeTable,
) -> RawFile:  # fmt: skip
    """The table with a series for each word of a column, each with its own rows and stamps."""
    lines = [*raw.detected, f"{name!r} tells {len(words)} series apart: {', '.join(words[:10])}"]
    time: FloatArray | None = None
    epoch = raw.epoch
    if found is not None:
        unit = _unit(asked.unit, None) if asked.unit else found.unit
        time, epoch = _times(raw.channels[found.series].values, unit)
        lines.append(f"time in {found.series!r}, unit {unit}, {found.why}")
        among = [r[detect.there(raw.channels[found.series].values[r])] for r in among]
    channels: dict[str, RawChannel] = {}
    for key, c in raw.channels.items():
        if key in (name, found and found.series):
            continue
        for word, rows in zip(words, among, strict=True):
            channels[f"{key}({word})"] = replace(
                c, name=f"{key}({word})", values=c.values[rows],
                time=None if time is None else time[rows],
            )  # fmt: skip
    texts = {key: cells for key, cells in raw.texts.items() if key != name}
    return replace(raw, channels=channels, texts=texts, detected=tuple(lines), epoch=epoch,
                   clock=None if found is None else found.series)  # fmt: skip


def _times(stamps: FloatArray, unit: str) -> tuple[FloatArray, int | None]:
    """Stamps in s, from the first where they count from a date; that one then, ns from 1970."""
    if not detect.dated(stamps, unit):
        scale = detect.UNITS[unit][0] * 1e-9
        return stamps * (1.0 if unit == "s" else scale), None
    ns = detect.ns_of(stamps, unit)
    begin = int(ns[detect.there(stamps)][0])
    return (ns - begin) * 1e-9, begin


def _rises(stamps: FloatArray) -> bool:
    return bool((np.diff(detect.known(stamps)) > 0).all())


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
            moment = (nanoseconds(moment) - raw.epoch) * 1e-9
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
        on = detect.rising(stamp, raw, entry.name)
        if not on.all():
            stamp, values = stamp[on], values[on]
            warn_user(f"{file}: {entry.name}: left out: {(~on).sum()} samples, the first sample "
                      f"{int((~on).argmax()) + 1}: no stamp later than the one before")  # fmt: skip
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
        if asked.resample is None and asked.bridge:
            cut[0], parts = _bridged(cut[0], parts, file)
        if asked.resample is None:
            if (jitter := _jitter(cut[0])) > TOLERANCE:
                found = f"the clock is not even (by {jitter:.2g} steps)"
                told = "; ".join([found, *(one.told for one in raw.left)])
                raise InputError(told, file=file, hint=_advice(whole))
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
        longest = max(detect.LARGEST_GAP * float(np.median(steps)), asked.bridge)
        gaps = np.flatnonzero(steps > longest)
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


def _bridged(
    stamp: FloatArray, series: list[FloatArray], file: Path
) -> tuple[FloatArray, list[FloatArray]]:
    """Missing samples of an even clock, drawn by straight lines; what is there stays as it is."""
    step = float(np.median(np.diff(stamp)))
    # Stamps are rounded: over many steps the mean is nearer.
    count = np.rint(np.diff(stamp) / step).sum()
    step = (stamp[-1] - stamp[0]) / count if count else step
    at = np.rint((stamp - stamp[0]) / step).astype(np.int64)
    even = stamp[0] + np.arange(at[-1] + 1) * step
    missing = even.size - stamp.size
    if np.abs(stamp - even[at]).max() > TOLERANCE * step or not missing:
        return stamp, series
    clock, drawn = even.copy(), [np.interp(even, stamp, v) for v in series]
    clock[at] = stamp
    for values, own in zip(drawn, series, strict=True):
        values[at] = own
    warn_user(f"{file}: {missing} missing samples of {even.size} are bridged by straight lines")
    return clock, drawn


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
