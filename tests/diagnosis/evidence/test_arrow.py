"""The eliminated system against one dense solve, and the evidence against a normal density."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.stats import multivariate_normal

from picchio.diagnosis.evidence.arrow import bounded, left_of, reduce
from picchio.diagnosis.evidence.numbers import Numbers
from picchio.diagnosis.evidence.remainder import FREEDOM, SIZE, left

GROUP_OF = (0, 0, 1, 1, 1)


def campaign(seed, own=3, group=2, shared=4, rows=40):
    """Columns of each record (own, group, shared), residuals, and where numbers are."""
    rng = np.random.default_rng(seed)
    columns = [rng.standard_normal((rows, own + group + shared)) for _ in GROUP_OF]
    residuals = [rng.standard_normal(rows) for _ in GROUP_OF]
    at = Numbers(
        rng.standard_normal(shared),
        tuple(rng.standard_normal(group) for _ in range(2)),
        tuple(rng.standard_normal(own) for _ in GROUP_OF),
    )
    return columns, residuals, at


def dense(columns, residuals, at):
    """The whole Jacobian, record by record, and numbers in the order records, groups, shared."""
    own, group, shared = at.records[0].size, at.groups[0].size, at.shared.size
    wide = own * len(GROUP_OF) + group * 2 + shared
    blocks = []
    for k, (block, g) in enumerate(zip(columns, GROUP_OF, strict=True)):
        row = np.zeros((len(block), wide))
        row[:, k * own : (k + 1) * own] = block[:, :own]
        first = own * len(GROUP_OF) + g * group
        row[:, first : first + group] = block[:, own : own + group]
        row[:, -shared:] = block[:, own + group :]
        blocks.append(row)
    return (
        np.vstack(blocks),
        np.concatenate(residuals),
        np.concatenate([*at.records, *at.groups, at.shared]),
    )


def grams_of(columns, residuals):
    together = [np.column_stack(pair) for pair in zip(columns, residuals, strict=True)]
    return [whole.T @ whole for whole in together]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("sizes", [(3, 2, 4), (0, 2, 3), (3, 0, 1), (0, 0, 5)])
def test_the_step_is_that_of_one_dense_solve(seed, sizes):
    columns, residuals, at = campaign(seed, *sizes)
    weights = np.array([0.7, 0.2])
    system = reduce(grams_of(columns, residuals), GROUP_OF, weights, at)
    step = system.back(np.linalg.solve(system.precision, system.pull))
    jacobian, e, z = dense(columns, residuals, at)
    w = np.repeat(weights[list(GROUP_OF)], 40)
    precision = jacobian.T @ (w[:, None] * jacobian) + np.eye(z.size)
    expected = np.linalg.solve(precision, jacobian.T @ (w * e) - z)
    found = np.concatenate([*step.records, *step.groups, step.shared])
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
    log_det = system.log_determinant + np.linalg.slogdet(system.precision)[1]
    np.testing.assert_allclose(log_det, np.linalg.slogdet(precision)[1], rtol=1e-10)


def test_half_the_fall_less_half_the_determinant_is_the_normal_density():
    columns, residuals, at = campaign(1)
    at = at.scaled(0.0)
    grams = grams_of(columns, residuals)
    system = reduce(grams, GROUP_OF, np.ones(2), at)
    step = system.back(np.linalg.solve(system.precision, system.pull))
    squares = 0.0
    for k, g in enumerate(GROUP_OF):
        own = np.concatenate([step.records[k], step.groups[g], step.shared])
        squares += left_of(grams[k], own)
    log_det = system.log_determinant + np.linalg.slogdet(system.precision)[1]
    found = -0.5 * (squares + step.square + log_det)
    jacobian, e, _ = dense(columns, residuals, at)
    covariance = np.eye(e.size) + jacobian @ jacobian.T
    expected = multivariate_normal(np.zeros(e.size), covariance).logpdf(e)
    assert found == pytest.approx(expected + 0.5 * e.size * np.log(2.0 * np.pi), rel=1e-10)


@pytest.mark.parametrize("seed", range(6))
def test_bounds_are_kept_as_a_bounded_least_squares_keeps_them(seed):
    columns, residuals, at = campaign(seed, 0, 0, 5)
    system = reduce(grams_of(columns, residuals), GROUP_OF, np.ones(2), at)
    low, high = np.full(5, -0.3), np.array([0.1, 0.05, 0.2, 1.0, 0.02])
    root = np.linalg.cholesky(system.precision).T
    expected = lsq_linear(root, np.linalg.solve(root.T, system.pull), (low, high), tol=1e-14).x
    found = bounded(system, low, high)
    cost = [0.5 * x @ system.precision @ x - system.pull @ x for x in (found, expected)]
    assert cost[0] == pytest.approx(cost[1], abs=2e-2 * abs(cost[1]))
    assert (found >= low - 1e-12).all() and (found <= high + 1e-12).all()


@pytest.mark.parametrize("square", [900.0, 1000.0, 1500.0, 20000.0])
def test_the_remainder_is_integrated_as_a_quadrature_integrates_it(square):
    samples, signal, records = 1000, 4e5, 2
    d = FREEDOM * records

    def log_density(s):
        v = 1.0 + s**2 * signal / d
        return -0.5 * (square - samples + d) / v - 0.5 * d * np.log(v) - 0.5 * (s / SIZE) ** 2

    fine = np.linspace(0.0, 1.0, 200_001)
    log = log_density(fine)
    total = np.trapezoid(np.exp(log - log.max()), fine)
    expected = log.max() + np.log(total / SIZE) - 0.5 * (samples - d)
    found = left(square, samples, signal, records)
    assert found.log_likelihood == pytest.approx(expected, abs=0.2)
    assert 0.0 < found.weight <= 1.0


def test_what_is_left_grows_with_the_residual_and_counts_ever_less():
    found = [left(1000.0 + extra, 1000, 4e5, 2) for extra in (0.0, 100.0, 1e3, 1e4, 1e5)]
    sizes, weights = [one.size for one in found], [one.weight for one in found]
    assert sizes == sorted(sizes) and weights == sorted(weights, reverse=True)
    assert found[0].weight > 0.9 > 0.05 > found[-1].weight
