"""Readers of foreign files work in a process of their own, with bounded time and memory.

Some are compiled and die of a damaged file; some files are small and unpack to more than there is
memory. What is imported here and in the readers is what such a process waits for.
"""

from __future__ import annotations

import importlib
import json
import sys
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from subprocess import TimeoutExpired
from typing import Any

import numpy as np

from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError, PicchioWarning, warn_user
from picchio.core.files import regular_file
from picchio.core.processes import run_python

_REFUSED = 3
_CHILD = "from picchio.campaign.importing.isolated import child; child(*sys.argv[1:])"


@dataclass(frozen=True)
class Limits:
    """What a reader may take; files are compressed, or text, to a degree of their kind.

    Attributes:
        seconds: for any file, and `seconds_a_byte` more.
        memory: bytes of address space for any file, and `memory_a_byte` more.
    """

    seconds: float = 60.0
    seconds_a_byte: float = 2e-6
    memory: float = float(4 << 30)
    memory_a_byte: float = 8.0


def read_isolated(module: str, path: Path, clock: Mapping[str, Any]) -> RawFile:
    """What `module.read(path, clock)` gives, read in another process.

    Args:
        module: dotted name; it has `read` and its `LIMITS`.
        path: the file.
        clock: the mapping's `[time]`; empty without one.

    Returns:
        the file's series.

    Raises:
        InputError: as the reader; or it crashed, or took more time or memory than it may.
    """
    limits: Limits = importlib.import_module(module).LIMITS
    size = regular_file(path).stat().st_size
    seconds = limits.seconds + size * limits.seconds_a_byte
    memory = int(limits.memory + size * limits.memory_a_byte)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "series.npz"
        arguments = [module, str(path), str(out), json.dumps(dict(clock))]
        try:
            done = run_python(_CHILD, arguments, seconds=seconds, memory=memory)
        except TimeoutExpired:
            raise InputError(f"could not be read within {seconds:.0f} s", file=path) from None
        if done.returncode == _REFUSED:
            told = json.loads(done.stdout)
            _warn(told["warnings"])
            raise InputError(**told["error"])
        if done.returncode != 0:
            raise InputError("is damaged: its reader crashed", file=path)
        return _unpacked(path, out)


def child(module: str, path: str, out: str, clock: str) -> None:
    """Read the file and leave its series as .npz; the other process runs this.

    Args:
        module: dotted name of the reader.
        path: the file.
        out: where the series go.
        clock: `[time]`, as JSON.
    """
    with warnings.catch_warnings(record=True) as met:
        warnings.simplefilter("always")
        try:
            found: RawFile = importlib.import_module(module).read(Path(path), json.loads(clock))
            refused = None
        except MemoryError:
            refused = InputError("needs more memory than its size allows for", file=path)
        except InputError as error:
            refused = error
    said = [str(w.message) for w in met if issubclass(w.category, PicchioWarning)]
    if refused is not None:
        print(json.dumps({"error": _told(refused), "warnings": said}))
        sys.exit(_REFUSED)
    arrays: dict[str, FloatArray] = {}
    series: list[dict[str, Any]] = []
    clock, stamps = "", None
    for channel in found.channels.values():
        arrays[key := f"values {len(series)}"] = channel.values
        if channel.time is None:
            clock, stamps = "", None
        elif stamps is None or not np.array_equal(stamps, channel.time):  # a topic's share them
            arrays[clock := f"time {len(series)}"] = stamps = channel.time
        about = {name: getattr(channel, name) for name in ("name", "unit", "suggestion", "note")}
        series.append(about | {"values": key, "time": clock})
    told = {
        "kind": found.kind,
        "taken": found.taken and found.taken.isoformat(),
        "epoch": found.epoch,
        "detected": found.detected,
        "series": series,
        "warnings": said,
    }
    np.savez(out, allow_pickle=False, told=np.array(json.dumps(told)), **arrays)


def _told(error: InputError) -> dict[str, Any]:
    """What makes the same error again."""
    keys = ("problem", "file", "key", "value", "choices", "hint")
    return {key: getattr(error, key) for key in keys if getattr(error, key) is not None}


def _unpacked(path: Path, stored: Path) -> RawFile:
    with np.load(stored) as found:
        told = json.loads(str(found["told"]))
        arrays = {name: found[name] for name in found.files if name != "told"}
    _warn(told["warnings"])
    channels = {}
    for entry in told["series"]:
        both = {name: arrays.get(entry[name]) for name in ("values", "time")}
        channels[entry["name"]] = RawChannel(**entry | both)
    taken = told["taken"] and datetime.fromisoformat(told["taken"])
    return RawFile(path, told["kind"], channels, taken, told["epoch"], tuple(told["detected"]))


def _warn(messages: Sequence[str]) -> None:
    for message in messages:
        warn_user(message)
