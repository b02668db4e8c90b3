"""What the series of a file are, where their names and units say so."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from picchio.campaign.channels import LOG_KINDS, TIME, ChannelKind, kinds, parse_channel
from picchio.campaign.importing.detect import clock, implausible
from picchio.campaign.importing.mapping import ChannelTable
from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.core.errors import InputError
from picchio.core.units import conversion

_UNIT = re.compile(
    r"(?P<name>.*?\S)\s*[\[(<]\s*(?P<unit>[^\d\[\](<>][^\[\](<>]*(\([^()]*\)[^\[\](<>]*)?)[\])>]"
    r"|(?P<quantity>.*?\S)\s+/\s+(?P<of>\S.*)"  # as ISO 80000 has it: quantity / unit
)
# What robots' logs call an array over all joints, by the channel; a commanded one is none of them.
_ARRAYS = {
    "position": re.compile(r"(.*[._/ ])?(q|qpos|pos|positions?|angles?|theta)", re.I),
    "velocity": re.compile(r"(.*[._/ ])?(dq|qd|qdot|qvel|vel|velocity|velocities)", re.I),
    "torque": re.compile(r"(.*[._/ ])?(tau|tau_j|torques?|efforts?)", re.I),
}
_COMMANDED = re.compile(r"target|desired|command|cmd|ref|goal|action", re.I)
_PLACE = re.compile(r"(?P<array>.*?[^\d(\[_.])[(\[_.]?(?P<place>\d+)[)\]]?")
_JOINT = re.compile(r"joint", re.I)
_OF_JOINTS = ("position", "velocity", "torque", "temperature")
# rad: a joint that turns further is hardly told in rad.
_TURN = 2.0 * np.pi


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


def named(
    raw: RawFile, joints: Collection[str] | None = None, frames: Collection[str] | None = None
) -> list[Named]:
    """What each series is, the clock left out.

    A series is taken where its name is that of a channel, or of a joint with a unit that tells
    which of the joint's readings it is. Nothing else is guessed.

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
    places = _of_joints(list(raw.channels), list(joints or ()))
    for channel in raw.channels.values():
        if time is not None and channel.name == time.series:
            continue
        one = _one(channel, joints, frames, places.get(channel.name))
        first = next((x.series for x in found if one.to and x.to == one.to), None)
        if first is not None:
            one = Named(one.series, "", one.unit, f"{first} is {one.to} already")
        found.append(one)
    return found


def _of_joints(names: list[str], joints: list[str]) -> dict[str, str]:
    """The channels of series that are an array over all joints, in the robot's order."""
    arrays: dict[str, dict[int, str]] = {}
    for name in names:
        if (parts := _PLACE.fullmatch(name)) and not _COMMANDED.search(name):
            arrays.setdefault(parts["array"], {})[int(parts["place"])] = name
    found: dict[str, str] = {}
    for array, places in arrays.items():
        kind = next((kind for kind, word in _ARRAYS.items() if word.fullmatch(array)), None)
        if kind and joints and sorted(places) in (
            list(range(len(joints))), list(range(1, len(joints) + 1))
        ):  # fmt: skip
            ordered = (name for _, name in sorted(places.items()))
            found |= {n: f"{kind}.{j}" for n, j in zip(ordered, joints, strict=True)}
    return found


def _one(
    channel: RawChannel, joints: Collection[str] | None, frames: Collection[str] | None,
    place: str | None,
) -> Named:  # fmt: skip
    parts = _UNIT.fullmatch(channel.name.strip())
    name = (parts["name"] or parts["quantity"]) if parts else channel.name.strip()
    unit = channel.unit or ((parts["unit"] or parts["of"]).strip() if parts else None)
    known = (*LOG_KINDS, *kinds())
    if unit is not None and not _fits(unit, known):
        return Named(channel.name, "", None, f"{unit!r} is no unit of a channel")
    wanted, why = name, "named as a channel"
    if joints is not None and name in joints:
        wanted, why = f"{_reading(unit, known)}.{name}", "named as a joint of the robot"
    elif joints is None and unit is not None and _JOINT.search(name) and "." not in name:
        wanted, why = f"{_reading(unit, known)}.{name}", "named as a joint"
    elif joints is not None and channel.suggestion is not None:
        wanted, why = channel.suggestion, "as its message says"
    elif place is not None:
        wanted, why = place, "by its place in an array over all joints"
    try:
        to, convert = parse_channel(wanted, unit, known)
    except InputError:
        return Named(channel.name, "", unit, _choices(unit, known))
    there = joints if to.kind.of == "joint" else frames if to.kind.of == "frame" else None
    if to.name == TIME or (there is not None and to.subject not in there):
        return Named(channel.name, "", unit, f"{wanted}, but the robot has no {to.subject}")
    why += f", in {unit}" if unit else f"; no unit is told, so {to.unit}"
    if unit is None and to.unit == "rad" and np.nanmax(np.abs(channel.values), initial=0) > _TURN:
        return Named(channel.name, "", None, f"{wanted}, but in deg or rad? No unit is told")
    values = RawChannel(channel.name, convert(channel.values))
    if problem := implausible(values, to.name):
        return Named(channel.name, "", unit, problem)
    return Named(channel.name, to.name, unit, why)


def _fits(unit: str, known: Collection[ChannelKind]) -> bool:
    return any(_of(unit, kind) for kind in known)


def _of(unit: str, kind: ChannelKind) -> bool:
    try:
        conversion(unit, kind.units)
    except InputError:
        return False
    return True


def _reading(unit: str | None, known: Collection[ChannelKind]) -> str:
    """Which of a joint's readings is in this unit; its position where nothing is told."""
    for kind in known if unit else ():
        if kind.of == "joint" and kind.name in _OF_JOINTS and _of(unit or "", kind):
            return kind.name
    return _OF_JOINTS[0]


def _choices(unit: str | None, known: Collection[ChannelKind]) -> str:
    """The channels that have this unit, for people."""
    if unit is None:
        return ""
    names = dict.fromkeys(kind.pattern for kind in known if _of(unit, kind))
    return f"in {unit}: " + ", ".join(names)
