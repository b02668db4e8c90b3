"""Rainflow counting, whole or in chunks, with an explicit rule for the residue.

Closed cycles are found by the four-point rule. What is left, the residue, diverges and then
converges, and the caller chooses what to count of it:

- `half-cycles`: each range of the residue is half a cycle. The counts are those of ASTM E1049-85
  (2017), section 5.4.4. The default.
- `repeated`: the history is taken to repeat for ever, so the residue closes upon itself and every
  cycle is whole (ASTM E1049-85, section 5.4.5).
- `discarded`: the residue is dropped. Unsafe: the largest range is always in the residue, and a
  single decaying blow consists of nothing else.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from picchio.core.arrays import FloatArray, as_floats
from picchio.core.errors import InputError
from picchio.fatigue.counting.cycles import Cycles

Residue = Literal["half-cycles", "repeated", "discarded"]
RESIDUE_RULES: tuple[Residue, ...] = get_args(Residue)

_BLOCK = 1 << 15


def rainflow(history: npt.ArrayLike, residue: Residue = "half-cycles") -> Cycles:
    """Count the cycles of a history.

    Args:
        history: (n,) finite samples or turning points, any unit; no binning is done.
        residue: how cycles that do not close are counted; see the module.

    Returns:
        the cycles: closed ones first, in the order in which they close. A constant has none.

    Raises:
        InputError: empty, not 1-D, NaN or infinite samples, or an unknown residue rule.
    """
    counter = RainflowCounter()
    if np.size(history) == 0:
        raise InputError("is empty", key="history")
    counter.add(history)
    return counter.cycles(residue)


class RainflowCounter:
    """Counts a history that arrives in chunks; no cut between chunks loses or adds a cycle.

    Example:
        >>> counter = RainflowCounter()
        >>> for chunk in ([0.0, 2.0, 1.0], [1.5, -1.0]):
        ...     counter.add(chunk)
        >>> counter.cycles().range.tolist()
        [0.5, 2.0, 3.0]
    """

    def __init__(self) -> None:
        self._stack: FloatArray = np.empty(0)
        self._closed: list[tuple[FloatArray, FloatArray]] = []

    def add(self, chunk: npt.ArrayLike) -> None:
        """Count further samples.

        Args:
            chunk: (n,) finite samples that follow those given before; may be empty.

        Raises:
            InputError: not 1-D, NaN or infinite samples. The counter is unchanged then.
        """
        values = as_floats(chunk, "history") if np.size(chunk) else np.empty(0)
        if values.ndim != 1:
            raise InputError("must be one-dimensional", key="history", value=values.shape)
        if len(values) == 0:
            return
        from picchio.fatigue.counting.kernel import push

        values = np.ascontiguousarray(values)
        # Block by block through small arrays: fresh memory costs more than the counting.
        ranges, means = np.empty(_BLOCK), np.empty(_BLOCK)
        for start in range(0, len(values), _BLOCK):
            block = values[start : start + _BLOCK]
            depth = len(self._stack)
            stack = np.empty(depth + len(block))
            stack[:depth] = self._stack
            if depth + len(block) > 2 * _BLOCK:
                ranges, means = np.empty(len(stack) // 2), np.empty(len(stack) // 2)
            depth, closed = push(block, stack, depth, ranges, means)
            self._stack = stack[:depth].copy()
            if closed:
                self._closed.append((ranges[:closed].copy(), means[:closed].copy()))

    def cycles(self, residue: Residue = "half-cycles") -> Cycles:
        """The cycles counted so far, as if the history ended here. More may be added after.

        Args:
            residue: how cycles that do not close are counted; see the module.

        Raises:
            InputError: an unknown residue rule.
        """
        rest, last = _close(self._stack)
        outer = _count_residue(rest, residue)
        whole = [*self._closed, last]
        closed = sum(len(part[0]) for part in whole)
        count = np.ones(closed + len(outer))
        count[closed:] = outer.count
        return Cycles.trusted(
            np.concatenate([*(part[0] for part in whole), outer.range]),
            np.concatenate([*(part[1] for part in whole), outer.mean]),
            count,
        )

    def taken(self) -> Cycles:
        """The cycles that have closed, which are then forgotten: memory stays bounded.

        What `cycles` gives after is the rest.
        """
        closed, self._closed = [(np.empty(0), np.empty(0)), *self._closed], []
        ranges, means = (np.concatenate(part) for part in zip(*closed, strict=True))
        return Cycles.trusted(ranges, means, np.ones(ranges.size))

    @property
    def residue(self) -> FloatArray:
        """(r,) the turning points of the residue, as if the history ended here."""
        return _close(self._stack)[0]


def _close(stack: FloatArray) -> tuple[FloatArray, tuple[FloatArray, FloatArray]]:
    """The residue when the history ends at the stack's top, and the cycles this closes."""
    if len(stack) < 4:
        return stack.copy(), (np.empty(0), np.empty(0))
    from picchio.fatigue.counting.kernel import finish

    rest = stack.copy()
    ranges, means = np.empty(len(rest) // 2), np.empty(len(rest) // 2)
    depth, closed = finish(rest, len(rest), ranges, means)
    return rest[:depth], (ranges[:closed], means[:closed])


def _count_residue(rest: FloatArray, rule: Residue) -> Cycles:
    if rule not in RESIDUE_RULES:
        raise InputError("unknown residue rule", key="residue", value=rule, choices=RESIDUE_RULES)
    if rule == "discarded" or len(rest) < 2:
        return Cycles.none()
    ranges, means = np.abs(np.diff(rest)), 0.5 * (rest[1:] + rest[:-1])
    if rule == "half-cycles":
        return Cycles(ranges, means, np.full(len(ranges), 0.5))
    # Repeated: run the residue round from its maximum back to its maximum. Every cycle closes,
    # and of the loop's residue (maximum, minimum, maximum) the two halves are one cycle.
    start = int(np.argmax(rest))
    loop = RainflowCounter()
    loop.add(np.concatenate((rest[start:], rest[: start + 1])))
    inner = loop.cycles("discarded")
    top, bottom = float(rest.max()), float(rest.min())
    outer = Cycles(np.array([top - bottom]), np.array([(top + bottom) / 2]), np.ones(1))
    return inner + outer
