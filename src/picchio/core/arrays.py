"""Array types for signatures (shapes and units are in the docstrings), and checked conversion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from picchio.core.errors import InputError

# NumPy's stubs lose the precise dtype in most arithmetic, so the names promise it, not the types.
FloatArray: TypeAlias = npt.NDArray[Any]
ComplexArray: TypeAlias = npt.NDArray[Any]
IndexArray: TypeAlias = npt.NDArray[Any]
BoolArray: TypeAlias = npt.NDArray[Any]
TextArray: TypeAlias = npt.NDArray[Any]
Vector: TypeAlias = tuple[float, float, float]


def symmetric(six: Sequence[float]) -> FloatArray:
    """The symmetric matrix (3, 3) of six numbers.

    Args:
        six: xx, xy, xz, yy, yz, zz.
    """
    xx, xy, xz, yy, yz, zz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def as_floats(values: Any, key: str, *, finite: bool = True) -> FloatArray:
    """`values` as float64, refusing anything but real numbers; not copied if float64 already.

    Args:
        values: a scalar or an array-like of real numbers.
        key: how to name it in the error.
        finite: refuse infinities as well as NaN.

    Raises:
        InputError: not real numbers, NaN, or infinite where that is refused.
    """
    try:
        raw = np.asarray(values)
        if raw.dtype.kind not in "iufb" and not (raw.dtype.kind == "O" and raw.size):
            raise TypeError
        array = np.asarray(raw, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("must be real numbers", key=key, value=values) from None
    bad = ~np.isfinite(array) if finite else np.isnan(array)
    if bad.any():
        where = "" if array.ndim == 0 else f" at index {int(np.flatnonzero(bad)[0])}"
        raise InputError(f"must be finite{where}", key=key, value=float(array[bad].flat[0]))
    return array
