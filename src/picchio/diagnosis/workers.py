"""Work on several cores, by processes that share this one's memory."""

from __future__ import annotations

import itertools
import multiprocessing
import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial
from typing import Any

from picchio.core.processes import end_with
from picchio.diagnosis.attempt import attempt

_MOST = 8
_shared: dict[int, Mapping[str, Callable[[Any], Any]]] = {}
_numbers = itertools.count()
_within = False  # whether this is a process that was forked here


def worker_count(workers: int | None) -> int:
    """As many as are asked for; as many as cores where None, eight at most.

    One where a process can't be forked safely: not on Linux, or within such a process.

    Args:
        workers: as many are asked for.
    """
    if sys.platform != "linux" or multiprocessing.current_process().daemon or _within:
        return 1
    return min(len(os.sched_getaffinity(0)), _MOST) if workers is None else workers


@contextmanager
def worker_pool(
    workers: int | None, functions: Mapping[str, Callable[[Any], Any]]
) -> Iterator[Callable[[str, Iterable[Any]], list[Any]]]:
    """Within the block, a function that maps others over items: (name, items) -> results in order.

    The functions may use whatever exists when the block begins: processes are forked, so nothing
    of that is copied or sent. Items and results are. Where a process can't be forked safely (not
    on Linux, or within such a process), or one core is all there is, this one does the work itself.

    A function that fails gives None, see `attempt`.

    Args:
        workers: processes; as many as cores where None, eight at most.
        functions: name -> function of one item.

    Returns:
        a context manager.
    """
    number, count = next(_numbers), worker_count(workers)
    pool: ProcessPoolExecutor | None = None
    if count > 1:
        _shared[number] = functions
        pool = ProcessPoolExecutor(
            count, multiprocessing.get_context("fork"), begin_worker, (os.getpid(),)
        )

    def mapped(name: str, items: Iterable[Any]) -> list[Any]:
        todo = list(items)
        if pool is None or len(todo) < 2:
            return [attempt(name, partial(functions[name], item)) for item in todo]
        return list(pool.map(_run, [(number, name, item) for item in todo]))

    others = set(multiprocessing.active_children())
    try:
        yield mapped
    except BaseException:
        # Interrupted: what they are at is of no use any more.
        for process in set(multiprocessing.active_children()) - others:
            process.kill()
        raise
    finally:
        _shared.pop(number, None)
        if pool is not None:
            pool.shutdown(cancel_futures=True)


def begin_worker(parent: int) -> None:
    """In a forked process: Ctrl-C is for the parent, which ends this one; so does its death.

    It does its own work alone.

    Args:
        parent: its number.
    """
    global _within
    _within = True
    end_with(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _run(task: tuple[int, str, Any]) -> Any:
    number, name, item = task
    # Whatever shows warnings may have been in the middle of something when this was forked.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return attempt(name, partial(_shared[number][name], item))
