"""phi1 and phi2 against scipy's matrix exponential of a Jordan chain."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from picchio.excitation.piecewise import phi1, phi2


def oracle(z: complex) -> tuple[complex, complex]:
    chain = expm(np.array([[z, 1, 0], [0, 0, 1], [0, 0, 0]], dtype=complex))
    return chain[0, 1], chain[0, 2]


@given(st.complex_numbers(max_magnitude=30, allow_nan=False, allow_infinity=False))
def test_phi_is_the_exponentials_divided_difference(z):
    first, second = oracle(z)
    scale = max(1.0, np.exp(z.real))
    assert abs(phi1(z) - first) <= 1e-12 * scale
    assert abs(phi2(z) - second) <= 1e-12 * scale


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-7, 1e-3, 0.69, 0.71])
@pytest.mark.parametrize("turn", [1, 1j, -1, -0.6 + 0.8j])
def test_phi_loses_no_digits_near_zero(size, turn):
    z = size * turn
    # Taylor's series to 30 terms, summed from the small end.
    fact = np.cumprod(np.concatenate([[1.0], np.arange(1.0, 33.0)]))
    first = sum(z**k / fact[k + 1] for k in range(30, -1, -1))
    second = sum(z**k / fact[k + 2] for k in range(30, -1, -1))
    assert abs(phi1(z) - first) <= 4e-16
    assert abs(phi2(z) - second) <= 4e-16
