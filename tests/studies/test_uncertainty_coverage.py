"""The stated sampling intervals hold what a plain Monte Carlo of 100,000 draws finds."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import uncertainty  # the benchmark, which prints the whole table


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::picchio.core.errors.PicchioWarning")
def test_sampling_intervals_cover_the_plain_monte_carlo() -> None:
    table = uncertainty.coverage(["fanuc_like_3dof"], seeds=20, samples=512)
    # 60 intervals at 95 %: as few as 52 happen once in 100 times.
    assert np.mean(list(table["fanuc_like_3dof"].values())) >= 52 / 60
