"""What numbers that are drawn anew in every record cost: they come from one distribution."""

from __future__ import annotations

import math
from dataclasses import replace

from picchio.diagnosis.percussion.unknowns import Hypothesis


def drawn_cost(fall: float, count: int, samples: int) -> float:
    """What a fit must pay for numbers drawn from a normal distribution of unknown width.

    A number that is told by the data with a standard deviation far below the width costs as much as
    any other, ln(samples) by BIC; one that is hardly told is not free to begin with. Minus twice
    the logarithm of the likelihood, integrated over the numbers: with the same information h of
    each and the width that is likeliest, h * width^2 = fall / count - 1, that is
    count (1 + ln(fall / count)). (Laird and Ware, Biometrics 38 (1982) 963, doi:10.2307/2529876.)

    Args:
        fall: of chi-square, by the numbers together.
        count: of the numbers.
        samples: of the data.

    Returns:
        the cost in units of chi-square, at least what the numbers gain by chance.
    """
    if count < 1 or fall <= count:
        return max(fall, 0.0)
    return count * min(1.0 + math.log(fall / count), math.log(max(samples, 2)))


def with_drawn(hypothesis: Hypothesis, label: str, fall: float, count: int) -> Hypothesis:
    """The hypothesis with what an effect's drawn numbers gain written down."""
    others = tuple(item for item in hypothesis.drawn if item[0] != label)
    return replace(hypothesis, drawn=(*others, (label, fall, count)))


def width_spread(width: float, fall: float, count: int) -> float:
    """Standard deviation of the width of a distribution, from numbers drawn from it.

    Args:
        width: of the distribution, without what noise adds.
        fall: of chi-square, by the numbers together.
        count: of the numbers.
    """
    if fall <= count or count < 1:
        return width
    return width * fall / (fall - count) / math.sqrt(2.0 * count)
