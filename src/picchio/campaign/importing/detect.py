"""The clock of a table: which column holds it, in what unit, and which rows have a stamp."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.core.arrays import BoolArray, FloatArray
from picchio.core.dates import MISSING, NS
from picchio.core.errors import InputError

_TIME_NAME = re.compile(
    r"(.*[.:/_ ])?(t|time|times|time ?stamps?|zeit|temps|tempo|clock|date ?time|date|datum|stamp|"
    r"uhrzeit|elapsed|rostime|x_value|seconds|secs?|millis|micros|nanos|nanoseconds|minutes|hours)"
    r"([ _]*([\[(</,]|in )?[ ]*(?P<unit>s|sec|seconds?|ms|msec|milliseconds?|us|µs|μs|usec|"
    r"microseconds?|ns|nsec|nanoseconds?|min|minutes?|h|hours?|d|days?)[ ]*[\])>]?)?",
    re.I,
)
_DAY = 86_400 * NS
UNITS: dict[str, tuple[int, int | None]] = {
    "s": (NS, 0), "ms": (10**6, 0), "us": (10**3, 0), "ns": (1, 0),
    "min": (60 * NS, None), "h": (3600 * NS, None), "days": (_DAY, None), "100 ns": (100, None),
    "days since 1899": (_DAY, -25_569 * _DAY),  # spreadsheets
    "days since year 0": (_DAY, -719_529 * _DAY),  # MATLAB's datenum
    "100 ns since 1601": (100, -11_644_473_600 * NS),  # Windows' file time
    "100 ns since year 1": (100, -62_135_596_800 * NS),  # .NET
}  # fmt: skip
"""Of stamps: ns of each, and ns from 1970 to its zero where it counts from a date."""
# ns from 1970 to 2001 and to 2100: stamps in between are dates, in whichever unit they fall there.
_DATES = (978_307_200 * NS, 4_102_444_800 * NS)
_SLOWEST, _FASTEST = 0.2, 2e5  # Hz, of logs: what tells days from seconds
LARGEST_GAP = 5.0
"""Usual steps: a hole of more is a dropout, over which nothing may be drawn."""
_ALIKE = 0.1  # relative difference of steps that are the same but for rounding
_UNEVEN = 0.01
_COARSE = 0.1  # share of the samples for which the stamps have no room
_RATE = re.compile(r"(.*\.)?(fs|sr|rate|f_?sample|sampl\w*_?(rate|freq\w*))(_?hz)?", re.I)
_STEP = re.compile(r"(.*\.)?(dt|ts|tinterval|delta_?[tx]|sampl\w*_?(interval|time|period))", re.I)
_START = re.compile(r"(.*\.)?(tstart|t0|x0|start_?time)", re.I)


@dataclass(frozen=True)
class FoundClock:
    """Which series is the time, and in what.

    Attributes:
        series: its name.
        unit: one of `UNITS`.
        why: how the unit is known, for people.
        other: a unit that is as likely, which only a person can tell.
    """

    series: str
    unit: str
    why: str
    other: str | None = None


def clock(raw: RawFile, series: str | None = None, *, any_order: bool = False) -> FoundClock | None:
    """The series that holds the time, by its type, or by its name and its values.

    Args:
        raw: the file.
        series: where it is known which; only the unit is then found.
        any_order: take one that does not ascend, too.

    Returns:
        None where no series is one.
    """
    for name, channel in raw.channels.items():
        if series is not None and name != series:
            continue
        named = _TIME_NAME.fullmatch(name.strip())
        if series is None:
            # Without names the first column is the time if it ascends evenly.
            if not (named or channel.clock or (name == "1" and _even(channel.values))):
                continue
            if not (any_order or _ascends(channel.values)):
                continue
        words = (named["unit"], named[2], channel.unit) if named else (channel.unit,)
        unit = next((u for word in words if word and (u := unit_of(word))), None)
        by_size, other = _size(channel.values, unit)
        why = "as its type says" if channel.clock else "as its name says"
        if unit is None or (by_size and dated(channel.values, by_size)):
            if not by_size:
                continue
            why = "by the size of the stamps, which count from a date"
            if not dated(channel.values, by_size):
                step = float(np.median(np.diff(known(channel.values))))
                why = f"by the size of its steps, {step:g}"
            elif unit not in (None, by_size) and not by_size.startswith(unit or ""):
                why += f" ({unit}, as the name says, cannot be)"
            if channel.clock:
                why = "as its type says"
            unit = by_size
        return FoundClock(name, unit, why, other if unit == by_size else None)
    return None


def known(values: FloatArray) -> FloatArray:
    """Those of stamps that are there.

    Args:
        values: (m,) as stored.
    """
    return values[there(values)]


def there(values: FloatArray) -> BoolArray:
    """(m,) whether a stamp is there.

    Args:
        values: (m,) as stored.
    """
    return np.isfinite(values) if values.dtype.kind == "f" else np.asarray(values != MISSING)


def _ascends(values: FloatArray) -> bool:
    found = known(values)
    return found.size >= 2 and bool((np.diff(found) >= 0).all()) and found[-1] > found[0]


def _even(values: FloatArray) -> bool:
    if not _ascends(values):
        return False
    steps = np.diff(values)
    return bool(steps.min() > 0 and np.median(np.abs(steps / np.median(steps) - 1.0)) < 0.1)


def unit_of(text: str) -> str | None:
    """The unit of stamps that a word stands for; None of no such word.

    Args:
        text: such as "[µs]" or "milliseconds".
    """
    word = text.strip(" []()<>").lower().replace("µ", "u").replace("μ", "u")
    if word in UNITS:
        return word
    for unit, start in (("ns", "nano"), ("us", "micro"), ("ms", "milli")):
        if word.startswith((start, f"{unit}ec")):
            return unit
    for unit in ("s", "min", "h", "days"):
        if re.fullmatch({"s": "secs?|seconds?", "min": "minutes?|mins?", "h": "hours?|hrs?",
                         "days": "d|days?"}[unit], word):  # fmt: skip
            return unit
    return None


def _size(values: FloatArray, named: str | None) -> tuple[str, str | None]:
    """The unit that the size of stamps tells ("" for none), and one that is as likely."""
    found = known(values)
    if found.size < 2:
        return "", None
    steps = np.diff(found).astype(np.float64)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    for unit in UNITS:
        if dated(found, unit) and not unit.startswith("days"):
            return unit, None
    if not step > 0.0:
        return "", None
    for unit in ("days since 1899", "days since year 0"):
        if dated(found, unit) and 1.0 / (step * 86400.0) >= _SLOWEST and step < 1.0:
            # As seconds since a computer's start they may be, too, where that is no absurd rate.
            return unit, "s" if 1.0 / step < _FASTEST and named is None else None
    whole = bool((found == np.round(found.astype(np.float64))).all())
    # Of the rates that logs have, 5 Hz to 100 kHz: a whole number of ns, us or ms.
    if not whole and step < 1.0:
        return "s", None
    if whole and step >= 1e5:
        return "ns", None
    return ("us" if step >= 250.0 else "ms" if step >= 1.0 else "s"), None


def dated(values: FloatArray, unit: str) -> bool:
    """Whether stamps in this unit count from a date, by their size.

    Args:
        values: (m,) as stored.
        unit: of them.
    """
    found = known(values)[:1].tolist()
    # Whole numbers without end: stamps in ms that are said to be s are beyond what 64 bits hold.
    factor, zero = UNITS[unit]
    return zero is not None and bool(found) and _DATES[0] <= found[0] * factor + zero <= _DATES[1]


def ns_of(values: FloatArray, unit: str) -> FloatArray:
    """Stamps in ns; from 1970 where the unit counts from a date.

    Args:
        values: (m,) as stored, all there.
        unit: of them.

    Returns:
        (m,) int64.
    """
    factor, zero = UNITS[unit]
    shift = (zero or 0) // factor
    if values.dtype.kind in "iu":
        return (values.astype(np.int64) + shift) * factor
    whole = np.floor(values)
    rest = np.rint((values - whole) * factor).astype(np.int64)
    return (whole.astype(np.int64) + shift) * factor + rest


def rising(values: FloatArray, raw: RawFile, name: str, scale: float = 1.0) -> BoolArray:
    """(m,) which stamps go on: those that are there and later than the one before.

    Args:
        values: (m,) stamps.
        raw: their file, for messages.
        name: their series, for messages.
        scale: s, their unit.

    Raises:
        InputError: they go back, stand still, or have too few digits.
    """
    kept = there(values)
    at = np.flatnonzero(kept)
    found = values[at]
    if found.size < 2:
        raise InputError("holds fewer than two stamps", file=raw.path, key=name)
    steps = np.diff(found)
    log = raw.kind in ("mcap", "bag")
    if (steps == 0).all():
        raise InputError(f"the stamps do not ascend: all are {float(found[0]):.10g}",
                         file=raw.path, key=name,
                         hint='[time] stamp = "log" takes the time of logging' if log else
                         "give [time] rate, in Hz")  # fmt: skip
    if (steps < 0).any():
        k = int(np.flatnonzero(steps < 0)[0])
        raise InputError(
            f"{name!r} is named as a time, but goes back in sample {at[k + 1] + 1}, from "
            f"{float(found[k]):.10g} to {float(found[k + 1]):.10g}", file=raw.path, key=name,
            hint="a [[filter]] takes one of several runs in a file, [time] series another clock, "
            "[time] rate none")  # fmt: skip
    still = steps == 0
    # A stamp that stands in another's place leaves a hole there; coarse ones have no holes.
    usual, span = float(np.median(steps[~still])), float(found[-1] - found[0])
    if still.sum() > 1 and steps.size * usual > (1.0 + _COARSE) * span:
        edges = np.flatnonzero(~still)
        first, last = edges[0] + 1, edges[-1] + 1
        count, span = last - first, float(found[last] - found[first]) * scale
        if not count:
            first, last = 0, edges[-1] + 1
            count, span = last, float(found[last] - found[0]) * scale
        rate = f"{count / span:.6g}"
        raise InputError(f"the stamps are too coarse for a clock: {int(still.sum())} of "
                         f"{found.size} repeat the one before; about {rate} samples a second",
                         file=raw.path, key=name, hint=f"[time] rate = {rate}")  # fmt: skip
    kept[at[1:][still]] = False
    return kept


def of_scalars(scalars: dict[str, float]) -> tuple[float, float, str] | None:
    """The clock that single numbers of a file tell: its rate, Hz, its start, s, and why.

    Args:
        scalars: by name.
    """
    start = next((value for name, value in scalars.items() if _START.fullmatch(name)), 0.0)
    for pattern, power in ((_RATE, 1.0), (_STEP, -1.0)):
        for name, value in scalars.items():
            if pattern.fullmatch(name) and value > 0.0 and math.isfinite(value):
                return value**power, start, f"rate {value**power:.6g} Hz, as {name!r} says"
    return None


def rate_and_gaps(ns: FloatArray) -> tuple[float, list[tuple[int, float]]]:
    """The rate by the usual step, Hz, and where stamps are missing: (sample before, s).

    Args:
        ns: (m,) ascending.
    """
    steps = np.diff(ns).astype(np.float64) * 1e-9
    usual = float(np.median(steps)) if steps.size else math.nan
    gaps = np.flatnonzero(steps > LARGEST_GAP * usual)
    # Stamps are rounded: of steps alike the mean is nearer than any one of them.
    alike = steps[np.abs(steps - usual) < _ALIKE * usual]
    usual = float(alike.mean()) if alike.size else usual
    return 1.0 / usual if usual > 0.0 else math.nan, [(int(k), float(steps[k])) for k in gaps]


def told(ns: FloatArray, dates: bool) -> tuple[str, ...]:
    """What a clock shows: rate, length, gaps, date.

    Args:
        ns: (m,) its stamps.
        dates: whether they count from 1970.
    """
    rate, gaps = rate_and_gaps(ns)
    length = (ns[-1] - ns[0]) * 1e-9
    lines = [f"rate {rate:.6g} Hz, measured from {ns.size} stamps over {length:.6g} s"]
    held = length - sum(step for _, step in gaps)
    average = (ns.size - 1 - len(gaps)) / held if held > 0.0 else rate
    if abs(average / rate - 1.0) > _UNEVEN:
        lines.append(f"the steps are uneven: {average:.4g} samples a second on the average")
    if dates:
        begin = datetime.fromtimestamp(int(ns[0]) // NS, UTC)
        lines.append(f"begins {begin:%Y-%m-%d %H:%M:%S} UTC")
    if gaps:
        longest = max(gaps, key=lambda gap: gap[1])
        at = (ns[longest[0]] - ns[0]) * 1e-9
        count = f"{len(gaps)} gap{'s' * (len(gaps) > 1)}"
        lines.append(f"{count}, the longest {longest[1]:.4g} s, {at:.6g} s after the beginning")
    return tuple(lines)


def implausible(channel: RawChannel, to: str) -> str | None:
    """Why a series can hardly be what a mapping takes it for, by its size; None where it can.

    Args:
        channel: as stored, in the unit that it is said to be in, SI.
        to: the channel.
    """
    if to.partition(".")[0] not in ("position", "motor_position", "reference_position"):
        return None
    values = channel.values[np.isfinite(channel.values)]
    if values.size and np.ptp(values) > 4.0 * math.pi:
        return f"{to} spans {np.ptp(values):.4g} rad: is {channel.name} in deg?"
    return None


def require(found: FoundClock | None, raw: RawFile, key: str = "time") -> FoundClock:
    """The clock that was found.

    Args:
        found: of the file.
        raw: the file.
        key: for the message.

    Returns:
        the clock.

    Raises:
        InputError: there is none, or its unit is one of two.
    """
    if found is not None and found.other is None:
        return found
    if found is not None:
        raise InputError(f"{found.series!r} may be in {found.unit} or in {found.other}",
                         file=raw.path, key=found.series, hint="give [time] unit")  # fmt: skip
    for name, cells in raw.texts.items():
        if _TIME_NAME.fullmatch(name.strip()):
            raise InputError(f"{name!r} is named as a time, but {str(cells[0])[:60]!r} is no date "
                             "that is understood", file=raw.path, key=name)  # fmt: skip
    for channel in raw.channels.values():
        values = known(channel.values)
        # What goes back in every third step is a signal, whatever its name.
        if _TIME_NAME.fullmatch(channel.name.strip()) and values.size > 1 and (
            (np.diff(values) < 0).mean() < 1.0 / 3.0
        ):  # fmt: skip
            rising(channel.values, raw, channel.name)
    raise InputError("this file has no clock of its own, and no series is named as one",
                     file=raw.path, key=key,
                     hint="give [time] series (which holds the time) or rate")  # fmt: skip
