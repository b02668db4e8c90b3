"""The life that a diagnosis tells: intervals against draws, sets of causes each with its own."""

import dataclasses
import warnings

import numpy as np
import pytest

import picchio
from picchio.diagnosis.life import Uncertain, life_before_and_after, with_effects
from picchio.model.effects.registry import effect_class
from picchio.studies.assessment.run import assess

DRAWS = 120


@pytest.fixture(scope="module")
def arm():
    return picchio.load_robot("fanuc_like_3dof")


@pytest.fixture(scope="module")
def task(arm):
    whole = picchio.load_task(arm.task_path, arm)
    operations = tuple(dataclasses.replace(o, poses=o.poses[[7]]) for o in whole.operations[1:])
    return dataclasses.replace(whole, operations=operations)


def _effects(vector):
    stiffness, damping = effect_class("joint_stiffness"), effect_class("modal_damping")
    scales = np.exp(vector)
    return (
        stiffness("joint_2").with_values(scale=float(scales[0])),
        stiffness("joint_3").with_values(scale=float(scales[1])),
        damping("robot").with_values(scale=float(scales[2])),
    )


@pytest.mark.parametrize("tied", [0.0, 0.06])
def test_intervals_of_a_life_are_those_of_draws(tied, arm, task):
    centre = np.log([0.8, 1.1, 0.9])
    spread = np.array([[0.03, 0.0, 0.0], [0.02, 0.02, 0.0], [tied, 0.0, 0.1]])
    unsure = Uncertain(_effects, centre, spread @ spread.T)
    # The paper's curve has no endurance limit: every life has an end.
    options = {"sn_curve": "nie-2016"}
    found = life_before_and_after(arm, task, _effects(centre), after=unsure, **options)
    assert found["interval_level"] == 0.9
    draws = np.random.default_rng(3).standard_normal((DRAWS, 3)) @ spread.T + centre
    lives, used = {}, {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for draw in draws:
            drawn = assess(with_effects(arm, _effects(draw)), task, steady_check=False, **options)
            for joint in drawn.joints:
                lives.setdefault(joint.name, []).append(joint.rivets_to_failure)
                used.setdefault(joint.name, []).append(joint.utilisation)
    for name, joint in found["extended"]["joints"].items():
        for key, sample in (("utilisation", used[name]), ("rivets", lives[name])):
            low, high = np.log(joint[f"{key}_interval"])
            centre, spread = np.mean(np.log(sample)), np.std(np.log(sample), ddof=1)
            # 120 draws know a spread to 6.5 %, and the middle to a tenth of it.
            assert (high - low) / 2.0 == pytest.approx(1.645 * spread, rel=0.2), (name, key)
            assert (high + low) / 2.0 == pytest.approx(centre, abs=0.4 * spread), (name, key)
    assert "rivets_interval" not in found["baseline"]
    told = found["extended"]
    ends = [joint["rivets_interval"] for joint in told["joints"].values()]
    assert told["rivets_interval"] == (min(e[0] for e in ends), min(e[1] for e in ends))
    for key, interval in (("rivets_to_failure", "rivets"), ("utilisation", "utilisation")):
        low, high = told[f"{interval}_interval"]
        assert low < told[key] < high


def test_an_interval_may_reach_from_a_life_with_an_end_to_one_without(arm, task):
    blows = effect_class("force_amplitude")

    def stronger(vector):
        return (blows("tool").with_values(scale=float(np.exp(vector[0]))),)

    used = life_before_and_after(arm, task, ())["baseline"]["utilisation"]
    centre = np.array([-np.log(used)])  # blows that bring the worst joint to its limit
    unsure = Uncertain(stronger, centre, np.array([[0.2**2]]))
    found = life_before_and_after(arm, task, stronger(centre), after=unsure)["extended"]
    low, high = found["rivets_interval"]
    assert np.isfinite(low) and np.isinf(high)
    assert found["utilisation_interval"] == pytest.approx(
        (np.exp(-1.6449 * 0.2), np.exp(1.6449 * 0.2)), rel=0.02
    )


def test_what_is_known_exactly_has_no_interval_and_other_sets_have_their_own_life(arm, task):
    blows = effect_class("force_amplitude")("tool")
    known = Uncertain(lambda vector: (blows,), np.zeros(1), np.zeros((1, 1)))
    other = blows.with_values(scale=1.5)
    found = life_before_and_after(arm, task, (blows,), before=known, after=known, others=[(other,)])
    for side in ("baseline", "extended"):
        low, high = found[side]["utilisation_interval"]
        assert low == high == found[side]["utilisation"]
    (instead,) = found["alternatives"]
    assert instead["utilisation"] == pytest.approx(1.5 * found["extended"]["utilisation"], rel=1e-6)


def _stronger(vector):
    return (effect_class("force_amplitude")("tool").with_values(scale=float(np.exp(vector[0]))),)


@pytest.mark.parametrize("share", [0.9, 1.05])
def test_poses_that_only_stronger_blows_damage_count_in_the_interval(share, arm):
    """Near the endurance limit more poses take part at the low end than in the middle."""
    whole = picchio.load_task(arm.task_path, arm)
    operation = dataclasses.replace(whole.operations[0], poses=whole.operations[0].poses[:6])
    task = dataclasses.replace(whole, operations=(operation,))
    used = life_before_and_after(arm, task, ())["baseline"]["utilisation"]
    centre, sigma = np.array([np.log(share / used)]), 0.15
    unsure = Uncertain(_stronger, centre, np.array([[sigma**2]]))
    found = life_before_and_after(arm, task, _stronger(centre), after=unsure)["extended"]
    worst = centre + 1.6448536 * sigma
    there = life_before_and_after(arm, task, _stronger(worst))["extended"]
    assert found["rivets_interval"][0] == pytest.approx(there["rivets_to_failure"], rel=1e-6)


def test_a_value_at_its_bound_still_has_an_interval(arm, task):
    def bounded(vector):
        return _stronger(np.minimum(vector, 0.0))

    unsure = Uncertain(
        bounded, np.zeros(1), np.array([[0.1**2]]), np.array([-1.0]), np.array([0.0])
    )  # fmt: skip
    found = life_before_and_after(arm, task, bounded(np.zeros(1)), after=unsure)["extended"]
    low, high = found["utilisation_interval"]
    assert high == pytest.approx(found["utilisation"])
    assert low == pytest.approx(np.exp(-0.16449) * found["utilisation"], rel=0.01)


def test_where_a_model_ends_the_interval_does_too_and_nothing_is_lost(arm, task):
    damper = effect_class("joint_damping")

    def weak(vector):  # below nothing the joint would drive itself
        return (damper("joint_3").with_values(damping=float(vector[0])),)

    unsure = Uncertain(weak, np.array([-30.0]), np.array([[60.0**2]]))
    found = life_before_and_after(
        arm, task, weak(unsure.centre), after=unsure, others=[weak([-500.0])]
    )
    low, high = found["extended"]["utilisation_interval"]
    assert low <= found["extended"]["utilisation"] <= high
    (instead,) = found["alternatives"]
    assert "damping" in instead["why"]
