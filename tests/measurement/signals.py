"""Records of arms that ring, in NumPy alone: damped sines, and noise whose truth is known."""

from functools import cache

import numpy as np
from scipy.signal import lfilter, welch

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record

PERIOD, WIDTH, HITS, FORCE = 0.040, 0.004, 12, 300.0
POSE = {"joint_1": 0.3, "joint_2": 0.5, "joint_3": -0.8}
EXCITATION = {"kind": "pulse_train", "force": FORCE, "period": PERIOD, "width": WIDTH}
MODES = ((5.3, 0.03), (11.0, 0.035), (23.0, 0.02))
CHANNELS = ("deflection.joint_1", "deflection.joint_2", "velocity.tool.x", "accelerometer.tool.x")
LEVELS = (1e-3, 8e-4, 0.05, 2.0)


def one_blow(time, mode, width=WIDTH):
    """Deflection, velocity and acceleration of one oscillator after a rectangular blow at 0."""
    w, z = 2 * np.pi * mode[0], mode[1]
    s = w * (-z + 1j * np.sqrt(1 - z * z))

    def step(t):
        t = t + 1e-9  # a sample at the edge holds the value just after it
        late = np.clip(t, 0.0, None)
        wave = np.exp(s * late)
        a = 1.0 / s.imag
        x = (1.0 - (wave.real - s.real * a * wave.imag)) / w**2
        return np.where(t >= 0.0, [x, a * wave.imag, wave.real + s.real * a * wave.imag], 0.0)

    return step(time) - step(time - width)


def burst(time, weights, hits=HITS, period=PERIOD, width=WIDTH, order=0):
    """(m,) the sum of the modes' answers to a burst; order 1 is its velocity, 2 its acceleration"""
    total = np.zeros(time.size)
    for mode, weight in zip(MODES, weights, strict=True):
        for h in range(hits):
            total += weight * one_blow(time - h * period, mode, width)[order]
    return total


def steady(time, weights, period=PERIOD, width=WIDTH, order=0):
    """(m,) the same under blows without end, by waiting until it repeats; the mean taken off."""
    whole = burst(time + 250 * period, weights, 250 + int(time[-1] / period) + 1, period, width,
                  order)  # fmt: skip
    return whole - whole.mean()


@cache
def clean_signal(first, last, rate, seed, order, hits):
    """Of samples at a rate, without noise; under blows without end where there is no number."""
    time, weights = np.arange(first, last) / rate, np.random.default_rng(seed).normal(size=3)
    if hits is None:
        return steady(time, weights, order=order)
    return burst(time, weights, hits, order=order)


def noise(kind, samples, std, rng):
    """Noise of this standard deviation: white, or one of two colours."""
    white = rng.normal(size=samples + 500)
    if kind == "white":
        return std * white[500:]
    filters = {"red": ([1.0], [1.0, -0.8]), "band": ([1.0], [1.0, -1.1, 0.7])}
    b, a = filters[kind]
    impulse = lfilter(b, a, np.eye(1, 400)[0])
    return std * lfilter(b, a, white)[500:] / np.sqrt((impulse**2).sum())


def record(file, rng, *, kind="white", level=0.01, hum=0.0, rate=2000.0, before=0.1, after=1.2,
           is_steady=False, hits=HITS, change=None, channels=CHANNELS,
           seeds=0, **table):  # fmt: skip
    """A percussion record, and the noise's true standard deviation by channel."""
    duration = hits * PERIOD + (0.0 if is_steady else after)
    first = 0 if is_steady else -round(before * rate)
    time = np.arange(first, round(duration * rate)) / rate
    arrays, truth = {}, {}
    for index, name in enumerate(CHANNELS):
        order = 1 if name.startswith("vel") else 2 if name.startswith("acc") else 0
        given = None if is_steady else hits
        clean = clean_signal(first, round(duration * rate), rate, index + seeds, order, given)
        clean = clean * (LEVELS[index] / np.sqrt(np.mean(clean**2)))
        if name not in channels:
            continue
        truth[name] = level * LEVELS[index]
        phase = rng.uniform(0, 2 * np.pi)
        arrays[name] = (
            clean
            + noise(kind, time.size, truth[name], rng)
            + hum * LEVELS[index] * np.sin(2 * np.pi * 50.0 * time + phase)
        )
    if change is not None:
        time, arrays = change(time, arrays)
    keys = {"pose": POSE, "direction": [1.0, 0.0, 0.0], **table}
    if not is_steady:
        keys["hits"] = hits
    return Record.from_arrays(file, time, arrays, **keys), truth


def campaign(*records, **table):
    """A campaign of the paper's arm."""
    given = {"robot": "fanuc_like_3dof", "tool": "tool", "excitation": EXCITATION, **table}
    return Campaign.from_records(records, **given)


__all__ = ["CHANNELS", "LEVELS", "burst", "campaign", "noise", "record", "steady", "welch"]
