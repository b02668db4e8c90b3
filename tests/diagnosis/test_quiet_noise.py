"""The likelihood of the quiet time before the blows, against dense linear algebra."""

import numpy as np
import pytest
from scipy.linalg import toeplitz

from picchio.diagnosis.percussion.data.noise import _likelihood


@pytest.mark.parametrize(("share", "slow"), [(0.3, 0.9), (0.9, -0.5), (1e-5, 0.0), (0.95, 0.99)])
def test_the_likelihood_of_quiet_pieces_is_that_of_the_dense_covariance(share, slow):
    rng, n = np.random.default_rng(3), 90
    rows = rng.normal(size=(n, 4))
    basis = np.stack([np.ones(n), np.cos(0.4 * np.arange(n))], axis=1)
    covariance = toeplitz(share * np.array([slow**k for k in range(n)])) + (1 - share) * np.eye(n)
    inverse = np.linalg.inv(covariance)
    inner = basis.T @ inverse @ basis
    free = inverse - inverse @ basis @ np.linalg.solve(inner, basis.T @ inverse)
    expected = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(inner)[1]
    log_det, square, left = _likelihood(rows, basis, share, slow)
    assert log_det == pytest.approx(expected, rel=1e-8)
    assert square == pytest.approx(np.sum(rows * (free @ rows)), rel=1e-8)
    assert left == n - 2
