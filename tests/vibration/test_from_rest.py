"""The response from rest against Runge-Kutta and the matrix exponential, for every damping."""

import numpy as np
import pytest

from picchio.core.errors import InputError
from picchio.excitation.measured import MeasuredForce
from picchio.excitation.pulse_train import HalfSineTrain, PulseTrain
from picchio.model.linear_system import LinearSystem
from picchio.vibration.closed_form.modes import modal_analysis
from picchio.vibration.closed_form.response import response_from_rest

DIRECTION = np.array([0.48, -0.6, 0.64])
PULSES = PulseTrain(300.0, 0.04, 0.004)
TIMES = np.linspace(0.0, 0.9, 181) + 2e-4


@pytest.mark.parametrize(
    "train",
    [
        PULSES,
        HalfSineTrain(300.0, 0.04, 0.004),
        MeasuredForce(np.array([0.0, 0.002, 0.005, 0.03]), np.array([10.0, 300, -40, 0]), 0.04),
    ],
    ids=["pulse", "half-sine", "measured"],
)
def test_against_time_integration(tools, train):
    system = tools.system(seed=11)
    response = response_from_rest(modal_analysis(system), train, 12)
    integrated, _ = tools.integrate(system, train.burst(12), DIRECTION, TIMES)
    exact = response.deflection(TIMES, DIRECTION)
    assert np.abs(exact - integrated).max() <= 1e-8 * np.abs(exact).max()


def coupled(tools, dampers):
    base = tools.system(seed=12)
    return LinearSystem(
        base.mass_matrix,
        np.diag(np.asarray(dampers, float)),
        base.stiffness_matrix,
        base.input_matrix,
        np.eye(3),
        base.output_names,
    )


def repeated(ratio):
    return LinearSystem(
        2 * np.eye(3), ratio * np.eye(3), 8e3 * np.eye(3), np.eye(3), np.eye(3), ("a", "b", "c")
    )


def critical_pair():
    """Two equal masses whose dampers couple them, one complex mode defective by design."""
    mass, stiffness = np.eye(2), np.diag([100.0**2, 130.0**2])
    damping = np.array([[40.0, 25.0], [25.0, 200.0]])
    return LinearSystem(mass, damping, stiffness, np.ones((2, 3)), np.eye(2), ("a", "b"))


CASES = {
    "light": lambda tools: tools.system(seed=13, ratio=0.03),
    "none": lambda tools: tools.system(seed=13, ratio=0.0),
    "critical": lambda tools: tools.system(seed=13, ratio=1.0),
    "nearly critical": lambda tools: tools.system(seed=13, ratio=1.0 - 1e-12),
    "over": lambda tools: tools.system(seed=13, ratio=4.0),
    "one of each": lambda tools: tools.system(seed=13, ratio=[0.02, 1.0, 3.0]),
    "dampers at the joints": lambda tools: coupled(tools, [30.0, 300.0, 5.0]),
    "heavy dampers at the joints": lambda tools: coupled(tools, [3e3, 1.0, 8e3]),
    "one damper alone": lambda tools: coupled(tools, [200.0, 0.0, 0.0]),
    "repeated frequencies": lambda tools: repeated(6.0),
    "repeated, critical": lambda tools: repeated(2 * np.sqrt(8e3 * 2)),
    "coupled pair": lambda tools: critical_pair(),
}


@pytest.mark.parametrize("name", CASES)
def test_every_kind_of_damping_against_the_matrix_exponential(tools, name):
    system = CASES[name](tools)
    modes = modal_analysis(system)
    expected = tools.by_expm(system, 300.0, 0.04, 0.004, 5, DIRECTION, TIMES)
    found = response_from_rest(modes, PULSES, 5).deflection(TIMES, DIRECTION)
    assert np.abs(found - expected).max() <= 1e-8 * np.abs(expected).max()


def test_dampers_that_couple_the_modes_are_seen_as_such(tools):
    assert modal_analysis(tools.system(seed=13, ratio=0.03)).decoupled
    assert not modal_analysis(coupled(tools, [30.0, 300.0, 5.0])).decoupled


def test_a_defective_coupled_system_keeps_its_accuracy(tools):
    """Search for the damping at which two complex modes merge, and stand right on it."""
    mass, stiffness = np.eye(2), np.diag([100.0**2, 110.0**2])

    def gap(c):
        damping = np.array([[2 * c, -c], [-c, 1.5 * c]])
        state = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damping]])
        poles = np.linalg.eigvals(state)
        upper = np.sort_complex(poles[poles.imag > 0])
        return abs(upper[0] - upper[1]) if upper.size == 2 else 1.0

    grid = np.linspace(1.0, 60.0, 4000)
    best = grid[np.argmin([gap(c) for c in grid])]
    step = grid[1] - grid[0]
    for _ in range(40):
        local = np.linspace(best - step, best + step, 21)
        best = local[np.argmin([gap(c) for c in local])]
        step /= 5
    damping = np.array([[2 * best, -best], [-best, 1.5 * best]])
    system = LinearSystem(mass, damping, stiffness, np.ones((2, 3)), np.eye(2), ("a", "b"))
    expected = tools.by_expm(system, 300.0, 0.04, 0.004, 5, DIRECTION, TIMES)
    found = response_from_rest(modal_analysis(system), PULSES, 5).deflection(TIMES, DIRECTION)
    assert np.abs(found - expected).max() <= 1e-7 * np.abs(expected).max()


def test_velocity_and_acceleration_are_the_derivatives(tools):
    response = response_from_rest(modal_analysis(tools.system(seed=14)), PULSES, 3)
    t = np.array([0.001, 0.013, 0.0415, 0.2])
    h = 1e-6

    def slope(function):
        return (function(t + h, DIRECTION) - function(t - h, DIRECTION)) / (2 * h)

    for function, derivative in (
        (response.deflection, response.velocity),
        (response.velocity, response.acceleration),
    ):
        exact = derivative(t, DIRECTION)
        assert np.abs(slope(function) - exact).max() <= 1e-6 * np.abs(exact).max()


def test_an_undamped_ring_down_has_no_end(tools):
    response = response_from_rest(modal_analysis(tools.system(ratio=0.0)), PULSES, 3)
    assert np.isfinite(response.deflection(TIMES, DIRECTION)).all()
    with pytest.raises(InputError, match="rings for ever"):
        response.turning_points(DIRECTION)


def test_a_burst_needs_hits(tools):
    modes = modal_analysis(tools.system())
    for hits in (0, -1, None):
        with pytest.raises(InputError, match="hit"):
            response_from_rest(modes, PULSES, hits)
