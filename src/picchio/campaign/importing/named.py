"""What the series of a file are, where their names and units say so."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from picchio.campaign.channels import AXES, LOG_KINDS, TIME, ChannelKind, kinds, parse_channel
from picchio.campaign.importing.detect import clock, implausible
from picchio.campaign.importing.mapping import ChannelTable
from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.core.errors import InputError
from picchio.core.units import Conversion, conversion

_UNIT = re.compile(
    r"(?P<name>.*?\S)\s*[\[(<]\s*(?P<unit>[^\d\[\](<>][^\[\](<>]*(\([^()]*\)[^\[\](<>]*)?)[\])>]"
    r"|(?P<quantity>.*?\S)\s+/\s+(?P<of>\S.*)"  # as ISO 80000 has it: quantity / unit
)
# What robots' logs call an array over all joints, by the channel; a commanded one is none of them.
_ARRAYS = {
    "position": re.compile(
        r"(.*[._/ ])?(q|qpos|pos|positions?|angles?|theta|joints?|axis|j)", re.I
    ),
    "velocity": re.compile(r"(.*[._/ ])?(dq|qd|qdot|qvel|vel|velocity|velocities)", re.I),
    "torque": re.compile(r"(.*[._/ ])?(tau|tau_j|torques?|efforts?)", re.I),
}
_COMMANDED = re.compile(r"target|desired|command|cmd|ref|goal|action", re.I)
_SWITCH = re.compile(
    r".*(tool|gun|hammer|valve).*(on|active|state|run\w*)|.*trigger.*|"
    r"(.*[._/ ])?(do|dout|digital_?out)(put)?s?([._ (\[]*(bits?|\d+)[)\]]?)?",
    re.I,
)
_PLACE = re.compile(r"(?P<array>.*?[^\d(\[_.])[(\[_.]?(?P<place>\d+)[)\]]?")
_JOINT = re.compile(r"joint", re.I)
_AXIS = re.compile(r"(?P<sensor>.*?)[\s._(\[-]*(?P<axis>[xyz])[)\]]?", re.I)
_ACCELERATION = re.compile(r"(.*[._/ ])?(a|acc\w*|imu|vib\w*)", re.I)
_OF_JOINTS = ("position", "velocity", "torque", "temperature")
# rad: a joint that turns further is hardly told in rad.
_TURN = 2.0 * np.pi
_AT_REST = 0.05  # relative, between what a sensor reads at rest and gravity: offset and gain of one


@dataclass(frozen=True)
class Named:
    """What one series is.

    Attributes:
        series: its name in the file.
        to: the channel; empty where its name and unit do not say.
        unit: as the name or the file says; None for the channel's SI unit.
        why: for people; where `to` is empty, what it may be.
    """

    series: str
    to: str
    unit: str | None
    why: str

    @property
    def entry(self) -> ChannelTable:
        """As a mapping has it."""
        return ChannelTable.model_validate({"from": self.series, "to": self.to, "unit": self.unit})


@dataclass(frozen=True, eq=False)
class Accelerometer:
    """The series of one accelerometer.

    Attributes:
        series: by axis; a sensor of one axis that is not told is along x.
        unit: of the readings; empty where nothing tells it.
        why: how it is known, for people.
        convert: readings to m/s^2; None where the unit is not known.
    """

    series: dict[str, str]
    unit: str
    why: str
    convert: Conversion | None

    def entries(self, frame: str) -> list[ChannelTable]:
        """Its axes as a mapping has them.

        Args:
            frame: of the robot, to which it is fixed.
        """
        return [
            ChannelTable.model_validate(
                {"from": name, "to": f"accelerometer.{frame}.{axis}", "unit": self.unit or None}
            )
            for axis, name in self.series.items()
        ]


def accelerometers(raw: RawFile) -> list[Accelerometer]:
    """The accelerometers of a file: by a unit of accelerations, by name, or by gravity at rest.

    Args:
        raw: the file.

    Returns:
        those with most axes first.
    """
    time = clock(raw)
    groups: dict[tuple[str, str | None], dict[str, RawChannel]] = {}
    for channel in raw.channels.values():
        if channel.clock or (time is not None and channel.name == time.series):
            continue
        if not np.isfinite(channel.values).any():
            continue
        name, unit = _parted(channel)
        parts = _AXIS.fullmatch(name)
        sensor, axis = (parts["sensor"], parts["axis"].lower()) if parts else (name, AXES[0])
        groups.setdefault((sensor.lower(), unit), {}).setdefault(axis, channel)
    found = []
    for (sensor, unit), axes in groups.items():
        series = {axis: channel.name for axis, channel in sorted(axes.items())}
        if unit is not None:
            if (convert := _converting(unit)) is not None:
                found.append(Accelerometer(series, unit, f"in {unit}, as the file says", convert))
            continue
        rest = float(np.linalg.norm([np.nanmedian(channel.values) for channel in axes.values()]))
        told = [u for u in ("g", "m/s^2", "mg") if _is_gravity(rest, _converting(u))]
        if told and len(axes) == len(AXES):
            why = f"at rest the three read {rest:.2f} in all, which is gravity in {told[0]}"
            found.append(Accelerometer(series, told[0], why, _converting(told[0])))
        elif len(axes) == len(AXES) and (not sensor or _ACCELERATION.fullmatch(sensor)):
            found.append(Accelerometer(series, "", "as the names say; no unit is told", None))
    return sorted(found, key=lambda one: -len(one.series))


def _converting(unit: str | None, to: Sequence[str] = ("m/s^2",)) -> Conversion | None:
    """How readings of a unit become SI; None where it is no unit of such a channel."""
    try:
        return None if unit is None else conversion(unit, to)[1]
    except InputError:
        return None


def _is_gravity(rest: float, convert: Conversion | None) -> bool:
    wanted = _converting("g")
    assert convert is not None and wanted is not None
    return abs(rest * convert.scale / wanted.scale - 1.0) < _AT_REST


def named(
    raw: RawFile, joints: Collection[str] | None = None, frames: Collection[str] | None = None
) -> list[Named]:
    """What each series is, the clock left out.

    A series is taken where its name is that of a channel, or of a joint, or one that robots' logs
    have for an array over all joints or for the tool's switch.

    Args:
        raw: the file.
        joints: of the robot; None where it is not known.
        frames: likewise.

    Returns:
        one for each series, in the file's order.
    """
    own = all(channel.time is not None for channel in raw.channels.values())
    time = None if own else clock(raw)
    found: list[Named] = []
    guessed = _of_joints(raw, joints) | _switched(raw)
    for channel in raw.channels.values():
        if time is not None and channel.name == time.series:
            continue
        one = _one(channel, joints, frames, guessed.get(channel.name))
        first = next((x.series for x in found if one.to and x.to == one.to), None)
        if first is not None:
            one = Named(one.series, "", one.unit, f"{first} is {one.to} already")
        found.append(one)
    return found


def _of_joints(raw: RawFile, joints: Collection[str] | None) -> dict[str, tuple[str, str]]:
    """The channels of series that are an array over all joints, in the robot's order, and why."""
    arrays: dict[str, dict[int, str]] = {}
    for name, channel in raw.channels.items():
        if (parts := _PLACE.fullmatch(_parted(channel)[0])) and not _COMMANDED.search(name):
            arrays.setdefault(parts["array"], {})[int(parts["place"])] = name
    found: dict[str, tuple[str, str]] = {}
    why = "by its place in an array over all joints"
    for array, places in arrays.items():
        kind = next((kind for kind, word in _ARRAYS.items() if word.fullmatch(array)), None)
        count = len(places) if joints is None else len(joints)
        if kind and count > 1 and sorted(places) in (
            list(range(count)), list(range(1, count + 1))
        ):  # fmt: skip
            own = joints or [f"joint_{j}" for j in range(1, count + 1)]
            told = why if joints else f"{why}, called so until --robot names them"
            for (_, name), joint in zip(sorted(places.items()), own, strict=True):
                found[name] = f"{kind}.{joint}", told
    return found


