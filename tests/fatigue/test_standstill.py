"""Indicators of false brinelling: Hertz, ISO 76, and where the joint stands between blows."""

import math

import numpy as np
import pytest

from picchio.fatigue.standstill import (
    contact_width,
    false_brinelling,
    roller_diameter,
    swings,
)
from picchio.robot.drives.reducer import load_reducer

BEARING = load_reducer("CSG-25-100-2UH").output_bearing
assert BEARING is not None


def test_rollers_and_contact_fit_the_static_rating_and_hertz():
    diameter, pitch = roller_diameter(BEARING), BEARING.pitch_diameter
    rollers = math.pi * pitch / (1.2 * diameter) / 2.0  # in one direction
    cosine = math.cos(math.radians(45.0))
    # ISO 76, radial roller bearings, in mm and N.
    rating = 44.0 * (1.0 - diameter * cosine / pitch) * rollers * (1e3 * diameter) ** 2 * cosine
    assert rating == pytest.approx(BEARING.static_load_rating)
    # Hertz, line contact: the load that gives 4000 MPa, scaled to the permissible moment.
    modulus, radius = 206e9 / (2.0 * (1.0 - 0.09)), 0.5 * diameter
    at_c0 = (4000e6) ** 2 * math.pi * radius / modulus
    line = at_c0 * 2.0 * BEARING.permissible_moment / pitch / BEARING.static_load_rating
    half = math.sqrt(4.0 * line * radius / (math.pi * modulus))
    assert contact_width(BEARING) == pytest.approx(2.0 * half)


def test_swings_are_end_to_end_and_small_ones_do_not_count():
    assert swings(np.array([0.0, 2.0, -1.0, 2.0, 1.9, 2.0, 0.0])) == (3.0, 2)
    assert swings(np.zeros(3)) == (0.0, 0)


@pytest.mark.parametrize(
    ("positions", "cycles", "risk", "longest"),
    [
        ([0.3], [40], "high", 40),  # one pose: it never moves
        ([0.3, 0.3, 0.3], [40, 40, 40], "high", 120),
        ([0.3, 0.5, 0.7], [40, 60, 50], "low", 60),
        ([0.3, 0.3, 0.7], [40, 60, 50], "medium", 100),
        ([0.3, 0.7, 0.3], [40, 60, 50], "medium", 90),  # from the last pose to the first
        ([0.3, 0.300001], [40, 60], "high", 100),  # within a contact's width
        ([0.3, 0.7], [40, 250_000], "high", 250_000),
    ],
)
def test_the_class_says_whether_the_joint_moves_on(positions, cycles, risk, longest):
    swing = np.linspace(1e-3, 2e-3, len(positions))
    found = false_brinelling(BEARING, swing, cycles, positions)
    assert (found.risk, found.cycles) == (risk, longest)
    assert found.pose == len(positions) - 1
    assert found.travel == pytest.approx(swing[-1] * 0.062 / 4.0)
    assert found.ratio == found.travel / found.contact_width
    assert f"risk of false brinelling of the output bearing: {risk}" in found.sentence


def test_without_a_bearing_the_class_is_not_known_and_what_would_tell_is_said():
    found = false_brinelling(None, [1e-3, 0.0], [40, 40], [0.0, 0.0])
    assert found.risk == "not known" and math.isnan(found.ratio)
    assert "output_bearing" in found.sentence
