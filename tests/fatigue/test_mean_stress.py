from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pylife.strength.meanstress as pylife
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picchio.core.errors import InputError
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.mean_stress import RULES, MeanStress, fkm_sensitivity
from picchio.fatigue.miner import damage, utilisation
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.sn.library import load_sn_curve


def curve(**changes: object) -> SNCurve:
    values = {
        "name": "c", "strength": 200e6, "cycles": 1e6, "slopes": (8.0,), "knees": (1e6,),
        "ultimate_shear": 577e6, "yield_shear": 433e6, "tensile_strength": 1000e6,
    }  # fmt: skip
    return SNCurve(**{**values, **changes})  # type: ignore[arg-type]


def rule(name: str) -> MeanStress:
    return MeanStress(  # type: ignore[arg-type]
        name, fatigue_strength_coefficient=900e6, walker_exponent=0.65
    )


def equivalent(name: str, a: float, m: float, sn: SNCurve | None = None) -> float:
    return float(rule(name).equivalent_amplitude(a, m, sn or curve()))


@pytest.mark.parametrize(
    ("name", "ultimate"), [("goodman", 1050.0), ("soderberg", 1172.7), ("gerber", 924.35)]
)
def test_khurmi_worked_example(name: str, ultimate: float) -> None:
    # Khurmi and Gupta, A Textbook of Machine Design, ch. 6: stress between +300 and -150 MPa,
    # yield 0.55 S_u, endurance 0.5 S_u, factor of safety 2: S_u = 924.35 (Gerber), 1050 (modified
    # Goodman), 1172.72 MPa (Soderberg). At that S_u, twice the load reaches the endurance limit.
    # Cited from memory: no copy was found that can be opened. The arithmetic is the book's rules.
    strength = ultimate * 1e6
    sn = curve(ultimate_shear=strength, yield_shear=0.55 * strength)
    assert equivalent(name, 450e6, 150e6, sn) == pytest.approx(0.5 * strength, rel=1e-4)


def test_shigley_worked_examples() -> None:
    # Shigley's, 9th ed., problem 6-20: S_e = 40, S_ut = 80 kpsi, amplitude 25, mean (von Mises)
    # 25.98 kpsi: n = 1.05 (Goodman), 1.31 (Gerber). Example 6-10: S_e = 33.9, S_ut = 100,
    # amplitude = mean = 8.38 kpsi: n = 3.66 (Gerber). The problem and its answers can be opened
    # at solutioninn.com/repeat-prob-620-but-with-an-alternating-torsional-stress-of-177929 and
    # qammunity.org/7853173; example 6-10 is cited from memory.
    for name, limit, ultimate, a, m, n in (
        ("goodman", 40.0, 80.0, 25.0, 25.98, 1.05), ("gerber", 40.0, 80.0, 25.0, 25.98, 1.31),
        ("gerber", 33.9, 100.0, 8.38, 8.38, 3.66),
    ):  # fmt: skip
        reached = equivalent(name, n * a, n * m, curve(ultimate_shear=ultimate))
        assert reached == pytest.approx(limit, rel=0.01)


def test_dowling_worked_example() -> None:
    # Dowling, Mechanical Behavior of Materials, 4th ed., section 9.7, AISI 4340 (aircraft quality):
    # sigma_f' = 1758 MPa, gamma = 0.65; 450 MPa about a mean of 200 MPa counts as 507.8 (Morrow),
    # 540.8 (SWT), 511.8 MPa (Walker). Cited from memory: no copy was found that can be opened.
    morrow = MeanStress("morrow", fatigue_strength_coefficient=1758e6)
    assert morrow.equivalent_amplitude(450e6, 200e6, curve()) == pytest.approx(507.8e6, rel=1e-4)
    assert equivalent("swt", 450e6, 200e6) == pytest.approx(540.8e6, rel=1e-4)
    assert equivalent("walker", 450e6, 200e6) == pytest.approx(511.8e6, rel=1e-4)


@given(st.floats(1e6, 3e8), st.floats(0.0, 2.999), st.floats(0.05, 0.5))
@settings(deadline=None)
def test_fkm_against_pylife(a: float, ratio: float, sensitivity: float) -> None:
    # With |mean|, FKM's rule in shear is pyLife's diagram for tensile means.
    m = ratio * a
    theirs = pylife.fkm_goodman(
        pd.Series([a]), pd.Series([m]), sensitivity, sensitivity / 3.0, -1.0
    )
    ours = MeanStress("fkm", sensitivity=sensitivity).equivalent_amplitude(a, m, curve())
    assert float(ours) == pytest.approx(float(np.asarray(theirs).ravel()[0]), rel=1e-9)


