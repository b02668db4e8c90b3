"""What numbers of one distribution cost, against the likelihood integrated over them."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.stats import norm

from picchio.diagnosis.percussion.drawn_numbers import drawn_cost


def deviance(seen, width):
    """-2 log of the likelihood of numbers seen with unit noise, each integrated numerically."""
    z = np.linspace(-12.0, 12.0, 8001)
    likelihood = norm.pdf(seen[:, None] - width * z) * norm.pdf(z)
    return -2.0 * np.log(np.trapezoid(likelihood, z, axis=1)).sum()


@pytest.mark.parametrize("spread", [0.8, 2.0, 6.0])
def test_the_cost_is_that_of_the_integrated_likelihood(spread):
    rng = np.random.default_rng(7)
    seen = np.hypot(1.0, spread) * rng.standard_normal(40)
    nothing = -2.0 * norm.logpdf(seen).sum()
    free = -2.0 * norm.logpdf(np.zeros(40)).sum()
    likeliest = minimize_scalar(
        lambda w: deviance(seen, w), bounds=(0.2 * spread, 3.0 * spread), method="bounded"
    )
    gain = nothing - likeliest.fun
    fall = nothing - free
    assert fall - drawn_cost(fall, 40, 10**9) == pytest.approx(gain, rel=1e-3, abs=0.02)


def test_what_chance_gives_is_paid_back():
    assert drawn_cost(30.0, 40, 10_000) == 30.0  # less than a unit each: there is no width
    assert drawn_cost(0.0, 0, 10_000) == 0.0
    rng = np.random.default_rng(3)
    falls = rng.chisquare(40, 2000)
    gains = falls - np.array([drawn_cost(f, 40, 10_000) for f in falls])
    # half a chi-square of one degree of freedom, since a width can't be negative
    assert np.quantile(gains, 0.99) < 6.6
    assert (gains > 0).mean() == pytest.approx(0.5, abs=0.06)


def test_numbers_that_are_told_well_cost_no_more_than_free_ones():
    assert drawn_cost(1e9, 40, 10_000) == pytest.approx(40 * np.log(10_000))
