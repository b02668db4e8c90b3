"""Compiled whitening of coloured noise, sample by sample."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True)
def whiten(series, predictors, deviation, out):
    """The one-step prediction error of `series` (m,) over its standard deviation, into `out` (m,).

    predictors (p + 1, p): row k predicts from k samples back; deviation (p + 1,) is the standard
    deviation of its error.
    """
    order = predictors.shape[1]
    for i in range(series.size):
        known = min(i, order)
        left = series[i]
        for k in range(known):
            left -= predictors[known, k] * series[i - 1 - k]
        out[i] = left / deviation[known]
