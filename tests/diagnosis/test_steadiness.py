"""Unknowns that must be the same at every pose: the test against its distribution."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import kstest

from picchio.diagnosis.percussion.steadiness import unsteadiness

POSES, RECORDS, SAMPLES, UNKNOWNS = 6, 3, 80, 4


def fitted(rng, moves=0.0, poses=POSES):
    """A linear problem fitted by least squares; the first unknown differs by `moves` a pose."""
    jacobians, data = [], []
    own = moves * rng.standard_normal(poses)
    for pose in range(poses):
        for _ in range(RECORDS):
            jacobian = rng.standard_normal((2 * SAMPLES, UNKNOWNS))
            noise = rng.standard_normal(2 * SAMPLES)
            jacobians.append(jacobian)
            data.append(jacobian[:, 0] * own[pose] + noise)
    x = np.linalg.lstsq(np.concatenate(jacobians), np.concatenate(data), rcond=None)[0]
    residuals = [
        (y - j @ x).reshape(2, SAMPLES) for y, j in zip(data, jacobians, strict=True)
    ]  # fmt: skip
    records = tuple(SimpleNamespace(pose=k // RECORDS) for k in range(len(data)))
    return SimpleNamespace(records=records, jacobians=jacobians, residuals=residuals)


@pytest.mark.parametrize("poses", [1, 3, 6])
def test_noise_alone_is_normal(poses):
    rng = np.random.default_rng(5)
    told = [unsteadiness(fitted(rng, poses=poses)) for _ in range(200)]
    assert kstest(told, "norm").pvalue > 0.01


def test_an_unknown_that_differs_from_pose_to_pose_shows():
    rng = np.random.default_rng(6)
    # five standard deviations of what a pose tells; the residual's power hardly rises
    found = fitted(rng, moves=5.0 / np.sqrt(RECORDS * 2 * SAMPLES))
    assert np.mean([np.mean(r**2) for r in found.residuals]) < 1.3
    assert unsteadiness(found) > 6.0


def test_without_slopes_nothing_is_said():
    assert unsteadiness(SimpleNamespace(jacobians=None)) == 0.0
