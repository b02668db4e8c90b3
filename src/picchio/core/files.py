"""Atomic writes, bounded reads, and file hashes."""

from __future__ import annotations

import atexit
import ctypes
import hashlib
import math
import os
import re
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import IO, Any

from picchio.core.errors import InputError, OutputError
from picchio.core.guard import guard
from picchio.core.unfinished import unfinished

LARGEST = 32 << 20
"""Bytes of a file that people write."""
_OLD = ".old"
_STANDARD = ("/dev/stdin", "/dev/stdout", "/dev/stderr")
_RENAME_EXCHANGE = 2  # linux/fs.h


@contextmanager
def atomic_write(path: str | Path, mode: str = "w") -> Iterator[IO[Any]]:
    """Open a temporary file beside `path` and rename it over `path` when the block ends well.

    A link is followed: what it points to is replaced. A pipe or a device is written to as it is.

    Args:
        path: where the file shall stand.
        mode: "w" for UTF-8 text, "wb" for bytes.

    Returns:
        a context manager whose value is the open file.

    Raises:
        InputError: the folder does not exist, or there is a folder of this name.
        OutputError: the disk is full or read-only, or the permission is missing.
    """
    encoding = None if "b" in mode else "utf-8"
    if is_stream(path):
        with writing(path):
            sys.stdout.flush()
            opened = os.dup(open_file) if (open_file := _open_file(path)) is not None else path
            with open(opened, mode, encoding=encoding) as stream:
                yield stream
        return
    target = Path(os.path.realpath(path))
    if not target.parent.is_dir():
        raise InputError("cannot write here: the folder does not exist", file=path)
    if target.is_dir():
        raise InputError("cannot write a file over a folder", file=path)
    with writing(path), unfinished(partial(part_of, target)) as temporary:
        # Names of files that are not UTF-8 may stand in a text: they are told as \udce4.
        bad = None if encoding is None else "backslashreplace"
        with open(temporary, mode, encoding=encoding, errors=bad) as stream:
            yield stream
        os.replace(temporary, target)


def part_of(target: Path, *, folder: bool = False) -> Path:
    """A new empty file or folder beside a target, which it is to replace; hidden by its name.

    Args:
        target: which may not exist yet.
        folder: whether it is one.
    """
    prefix = f".{target.name}."
    if folder:
        made = tempfile.mkdtemp(".part", prefix, target.parent)
    else:
        handle, made = tempfile.mkstemp(".part", prefix, target.parent)
        os.close(handle)
    os.chmod(made, (0o777 if folder else 0o666) & ~umask())
    return Path(made)


@contextmanager
def writing(path: str | Path) -> Iterator[None]:
    """Within the block, an error of the operating system is one line that names the output.

    Args:
        path: what is being written.

    Returns:
        a context manager.

    Raises:
        OutputError: the disk is full or read-only, or the permission is missing.
        InputError: a command would write over what it has read.
    """
    guard.written(path)
    try:
        yield
    except BrokenPipeError:  # the reader has gone, which is no failure
        raise
    except OSError as error:
        reason = error.strerror or str(error)
        raise OutputError(f"cannot be written: {reason}", file=path) from None


