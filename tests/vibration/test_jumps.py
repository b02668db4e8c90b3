"""A jump between samples, seen through a filter that takes straight lines between them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

import picchio
from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.model.effects.effect import Effect
from picchio.model.effects.registry import effect_class
from picchio.prediction import percussion as percussion_setup
from picchio.prediction.percussion import predict
from picchio.vibration.integration.integrate import jump_corrections

STEP = 1e-4
FREQUENCY, DAMPING = 140.0, 0.05


def filtered(values):
    w = 2.0 * np.pi * FREQUENCY
    system = ([w * w], [1.0, 2.0 * DAMPING * w, w * w])
    b, a, _ = cont2discrete(system, STEP, method="foh")
    return lfilter(np.squeeze(b), a, values)


def step_response(times):
    """Of the same oscillator, closed form."""
    w = 2.0 * np.pi * FREQUENCY
    t, wd = np.maximum(times, 0.0), w * np.sqrt(1.0 - DAMPING**2)
    ring = np.exp(-DAMPING * w * t) * (np.cos(wd * t) + DAMPING * w / wd * np.sin(wd * t))
    return np.where(times > 0.0, 1.0 - ring, 0.0)


def sampled(jump, times):
    return np.where(np.abs(times - jump) < 1e-12, 0.5, (times > jump).astype(float))


@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.5, 0.77, 0.999])
def test_a_filter_answers_to_a_jump_as_in_closed_form(share):
    times = STEP * np.arange(-20, 400)
    jump = (10 + share) * STEP
    late = times > jump + 3 * STEP
    plain = filtered(sampled(jump, times))
    added = jump_corrections(times[0], STEP, times.size, 0, np.array([jump]), np.ones(1))
    right = step_response(times - jump)[late]
    error = np.abs(filtered(sampled(jump, times) + added)[late] - right).max()
    assert error < 2e-5
    if share not in (0.0, 0.5):
        assert error < 0.01 * np.abs(plain[late] - right).max()


def test_the_correction_is_continuous_in_the_jumps_time():
    times = STEP * np.arange(0, 60)
    jumps = np.linspace(20.0, 23.0, 3001) * STEP
    rows = [
        sampled(j, times) + jump_corrections(0.0, STEP, 60, 0, np.array([j]), np.ones(1))
        for j in jumps
    ]
    assert np.abs(np.diff(rows, axis=0)).max() < 2e-3  # a thousandth of a step each


@pytest.mark.parametrize("jump", [2.3, 2.0, 1.9, 1.51, 1.49, 1.1])
def test_area_and_moment_hold_where_nothing_stands_on_the_left(jump):
    """The first blow comes between a sample that is at rest and the first that moves."""
    first, time = 2, np.arange(8)
    added = jump_corrections(0.0, 1.0, time.size, first, np.array([jump]), np.array([4.0]))
    assert not added[:first].any()
    held = 4.0 * sampled(jump, time) + added
    # Of straight lines through the samples, and of the step itself, up to the last sample.
    area = held[:-1].sum() + 0.5 * held[-1]
    moment = held[:-1] @ time[:-1] + held[-1] * (0.5 * time[-1] - 1.0 / 6.0)
    assert area == pytest.approx(4.0 * (time[-1] - jump))
    assert moment == pytest.approx(2.0 * (time[-1] ** 2 - jump**2))


class Rise(Effect):
    """Blows that take so many seconds to rise; not in the catalogue."""

    name, where, target_kind, parameters, meaning = "rise", "blows", "tool", (), ""

    def __init__(self, rise):
        super().__init__("tool")
        self.rise = rise
        self.__dict__["key"] = ("rise", rise)

    def blows(self, blows, conditions):
        return blows.change(shape=blows.shape.ramped(self.rise))


def _read(width, effect, monkeypatch, fine=1e-4, offset=0.0005, rise=0.0):
    monkeypatch.setattr(percussion_setup, "_FILTER_STEP", fine)
    arm = picchio.load_robot("fanuc_like_3dof")
    time = np.arange(-40, 500) * 1e-3 + offset
    names = [f"accelerometer.tool.{axis}" for axis in "xyz"]
    record = Record.from_arrays(
        "r01.csv", time, {name: np.zeros(time.size) for name in names},
        pose={"joint_1": 0.2, "joint_2": 0.5, "joint_3": -0.4}, direction=[0.3, 0.2, 1.0],
    )  # fmt: skip
    blows = {"kind": "pulse_train", "force": 300.0, "period": 0.04, "width": width, "hits": 6}
    campaign = Campaign.from_records([record], robot="fanuc_like_3dof", excitation=blows)
    effects = [effect, Rise(rise)] if rise else [effect]
    read = predict(arm, campaign, effects)["r01.csv"]
    return np.stack([read[name] for name in names])


@pytest.mark.parametrize("offset", [0.0005, 0.00051, 0.00047])
@pytest.mark.parametrize("width", [0.003067, 0.00312, 0.0035])
def test_a_mounted_accelerometer_reads_what_a_finer_filter_reads(width, offset, monkeypatch):
    mount = effect_class("mount_resonance")("accelerometer.tool")
    effect = mount.with_values(frequency=73.0, damping_ratio=0.05)
    coarse = _read(width, effect, monkeypatch, 1e-4, offset)
    fine = _read(width, effect, monkeypatch, 2e-6, offset)
    # Samples a step of the filter after the very first edge cannot know all of it.
    assert np.abs(coarse - fine).max() < (3e-5 if offset == 0.0005 else 2e-4) * np.abs(fine).max()


@pytest.mark.parametrize("rise", [1e-5, 6.1e-5, 2.3e-4, 6.7e-4])
@pytest.mark.parametrize("width", [0.003067, 0.0035])
def test_a_rise_between_the_steps_of_a_filter_is_seen_by_it(width, rise, monkeypatch):
    mount = effect_class("mount_resonance")("accelerometer.tool")
    effect = mount.with_values(frequency=73.0, damping_ratio=0.05)
    coarse = _read(width, effect, monkeypatch, 1e-4, rise=rise)
    fine = _read(width, effect, monkeypatch, 2e-6, rise=rise)
    assert np.abs(coarse - fine).max() < 3e-5 * np.abs(fine).max()
    sharp = _read(width, effect, monkeypatch, 1e-4)
    assert np.abs(sharp - fine).max() > 100.0 * rise * np.abs(fine).max()


def test_a_high_pass_lets_jumps_through_as_they_are(monkeypatch):
    """What stands in for a jump before a filter must not show where there is none."""
    highpass = effect_class("sensor_highpass")("accelerometer.tool").with_values(frequency=0.3)
    nothing = effect_class("sensor_gain")("accelerometer.tool")
    filtered = _read(0.00308, highpass, monkeypatch)
    plain = _read(0.00308, nothing, monkeypatch)
    assert np.abs(filtered - plain)[:, 38:60].max() < 0.01 * np.abs(plain).max()
