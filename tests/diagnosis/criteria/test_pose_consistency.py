"""Unknowns that must be the same at every pose: the test against its distribution."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.stats import kstest

from picchio.campaign.tables import Tolerance
from picchio.diagnosis.percussion.criteria.pose_consistency import (
    jackknife_covariance,
    pose_inconsistency,
)
from picchio.diagnosis.percussion.data.problem import MeasuredRecord
from picchio.diagnosis.percussion.fit.least_squares import Fit
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.model.effects.registry import effect_class

POSES, RECORDS, SAMPLES, UNKNOWNS = 6, 3, 80, 4


class Linear(NamedTuple):
    """A fit of four unknowns of which nothing is known beforehand, and the data it was made to."""

    fit: Fit
    data: list


def some_fit(jacobians, residuals, poses):
    gain = effect_class("sensor_gain")
    effects = tuple(gain(f"accelerometer.{n}", gain=1.0) for n in range(UNKNOWNS))
    records = tuple(MeasuredRecord(None, {}, {}, pose) for pose in poses)
    hypothesis = Hypothesis(effects, Tolerance(), n_nuisances=0)
    return Fit(hypothesis, residuals, jacobians, 0.0, records, None)


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
    units = [k // RECORDS for k in range(len(data))]
    return Linear(some_fit([-j for j in jacobians], residuals, units), data)


@pytest.mark.parametrize("poses", [1, 3, 6])
def test_noise_alone_is_normal(poses):
    rng = np.random.default_rng(5)
    told = [pose_inconsistency(fitted(rng, poses=poses).fit) for _ in range(200)]
    assert kstest(told, "norm").pvalue > 0.01


def test_an_unknown_that_differs_from_pose_to_pose_shows():
    rng = np.random.default_rng(6)
    # five standard deviations of what a pose tells; the residual's power hardly rises
    found = fitted(rng, moves=5.0 / np.sqrt(RECORDS * 2 * SAMPLES)).fit
    assert np.mean([np.mean(r**2) for r in found.residuals]) < 1.3
    assert pose_inconsistency(found) > 6.0


def test_a_model_without_unknowns_has_no_spread():
    none = np.zeros((2 * SAMPLES, 0))
    hypothesis = Hypothesis((), Tolerance(), n_nuisances=0)
    records = tuple(MeasuredRecord(None, {}, {}, pose) for pose in range(3))
    found = Fit(hypothesis, [np.ones((2, SAMPLES))] * 3, [none] * 3, 0.0, records, None)
    assert jackknife_covariance(found).shape == (0, 0)


def test_without_slopes_nothing_is_said():
    assert pose_inconsistency(some_fit(None, [np.ones((2, SAMPLES))], [0])) == 0.0


def test_the_spread_between_poses_is_that_of_fits_without_one():
    found, measured = fitted(np.random.default_rng(7), moves=0.5)
    without = []
    for pose in range(POSES):
        some = [k for k, r in enumerate(found.records) if r.pose != pose]
        design = -np.concatenate([found.jacobians[k] for k in some])
        data = np.concatenate([measured[k] for k in some])
        without.append(np.linalg.lstsq(design, data, rcond=None)[0])
    covariance = (POSES - 1) / POSES * np.cov(np.array(without).T, ddof=0) * POSES
    np.testing.assert_allclose(jackknife_covariance(found), covariance, rtol=1e-9, atol=1e-15)


def test_where_noise_is_left_the_poses_agree_as_the_fit_says():
    rng = np.random.default_rng(8)
    ratios = []
    for _ in range(100):
        found = fitted(rng).fit
        fits = np.linalg.inv(found.normal_matrix())
        ratios.append(jackknife_covariance(found).diagonal() / fits.diagonal())
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.15)


def test_one_pose_has_no_spread():
    found = fitted(np.random.default_rng(9), poses=1).fit
    alone = some_fit(found.jacobians[:1], found.residuals[:1], [0])
    assert not jackknife_covariance(alone).any()


def test_what_one_record_alone_tells_does_not_spread():
    """Without it nothing but rounding is left of that unknown: it once came out as 1e160."""
    found = fitted(np.random.default_rng(10), poses=2).fit
    rest = found.jacobians[1:]
    for jacobian in rest:
        jacobian[:, 0] *= 1e-14
    spread = jackknife_covariance(found)
    normal = found.normal_matrix()
    assert spread[0, 0] < np.linalg.inv(normal)[0, 0]
    assert (spread.diagonal()[1:] < 4.0 * np.linalg.inv(normal).diagonal()[1:]).all()
