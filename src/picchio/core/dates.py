"""Dates and times as people and loggers write them, in ns from 1970."""

from __future__ import annotations

import re
from datetime import UTC, datetime

import numpy as np

from picchio.core.arrays import IndexArray

NS = 1_000_000_000
MISSING = np.iinfo(np.int64).min
"""ns of a cell that holds no date; numpy's NaT."""
_DAY = 86_400 * NS
_ISO = len("2026-03-01T08:00:00")
_WHEN = re.compile(
    r"(?:(?P<y>\d{4})(?P<s>[-/.]?)(?P<m>\d\d)(?P=s)(?P<d>\d\d)"
    r"|(?P<a>\d{1,2})(?P<t>[-/. ])(?P<b>\d{1,2}|[A-Za-z]{3})(?P=t)(?P<z>\d{4}|\d\d))?[T ,]*"
    r"(?:(?P<h>\d{1,2}):(?P<n>\d\d)(?::(?P<c>\d\d)(?:[.,:](?P<f>\d{1,12}))?)?"
    r"|(?<=T)(?P<h2>\d\d)(?P<n2>\d\d)(?P<c2>\d\d)(?:[.,](?P<f2>\d{1,12}))?)?"
    r" ?(?P<half>[AP]\.?M\.?)? ?(?P<zone>Z|UTC|GMT|[+-]\d\d(?::?\d\d)?)?",
    re.I,
)
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")


def nanoseconds(when: datetime) -> int:
    """From 1970, ns.

    Args:
        when: in UTC where it has no zone.
    """
    aware = when if when.tzinfo else when.replace(tzinfo=UTC)
    since = aware - datetime(1970, 1, 1, tzinfo=UTC)
    return (since.days * 86400 + since.seconds) * NS + since.microseconds * 1000


def is_moment(cell: str) -> bool:
    """Whether a text is a date, a time of day, or both.

    Args:
        cell: such as "01.01.2026 10:30:25,5 PM".
    """
    found = _WHEN.fullmatch(cell.strip()) if cell[:1].isdigit() else None
    return found is not None and any(found[k] for k in ("h", "h2", "s", "t"))


def moment(cell: str) -> int | None:
    """A date and time as text, in ns from 1970 (UTC where it has no zone); None of other text.

    Args:
        cell: such as "2026-03-01T08:00:00.123456789Z".
    """
    if not is_moment(cell):
        return None
    kind, ns, _ = moments([cell])
    return int(ns[0]) if kind == "date" and ns[0] != MISSING else None


def moments(cells: list[str]) -> tuple[str, IndexArray, str]:
    """Texts as dates.

    Args:
        cells: of one column.

    Returns:
        "date" (ns from 1970), "day" (the same, without a time of day) or "clock" (ns from
        midnight); (m,) int64 ns, `MISSING` where a cell is none; how days and months were told
        apart where both would do, else "".
    """
    first = next((c for c in cells if c), "")
    if min(map(len, cells), default=0) >= _ISO and first[4] == "-" and first[13:14] == ":":
        try:  # UTC, with or without a Z: a hundred times as fast
            if not any("+" in c or "-" in c[10:] or c[-1] in "cCmMtT" for c in cells):
                made = np.array([c.rstrip("Z") for c in cells], "datetime64[ns]")
                return "date", made.astype(np.int64), ""
        except ValueError:
            pass
    found = [_WHEN.fullmatch(cell.strip()) for cell in cells]
    dated = [x for x in found if x is not None and (x["y"] or x["a"])]
    word = ""
    day_first = True
    numbers = [x for x in dated if x["a"] and x["b"].isdigit()]
    if numbers:
        above = [max((int(x[k]) for x in numbers), default=0) > 12 for k in ("a", "b")]
        american = any(x["half"] for x in numbers) and numbers[0]["t"] == "/"
        day_first = above[0] or not (above[1] or american)
        if not any(above) and numbers[0]["t"] != ".":
            order = "day and month" if day_first else "month and day"
            word = f"{numbers[0][0]!r} is taken for {order}"
    ns = np.array([_ns(x, day_first) for x in found], dtype=np.int64)
    timed = any(x is not None and (x["h"] or x["h2"]) for x in found)
    kind = "clock" if not dated else "date" if timed else "day"
    return kind, ns, word


def _ns(found: re.Match[str] | None, day_first: bool) -> int:
    """One text in ns from 1970, or from midnight where it has no date."""
    if found is None or not found[0]:
        return MISSING
    hour, minute = int(found["h"] or found["h2"] or 0), int(found["n"] or found["n2"] or 0)
    second = int(found["c"] or found["c2"] or 0)
    if found["half"]:
        hour = hour % 12 + 12 * (found["half"][0] in "pP")
    ns = int((found["f"] or found["f2"] or "")[:9].ljust(9, "0"))
    year, month, day = 1970, 1, 1
    try:
        if found["y"]:
            year, month, day = int(found["y"]), int(found["m"]), int(found["d"])
        elif found["a"]:
            first, second_ = found["a"], found["b"]
            if not second_.isdigit():
                month, day = _MONTHS.index(second_.lower()) + 1, int(first)
            else:
                day, month = (int(first), int(second_))[:: 1 if day_first else -1]
            year = int(found["z"]) + (2000 if len(found["z"]) == 2 else 0)
        whole = nanoseconds(datetime(year, month, day, hour, minute, min(second, 59)))
    except ValueError:  # no such month, day or hour
        return MISSING
    ns += whole + (second - min(second, 59)) * NS  # a leap second
    zone = found["zone"]
    if zone and zone[0] in "+-":
        away = int(zone[1:3]) * 60 + int(zone[-2:] if len(zone) > 3 else 0)
        ns -= (1 if zone[0] == "+" else -1) * away * 60 * NS
    return ns
