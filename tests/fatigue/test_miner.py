from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from picchio.core.errors import InputError
from picchio.fatigue.counting.counter import rainflow
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.miner import damage, life, peak_damage, utilisation
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.sn.library import load_sn_curve

CURVE = SNCurve(name="c", strength=200e6, cycles=1e6, slopes=(8.0,), knees=(1e6,))

stresses = st.lists(st.floats(-6e8, 6e8), min_size=1, max_size=40)


def cycles_of(amplitudes: list[float], counts: list[float]) -> Cycles:
    zero = np.zeros(len(amplitudes))
    return Cycles(2.0 * np.array(amplitudes), zero, np.array(counts))


def test_blocks_by_hand() -> None:
    # Two blocks above the limit and one below: 1000/N1 + 500/N2 + 0.
    cycles = cycles_of([400e6, 300e6, 150e6], [1000.0, 500.0, 1e9])
    expected = 1000.0 / (1e6 * 2.0**-8) + 500.0 / (1e6 * 1.5**-8)
    assert damage(cycles, CURVE) == pytest.approx(expected, rel=1e-12)
    elementary = expected + 1e9 / (1e6 * 0.75**-8)
    assert damage(cycles, CURVE, miner="elementary") == pytest.approx(elementary, rel=1e-12)
    haibach = expected + 1e9 / (1e6 * 0.75**-15)
    assert damage(cycles, CURVE, miner="haibach") == pytest.approx(haibach, rel=1e-12)


def test_shigley_worked_example_of_miner() -> None:
    # Shigley's, 9th ed., section 6-15: S_ut = 80, S_e = 40 kpsi, f = 0.9: at 60 kpsi a part lives
    # N_1 = 8520 cycles; after 3000 of them it has 5520 left. Cited from memory: no copy was found
    # that can be opened.
    slope = 3.0 / math.log10(0.9 * 80.0 / 40.0)
    sn = SNCurve(name="s", strength=40.0, cycles=1e6, slopes=(slope,), knees=(1e6,))
    spent = damage(cycles_of([60.0], [3000.0]), sn)
    assert float(sn.cycles_to_failure(60.0)) == pytest.approx(8520.0, abs=5.0)
    assert (1.0 - spent) * float(sn.cycles_to_failure(60.0)) == pytest.approx(5520.0, abs=5.0)


@given(stresses, stresses)
def test_damage_adds_and_doubles(first: list[float], second: list[float]) -> None:
    a, b = rainflow(first), rainflow(second)
    assert damage(a + b, CURVE) == pytest.approx(damage(a, CURVE) + damage(b, CURVE), rel=1e-12)
    assert damage(a.repeated(2), CURVE) == pytest.approx(2 * damage(a, CURVE), rel=1e-12)


@given(stresses)
def test_utilisation_ranks_and_agrees_with_endless_life(history: list[float]) -> None:
    cycles = rainflow(history)
    value = utilisation(cycles, CURVE)
    assert math.isfinite(value)
    assert value == pytest.approx((max(history) - min(history)) / 2 / 200e6, rel=1e-12)
    assert (damage(cycles, CURVE) == 0.0) == (value < 1.0)


def test_utilisation_of_a_curve_without_a_limit() -> None:
    curve = load_sn_curve("nie-2016", quiet=True)
    allowable = 18930e6 * 1e7**-0.3548
    value = utilisation(cycles_of([50e6], [1.0]), curve)
    assert value == pytest.approx(50e6 / allowable, rel=1e-12)
    assert utilisation(Cycles.none(), curve) == damage(Cycles.none(), curve) == 0.0


def test_the_papers_rule() -> None:
    curve = load_sn_curve("nie-2016", quiet=True)
    # Section 4.3: S = a N^b, so N = (S / a)^(1/b); the stresses are table 2's.
    for stress in (35.56e6, -37.91e6):
        cycles = (abs(stress) / 18930e6) ** (-1.0 / 0.3548)
        assert peak_damage(stress, 12, curve) == pytest.approx(12 / cycles, rel=1e-12)
    assert peak_damage(0.0, 12, curve) == 0.0
    with pytest.raises(InputError, match="hits"):
        peak_damage(1e6, -1, curve)


def test_life() -> None:
    assert life(0.0) == math.inf
    assert life(0.25) == 4.0
    assert life(math.inf) == 0.0
    for bad in (-1.0, math.nan):
        with pytest.raises(InputError, match="damage"):
            life(bad)
