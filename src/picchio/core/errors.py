"""The errors and warnings that picchio raises on purpose.

Every message is one line that names the file, the key, the value that is wrong and the
valid choices, so that a user can mend the input without reading a traceback.
"""

from __future__ import annotations

import difflib
import sys
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

_NOT_GIVEN = object()
_MOST_CHOICES = 12
_LONGEST = 1500  # characters of a message, which may quote a damaged file
# Modules whose lines are none of the user's; contextlib's are between decorated functions.
_OURS = ("picchio", "contextlib")
_listening: ContextVar[tuple[list[str], ...]] = ContextVar("_listening", default=())
_holding: ContextVar[list[str] | None] = ContextVar("_holding", default=None)


class PicchioError(Exception):
    """Root of every error that picchio raises on purpose."""


class PicchioWarning(UserWarning):
    """Something the user should know, that does not stop the work."""


def warn_user(message: str) -> None:
    """A PicchioWarning at the line, outside picchio, that led to it.

    Args:
        message: a sentence without a full stop.
    """
    if (kept := _holding.get()) is not None:
        kept.append(message)
        return
    for said in _listening.get():
        if message not in said:
            said.append(message)
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_globals["__name__"].split(".")[0] in _OURS:
        level, frame = level + 1, frame.f_back
    warnings.warn(message, PicchioWarning, stacklevel=level)


@contextmanager
def gathered() -> Iterator[list[str]]:
    """Every warning of picchio meanwhile, each once; they are raised all the same."""
    said: list[str] = []
    token = _listening.set((*_listening.get(), said))
    try:
        yield said
    finally:
        _listening.reset(token)


@contextmanager
def held_back() -> Iterator[list[str]]:
    """Every warning of picchio meanwhile, none of them raised: the caller says what matters."""
    kept: list[str] = []
    token = _holding.set(kept)
    try:
        yield kept
    finally:
        _holding.reset(token)


class OutputError(PicchioError):
    """The machine failed: a full or read-only disk, a missing permission, a lock, memory.

    Args:
        problem: what went wrong, without a full stop.
        file: that could not be written.
    """

    def __init__(self, problem: str, *, file: str | Path) -> None:
        self.problem, self.file = problem, str(file)
        super().__init__(f"{self.file}: {problem}")


class InputError(PicchioError):
    """Bad input: a file, a key, a value or an argument.

    Args:
        problem: what is wrong, without a full stop.
        file: the file that holds it.
        key: the dotted key, joint, frame or option that is wrong.
        value: the value found there.
        choices: what would have been valid; close matches come first.
        hint: what to do.
    """

    def __init__(
        self,
        problem: str,
        *,
        file: str | Path | None = None,
        key: str | None = None,
        value: Any = _NOT_GIVEN,
        choices: Iterable[str] | None = None,
        hint: str | None = None,
    ) -> None:
        self.problem = problem
        self.file = str(file) if file is not None else None
        self.key = key
        self.value = None if value is _NOT_GIVEN else value
        self.choices = tuple(choices) if choices is not None else None
        self.hint = hint
        super().__init__(self._line(value))

    def placed(self, *, file: str | Path | None = None, key: str | None = None) -> InputError:
        """The same error, told with the file or key that only the caller knows.

        Args:
            file: that holds what is wrong.
            key: that is wrong.
        """
        value: dict[str, Any] = {} if self.value is None else {"value": self.value}
        return InputError(self.problem, file=file or self.file, key=key or self.key,
                          choices=self.choices, hint=self.hint, **value)  # fmt: skip

    def _line(self, value: Any) -> str:
        place = [part for part in (self.file, self.key) if part]
        line = (": ".join(place) + ": " if place else "") + self.problem
        if value is not _NOT_GIVEN:
            line += f", got {shorten(value)}"
        if self.choices is not None:
            line += "; " + describe_choices(value, self.choices)
        if self.hint:
            line += f"; {self.hint}"
        line = " ".join(line.split())
        return line if len(line) <= _LONGEST else line[: _LONGEST - 3] + "..."


def shorten(value: Any, width: int = 80) -> str:
    """The value's repr, cut to `width` characters and to one line."""
    text = " ".join(repr(value).split())
    return text if len(text) <= width else text[: width - 3] + "..."


def describe_choices(value: Any, choices: Iterable[str]) -> str:
    """A sentence part that lists the valid choices, the likely one first."""
    names = [str(choice) for choice in choices]
    if not names:
        return "there are none to choose from"
    lowered = {name.lower(): name for name in reversed(names)}
    close = difflib.get_close_matches(str(value).lower(), lowered, n=1, cutoff=0.6)
    shown = ", ".join(names[:_MOST_CHOICES])
    more = f" and {len(names) - _MOST_CHOICES} more" if len(names) > _MOST_CHOICES else ""
    meant = f"did you mean {lowered[close[0]]!r}? " if close else ""
    return f"{meant}valid: {shown}{more}"
