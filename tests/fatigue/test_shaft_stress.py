from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from picchio.core.errors import InputError
from picchio.fatigue.shaft_stress import (
    check_shaft,
    shear_stress,
    shear_stress_from_deflection,
)
from picchio.robot.joint import Shaft


def solid_bar(
    radius: float = 0.01765, length: float = 0.0504, shear_modulus: float = 79.3e9
) -> Shaft:
    return Shaft(radius=radius, length=length, shear_modulus=shear_modulus)


def test_textbook_shaft() -> None:
    # Any strength-of-materials text: tau = 16 T / (pi d^3); 1.5 kN m on d = 50 mm: 61.1 MPa.
    stress = shear_stress(1500.0, solid_bar(radius=0.025))
    assert float(stress) == pytest.approx(16 * 1500.0 / (math.pi * 0.05**3), rel=1e-14)
    assert float(stress) == pytest.approx(61.1e6, rel=1e-3)


def test_paper_arm_shafts_are_their_springs() -> None:
    # Issue 2: chosen so that k = G Jp / l holds to 0.5 % and G r / l = 27.8 GPa.
    for bar, stiffness in ((solid_bar(), 2.4e5), (solid_bar(radius=0.0132, length=0.0377), 1e5)):
        assert abs(check_shaft(stiffness, bar)) < 5e-3
        assert float(shear_stress_from_deflection(1.0, bar)) == pytest.approx(27.8e9, rel=2e-3)


@given(
    st.floats(1e-3, 0.2),
    st.floats(1e-2, 2.0),
    st.floats(1e9, 2e11),
    st.floats(-1e-2, 1e-2, allow_subnormal=False),
)
def test_both_ways_agree_when_the_shaft_is_the_spring(
    radius: float, length: float, modulus: float, deflection: float
) -> None:
    bar = solid_bar(radius, length, modulus)
    stiffness = modulus * math.pi / 2.0 * radius**4 / length
    assert check_shaft(stiffness, bar) == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(
        shear_stress(stiffness * deflection, bar),
        shear_stress_from_deflection(deflection, bar),
        rtol=1e-12,
    )


def test_disagreement_is_the_stresses_ratio() -> None:
    bar, stiffness = solid_bar(), 1e5
    ratio = shear_stress_from_deflection(1e-3, bar) / shear_stress(stiffness * 1e-3, bar)
    assert check_shaft(stiffness, bar) == pytest.approx(float(ratio) - 1.0, rel=1e-12)


@pytest.mark.parametrize("bad", [math.nan, math.inf, "x", None, 1j])
def test_bad_torque_is_named(bad: object) -> None:
    with pytest.raises(InputError, match="torque"):
        shear_stress(bad, solid_bar())  # type: ignore[arg-type]


@pytest.mark.parametrize("key", ["radius", "length", "shear_modulus"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan])
def test_bad_shaft_is_named(key: str, value: float) -> None:
    with pytest.raises(InputError, match=key):
        solid_bar(**{key: value})
