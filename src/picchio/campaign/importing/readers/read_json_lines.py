"""JSON: an object a line, or one document; numbers are named by the keys that lead to them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from picchio.campaign.importing.isolated import Limits
from picchio.campaign.importing.raw import RawFile, columns_of
from picchio.core.dates import is_moment, moment
from picchio.core.errors import InputError
from picchio.core.tables import Column, Left

LIMITS = Limits(seconds_a_byte=1e-6, memory_a_byte=32.0)
_DEEPEST = 6


def read(path: Path, clock: Mapping[str, Any]) -> RawFile:
    """Every number, "pose.x" or "q[2]" of lines, "q(3)" of a document's arrays; dates as ns.

    A key that some lines lack is NaN there; text is left out and told.

    Args:
        path: the file.
        clock: the mapping's `[time]`.

    Raises:
        InputError: a line that is no JSON object, with its number; no number at all.
    """
    text = path.read_text("utf-8-sig", errors="replace")
    rows: list[dict[str, Any]] = []
    try:
        whole = json.loads(text)
    except (ValueError, RecursionError):
        whole = None
    if isinstance(whole, list) and whole and all(isinstance(row, dict) for row in whole):
        rows = whole
    elif isinstance(whole, (dict, list)):
        return RawFile.of(path, "json-lines", columns_of("", whole))
    for number, line in enumerate([] if rows else text.splitlines(), start=1):
        if not line.strip():
            continue
        try:
            row = json.loads(line)
            if not isinstance(row, dict):
                raise ValueError
        except (ValueError, RecursionError):
            raise InputError("is no JSON object of numbers", file=path, key=f"line {number}",
                             value=line.strip()[:60]) from None  # fmt: skip
        rows.append(row)
    return RawFile.of(path, "json-lines", _columns(rows))


def _columns(rows: list[dict[str, Any]]) -> Iterator[Column | Left]:
    found = by_key(rows)
    for name, (at, values) in found.items():
        numbers = [v if isinstance(v, (bool, int, float)) else None for v in values]
        lost = [k for k, v in enumerate(numbers) if v is None]
        if lost:
            why, first = f"no number in {name}", lost[0]
            yield Left(why, len(lost), at[first] + 1, str(values[first]), len(lost), name, "row")
        if len(lost) == len(values):
            continue
        exact = len(at) == len(rows) and all(
            isinstance(v, int) and abs(v) < 2**63 for v in numbers
        ) and abs(values[0]) >= 2**53  # fmt: skip
        column = np.full(len(rows), np.nan) if not exact else np.zeros(len(rows), np.int64)
        column[at] = np.array(numbers, dtype=column.dtype)
        yield Column(name, "number", column)


def by_key(rows: list[dict[str, Any]]) -> dict[str, tuple[list[int], list[Any]]]:
    """What objects of JSON hold, by the keys that lead there: in which of them, and what.

    Args:
        rows: the objects.
    """
    found: dict[str, tuple[list[int], list[Any]]] = {}
    for k, row in enumerate(rows):
        for name, value in _leaves("", row, _DEEPEST):
            at, values = found.setdefault(name, ([], []))
            at.append(k)
            values.append(value)
    return found


def _leaves(name: str, value: Any, depth: int) -> Iterator[tuple[str, Any]]:
    if isinstance(value, str) and is_moment(value):
        yield name, value if (when := moment(value)) is None else when
    elif isinstance(value, dict) and depth:
        for key, part in value.items():
            yield from _leaves(f"{name}.{key}" if name else key, part, depth - 1)
    elif isinstance(value, list) and depth:
        for i, part in enumerate(value):
            yield from _leaves(f"{name}[{i}]", part, depth - 1)
    elif value is not None:
        yield name, value
