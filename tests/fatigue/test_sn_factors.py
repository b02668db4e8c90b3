from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pylife.materiallaws.woehlercurve
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pylife.strength.failure_probability import FailureProbability
from pylife.strength.fkm_linear.constants import consts_fkm, fw_t

from picchio.core.errors import InputError
from picchio.fatigue.allowable_load import allowable_factor, allowable_radius
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.mean_stress import MeanStress, fkm_sensitivity
from picchio.fatigue.miner import damage
from picchio.fatigue.sn.curve import MinerRule, SNCurve
from picchio.fatigue.sn.factors import (
    fkm_shear_strength,
    fkm_surface_factor,
    key_factor,
    shigley_size_factor,
    shigley_surface_factor,
    shigley_torsion_curve,
    spline_factor,
)
from picchio.fatigue.sn.library import load_sn_curve

assert pylife.materiallaws.woehlercurve  # registers the accessor used below

CURVE = SNCurve(
    name="c", strength=200e6, cycles=1e6, slopes=(8.0,), knees=(1e6,), survival=0.5,
    scatter=math.log10(1.25) / 2.5631031310892007, ultimate_shear=577e6,
)  # fmt: skip


def pylife_curve() -> pd.Series:
    return pd.Series({"k_1": 8.0, "ND": 1e6, "SD": 200.0, "TS": 1.25})


amplitudes = st.floats(20e6, 570e6)


@given(amplitudes)
def test_life_against_pylife(amplitude: float) -> None:
    theirs = pylife_curve().woehler
    lives: dict[MinerRule, float] = {
        "original": theirs.cycles([amplitude / 1e6])[0],
        "elementary": theirs.miner_elementary().cycles([amplitude / 1e6])[0],
        "haibach": theirs.miner_haibach().cycles([amplitude / 1e6])[0],
    }
    for rule, life in lives.items():
        ours = float(CURVE.with_miner(rule).cycles_to_failure(amplitude))
        assert ours == life or ours == pytest.approx(life, rel=1e-9)


@given(st.floats(0.001, 0.999), amplitudes)
def test_survival_against_pylife(survival: float, amplitude: float) -> None:
    theirs = pylife_curve().woehler.transform_to_failure_probability(1.0 - survival)
    ours = CURVE.at_survival(survival)
    assert ours.strength == pytest.approx(theirs.SD * 1e6, rel=1e-9)
    life = float(theirs.cycles([amplitude / 1e6])[0])
    mine = float(ours.cycles_to_failure(amplitude))
    assert mine == life or mine == pytest.approx(life, rel=1e-9)


@given(st.floats(120e6, 300e6), st.floats(1e4, 1e9))
def test_failure_probability_against_pylife(amplitude: float, cycles: float) -> None:
    median = float(CURVE.amplitude(cycles))
    scatter = CURVE.scatter
    assert scatter is not None
    theirs = FailureProbability(median, scatter).pf_simple_load(amplitude)
    ours = float(CURVE.failure_probability(amplitude, cycles))
    assert ours == pytest.approx(float(np.asarray(theirs)), rel=1e-9, abs=1e-15)


def test_fkm_factors_by_hand() -> None:
    assert fkm_shear_strength(1000e6) == pytest.approx(259.65e6)
    # 1 - 0.577 * 0.22 * lg 10 * lg 5 = 0.91127 (Rz = 10 um, R_m = 1000 MPa).
    assert fkm_surface_factor(10e-6, 1000e6) == pytest.approx(0.91127, abs=1e-5)
    assert fkm_surface_factor(0.5e-6, 1000e6) == 1.0
    assert fkm_surface_factor(25e-6, 1000e6) < fkm_surface_factor(10e-6, 1000e6)


def test_shigley_factors_by_hand() -> None:
    # Shigley's, 9th ed., example 6-3: S_ut = 520 MPa, machined: 0.860; example 6-4: 32 mm: 0.858
    # (rotating bending and torsion).
    assert shigley_surface_factor("machined", 520e6) == pytest.approx(0.860, abs=5e-4)
    assert shigley_size_factor(0.032) == pytest.approx(0.856, abs=3e-3)
    sn = shigley_torsion_curve(1000e6, 0.035, "machined", yield_strength=750e6)
    limit = 4.51 * 1000**-0.265 * 1.24 * 35**-0.107 * 0.59 * 500e6
    assert sn.endurance_limit == pytest.approx(limit, rel=1e-12)
    assert float(sn.amplitude(1e3)) == pytest.approx(0.9 * 0.67 * 1000e6, rel=1e-9)
    with pytest.raises(InputError, match="machined"):
        shigley_surface_factor("machned", 520e6)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="diameter"):
        shigley_size_factor(0.3)


