"""Read S-N tests from a table: stress amplitude, cycles, and whether the specimen failed."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError, warn_user
from picchio.core.files import csv_rows, read_text

_UNITS = {"pa": 1.0, "kpa": 1e3, "mpa": 1e6, "n/mm^2": 1e6, "n/mm2": 1e6, "gpa": 1e9,
          "psi": 6894.757293168361, "ksi": 6894757.293168361}  # fmt: skip
_FAILED = {"failure", "failed", "fail", "fracture", "true", "1", "yes", "broken"}
_ALIVE = {"runout", "run-out", "run out", "survived", "survivor", "false", "0", "no", "alive"}


@dataclass(frozen=True)
class SNTests:
    """S-N tests.

    Attributes:
        amplitude: (n,) Pa.
        cycles: (n,) at failure, or reached without.
        failed: (n,) bool.
        assumptions: what the reader had to assume.
        file: the table they are from; None for arrays.
    """

    amplitude: FloatArray
    cycles: FloatArray
    failed: np.ndarray
    assumptions: tuple[str, ...] = ()
    file: Path | None = None


def read_sn_tests(path: str | Path, *, run_out_cycles: float | None = None) -> SNTests:
    """Read a table with a header, separated by comma, semicolon or tab.

    Columns are known by the words in their names: "stress", "load" or "amplitude" with a unit in
    brackets (`Stress [MPa]`), "cycles" or "life", and (optional) "outcome", "failed", "result" or
    "comment" with words such as Failure and RunOut.

    Args:
        path: the file.
        run_out_cycles: without an outcome column, tests that reached this many cycles are
            run-outs. None: the longest life, if two tests at least share it exactly.

    Raises:
        InputError: missing columns, an unknown unit, or a cell that can't be read (with its row).
    """
    rows = _rows(path)
    header = [cell.strip() for cell in rows[0]]
    stress = _column(header, path, "stress", "load", "amplitude")
    cycles = _column(header, path, "cycles", "life")
    outcome = _find(header, "outcome", "failed", "result", "comment")
    factor = _unit(header[stress], path)
    values, outcomes = [], []
    for line, row in enumerate(rows[1:], start=2):
        cells = [cell.strip() for cell in row] + [""] * len(header)
        where = f"row {line}"
        for text in (cells[stress], cells[cycles]):
            try:
                value = float(text)
            except ValueError:
                value = math.nan
            if not 0.0 < value < math.inf:
                raise InputError("must be a positive number", file=path, key=where, value=text)
            values.append(value)
        if outcome is not None:
            word = cells[outcome].lower()
            if word not in _FAILED | _ALIVE:
                choices = ("Failure", "RunOut")
                raise InputError(
                    "unknown outcome", file=path, key=where, value=word, choices=choices
                )
            outcomes.append(word in _FAILED)
    amplitude, life = np.reshape(values, (-1, 2)).T
    notes: tuple[str, ...] = ()
    failed = np.array(outcomes)
    if outcome is None:
        failed, notes = _by_cycles(life, run_out_cycles)
    return SNTests(amplitude * factor, life, failed, notes, Path(path))


def _rows(path: str | Path) -> list[list[str]]:
    lines = [line for line in read_text(path).splitlines() if line.strip()]
    if len(lines) < 2:
        raise InputError("has no tests: needs a header and at least one row", file=path)
    delimiter = max("\t;,", key=lines[0].count)
    return csv_rows(lines, path, delimiter=delimiter)


def _find(header: list[str], *words: str) -> int | None:
    for word in words:
        for i, name in enumerate(header):
            if word in name.lower():
                return i
    return None


def _column(header: list[str], path: str | Path, *words: str) -> int:
    found = _find(header, *words)
    if found is None:
        raise InputError(f"no column named like {words[0]!r}", file=path, value=header)
    return found


def _unit(name: str, path: str | Path) -> float:
    found = re.search(r"[\[(]\s*([^\])]+?)\s*[\])]", name)
    unit = found.group(1).lower() if found else ""
    if unit not in _UNITS:
        raise InputError(
            "the stress needs a unit in brackets", file=path, key=name, value=unit, choices=_UNITS
        )
    return _UNITS[unit]


def _by_cycles(
    cycles: FloatArray, run_out_cycles: float | None
) -> tuple[np.ndarray, tuple[str, ...]]:
    longest = float(cycles.max())
    if run_out_cycles is None and int((cycles == longest).sum()) < 2:
        return np.ones(len(cycles), dtype=bool), ("no outcome column: every test failed",)
    limit = longest if run_out_cycles is None else float(run_out_cycles)
    note = f"no outcome column: tests that reached {limit:g} cycles are run-outs"
    if run_out_cycles is None:
        warn_user(note)
    return cycles < limit, (note,)
