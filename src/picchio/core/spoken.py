"""Numbers as an engineer says them: the one place where a number becomes text for people."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

DIGITS = 3  # more than these the physics does not deserve
UNLIMITED = "unlimited"  # a life below the endurance limit, or whatever else nothing bounds
_ROUNDING = 1e-9  # in any unit that is printed, less than this is rounding
_FEW = 3  # names that are read faster than counted
_GROUPED = 1e9  # from here on a power of ten is easier to read than groups of digits


def number(value: float | None, digits: int = DIGITS, least: float = _ROUNDING) -> str:
    """A number of any quantity.

    Args:
        value: inf is "unlimited"; None and NaN are a dash.
        digits: that count.
        least: what is smaller is "about 0".

    Returns:
        such as "0.0412", "12,300" or "4.1e9".
    """
    if value is None or math.isnan(value):
        return "-"
    if math.isinf(value):
        return UNLIMITED
    if abs(value) < least:
        return "about 0" if value else "0"
    rounded = float(f"{value:.{digits}g}")
    if min(1e3, 10**digits) <= abs(rounded) < _GROUPED:
        return f"{rounded:,.0f}" if abs(rounded) >= 10 ** (digits - 1) else f"{rounded:,g}"
    mantissa, e, power = f"{rounded:.{digits}g}".partition("e")
    return mantissa + (f"e{int(power)}" if e else "")


def count(value: float | None, digits: int = DIGITS) -> str:
    """A number of rivets or blows: "< 1" and "> 1e9" beyond what anybody needs to know.

    Args:
        value: as in `number`.
        digits: that count.
    """
    if value is not None and 0.0 < value < 1.0:
        return "< 1"
    return "> 1e9" if value is not None and _GROUPED < value < math.inf else number(value, digits)


def per_cent(share: float | None, digits: int = DIGITS) -> str:
    """A share, 1 being all, in per cent without its sign; below 0.001 % it is about 0.

    Args:
        share: as in `number`.
        digits: that count.
    """
    return number(None if share is None else 100.0 * share, digits, 1e-3)


def between(ends: Sequence[float | None], tell: Callable[..., str] = number) -> str:
    """An interval; one number where both ends read alike.

    Args:
        ends: low and high.
        tell: writes each.
    """
    return " to ".join(dict.fromkeys(map(tell, ends)))


def likely(ends: Sequence[float | None]) -> str:
    """The interval of an estimated share, 1 being all, in per cent without its sign.

    Args:
        ends: low and high; an estimate deserves two digits, and below 1 % none.
    """
    if all(end is not None and 0.0 <= end < 0.01 for end in ends) and any(ends):
        return "< 1"
    return between(ends, partial(per_cent, digits=2))


def those(names: Sequence[str], every: Sequence[str]) -> str:
    """Joints by name, but "all 6 joints" rather than a list of so many.

    Args:
        names: those that are meant.
        every: all that there are.

    Returns:
        such as "joint_1, joint_2".
    """
    all_of_many = len(every) > _FEW and set(names) == set(every)
    return f"all {len(every)} joints" if all_of_many else ", ".join(names)


def factor(decades: float) -> str:
    """How far apart the ends of an interval are.

    Args:
        decades: powers of ten from end to end.

    Returns:
        such as "a factor 22".
    """
    return f"a factor {number(10.0**decades, 2)}"


def allowed(ends: Sequence[float | None]) -> str:
    """An interval of what is allowed; None, as in JSON, is unlimited.

    Args:
        ends: low and high.
    """
    return between([math.inf if end is None else end for end in ends])