@pytest.mark.parametrize(
    ("name", "factor"), [("keyed", key_factor(1000e6)), ("splined", spline_factor(1000e6))]
)
def test_keyed_and_splined_curves_are_the_plain_one_times_a_factor(
    name: str, factor: float
) -> None:
    plain, notched = load_sn_curve("42CrMo4-QT-shaft"), load_sn_curve(f"42CrMo4-QT-{name}")
    assert notched.strength == pytest.approx(plain.strength * factor, rel=1e-6)
    assert notched.slopes == plain.slopes
    # beta_tau by hand: 0.56 * 3 + 0.1 = 1.78; exp(0.42) = 1.522.
    assert 1.0 / factor == pytest.approx({"keyed": 1.78, "splined": 1.52196}[name], rel=1e-5)


def test_fkm_constants_are_those_of_pylife() -> None:
    # pyLife's tables of the guideline's constants, of "Steel".
    steel = consts_fkm["Steel"]
    expected = fw_t["Steel"]["shear"] * steel["fw_s"]
    assert fkm_shear_strength(1000e6) / 1000e6 == pytest.approx(expected, rel=1e-12)
    rough = 1.0 - fw_t["Steel"]["shear"] * steel["aR_s"] * math.log10(16.0) * math.log10(
        2.0 * 800.0 / steel["RmNmin"]
    )
    assert fkm_surface_factor(16e-6, 800e6) == pytest.approx(rough, rel=1e-12)
    tension = steel["a_M"] * 1e-3 * 800.0 + steel["b_M"]
    assert fkm_sensitivity(800e6) == pytest.approx(fw_t["Steel"]["shear"] * tension, rel=1e-12)


def test_factors_are_printed_with_the_curve() -> None:
    rough = CURVE.scaled(fkm_surface_factor(10e-6, 1000e6), "FKM roughness, Rz 10 um")
    assert rough.strength == pytest.approx(182.25e6, rel=1e-4)
    assert "FKM roughness, Rz 10 um" in rough.describe()
    for bad in (0.0, -1.0, math.nan):
        with pytest.raises(InputError, match="factor"):
            CURVE.scaled(bad, "nonsense")


def block(amplitude: float, count: float = 1.0) -> Cycles:
    return Cycles(np.array([2 * amplitude]), np.array([0.0]), np.array([count]))


@given(st.floats(1e6, 500e6), st.floats(1e-7, 1e-3))
def test_allowable_factor_is_the_curve_upside_down(amplitude: float, allowed: float) -> None:
    # One cycle a unit: N(f a) = 1 / allowed, so f = S(1 / allowed) / a, or the endurance limit.
    factor = allowable_factor(block(amplitude), CURVE, allowed)
    expected = float(CURVE.amplitude(1.0 / allowed)) / amplitude
    assert factor == pytest.approx(expected, rel=1e-9)
    assert damage(block(amplitude * factor), CURVE) <= allowed


@given(st.floats(50e6, 400e6), st.floats(0.0, 200e6), st.floats(1e-6, 1e-2))
def test_allowable_factor_with_gravity(amplitude: float, gravity: float, allowed: float) -> None:
    factor = allowable_factor(
        block(amplitude), CURVE, allowed, steady_stress=gravity, mean_stress="goodman"
    )
    just = damage(block(amplitude * factor).shifted(gravity), CURVE, "goodman")
    more = damage(block(amplitude * factor * (1 + 1e-9)).shifted(gravity), CURVE, "goodman")
    assert just <= allowed
    assert more > allowed * (1 - 1e-6)


def test_allowable_radius_bears_the_torque() -> None:
    radius = allowable_radius(0.0132, block(300e6), CURVE, 1e-4, steady_stress=50e6)
    grown = (0.0132 / radius) ** 3
    assert damage(block(300e6 * grown), CURVE) == pytest.approx(1e-4, rel=1e-9)
    assert allowable_radius(0.0132, Cycles.none(), CURVE, 1e-4) == 0.0
    assert allowable_factor(Cycles.none(), CURVE, 1e-4) == math.inf


def test_allowable_says_when_gravity_alone_breaks_it() -> None:
    with pytest.raises(InputError, match="steady stress alone"):
        allowable_factor(block(1e6), CURVE, 1e-4, steady_stress=600e6,
                         mean_stress=MeanStress("goodman"))  # fmt: skip
    for bad in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(InputError, match="allowed_damage"):
            allowable_factor(block(1e6), CURVE, bad)
