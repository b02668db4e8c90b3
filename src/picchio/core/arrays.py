"""Names for array types in signatures; the shapes and units stand in the docstrings."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy.typing as npt

# NumPy's stubs lose the precise dtype in most arithmetic, so the names promise it, not the types.
FloatArray: TypeAlias = npt.NDArray[Any]
ComplexArray: TypeAlias = npt.NDArray[Any]
IndexArray: TypeAlias = npt.NDArray[Any]
BoolArray: TypeAlias = npt.NDArray[Any]
