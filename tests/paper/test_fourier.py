"""Eqs. 12 and 13 against integrals and against the exact solution."""

import numpy as np
import pytest

from picchio.excitation.pulse_train import PulseTrain
from picchio.paper.equations import printed_force, printed_series


def test_eq_12_is_the_pulses_integral():
    blows = PulseTrain(300.0, 0.04, 0.004)
    time = (np.arange(200_000) + 0.5) * blows.period / 200_000
    force = np.where(time < blows.width, blows.force, 0.0)
    for j, term in enumerate(printed_series(blows, 6)):
        wave = np.exp(-2j * np.pi * j * time / blows.period)
        integral = (force * wave).mean() * (2.0 if j else 1.0)
        # The paper's a_j cos + b_j sin is the real part of (a_j - i b_j) exp(i j w t).
        assert term == pytest.approx(integral, abs=0.01)


def test_eq_12_comes_to_the_pulse_between_its_edges():
    blows = PulseTrain(300.0, 0.04, 0.01)
    found = printed_force(blows, 4000, np.array([0.005, 0.025]))
    np.testing.assert_allclose(found, [300.0, 0.0], atol=0.5)


def test_eq_13_is_exact_with_the_right_quadrant_only(study):
    found = study.phase
    np.testing.assert_allclose(found["right"], found["exact"], rtol=1e-6)
    assert found["plain_history"] > 0.01


def test_gravity_by_hand(study):
    largest = study.base.sweep[1].max(axis=0)
    # Link 2 at 0.4 m, link 3 at 1.2 m from joint 2; link 3 at 0.4 m from joint 3.
    assert largest[1] == pytest.approx(9.81 * (30 * 0.4 + 45 * 1.2), rel=1e-3)
    assert largest[2] == pytest.approx(9.81 * 45 * 0.4, rel=1e-3)
    stress = study.base.gravity_stress
    joint = study.base.robot.flexible_joints[1]
    torque = abs(study.base.robot.gravity_torque(study.base.rivet_poses[0])[1])
    by_hand = 2.0 * torque / (np.pi * joint.shaft.radius**3)
    assert stress[0, 1] == pytest.approx(by_hand / 1e6)
