"""MCAP logs of ROS 2: JointState, Imu and WrenchStamped messages (needs mcap-ros2-support)."""

from __future__ import annotations

import contextlib
import io
import math
from array import array
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from picchio.campaign.importing.isolated import Limits
from picchio.campaign.importing.raw import RawChannel, RawFile, reason
from picchio.core.errors import InputError

# Decoded message by message, and often compressed.
LIMITS = Limits(seconds_a_byte=1e-5, memory_a_byte=32.0)
_NANO = 1_000_000_000
_JOINT_FIELDS = {"position": ("position", "rad"), "velocity": ("velocity", "rad/s"),
                 "effort": ("torque", "N*m")}  # fmt: skip
_VECTORS: dict[str, dict[str, tuple[str | None, str]]] = {
    "Imu": {"linear_acceleration": ("accelerometer", "m/s^2"), "angular_velocity": (None, "rad/s")},
    "WrenchStamped": {"wrench.force": (None, "N"), "wrench.torque": (None, "N*m")},
}
Sample = tuple[str, float, str | None, str | None]


def read(path: Path, clock: Mapping[str, Any]) -> RawFile:
    """Every number of the messages of these three kinds, named "<topic>:<field>".

    `/joint_states:position.joint_1`, `/imu:linear_acceleration.x`, `/wrench:force.z`. Times are
    counted from the earliest stamp of all; other kinds of message are left out. A joint that
    some messages of a topic lack keeps its own stamps.

    Raises:
        InputError: mcap is missing, the file is no MCAP or cut short, or holds no such message.
    """
    try:
        from mcap.reader import make_reader
        from mcap_ros2.decoder import DecoderFactory
    except ImportError:
        raise InputError("MCAP files need mcap and mcap-ros2-support",
                         hint="pip install 'picchio[import]'") from None  # fmt: skip
    stamp = clock.get("stamp", "header")
    stamps: dict[str, array[int]] = {}
    values: dict[str, array[float]] = {}
    about: dict[str, tuple[str | None, str | None]] = {}
    try:
        # The decoder prints what it does not like about a message's definition.
        with open(path, "rb") as stream, contextlib.redirect_stdout(io.StringIO()):
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            for schema, channel, message, ros in reader.iter_decoded_messages(
                log_time_order=stamp == "log"
            ):
                when = message.log_time if stamp == "log" else _stamp(ros)
                for field, number, unit, suggestion in _samples(schema, ros):
                    name = f"{channel.topic}:{field}"
                    stamps.setdefault(name, array("q")).append(when)
                    values.setdefault(name, array("d")).append(number)
                    about[name] = (unit, suggestion)
    except MemoryError:
        raise
    except Exception as error:  # mcap's, zstandard's, lz4's and the decoder's own kinds
        raise InputError(f"is not a readable MCAP file: {reason(error)}", file=path) from None
    if not values:
        raise InputError("holds no JointState, Imu or WrenchStamped message", file=path)
    begin = min(series[0] for series in stamps.values())
    channels = {}
    for name, series in values.items():
        # Nanoseconds since 1970 do not fit a float: subtract first.
        ticks = np.array(stamps[name], dtype=np.int64) - begin
        unit, suggestion = about[name]
        channels[name] = RawChannel(name, np.array(series), ticks / _NANO, unit, suggestion)
    return RawFile(path, "mcap", channels, datetime.fromtimestamp(begin / _NANO, UTC))


def _stamp(message: Any) -> int:
    if not hasattr(message, "header"):
        return 0
    return int(message.header.stamp.sec) * _NANO + int(message.header.stamp.nanosec)


def _samples(schema: Any, message: Any) -> Iterator[Sample]:
    """(field, value, unit, suggested channel) of a message; none for other kinds."""
    kind = schema.name.rpartition("/")[2] if schema is not None else ""
    if kind == "JointState":
        for field, (channel, unit) in _JOINT_FIELDS.items():
            for joint, number in zip(message.name, getattr(message, field), strict=False):
                # NaN is how a driver says that a joint has no such reading.
                if not math.isnan(number):
                    yield f"{field}.{joint}", float(number), unit, f"{channel}.{joint}"
    for field, (group, unit) in _VECTORS.get(kind, {}).items():
        vector = message
        for part in field.split("."):
            vector = getattr(vector, part)
        frame = message.header.frame_id or "tool"
        for axis in ("x", "y", "z"):
            suggestion = f"{group}.{frame}.{axis}" if group else None
            yield f"{field}.{axis}", float(getattr(vector, axis)), unit, suggestion
