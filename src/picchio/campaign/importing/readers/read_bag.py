"""Bags of ROS 1 (.bag) and ROS 2 (.db3) (needs rosbags), whole or in blocks."""

from __future__ import annotations

import bz2
import sqlite3
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

from picchio.campaign.importing.isolated import Limits
from picchio.campaign.importing.raw import RawFile
from picchio.campaign.importing.readers.ros_messages import Series, Topic, collected, definitions
from picchio.core.errors import InputError

LIMITS = Limits(seconds_a_byte=1e-5, memory_a_byte=32.0)
_WORDS = "ROS bag"
_SQLITE = b"SQLite format 3\0"
_BAG = b"#ROSBAG V2.0\n"
_MESSAGE, _BEGIN, _CHUNK, _CONNECTION = 2, 3, 5, 7  # kinds of record
_LARGEST = 1 << 31  # bytes of a record; damage asks for more
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
    return next(collected(Series(path, "bag", clock), _fill, _WORDS, whole=True))


def blocks(path: Path, clock: Mapping[str, Any], names: set[str] | None) -> Iterator[RawFile]:
    """The same in blocks: memory does not grow with the file.

    Args:
        path: the file.
        clock: the mapping's `[time]`.
        names: of the series that are needed; all where None.

    Raises:
        InputError: as `read`.
    """
    return collected(Series(path, "bag", clock, names), _fill, _WORDS, whole=False)


def _fill(series: Series) -> Iterator[None]:
    try:
        import rosbags.typesys  # noqa: F401
    except ImportError:
        raise InputError("ROS bags need rosbags", file=series.path,
                         hint="pip install 'picchio[import]'") from None  # fmt: skip
    with open(series.path, "rb") as file:
        if file.read(len(_SQLITE)) != _SQLITE:
            file.seek(0)
            yield from _ros1(file, series)
            return
    yield from _ros2(series)


def _ros1(file: BinaryIO, series: Series) -> Iterator[None]:
    """A chunk at a time, in the order of the file, without its index, which may be large.

    Source: the ROS wiki, "Bags/Format/2.0".
    """
    if file.read(len(_BAG)) != _BAG:
        raise ValueError("it does not begin as a bag of version 2.0")
    topics: dict[int, Topic | None] = {}
    claimed, chunks = -1, 0
    while (record := _record(file)) is not None:
        head, data = record
        kind = head["op"][0]
        if kind == _BEGIN:
            claimed = _whole(head["chunk_count"])
            if not _whole(head["index_pos"]):
                raise ValueError("it was not closed; reindex it first")
        elif kind == _CONNECTION:
            _connect(head, data, topics, series)
        elif kind == _CHUNK:
            chunks += 1
            _inside(_unpacked(head["compression"], data), topics, series)
            yield
    if chunks != claimed:
        raise ValueError(f"it holds {chunks} of {claimed} chunks")


def _unpacked(how: bytes, data: bytes) -> bytes:
    if how == b"bz2":
        return bz2.decompress(data)
    if how == b"lz4":
        import lz4.frame  # type: ignore[import-untyped]

        return bytes(lz4.frame.decompress(data))
    if how != b"none":
        raise ValueError(f"its compression {how!r} is not known")
    return data


def _inside(data: bytes, topics: dict[int, Topic | None], series: Series) -> None:
    at = 0
    while at < len(data):
        (size,) = struct.unpack_from("<I", data, at)
        head = _fields(data[at + 4 : at + 4 + size])
        (length,) = struct.unpack_from("<I", data, at + 4 + size)
        begin = at + 8 + size
        at = begin + length
        if at > len(data):
            raise ValueError("a record goes beyond its chunk")
        if head["op"][0] == _CONNECTION:
            _connect(head, data[begin:at], topics, series)
        elif head["op"][0] == _MESSAGE:
            topic = topics[_whole(head["conn"])]
            if topic is not None:
                seconds, rest = struct.unpack("<II", head["time"])
                topic.data.append(data[begin:at])
                topic.logged.append(seconds * 1_000_000_000 + rest)


def _connect(
    head: dict[str, bytes], data: bytes, topics: dict[int, Topic | None], series: Series
) -> None:
    number = _whole(head["conn"])
    if number not in topics:
        about = _fields(data)
        kind = about["type"].decode().replace("/", "/msg/")
        fields = definitions(about["message_definition"].decode(), kind, ros1=True)
        topics[number] = series.topic(head["topic"].decode(), kind, fields, ros1=True)


def _record(file: BinaryIO) -> tuple[dict[str, bytes], bytes] | None:
    parts: list[bytes] = []
    for _ in range(2):
        length = file.read(4)
        if not length and not parts:
            return None
        (size,) = struct.unpack("<I", length)
        parts.append(file.read(size) if size < _LARGEST else b"")
        if len(parts[-1]) < size:
            raise ValueError("it is cut short")
    return _fields(parts[0]), parts[1]


def _fields(data: bytes) -> dict[str, bytes]:
    found, at = {}, 0
    while at < len(data):
        (size,) = struct.unpack_from("<I", data, at)
        name, _, value = data[at + 4 : at + 4 + size].partition(b"=")
        found[name.decode()] = value
        at += 4 + size
    return found


def _whole(value: bytes) -> int:
    return int.from_bytes(value, "little")


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
