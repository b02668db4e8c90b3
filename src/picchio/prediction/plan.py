"""What a test plan holds: `picchio-plan/1`."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from picchio.campaign.channels import AXES, Channel, ChannelKind, kinds, parse_channel
from picchio.campaign.tables import CampaignExcitation, Direction, Pose, SampleRate, Tolerance
from picchio.core.errors import InputError
from picchio.core.toml import (
    Finite,
    Name,
    NotNegative,
    Positive,
    StrictModel,
    parse_toml,
    read_toml,
    validate,
)
from picchio.excitation.piecewise import Hits
from picchio.excitation.table import catalogue, excitation_class
from picchio.model.effects.effect import Effect
from picchio.model.effects.registry import from_dict
from picchio.robot.flexible_robot import FlexibleRobot

FORMAT = "picchio-plan/1"
MOST_SAMPLES = 50_000_000


def _predicted() -> dict[str, ChannelKind]:
    """The kinds of channel that a percussion record can hold, by name."""
    return {kind.name: kind for kind in kinds() if kind.reader is not None}


def _groups() -> list[str]:
    """What a sensor may be asked to read, for messages."""
    return [name + (".tool" if kind.of == "frame" else "") for name, kind in _predicted().items()]


class SensorTable(StrictModel):
    """One `[[sensor]]`.

    Attributes:
        channels: a channel, or a group of them: "deflection" for every flexible joint,
            "accelerometer.tool" for that frame's three axes, "accelerometer" for the tool frame's.
        noise: standard deviation of white noise, in `unit`.
        unit: of `noise`; the channel's SI unit where left out.
    """

    channels: Name
    noise: NotNegative = 0.0
    unit: str | None = None

    def expand(self, robot: FlexibleRobot) -> list[tuple[Channel, float]]:
        """Its channels on this robot, with their noise in SI.

        Args:
            robot: the robot.

        Raises:
            InputError: no such channel, joint or frame, or one that cannot be predicted.
        """
        word, _, rest = self.channels.partition(".")
        kind = _predicted().get(word)
        if kind is not None and kind.of == "joint" and not rest:
            names = [f"{word}.{joint}" for joint in robot.flexible_names]
        elif kind is not None and kind.of == "frame" and rest.rpartition(".")[2] not in AXES:
            frame = rest or robot.tool_frame
            robot.link_of(frame)
            names = [f"{word}.{frame}"]
            if kind.axes:
                names = [f"{word}.{frame}.{axis}" for axis in AXES]
        else:
            names = [self.channels]
        found = []
        for name in names:
            try:
                channel, convert = parse_channel(name, self.unit or _own_unit(name, robot))
            except InputError as error:
                raise InputError(error.problem, key="channels", value=self.channels,
                                 choices=error.choices or _groups()) from None  # fmt: skip
            if channel.kind.reader is None:
                raise InputError("is nothing that a percussion record holds", key="channels",
                                 value=self.channels, choices=_groups())  # fmt: skip
            joint = channel.kind.of == "joint"
            if joint and channel.subject not in robot.flexible_names:
                raise InputError("no such flexible joint", key="channels", value=self.channels,
                                 choices=robot.flexible_names)  # fmt: skip
            if joint and channel.unit != _own_unit(name, robot):
                raise InputError(f"must be a multiple of {_own_unit(name, robot)}", key="unit",
                                 value=self.unit)  # fmt: skip
            if channel.kind.of == "frame":
                robot.link_of(channel.subject or "")
            found.append((channel, convert.scale * self.noise))
        return found


def _own_unit(name: str, robot: FlexibleRobot) -> str | None:
    """A joint's channel's SI unit, which depends on the joint; None for other channels."""
    word, _, joint = name.partition(".")
    kind = _predicted().get(word)
    slides = {j.name: j.kind == "prismatic" for j in robot.flexible_joints}
    if kind is None or kind.of != "joint" or joint not in slides:
        return None
    return kind.units[-1 if slides[joint] else 0]


class EffectTable(StrictModel):
    """One `[[effect]]`: a departure of the simulated world from the robot's files.

    Attributes:
        effect: a name from `picchio effects`.
        target: the joint, link, axis, channel group, "tool" or "robot" that it acts on.
        parameters: SI values by name; those left out are neutral.
    """

    effect: str
    target: str
    parameters: dict[str, Finite] = Field(default_factory=dict)

    def build(self, robot: FlexibleRobot) -> Effect:
        """The effect.

        Args:
            robot: that has its target.

        Raises:
            InputError: no such effect, target or parameter, a value out of bounds.
        """
        return from_dict(self.model_dump(), robot)


class Plan(StrictModel):
    """A plan as it is written.

    Attributes:
        poses: rad or m, by joint name or in the robot's joint order.
        directions: world, of any length.
        levels: N, heights of the blows; the excitation's own where left out.
        combine: "all" takes every pose with every direction and level; "in-turn" takes the
            directions and levels in turn, one record a pose.
        repeats: how often each record is taken.
        hits: blows of a burst from rest; a steady state where left out.
        sample_rate: Hz, of every record.
        quiet: s, before the first blow; none in a steady record.
        length: s, from the first blow on.
        times: when each record is taken; as many as there are records.
        temperatures: deg C, of the robot in each record; as many as there are records.
        excitation: the blows.
        tolerance: how well the nominal values are known; copied to the campaign.
        sensor: what is measured, and with how much noise.
        effect: how the simulated world differs from the robot's files.
        seed: of the noise.
        notes: free text.
    """

    poses: list[Pose] = Field(min_length=1)
    directions: list[Direction] = Field(min_length=1)
    levels: list[Positive] | None = Field(default=None, min_length=1)
    combine: Literal["all", "in-turn"] = "all"
    repeats: Annotated[int, Field(gt=0, strict=True)] = 1
    hits: Hits | None = None
    sample_rate: SampleRate
    quiet: NotNegative = 0.15
    length: Positive
    times: list[datetime] | None = None
    temperatures: list[Finite] | None = None
    excitation: CampaignExcitation
    tolerance: Tolerance = Tolerance()
    sensor: list[SensorTable] = Field(min_length=1)
    effect: list[EffectTable] = Field(default_factory=list)
    seed: Annotated[int, Field(ge=0, strict=True)] = 0
    notes: str | None = None

    @property
    def burst(self) -> int | None:
        """Blows of a burst; None for a steady state."""
        return self.hits if self.hits is not None else self.excitation.hits

    @property
    def samples(self) -> tuple[int, int]:
        """How many before t = 0, and from there on."""
        before = 0 if self.burst is None else round(self.quiet * self.sample_rate)
        return before, max(round(self.length * self.sample_rate), 2)

    def records(self) -> Iterator[dict[str, Any]]:
        """What is to be taken, in order: what a campaign's table of each record says."""
        levels: list[float | None] = [*self.levels] if self.levels else [None]
        kinds = list(itertools.product(self.directions, levels))
        number = 0
        for turn, pose in enumerate(self.poses):
            chosen = kinds if self.combine == "all" else [kinds[turn % len(kinds)]]
            for direction, level in chosen:
                for _ in range(self.repeats):
                    told = {
                        "pose": pose,
                        "direction": direction,
                        "force": level,
                        "time": self.times[number] if self.times else None,
                        "temperature": self.temperatures[number] if self.temperatures else None,
                    }
                    yield {key: value for key, value in told.items() if value is not None}
                    number += 1

    @property
    def count(self) -> int:
        """How many records."""
        kinds = len(self.directions) * (len(self.levels) if self.levels else 1)
        return len(self.poses) * self.repeats * (kinds if self.combine == "all" else 1)

    def check(self) -> None:
        """Raise for what only shows in the whole.

        Raises:
            InputError: a measured excitation, a wrong number of times, too many samples.
        """
        if not excitation_class(self.excitation.kind).programmed:
            programmed = [kind for kind, made in catalogue().items() if made.programmed]
            raise InputError("a plan's blows are not measured yet", key="excitation.kind",
                             value=self.excitation.kind, choices=programmed)  # fmt: skip
        if self.hits is not None and self.excitation.hits is not None:
            raise InputError("is given twice, here and in [excitation]", key="hits",
                             value=self.hits)  # fmt: skip
        for key in ("times", "temperatures"):
            given = getattr(self, key)
            if given is not None and len(given) != self.count:
                raise InputError(f"must be as many as records ({self.count})", key=key,
                                 value=len(given))  # fmt: skip
        for key in ("quiet", "length"):
            total = self.count * getattr(self, key) * self.sample_rate
            if total > MOST_SAMPLES:
                raise InputError(f"that is {total:.3g} samples a channel at {self.sample_rate:g} "
                                 f"Hz; at most {MOST_SAMPLES:.0e}", key=key,
                                 value=getattr(self, key))  # fmt: skip
        first = next(self.records())
        self.excitation.overridden_by(CampaignExcitation(force=first.get("force"))).blows.build()


