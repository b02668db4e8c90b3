"""Residuals in numbers, against cases whose answer is known."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from picchio.prediction.residual import (
    ChannelResidual,
    by_window,
    growth_with_level,
    residual_torque,
    spectrum,
    together,
    transfer,
)

MASS = np.array([[30.0, 6.0], [6.0, 12.0]])
STIFFNESS = np.diag([9e4, 4e4])
DAMPING = np.diag([40.0, 20.0])
STEP = 1e-3


def part(residual=0.1, signal=1.0, noise=0.01, times=10.0, level=300.0, record="r01.csv"):
    return ChannelResidual(record, "deflection.joint_1", "deflection", 0, (1.0, 0.0, 0.0), level,
                           None, None, residual, signal, noise, times)  # fmt: skip


def test_one_channel():
    assert part().nrmse == pytest.approx(0.1)
    assert part(times=2.0).above_noise == pytest.approx(0.75)
    assert part(times=0.9).above_noise == 0.0
    assert np.isnan(part(signal=0.0).nrmse)


def test_channels_of_different_units_weigh_by_their_noise():
    coarse, fine = part(residual=1e-6, signal=1e-5, noise=1e-7), part(1.0, 2.0, 0.1)
    whole = together([coarse, fine])
    # (10^2 + 10^2) / (100^2 + 20^2)
    assert whole.nrmse == pytest.approx(np.sqrt(200.0 / 10400.0))
    assert whole.floor == pytest.approx(np.sqrt(2.0 / 10400.0))


def test_white_noise_has_a_power_of_one_and_a_line_stands_out():
    rng = np.random.default_rng(1)
    edges = np.linspace(0.5, 500.0, 21)
    rows = [rng.standard_normal(4000) for _ in range(20)]
    np.testing.assert_allclose(spectrum(rows, STEP, edges), 1.0, atol=0.1)
    time = np.arange(4000) * STEP
    rows = [row + np.sin(2 * np.pi * 60.0 * time) for row in rows]
    found = spectrum(rows, STEP, edges)
    assert edges[found.argmax()] <= 60.0 < edges[found.argmax() + 1]
    # The line's power, m / 4 at one of the band's lines.
    lines = (edges[1] - edges[0]) * 4000 * STEP
    assert found.max() == pytest.approx(1.0 + 4000 / 4.0 / lines, rel=0.1)


def test_windows_of_time():
    time = np.arange(100) * 0.01
    found = by_window([time, time], [np.ones(100), np.full(100, 3.0)], np.array([0, 0.5, 1, 1.5]))
    np.testing.assert_allclose(found[:2], np.sqrt(5.0))
    assert np.isnan(found[2])


@pytest.mark.parametrize("power", [0.0, 1.0, 3.0])
def test_how_the_residual_grows(power):
    rng = np.random.default_rng(2)
    parts = []
    for index, level in enumerate(np.geomspace(100, 400, 12)):
        size = (level / 200.0) ** power * (1.0 + 0.02 * rng.standard_normal())
        parts.append(part(0.1 * size, level / 200.0, 1e-3, 100.0 * size, level, f"r{index}.csv"))
    found, error = growth_with_level(parts)
    assert abs(found - power) < max(4.0 * error, 0.02)
    assert error < 0.05


def test_growth_needs_levels_that_differ():
    assert growth_with_level([part(record=f"r{i}.csv") for i in range(8)]) is None


def bent(torque):
    """The two joints' motion after a push, SciPy's, with another torque on the second."""

    def slope(t, y):
        x, v = y[:2], y[2:]
        push = np.array([300.0, 120.0]) * (t < 0.004)
        missing = np.array([0.0, torque(x[1], v[1])])
        return np.concatenate(
            [v, np.linalg.solve(MASS, push + missing - DAMPING @ v - STIFFNESS @ x)]
        )

    time = np.arange(1200) * STEP
    found = solve_ivp(slope, (0.0, time[-1]), np.zeros(4), t_eval=time, rtol=1e-10, atol=1e-13,
                      max_step=1e-3)  # fmt: skip
    return found.y[:2]


@pytest.mark.parametrize(
    "torque",
    [
        pytest.param(lambda x, v: -6e3 * x, id="softer spring"),
        pytest.param(lambda x, v: -2e9 * x**3, id="hardening"),
        pytest.param(lambda x, v: -30.0 * v, id="damping"),
        pytest.param(lambda x, v: -1.5 * np.tanh(v / 1e-4), id="friction"),
    ],
)
def test_the_missing_torque_is_found_on_the_right_joint(torque):
    model, world = bent(lambda x, v: 0.0), bent(torque)
    first, second = residual_torque(MASS, DAMPING, STIFFNESS, world, model, STEP)
    true = np.array([torque(x, v) for x, v in zip(second.deflection, second.velocity, strict=True)])
    size = np.sqrt(np.mean(true**2))
    assert np.sqrt(np.mean(first.torque**2)) < 0.2 * size
    assert np.sqrt(np.mean((second.torque - true) ** 2)) < 0.35 * size
    assert np.corrcoef(second.torque, true)[0, 1] > 0.93


def test_transfer_of_a_known_oscillator():
    """Against x/F = 1 / (k - m w^2 + i c w)."""
    time = np.arange(6000) * STEP
    rng = np.random.default_rng(3)
    m, c, k = 10.0, 60.0, 9e4
    forces, answers = [], []
    for index in range(4):
        f = np.where((time > 0.1) & (time < 0.1 + 0.004 * (1 + index)), 300.0, 0.0)
        spectrum_of = np.fft.rfft(f, 4 * f.size)
        w = 2 * np.pi * np.fft.rfftfreq(4 * f.size, STEP)
        answers.append(np.fft.irfft(spectrum_of / (k - m * w**2 + 1j * c * w))[: f.size])
        forces.append(f)
    noisy = [x + 1e-6 * rng.standard_normal(x.size) for x in answers]
    found = transfer(forces, noisy, answers, STEP)
    w = 2 * np.pi * found.frequency
    inside = (found.frequency > 5.0) & (found.frequency < 30.0)
    true = 1.0 / (k - m * w**2 + 1j * c * w)
    np.testing.assert_allclose(found.measured[inside], true[inside], rtol=0.1)
    assert found.coherence[inside].min() > 0.95
    far = found.frequency > 300.0
    assert np.median(found.coherence[far]) < 0.7


def test_transfer_of_a_single_record_has_a_coherence():
    rng = np.random.default_rng(4)
    f = rng.standard_normal(8000)
    found = transfer([f], [0.5 * f + 0.5 * rng.standard_normal(8000)], [0.5 * f], STEP)
    assert np.median(found.coherence) == pytest.approx(0.5, abs=0.1)
    assert np.median(np.abs(found.simulated)) == pytest.approx(0.5, abs=1e-6)
