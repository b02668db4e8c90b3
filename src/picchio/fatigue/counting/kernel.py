"""The compiled inner loops of rainflow counting. Importing this module loads numba."""

from __future__ import annotations

import numba
import numpy as np

from picchio.core.arrays import FloatArray


@numba.njit(cache=True, inline="always")
def _close(
    stack: FloatArray, depth: int, top: float, ranges: FloatArray, means: FloatArray, closed: int
) -> tuple[int, int]:
    """Take the cycles off the stack that a new top closes: the four-point rule."""
    while depth >= 4:
        b = stack[depth - 3]
        c = stack[depth - 2]
        inner = abs(b - c)
        if inner > abs(top - c) or inner > abs(stack[depth - 4] - b):
            break
        ranges[closed] = inner
        means[closed] = 0.5 * (b + c)
        closed += 1
        stack[depth - 3] = top
        depth -= 2
    return depth, closed


@numba.njit(cache=True)
def push(
    values: FloatArray,
    stack: FloatArray,
    depth: int,
    ranges: FloatArray,
    means: FloatArray,
) -> tuple[int, int]:
    """Feed samples to the four-point counter (Clormann and Seeger 1986; ASTM E1049's cycles).

    The stack holds the turning points that no cycle has used yet. Its top is provisional: it
    moves on while the samples go on in the same direction, and is closed against the stack when
    they turn. So it does not matter how a history is cut into chunks.

    Args:
        values: (n,) finite samples.
        stack: at least (depth + n,), the first `depth` in use.
        depth: how many are in use.
        ranges: at least ((depth + n) // 2,), filled.
        means: likewise.

    Returns:
        the new depth, and the number of cycles closed.
    """
    closed, first = 0, 0
    while depth < 2 and first < values.shape[0]:
        if depth == 0 or values[first] != stack[0]:
            stack[depth] = values[first]
            depth += 1
        first += 1
    if depth < 2:
        return depth, closed
    top = stack[depth - 1]
    rising = top > stack[depth - 2]
    for i in range(first, values.shape[0]):
        value = values[i]
        if rising:
            if value >= top:
                top = value
                continue
        elif value <= top:
            top = value
            continue
        stack[depth - 1] = top
        depth, closed = _close(stack, depth, top, ranges, means, closed)
        stack[depth] = value
        depth += 1
        top = value
        rising = not rising
    stack[depth - 1] = top
    return depth, closed


@numba.njit(cache=True)
def finish(stack: FloatArray, depth: int, ranges: FloatArray, means: FloatArray) -> tuple[int, int]:
    """Close the provisional top, at the end of a history. Arguments and result as `push`."""
    top = stack[depth - 1] if depth else np.nan
    return _close(stack, depth, top, ranges, means, 0)
