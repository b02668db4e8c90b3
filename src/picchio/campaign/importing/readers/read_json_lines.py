"""JSON: an object a line, or one document; numbers are named by the keys that lead to them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from picchio.campaign.importing.isolated import Limits
from picchio.campaign.importing.raw import RawFile, columns_of
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
    return RawFile.of(path, "json-lines", by_key(rows))


def by_key(rows: list[dict[str, Any]]) -> Iterator[Column | Left]:
    """What objects of JSON hold, by the keys that lead there; NaN where one lacks a key.

    Args:
        rows: the objects.

    Returns:
        a column a key, of a value a row.
    """
    found: dict[str, list[Any]] = {}
    for k, row in enumerate(rows):
        for name, value in _leaves("", row, _DEEPEST):
            found.setdefault(name, [None] * len(rows))[k] = value
    for name, values in found.items():
        yield from columns_of(name, values, table=True)


def _leaves(name: str, value: Any, depth: int) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict) and depth:
        for key, part in value.items():
            yield from _leaves(f"{name}.{key}" if name else key, part, depth - 1)
    elif isinstance(value, list) and depth:
        for i, part in enumerate(value):
            yield from _leaves(f"{name}[{i}]", part, depth - 1)
    elif value is not None:
        yield name, value
