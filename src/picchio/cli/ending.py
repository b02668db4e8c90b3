"""Asked to end, by Ctrl-C or a signal, a command does within a moment, and tidies up first.

It imports next to nothing, so that it holds from the first moment.
"""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, NoReturn

# What compiles kernels crashes where it is left in the midst of it.
_NOT_LEFT = "llvmlite.binding"
_AGAIN = 0.05  # s
_GRACE = 0.6  # s for tidying up; then the process ends where it stands


class Terminated(BaseException):
    """The process is asked to end: whatever is half-written goes, as after Ctrl-C."""


_RAISED = {signal.SIGINT: KeyboardInterrupt, signal.SIGTERM: Terminated}
_TOLD = {signal.SIGINT: ("interrupted", 130), signal.SIGTERM: ("terminated", 143)}
STATUSES = tuple(status for _, status in _TOLD.values())


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
        self._heard_at = -1.0

    @contextmanager
    def obeyed(self, at_last: bool = False) -> Iterator[None]:
        """Within the block, signals to end are raised: KeyboardInterrupt or `Terminated`.

        Args:
            at_last: end the process where nobody has heard it a moment later, such as in the midst
                of a long call of compiled code.

        Returns:
            a context manager.
        """
        before = {n: signal.getsignal(n) for n in _RAISED}
        kept = {n: handler for n, handler in before.items() if handler is not signal.SIG_IGN}
        for number in kept:
            signal.signal(number, self._ask)
        if at_last and kept:
            self._guard()
        try:
            with self.meant():
                yield
        finally:
            self.heard()
            if at_last:
                self.last()
            else:
                for number, handler in kept.items():
                    signal.signal(number, handler)

    @contextmanager
    def meant(self) -> Iterator[None]:
        """Whatever fails within the block once it was asked to end, ends.

        A library that is interrupted in the midst of its import says that its schema is wrong.

        Returns:
            a context manager.
        """
        try:
            yield
        except Exception as error:
            if self._asked is None:
                raise
            raise _RAISED[self._asked] from error

    def heard(self) -> None:
        """It was dealt with: what comes now is to be finished."""
        with self._one:
            self._asked = None
            self._heard_at = time.monotonic()
        if hasattr(signal, "pthread_sigmask"):  # a last reminder comes now, or never
            signal.pthread_sigmask(signal.SIG_BLOCK, ())

    def told(self, error: BaseException) -> int:
        """Say that the command was asked to end, and ask for no more.

        Args:
            error: that came of it.

        Returns:
            the exit status.
        """
        number = signal.SIGTERM if isinstance(error, Terminated) else signal.SIGINT
        self.last()
        word, status = _TOLD[number]
        print(f"picchio: error: {word}", file=sys.stderr)
        return status

    def last(self) -> None:
        """It ends now: who asks for it once more is not answered."""
        for number in _RAISED:
            if signal.getsignal(number) == self._ask:
                signal.signal(number, signal.SIG_IGN)
        self.heard()

    def _guard(self) -> None:
        """A thread that hears of a signal even while compiled code runs, and ends the process."""
        asked, tells = os.pipe()
        os.set_blocking(tells, False)
        signal.set_wakeup_fd(tells, warn_on_full_buffer=False)

        def wait() -> None:
            while byte := os.read(asked, 1):
                if byte[0] in _TOLD:
                    woke = time.monotonic()
                    while self._heard_at < woke - _AGAIN:
                        time.sleep(0.5 * _AGAIN)
                        if time.monotonic() > woke + _GRACE:
                            word, status = _TOLD[signal.Signals(byte[0])]
                            with suppress(OSError):
                                os.write(2, f"picchio: error: {word}\n".encode())
                            end_at_once(status)

        threading.Thread(target=wait, name="picchio ending", daemon=True).start()

    def _ask(self, number: int, frame: FrameType | None) -> None:
        reminded, self._reminding = self._reminding, False
        once_more = reminded or self._asked is not None
        if once_more and (self._asked is None or _dealt_with(sys.exc_info()[1])):
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


def end_at_once(status: int) -> NoReturn:
    """End without waiting for threads and workers, which have nothing to say any more.

    Args:
        status: to exit with.
    """
    if "multiprocessing" in sys.modules:
        import multiprocessing

        for process in multiprocessing.active_children():
            process.kill()
    if (left := sys.modules.get("picchio.core.unfinished")) is not None:
        left.clear()
    with suppress(OSError, ValueError, RuntimeError):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(status)


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


def shown(kind: type[BaseException], error: BaseException, trace: Any) -> None:
    """Say nothing of a signal that compiled code met and dropped: it is raised again, and told.

    Args:
        kind: as `sys.excepthook` gets it, with the next two.
        error: what was raised.
        trace: where.
    """
    if not _dealt_with(error):
        sys.__excepthook__(kind, error, trace)


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
