"""The life that a diagnosis tells: intervals against draws, sets of causes each with its own."""

import dataclasses
import warnings

import numpy as np
import pytest

import picchio
from picchio.diagnosis.life import Unsure, life_before_and_after, with_effects
from picchio.model.effects import effect_class
from picchio.studies import assess

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


def test_intervals_of_a_life_are_those_of_draws(arm, task):
    centre = np.log([0.8, 1.1, 0.9])
    spread = np.array([[0.03, 0.0, 0.0], [0.02, 0.02, 0.0], [0.0, 0.0, 0.1]])
    unsure = Unsure(_effects, centre, spread @ spread.T)
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
    governs = found["extended"]["limiting_joint"]
    of_robot = found["extended"]["rivets_interval"]
    assert of_robot == found["extended"]["joints"][governs]["rivets_interval"]
    assert of_robot[0] < found["extended"]["rivets_to_failure"] < of_robot[1]


def test_an_interval_may_reach_from_a_life_with_an_end_to_one_without(arm, task):
    blows = effect_class("force_amplitude")

    def stronger(vector):
        return (blows("tool").with_values(scale=float(np.exp(vector[0]))),)

    used = life_before_and_after(arm, task, ())["baseline"]["utilisation"]
    centre = np.array([-np.log(used)])  # blows that bring the worst joint to its limit
    unsure = Unsure(stronger, centre, np.array([[0.2**2]]))
    found = life_before_and_after(arm, task, stronger(centre), after=unsure)["extended"]
    low, high = found["rivets_interval"]
    assert np.isfinite(low) and np.isinf(high)
    assert found["utilisation_interval"] == pytest.approx(
        (np.exp(-1.6449 * 0.2), np.exp(1.6449 * 0.2)), rel=0.02
    )


def test_what_is_known_exactly_has_no_interval_and_other_sets_have_their_own_life(arm, task):
    blows = effect_class("force_amplitude")("tool")
    known = Unsure(lambda vector: (blows,), np.zeros(1), np.zeros((1, 1)))
    other = blows.with_values(scale=1.5)
    found = life_before_and_after(arm, task, (blows,), before=known, after=known, others=[(other,)])
    for side in ("baseline", "extended"):
        low, high = found[side]["utilisation_interval"]
        assert low == high == found[side]["utilisation"]
    (instead,) = found["alternatives"]
    assert instead["utilisation"] == pytest.approx(1.5 * found["extended"]["utilisation"], rel=1e-6)
