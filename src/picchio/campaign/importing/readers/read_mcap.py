"""MCAP logs of ROS 2, or of ROS 1 (needs mcap and rosbags), whole or in blocks."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from picchio.campaign.importing.isolated import Limits
from picchio.campaign.importing.raw import RawFile
from picchio.campaign.importing.readers.ros_messages import Series, Topic, collected, definitions
from picchio.core.errors import warn_user

LIMITS = Limits(seconds_a_byte=1e-5, memory_a_byte=32.0)  # often compressed
_WHAT = ("MCAP file", "mcap and rosbags")
_SCHEMA, _CHANNEL, _MESSAGE = 3, 4, 5
_HEAD = struct.Struct("<BQ")  # kind and length of a record
_ABOUT = struct.Struct("<HIQQ")  # of a message: channel, number, when logged, when published
_WRITTEN = {("ros2msg", "cdr"), ("ros2idl", "cdr"), ("ros1msg", "ros1")}
_CUT = "ends without a footer: what stands before its last, unfinished chunk is read"


def read(path: Path, clock: Mapping[str, Any]) -> RawFile:
    """Every number of the messages, named "<topic>:<field>"; see `Series`.

    Args:
        path: the file.
        clock: the mapping's `[time]`.

    Raises:
        InputError: mcap is missing, the file is no MCAP, or holds no number.
    """
    return next(collected(Series(path, "mcap", clock), _fill, _WHAT, whole=True))


def blocks(path: Path, clock: Mapping[str, Any], names: set[str] | None) -> Iterator[RawFile]:
    """The same in blocks: memory does not grow with the file.

    Args:
        path: the file.
        clock: the mapping's `[time]`.
        names: of the series that are needed; all where None.

    Raises:
        InputError: as `read`.
    """
    return collected(Series(path, "mcap", clock, names), _fill, _WHAT, whole=False)


def _fill(series: Series) -> Iterator[None]:
    """A chunk at a time; its messages, of which there are very many, by hand."""
    from mcap.exceptions import EndOfFile
    from mcap.records import Channel, Chunk, Message, Schema
    from mcap.stream_reader import ReadDataStream, StreamReader, get_chunk_data_stream

    schemas: dict[int, Any] = {}
    topics: dict[int, Topic | None] = {}

    def take(record: Any) -> None:
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel) and record.id not in topics:
            topics[record.id] = _topic(series, record, schemas.get(record.schema_id))
        elif isinstance(record, Message) and (topic := topics[record.channel_id]) is not None:
            topic.data.append(record.data)
            topic.logged.append(record.log_time)

    def inside(data: bytes) -> None:
        at, end = 0, len(data)
        while at < end:
            kind, length = _HEAD.unpack_from(data, at)
            at += _HEAD.size
            if at + length > end:
                raise ValueError("a record goes beyond its chunk")
            if kind == _MESSAGE:
                channel, _, logged, _ = _ABOUT.unpack_from(data, at)
                topic = topics[channel]
                if topic is not None:
                    topic.data.append(data[at + _ABOUT.size : at + length])
                    topic.logged.append(logged)
            elif kind in (_CHANNEL, _SCHEMA):
                stream = ReadDataStream(io.BytesIO(data[at : at + length]))
                take((Channel if kind == _CHANNEL else Schema).read(stream))
            at += length

    with open(series.path, "rb") as file:
        records = StreamReader(file, emit_chunks=True, validate_crcs=True).records
        while True:
            try:
                record = next(records, None)
            except (EndOfFile, struct.error):
                if file.read(1):
                    raise
                warn_user(f"{series.path}: {_CUT}")
                return
            if record is None:
                return
            if isinstance(record, Chunk):
                stream, length = get_chunk_data_stream(record, validate_crc=True)
                inside(stream.read(length))
            else:
                take(record)
            yield


def _topic(series: Series, channel: Any, schema: Any) -> Topic | None:
    """A channel's messages; None, with a warning, of what nobody can read."""
    if channel.message_encoding == "json":
        return series.json_topic(channel.topic)
    if schema is None or (schema.encoding, channel.message_encoding) not in _WRITTEN:
        warn_user(f"{series.path}: messages of {channel.topic} are not ROS's and left out")
        return None
    ros1, idl = schema.encoding == "ros1msg", schema.encoding == "ros2idl"
    kind = schema.name if schema.name.count("/") > 1 else schema.name.replace("/", "/msg/")
    fields = definitions(schema.data.decode(), kind, ros1, idl)
    return series.topic(channel.topic, kind, fields, ros1)