def _switched(raw: RawFile) -> dict[str, tuple[str, str]]:
    """The series that is the tool's switch: named so, on or off, and the only one that changes."""
    found = [
        name
        for name, channel in raw.channels.items()
        if _SWITCH.fullmatch(name) and set(np.unique(channel.values)) == {0.0, 1.0}
    ]
    told = "named as a switch of the tool, and on or off"
    return {found[0]: ("trigger", told)} if len(found) == 1 else {}


def _one(
    channel: RawChannel, joints: Collection[str] | None, frames: Collection[str] | None,
    guess: tuple[str, str] | None,
) -> Named:  # fmt: skip
    name, unit = _parted(channel)
    known = (*LOG_KINDS, *kinds())
    if unit is not None and not any(_converting(unit, kind.units) for kind in known):
        return Named(channel.name, "", None, f"{unit!r} is no unit of a channel")
    wanted, why = name, "named as a channel"
    if joints is not None and name in joints:
        wanted, why = f"{_reading(unit, known)}.{name}", "named as a joint of the robot"
    elif joints is None and unit is not None and _JOINT.search(name) and "." not in name:
        wanted, why = f"{_reading(unit, known)}.{name}", "named as a joint"
    elif joints is not None and channel.suggestion is not None:
        wanted, why = channel.suggestion, "as its message says"
    elif guess is not None:
        wanted, why = guess
    try:
        to, convert = parse_channel(wanted, unit, known)
    except InputError:
        return Named(channel.name, "", unit, _choices(unit, known))
    there = joints if to.kind.of == "joint" else frames if to.kind.of == "frame" else None
    if to.name == TIME or (there is not None and to.subject not in there):
        return Named(channel.name, "", unit, f"{wanted}, but the robot has no {to.subject}")
    why += f", in {unit}" if unit else "" if to.unit == "1" else f"; no unit is told, so {to.unit}"
    if unit is None and to.unit == "rad" and np.nanmax(np.abs(channel.values), initial=0) > _TURN:
        return Named(channel.name, "", None, f"{wanted}, but in deg or rad? No unit is told")
    values = RawChannel(channel.name, convert(channel.values))
    if problem := implausible(values, to.name):
        return Named(channel.name, "", unit, problem)
    return Named(channel.name, to.name, unit, why)


def _parted(channel: RawChannel) -> tuple[str, str | None]:
    """A series' name without its unit, and the unit."""
    parts = _UNIT.fullmatch(channel.name.strip())
    if not parts:
        return channel.name.strip(), channel.unit
    return parts["name"] or parts["quantity"], channel.unit or (
        parts["unit"] or parts["of"]
    ).strip()


def _reading(unit: str | None, known: Collection[ChannelKind]) -> str:
    """Which of a joint's readings is in this unit; its position where nothing is told."""
    for kind in known:
        if kind.of == "joint" and kind.name in _OF_JOINTS and _converting(unit, kind.units):
            return kind.name
    return _OF_JOINTS[0]


def _choices(unit: str | None, known: Collection[ChannelKind]) -> str:
    """The channels that have this unit, for people."""
    if unit is None:
        return ""
    names = dict.fromkeys(kind.pattern for kind in known if _converting(unit, kind.units))
    return f"in {unit}: " + ", ".join(names)
