"""The channels that a record may hold: the one place to add a kind.

A channel's name is its kind, then the joint or frame it belongs to, then an axis where the kind
has axes: `force`, `deflection.joint_1`, `accelerometer.tool.x`. To add a kind, add a line to
`KINDS`, or call `register_channel_kind` from elsewhere.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from functools import cache
from typing import Literal

from picchio.campaign.units import Conversion, conversion
from picchio.core.errors import InputError

AXES = ("x", "y", "z")
TIME = "time"


@dataclass(frozen=True)
class ChannelKind:
    """A kind of channel.

    Attributes:
        name: the first word of the channel's name.
        of: what it belongs to: "joint", "frame", or None for the robot as a whole.
        units: the SI units it may have; the second is the prismatic joint's.
        axes: whether the name ends in .x, .y or .z.
        meaning: for people.
        free_offset: a constant offset per record and channel is a nuisance (encoder zeros).
    """

    name: str
    of: Literal["joint", "frame"] | None
    units: tuple[str, ...]
    axes: bool = False
    meaning: str = ""
    free_offset: bool = False

    @property
    def pattern(self) -> str:
        """How a name of this kind looks, such as "deflection.<joint>"."""
        return self.name + (f".<{self.of}>" if self.of else "") + (".x" if self.axes else "")


KINDS: list[ChannelKind] = [
    ChannelKind("force", None, ("N",), meaning="the tool's force along the direction"),
    ChannelKind("deflection", "joint", ("rad", "m"), meaning="link side minus motor side"),
    ChannelKind("acceleration", "frame", ("m/s^2",), True, "of the frame's origin, world axes"),
    ChannelKind("accelerometer", "frame", ("m/s^2",), True, "as read, the frame's axes"),
    ChannelKind("velocity", "frame", ("m/s",), True, "of the frame's origin, world axes"),
    ChannelKind("displacement", "frame", ("m",), True, "of the frame's origin, world axes"),
    ChannelKind("position", "joint", ("rad", "m"), False, "link side", True),
    ChannelKind("motor_position", "joint", ("rad", "m"), False, "motor side, after the gear", True),
    ChannelKind("reference_position", "joint", ("rad", "m"), False, "as commanded", True),
    ChannelKind("velocity", "joint", ("rad/s", "m/s"), meaning="link side"),
    ChannelKind("torque", "joint", ("N*m", "N"), meaning="of the drive, after the gear"),
    ChannelKind("temperature", "joint", ("degC",), meaning="of the joint"),
]
_TIME_KIND = ChannelKind(TIME, None, ("s",), meaning="0 is the first edge of the first blow")


@dataclass(frozen=True)
class Channel:
    """One channel of a record.

    Attributes:
        name: as the contract spells it, such as "accelerometer.tool.x".
        kind: what it measures.
        subject: the joint or frame, or None.
        axis: "x", "y", "z" or None.
        unit: SI.
    """

    name: str
    kind: ChannelKind
    subject: str | None
    axis: str | None
    unit: str

    @property
    def group(self) -> str:
        """The name without its axis and joint: "accelerometer.tool", "deflection"."""
        return f"{self.kind.name}.{self.subject}" if self.kind.of == "frame" else self.kind.name

    @property
    def header(self) -> str:
        """The column's header, such as "force [N]"."""
        return f"{self.name} [{self.unit}]"


def register_channel_kind(kind: ChannelKind) -> None:
    """Make another kind of channel known.

    Raises:
        InputError: a kind of this pattern is known already.
    """
    if any(known.pattern == kind.pattern for known in [*KINDS, _TIME_KIND]):
        raise InputError("this kind of channel is known already", value=kind.pattern)
    KINDS.append(kind)
    _parse.cache_clear()


def patterns() -> list[str]:
    """How the names of the known kinds look."""
    return [kind.pattern for kind in KINDS]


def parse_channel(name: str, unit: str | None = None) -> tuple[Channel, Conversion]:
    """The channel of this name, and how values in `unit` become its SI unit.

    Args:
        name: such as "deflection.joint_1" or "time".
        unit: as the file states it; the kind's first SI unit where it is None.

    Raises:
        InputError: no such kind of channel, a joint or axis missing, a unit of another dimension.
    """
    return _parse(name, unit)


@cache
def _parse(name: str, unit: str | None) -> tuple[Channel, Conversion]:
    problem: InputError | None = None
    for kind in [_TIME_KIND, *KINDS]:
        parts = _split(name, kind)
        if parts is None:
            continue
        try:
            target, convert = conversion(kind.units[0] if unit is None else unit, kind.units)
        except InputError as error:
            problem = problem or error
            continue
        return Channel(name, kind, *parts, target), convert
    if problem is not None:
        raise InputError(problem.problem, key=name, value=problem.value, choices=problem.choices)
    raise _unknown(name)


def _split(name: str, kind: ChannelKind) -> tuple[str | None, str | None] | None:
    """Subject and axis, or None where the name is not of this kind."""
    word, dot, rest = name.partition(".")
    if word != kind.name or (kind.of is None) == bool(dot):
        return None
    if not kind.axes:
        return (rest or None, None) if bool(rest) == (kind.of is not None) else None
    subject, _, axis = rest.rpartition(".")
    return (subject, axis) if subject and axis in AXES else None


def _unknown(name: str) -> InputError:
    alike = [kind.pattern for kind in KINDS if kind.name == name.partition(".")[0]]
    if alike:
        return InputError(f"a channel of this kind is named {' or '.join(alike)}", value=name)
    close = difflib.get_close_matches(name.partition(".")[0], [kind.name for kind in KINDS], n=1)
    hint = f"did you mean {close[0]!r}?" if close else None
    return InputError("unknown channel", value=name, choices=patterns(), hint=hint)


def parse_header(cell: str) -> tuple[Channel, Conversion]:
    """A column's header, `channel [unit]`.

    Raises:
        InputError: no unit in brackets, or as `parse_channel`.
    """
    text = cell.strip()
    name, bracket, rest = text.partition("[")
    if not bracket or not rest.endswith("]") or "[" in rest:
        raise InputError("a column's header must be 'channel [unit]'", value=text)
    return parse_channel(name.strip(), rest[:-1].strip())
