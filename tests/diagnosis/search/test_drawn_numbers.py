"""What numbers of one distribution cost, against the likelihood integrated over them."""

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.optimize import minimize_scalar
from scipy.stats import norm

from picchio.campaign.tables import Tolerance
from picchio.diagnosis.percussion.conclude.causes import with_solved
from picchio.diagnosis.percussion.fit.drawn import drawn_cost, width_spread
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.result import Cause, Value
from picchio.model.effects.registry import effect_class


def deviance(seen, width):
    """-2 log of the likelihood of numbers seen with unit noise, each integrated numerically."""
    z = np.linspace(-12.0, 12.0, 8001)
    likelihood = norm.pdf(seen[:, None] - width * z) * norm.pdf(z)
    return -2.0 * np.log(trapezoid(likelihood, z, axis=1)).sum()


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


@pytest.mark.parametrize("width", [1.5, 5.0, 50.0])
def test_the_width_is_known_as_well_as_is_said(width):
    """Forty numbers seen with unit noise, many times over."""
    rng = np.random.default_rng(9)
    seen = np.hypot(1.0, width) * rng.standard_normal((4000, 40))
    falls = (seen**2).sum(axis=1)
    found = np.sqrt(np.maximum((seen**2).mean(axis=1) - 1.0, 0.0))
    told = np.array([width_spread(w, f, 40) for w, f in zip(found, falls, strict=True)])
    assert np.median(told) == pytest.approx(found.std(), rel=0.08)
    assert found.mean() == pytest.approx(width, rel=0.03)


def test_a_hum_is_as_strong_as_it_is_without_noise():
    """Lines of one amplitude and any phase, seen with unit noise of their sines and cosines."""
    rng = np.random.default_rng(10)
    records, amplitude = 18, 3.0
    hum = effect_class("mains_hum")
    cause = Cause("mains_hum", "deflection", 1.0, {"amplitude": Value(0.0, 0.0, "rad")})
    told = []
    for _ in range(1500):
        phase = rng.uniform(0.0, 2.0 * np.pi, records)
        lines = amplitude * np.array([np.cos(phase), np.sin(phase)])
        lines = lines + rng.standard_normal(lines.shape)
        seen = float(np.sqrt((lines**2).sum() / records))
        label = ("mains_hum:deflection", float((lines**2).sum()), 2 * records)
        effects = (hum("deflection", amplitude=seen),)
        found = Hypothesis(effects, Tolerance(), n_nuisances=0, drawn=(label,))
        told.append(with_solved([cause], found)[0].parameters["amplitude"])
    values = np.array([t.value for t in told])
    assert values.mean() == pytest.approx(amplitude, rel=0.01)
    assert np.median([t.std for t in told]) == pytest.approx(values.std(), rel=0.1)
    assert told[0].unit == "rad"


def test_blows_that_come_ever_earlier_are_blows_at_another_rate():
    """Also where records have blows of different programmed rates."""
    rng = np.random.default_rng(4)
    jitter = effect_class("pulse_jitter")("tool", std=4e-3)
    hits, intervals = np.arange(12), {"r0": 0.04, "r1": 0.04, "r2": 0.08}
    scatter = dict(zip(intervals, 2e-4 * rng.standard_normal((3, 12)), strict=True))
    line = {name: tuple(-0.021 * intervals[name] * hits + scatter[name]) for name in intervals}
    (rate,) = jitter.with_hidden(line).coarser(intervals)
    assert rate.label == "pulse_rate:tool"
    assert rate.values["scale"] == pytest.approx(0.979, abs=5e-4)
    chance = {name: tuple(1.3e-3 * rng.standard_normal(12)) for name in intervals}
    assert jitter.with_hidden(chance).coarser(intervals) == ()
    assert jitter.coarser(intervals) == ()  # none are known
