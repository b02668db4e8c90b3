"""What a command is doing, as a bar on stderr: for work over two seconds, on a terminal alone."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

PATIENCE = 2.0  # s
_FIRST = "reading the inputs (a first run compiles for a minute)"


class Waiting:
    """The bar of the command that runs; there is one for all of a command's steps."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._timer: threading.Timer | None = None
        self._bar: Progress | None = None
        self._task: TaskID | None = None
        self._state: tuple[str, int, int | None] = (_FIRST, 0, None)

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Within the block a bar appears once two seconds have passed."""
        if sys.stderr.isatty():
            self._state = (_FIRST, 0, None)
            self._timer = threading.Timer(PATIENCE, self._show)
            self._timer.daemon = True
            self._timer.start()
        try:
            yield
        finally:
            self.end()

    def say(self, what: str, done: int = 0, total: int | None = None) -> None:
        """Tell what is done now, and how much of it.

        Args:
            what: in a word or two.
            done: steps.
            total: steps in all; None where nobody knows.
        """
        with self._lock:
            self._state = (what, done, total)
            if self._bar is not None and self._task is not None:
                self._bar.update(self._task, total=total, **self._told())

    def end(self) -> None:
        """Take the bar away: results follow, or an error."""
        timer, self._timer = self._timer, None
        if timer is not None:
            timer.cancel()
        with self._lock:
            bar, self._bar = self._bar, None
        if bar is not None:
            bar.stop()

    def _told(self) -> dict[str, Any]:
        what, done, total = self._state
        count = "" if total is None else f"{done}/{total}"
        return {"description": what, "completed": done, "count": count}

    def _show(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
        from rich.progress import TimeRemainingColumn as Left

        bar = Progress(
            TextColumn("{task.description}", markup=False), BarColumn(bar_width=24),
            TextColumn("{task.fields[count]}"), TimeElapsedColumn(), Left(),
            console=Console(stderr=True), transient=True, redirect_stdout=False,
        )  # fmt: skip
        with self._lock:
            if self._timer is None:  # it has ended meanwhile
                return
            told = self._told()
            self._task = bar.add_task(told.pop("description"), total=self._state[2], **told)
            self._bar = bar
            bar.start()


waiting = Waiting()
