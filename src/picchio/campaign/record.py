"""One record: what was done, and the samples, read when needed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from picchio.campaign.channels import (
    FREQUENCY,
    FRF_KINDS,
    LOADING_KINDS,
    TIME,
    Channel,
    parse_channel,
)
from picchio.campaign.clock import TOLERANCE, Clock, ClockCheck
from picchio.campaign.source import Arrays, Layout, MemorySource, Source
from picchio.campaign.tables import (
    CAMPAIGN_FILE,
    FORMAT,
    CampaignExcitation,
    CampaignTable,
    RecordTable,
)
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.shown import Shown
from picchio.core.toml import validate
from picchio.excitation.excitation import Excitation
from picchio.robot.flexible_robot import FlexibleRobot

if TYPE_CHECKING:
    import pandas

BLOCK = 16384
LAYOUTS = {
    "static": Layout(None, LOADING_KINDS),
    "frf": Layout(FREQUENCY, FRF_KINDS),
}
"""What the columns of a record may be, by its kind; of the others a time and channels."""


@dataclass(frozen=True, eq=False)
class Record(Shown):
    """One record of a campaign.

    Attributes:
        table: the `[[record]]` table as written.
        source: the samples.
        base_excitation: the campaign's `[excitation]`.
        folder: the campaign's folder; None in memory.
        clock_tolerance: how uneven the clock may be, in steps.
    """

    PLOTS: ClassVar = {"channels": "visuals.plots.results:plot_record"}
    LACKS: ClassVar = {"show": "a record alone has no robot"}

    table: RecordTable
    source: Source
    base_excitation: CampaignExcitation = field(default_factory=CampaignExcitation)
    folder: Path | None = None
    clock_tolerance: float = TOLERANCE

    @classmethod
    def from_arrays(
        cls,
        file: str,
        time: FloatArray,
        channels: Mapping[str, FloatArray],
        /,
        *,
        units: Mapping[str, str] | None = None,
        **table: Any,
    ) -> Record:
        """A record in memory.

        Args:
            file: the name it will have in a campaign, such as "r01.csv".
            time: (m,) s.
            channels: {name: (m,)} in SI.
            units: the SI unit of a channel where its kind allows several and it is not the
                first: {"position.slide": "m"}.
            **table: the other keys of `[[record]]`: kind, pose, direction, hits, time
                (when it was taken), ...

        Raises:
            InputError: an unknown channel or key, arrays that don't fit.
        """
        return cls._of(file, list(channels), {**channels, TIME: time}, units, table)

    @classmethod
    def from_columns(
        cls,
        file: str,
        columns: Mapping[str, FloatArray],
        /,
        *,
        units: Mapping[str, str] | None = None,
        **table: Any,
    ) -> Record:
        """A record in memory whose rows are no samples in time, such as a static one.

        Args:
            file: the name it will have in a campaign, such as "loads.csv".
            columns: {name: (m,)} in SI.
            units: as `from_arrays`.
            **table: the other keys of `[[record]]`, `kind` among them.

        Raises:
            InputError: an unknown column or key, arrays that don't fit.
        """
        return cls._of(file, list(columns), columns, units, table)

    @classmethod
    def from_function(
        cls,
        file: str,
        names: Sequence[str],
        read: Callable[[], Mapping[str, FloatArray]],
        /,
        *,
        units: Mapping[str, str] | None = None,
        **table: Any,
    ) -> Record:
        """A record whose arrays, "time" among them, are made when first needed.

        Args:
            file: its name, relative to a campaign's folder.
            names: the channels that `read` returns.
            read: gives the arrays by channel, "time" among them.
            units: by channel; SI where left out.
            **table: keys of `[[record]]`.

        Raises:
            InputError: as `from_arrays`.
        """
        return cls._of(file, names, read, units, table)

    @classmethod
    def _of(
        cls,
        file: str,
        names: Sequence[str],
        arrays: Arrays,
        units: Mapping[str, str] | None,
        table: Mapping[str, Any],
    ) -> Record:
        content = {"format": FORMAT, "record": [{"file": file, **table}]}
        entry = validate(content, CampaignTable, format=FORMAT).record[0]
        layout = LAYOUTS.get(entry.kind, Layout())
        found = [
            parse_channel(name, (units or {}).get(name), layout.kinds)[0]
            for name in names
            if name != layout.first
        ]
        return cls(entry, MemorySource(found, arrays, file, layout))

    def to_frame(self) -> pandas.DataFrame:
        """A row a sample: the time (or the first column) and every channel, SI."""
        import pandas

        return pandas.DataFrame(self.read())

    def _repr_html_(self) -> str:
        from picchio.core.html import sheet

        facts = {"kind": self.kind, "pose [rad, m]": str(self.pose), "force along": self.direction,
                 "hits": self.hits, "temperature [degC]": self.temperature}  # fmt: skip
        rows = [(self.channel(name).name, self.channel(name).unit) for name in self.channels]
        return sheet(f"Record {self.file}", facts, ("channel", "unit"), rows)

    @property
    def file(self) -> str:
        """The file's name within the campaign: what the record is called."""
        return self.table.file

    @property
    def kind(self) -> str:
        """What was done: "percussion", "motion", "static", "frf" or "clamped"."""
        return self.table.kind

    @property
    def test(self) -> str:
        """What kind of test it is: its kind, or "tap" of a percussion record that is one blow."""
        tapped = self.kind == "percussion" and self.excitation.kind == "tap"
        return "tap" if tapped else self.kind

    @property
    def in_time(self) -> bool:
        """Whether its rows are samples in time."""
        return self.source.layout.first == TIME

    @property
    def pose(self) -> dict[str, float] | list[float] | None:
        """Link-side joint positions (rad or m), as `FlexibleRobot.pose` takes them."""
        return self.table.pose

    def posed(self, robot: FlexibleRobot) -> FloatArray:
        """(nv,) the pose, rad or m; joints that it does not name are at 0.

        Args:
            robot: whose joints they are.

        Raises:
            InputError: as `FlexibleRobot.pose`, with the campaign's file and the record's number.
        """
        try:
            return robot.pose({} if self.pose is None else self.pose)
        except InputError as error:
            path = self.source.path
            if path is not None:
                path = path.parents[len(Path(self.file).parts) - 1] / CAMPAIGN_FILE
            raise error.placed(file=path, key=f"{self.source.key}.pose") from None

    def standing(self, robot: FlexibleRobot) -> dict[str, float | None]:
        """Joints whose angle was not recorded -> where `pose` says they stand, None if nowhere.

        Args:
            robot: whose joints count.

        Returns:
            {joint: rad or m}, without the joints that have a channel.

        Raises:
            InputError: a pose that does not fit the robot.
        """
        channels = [self.channel(name) for name in self.channels]
        seen = {c.subject for c in channels if c.kind.motion in ("link", "motor")}
        given = self.pose or {}
        at = dict(zip(robot.joint_names, self.posed(robot).tolist(), strict=True))
        stated = given if isinstance(given, dict) else robot.joint_names
        return {j: at[j] if j in stated else None for j in at if j not in seen}

    @property
    def direction(self) -> FloatArray | None:
        """(3,) unit vector, world; None for motion."""
        if self.table.direction is None or self.kind != "percussion":
            return None
        direction = np.array(self.table.direction, dtype=np.float64)
        return direction / np.linalg.norm(direction)

    @property
    def taken(self) -> datetime | None:
        """When it was taken."""
        return self.table.time

    @property
    def temperature(self) -> float | None:
        """Of the surroundings, deg C."""
        return self.table.temperature

    @cached_property
    def excitation(self) -> CampaignExcitation:
        """The blows as programmed: the campaign's table with the record's own keys in it."""
        return self.base_excitation.overridden_by(self.table.own_excitation())

    @property
    def hits(self) -> int | None:
        """Blows of the burst, one of a tap; None in a steady record."""
        return self.excitation.hits or (1 if self.test == "tap" else None)

    @property
    def reads_force(self) -> bool:
        """Whether it states no blows: its channel `force` has what the tool did."""
        stated = self.excitation.blows.model_dump(exclude_none=True)
        return self.kind == "percussion" and not stated

    @property
    def steady(self) -> bool:
        """Whether the blows never end. A force that is only read begins from rest."""
        return self.kind == "percussion" and self.hits is None and not self.reads_force

    def blows(self) -> Excitation | None:
        """The programmed blow train; None where none is stated.

        Raises:
            InputError: a key of the excitation is missing or out of range.
        """
        if self.kind != "percussion" or self.reads_force:
            return None
        file = self.folder / "campaign.toml" if self.folder is not None else None
        return self.excitation.blows.build(file=file, key=f"{self.source.key}.excitation")

    def acting(self) -> tuple[Excitation, int | None]:
        """What acts on the robot, and how many of it: the blows as stated, or once what was read.

        Raises:
            InputError: as of `blows`; neither is there.
        """
        from picchio.excitation.measured import MeasuredForce

        stated = self.blows()
        if stated is not None:
            return stated, self.hits
        read = self.read(["force"])
        return MeasuredForce.from_start(read[TIME], read["force"]), 1

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels' names, without the time."""
        return tuple(self.source.channels)

    def channel(self, name: str) -> Channel:
        """What a channel measures.

        Args:
            name: such as "deflection.joint_1".

        Raises:
            InputError: this record has no such channel.
        """
        try:
            return self.source.channels[name]
        except KeyError:
            raise self.source.error(
                "the record has no such channel", value=name, choices=self.channels
            ) from None

    def chunks(
        self, channels: Iterable[str] | None = None, size: int = BLOCK
    ) -> Iterator[dict[str, FloatArray]]:
        """The record block by block, in constant memory, checked on the way.

        Args:
            channels: their names; all where None.
            size: at most so many samples a block.

        Yields:
            {"time": (m,) s, name: (m,) in the channel's SI unit}, float64; without the time
            where the record's rows are no samples in time.

        Raises:
            InputError: a sample that is missing, not finite or out of time, with its line.
        """
        if size < 1:
            raise InputError("must be positive", key="size", value=size)
        names = list(self.channels if channels is None else channels)
        for name in names:
            if name != TIME:
                self.channel(name)
        if not self.in_time:
            column = self.source.layout.first
            wanted = [*([column] if column else []), *names]
            yield from (block for _, block in self.source.blocks(wanted, size))
            return
        check = ClockCheck(self.source, self.clock_tolerance)
        for first, block in self.source.blocks([TIME, *dict.fromkeys(names)], size):
            check.feed(block[TIME], first)
            yield block
        clock = check.finish()
        self.__dict__.setdefault("clock", clock)

    def read(self, channels: Iterable[str] | None = None) -> dict[str, FloatArray]:
        """The record, or some of its channels, at once; as one block of `chunks`.

        Args:
            channels: names; None for all.

        Raises:
            InputError: as `chunks`; there is no row.
        """
        blocks = list(self.chunks(channels))
        if not blocks:
            raise self.source.error("is empty")
        return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}

    def __getitem__(self, name: str) -> FloatArray:
        """(m,) one channel, or the time."""
        return self.read([name])[name]

    @property
    def time(self) -> FloatArray:
        """(m,) s, as written."""
        return self[TIME]

    @cached_property
    def clock(self) -> Clock:
        """Start, step and length; reads the time column once."""
        check = ClockCheck(self.source, self.clock_tolerance)
        for first, block in self.source.blocks([TIME], BLOCK):
            check.feed(block[TIME], first)
        return check.finish()

    def check_samples(self) -> None:
        """Read everything once, in constant memory.

        Raises:
            InputError: as `chunks`.
        """
        for _ in self.chunks():
            pass