class PlannedTest(StrictModel):
    """One `[[test]]`: a record to be taken by hand.

    Attributes:
        kind: what it becomes in a campaign.
        pose: rad or m, by joint name.
        direction: of the pull or the blow, world, unit length.
        force: N, how hard.
        read_direction: the way in which the instrument reads, world; all axes where left out.
        file: of the campaign, where the record goes.
        minutes: 1, that it takes, with what must be set up for it.
    """

    kind: Literal["static", "frf"]
    pose: Pose
    direction: Direction
    force: Positive
    read_direction: Direction | None = None
    file: Name
    minutes: Positive


class TestPlan(StrictModel):
    """A plan of tests for stiffness, as `picchio plan` writes it.

    Attributes:
        robot: its name or file.
        instruments: at hand.
        test: the records, in the order in which to take them.
        notes: free text.
    """

    robot: Name
    instruments: list[Name]
    test: list[PlannedTest]
    notes: str | None = None


def read_plan(path: str | Path | Mapping[str, Any]) -> Plan:
    """The plan of blows in a file.

    Args:
        path: of the file, or its keys and values; `format` may be left out.

    Raises:
        InputError: no such plan; one of tests that are done by hand.
    """
    if isinstance(path, Mapping):
        return validate({"format": FORMAT, **path}, Plan, format=FORMAT)
    if "test" in read_toml(path):
        raise InputError(
            "is a plan of tests for stiffness, which are done by hand", file=Path(path), key="test",
            hint="fill in the form beside it; picchio identify reads it",
        )  # fmt: skip
    return parse_toml(path, Plan, format=FORMAT)


def plan_toml(plan: Plan | TestPlan) -> str:
    """The plan as a file."""
    import tomlkit

    content = plan.model_dump(exclude_none=True, exclude_defaults=True)
    tables = ("excitation", "tolerance", "sensor", "effect", "test")
    keys = sorted(content, key=lambda name: (name in tables, name in ("sensor", "effect", "test")))
    document = tomlkit.document()
    document |= {"format": FORMAT, **{key: content[key] for key in keys}}
    return tomlkit.dumps(document)
