"""The channels that a record may hold: the one place to add a kind.

A channel's name is its kind, then the joint or frame it belongs to, then an axis where the kind
has axes: `force`, `deflection.joint_1`, `accelerometer.tool.x`. To add a kind, add a line to
`KINDS`, or name a `ChannelKind` of your own in the entry-point group `picchio.channels`.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import Literal

from picchio.campaign import readers
from picchio.campaign.readers import Reader
from picchio.core.errors import InputError
from picchio.core.registry import with_entry_points
from picchio.core.units import Conversion, conversion

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
        reader: what an ideal sensor of this kind reads in a percussion record; None where that
            is not known: such a channel is then not used, and the user is told so.
        of_force: whether it reads the force, rather than the robot's answer.
        jumps: whether its reading jumps where the force does: samples beside a jump then say
            nothing for sure.
        ac_corner: Hz, below which sensors of this kind answer less and less (first order), as
            one that is AC-coupled does; 0 where they answer to a constant.
        motion: what it is in a motion record: "link", "motor", "reference" or "torque" of a
            joint; empty where it is nothing that is compared.
        unused: why it is compared with no prediction, where that needs no warning.
        condition: whether it is a condition that the robot is under, such as its temperature: it
            may stand still for long.
        derivative: which derivative of a displacement by time it reads: 0, 1 or 2; None of what is
            none of them: its axes and its phase are then not checked. A sensor of accelerations
            may swing on its mount.
        own_axes: whether it reads along the axes of the frame that it is fixed to, gravity included
            where it reads accelerations, rather than along the world's.
        plausible: (least, most, what other numbers may be in) for each of `units`: no vibration of
            a robot, and no such condition, lies beyond.
        addable: whether a diagnosis may ask for such a sensor, at the tool or on every flexible
            joint, where a campaign has none.
    """

    name: str
    of: Literal["joint", "frame"] | None
    units: tuple[str, ...]
    axes: bool = False
    meaning: str = ""
    free_offset: bool = False
    reader: Reader | None = None
    of_force: bool = False
    jumps: bool = False
    ac_corner: float = 0.0
    motion: Literal["", "link", "motor", "reference", "torque"] = ""
    unused: str = ""
    condition: bool = False
    derivative: Literal[0, 1, 2] | None = None
    own_axes: bool = False
    plausible: tuple[tuple[float, float, str], ...] = ()
    addable: bool = True

    @property
    def answers(self) -> bool:
        """Whether it shows how the robot answers to the tool."""
        return self.reader is not None and not self.of_force

    @property
    def smooth(self) -> bool:
        """Whether it reads a position or a velocity, which no blow makes jump."""
        return self.derivative in (0, 1) and not self.jumps

    @property
    def pattern(self) -> str:
        """How a name of this kind looks, such as "deflection.<joint>"."""
        return self.name + (f".<{self.of}>" if self.of else "") + (".x" if self.axes else "")


KINDS: list[ChannelKind] = [
    ChannelKind("force", None, ("N",), meaning="the tool's force along the direction",
                reader=readers.force, of_force=True, jumps=True,
                plausible=((-2e5, 2e5, "mN, or counts?"),)),
    ChannelKind("deflection", "joint", ("rad", "m"), meaning="link side minus motor side",
                free_offset=True, reader=readers.deflection, derivative=0,
                plausible=((-0.05, 0.05, "deg, or arcmin?"), (-0.05, 0.05, "mm?"))),
    ChannelKind("acceleration", "frame", ("m/s^2",), True, "of the frame's origin, world axes",
                reader=readers.acceleration, jumps=True, derivative=2,
                plausible=((-5e3, 5e3, "mm/s^2?"),), addable=False),
    ChannelKind("accelerometer", "frame", ("m/s^2",), True, "as read, the frame's axes",
                reader=readers.accelerometer, jumps=True, derivative=2,
                own_axes=True, plausible=((-5e3, 5e3, "mm/s^2, or counts?"),)),
    ChannelKind("velocity", "frame", ("m/s",), True, "of the frame's origin, world axes",
                reader=readers.velocity, derivative=1, plausible=((-10.0, 10.0, "mm/s?"),),
                addable=False),
    ChannelKind("displacement", "frame", ("m",), True, "of the frame's origin, world axes",
                free_offset=True, reader=readers.displacement, derivative=0,
                plausible=((-0.1, 0.1, "mm?"),), addable=False),
    ChannelKind("position", "joint", ("rad", "m"), meaning="link side", free_offset=True,
                motion="link", derivative=0),
    ChannelKind("motor_position", "joint", ("rad", "m"), meaning="motor side, after the gear",
                free_offset=True, motion="motor", derivative=0),
    ChannelKind("reference_position", "joint", ("rad", "m"), meaning="as commanded",
                free_offset=True, motion="reference", derivative=0),
    ChannelKind("velocity", "joint", ("rad/s", "m/s"), meaning="link side",
                unused="positions are differentiated instead", derivative=1,
                plausible=((-50.0, 50.0, "deg/s, or rpm?"), (-10.0, 10.0, "mm/s?"))),
    ChannelKind("torque", "joint", ("N*m", "N"), meaning="of the drive, after the gear",
                motion="torque"),
    ChannelKind("temperature", "joint", ("degC",), meaning="of the joint",
                unused="it is a condition, not an answer of the robot", condition=True,
                plausible=((-60.0, 250.0, "K, or raw counts?"),)),
]  # fmt: skip
LOADING_KINDS: tuple[ChannelKind, ...] = (
    ChannelKind("pose", "joint", ("rad", "m"), meaning="where the joint stands, link side"),
    ChannelKind("force", None, ("N",), True, "on the tool, world axes"),
    ChannelKind("weight", None, ("N",), meaning="in place of the force: hung on the tool"),
    ChannelKind("pull", None, ("N",), meaning="in place of both: what a scale reads of a cord"),
    ChannelKind("pull_direction", None, ("1",), True, "along which the cord pulls, world axes; of "
                "any length"),
    ChannelKind("point", None, ("m",), True, "where the force acts, tool frame; else its origin, "
                "or where the sidecar's [tool] has the tool's point"),
    ChannelKind("displacement", "frame", ("m",), True, "of the frame's origin against the "
                "unloaded pose, world axes"),
    ChannelKind("dial", None, ("m",), meaning="what a dial gauge at the tool reads, likewise"),
    ChannelKind("dial_direction", None, ("1",), True, "the way in which it reads more, world axes; "
                "of any length"),
    ChannelKind("dial_point", None, ("m",), True, "where it touches, tool frame; else its origin"),
    ChannelKind("deflection", "joint", ("rad", "m"), meaning="link less motor side, likewise"),
    ChannelKind("set", None, ("1",), meaning="a number: rows of one set share a zero that nobody "
                "knows; else each row has a zero of its own, read just before"),
)  # fmt: skip
"""The columns of a static record: a row a loading, in any order, without a time."""
LOG_KINDS: tuple[ChannelKind, ...] = (
    ChannelKind("force", None, ("N",), True, "on the tool, in the axes that [blows] names"),
    ChannelKind("trigger", None, ("1",), meaning="of the tool: see [blows] trigger"),
)
"""What a log may hold beside a record's channels, for `picchio count`."""
FREQUENCY = "frequency"
_QUOTIENTS = ("m/s^2/N", "m/s/N", "m/N")
FRF_KINDS: tuple[ChannelKind, ...] = (
    ChannelKind(FREQUENCY, None, ("Hz",), meaning="ascending; the first column"),
    ChannelKind("real", None, ("1", *_QUOTIENTS), meaning="real part; SI where no unit is told"),
    ChannelKind("imag", None, ("1", *_QUOTIENTS), meaning="imaginary part, likewise"),
    ChannelKind("coherence", None, ("1",), meaning="0 to 1; what is low counts little"),
)
"""The columns of a frequency response function, a row a line."""
GROUP = "picchio.channels"
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


