"""No output takes the place of an input, or of another output: what a command reads and writes."""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from picchio.core.errors import InputError

_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT


class Guard:
    """The files that a command has opened to read, and those that it was told to write.

    Every file that Python opens is known, whoever opens it; `reading` adds those that compiled code
    opens, and those that will be read later. They are compared as the system does: a link, or
    another name, is the same file.
    """

    def __init__(self) -> None:
        self._on = self._hooked = False
        self.begin(listen=False)

    def begin(self, listen: bool = True) -> None:
        """A command begins: nothing is known of it yet.

        Args:
            listen: to what is opened from now on.
        """
        self._new: set[str] = set()
        self._read: dict[tuple[int, int], str] = {}
        self._folders: list[str] = []
        self._targets: dict[Path, tuple[str, bool]] = {}
        self._on = listen
        if listen and not self._hooked:
            self._hooked = True
            sys.addaudithook(self._opened)

    def _opened(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open" and self._on and isinstance(arguments[0], (str, os.PathLike)):
            path, _, flags = arguments
            if not (flags or 0) & _WRITES:
                self._new.add(os.fspath(path))

    @property
    def keys(self) -> set[str]:
        """The options that name outputs."""
        return {key for key, _ in self._targets.values()}

    def reading(self, paths: Iterable[str | Path]) -> None:
        """Files that are inputs, opened or not.

        Args:
            paths: of files; others are no matter.
        """
        self._new.update(str(path) for path in paths)

    def declare(self, target: Path, key: str, *, added_to: bool = False) -> None:
        """A file or folder that the command shall write.

        Args:
            target: which may not exist yet.
            key: the option that names it.
            added_to: whether what is there is read and kept, as in a ledger.

        Raises:
            InputError: another option names it, too, or a folder that it is in.
        """
        real = os.path.realpath(target)
        for other, (first, _) in self._targets.items():
            there = os.path.realpath(other)
            if real == there or (target.exists() and other.exists() and target.samefile(other)):
                raise InputError(f"is written by {first}, too: name another file", file=target,
                                 key=key)  # fmt: skip
            for inner, outer in ((real, there), (there, real)):
                if inner.startswith(outer + os.sep):
                    raise InputError(f"would lie within what {first} writes, or the other way "
                                     "round: name one elsewhere", file=target, key=key)  # fmt: skip
        self._targets[target] = key, added_to

    def check(self) -> None:
        """Raise where an output that is not written yet would replace what was read.

        Raises:
            InputError: it would.
        """
        there = {}
        for target, (key, added_to) in self._targets.items():
            try:
                found = target.stat()
            except (OSError, ValueError):
                continue
            if not added_to and (stat.S_ISREG(found.st_mode) or target.suffix == ".zarr"):
                there[target] = key, (found.st_dev, found.st_ino)
        if not there:
            return
        while self._new:
            path = self._new.pop()
            try:
                one = os.stat(path)
            except (OSError, ValueError):
                continue
            self._read[one.st_dev, one.st_ino] = path
        for target, (key, identity) in there.items():
            within = os.path.realpath(target) + os.sep
            if identity in self._read or (
                target.is_dir()
                and any(os.path.realpath(path).startswith(within) for path in self._read.values())
            ):
                raise InputError("would overwrite an input of this command", file=target, key=key)

    def written(self, target: str | Path) -> None:
        """An output is about to be written: checked now, and what is read of it later is no input.

        Args:
            target: any output, declared or not.

        Raises:
            InputError: as `check`.
        """
        self.check()
        self._targets.pop(Path(target), None)


guard = Guard()
