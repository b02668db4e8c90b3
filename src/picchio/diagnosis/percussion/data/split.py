"""Which records a model is fitted to, and which it is judged on."""

from __future__ import annotations

from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.data.record import MeasuredRecord

# One pose of so many is held out.
_EVERY = 3

Split = tuple[list[MeasuredRecord], list[MeasuredRecord]]


def held_out(problem: Problem) -> list[Split]:
    """Ways to choose records to fit and records held out, the usual one first.

    Whole poses are held out, every third; of fewer poses every third record; of fewer records none.
    """
    ways: list[Split] = []
    for offset in reversed(range(_EVERY)):
        if problem.n_poses >= _EVERY:
            kept = [r for r in problem.records if r.pose % _EVERY == offset]
        elif len(problem.records) >= _EVERY:
            kept = problem.records[offset::_EVERY]
        else:
            return [(list(problem.records), [])]
        ways.append(([r for r in problem.records if r not in kept], kept))
    return ways
