"""The sensors' filters against scipy.signal, their band, their clock, and the noise."""

import numpy as np
import pytest
from scipy import signal as dsp

from worlds import campaign
from worlds.sensors import Sensor

STEP = 1e-3
STOPS = np.arange(0.0, 1.0 + STEP / 2, STEP)
TIMES = STOPS[:-1] + 0.0


def sampled(function):
    """A signal on the intervals, as the kernel gives it."""
    parts = [STOPS[:-1], STOPS[:-1] + STEP / 2, STOPS[1:]]
    return np.stack([function(t) for t in parts], axis=1)[:, :, None]


def tone(t):
    return np.sin(2 * np.pi * 9.0 * t) + 0.3 * np.cos(2 * np.pi * 31.0 * t)


@pytest.mark.parametrize(
    ("sensor", "system"),
    [
        (Sensor(highpass=1.5), ([1.0, 0.0], [1.0, 2 * np.pi * 1.5])),
        (
            Sensor(highpass=2.0, order=2),
            (
                [1.0, 0.0, 0.0],
                [1.0, np.sqrt(2.0) * 2 * np.pi * 2.0, (2 * np.pi * 2.0) ** 2],
            ),
        ),
        (Sensor(lowpass=40.0), ([2 * np.pi * 40.0], [1.0, 2 * np.pi * 40.0])),
        (
            Sensor(mount=(90.0, 0.05)),
            (
                [(2 * np.pi * 90.0) ** 2],
                [1.0, 2 * 0.05 * 2 * np.pi * 90.0, (2 * np.pi * 90.0) ** 2],
            ),
        ),
    ],
)
def test_filters_are_the_contracts(sensor, system):
    """Against scipy on a grid forty times as fine, a jump at the start included."""
    fine = np.arange(0.0, 1.0, STEP / 40)
    known = dsp.lsim(system, tone(fine), fine)[1][::40]
    found = sensor.read(STOPS, sampled(tone), TIMES, 0.0)[:, 0]
    assert np.abs(found - known[: found.size]).max() < 2e-4 * np.abs(known).max()


@pytest.mark.parametrize("order", [1, 2])
def test_a_digital_high_pass_is_the_bilinear_transform_of_the_samples(order):
    """Near the analogue one as long as the samples are dense, and not the same."""
    plain = Sensor().read(STOPS, sampled(tone), TIMES, 0.0)[:, 0]
    found = Sensor(highpass=2.0, order=order, digital=True)
    found = found.read(STOPS, sampled(tone), TIMES, 0.0)[:, 0]
    known = dsp.lfilter(*dsp.butter(order, 2.0, "high", fs=1.0 / STEP), plain)
    assert np.abs(found - known).max() < 1e-9
    analogue = Sensor(highpass=2.0, order=order).read(STOPS, sampled(tone), TIMES, 0.0)[:, 0]
    assert 1e-4 < np.abs(found - analogue).max() / np.abs(analogue).max() < 0.02


def test_the_sensors_band_is_flat_where_the_arm_is():
    for f, low, high in ((10.0, 0.9999, 1.0001), (100.0, 0.9999, 1.0001), (375.0, 0.69, 0.72)):
        times = np.arange(300, 700) * STEP
        fine = np.arange(0.0, 1.0 + 1e-9, STEP / 8)
        middle = 0.5 * (fine[:-1] + fine[1:])
        wave = np.stack([np.sin(2 * np.pi * f * t) for t in (fine[:-1], middle, fine[1:])], axis=1)
        found = Sensor(bandwidth=375.0).read(fine, wave[:, :, None], times, 0.0)[:, 0]
        basis = np.stack([np.sin(2 * np.pi * f * times), np.cos(2 * np.pi * f * times)])
        share = np.linalg.lstsq(basis.T, found, rcond=None)[0]
        assert low < share[0] < high and abs(share[1]) < 1e-4


def test_between_the_samples_a_wide_band_shows_the_value_just_after_a_jump():
    """The default: 5 kHz, samples half a step from where blows begin and end."""
    box = np.where((STOPS[:-1] >= 0.1) & (STOPS[:-1] < 0.104), 1.0, 0.0)
    wave = np.repeat(box[:, None, None], 3, axis=1)
    found = Sensor(bandwidth=5000.0).read(STOPS, wave, TIMES + STEP / 2, 0.0)[:, 0]
    assert np.abs(found - box).max() < 1e-6


def test_clock_and_delay():
    times = np.arange(100, 900) * STEP
    sensor = Sensor(delay=0.002, rate=0.005, bandwidth=5000.0)
    found = sensor.read(STOPS, sampled(tone), times, 0.0)[:, 0]
    assert np.abs(found - tone(times * 1.005 - 0.002)).max() < 1e-4


def test_order_gain_before_clipping_before_hum():
    sensor = Sensor(gain=2.0, limit=1.0, hum=(0.1, 50.0), turn=np.eye(3)[[1, 0, 2]])
    wave = np.concatenate([sampled(tone), 0.1 * sampled(tone), 0.0 * sampled(tone)], axis=2)
    found = sensor.read(STOPS, wave, TIMES, 0.3)
    hum = 0.1 * np.sin(2 * np.pi * 50.0 * TIMES + 0.3)
    assert np.allclose(found[:, 0], 0.2 * tone(TIMES) + hum, atol=1e-9)
    assert np.allclose(found[:, 1], np.clip(2.0 * tone(TIMES), -1, 1) + hum, atol=1e-9)
    assert np.allclose(found[:, 2], hum, atol=1e-9)


def test_noise_is_stationary_of_unit_variance_and_slightly_coloured():
    made = campaign.noise((200000, 2), np.random.default_rng(1))
    assert np.allclose(made.var(axis=0), 1.0, atol=0.02)
    first, last = made[:1000].std(), made[-1000:].std()
    assert 0.9 < first / last < 1.1
    lag = (made[1:] * made[:-1]).mean()
    assert lag == pytest.approx(0.2 * 0.7, abs=0.01)
