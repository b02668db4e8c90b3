"""Readers of foreign files work in a process of their own, with bounded time and memory.

Some are compiled and die of a damaged file; some files are small and unpack to more than there is
memory. What is imported here and in the readers is what such a process waits for. It hands over
what it reads by a pipe, which it waits at: it is never further ahead than a block.
"""

from __future__ import annotations

import importlib
import json
import os
import select
import sys
import time
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import IO, Any

import numpy as np

from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError, PicchioWarning, warn_user
from picchio.core.files import regular_file
from picchio.core.processes import start_python
from picchio.core.tables import Left

_CHILD = "from picchio.campaign.importing.isolated import child; child(*sys.argv[1:])"


@dataclass(frozen=True)
class Limits:
    """What a reader may take; files are compressed, or text, to a degree of their kind.

    Attributes:
        seconds: that are waited for any file, and `seconds_a_byte` more.
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
    (found,) = _received(module, path, clock, "whole")
    return found


def blocks_isolated(
    module: str, path: Path, clock: Mapping[str, Any], names: set[str] | None
) -> Iterator[RawFile]:
    """What `module.blocks(path, clock, names)` gives, a block at a time.

    Args:
        module: dotted name; it has `blocks` and its `LIMITS`.
        path: the file.
        clock: the mapping's `[time]`; empty without one.
        names: of the series that are needed; all where None.

    Raises:
        InputError: as `read_isolated`.
    """
    return _received(module, path, clock, None if names is None else sorted(names))


def _received(module: str, path: Path, clock: Mapping[str, Any], names: Any) -> Iterator[RawFile]:
    limits: Limits = importlib.import_module(module).LIMITS
    size = regular_file(path).stat().st_size
    seconds = limits.seconds + size * limits.seconds_a_byte
    memory = int(limits.memory + size * limits.memory_a_byte)
    arguments = [module, str(path), json.dumps(dict(clock)), json.dumps(names)]
    process = start_python(_CHILD, arguments, memory=memory)
    assert process.stdout is not None
    pipe = _Pipe(process.stdout, seconds)
    try:
        while True:
            told = pipe.told()
            for message in told["warnings"]:
                warn_user(message)
            if "error" in told:
                raise InputError(**told["error"])
            if "series" not in told:
                return
            yield _block(path, told, pipe)
    except TimeoutError:
        raise InputError(f"could not be read within {seconds:.0f} s", file=path) from None
    except EOFError:
        raise InputError("is damaged: its reader crashed", file=path) from None
    finally:
        process.kill()
        process.stdout.close()
        process.wait()


class _Pipe:
    """What the other process writes; waiting for it takes no longer, all in all, than it may."""

    def __init__(self, stream: IO[bytes], seconds: float) -> None:
        self.stream, self.left = stream, seconds

    def fill(self, target: memoryview) -> None:
        at = 0
        while at < len(target):
            begin = time.monotonic()
            if not select.select([self.stream], [], [], max(self.left, 0.0))[0]:
                raise TimeoutError
            self.left -= time.monotonic() - begin
            got = self.stream.readinto(target[at:])  # type: ignore[attr-defined]
            if not got:
                raise EOFError
            at += got

    def told(self) -> dict[str, Any]:
        """What goes before the numbers: its length, then JSON."""
        length = np.zeros(1, np.int64)
        self.fill(length.data.cast("B"))
        text = bytearray(int(length[0]))
        self.fill(memoryview(text))
        found: dict[str, Any] = json.loads(text)
        return found


def _block(path: Path, told: dict[str, Any], pipe: _Pipe) -> RawFile:
    arrays: list[FloatArray] = []
    for kind, size in told["arrays"]:
        arrays.append(np.empty(size, kind))
        if size:
            pipe.fill(arrays[-1].data.cast("B"))
    channels = {}
    for entry in told["series"]:
        at, when = entry.pop("values"), entry.pop("time")
        time_of = None if when is None else arrays[when]
        channels[entry["name"]] = RawChannel(values=arrays[at], time=time_of, **entry)
    taken = told["taken"] and datetime.fromisoformat(told["taken"])
    texts = {name: np.array(words, object)[arrays[at]] for name, at, words in told["texts"]}
    return RawFile(path, told["kind"], channels, taken, told["epoch"], tuple(told["detected"]),
                   texts=texts, scalars=told["scalars"],
                   left=tuple(Left(**one) for one in told["left"]))  # fmt: skip


def child(module: str, path: str, clock: str, names: str) -> None:
    """Read the file and write its series to the pipe; the other process runs this.

    Args:
        module: dotted name of the reader.
        path: the file.
        clock: `[time]`, as JSON.
        names: JSON: of the series that are needed, null for all, "whole" for one block.
    """
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is none of it
    wanted = json.loads(names)
    with warnings.catch_warnings(record=True) as met:
        warnings.simplefilter("always")
        refused = None
        try:
            reader = importlib.import_module(module)
            how = Path(path), json.loads(clock)
            found: Iterable[RawFile] = (
                [reader.read(*how)] if wanted == "whole"
                else reader.blocks(*how, None if wanted is None else set(wanted))
            )  # fmt: skip
            for raw in found:
                _send(out, raw, _said(met))
        except MemoryError:
            refused = InputError("needs more memory than its size allows for", file=path)
        except InputError as error:
            refused = error
        last: dict[str, Any] = {"warnings": _said(met)}
    _write(out, last if refused is None else {**last, "error": _told(refused)})
    out.close()
    sys.exit(0)


def _said(met: list[warnings.WarningMessage]) -> Sequence[str]:
    """What was warned of since the last time."""
    said = [str(w.message) for w in met if issubclass(w.category, PicchioWarning)]
    met.clear()
    return said


def _write(out: IO[bytes], told: dict[str, Any]) -> None:
    text = json.dumps(told).encode()
    out.write(np.array([len(text)], np.int64).tobytes() + text)
    out.flush()


def _send(out: IO[bytes], raw: RawFile, said: Sequence[str]) -> None:
    arrays: list[FloatArray] = []
    series: list[dict[str, Any]] = []
    clock: int | None = None
    for channel in raw.channels.values():
        arrays.append(channel.values)
        at = len(arrays) - 1
        if channel.time is None:
            clock = None
        elif clock is None or not np.array_equal(arrays[clock], channel.time):
            clock = len(arrays)  # a topic's series share their stamps
            arrays.append(channel.time)
        about = {name: getattr(channel, name)
                 for name in ("name", "unit", "suggestion", "note", "clock")}  # fmt: skip
        series.append(about | {"values": at, "time": clock})
    texts = []
    for name, cells in raw.texts.items():
        words, codes = np.unique(cells.astype(str), return_inverse=True)
        texts.append((name, len(arrays), words.tolist()))
        arrays.append(codes)
    _write(out, {
        "texts": texts,
        "scalars": raw.scalars,
        "left": [asdict(one) for one in raw.left],
        "kind": raw.kind,
        "taken": raw.taken and raw.taken.isoformat(),
        "epoch": raw.epoch,
        "detected": raw.detected,
        "series": series,
        "arrays": [(a.dtype.str, a.size) for a in arrays],
        "warnings": said,
    })  # fmt: skip
    for array in arrays:
        if array.size:
            out.write(np.ascontiguousarray(array).data.cast("B"))
    out.flush()


def _told(error: InputError) -> dict[str, Any]:
    """What makes the same error again."""
    keys = ("problem", "file", "key", "value", "choices", "hint")
    return {key: getattr(error, key) for key in keys if getattr(error, key) is not None}
