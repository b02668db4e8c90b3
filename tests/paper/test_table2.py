"""The hypotheses with the arm: their parts, and that the truth of a made-up table is found."""

import numpy as np
import pytest

from picchio.paper.printed import printed
from picchio.paper.table2.by_arm import (
    Place,
    Target,
    at_mean,
    at_worst,
    by_miner,
    decode,
    encode,
    evaluate,
    refine,
    rules,
    steady_extremes,
)
from picchio.paper.world import Assumptions, World
from picchio.vibration.closed_form.modes import modal_analysis
from picchio.vibration.closed_form.response import steady_state

WORLD = {
    "period": 0.07, "duty": 0.3, "damping_ratio": 0.03, "panel_x": 0.9, "panel_y": 0.4,
    "panel_z": 0.9, "pitch": 0.1,
}  # fmt: skip


def test_encoding_is_undone():
    assert decode(encode(WORLD)) == pytest.approx(WORLD)


@pytest.mark.parametrize("duty", [0.03, 0.4])
@pytest.mark.parametrize("period", [0.02, 0.15])
def test_peaks_and_ranges_are_the_exact_ones(duty, period):
    world = World(Assumptions(**(WORLD | {"period": period, "duty": duty}), rows=1, columns=3))
    poses = world.rivet_poses
    mass, jacobian = world.robot.mass_and_jacobian(poses)
    (peak,), (span,) = steady_extremes(
        mass[None], jacobian[None], world.robot.stiffness,
        np.array([world.given.damping_ratio]), [world.blows], np.eye(3),
    )  # fmt: skip
    for k, pose in enumerate(poses):
        response = steady_state(modal_analysis(world.model.linear_system(pose)), world.blows)
        for d in range(3):
            points = [value for _, value in response.turning_points(np.eye(3)[d])]
            for j, value in enumerate(points):
                exact = np.abs(value).max()
                assert peak[d, k, j] == pytest.approx(exact, rel=2e-3, abs=1e-9)
                assert span[d, k, j] == pytest.approx(np.ptp(value), rel=2e-3, abs=1e-8)


def test_the_averages_by_hand():
    stress = np.array([[1.0, 2.0, 3.0], [2.0, 2.0, 2.0]])
    np.testing.assert_array_equal(at_mean(stress, 3.0), 0.0)
    # Miner: mean of N^-1 ~ s^3 over that at the mean, (1 + 8 + 27) / 3 / 8.
    np.testing.assert_allclose(np.exp(by_miner(stress, 3.0)), [1.5, 1.0])
    np.testing.assert_allclose(np.exp(at_worst(stress, 3.0)), [27 / 8, 1.0])


def made_up(rule, exponent=None):
    """A paper whose Table 2 a rule made in a known world."""
    paper = printed()
    place = Place(Assumptions(rows=3, columns=5))
    found = place.deflections(encode(WORLD), paper)
    stress = found.mean(axis=1) * 25e3  # MPa
    m = exponent or paper.sn_curve.exponent
    spread = np.exp(rule.average(np.moveaxis(found, 1, 2) + 1e-15, m))
    with np.errstate(divide="ignore"):
        cycles = (paper.sn_curve.a / stress) ** m / (rule.counts or 1.0) / spread
    stress[2, 0], cycles[2, 0] = 0.0, np.inf
    rows = [
        row.model_copy(update={"stress": tuple(s), "cycles": tuple(n)})
        for row, s, n in zip(paper.table2, stress, cycles, strict=True)
    ]
    return paper.model_copy(update={"table2": tuple(rows)}), place


@pytest.mark.parametrize("k", [1, 2, 3])
def test_the_rule_that_made_a_table_fits_it_and_the_others_do_not(k):
    every = rules(12)[:4]
    paper, place = made_up(every[k])
    target = Target(paper)
    costs = [evaluate(rule, place, encode(WORLD), target).cost for rule in every]
    assert costs[k] == pytest.approx(0.0, abs=1e-12)
    assert min(cost for i, cost in enumerate(costs) if i != k) > 0.05


def test_a_fit_finds_its_way_back():
    rule = rules(12)[2]
    paper, place = made_up(rule)
    near = encode(WORLD | {"period": 0.072, "panel_x": 0.88, "pitch": 0.11})
    fit = refine(rule, place, near, Target(paper), 60)
    assert fit.cost < 1e-6
    assert decode(fit.vector[:7])["period"] == pytest.approx(0.07, rel=1e-3)
    assert fit.stress_per_twist == pytest.approx(25e9, rel=1e-3)


def test_every_rule_has_the_same_freedom_but_what_it_says():
    assert [rule.extra for rule in rules(12)] == [0, 0, 0, 0, 0, 0, 2, 2, 2]


def test_a_world_out_of_reach_is_no_fit():
    place = Place(Assumptions())
    far = encode(WORLD | {"panel_x": 1.45, "panel_y": 1.0})
    assert evaluate(rules(12)[0], place, far, Target(printed())) is None
