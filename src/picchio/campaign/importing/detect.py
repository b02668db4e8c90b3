"""What a file of numbers seems to be: its layout, its clock, its rate; all of it is told."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from picchio.campaign.importing.mapping import SourceTable
from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError

_HEAD = 1 << 18  # bytes looked at
_MOST = 1000  # lines of them
_LINES = 60
_DELIMITERS = ("\t", ";", ",", "|", " ")
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.I)
_NUMBER_COMMA = re.compile(r"[+-]?(\d+(,\d*)?|,\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.I)
_COMMENTS = ("#", "%", "//", "!")
_TIME_NAME = re.compile(
    r"(.*[.:/_ ])?(t|time|times|time ?stamps?|zeit|temps|tempo|clock|date ?time|date|datum|stamp|"
    r"uhrzeit|"
    r"rostime|x_value|seconds|secs?|millis|micros|nanos|nanoseconds)"
    r"([ _]*[\[(<]?[ ]*(?P<unit>s|sec|seconds?|ms|msec|milliseconds?|us|µs|μs|usec|"
    r"microseconds?|ns|nsec|nanoseconds?)[ ]*[\])>]?)?",
    re.I,
)
_WORDS = {"millis": "ms", "micros": "us", "nanos": "ns", "nanoseconds": "ns"}
SCALES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
# ns from 1970 to 2001 and to 2100: stamps in between are dates, in whichever unit they fall there.
_DATES = (978_307_200_000_000_000, 4_102_444_800_000_000_000)
_LARGEST_GAP = 5.0
_ALIKE = 0.1  # relative difference of steps that are the same but for rounding
_UNEVEN = 0.01


def layout(path: Path) -> SourceTable:
    """How a table of text is written, told from its first lines.

    Args:
        path: the file.

    Raises:
        InputError: not UTF-8, or no line holds two numbers or one.
    """
    with open(path, "rb") as stream:
        head = stream.read(_HEAD)
    text = head.decode("utf-8-sig", errors="replace")
    lines = text.splitlines()
    if len(head) == _HEAD:
        lines = lines[:-1]
    lines = lines[:_MOST]
    # Prose or comments may stand above: the numbers say what the rest is.
    best: tuple[float, SourceTable] | None = None
    for delimiter in _DELIMITERS:
        for decimal in (".", ","):
            if decimal == delimiter:
                continue
            found = _tried(lines, delimiter, decimal)
            if found is not None and (best is None or found[0] > best[0]):
                best = found
    return best[1] if best else SourceTable()


def split(line: str, delimiter: str) -> list[str]:
    """The cells of a line; a blank stands for any run of blanks.

    Args:
        line: without its end.
        delimiter: one letter.
    """
    if delimiter == " ":
        return line.split()
    return [cell.strip().strip('"') for cell in line.split(delimiter)]


def _tried(lines: list[str], delimiter: str, decimal: str) -> tuple[float, SourceTable] | None:
    """How well the lines fit this layout: columns of numbers, many of them; and the layout."""
    number = _NUMBER if decimal == "." else _NUMBER_COMMA
    table, comment = [], None
    for at, line in enumerate(lines):
        if not line.strip():
            continue
        mark = next((c for c in _COMMENTS if line.lstrip().startswith(c)), None)
        if mark is not None:
            comment = comment or mark
            continue
        table.append((at, split(line, delimiter)))
    if not table:
        return None
    widths = [len(cells) for _, cells in table]
    width = max(set(widths), key=widths.count)

    def told_as(cells: list[str]) -> list[bool]:
        return [number.fullmatch(c) is not None or moment(c) is not None for c in cells]

    def numeric(cells: list[str]) -> int:
        return sum(told_as(cells))

    # The columns that hold numbers in most lines: a header may be called "1", but not all of it.
    every = [told_as(cells) for _, cells in table if len(cells) == width]
    usual = [2 * sum(column) > len(every) for column in zip(*every, strict=True)]

    def row(at: int) -> bool:
        cells = table[at][1]
        if len(cells) != width or not numeric(cells):
            return False
        found = told_as(cells)
        return all(f or not u or not c for f, u, c in zip(found, usual, cells, strict=True))

    # The first line of numbers that another follows: prose above may hold a number, too.
    starts = [k for k in range(len(table)) if row(k) and (k + 1 == len(table) or row(k + 1))]
    if not starts:
        return None
    begin = starts[0]
    body = [cells for _, cells in table[begin:] if len(cells) == width][:_LINES]
    told = sum(numeric(cells) for cells in body) / len(body)
    if told < 1.0:
        return None
    words = sum(cell.count(",") for cells in body for cell in cells) if decimal == "," else 0
    if decimal == "," and not words:
        return None  # no number has a comma: the point is as good
    header = begin > 0 and len(table[begin - 1][1]) == width
    units = False
    if header and begin > 1 and len(table[begin - 2][1]) == width:
        upper, lower = table[begin - 2][1], table[begin - 1][1]
        units = not numeric(lower) and not numeric(upper) and _units(lower)
    first = begin - header - units
    skip = table[first][0]
    above = any(
        line.lstrip().startswith(comment) for line in lines[skip:] if comment is not None
    )  # fmt: skip
    made = SourceTable(
        delimiter=delimiter, decimal=decimal, skip_lines=skip, header=header, units=units,
        comment=comment if above else None,
    )  # fmt: skip
    # A blank is a separator only where nothing else is; a column of text costs a little.
    return told - 0.1 * (width - told) - 0.01 * _DELIMITERS.index(delimiter), made


def _units(cells: list[str]) -> bool:
    """Whether a line looks like one of units: short, and repeated or bracketed."""
    return all(len(c.strip("[]() ")) <= 8 for c in cells) and any(
        c.strip("[]() ").lower()
        in ("s", "ms", "us", "ns", "n", "rad", "deg", "v", "nm", "m/s^2", "g")
        for c in cells
    )


def moment(cell: str) -> int | None:
    """A date and time as text, in ns from 1970 (UTC where it has no zone); None of other text.

    Args:
        cell: such as "2026-03-01T08:00:00.123456789Z".
    """
    if len(cell) < 16 or cell[4:5] not in "-/" or cell[13:14] != ":":
        return None
    text = cell.replace("/", "-").replace(",", ".")
    fraction = re.search(r"\.(\d+)", text)
    whole = text if fraction is None else text[: fraction.start()] + text[fraction.end() :]
    try:
        when = datetime.fromisoformat(whole.replace("Z", "+00:00"))
    except ValueError:
        return None
    digits = (fraction[1] if fraction else "")[:9].ljust(9, "0")
    return nanoseconds(when) + int(digits)


def nanoseconds(when: datetime) -> int:
    """From 1970, ns.

    Args:
        when: in UTC where it has no zone.
    """
    aware = when if when.tzinfo else when.replace(tzinfo=UTC)
    since = aware - datetime(1970, 1, 1, tzinfo=UTC)
    return (since.days * 86400 + since.seconds) * 1_000_000_000 + since.microseconds * 1000


@dataclass(frozen=True)
class FoundClock:
    """Which series is the time, and in what.

    Attributes:
        series: its name.
        unit: s, ms, us or ns.
        dates: whether it counts from 1970.
        why: how the unit is known, for people.
    """

    series: str
    unit: str
    dates: bool
    why: str


def clock(raw: RawFile, series: str | None = None) -> FoundClock | None:
    """The series that holds the time, by its name and its values.

    Args:
        raw: the file.
        series: where it is known which; only the unit is then found.

    Returns:
        None where no series is named as a time and ascends, or nothing tells the unit.
    """
    for name, channel in raw.channels.items():
        if series is not None and name != series:
            continue
        named = _TIME_NAME.fullmatch(name.strip())
        # Without names the first column is the time if it ascends evenly.
        if series is None and named is None and not (name == "1" and _even(channel.values)):
            continue
        if series is None and not _ascends(channel.values):
            continue
        told = (named["unit"] or _WORDS.get(name.lower()) if named else None) or channel.unit
        unit = _unit(told) if told else None
        by_size, dates = _size(channel.values)
        if dates:
            why = "by the size of the stamps, which count from 1970"
            if unit is not None and unit != by_size:
                why += f" ({unit}, as the name says, cannot be)"
            return FoundClock(name, by_size, True, why)
        if unit is not None:
            why = "as its name says" if named and named["unit"] else "as the file says"
            return FoundClock(name, unit, False, why)
        if by_size:
            step = float(np.median(np.diff(channel.values)))
            return FoundClock(name, by_size, False, f"by the size of its steps, {step:g}")
    return None


def _ascends(values: FloatArray) -> bool:
    known = values[np.isfinite(values)] if values.dtype.kind == "f" else values
    return known.size >= 2 and bool((np.diff(known) >= 0).all()) and known[-1] > known[0]


def _even(values: FloatArray) -> bool:
    if not _ascends(values):
        return False
    steps = np.diff(values)
    return (
        bool(np.median(np.abs(steps / np.median(steps) - 1.0)) < 0.1) if steps.min() > 0 else False
    )


def _unit(text: str) -> str | None:
    word = text.strip(" []()").lower().replace("µ", "u").replace("μ", "u")
    for unit, names in (("ns", "nano"), ("us", "micro"), ("ms", "milli")):
        if word.startswith((names, unit)):
            return unit
    return "s" if word in ("s", "sec", "second", "seconds") else None


def _size(values: FloatArray) -> tuple[str, bool]:
    """The unit that the size of stamps tells ("" for none), and whether they count from 1970."""
    known = values[np.isfinite(values)] if values.dtype.kind == "f" else values
    if known.size < 2:
        return "", False
    start = float(known[0])
    for unit, scale in SCALES.items():
        if _DATES[0] <= start * scale * 1e9 <= _DATES[1]:
            return unit, True
    steps = np.diff(known.astype(np.float64))
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    whole = bool((known == np.round(known.astype(np.float64))).all())
    # Of the rates that logs have, 5 Hz to 100 kHz: a whole number of ns, us or ms.
    if not step > 0.0 or (not whole and step < 1.0):
        return ("s", False) if step > 0.0 else ("", False)
    if whole and step >= 1e5:
        return "ns", False
    if step >= 250.0:
        return "us", False
    return ("ms", False) if step >= 1.0 else ("s", False)


def ns_of(values: FloatArray, unit: str) -> FloatArray:
    """Stamps in ns.

    Args:
        values: (m,) as stored, all finite.
        unit: of them.

    Returns:
        (m,) int64.
    """
    factor = round(SCALES[unit] * 1e9)
    if values.dtype.kind in "iu":
        return values.astype(np.int64) * factor
    whole = np.floor(values)
    return whole.astype(np.int64) * factor + np.rint((values - whole) * factor).astype(np.int64)


def rate_and_gaps(ns: FloatArray) -> tuple[float, list[tuple[int, float]]]:
    """The rate by the usual step, Hz, and where stamps are missing: (sample before, s).

    Args:
        ns: (m,) ascending.
    """
    steps = np.diff(ns).astype(np.float64) * 1e-9
    usual = float(np.median(steps)) if steps.size else math.nan
    gaps = np.flatnonzero(steps > _LARGEST_GAP * usual)
    # Stamps are rounded: of steps alike the mean is nearer than any one of them.
    alike = steps[np.abs(steps - usual) < _ALIKE * usual]
    usual = float(alike.mean()) if alike.size else usual
    return 1.0 / usual if usual > 0.0 else math.nan, [(int(k), float(steps[k])) for k in gaps]


def told(raw: RawFile, ns: FloatArray, dates: bool) -> tuple[str, ...]:
    """What a clock shows: rate, length, gaps, date.

    Args:
        raw: its file.
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
        begin = datetime.fromtimestamp(int(ns[0]) // 1_000_000_000, UTC)
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

    Raises:
        InputError: there is none.
    """
    if found is None:
        for channel in raw.channels.values():
            back = np.flatnonzero(np.diff(channel.values) < 0)
            if _TIME_NAME.fullmatch(channel.name.strip()) and back.size:
                at = int(back[0])
                a, b = (f"{float(value):.10g}" for value in channel.values[at : at + 2])
                raise InputError(f"{channel.name!r} is named as a time, but goes back in sample "
                                 f"{at + 2}, from {a} to {b}", file=raw.path, key=channel.name,
                                 hint="a [[filter]] takes one of several runs in a file, [time] "
                                 "series another clock, [time] rate none")  # fmt: skip
        raise InputError("this file has no clock of its own, and no series is named as one",
                         file=raw.path, key=key,
                         hint="give [time] series (which holds the time) or rate")  # fmt: skip
    return found
