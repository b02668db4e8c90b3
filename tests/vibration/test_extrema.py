"""Turning points and worst directions against dense sampling and brute force."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picchio.core.errors import InputError
from picchio.excitation.pulse_train import HalfSineTrain, PulseTrain
from picchio.vibration.closed_form.modes import modal_analysis
from picchio.vibration.closed_form.response import response_from_rest, steady_state

DIRECTION = np.array([0.48, -0.6, 0.64])


def turns(values):
    """Interior turning points of dense samples."""
    rising = np.diff(values) > 0
    return values[1:-1][rising[1:] != rising[:-1]]


def lasting(values, least):
    """Turning points without neighbours that differ by less than `least`."""
    kept = []
    for value in values:
        if kept and abs(value - kept[-1]) <= least:
            kept.pop()
        else:
            kept.append(value)
    return np.array(kept)


def are_among(few, many, tolerance):
    """Whether all of the first stand among the second, in their order."""
    rest = iter(many)
    return all(any(abs(value - other) <= tolerance for other in rest) for value in few)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), ratio=st.floats(0.01, 0.3), width=st.floats(0.001, 0.039))
def test_turning_points_are_those_of_a_dense_sampling(tools, seed, ratio, width):
    modes = modal_analysis(tools.system(seed=seed, ratio=ratio))
    response = response_from_rest(modes, PulseTrain(300.0, 0.04, width), 4)
    time = np.linspace(0.0, response.horizon, 120_001)
    dense = response.deflection(time, DIRECTION)
    for (_, values), samples in zip(response.turning_points(DIRECTION), dense, strict=True):
        size = np.abs(samples).max()
        assert values[0] == 0.0
        assert values[-1] == 0.0
        # Between samples a curve rises by at most its second difference over eight.
        sagitta = 0.5 * np.abs(np.diff(samples, 2)).max()
        assert size * (1 - 1e-12) <= np.abs(values).max() <= size + sagitta
        # Dense samples see the same turning points, in the same order, a little lower; a wiggle
        # smaller than what hides between two samples may be seen by one side alone.
        seen, exact = turns(samples), values[1:-1]
        for mine, others in ((seen, exact), (exact, seen)):
            assert are_among(lasting(mine, 5.0 * sagitta), others, 2.0 * sagitta)


@pytest.mark.parametrize("train", [PulseTrain(300, 0.04, 0.004), HalfSineTrain(300, 0.04, 0.02)])
def test_peaks_of_the_steady_state(tools, train):
    response = steady_state(modal_analysis(tools.system(seed=21)), train)
    time = np.linspace(0, 0.04, 400_001)
    dense = np.abs(response.deflection(time, DIRECTION)).max(axis=1)
    for peak, size in zip(response.peaks(DIRECTION), dense, strict=True):
        assert size * (1 - 1e-12) <= abs(peak.value) <= size * (1 + 1e-8)


def test_a_periodic_history_closes(tools):
    response = steady_state(modal_analysis(tools.system(seed=22)), PulseTrain(300, 0.04, 0.004))
    for time, value in response.turning_points(DIRECTION):
        assert value[0] == value[-1]
        assert time[-1] - time[0] == pytest.approx(0.04)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000), ratio=st.floats(0.01, 0.5), from_rest=st.booleans())
def test_no_direction_is_worse_than_the_worst(tools, seed, ratio, from_rest):
    modes = modal_analysis(tools.system(seed=seed, ratio=ratio))
    train = PulseTrain(300.0, 0.04, 0.004)
    response = response_from_rest(modes, train, 3) if from_rest else steady_state(modes, train)
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    g = response.unit_deflection(np.linspace(0, min(response.horizon, 0.4), 20_000)[:-1])
    for j, worst in enumerate(response.worst_directions()):
        brute = np.abs(directions @ g[j, :, ::10]).max()
        assert np.linalg.norm(worst.direction) == pytest.approx(1.0)
        assert worst.value >= brute * (1 - 1e-12)
        dense = np.linalg.norm(g[j], axis=0).max()
        assert worst.value == pytest.approx(dense, rel=1e-4)
        reached = response.peaks(worst.direction)[j]
        assert abs(reached.value) == pytest.approx(worst.value, rel=1e-12)


def test_a_joint_that_nothing_moves(tools):
    base = tools.system(seed=23)
    still = type(base)(
        np.diag([1.0, 2.0, 3.0]),
        np.diag([1.0, 1.0, 1.0]),
        np.diag([1e3, 2e3, 3e3]),
        np.array([[0.0, 0, 0], [1, 2, 3], [0, 1, 0]]),
        np.eye(3),
        base.output_names,
    )
    response = response_from_rest(modal_analysis(still), PulseTrain(300, 0.04, 0.004), 2)
    assert response.worst_directions()[0].value == 0.0
    assert response.peaks(DIRECTION)[0].value == 0.0
    assert np.abs(response.turning_points(DIRECTION)[0][1]).max() == 0.0


@pytest.mark.parametrize("direction", [[0, 0, 0], [1, 2], [np.nan, 0, 1], [np.inf, 0, 0]])
def test_a_direction_that_is_none(tools, direction):
    response = steady_state(modal_analysis(tools.system()), PulseTrain(300, 0.04, 0.004))
    with pytest.raises(InputError, match="direction"):
        response.deflection([0.0], direction)
