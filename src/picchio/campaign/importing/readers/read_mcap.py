"""MCAP logs of ROS 2 (needs mcap-ros2-support)."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from picchio.campaign.importing.isolated import Limits
from picchio.campaign.importing.raw import RawFile, reason
from picchio.campaign.importing.readers.ros_messages import Series, stamp_of
from picchio.core.errors import InputError

# Decoded message by message, and often compressed.
LIMITS = Limits(seconds_a_byte=1e-5, memory_a_byte=32.0)


def read(path: Path, clock: Mapping[str, Any]) -> RawFile:
    """Every number of the messages, named "<topic>:<field>"; see `Series`.

    Raises:
        InputError: mcap is missing, the file is no MCAP or cut short, or holds no number.
    """
    try:
        from mcap.reader import make_reader
        from mcap_ros2.decoder import DecoderFactory
    except ImportError:
        raise InputError("MCAP files need mcap and mcap-ros2-support",
                         hint="pip install 'picchio[import]'") from None  # fmt: skip
    stamp = clock.get("stamp", "header")
    series = Series()
    try:
        # The decoder prints what it does not like about a message's definition.
        with open(path, "rb") as stream, contextlib.redirect_stdout(io.StringIO()):
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            for schema, channel, message, ros in reader.iter_decoded_messages(
                log_time_order=stamp == "log"
            ):
                kind = schema.name.rpartition("/")[2] if schema is not None else ""
                when = message.log_time if stamp == "log" else stamp_of(ros, message.log_time)
                series.add(channel.topic, kind, when, ros)
    except MemoryError:
        raise
    except Exception as error:  # mcap's, zstandard's, lz4's and the decoder's own kinds
        raise InputError(f"is not a readable MCAP file: {reason(error)}", file=path) from None
    return series.file(path, "mcap")
