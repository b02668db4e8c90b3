"""Bags of ROS 1 (.bag) and ROS 2 (.db3), read by rosbags."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from picchio.campaign.importing.isolated import Limits
from picchio.campaign.importing.raw import RawFile, reason
from picchio.campaign.importing.readers.ros_messages import Series, stamp_of
from picchio.core.errors import InputError, warn_user

LIMITS = Limits(seconds_a_byte=1e-5, memory_a_byte=32.0)
_SQLITE = b"SQLite format 3\0"


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
    try:
        import rosbags.rosbag1  # noqa: F401
    except ImportError:
        raise InputError("ROS bags need rosbags", file=path,
                         hint="pip install 'picchio[import]'") from None  # fmt: skip
    log = clock.get("stamp") == "log"
    with open(path, "rb") as stream:
        messages = _ros2 if stream.read(len(_SQLITE)) == _SQLITE else _ros1
    series = Series()
    try:
        for topic, kind, logged, message in messages(path):
            when = logged if log else stamp_of(message, logged)
            series.add(topic, kind.rpartition("/")[2], when, message)
    except MemoryError:
        raise
    except Exception as error:  # rosbags', sqlite's and the decoder's own kinds
        raise InputError(f"is not a readable ROS bag: {reason(error)}", file=path) from None
    return series.file(path, "bag")


def _ros1(path: Path) -> Iterator[tuple[str, str, int, Any]]:
    from rosbags.highlevel import AnyReader

    with AnyReader([path]) as reader:
        for connection, logged, data in reader.messages():
            yield (
                connection.topic, connection.msgtype, logged,
                reader.deserialize(data, connection.msgtype),
            )  # fmt: skip


def _ros2(path: Path) -> Iterator[tuple[str, str, int, Any]]:
    from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

    store = get_typestore(Stores.LATEST)
    database = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)
    try:
        tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master")}
        if "message_definitions" in tables:
            rows = database.execute(
                "SELECT topic_type, encoded_message_definition FROM message_definitions "
                "WHERE encoding = 'ros2msg'"
            )
            for kind, text in rows:
                if kind not in store.types and text:
                    # One that can't be parsed is told below, with those that are not there.
                    with suppress(TypesysError):
                        store.register(get_types_from_msg(text, kind))
        topics = {
            key: (name, kind)
            for key, name, kind in database.execute("SELECT id, name, type FROM topics")
        }
        unknown = {kind for _, kind in topics.values() if kind not in store.types}
        for kind in sorted(unknown):
            warn_user(f"{path}: messages of the kind {kind} are defined nowhere and left out")
        for key, logged, data in database.execute(
            "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id"
        ):
            topic, kind = topics[key]
            if kind not in unknown:
                yield topic, kind, logged, store.deserialize_cdr(data, kind)
    finally:
        database.close()
