"""What a difference leaves when unknowns, known so far, make up for it: against the closed form."""

import numpy as np
import pytest

from picchio.diagnosis.percussion.separation import _left, _root


@pytest.fixture
def drawn():
    rng = np.random.default_rng(11)
    slopes = rng.standard_normal((60, 4)) * [1.0, 30.0, 1e-3, 5.0]
    spread = rng.standard_normal((4, 4)) * np.array([[1e-2], [1e-5], [10.0], [1e-3]])
    return rng.standard_normal(60), slopes, spread


def test_it_is_the_difference_weighed_by_noise_and_what_is_known(drawn):
    left, slopes, spread = drawn
    covariance = spread @ spread.T
    exact = left @ np.linalg.solve(np.eye(60) + slopes @ covariance @ slopes.T, left)
    assert _left(left, slopes, covariance) == pytest.approx(exact, rel=1e-9)


def test_unknowns_that_no_record_told_apart_are_no_hindrance(drawn):
    """A covariance that is singular, by rounding even negative: it once ended a diagnosis."""
    left, slopes, spread = drawn
    half = spread[:, :2] @ spread[:, :2].T
    rounded = half * (1.0 + 3e-16 * np.arange(16).reshape(4, 4))
    exact = left @ np.linalg.solve(np.eye(60) + slopes @ half @ slopes.T, left)
    assert _left(left, slopes, rounded) == pytest.approx(exact, rel=1e-6)
    fixed = np.zeros((4, 4))
    assert _left(left, slopes, fixed) == pytest.approx(left @ left)


def test_the_root_is_one(drawn):
    covariance = drawn[2] @ drawn[2].T
    root = _root(covariance)
    scale = np.sqrt(covariance.diagonal())
    error = (root @ root.T - covariance) / np.outer(scale, scale)
    assert np.abs(error).max() < 1e-12
