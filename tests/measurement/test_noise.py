"""Noise estimates against noise whose truth is known, made with SciPy's filters."""

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import freqz, lfilter
from scipy.stats import binom

from picchio.campaign.record import Record
from picchio.core.errors import InputError
from picchio.measurement.noise.autoregression import AutoRegression, fit_autoregression
from picchio.measurement.noise.estimate import noise_levels
from picchio.measurement.noise.periodic import find_period, not_periodic
from picchio.measurement.noise.ringdown import fit_ring_down

from ..whiteness import band_levels, flatness, largest_line, runs, whiteness
from .signals import CHANNELS, LEVELS, PERIOD, campaign, noise, record, steady

SEEDS = range(12)
SITUATIONS = {
    "a burst": {},
    "a burst without quiet time": {"before": 0.0},
    "a burst and a long silence": {"after": 6.0, "before": 0.05},
    "a steady record": {"is_steady": True},
    "a steady record, 81.92 samples a period": {"is_steady": True, "rate": 2048.0},
}


def estimates(seeds, **options):
    """(seeds, channels) estimated over true standard deviation, and the noises."""
    ratios, found = [], []
    for seed in seeds:
        made, truth = record("r.csv", np.random.default_rng(seed), **options)
        levels = noise_levels(campaign(made))
        assert set(levels) == set(truth)
        ratios.append([levels[name].std / std for name, std in truth.items()])
        found.append(levels)
    return np.array(ratios), found


@pytest.mark.slow
@pytest.mark.parametrize("hum", [0.0, 0.07])
@pytest.mark.parametrize("kind", ["white", "red", "band"])
@pytest.mark.parametrize("situation", SITUATIONS)
def test_within_ten_percent_from_twelve_hits(situation, kind, hum):
    ratios, found = estimates(SEEDS, kind=kind, hum=hum, **SITUATIONS[situation])
    error = np.abs(ratios - 1.0)
    stated = np.mean([n.error for levels in found for n in levels.values()])
    print(f"{situation}, {kind}, hum {hum}: mean {ratios.mean():.3f}, std {ratios.std():.3f}, "
          f"stated {stated:.3f}, within 10 %: {100 * (error < 0.1).mean():.0f} %")  # fmt: skip
    assert abs(ratios.mean() - 1.0) < 0.035
    # Slow noise has few independent samples in 0.5 s of steady record: 4.7 % is its own spread.
    assert np.sqrt((error**2).mean()) < 0.06
    assert (error < 0.1).mean() >= 0.9
    assert ratios.std() < 1.6 * stated + 0.01


def test_within_ten_percent_white_quick():
    ratios, found = estimates(range(4), kind="white", hum=0.07)
    assert np.abs(ratios - 1.0).max() < 0.1
    for levels in found:
        for name, level in zip(CHANNELS, LEVELS, strict=True):
            (line,) = levels[name].hum
            assert line.frequency == pytest.approx(50.0, rel=6e-3)
            assert line.amplitude == pytest.approx(0.07 * level, rel=0.15)


@pytest.mark.slow
def test_no_hum_where_there_is_none():
    _, found = estimates(range(20), kind="red")
    assert not any(noise.hum for levels in found for noise in levels.values())


