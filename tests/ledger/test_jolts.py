"""Blows in accelerations of mounts that ring, integrated by scipy, nothing of picchio."""

import numpy as np
import pytest
import shift
from scipy.signal import cont2discrete, lfilter

import picchio
from picchio.ledger import count as counting
from picchio.ledger.count import blows_held
from picchio.ledger.jolts import jolts
from picchio.ledger.samples import Samples
from picchio.ledger.store import SHIFT, Ledger, Stream
from picchio.model.model import Model
from picchio.studies.default_task import task_of

PEAK, NAME = 60.0, "fanuc_like_3dof"


def filtered(numerator, denominator, step, signal):
    b, a, _ = cont2discrete((numerator, denominator), step, method="foh")
    return lfilter(np.ravel(b), a, signal)


def reading(
    frequency, damping, rate, sampling, *, square=True, hits=12, noise=0.01, seed=0, onsets=None
):
    """Uneven blows on an arm (9 and 31 Hz), felt through a mount; each sample a mean over its step.

    Returns s, m/s^2, the blows' beginnings s, their width s.
    """
    rng = np.random.default_rng(seed)
    width = min(0.004, 0.1 / rate)
    if onsets is None:
        onsets = 0.3 + (np.arange(hits) + rng.uniform(-0.02, 0.02, hits)) / rate
    finer = max(1, int(np.ceil(max(16.0 * frequency, 40.0 / width) / sampling)))
    step = 1.0 / (sampling * finer)
    time = step * np.arange(int((onsets[-1] + 0.6) / step) // finer * finer)
    base = np.zeros_like(time)
    for onset, peak in zip(onsets, PEAK * rng.uniform(0.85, 1.15, len(onsets)), strict=True):
        share = (time - onset) / width
        shape = 1.0 if square else np.sin(np.pi * share)
        base += peak * shape * ((share >= 0.0) & (share < 1.0))
    w = 2.0 * np.pi * frequency
    felt = filtered([2 * damping * w, w * w], [1, 2 * damping * w, w * w], step, base)
    for hz, ratio, share in ((9.0, 0.03, 0.15), (31.0, 0.04, 0.2)):
        w = 2.0 * np.pi * hz
        felt += share * (filtered([1, 0, 0], [1, 2 * ratio * w, w * w], step, base) - base)
    felt = felt.reshape(-1, finer).mean(axis=1)
    felt += noise * PEAK * rng.standard_normal(felt.size)
    return time[::finer], felt, onsets, width


@pytest.mark.parametrize("frequency", [100.0, 250.0, 500.0, 1000.0, 3000.0, 10_000.0])
@pytest.mark.parametrize("damping", [0.005, 0.02, 0.1])
@pytest.mark.parametrize(("rate", "sampling"), [(10, 1000), (25, 5000), (60, 20_000), (17, 2000)])
def test_every_blow_is_counted_once_whatever_rings(frequency, damping, rate, sampling):
    square = rate != 17
    time, felt, onsets, width = reading(frequency, damping, rate, sampling, square=square)
    found = jolts(time, felt[:, None], 0.2 * PEAK, width, 1.0 / rate)
    assert len(found) == len(onsets)
    begins = np.array([begin for begin, _, _ in found])
    np.testing.assert_allclose(begins, onsets, rtol=0.0, atol=width + 1.0 / sampling)


@pytest.mark.parametrize("frequency", [130.0, 900.0])
@pytest.mark.parametrize("rate", [10, 17, 40, 60])
def test_the_task_need_not_know_the_rate(frequency, rate):
    time, felt, onsets, _ = reading(frequency, 0.01, rate, 5000)
    assert len(jolts(time, felt[:, None], 0.2 * PEAK, 0.004, 0.04)) == len(onsets)


def test_uneven_blows_single_ones_and_the_fastest_sampling():
    """22 impacts at any time, 30 ms and more apart; one alone; 0.1 s at 200 kHz."""
    rng = np.random.default_rng(7)
    onsets = 0.2 + np.cumsum(rng.uniform(0.03, 0.5, 22))
    time, felt, onsets, width = reading(400.0, 0.01, 25, 10_000, onsets=onsets)
    assert len(jolts(time, felt[:, None], 0.2 * PEAK, width, 0.04)) == 22
    time, felt, _, width = reading(2000.0, 0.005, 25, 10_000, hits=1)
    assert len(jolts(time, felt[:, None], 0.2 * PEAK, width, 0.04)) == 1
    time, felt, _, width = reading(4000.0, 0.01, 25, 200_000, hits=3)
    near = (time > 0.28) & (time < 0.4)
    assert len(jolts(time[near], felt[near, None], 0.2 * PEAK, width, 0.04)) == 3


@pytest.mark.parametrize("kind", ["sine", "lobes", "noise", "rough"])
@pytest.mark.parametrize("sampling", [1000, 5000, 25_600])
def test_a_drill_has_no_separate_blows(kind, sampling):
    rng = np.random.default_rng(1)
    time = np.arange(4 * sampling) / sampling
    noise = rng.standard_normal(time.size)
    turn = 2.0 * np.pi * time
    w = 2.0 * np.pi * 300.0
    rough = filtered([w * w], [1, 0.1 * w, w * w], 1.0 / sampling, noise)
    made = {
        "sine": np.sin(50.0 * turn),
        "noise": noise,
        "rough": rough / rough.std(),
        "lobes": np.abs(np.sin(23.0 * turn)) + 0.5 * np.sin(46.0 * turn + 1.0) + 0.2 * noise,
    }
    felt = 40.0 * made[kind] * ((time > 1.0) & (time < 3.0)) + 0.3 * rng.standard_normal(time.size)
    assert jolts(time, felt[:, None], 12.0, 0.004, 0.04) is None


@pytest.mark.parametrize("seed", range(2))
def test_cuts_of_a_ringing_log_change_nothing(tmp_path, seed):
    robot = picchio.load_robot(NAME)
    how = Model.of(robot), task_of(robot, None)
    onsets = np.concatenate([0.3 + 0.04 * np.arange(5), 1.4 + 0.04 * np.arange(6), [2.5]])
    time, felt, _, _ = reading(180.0, 0.01, 25, 2000, onsets=onsets)
    stamps = shift.BEGIN + np.rint(1e9 * time).astype(np.int64)
    whole = Samples("acceleration", stamps, felt[:, None], stamps[::20],
                    np.tile(shift.POSES[0], (stamps[::20].size, 1)))  # fmt: skip
    settings = {"operation": "upward", "sensor": ["acceleration.tool.z"], "hold": 80_000_000}
    stream = Stream("acceleration", whole.gap, 1, 12.0, 1.2, settings)

    def held(name, logs):
        """Of logs of one stretch or more."""
        with Ledger(tmp_path / name, NAME) as book:
            for number, parts in enumerate(logs):
                book.add(str(number), "m", "part", stream, parts)
            known = counting.streams_of(book)[0]
            found = [b for n in book.shifts() for b in blows_held(book, known, *how, n * SHIFT)]
            rows = book._base.execute("SELECT length(stamps) / 8 FROM run").fetchall()
        return [(b.onset, b.cut, b.peak) for b in found], sum(n for (n,) in rows)

    expected, kept = held("whole", [[whole]])
    assert len(expected) == onsets.size
    assert not any(cut for _, cut, _ in expected)
    assert kept < 0.6 * stamps.size  # silence is not held
    rng = np.random.default_rng(seed)
    ends = np.sort(rng.choice(stamps, 9, replace=False))
    edges = [stamps[0], *ends, stamps[-1] + 1]
    parts = [whole.between(a, b - 1) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    blocks, _ = held("blocks", [parts])
    logs, _ = held("logs", [[parts[k]] for k in rng.permutation(len(parts))])
    assert blocks == logs == expected
