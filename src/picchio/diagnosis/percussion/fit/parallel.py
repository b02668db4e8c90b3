"""Work on several cores, by processes that share this one's memory.

`worker_pool` maps functions over independent items; `parallel_records` has records predicted
where a search's steps depend on each other.
"""

from __future__ import annotations

import itertools
import multiprocessing
import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial
from multiprocessing.connection import Connection
from typing import Any

from picchio.core.arrays import FloatArray
from picchio.core.processes import end_with
from picchio.diagnosis.attempt import attempt
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Pin, Problem
from picchio.model.effects.effect import Effect

_MOST = 8
# Numbers of a residual (channels x samples, all records) below which sending costs what it saves.
_WORTH_SENDING = 10_000
_shared: dict[int, Mapping[str, Callable[[Any], Any]]] = {}
_numbers = itertools.count()


def worker_count(workers: int | None) -> int:
    """As many as are asked for; as many as cores where None, eight at most.

    One where a process can't be forked safely: not on Linux, or within such a process.
    """
    if sys.platform != "linux" or multiprocessing.current_process().daemon:
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
    """
    number, count = next(_numbers), worker_count(workers)
    pool: ProcessPoolExecutor | None = None
    if count > 1:
        _shared[number] = functions
        pool = ProcessPoolExecutor(
            count, multiprocessing.get_context("fork"), _start, (os.getpid(),)
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


def _start(parent: int) -> None:
    """In a forked process: Ctrl-C is for the parent, which ends this one; so does its death."""
    end_with(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _run(task: tuple[int, str, Any]) -> Any:
    number, name, item = task
    # Whatever shows warnings may have been in the middle of something when this was forked.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return attempt(name, partial(_shared[number][name], item))


@contextmanager
def parallel_records(problem: Problem) -> Iterator[None]:
    """Within the block, other processes predict their part of the records.

    They are forked, so they have the problem as it is now; which effects, which records and up to
    when is sent, residuals come back. Results are the same. Where there is one core, or no safe
    fork (not on Linux), nothing is shared.
    """
    count = worker_count(problem.workers) - 1
    if count < 1 or problem.helpers is not None:
        yield
        return
    helpers = _Helpers(problem, count)
    problem.helpers = helpers
    try:
        yield
    finally:
        problem.helpers = None
        helpers.close()


class _Helpers:
    """The processes, and what passes between them and this one."""

    def __init__(self, problem: Problem, count: int) -> None:
        self._problem, self._owner, self._count = problem, os.getpid(), count
        self._places = {record.name: i for i, record in enumerate(problem.records)}
        self._ends: list[Connection] = []
        self._processes: list[Any] = []
        self._start()

    def renew(self) -> None:
        """Start them anew: they have the problem as it is now."""
        if os.getpid() == self._owner:
            self.close()
            self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("fork")
        problem = self._problem
        for _ in range(self._count):
            mine, its = context.Pipe()
            self._ends.append(mine)
            # Were our ends open in it, it would not notice that we are gone.
            process = context.Process(
                target=_serve,
                args=(problem, its, list(self._ends), self._owner),
                daemon=True,
            )
            process.start()
            its.close()
            self._processes.append(process)

    def residuals(
        self, effects: Sequence[Effect], records: Sequence[MeasuredRecord], end: float | None
    ) -> list[FloatArray] | None:
        """(channels, m) of every record; None where sharing is not worth it or not possible."""
        parts = len(self._ends) + 1
        numbers = sum(len(r.values) * r.until(end).samples.count for r in records)
        known = all(r.name in self._places for r in records)
        if os.getpid() != self._owner or parts == 1 or not known or len(records) < parts:
            return None
        if numbers < _WORTH_SENDING:
            return None
        bounds = [len(records) * k // parts for k in range(parts + 1)]
        shares = [records[a:b] for a, b in zip(bounds[:-1], bounds[1:], strict=True)]
        pins = tuple(self._problem.pins)
        asked: list[Connection] = []
        told: list[Any] = []
        try:
            for connection, share in zip(self._ends, shares[1:], strict=True):
                places = [self._places[r.name] for r in share]
                connection.send((tuple(effects), places, end, pins))
                asked.append(connection)
            try:
                told.append(self._problem.own_residuals(effects, shares[0], end))
            finally:
                # Whatever happens here, what was asked for is taken, or it would answer the next.
                told += [connection.recv() for connection in asked]
        except (EOFError, OSError):  # one of them was killed: go on alone
            self.close()
            return None
        found: list[FloatArray] = []
        for answer in told:
            if isinstance(answer, Exception):
                raise answer
            found += answer
        return found

    def close(self) -> None:
        """Let them end."""
        for connection in self._ends:
            connection.close()
        for process in self._processes:
            process.join(timeout=1.0)
            if process.is_alive():
                process.kill()
        self._ends, self._processes = [], []


def _serve(
    problem: Problem, connection: Connection, others: Sequence[Connection], parent: int
) -> None:
    """Answer until the other end is closed."""
    _start(parent)
    for other in others:
        other.close()
    warnings.simplefilter("ignore")
    problem.helpers = None
    while True:
        try:
            effects, places, end, pins = connection.recv()
        except (EOFError, OSError):
            return
        answer: list[FloatArray] | Exception
        try:
            _pin(problem, pins)
            records = [problem.records[i] for i in places]
            answer = problem.own_residuals(effects, records, end)
        except Exception as error:
            answer = error
        try:
            connection.send(answer)
        except OSError:
            return


def _pin(problem: Problem, pins: Sequence[Pin]) -> None:
    """Pin what is pinned there, no more and no less."""
    same = 0
    for mine, wanted in zip(problem.pins, pins, strict=False):
        if mine != wanted:
            break
        same += 1
    while len(problem.pins) > same:
        problem.unpin()
    for pin in pins[same:]:
        problem.pin(pin)