@pytest.mark.parametrize("kind", ["white", "red", "band"])
def test_spectrum_and_whitening(kind):
    made = [record(f"r{i}.csv", np.random.default_rng(i), kind=kind, before=1.0) for i in range(4)]
    found = noise_levels(campaign(*(m for m, _ in made)))
    b, a = {"white": ([1.0], [1.0]), "red": ([1.0], [1.0, -0.8]),
            "band": ([1.0], [1.0, -1.1, 0.7])}[kind]  # fmt: skip
    for name, std in made[0][1].items():
        level = found[name]
        assert level.white == (kind == "white")
        _, response = freqz(b, a, level.frequency, fs=level.rate)
        shape = np.abs(response) ** 2
        truth = std**2 * shape / (shape[1:-1].mean() * level.rate / 2.0)
        middle = slice(4, -4)
        assert np.abs(np.log(level.psd[middle] / truth[middle])).max() < 0.45
        area = level.psd.mean() * level.rate / 2.0
        assert area == pytest.approx(level.std**2, rel=0.03)
        alarms = [
            whiteness(level.model.whiten(noise(kind, 1500, std, np.random.default_rng(seed))),
                      std=1.0, level=0.01).alarm
            for seed in range(100, 120)
        ]  # fmt: skip
        assert sum(alarms) <= 4
        raw = whiteness(noise(kind, 1500, std, np.random.default_rng(9)), std=std, level=0.01)
        assert raw.alarm == (kind != "white")


def test_whitening_is_exact_from_the_first_sample_on():
    model = AutoRegression(np.array([0.8, -0.4, 0.3]), 2.5)
    lags = 40
    impulse = lfilter([1.0], np.append(1.0, -model.predictors[-1]), np.eye(1, 4000)[0])
    covariance = np.array([impulse[: 4000 - k] @ impulse[k:] for k in range(lags)])
    covariance *= 2.5 / covariance[0]
    np.testing.assert_allclose(model.autocorrelation(lags - 1), covariance / 2.5, atol=1e-12)
    whitener = model.whiten(np.eye(lags)).T  # columns: the filter's answer to each unit vector
    np.testing.assert_allclose(whitener @ toeplitz(covariance) @ whitener.T, np.eye(lags),
                               atol=1e-10)  # fmt: skip


def test_noise_without_variance_cannot_whiten():
    with pytest.raises(InputError, match="variance"):
        AutoRegression(np.zeros(0), 0.0).whiten(np.ones(4))
    with pytest.raises(InputError, match="no samples"):
        fit_autoregression([])


def test_repeats_that_differ_are_not_believed():
    rng = np.random.default_rng(0)
    made = [record(f"r{i}.csv", rng) for i in range(3)]
    other, _ = record("r3.csv", rng, change=lambda t, x: (t, {n: 0.9 * v for n, v in x.items()}))
    found = noise_levels(campaign(*(m for m, _ in made), other))
    for name, std in made[0][1].items():
        assert found[name].std == pytest.approx(std, rel=0.1)
        source = next(s for s in found[name].sources if s.method == "repeats")
        assert not source.used
        assert source.std > 2.0 * std


def test_repeats_alone():
    """Six repeats that start with the blow and end with it: nothing else to go by."""
    rng = np.random.default_rng(1)
    made = [record(f"r{i}.csv", rng, before=0.0, after=0.02, kind="red") for i in range(6)]
    found = noise_levels(campaign(*(m for m, _ in made)))
    for name, std in made[0][1].items():
        assert [s.method for s in found[name].sources] == ["repeats"]
        assert found[name].std == pytest.approx(std, rel=0.1)


def test_motion_gives_a_rough_floor():
    time = np.arange(4000) / 1000.0
    rng = np.random.default_rng(0)
    x = np.sin(time) + 1e-5 * rng.normal(size=time.size)
    motion = Record.from_arrays("m.csv", time, {"position.joint_1": x}, kind="motion")
    found = noise_levels(campaign(motion))["position.joint_1"]
    assert found.rough
    assert found.std == pytest.approx(1e-5, rel=0.1)


def test_resolution_is_a_floor():
    def coarse(time, arrays):
        step = 0.05 * LEVELS[0]
        return time, {n: step * np.round(v / step) for n, v in arrays.items()}

    made, truth = record("r.csv", np.random.default_rng(0), level=1e-4, channels=CHANNELS[:1],
                         change=coarse)  # fmt: skip
    found = noise_levels(campaign(made))[CHANNELS[0]]
    assert found.resolution == pytest.approx(0.05 * LEVELS[0])
    assert found.std >= found.resolution / np.sqrt(12.0) > truth[CHANNELS[0]]


