"""Compiled: products of tall, single-precision columns with double-precision residuals."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np
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


@njit(cache=True, nogil=True, fastmath=True)
def across(columns, jacobian, out):
    """Sum over channels and samples of a Jacobian's columns times columns.

    Args:
        columns: (c, m, k).
        jacobian: (c m, n).
        out: (n, k), where it goes.
    """
    out[:] = 0.0
    for c in range(columns.shape[0]):
        for j in range(columns.shape[1]):
            for n in range(out.shape[0]):
                value = jacobian[c * columns.shape[1] + j, n]
                for k in range(out.shape[1]):
                    out[n, k] += columns[c, j, k] * value


@njit(cache=True, nogil=True, fastmath=True)
def less_taken_up(columns, first, jacobian, taken):
    """Columns less a Jacobian times what each takes up of them, in place.

    Args:
        columns: (c, m, first + k), of which the last k change.
        first: how many stay.
        jacobian: (c m, n).
        taken: (n, k).
    """
    row = np.empty(taken.shape[1])
    for c in range(columns.shape[0]):
        for j in range(columns.shape[1]):
            row[:] = 0.0
            for n in range(taken.shape[0]):
                value = jacobian[c * columns.shape[1] + j, n]
                for k in range(row.size):
                    row[k] += value * taken[n, k]
            for k in range(row.size):
                columns[c, j, first + k] -= row[k]