def kinds() -> list[ChannelKind]:
    """Every kind of channel, those of other packages last."""
    return [*KINDS, *_plugged()]


@cache
def _plugged() -> tuple[ChannelKind, ...]:
    found = with_entry_points(
        GROUP, "kind of channel", [*KINDS, _TIME_KIND], lambda x: isinstance(x, ChannelKind),
        lambda x: x.pattern,
    )  # fmt: skip
    return tuple(kind for kind in found.values() if kind not in [*KINDS, _TIME_KIND])


def addable_kinds() -> list[ChannelKind]:
    """The kinds of sensor that a diagnosis may ask for."""
    return [kind for kind in kinds() if kind.answers and kind.addable]


def patterns() -> list[str]:
    """How the names of the known kinds look."""
    return [kind.pattern for kind in kinds()]


@cache
def parse_channel(
    name: str, unit: str | None = None, among: tuple[ChannelKind, ...] = ()
) -> tuple[Channel, Conversion]:
    """The channel of this name, and how values in `unit` become its SI unit.

    Args:
        name: such as "deflection.joint_1" or "time".
        unit: as the file states it; the kind's first SI unit where it is None.
        among: the kinds that there are; those of a record in time where empty.

    Raises:
        InputError: no such kind of channel, a joint or axis missing, a unit of another dimension.
    """
    problem: InputError | None = None
    for kind in among or (_TIME_KIND, *kinds()):
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
        raise problem.placed(key=name)
    raise _unknown(name, among or kinds())


def _split(name: str, kind: ChannelKind) -> tuple[str | None, str | None] | None:
    """Subject and axis, or None where the name is not of this kind."""
    word, dot, rest = name.partition(".")
    if kind.of is None and kind.axes:
        return (None, rest) if word == kind.name and rest in AXES else None
    if word != kind.name or (kind.of is None) == bool(dot):
        return None
    if not kind.axes:
        return (rest or None, None) if bool(rest) == (kind.of is not None) else None
    subject, _, axis = rest.rpartition(".")
    return (subject, axis) if subject and axis in AXES else None


def _unknown(name: str, among: Iterable[ChannelKind]) -> InputError:
    known = list(among)
    alike = [kind.pattern for kind in known if kind.name == name.partition(".")[0]]
    if alike:
        return InputError(f"a channel of this kind is named {' or '.join(alike)}", value=name)
    close = difflib.get_close_matches(name.partition(".")[0], [kind.name for kind in known], n=1)
    hint = f"did you mean {close[0]!r}?" if close else None
    if any(_split(name, kind) for kind in (*LOADING_KINDS, *FRF_KINDS) if kind not in known):
        hint = (
            "it is a column of a static or frf record: name its table in a campaign.toml as it is"
        )
    choices = [kind.pattern for kind in known]
    return InputError("unknown channel", value=name, choices=choices, hint=hint)


def parse_header(cell: str, among: tuple[ChannelKind, ...] = ()) -> tuple[Channel, Conversion]:
    """A column's header, `channel [unit]`; a pure number needs no unit.

    Args:
        cell: the header.
        among: see `parse_channel`.

    Raises:
        InputError: no unit in brackets, or as `parse_channel`.
    """
    text = cell.strip()
    name, bracket, rest = text.partition("[")
    if not bracket and any(k.units[0] == "1" and _split(text, k) for k in among):
        return parse_channel(text, None, among)
    if not bracket or not rest.endswith("]") or "[" in rest:
        raise InputError("a column's header must be 'channel [unit]'", value=text)
    return parse_channel(name.strip(), rest[:-1].strip(), among)
