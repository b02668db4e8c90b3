"""The straight line that stands for a force with a kink, against plain quadrature."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import picchio
from picchio.model.blows import Blows
from picchio.model.effects.registry import effect_class
from picchio.model.geometry import Geometry
from picchio.vibration.integration.element_kernel import element_force, kink_correction
from picchio.vibration.integration.integrate import Samples, integrate

HARDENING = (1, np.array([4e12, 0.0, 0.0, 0.0, 0.0, 0.0]))
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


@pytest.mark.parametrize(
    "element", [BACKLASH, CONTACT, HARDENING], ids=["backlash", "contact", "hardening"]
)
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
    assert clear == 60 if kind == HARDENING[0] else 10 < clear < 55


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


@pytest.mark.parametrize(
    ("effect", "values", "least"),
    [
        ("coulomb_friction", {"torque": 5.0, "smoothing": 5e-4}, 1e-4),
        ("coulomb_friction", {"torque": 50.0, "smoothing": 1e-4}, 5e-4),
        ("coulomb_friction", {"torque": 300.0, "smoothing": 5e-5}, 1e-4),
        ("hardening", {"cubic": 2e11}, 3e-4),  # at its peaks ten times as stiff as at rest
    ],
)
def test_what_bends_is_followed_at_the_step_that_is_used(effect, values, least):
    """Friction that fades and a spring that hardens, by scipy's Radau method between edges."""
    robot = picchio.load_robot("fanuc_like_3dof")
    model = picchio.Model(robot).with_effects([effect_class(effect)("joint_3", **values)])
    direction = np.array([0.0, 1.0, 0.0])
    system = model.plant(Geometry.of(robot, [0.3, 0.5, -0.8])).build(direction)
    nothing = np.zeros_like(system.mass_gradient)
    system = replace(
        system, mass_gradient=nothing, gravity_curvature=nothing,
        force_gradient=np.zeros_like(system.force_gradient),
    )  # fmt: skip
    inverse, row, n = np.linalg.inv(system.mass), system.rows[0], len(system.coordinates)
    train = picchio.PulseTrain(3000.0, 0.04, 0.004)
    samples = Samples(0.0, 1e-3, 400)

    def torque(y):
        if effect == "hardening":
            return values["cubic"] * (row @ y[:n]) ** 3
        return values["torque"] * np.tanh(row @ y[n:] / values["smoothing"])

    def slope(_, y, push):
        held = system.stiffness @ y[:n] + system.damping @ y[n:] + torque(y) * row
        return np.concatenate([y[n:], inverse @ (system.force * push - held)])

    edges = [*np.sort(np.concatenate([0.04 * np.arange(10), 0.04 * np.arange(10) + 0.004])), 0.4]
    right, y = np.zeros((samples.count, n)), np.zeros(2 * n)
    for k, (begin, end) in enumerate(zip(edges, edges[1:], strict=False)):
        inside = (samples.times > begin - 1e-9) & (samples.times < end + 1e-9)
        push = 3000.0 if k % 2 == 0 else 0.0
        times = np.clip(samples.times[inside], begin, end)
        ran = solve_ivp(
            slope, (begin, end), y, "Radau", args=(push,), rtol=1e-9, atol=1e-12,
            dense_output=True,
        )  # fmt: skip
        right[inside], y = ran.sol(times)[:n].T, ran.y[:, -1]
    force = Blows.of(train, 10, direction).force()
    found = integrate(system, force, samples).position
    assert np.abs(found - right).max() <= least * right.std()
