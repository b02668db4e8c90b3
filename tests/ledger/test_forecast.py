"""What is left, given that the joint has survived: a closed form, and how often it is right."""

import numpy as np
import pytest
from scipy.stats import norm

from picchio.ledger.forecast import Worlds, quantiles

BLOWS, SPREAD = 1000, 1.1


@pytest.mark.parametrize("middle", [0.05, 0.9, 4.0])
def test_life_left_is_that_of_a_truncated_distribution(middle):
    """ln damage is normal: given that it is below zero its quantiles have a closed form."""
    share = (np.arange(200_000) + 0.5) / 200_000
    damage = middle * np.exp(SPREAD * norm.ppf(share))
    found = quantiles(Worlds(damage[None], np.ones(share.size)).blows_left(0, BLOWS))
    whole = norm.cdf(-np.log(middle) / SPREAD)
    for name, part in (("p10", 0.1), ("p50", 0.5), ("p90", 0.9)):
        # The more damage, the less is left.
        at = middle * np.exp(SPREAD * norm.ppf((1.0 - part) * whole))
        assert found[name] == pytest.approx(BLOWS * (1.0 - at) / at, rel=1e-3)


@pytest.mark.parametrize("middle", [0.3, 2.0, 6.0])
def test_four_of_five_robots_that_live_end_within_their_interval(middle):
    """256 worlds a robot; of 6.0 a dozen are left in which it is whole."""
    rng = np.random.default_rng(8)
    held, forgetful, robots = 0, 0, 0
    while robots < 1500:
        real = middle * np.exp(SPREAD * rng.standard_normal())
        if real >= 1.0:
            continue
        robots += 1
        damage = middle * np.exp(SPREAD * rng.standard_normal(256))
        left = BLOWS * (1.0 - real) / real
        told = quantiles(Worlds(damage[None], np.ones(256)).blows_left(0, BLOWS))
        held += told["p10"] <= left <= told["p90"]
        low, high = np.quantile(np.maximum(BLOWS * (1.0 - damage) / damage, 0.0), [0.1, 0.9])
        forgetful += low <= left <= high
    assert held / robots == pytest.approx(0.81, abs=0.04)
    # Without the survival so far it would be told much worse where it says much.
    assert forgetful / robots < 0.75 or middle < 1.0


def test_few_worlds_make_it_wide():
    few = quantiles(np.array([30.0, 10.0, 20.0]))
    assert few == {"p10": 0.0, "p50": 20.0, "p90": 30.0}
    assert quantiles(np.empty(0)) == {"p10": 0.0, "p50": 0.0, "p90": 0.0}
    assert quantiles(np.full(50, np.inf))["p90"] == np.inf
