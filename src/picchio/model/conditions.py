"""What else was so when a record was taken: the date and the temperature."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Conditions:
    """The state of the world at a record, for effects that depend on it.

    Attributes:
        record: the record's name; effects that are drawn anew in every record look it up.
        days: since the campaign's first record; None where the date is not known.
        temperature: deg C above the mean of the campaign; None where it is not known.
    """

    record: str = ""
    days: float | None = None
    temperature: float | None = None
