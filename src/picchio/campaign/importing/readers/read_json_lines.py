"""JSON lines: an object a line, its numbers named by the keys that lead to them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from picchio.campaign.importing.detect import moment
from picchio.campaign.importing.isolated import Limits
from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.core.errors import InputError

LIMITS = Limits(seconds_a_byte=1e-6, memory_a_byte=32.0)
_DEEPEST = 6


def read(path: Path, clock: Mapping[str, Any]) -> RawFile:
    """Every number, "pose.x" or "q[2]"; texts that are dates become ns from 1970.

    A key that some lines lack is NaN there.

    Args:
        path: the file.
        clock: the mapping's `[time]`.

    Raises:
        InputError: a line that is no JSON object, with its number; no number at all.
    """
    values: dict[str, list[float]] = {}
    rows = 0
    with open(path, encoding="utf-8-sig", errors="replace") as stream:
        for number, line in enumerate(stream, start=1):
            if not line.strip():
                continue
            try:
                row = json.loads(line)
                if not isinstance(row, dict):
                    raise ValueError
                found = list(_numbers("", row, _DEEPEST))
            except (ValueError, RecursionError):
                raise InputError("is no JSON object of numbers", file=path, key=f"line {number}",
                                 value=line.strip()[:60]) from None  # fmt: skip
            for name, value in found:
                column = values.setdefault(name, [])
                column.extend([np.nan] * (rows - len(column)))
                column.append(value)
            rows += 1
    channels = {}
    for name, column in values.items():
        column.extend([np.nan] * (rows - len(column)))
        exact = all(isinstance(v, int) for v in column) and abs(column[0]) >= 2**53
        kind = np.int64 if exact else np.float64
        channels[name] = RawChannel(name, np.array(column, dtype=kind))
    if not channels:
        raise InputError("holds no series of numbers", file=path)
    return RawFile(path, "json-lines", channels)


def _numbers(name: str, value: Any, depth: int) -> Iterator[tuple[str, float]]:
    if isinstance(value, (bool, int, float)):
        if isinstance(value, int) and abs(value) >= 2**63:
            raise ValueError
        yield name, value
    elif isinstance(value, str):
        if (when := moment(value)) is not None:
            yield name, when
    elif isinstance(value, dict) and depth:
        for key, part in value.items():
            yield from _numbers(f"{name}.{key}" if name else key, part, depth - 1)
    elif isinstance(value, list) and depth:
        for i, part in enumerate(value):
            yield from _numbers(f"{name}[{i}]", part, depth - 1)
