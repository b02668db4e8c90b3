from __future__ import annotations

import math
import subprocess
import sys
from collections import defaultdict

import numpy as np
import pytest
import rainflow as oracle
from hypothesis import given, settings
from hypothesis import strategies as st

from picchio.core.errors import InputError
from picchio.core.results import plain
from picchio.fatigue.counting.counter import RESIDUE_RULES, RainflowCounter, Residue, rainflow
from picchio.fatigue.counting.cycles import Cycles

ASTM = [-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0]  # E1049-85, figures 6 and 7

histories = st.one_of(
    st.lists(st.floats(-1e6, 1e6, width=32).map(lambda x: round(x, 6)), min_size=1, max_size=60),
    st.lists(st.integers(-3, 3).map(float), min_size=1, max_size=60),  # ties and plateaus
)


def table(cycles: Cycles) -> dict[tuple[float, float], float]:
    """{(range, mean): count}: a measure that no order of closing can change; bits are kept."""
    total: dict[tuple[float, float], float] = defaultdict(float)
    for size, mean, count in zip(cycles.range, cycles.mean, cycles.count, strict=True):
        total[float(size), float(mean) + 0.0] += float(count)
    return {key: count for key, count in total.items() if key[0] > 0}


def oracle_cycles(history: list[float]) -> Cycles:
    # The package finds nothing in exactly two samples (rainflow 3.2.0 never sets its index
    # there); the last one twice is the same history.
    history = history + history[-1:]
    found = np.array([c[:3] for c in oracle.extract_cycles(history)]).reshape(-1, 3)
    return Cycles(found[:, 0], found[:, 1], found[:, 2])


def assert_same(ours: Cycles, theirs: Cycles) -> None:
    # Both subtract and halve the same samples, so not only to 1e-12 but to the last bit.
    assert table(ours) == table(theirs)


def test_astm_example_half_cycles() -> None:
    cycles = rainflow(ASTM)
    counts: dict[float, float] = defaultdict(float)
    for size, count in zip(cycles.range, cycles.count, strict=True):
        counts[float(size)] += float(count)
    # E1049-85 (2017), table 1 of its section 5.4.4.
    assert dict(counts) == {3.0: 0.5, 4.0: 1.5, 6.0: 0.5, 8.0: 1.0, 9.0: 0.5}


def test_astm_example_repeating() -> None:
    # E1049-85 (2017), section 5.4.5: the same history, repeating: 3, 4, 7 and 9 once each.
    cycles = rainflow(ASTM, "repeated")
    assert sorted(cycles.range.tolist()) == [3.0, 4.0, 7.0, 9.0]
    assert cycles.count.tolist() == [1.0] * 4


@given(histories)
@settings(max_examples=400)
def test_against_the_rainflow_package(history: list[float]) -> None:
    assert_same(rainflow(history), oracle_cycles(history))


