"""The straight line that stands for a force with a kink, against plain quadrature."""

import numpy as np
import pytest

import picchio
from picchio.model.blows import Blows
from picchio.model.effects.registry import effect_class
from picchio.model.geometry import Geometry
from picchio.vibration.integration.element_kernel import element_force, kink_correction
from picchio.vibration.integration.integrate import Samples, integrate

BACKLASH = (0, np.array([1e5, 2e-4, 1e-5, 0.0, 0.0, 0.0]))
CONTACT = (4, np.array([1e5, 50.0, 10.0, 0.0, 0.0, 0.0]))
LENGTH, POINTS = 4e-4, 4000


def by_quadrature(kind, parameters, d0, rate0, d1, rate1):
    """The line's ends less the force's own, of mean and first moment on a cubic path."""
    s = (np.arange(POINTS) + 0.5) / POINTS
    path = np.polynomial.Polynomial(
        [d0, LENGTH * rate0, 3 * (d1 - d0) - LENGTH * (2 * rate0 + rate1),
         2 * (d0 - d1) + LENGTH * (rate0 + rate1)]
    )  # fmt: skip
    rate = path.deriv()
    values = np.array([element_force(kind, parameters, path(x), rate(x) / LENGTH, 0.0) for x in s])
    first, last = (
        element_force(kind, parameters, d, r, 0.0) for d, r in ((d0, rate0), (d1, rate1))
    )
    above = values - first - (last - first) * s
    mean, moment = above.mean(), (above * s).mean()
    return np.array([4 * mean - 6 * moment, 6 * moment - 2 * mean]), np.abs(values).max()


@pytest.mark.parametrize("element", [BACKLASH, CONTACT], ids=["backlash", "contact"])
def test_the_line_keeps_the_forces_mean_and_moment(element):
    kind, parameters = element
    rng = np.random.default_rng(4)
    clear = 0
    for number in range(60):
        d0, d1 = rng.normal(0.0, 2e-4, 2)
        if number % 2:
            d1 = d0 + rng.normal(0.0, 1e-5)
        rate0, rate1 = (d1 - d0) / LENGTH + rng.normal(0.0, 0.05, 2)
        found = np.empty(2)
        straight = kink_correction(kind, parameters, d0, rate0, d1, rate1, LENGTH, found)
        right, size = by_quadrature(kind, parameters, d0, rate0, d1, rate1)
        clear += straight
        # Clear of the kink it is known in closed form, across it summed over 16 points.
        tolerance = (1e-6 if straight else 2e-2) * size + 1e-12
        assert np.abs(found - right).max() <= tolerance, (number, straight)
    assert 10 < clear < 55


def test_play_is_followed_at_the_step_that_is_used():
    """Against steps of 10 us, of the same kernel: what a step that meets an edge misses."""
    robot = picchio.load_robot("fanuc_like_3dof")
    model = picchio.Model(robot, gravity_stiffness=True).with_effects(
        [effect_class("backlash")("joint_1", gap=1e-3)]
    )
    direction = np.array([0.0, 1.0, 0.0])
    system = model.plant(Geometry.of(robot, [0.3, 0.5, -0.8])).build(direction)
    force = Blows.of(picchio.PulseTrain(300.0, 0.04, 0.004), 12, direction).force()
    samples = Samples(0.0, 1e-3, 1200)
    fine = integrate(system, force, samples, longest_step=1e-5).position
    found = integrate(system, force, samples).position
    assert np.abs(found - fine).max() <= 1e-5 * fine.std()
