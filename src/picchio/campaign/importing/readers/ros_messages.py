"""What the messages of a ROS log hold, as series: the same for MCAP, .db3 and .bag."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.core.errors import InputError

_NANO = 1_000_000_000
_DEEPEST = 6
# An array of more numbers is an image or a cloud, no reading.
_LONGEST = 64
_JOINT_FIELDS = {"position": ("position", "rad"), "velocity": ("velocity", "rad/s"),
                 "effort": ("torque", "N*m")}  # fmt: skip
_ACCELERATION = {"linear_acceleration": ("accelerometer", "m/s^2"),
                 "angular_velocity": (None, "rad/s")}  # fmt: skip
_VECTORS: dict[str, dict[str, tuple[str | None, str]]] = {
    "Imu": _ACCELERATION,  # type: ignore[dict-item]
    "AccelStamped": {"accel.linear": ("acceleration", "m/s^2"), "accel.angular": (None, "rad/s^2")},
    "WrenchStamped": {"wrench.force": (None, "N"), "wrench.torque": (None, "N*m")},
}
Sample = tuple[str, float, str | None, str | None]


class Series:
    """Collects the numbers of messages, named "<topic>:<field>".

    `/joint_states:position.joint_1`, `/imu:linear_acceleration.x`, `/wrench:wrench.force.z`; of
    other kinds of message every number, as its fields lead to it. Times count from the earliest
    stamp of all. A joint that some messages of a topic lack keeps its own stamps.
    """

    def __init__(self) -> None:
        self._stamps: dict[str, array[int]] = {}
        self._values: dict[str, array[float]] = {}
        self._about: dict[str, tuple[str | None, str | None]] = {}

    def add(self, topic: str, kind: str, when: int, message: Any) -> None:
        """One message.

        Args:
            topic: it came by.
            kind: of message, without its package.
            when: ns from 1970.
            message: decoded, its fields as attributes.
        """
        for field, number, unit, suggestion in _samples(kind, message):
            name = f"{topic}:{field}"
            if name not in self._stamps:
                self._stamps[name], self._values[name] = array("q"), array("d")
                self._about[name] = (unit, suggestion)
            self._stamps[name].append(when)
            self._values[name].append(number)

    def file(self, path: Path, kind: str) -> RawFile:
        """What was collected.

        Args:
            path: the file.
            kind: of file.

        Raises:
            InputError: no message held a number.
        """
        if not self._values:
            raise InputError("holds no JointState, Imu or WrenchStamped message, nor any other "
                             "with numbers", file=path)  # fmt: skip
        begin = min(min(series) for series in self._stamps.values())
        channels = {}
        for name, series in self._values.items():
            # Nanoseconds since 1970 do not fit a float: subtract first.
            ticks = np.array(self._stamps[name], dtype=np.int64) - begin
            values = np.array(series)
            if (np.diff(ticks) < 0).any():
                order = np.argsort(ticks, kind="stable")
                ticks, values = ticks[order], values[order]
            unit, suggestion = self._about[name]
            channels[name] = RawChannel(name, values, ticks / _NANO, unit, suggestion)
        taken = datetime.fromtimestamp(begin // _NANO, UTC) if begin > 0 else None
        if taken is not None:
            taken = taken.replace(microsecond=begin % _NANO // 1000)
        return RawFile(path, kind, channels, taken, begin if begin > 0 else None)


def stamp_of(message: Any, logged: int) -> int:
    """The stamp of a message's header, ns; when it was logged where it has none.

    Args:
        message: decoded.
        logged: ns.
    """
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is None:
        return logged
    fraction = getattr(stamp, "nanosec", None)
    return int(stamp.sec) * _NANO + int(stamp.nsec if fraction is None else fraction)


def _samples(kind: str, message: Any) -> Iterator[Sample]:
    """(field, value, unit, suggested channel) of a message."""
    if kind == "JointState":
        for field, (channel, unit) in _JOINT_FIELDS.items():
            for joint, number in zip(message.name, getattr(message, field), strict=False):
                # NaN is how a driver says that a joint has no such reading.
                if not math.isnan(number):
                    yield f"{field}.{joint}", float(number), unit, f"{channel}.{joint}"
        return
    if kind not in _VECTORS:
        for field, number in _numbers("", message, _DEEPEST):
            yield field, number, None, None
        return
    for field, (group, unit) in _VECTORS[kind].items():
        vector = message
        for part in field.split("."):
            vector = getattr(vector, part)
        frame = message.header.frame_id or "tool"
        for axis in ("x", "y", "z"):
            suggestion = f"{group}.{frame}.{axis}" if group else None
            yield f"{field}.{axis}", float(getattr(vector, axis)), unit, suggestion


def _numbers(name: str, value: Any, depth: int) -> Iterator[tuple[str, float]]:
    """Every number that a message's fields lead to, but its header's."""
    if isinstance(value, (bool, int, float, np.number, np.bool_)):
        if not math.isnan(value):
            yield name, float(value)
    elif isinstance(value, np.ndarray) or (isinstance(value, (list, tuple)) and value):
        if len(value) <= _LONGEST:
            for i, part in enumerate(value):
                yield from _numbers(f"{name}[{i}]", part, depth)
    elif depth and not isinstance(value, (str, bytes)):
        fields = getattr(value, "__dataclass_fields__", None) or getattr(value, "__slots__", None)
        for field in fields or getattr(value, "__dict__", {}):
            # What is in capitals is a constant of that kind of message, no reading.
            if field.startswith("_") or field == "header" or field.isupper():
                continue
            inner = getattr(value, field)
            yield from _numbers(f"{name}.{field}" if name else field, inner, depth - 1)