@pytest.mark.parametrize("seed", range(5))
def test_long_random_and_periodic_against_the_rainflow_package(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.arange(20_000) * 1e-3
    for history in (
        rng.normal(size=20_000),
        np.cumsum(rng.normal(size=20_000)),
        np.sin(2 * np.pi * 7.3 * t) + 0.4 * np.sin(2 * np.pi * 31.0 * t + seed),
        np.exp(-t) * np.sin(2 * np.pi * 5.0 * t),
        np.repeat(rng.integers(-4, 5, size=5_000), 4).astype(float),
    ):
        ours = rainflow(history)
        theirs = oracle_cycles(history.tolist())
        assert ours.total == theirs.count[theirs.range > 0].sum()
        assert_same(ours, theirs)


@given(histories, st.sampled_from(["half-cycles", "repeated"]))
def test_the_largest_range_is_peak_to_peak(history: list[float], rule: Residue) -> None:
    cycles = rainflow(history, rule)
    assert max(cycles.range, default=0.0) == max(history) - min(history)


@given(histories, st.lists(st.integers(0, 60), max_size=6), st.sampled_from(RESIDUE_RULES))
def test_no_cut_loses_a_cycle(history: list[float], cuts: list[int], rule: Residue) -> None:
    counter = RainflowCounter()
    for chunk in np.split(np.array(history), sorted(cuts)):
        counter.add(chunk)
    whole = rainflow(history, rule)
    assert plain(vars(counter.cycles(rule))) == plain(vars(whole))
    # Asking in between changes nothing.
    counter = RainflowCounter()
    for chunk in np.split(np.array(history), sorted(cuts)):
        counter.add(chunk)
        counter.cycles(rule)
    assert plain(vars(counter.cycles(rule))) == plain(vars(whole))


@given(histories)
def test_repeated_is_what_many_repeats_add(history: list[float]) -> None:
    once, twice = (rainflow(history * n) for n in (3, 4))
    per_repeat: dict[float, float] = defaultdict(float)
    for sign, cycles in ((1, twice), (-1, once)):
        for size, count in zip(cycles.range, cycles.count, strict=True):
            per_repeat[round(float(size), 6)] += sign * float(count)
    expected: dict[float, float] = defaultdict(float)
    for size in rainflow(history, "repeated").range:
        expected[round(float(size), 6)] += 1.0
    found = {size: count for size, count in per_repeat.items() if count and size}
    assert found == {size: count for size, count in expected.items() if size}


@given(histories)
def test_shift_scale_and_turn_over(history: list[float]) -> None:
    signal = np.array(history)
    plain = rainflow(signal)
    np.testing.assert_array_equal(rainflow(-signal).range, plain.range)
    np.testing.assert_array_equal(rainflow(-signal).mean, -plain.mean)
    np.testing.assert_array_equal(rainflow(4.0 * signal).range, plain.scaled(4.0).range)
    np.testing.assert_array_equal(rainflow(np.repeat(signal, 3)).range, plain.range)


def test_a_lone_ring_down_has_cycles() -> None:
    # pyLife drops the residue: a single impact's ring-down counts as no cycle at all there.
    pylife = pytest.importorskip("pylife.stress.rainflow")
    t = np.arange(4000) * 1e-3
    blow = np.exp(-0.94 * t) * np.sin(2 * np.pi * 5.0 * t)
    recorder = pylife.LoopValueRecorder()
    pylife.FourPointDetector(recorder=recorder).process(blow)
    assert len(recorder.values_from) == 0
    assert len(rainflow(blow, "discarded")) == 0
    cycles = rainflow(blow)
    assert len(cycles) == 41
    assert cycles.range.max() == blow.max() - blow.min()


def test_constants_and_two_points() -> None:
    for rule in RESIDUE_RULES:
        assert len(rainflow([3.0], rule)) == 0
        assert len(rainflow([3.0, 3.0, 3.0], rule)) == 0
    assert plain(vars(rainflow([1.0, 4.0]))) == {"range": [3.0], "mean": [2.5], "count": [0.5]}
    whole = rainflow([1.0, 4.0], "repeated")
    assert plain(vars(whole)) == {"range": [3.0], "mean": [2.5], "count": [1.0]}
    assert len(rainflow([1.0, 4.0], "discarded")) == 0
    assert rainflow(np.array([0, 3, 0], dtype=np.uint8)).range.tolist() == [3.0, 3.0]


@pytest.mark.parametrize(
    "bad",
    [[], [[1.0, 2.0]], [1.0, math.nan, 2.0], [1.0, math.inf], ["a", "b"], [1j, 2.0], None, 3.0],
)
def test_bad_histories_are_refused(bad: object) -> None:
    with pytest.raises(InputError, match="history"):
        rainflow(bad)  # type: ignore[arg-type]


def test_an_unknown_rule_is_refused() -> None:
    with pytest.raises(InputError, match=r"did you mean 'repeated'"):
        rainflow([0.0, 1.0], "repeat")  # type: ignore[arg-type]


def test_a_refused_chunk_changes_nothing() -> None:
    counter = RainflowCounter()
    counter.add([0.0, 2.0])
    with pytest.raises(InputError, match="index 1"):
        counter.add([1.0, math.nan])
    counter.add([])
    assert counter.residue.tolist() == [0.0, 2.0]


def test_cycles_are_read_only_and_checked() -> None:
    cycles = rainflow(ASTM)
    with pytest.raises(ValueError, match="read-only"):
        cycles.range[0] = 1.0
    with pytest.raises(InputError, match="equally long"):
        Cycles([1.0], [0.0, 1.0], [1.0])  # type: ignore[arg-type]
    with pytest.raises(InputError, match="negative"):
        Cycles(np.array([-1.0]), np.array([0.0]), np.array([1.0]))


def test_numba_loads_with_the_first_count() -> None:
    code = (
        "import sys, picchio\n"
        "from picchio.fatigue.sn.library import load_sn_curve\n"
        "from picchio.fatigue.counting.counter import rainflow\n"
        "early = {'numba', 'scipy', 'pinocchio'} & set(sys.modules)\n"
        "load_sn_curve('42CrMo4-QT-shaft').cycles_to_failure([3e8])\n"
        "assert not early and 'numba' not in sys.modules, early\n"
        "rainflow([0.0, 1.0])\n"
        "assert 'numba' in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
