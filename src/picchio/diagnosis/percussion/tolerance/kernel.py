"""Compiled: products of tall, single-precision columns with double-precision residuals."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True, fastmath=True)
def projected(columns, rows, out):
    """Sum over channels and samples of columns times rows.

    Args:
        columns: (c, m, k).
        rows: (c, n), n <= m.
        out: (k,), where it goes.
    """
    out[:] = 0.0
    for c in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            value = rows[c, j]
            for k in range(out.size):
                out[k] += columns[c, j, k] * value


@njit(cache=True, nogil=True, fastmath=True)
def taken_out(columns, weights, rows):
    """Rows less columns times weights, in place.

    Args:
        columns: (c, m, k).
        weights: (k,).
        rows: (c, n), n <= m.
    """
    for c in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            total = 0.0
            for k in range(weights.size):
                total += columns[c, j, k] * weights[k]
            rows[c, j] -= total
