"""Unknowns that must be the same at every pose: the test against its distribution."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import kstest

from picchio.diagnosis.percussion.criteria.pose_consistency import (
    jackknife_covariance,
    pose_inconsistency,
)

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
    return SimpleNamespace(
        records=records,
        jacobians=[-j for j in jacobians],
        residuals=residuals,
        hypothesis=SimpleNamespace(unknowns=lambda: range(UNKNOWNS)),
        normal_matrix=lambda: sum(j.T @ j for j in jacobians),
        solution=x,
        data=data,
    )


@pytest.mark.parametrize("poses", [1, 3, 6])
def test_noise_alone_is_normal(poses):
    rng = np.random.default_rng(5)
    told = [pose_inconsistency(fitted(rng, poses=poses)) for _ in range(200)]
    assert kstest(told, "norm").pvalue > 0.01


def test_an_unknown_that_differs_from_pose_to_pose_shows():
    rng = np.random.default_rng(6)
    # five standard deviations of what a pose tells; the residual's power hardly rises
    found = fitted(rng, moves=5.0 / np.sqrt(RECORDS * 2 * SAMPLES))
    assert np.mean([np.mean(r**2) for r in found.residuals]) < 1.3
    assert pose_inconsistency(found) > 6.0


def test_without_slopes_nothing_is_said():
    assert pose_inconsistency(SimpleNamespace(jacobians=None)) == 0.0


def test_the_spread_between_poses_is_that_of_fits_without_one():
    found = fitted(np.random.default_rng(7), moves=0.5)
    without = []
    for pose in range(POSES):
        some = [k for k, r in enumerate(found.records) if r.pose != pose]
        design = -np.concatenate([found.jacobians[k] for k in some])
        data = np.concatenate([found.data[k] for k in some])
        without.append(np.linalg.lstsq(design, data, rcond=None)[0])
    covariance = (POSES - 1) / POSES * np.cov(np.array(without).T, ddof=0) * POSES
    np.testing.assert_allclose(jackknife_covariance(found), covariance, rtol=1e-9, atol=1e-15)


def test_where_noise_is_left_the_poses_agree_as_the_fit_says():
    rng = np.random.default_rng(8)
    ratios = []
    for _ in range(100):
        found = fitted(rng)
        fits = np.linalg.inv(found.normal_matrix())
        ratios.append(jackknife_covariance(found).diagonal() / fits.diagonal())
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.15)


def test_one_pose_has_no_spread():
    found = fitted(np.random.default_rng(9), poses=1)
    found.records, found.jacobians = found.records[:1], found.jacobians[:1]
    found.residuals = found.residuals[:1]
    assert not jackknife_covariance(found).any()


def test_what_one_record_alone_tells_does_not_spread():
    """Without it nothing but rounding is left of that unknown: it once came out as 1e160."""
    found = fitted(np.random.default_rng(10), poses=2)
    for jacobian in found.jacobians[1:]:
        jacobian[:, 0] = 0.0
    normal = sum(j.T @ j for j in found.jacobians)
    normal[0, 1:] += 1e-13
    normal[1:, 0] += 1e-13
    found.normal_matrix = lambda: normal
    spread = jackknife_covariance(found)
    assert spread[0, 0] < np.linalg.inv(normal)[0, 0]
    assert (spread.diagonal()[1:] < 4.0 * np.linalg.inv(normal).diagonal()[1:]).all()