def test_other_sample_rates():
    rng = np.random.default_rng(0)
    slow, truth = record("a.csv", rng, kind="red")
    fast, _ = record("b.csv", rng, kind="red", rate=4000.0)
    found = noise_levels(campaign(slow, fast))
    for name, std in truth.items():
        for rate in (2000.0, 4000.0):
            assert found[name].at(rate).rate == pytest.approx(rate)
            assert found[name].at(rate).std == pytest.approx(std, rel=0.12)
        assert found[name].at(500.0).white


@pytest.mark.parametrize("period", [0.0391, 0.04, 0.0412])
def test_the_period_is_found(period):
    time = np.arange(1000) / 2000.0
    clean = steady(time, (1.0, 0.5, 0.3), period=period)
    x = clean + 0.01 * clean.std() * np.random.default_rng(0).normal(size=time.size)
    assert find_period(time, x, PERIOD) == pytest.approx(period, rel=2e-4)


def test_jumps_are_no_noise():
    """A rectangular force, on any sampling of its edges."""
    for rate in (1000.0, 2000.0, 2048.0):
        time = np.arange(int(12 * PERIOD * rate)) / rate
        force = 300.0 * (np.mod(time + 1e-9, PERIOD) < 0.004)
        x = force + np.random.default_rng(0).normal(size=time.size)
        assert not_periodic(time, x, PERIOD).std == pytest.approx(1.0, rel=0.12)


def test_damped_waves_are_found():
    time = np.arange(1500) / 1000.0
    poles = 2 * np.pi * np.array([5.0, 11.0, 19.0]) * (-0.03 + 1j)
    rng = np.random.default_rng(0)
    weights = rng.normal(size=(4, 3)) + 1j * rng.normal(size=(4, 3))
    x = np.real(weights @ np.exp(np.outer(poles, time))) + 0.01 * rng.normal(size=(4, time.size))
    found = fit_ring_down(x, 1000.0)
    np.testing.assert_allclose(np.sort_complex(found.poles), np.sort_complex(poles), rtol=2e-3)
    assert fit_ring_down(x[:, :100], 1000.0) is None


@pytest.mark.parametrize("level", [0.05, 0.01])
@pytest.mark.parametrize("samples", [60, 1000])
def test_false_alarms_at_the_stated_rate(samples, level):
    """200 seeds; each test and all together within what chance allows (1 in 1,000 a side)."""
    seeds = range(200)
    every = [whiteness(np.random.default_rng(s).normal(size=samples), std=1.0, level=level)
             for s in seeds]  # fmt: skip
    low, high = binom.ppf([0.001, 0.999], len(seeds), level)
    for name in [r.name for r in every[0].results]:
        alarms = sum(w[name].probability < level for w in every)
        assert low <= alarms <= high, name
    together = sum(w.alarm for w in every)
    print(f"{samples} samples, level {level}: {together} of 200 together")
    assert low <= together <= high


def test_the_tests_see_what_they_should():
    rng = np.random.default_rng(0)
    red, hum = noise("red", 1000, 1.0, rng), rng.normal(size=1000)
    hum += 0.4 * np.sin(0.3 * np.arange(1000))
    assert flatness(red).probability < 1e-6
    assert runs(red).probability < 1e-6
    assert whiteness(red)["cumulated periodogram"].probability < 1e-6
    assert largest_line(hum, rate=1000.0).probability < 1e-6
    assert largest_line(hum, rate=1000.0).where.startswith("48 Hz")
    assert band_levels(1.3 * rng.normal(size=1000), 1.0).probability < 1e-6
    assert band_levels(0.7 * rng.normal(size=1000), 1.0).probability < 1e-6
    assert whiteness(hum).alarm
    with pytest.raises(InputError, match="16 samples"):
        flatness(np.zeros(5))
    with pytest.raises(InputError, match="no such test"):
        whiteness(hum)["smell"]
