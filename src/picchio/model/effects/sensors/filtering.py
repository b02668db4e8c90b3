"""Parameters of filters in a sensor's electronics or in its logger."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from picchio.model.effects.effect import Parameter
from picchio.model.sensing import Filter

ORDER = Parameter(
    "order",
    neutral=1.0,
    lower=1.0,
    upper=2.0,
    shape=True,
    whole=True,
    meaning="1, or 2: Butterworth",
)
DIGITAL = Parameter(
    "digital", lower=0.0, upper=1.0, shape=True, whole=True,
    meaning="1: of the samples (bilinear), 0: before them; slow corners hardly tell the two apart",
)  # fmt: skip


def filter_of(values: Mapping[str, float]) -> Filter:
    """The filter of an effect's values.

    Args:
        values: "frequency", "order" and "digital".
    """
    return Filter(values["frequency"], round(values["order"]), values["digital"] > 0.5)


def tried_at(frequencies: Sequence[float]) -> tuple[dict[str, float], ...]:
    """Every order, analogue and digital, at each of some corners.

    Args:
        frequencies: Hz.
    """
    return tuple(
        {"frequency": f, "order": order, "digital": digital}
        for f in frequencies
        for order in (1.0, 2.0)
        for digital in (0.0, 1.0)
    )
