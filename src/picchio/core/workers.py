"""Work on several cores, by processes that share this one's memory."""

from __future__ import annotations

import math
import mmap
import multiprocessing
import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing.connection import Connection, wait
from typing import Any, TypeVar

import numpy as np

from picchio.core.processes import end_with

_MOST = 8  # processes of one pool, unless more are asked for: memory and pipes have their ends
_ASKING = (signal.SIGINT, signal.SIGTERM)  # a process to end
Done = TypeVar("Done")
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


class Worker:
    """A process forked from this one, which has whatever exists now, and answers what it is sent.

    Each has a pipe of its own: one that is killed in the midst of an answer leaves nothing half
    read or locked that another would wait for. It ends with this process, at the latest.
    """

    def __init__(self, answer: Callable[[Any], Any]) -> None:
        """Start it.

        Args:
            answer: called in it with what was sent; what it returns comes back, as an error does.
        """
        context = multiprocessing.get_context("fork")
        self.connection, its = context.Pipe()
        self.process = context.Process(
            target=_serve, args=(answer, its, self.connection, os.getpid()), daemon=True
        )
        # What asks this process to end is heard a moment later: the new one knows by then that
        # it is not meant.
        held = signal.pthread_sigmask(signal.SIG_BLOCK, _ASKING)
        try:
            self.process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, held)
            its.close()

    def end(self) -> None:
        """Whatever it is at is of no use any more."""
        self.connection.close()
        self.process.kill()
        self.process.join()


def shared_array(shape: tuple[int, ...], dtype: type[np.generic]) -> np.ndarray:
    """Zeros that processes forked from now on may write for this one to read.

    Args:
        shape: of the array.
        dtype: of its numbers.

    Returns:
        the array, on memory of its own.
    """
    count = math.prod(shape)
    memory = mmap.mmap(-1, max(count * np.dtype(dtype).itemsize, 1))
    return np.frombuffer(memory, dtype, count).reshape(shape)


def answered(call: Callable[[], Any]) -> Any:
    """What a call returns, or the error that it raises.

    Args:
        call: may fail.
    """
    try:
        return call()
    except Exception as error:
        return error


def _serve(
    answer: Callable[[Any], Any], connection: Connection, other: Connection, parent: int
) -> None:
    global _within
    _within = True
    end_with(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends this one
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _ASKING)
    other.close()
    # Whatever shows warnings may have been in the middle of something when this was forked.
    warnings.simplefilter("ignore")
    if "numba" in sys.modules:
        sys.modules["numba"].set_num_threads(1)  # each core has a process already
    while True:
        try:
            asked = connection.recv()
        except (EOFError, OSError):
            return
        try:
            connection.send(answered(partial(answer, asked)))
        except OSError:
            return


@contextmanager
def worker_pool(
    workers: int | None, functions: Mapping[str, Callable[[Any], Any]]
) -> Iterator[Callable[[str, Iterable[Any]], list[Any]]]:
    """Within the block, a function that maps others over items: (name, items) -> results in order.

    The functions may use whatever exists when the block begins: processes are forked, so nothing
    of that is copied or sent. Items and results are. Where a process can't be forked safely (not
    on Linux, or within such a process), or one core is all there is, this one does the work itself;
    so it does with what is left where one is killed.

    An error of a function is raised here.

    Args:
        workers: processes; as many as cores where None, eight at most.
        functions: name -> function of one item.

    Returns:
        a context manager.
    """
    alone = worker_count(workers) < 2
    pool: list[Worker] = []

    def run(asked: tuple[str, Any]) -> Any:
        name, item = asked
        return functions[name](item)

    def mapped(name: str, items: Iterable[Any]) -> list[Any]:
        nonlocal alone
        todo = [(name, item) for item in items]
        if alone or len(todo) < 2:
            return [run(asked) for asked in todo]
        while len(pool) < worker_count(workers):
            pool.append(Worker(run))
        told = dict(_shared_out(todo, pool))
        # Who is killed is not replaced: memory may be what was lacking.
        alone = len(told) < len(todo)
        return [_given(told[k]) if k in told else run(asked) for k, asked in enumerate(todo)]

    try:
        yield mapped
    finally:
        for worker in pool:
            worker.end()


def as_done(
    function: Callable[[Any], Done], items: Sequence[Any], workers: int | None
) -> Iterator[Done]:
    """What a function makes of each item, as soon as it is there; as of `worker_pool`.

    Args:
        function: of one item; its error is raised here.
        items: any number.
        workers: processes; as many as cores where None, eight at most.

    Returns:
        an iterator of results, in any order.
    """
    count = min(worker_count(workers), len(items))
    pool = [Worker(function) for _ in range(count)] if count > 1 else []
    left = set(range(len(items)))
    try:
        for place, answer in _shared_out(items, pool):
            left.discard(place)
            yield _given(answer)
    finally:
        for worker in pool:
            worker.end()
    for place in sorted(left):
        yield function(items[place])


def _given(answer: Any) -> Any:
    if isinstance(answer, Exception):
        raise answer
    return answer


def _shared_out(todo: Sequence[Any], pool: list[Worker]) -> Iterator[tuple[int, Any]]:
    """The place of each and what is answered to it; whoever is free is sent the next.

    Not all are answered where a worker is killed.
    """
    at: dict[Any, int] = {}  # which each connection was sent
    left = iter(range(len(todo)))

    def send(connection: Connection) -> None:
        for place in left:
            at[connection] = place
            connection.send(todo[place])
            return

    for worker in pool:
        with suppress(OSError):
            send(worker.connection)
    while at:
        ready: list[Any] = wait(list(at))
        for connection in ready:
            place = at.pop(connection)
            try:
                answer = connection.recv()
            except (EOFError, OSError):
                continue
            with suppress(OSError):
                send(connection)
            yield place, answer
