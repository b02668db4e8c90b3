"""Independent work on all cores, by processes that share this one's memory."""

from __future__ import annotations

import itertools
import multiprocessing
import os
import sys
import warnings
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from types import TracebackType
from typing import Any, Self

_MOST = 8
_shared: dict[int, Mapping[str, Callable[[Any], Any]]] = {}
_numbers = itertools.count()


def cores() -> int:
    """How many this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def worker_count(workers: int | None) -> int:
    """As many as are asked for; as many as cores where None, eight at most.

    One where a process can't be forked safely: not on Linux, or within such a process.
    """
    if sys.platform != "linux" or multiprocessing.current_process().daemon:
        return 1
    return min(cores(), _MOST) if workers is None else workers


class Workers:
    """Maps functions over items; a `with` block is as long as the processes live.

    The functions may use whatever exists when the block begins: processes are forked, so nothing
    of that is copied or sent. Items and results are. Where a process can't be forked safely (not
    on Linux, or within such a process), or one core is all there is, this one does the work itself.

    Args:
        workers: processes; as many as cores where None, eight at most.
        functions: name -> function of one item.
    """

    def __init__(self, workers: int | None, functions: Mapping[str, Callable[[Any], Any]]) -> None:
        self._functions = functions
        self._number = next(_numbers)
        self._workers = worker_count(workers)
        self._pool: ProcessPoolExecutor | None = None

    def __enter__(self) -> Self:
        if self._workers > 1:
            _shared[self._number] = self._functions
            context = multiprocessing.get_context("fork")
            self._pool = ProcessPoolExecutor(self._workers, context)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        _shared.pop(self._number, None)
        if self._pool is not None:
            self._pool.shutdown(wait=kind is None, cancel_futures=True)

    def map(self, name: str, items: Iterable[Any]) -> list[Any]:
        """Results of one of the functions, in the items' order."""
        todo = list(items)
        if self._pool is None or len(todo) < 2:
            return [self._functions[name](item) for item in todo]
        return list(self._pool.map(_run, [(self._number, name, item) for item in todo]))


def _run(task: tuple[int, str, Any]) -> Any:
    number, name, item = task
    # Whatever shows warnings may have been in the middle of something when this was forked.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return _shared[number][name](item)