def temporary_folder() -> Path:
    """A new folder that lasts as long as this process."""
    folder = tempfile.mkdtemp(prefix="picchio-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def is_stream(path: str | Path) -> bool:
    """Whether this is a pipe, a device or an open file's number: not to be replaced by a file.

    Args:
        path: of an output, which may not exist yet.
    """
    if _open_file(path) is not None:
        return True
    try:
        mode = os.stat(path).st_mode
    except OSError:
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


def _open_file(path: str | Path) -> int | None:
    """The number of the open file that a name such as /dev/stdout stands for."""
    name = os.path.abspath(path)
    if name in _STANDARD:
        return _STANDARD.index(name)
    found = re.fullmatch(r"/(?:dev|proc/self)/fd/(\d+)", name)
    return int(found[1]) if found else None


def swap_in(new: Path, target: Path) -> None:
    """Put a finished file or folder in the place of an old one, which is deleted.

    At every moment there is the old one or the new one, whole: the two names are exchanged in one
    step where the system can do that (Linux). Elsewhere a folder is moved aside first;
    `recover` brings it back where that was interrupted.

    Args:
        new: beside the target, on the same disk.
        target: need not exist.
    """
    empty = target.is_dir() and not any(target.iterdir())
    if not target.exists() or (empty if new.is_dir() else target.is_file()):
        os.replace(new, target)
        return
    aside = Path(tempfile.mkdtemp(prefix=f".{target.name}.", suffix=_OLD, dir=target.parent))
    old = aside / target.name
    try:
        os.replace(new, old)
        if not _exchange(old, target):
            os.replace(old, new)
            os.replace(target, old)
            try:
                os.replace(new, target)
            except BaseException:
                os.replace(old, target)
                raise
    finally:
        shutil.rmtree(aside, ignore_errors=True)


def recover(target: Path) -> bool:
    """Bring back a folder whose replacement was interrupted.

    Args:
        target: where it stood.

    Returns:
        whether there was one.
    """
    if target.exists():
        return False
    for old in sorted(target.parent.glob(f".{target.name}.*{_OLD}/{target.name}")):
        os.replace(old, target)
        shutil.rmtree(old.parent, ignore_errors=True)
        return True
    return False


@contextmanager
def locked(target: Path, *, patience: float = 0.0) -> Iterator[None]:
    """Within the block no other process writes this file or folder, if it locks it, too.

    Args:
        target: which may not exist yet.
        patience: seconds to wait for another process.

    Returns:
        a context manager.

    Raises:
        OutputError: another process is writing it, or the lock cannot be made.
    """
    from filelock import FileLock, Timeout

    file = target.with_name(f".{target.name}.lock")
    lock = FileLock(file, timeout=patience)
    with writing(target):
        try:
            lock.acquire()
        except Timeout:
            raise OutputError("another process is writing it", file=target) from None
    try:
        # It goes while it is held: who waits for it sees that, and takes a new one.
        with unfinished(lambda: file):
            yield
    finally:
        lock.release()


def _exchange(one: Path, other: Path) -> bool:
    """Exchange two names in one step; False where the system or the disk cannot."""
    try:
        call = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError):
        return False
    names = os.fsencode(one.absolute()), os.fsencode(other.absolute())
    return call(-1, names[0], -1, names[1], _RENAME_EXCHANGE) == 0


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
    """SHA-256 of a file's bytes.

    Args:
        path: of the file.

    Returns:
        64 hex digits.
    """
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def printable_name(path: str | Path) -> str:
    r"""A file's name, or a text with one in it, as UTF-8 can write it: others are told as \xe4.

    Args:
        path: of the file; of a text all is told.
    """
    name = path.name if isinstance(path, Path) else path
    return os.fsencode(name).decode("utf-8", "backslashreplace")


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
    try:
        return regular_file(path, limit=limit).read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=path) from None


def regular_file(path: str | Path, *, limit: float = math.inf) -> Path:
    """The path, once it is sure that a file of bounded size is there.

    A pipe would be waited for, a device read without end.

    Args:
        path: the file.
        limit: refuse files above this size, in bytes.

    Raises:
        InputError: missing, a folder, a pipe or a device, unreadable or too large.
    """
    try:
        found = os.stat(path)
    except FileNotFoundError:
        raise InputError("no such file", file=path) from None
    except (OSError, ValueError) as error:  # a name with a zero byte is a ValueError
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"cannot be read: {reason}", file=path) from None
    if stat.S_ISDIR(found.st_mode):
        raise InputError("is a folder, not a file", file=path)
    if not stat.S_ISREG(found.st_mode):
        raise InputError("is a pipe or a device, not a file", file=path)
    if found.st_size > limit:
        raise InputError(f"is too large ({found.st_size} bytes; at most {limit:.0f})", file=path)
    guard.reading([path])
    return Path(path)
