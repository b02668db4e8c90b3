"""Atomic writes, bounded reads, and file hashes."""

from __future__ import annotations

import csv
import hashlib
import io
import math
import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from picchio.core.errors import InputError

LARGEST = 32 << 20
"""Bytes of a file that people write."""


@contextmanager
def atomic_write(path: str | Path, mode: str = "w") -> Iterator[IO[Any]]:
    """Open a temporary file beside `path` and rename it over `path` when the block ends well.

    Args:
        path: where the file shall stand.
        mode: "w" for UTF-8 text, "wb" for bytes.

    Raises:
        InputError: the folder does not exist or can't be written.
    """
    target = Path(path)
    try:
        handle, name = tempfile.mkstemp(
            prefix=f".{target.name}.", suffix=".part", dir=target.parent
        )
    except OSError as error:
        raise InputError(f"cannot write here: {error.strerror}", file=target) from None
    temporary = Path(name)
    try:
        os.chmod(temporary, 0o666 & ~umask())
        with os.fdopen(handle, mode, encoding=None if "b" in mode else "utf-8") as stream:
            yield stream
        if target.is_dir():
            raise InputError("cannot write a file over a folder", file=target)
        os.replace(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_text(path: str | Path, text: str) -> None:
    """Write a text file, whole or not at all; errors as of `atomic_write`.

    Args:
        path: where the file shall stand.
        text: its content.
    """
    with atomic_write(path) as stream:
        stream.write(text)


def umask() -> int:
    """The user's default permissions, which `tempfile` does not give its files."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def sha256(path: str | Path) -> str:
    """SHA-256 of a file's bytes, as 64 hex digits."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def relative_name(path: str | Path, folder: Path) -> str:
    """The way to a file from a folder, with forward slashes, as a file in the folder names it.

    Args:
        path: of the file.
        folder: which may not exist yet.
    """
    return Path(os.path.relpath(Path(path).resolve(), folder.resolve())).as_posix()


def read_text(path: str | Path, *, limit: int = LARGEST) -> str:
    """A UTF-8 text file's content.

    Args:
        path: the file.
        limit: refuse files above this size, in bytes.

    Raises:
        InputError: as `read_bytes`, or not UTF-8.
    """
    try:
        return read_bytes(path, limit=limit).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"is not UTF-8 text (byte {error.start})", file=path) from None


def read_bytes(path: str | Path, *, limit: int = LARGEST) -> bytes:
    """A file's content.

    Args:
        path: the file.
        limit: refuse files above this size, in bytes.

    Raises:
        InputError: missing, a folder, unreadable or too large.
    """
    source = Path(path)
    try:
        if source.is_dir():
            raise InputError("is a folder, not a file", file=source)
        if (size := source.stat().st_size) > limit:
            raise InputError(f"is too large ({size} bytes; at most {limit})", file=source)
        return source.read_bytes()
    except FileNotFoundError:
        raise InputError("no such file", file=source) from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=source) from None


def read_columns(
    path: str | Path, needed: Sequence[str], optional: Sequence[str] = ()
) -> list[list[float]]:
    """Columns of numbers from a CSV file, found by their names in its header.

    Args:
        path: the file.
        needed: names of columns.
        optional: further ones, which are read where the header has all of them.

    Returns:
        a list a row, in the order of the names.

    Raises:
        InputError: no such file, a column that is missing or there twice, or a cell that is no
            finite number, with its line.
    """
    rows = list(csv.reader(io.StringIO(read_text(path))))
    header = [cell.strip() for cell in rows[0]] if rows else []
    names = [*needed, *(optional if set(optional) <= set(header) else ())]
    for name in names:
        if header.count(name) != 1:
            raise InputError(f"the header must name one column {name!r}", file=path, value=header)
    found = []
    for line, row in enumerate(rows[1:], start=2):
        if not row:
            continue
        try:
            numbers = [float(row[header.index(name)]) for name in names]
        except (ValueError, IndexError):
            numbers = [math.nan]
        if not all(map(math.isfinite, numbers)):
            raise InputError(
                f"line {line} does not hold {len(names)} finite numbers",
                file=path,
                value=",".join(row),
            )
        found.append(numbers)
    return found
