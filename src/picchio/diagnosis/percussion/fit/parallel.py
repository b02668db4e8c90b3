"""Records predicted by several processes, where a search's steps depend on each other."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

from picchio.core.arrays import FloatArray
from picchio.core.workers import Worker, answered, worker_count
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Pin, Problem
from picchio.model.effects.effect import Effect

# Numbers of a residual (channels x samples, all records) below which sending costs what it saves.
_WORTH_SENDING = 10_000


@contextmanager
def parallel_records(problem: Problem) -> Iterator[None]:
    """Within the block, other processes predict their part of the records.

    They are forked, so they have the problem as it is now; which effects, which records and up to
    when is sent, residuals come back. Results are the same. Where there is one core, or no safe
    fork (not on Linux), nothing is shared.

    Args:
        problem: whose records.

    Returns:
        a context manager.
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
        self._workers: list[Worker] = []
        self._broken = False

    def renew(self) -> None:
        """Have the problem as it is from now on: they start anew where they are next asked."""
        if os.getpid() == self._owner:
            self.close()
            self._broken = False

    def residuals(
        self, effects: Sequence[Effect], records: Sequence[MeasuredRecord], end: float | None
    ) -> list[FloatArray] | None:
        """(channels, m) of every record; None where sharing is not worth it or not possible."""
        return self._told("own_residuals", (tuple(effects),), records, end)

    def changes(
        self,
        effects: Sequence[Effect],
        pairs: Sequence[tuple[Sequence[Effect], Sequence[Effect]]],
        records: Sequence[MeasuredRecord],
        end: float | None,
    ) -> list[FloatArray | None] | None:
        """(pairs, channels, m) or None of every record; None as `residuals`."""
        return self._told("own_changes", (tuple(effects), pairs), records, end)

    def _told(
        self,
        what: str,
        given: tuple[Any, ...],
        records: Sequence[MeasuredRecord],
        end: float | None,
    ) -> list[Any] | None:
        """What a method of the problem tells of every record, each process asked for its share."""
        parts = 1 if self._broken else self._count + 1
        numbers = sum(len(r.values) * r.until(end).samples.count for r in records)
        known = all(r.name in self._places for r in records)
        if os.getpid() != self._owner or parts == 1 or not known or len(records) < parts:
            return None
        if numbers < _WORTH_SENDING:
            return None
        while len(self._workers) < self._count:
            self._workers.append(Worker(self._answer))
        bounds = [len(records) * k // parts for k in range(parts + 1)]
        shares = [records[a:b] for a, b in zip(bounds[:-1], bounds[1:], strict=True)]
        pins = tuple(self._problem.pins)
        try:
            for worker, share in zip(self._workers, shares[1:], strict=True):
                places = [self._places[r.name] for r in share]
                worker.connection.send((what, given, places, end, pins))
            own = getattr(self._problem, what)
            told = [answered(partial(own, *given, shares[0], end))]
            # Whatever failed here, what was asked for is taken, or it would answer the next.
            told += [worker.connection.recv() for worker in self._workers]
        except (EOFError, OSError):  # one of them was killed: go on alone
            self.close()
            self._broken = True
            return None
        except BaseException:  # interrupted
            self.close()
            raise
        found: list[Any] = []
        for answer in told:
            if isinstance(answer, Exception):
                raise answer
            found += answer
        return found

    def _answer(self, asked: Any) -> list[Any]:
        """In a worker."""
        what, given, places, end, pins = asked
        self._problem.helpers = None
        _pin(self._problem, pins)
        records = [self._problem.records[i] for i in places]
        told: list[Any] = getattr(self._problem, what)(*given, records, end)
        return told

    def close(self) -> None:
        """Ask no more of them."""
        for worker in self._workers:
            worker.end()
        self._workers = []


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
