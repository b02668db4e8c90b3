"""Processes and threads of our own: what they import, how long they live, how many there are."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

_PR_SET_PDEATHSIG = 1  # linux/prctl.h
_PACKAGES = str(Path(__file__).resolve().parents[2])
# What a child does first: its search path is ours, not one that begins with the current folder,
# where a `numpy.py` beside the data would be taken for the package.
_BEGIN = "import sys; sys.path[:] = sys.argv.pop(1).split({sep!r}); "
_LIMIT = "import resource; resource.setrlimit(resource.RLIMIT_AS, ({memory}, {memory})); "


def memory_size() -> float:
    """How much memory this machine has.

    Returns:
        bytes; infinite where the system does not say.
    """
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, OSError, ValueError):
        return float("inf")


def search_path() -> list[str]:
    """The folders that a child process imports from: ours, without the current folder."""
    here = os.path.realpath(os.curdir)
    kept = [folder for folder in sys.path if folder and os.path.realpath(folder) != here]
    return kept if _PACKAGES in kept else [*kept, _PACKAGES]


def start_python(code: str, arguments: Sequence[str], *, memory: int) -> subprocess.Popen[bytes]:
    """Run some lines of Python in a process of their own, with bounded memory.

    Args:
        code: the lines; `sys.argv[1:]` holds the arguments.
        arguments: of the process.
        memory: bytes of its address space, on Linux.

    Returns:
        the process; `stdout` is an unbuffered pipe, what it says of errors goes nowhere.
    """
    begin = _BEGIN.format(sep=os.pathsep)
    if sys.platform == "linux":  # elsewhere the address space has no such limit
        begin += _LIMIT.format(memory=memory)
    begin += f"from picchio.core.processes import end_with; end_with({os.getpid()}); "
    return subprocess.Popen(
        # -I: neither the current folder nor the environment's folders are searched (implies -P)
        [sys.executable, "-I", "-c", begin + code, os.pathsep.join(search_path()), *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        bufsize=0,
        # Each thread of the linear algebra takes address space; a reader needs one.
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )


def end_with(parent: int) -> None:
    """Have this process end when its parent does, however that ends (Linux).

    Args:
        parent: process number, as `os.getpid()` in the parent.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it ended before we asked
            os._exit(1)


@contextmanager
def safe_start() -> Iterator[None]:
    """Within the block, Python processes that others start search no current folder either.

    Returns:
        a context manager.
    """
    path, before = list(sys.path), dict(os.environ)
    sys.path[:] = search_path()
    os.environ["PYTHONSAFEPATH"] = "1"
    # Of a command that was interrupted multiprocessing says that it left something behind.
    os.environ["PYTHONWARNINGS"] = "ignore:resource_tracker"
    try:
        yield
    finally:
        sys.path[:] = path
        os.environ.clear()
        os.environ.update(before)


def on_threads(kernel: Callable[..., None], count: int, span: int, *arguments: Any) -> None:
    """A compiled kernel on rows of arrays, over the cores; it must let other threads run.

    Numba's own threads wait for each other at full speed, and a loop for them takes ten seconds to
    compile. Rows are parted alike however many threads there are, so that results are, too.

    Args:
        kernel: called with the first row, the one after the last, and the arguments, by several
            threads at once.
        count: how many rows there are.
        span: rows that a thread takes at a time; up to so many are done by this one.
        *arguments: the same for all, what it writes to among them.
    """
    from numba import get_num_threads

    parts = [(first, min(first + span, count)) for first in range(0, count, span)]
    threads = min(len(parts), get_num_threads()) if len(parts) > 1 else 1
    if threads == 1:
        kernel(0, count, *arguments)
        return
    left = iter(parts)  # of which each thread takes the next

    def work() -> None:
        for part in left:
            kernel(*part, *arguments)

    with ThreadPoolExecutor(threads) as pool:
        for done in [pool.submit(work) for _ in range(threads)]:
            done.result()


@contextmanager
def one_thread() -> Iterator[None]:
    """Within the block, linear algebra uses one thread a process; forked processes do as well.

    The matrices of a robot are small, and several threads only wait for each other: a diagnosis on
    an idle machine of two cores takes a quarter longer with them, on a busy one several times.

    Returns:
        a context manager, or a decorator of a function that computes.
    """
    with _linear_algebra().limit(limits=1, user_api="blas"):
        yield


@cache
def _linear_algebra() -> Any:
    """The libraries' threads; looking for them takes 5 ms."""
    import scipy.linalg  # noqa: F401  # a library that is not loaded yet cannot be limited
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
