"""What a reader of a foreign file hands over: named series, as they stand in the file."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError


@dataclass(frozen=True, eq=False)
class RawChannel:
    """One series of a foreign file.

    Attributes:
        name: unique in its file.
        values: (m,) float64, as stored (int64 where a float would lose digits); NaN where a
            table's cell is empty.
        time: (m,) s from the file's beginning, where the format itself says; else None.
        unit: as the file says, or None.
        suggestion: the contract's channel it seems to be, or None.
        note: for people.
    """

    name: str
    values: FloatArray
    time: FloatArray | None = None
    unit: str | None = None
    suggestion: str | None = None
    note: str = ""


@dataclass(frozen=True, eq=False)
class RawFile:
    """A foreign file.

    Attributes:
        path: the file.
        kind: one of `picchio.campaign.importing.mapping.KINDS`.
        channels: by name.
        taken: when it was recorded, where the format says.
        epoch: ns from 1970 to zero of the channels' times, where the file says.
        detected: what was found out about the file, a sentence each.
        before: samples of a table that stand in the blocks before this one.
    """

    path: Path
    kind: str
    channels: dict[str, RawChannel]
    taken: datetime | None = None
    epoch: int | None = None
    detected: tuple[str, ...] = ()
    before: int = 0

    @property
    def rows(self) -> int:
        """Samples of the first series: a table's rows."""
        return next((c.values.size for c in self.channels.values()), 0)

    def channel(self, name: str, *, mapping: Path | None = None, key: str = "from") -> RawChannel:
        """A series by name.

        Raises:
            InputError: the file has no such series.
        """
        if name not in self.channels:
            raise InputError(f"{self.path.name} has no such series", file=mapping, key=key,
                             value=name, choices=self.channels)  # fmt: skip
        return self.channels[name]


class Names:
    """Makes names unique by a trailing #2, #3, ..."""

    def __init__(self) -> None:
        self._seen: dict[str, int] = {}

    def __call__(self, name: str) -> str:
        """The name, or with its number where it was given out before."""
        self._seen[name] = self._seen.get(name, 0) + 1
        return name if self._seen[name] == 1 else f"{name}#{self._seen[name]}"


def reason(error: Exception) -> str:
    """What a reader's library says is wrong, in one line.

    Args:
        error: as it raised.
    """
    return str(error).partition("\n")[0] or type(error).__name__
