from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pylife.materiallaws.woehlercurve
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pylife.strength.fkm_linear.constants import consts_fkm, fw_t

from picchio.core.errors import InputError
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.mean_stress import Rule, fkm_sensitivity
from picchio.fatigue.miner import damage
from picchio.fatigue.sn.curve import MinerRule, SNCurve
from picchio.fatigue.sn.library import load_sn_curve
from picchio.studies.assessment.backwards import largest_factor

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


@pytest.mark.parametrize(("name", "notch"), [("keyed", 1.78), ("splined", math.exp(0.42))])
def test_keyed_and_splined_curves_are_the_plain_one_over_the_notch_factor(
    name: str, notch: float
) -> None:
    # DIN 743-2, table 1, at sigma_B = 1000 MPa: beta_tau = 0.56 * 3 + 0.1 for one feather key,
    # exp(4.2e-7 * 1000^2) for a spline.
    plain, notched = load_sn_curve("42CrMo4-QT-shaft"), load_sn_curve(f"42CrMo4-QT-{name}")
    # FKM guideline: tau_W = 0.577 * 0.45 * R_m.
    assert plain.strength == pytest.approx(0.577 * 0.45 * 1000e6)
    assert notched.strength == pytest.approx(plain.strength / notch, rel=1e-6)
    assert notched.slopes == plain.slopes


def test_fkm_sensitivity_is_pylifes() -> None:
    # pyLife's tables of the guideline's constants, of "Steel".
    steel = consts_fkm["Steel"]
    tension = steel["a_M"] * 1e-3 * 800.0 + steel["b_M"]
    assert fkm_sensitivity(800e6) == pytest.approx(fw_t["Steel"]["shear"] * tension, rel=1e-12)


def test_factors_are_printed_with_the_curve() -> None:
    rough = CURVE.scaled(0.91, "FKM roughness, Rz 10 um")
    assert rough.strength == pytest.approx(182e6)
    assert "FKM roughness, Rz 10 um" in rough.describe()
    for bad in (0.0, -1.0, math.nan):
        with pytest.raises(InputError, match="factor"):
            CURVE.scaled(bad, "nonsense")


def allowable_factor(
    cycles: Cycles, allowed: float, gravity: float = 0.0, rule: Rule = "none"
) -> float:
    def spent(factor: float) -> float:
        return damage(cycles.scaled(factor).shifted(gravity), CURVE, rule)

    return largest_factor(spent, allowed)


def block(amplitude: float, count: float = 1.0) -> Cycles:
    return Cycles(np.array([2 * amplitude]), np.array([0.0]), np.array([count]))


@given(st.floats(1e6, 500e6), st.floats(1e-7, 1e-3))
def test_allowable_factor_is_the_curve_upside_down(amplitude: float, allowed: float) -> None:
    # One cycle a unit: N(f a) = 1 / allowed, so f = S(1 / allowed) / a, or the endurance limit.
    factor = allowable_factor(block(amplitude), allowed)
    expected = float(CURVE.amplitude(1.0 / allowed)) / amplitude
    assert factor == pytest.approx(expected, rel=1e-9)
    assert damage(block(amplitude * factor), CURVE) <= allowed


@given(st.floats(50e6, 400e6), st.floats(0.0, 200e6), st.floats(1e-6, 1e-2))
def test_allowable_factor_with_gravity(amplitude: float, gravity: float, allowed: float) -> None:
    factor = allowable_factor(block(amplitude), allowed, gravity, "goodman")
    just = damage(block(amplitude * factor).shifted(gravity), CURVE, "goodman")
    more = damage(block(amplitude * factor * (1 + 1e-9)).shifted(gravity), CURVE, "goodman")
    assert just <= allowed
    assert more > allowed * (1 - 1e-6)


def test_allowable_says_when_gravity_alone_breaks_it() -> None:
    with pytest.raises(InputError, match="steady stress alone"):
        allowable_factor(block(1e6), 1e-4, 600e6, "goodman")