def test_fkm_beyond_half_is_constant() -> None:
    # Where pyLife is not the guideline: for R >= 0.5 it goes on with the slope M / 3, FKM's field
    # IV divides the amplitude by the constant (3 + M) / (3 (1 + M)^2), here 100 / 153.636.
    rule_ = MeanStress("fkm", sensitivity=0.3)
    for mean in (300e6, 301e6, 800e6):
        value = float(rule_.equivalent_amplitude(100e6, mean, curve()))
        assert value == pytest.approx(100e6 * 3 * 1.3**2 / 3.3, rel=1e-12)
    beyond = pylife.fkm_goodman(pd.Series([100.0]), pd.Series([800.0]), 0.3, 0.1, -1.0)
    assert float(np.asarray(beyond).ravel()[0]) == pytest.approx(212.7, abs=0.1)


def test_fkm_sensitivity_of_steel() -> None:
    # M_tau = 0.577 (0.35e-3 * 1000 - 0.1) = 0.14425.
    assert fkm_sensitivity(1000e6) == pytest.approx(0.14425, rel=1e-12)
    assert fkm_sensitivity(200e6) == 0.0
    by_curve = MeanStress("fkm").equivalent_amplitude(100e6, 50e6, curve())
    assert float(by_curve) == pytest.approx(100e6 + 0.14425 * 50e6, rel=1e-12)


@given(st.sampled_from(RULES), st.floats(1e5, 3e8), st.floats(0.0, 4e8))
def test_in_shear_the_sign_of_the_mean_does_not_matter(name: str, a: float, m: float) -> None:
    value = equivalent(name, a, m)
    assert value == equivalent(name, a, -m)
    assert value >= a * (1 - 1e-12)
    assert equivalent(name, a, 0.0) == pytest.approx(a, rel=1e-12)
    assert equivalent(name, a, m * 0.9) <= value * (1 + 1e-12)


@given(st.sampled_from(RULES), st.floats(1e6, 3e8), st.floats(0.0, 4e8), st.floats(0.1, 0.999))
def test_a_smaller_amplitude_never_counts_more(name: str, a: float, m: float, f: float) -> None:
    assert equivalent(name, a * f, m) <= equivalent(name, a, m) * (1 + 1e-9)


def test_smooth_shafts_default_to_no_effect() -> None:
    cycles = Cycles(np.array([500e6]), np.array([300e6]), np.array([1.0]))
    assert damage(cycles, curve()) == damage(cycles.shifted(-300e6), curve())
    assert utilisation(cycles, curve()) == pytest.approx(1.25)
    assert utilisation(cycles, curve(), "goodman") == pytest.approx(1.25 / (1 - 300 / 577))
    assert damage(cycles, curve(), "gerber") > damage(cycles, curve())


def test_gravity_as_a_mean_can_be_shifted_in_and_out() -> None:
    keyed = load_sn_curve("42CrMo4-QT-keyed")
    cycles = Cycles(np.array([320e6]), np.array([10e6]), np.array([1.0]))
    with_gravity = damage(cycles.shifted(90e6), keyed, "fkm")
    assert with_gravity > damage(cycles, keyed, "fkm") > damage(cycles, keyed)
    assert with_gravity == pytest.approx(damage(cycles.shifted(-110e6), keyed, "fkm"))


def test_static_failure_is_said() -> None:
    for name, strength in (("goodman", 577e6), ("gerber", 577e6), ("soderberg", 433e6)):
        with pytest.raises(InputError, match="fails statically"):
            equivalent(name, 1e6, strength)


def test_missing_constants_are_named() -> None:
    bare = SNCurve(name="bare", strength=1e8, cycles=1e6, slopes=(5.0,))
    for name, key in (
        ("goodman", r"bare\.ultimate_shear"), ("soderberg", r"bare\.yield_shear"),
        ("fkm", r"bare\.tensile_strength"), ("morrow", "fatigue_strength_coefficient"),
        ("walker", "walker_exponent"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=key):
            MeanStress(name).equivalent_amplitude(1e6, 1e6, bare)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="did you mean 'goodman'"):
        MeanStress("godman")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="walker_exponent"):
        MeanStress("walker", walker_exponent=1.5)
    with pytest.raises(InputError, match="mean"):
        equivalent("swt", 1e6, math.nan)
