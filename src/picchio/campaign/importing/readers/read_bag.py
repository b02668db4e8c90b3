"""Bags of ROS 1 (.bag) and ROS 2 (.db3) (needs rosbags), whole or in blocks."""

from __future__ import annotations

import io
import sqlite3
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from picchio.campaign.importing.isolated import Limits
from picchio.campaign.importing.raw import RawFile
from picchio.campaign.importing.readers.ros_messages import Series, Topic, collected, definitions

LIMITS = Limits(seconds_a_byte=1e-5, memory_a_byte=32.0)
_WHAT = ("ROS bag", "rosbags")
_SQLITE = b"SQLite format 3\0"
_BAG = b"#ROSBAG V2.0\n"
_MESSAGE, _BEGIN, _CHUNK, _CONNECTION = 2, 3, 5, 7  # kinds of record
_SOME = 1000  # messages


def read(path: Path, clock: Mapping[str, Any]) -> RawFile:
    """Every number of the messages, named "<topic>:<field>"; see `Series`.

    A .db3 needs no metadata.yaml beside it. A kind of message that neither the bag nor ROS 2's own
    packages define is left out, with a warning.

    Args:
        path: the file.
        clock: the mapping's `[time]`.

    Raises:
        InputError: rosbags is missing, the file is no bag or cut short, or holds no number.
    """
    return next(collected(Series(path, "bag", clock), _fill, _WHAT, whole=True))


def blocks(path: Path, clock: Mapping[str, Any], names: set[str] | None) -> Iterator[RawFile]:
    """The same in blocks: memory does not grow with the file.

    Args:
        path: the file.
        clock: the mapping's `[time]`.
        names: of the series that are needed; all where None.

    Raises:
        InputError: as `read`.
    """
    return collected(Series(path, "bag", clock, names), _fill, _WHAT, whole=False)


def _fill(series: Series) -> Iterator[None]:
    import rosbags.typesys  # noqa: F401  # before the file is looked at

    with open(series.path, "rb") as file:
        if file.read(len(_SQLITE)) == _SQLITE:
            yield from _ros2(series)
            return
        file.seek(0)
        if file.read(len(_BAG)) != _BAG:
            raise ValueError("it does not begin as a bag of version 2.0")
        claimed = chunks = 0
        topics: dict[int, Topic | None] = {}
        for head, data in _records(file):
            if head["op"][0] == _BEGIN:
                claimed = head.get_uint32("chunk_count")
                if not head.get_uint64("index_pos"):
                    raise ValueError("it was not closed; reindex it first")
            elif head["op"][0] == _CHUNK:
                chunks += 1
                for inner, message in _records(_unpacked(head, data)):
                    _taken(inner, message, topics, series)
                yield
            else:
                _taken(head, data, topics, series)
        if chunks != claimed:
            raise ValueError(f"it holds {chunks} of {claimed} chunks")


def _records(file: io.BufferedReader) -> Iterator[tuple[Any, bytes]]:
    """Header and data of each, in the order of the file, without its index, which may be large.

    Source: the ROS wiki, "Bags/Format/2.0".
    """
    from rosbags.rosbag1.reader import Header, read_bytes, read_uint32

    while file.peek(1):
        head = Header.read(file)
        yield head, read_bytes(file, read_uint32(file))


def _unpacked(head: Any, data: bytes) -> io.BufferedReader:
    """The records of a chunk."""
    from rosbags.rosbag1.reader import decompressors

    if (how := head.get_string("compression")) not in decompressors:
        raise ValueError(f"its compression {how!r} is not known")
    return io.BufferedReader(io.BytesIO(decompressors[how](data)))


def _taken(head: Any, data: bytes, topics: dict[int, Topic | None], series: Series) -> None:
    """Take a message, or what a connection says of those that come."""
    from rosbags.rosbag1.reader import Header

    kind = head["op"][0]
    number = head.get_uint32("conn") if kind in (_MESSAGE, _CONNECTION) else 0
    if kind == _MESSAGE and (topic := topics[number]) is not None:
        topic.data.append(data)
        topic.logged.append(head.get_time("time"))
    elif kind == _CONNECTION and number not in topics:
        about = Header.read(io.BytesIO(len(data).to_bytes(4, "little") + data))
        name = about.get_string("type").replace("/", "/msg/")
        fields = definitions(about.get_string("message_definition"), name, ros1=True)
        topics[number] = series.topic(head.get_string("topic"), name, fields, ros1=True)


def _ros2(series: Series) -> Iterator[None]:
    database = sqlite3.connect(f"{series.path.resolve().as_uri()}?mode=ro", uri=True)
    try:
        tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master")}
        texts = {}
        if "message_definitions" in tables:
            texts = dict(database.execute(
                "SELECT topic_type, encoded_message_definition FROM message_definitions "
                "WHERE encoding = 'ros2msg'"
            ))  # fmt: skip
        topics = {
            key: series.topic(name, kind, definitions(texts.get(kind) or "", kind))
            for key, name, kind in database.execute("SELECT id, name, type FROM topics")
        }
        rows = database.execute("SELECT topic_id, timestamp, data FROM messages "
                                "ORDER BY timestamp, id")  # fmt: skip
        for count, (key, logged, data) in enumerate(rows):
            topic = topics[key]
            if topic is not None:
                topic.data.append(data)
                topic.logged.append(logged)
            if count % _SOME == 0:
                yield
    finally:
        database.close()
