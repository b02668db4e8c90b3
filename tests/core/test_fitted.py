"""Fitted parameters by name, and their report."""

from __future__ import annotations

import math

import numpy as np
import pytest

import picchio
from picchio.core.fitted import FittedValue, Parameters


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (FittedValue("k", 2e5, 1e3, "N*m/rad", 0.0), "2e+05 +/- 1e+03 N*m/rad (0.50%)"),
        (
            FittedValue("scale", 0.7, 0.007, "1", 0.1, 10.0),
            "0.7 +/- 0.007 (1.00%), within 0.1 to 10",
        ),
        (FittedValue("x", 0.0, 0.1, "m"), "0 +/- 0.1 m"),
        (FittedValue("knee", 2e6, math.nan, "cycles", vary=False), "2e+06 cycles (fixed)"),
    ],
)
def test_a_value_is_told_with_error_bounds_and_whether_it_was_fixed(
    value: FittedValue, text: str
) -> None:
    assert str(value) == text
    params = Parameters([value])
    assert params[value.name] is value and params.to_frame().loc[value.name, "vary"] == value.vary
    with pytest.raises(picchio.InputError, match=f"no such parameter.*{value.name}"):
        params["none"]


@pytest.mark.parametrize("knee", [True, False])
def test_an_sn_fit_has_lmfits_names(knee: bool) -> None:
    rng = np.random.default_rng(2)
    stress = np.repeat([300e6, 340e6, 380e6, 420e6], 6)
    cycles = 1e6 * (stress / 300e6) ** -9.0 * np.exp(0.3 * rng.standard_normal(24))
    failed = np.ones(24, bool)
    if knee:
        stress, cycles = np.append(stress, [250e6] * 4), np.append(cycles, [1e7] * 4)
        failed = np.append(failed, [False] * 4)
    fit = picchio.fit_sn(picchio.SNTests(stress, cycles, failed), knee=knee)
    assert fit.params["slope"].value == fit.slope.value
    assert fit.slope.low < fit.slope.value - 0.5 * fit.params["slope"].stderr
    assert fit.params["knee"].vary == knee
    lines = fit.fit_report().splitlines()
    assert len(lines) == 1 + len(fit.params) and ("(fixed)" in fit.fit_report()) != knee
