"""Asked to end, by Ctrl-C or a signal, a command does within a moment, and tidies up first."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

# What compiles kernels crashes where it is left in the midst of it.
_NOT_LEFT = "llvmlite.binding"
_AGAIN = 0.05  # s


class Terminated(BaseException):
    """The process is asked to end: whatever is half-written goes, as after Ctrl-C."""


_RAISED = {signal.SIGINT: KeyboardInterrupt, signal.SIGTERM: Terminated}


class Ending:
    """What was asked, until somebody has heard it.

    It is raised, as Python does with Ctrl-C. But what is raised in a destructor, or in a callback
    of compiled code, is dropped, and work goes on. So it is raised again until it is heard; never
    in the midst of an `except` or a `finally` that deals with it.
    """

    def __init__(self) -> None:
        self._asked: signal.Signals | None = None
        self._reminding = False
        self._one = threading.Lock()

    @contextmanager
    def obeyed(self) -> Iterator[None]:
        """Within the block, signals to end are raised: KeyboardInterrupt or `Terminated`.

        Returns:
            a context manager.
        """
        before = {n: signal.getsignal(n) for n in _RAISED}
        kept = {n: handler for n, handler in before.items() if handler is not signal.SIG_IGN}
        for number in kept:
            signal.signal(number, self._ask)
        try:
            yield
        finally:
            self.heard()
            for number, handler in kept.items():
                signal.signal(number, handler)

    def heard(self) -> None:
        """It was dealt with: what comes now is to be finished."""
        with self._one:
            self._asked = None
        if hasattr(signal, "pthread_sigmask"):  # a last reminder comes now, or never
            signal.pthread_sigmask(signal.SIG_BLOCK, ())

    def _ask(self, number: int, frame: FrameType | None) -> None:
        reminded, self._reminding = self._reminding, False
        if reminded and (self._asked is None or _dealt_with(sys.exc_info()[1])):
            return
        if self._asked is None:
            self._asked = signal.Signals(number)
            # Without the locks of `threading`, which may be held by what was interrupted.
            _thread.start_new_thread(self._remind, ())
        if _may_be_left(frame):
            raise _RAISED[self._asked]

    def _remind(self) -> None:
        while True:
            time.sleep(_AGAIN)
            with self._one:
                if self._asked is None:
                    return
                self._reminding = True
                if hasattr(signal, "pthread_kill"):  # which wakes what waits, too
                    signal.pthread_kill(threading.main_thread().ident or 0, self._asked)
                else:
                    _thread.interrupt_main(self._asked)


def _dealt_with(error: BaseException | None) -> bool:
    while error is not None:
        if isinstance(error, (KeyboardInterrupt, Terminated)):
            return True
        error = error.__context__
    return False


def _may_be_left(frame: FrameType | None) -> bool:
    while frame is not None:
        if str(frame.f_globals.get("__name__")).startswith(_NOT_LEFT):
            return False
        frame = frame.f_back
    return True


def drop(met: Any) -> None:
    """Say nothing of what Python can't raise, such as an error in a destructor, but for our own.

    A library's complaint, such as that of a file that never opened, is of no use to anybody.

    Args:
        met: as `sys.unraisablehook` gets it.
    """
    ours = str(getattr(met.object, "__module__", "picchio")).partition(".")[0] == "picchio"
    if ours and not _dealt_with(met.exc_value):
        sys.__unraisablehook__(met)


ending = Ending()
