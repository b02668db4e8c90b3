"""The compiled kernel against the NumPy path, and against brute force over directions."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from picchio.core.errors import InputError
from picchio.excitation.measured import MeasuredForce
from picchio.excitation.pulse_train import HalfSineTrain, PulseTrain
from picchio.model.linear_system import LinearSystem, modal_damping_matrix
from picchio.vibration.batch.peaks import batch_peaks
from picchio.vibration.closed_form.modes import modal_analysis
from picchio.vibration.closed_form.response import steady_state

TRAINS = [
    PulseTrain(300.0, 0.040, 0.004),
    PulseTrain(300.0, 0.3, 0.1),
    HalfSineTrain(300.0, 0.050, 0.020),
    MeasuredForce(np.array([0.0, 0.002, 0.005, 0.03]), np.array([10.0, 300.0, -40.0, 0.0]), 0.04),
]


def random_poses(seed, poses, n):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(poses, n, n))
    mass = root @ root.transpose(0, 2, 1) + n * np.eye(n)
    return mass, rng.normal(size=(poses, 3, n)), rng.uniform(1e3, 1e5, (poses, n))


@settings(max_examples=40, deadline=None)
# Modes that nearly cancel: a top stands far above the samples beside it.
@example(seed=99_999, n=2, train=TRAINS[3], hits=5, fixed=False, ratio=0.5)
@example(seed=85, n=5, train=TRAINS[0], hits=5, fixed=False, ratio=0.046)
@given(
    seed=st.integers(0, 100_000),
    n=st.integers(1, 7),
    train=st.sampled_from(TRAINS),
    hits=st.sampled_from([None, 1, 5]),
    fixed=st.booleans(),
    ratio=st.floats(0.005, 0.6),
)
def test_the_compiled_path_is_the_numpy_path(seed, n, train, hits, fixed, ratio):
    mass, jacobian, springs = random_poses(seed, 3, n)
    options = {"hits": hits, "direction": [0.48, -0.6, 0.64] if fixed else None}
    fast = batch_peaks(mass, jacobian, springs, ratio, train, **options)
    slow = batch_peaks(mass, jacobian, springs, ratio, train, compiled=False, **options)
    np.testing.assert_allclose(fast.natural_frequencies, slow.natural_frequencies, rtol=1e-9)
    np.testing.assert_allclose(fast.peak_deflection, slow.peak_deflection, rtol=1e-9)
    if not fixed:
        aligned = np.abs((fast.direction * slow.direction).sum(axis=-1))
        # Two directions may tie; where they do not, they are the same.
        assert (aligned > 1 - 1e-6).mean() > 0.9


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 100_000), n=st.integers(2, 6), train=st.sampled_from(TRAINS))
def test_no_direction_of_100000_is_worse(seed, n, train):
    mass, jacobian, springs = random_poses(seed, 1, n)
    worst = batch_peaks(mass, jacobian, springs, 0.03, train)
    rng = np.random.default_rng(seed)
    # Dense around the worst, sparse elsewhere.
    spread = rng.normal(size=(50_000, 3))
    for j in range(n):
        near = worst.direction[0, j] + 1e-3 * rng.normal(size=(50_000, 3))
        directions = np.concatenate([spread, near])
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        damping = modal_damping_matrix(mass[0], springs[0], 0.03)
        names = tuple("abcdefg"[:n])
        system = LinearSystem(
            mass[0], damping, np.diag(springs[0]), jacobian[0].T, np.eye(n), names
        )
        response = steady_state(modal_analysis(system), train)
        times = np.linspace(0, train.period, 200, endpoint=False)
        at_top = response.worst_directions()[j].time + np.linspace(-1e-5, 1e-5, 21)
        g = response.unit_deflection(np.concatenate([times, at_top]))[j]
        brute = np.abs(directions @ g).max()
        assert worst.peak_deflection[0, j] >= brute * (1 - 1e-12)
        assert worst.peak_deflection[0, j] <= brute * (1 + 1e-6)


def test_two_directions_that_tie_and_a_joint_that_nothing_moves():
    mass = np.diag([2.0, 3.0, 1.0])[None]
    jacobian = np.zeros((1, 3, 3))
    jacobian[0, 0, 0] = jacobian[0, 1, 1] = 1.0  # the third joint sees no force
    springs = np.array([2e4, 3e4, 1e4])
    found = batch_peaks(mass, jacobian, springs, 0.03, TRAINS[0])
    assert found.peak_deflection[0, 2] == 0.0
    assert np.linalg.norm(found.direction[0, 2]) == 1.0
    np.testing.assert_allclose(np.abs(found.direction[0, :2]), [[1, 0, 0], [0, 1, 0]], atol=1e-12)


@pytest.mark.parametrize("ratio", [0.0, 1.0, 2.5])
def test_other_damping_takes_the_exact_path(ratio):
    mass, jacobian, springs = random_poses(7, 4, 3)
    fast = batch_peaks(mass, jacobian, springs, ratio, TRAINS[0])
    slow = batch_peaks(mass, jacobian, springs, ratio, TRAINS[0], compiled=False)
    np.testing.assert_array_equal(fast.peak_deflection, slow.peak_deflection)


def test_a_singular_pose_is_marked_and_spoils_no_other():
    mass, jacobian, springs = random_poses(8, 3, 3)
    mass = mass.copy()
    mass[1] = -np.eye(3)
    found = batch_peaks(mass, jacobian, springs, 0.03, TRAINS[0])
    assert np.isnan(found.peak_deflection[1]).all()
    assert np.isfinite(found.peak_deflection[[0, 2]]).all()


def test_bad_directions():
    mass, jacobian, springs = random_poses(9, 2, 3)
    for direction in ([0, 0, 0], [[1, 0, 0]], [1, 0]):
        with pytest.raises(InputError, match="direction"):
            batch_peaks(mass, jacobian, springs, 0.03, TRAINS[0], direction=direction)


@pytest.mark.slow
def test_no_top_is_missed():
    """Random arms, blows and damping; where modes nearly cancel, tops hide between samples."""
    for seed in range(400):
        rng = np.random.default_rng(seed)
        n, train = int(rng.integers(1, 8)), TRAINS[rng.integers(4)]
        hits, fixed = [None, 1, 5][rng.integers(3)], bool(rng.integers(2))
        ratio = float(np.exp(rng.uniform(np.log(0.005), np.log(0.6))))
        options = {"hits": hits, "direction": [0.48, -0.6, 0.64] if fixed else None}
        arms = random_poses(seed, 3, n)
        fast = batch_peaks(*arms, ratio, train, **options)
        slow = batch_peaks(*arms, ratio, train, compiled=False, **options)
        np.testing.assert_allclose(
            fast.peak_deflection, slow.peak_deflection, rtol=1e-9, err_msg=f"seed {seed}"
        )
