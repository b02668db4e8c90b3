from __future__ import annotations

import pytest

from picchio.fatigue.counting.counter import rainflow


@pytest.fixture(autouse=True, scope="session")
def _compiled() -> None:
    """Compile once, so that hypothesis times the tests and not numba."""
    rainflow([0.0, 3.0, 1.0, 2.0, 0.0], "repeated")
