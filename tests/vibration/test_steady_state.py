"""The exact steady state against Fourier sums, time integration and its own definition."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from picchio.core.errors import InputError
from picchio.excitation.measured import MeasuredForce
from picchio.excitation.pulse_train import HalfSineTrain, PulseTrain
from picchio.vibration.closed_form.modes import modal_analysis
from picchio.vibration.closed_form.response import (
    response_from_rest,
    steady_state,
    truncated_fourier_response,
)

PULSES = PulseTrain(300.0, 0.04, 0.004)
TRAINS = {
    "pulse": PULSES,
    "half-sine": HalfSineTrain(300.0, 0.04, 0.004),
    "measured": MeasuredForce(
        np.array([0.0, 0.002, 0.005, 0.03]), np.array([10.0, 300.0, -40.0, 0.0]), 0.04
    ),
}
DIRECTION = np.array([0.48, -0.6, 0.64])


def papers_fourier_sum(system, time, terms, f0=300.0, period=0.04, width=0.004):
    """Eqs. 12 and 13 from the matrices, without any modal step."""
    w = 2 * np.pi / period
    push = system.input_matrix @ DIRECTION
    total = np.outer(np.linalg.solve(system.stiffness_matrix, push), np.ones(time.size))
    total *= f0 * width / period
    for j in range(1, terms + 1):
        a = f0 / (j * np.pi) * np.sin(2 * j * np.pi * width / period)
        b = f0 / (j * np.pi) * (1 - np.cos(2 * j * np.pi * width / period))
        dynamic = (
            system.stiffness_matrix
            - (j * w) ** 2 * system.mass_matrix
            + 1j * j * w * system.damping_matrix
        )
        x = np.linalg.solve(dynamic, push * (a - 1j * b))
        total += np.real(x[:, None] * np.exp(1j * j * w * time))
    return total


def test_against_the_sum_of_20000_fourier_terms(tools):
    system = tools.system(seed=1)
    time = np.linspace(0.0, 0.04, 37, endpoint=False) + 1e-4
    exact = steady_state(modal_analysis(system), PULSES).deflection(time, DIRECTION)
    summed = papers_fourier_sum(system, time, 20_000)
    assert np.abs(exact - summed).max() <= 1e-6 * np.abs(summed).max()


@pytest.mark.parametrize("name", TRAINS)
def test_against_time_integration_over_one_period(tools, name):
    system = tools.system(seed=2)
    train = TRAINS[name]
    response = steady_state(modal_analysis(system), train)
    time = np.linspace(0.0, 0.04, 50, endpoint=False) + 3e-4
    start = np.concatenate(
        [response.deflection([0.0], DIRECTION)[:, 0], response.velocity([0.0], DIRECTION)[:, 0]]
    )
    integrated, end = tools.integrate(system, train.one_period(), DIRECTION, time, start)
    exact = response.deflection(time, DIRECTION)
    assert np.abs(exact - integrated).max() <= 1e-9 * np.abs(exact).max()
    # It is periodic: the integrator is back where it began.
    assert np.abs(end - start).max() <= 1e-9 * np.abs(start).max()


def test_the_response_from_rest_tends_to_the_steady_state(tools):
    modes = modal_analysis(tools.system(seed=3, ratio=0.2))
    time = np.linspace(0, 0.04, 20, endpoint=False) + 1e-4
    late = response_from_rest(modes, PULSES, 100).deflection(time + 95 * 0.04, DIRECTION)
    steady = steady_state(modes, PULSES).deflection(time, DIRECTION)
    assert np.abs(late - steady).max() <= 1e-9 * np.abs(steady).max()


@pytest.mark.parametrize("name", TRAINS)
def test_the_truncated_sum_converges_to_the_exact_solution(tools, name):
    modes = modal_analysis(tools.system(seed=4))
    time = np.linspace(0, 0.04, 101)
    exact = steady_state(modes, TRAINS[name]).deflection(time, DIRECTION)
    errors = [
        np.abs(
            truncated_fourier_response(modes, TRAINS[name], DIRECTION, time, terms) - exact
        ).max()
        / np.abs(exact).max()
        for terms in (10, 100, 1000)
    ]
    # F's coefficients fall like 1/j, the response's like 1/j^3: the tail's sum like 1/terms^2.
    assert errors[1] < errors[0] / 30
    assert errors[2] < errors[1] / 30


def test_the_truncated_sum_is_the_papers(tools):
    system = tools.system(seed=5)
    time = np.linspace(0, 0.04, 11)
    ours = truncated_fourier_response(modal_analysis(system), PULSES, DIRECTION, time, 25)
    np.testing.assert_allclose(ours, papers_fourier_sum(system, time, 25), rtol=0, atol=1e-15)


def test_resonance_without_damping_is_an_error_not_an_infinity(tools):
    # One mode at exactly 50 Hz, blows at 25 Hz.
    stiffness = np.array([[(2 * np.pi * 50.0) ** 2]])
    system = tools.system(n=1, ratio=0.0, stiffness=stiffness)
    scaled = type(system)(
        np.eye(1), np.zeros((1, 1)), stiffness, np.ones((1, 3)), np.eye(1), ("joint_1",)
    )
    with pytest.raises(InputError, match=r"50 Hz.*resonance"):
        steady_state(modal_analysis(scaled), PULSES)


def test_without_damping_away_from_resonance_there_is_a_steady_state(tools):
    system = tools.system(seed=6, ratio=0.0)
    time = np.linspace(0, 0.04, 37, endpoint=False) + 1e-4
    exact = steady_state(modal_analysis(system), PULSES).deflection(time, DIRECTION)
    summed = papers_fourier_sum(system, time, 20_000)
    assert np.abs(exact - summed).max() <= 1e-6 * np.abs(summed).max()


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    ratio=st.floats(0.005, 3.0),
    factor=st.floats(-5, 5),
    fraction=st.floats(0.02, 0.98),
)
def test_linear_in_the_force_and_in_the_direction(tools, seed, ratio, factor, fraction):
    modes = modal_analysis(tools.system(seed=seed, ratio=ratio))
    width = 0.04 * fraction
    time = np.linspace(0, 0.08, 23)
    one = steady_state(modes, PulseTrain(100.0, 0.04, width))
    more = steady_state(modes, PulseTrain(100.0 * factor, 0.04, width))
    x = one.deflection(time, DIRECTION)
    np.testing.assert_allclose(
        more.deflection(time, DIRECTION), factor * x, rtol=1e-9, atol=1e-12 * np.abs(x).max()
    )
    np.testing.assert_allclose(
        np.einsum("mdk,d->mk", one.unit_deflection(time), DIRECTION),
        x,
        rtol=0,
        atol=1e-9 * np.abs(x).max(),  # next to critical damping two poles cancel to 1e-11
    )
