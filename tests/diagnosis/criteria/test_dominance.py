"""Where more than noise is left, only what stands far above it is claimed."""

from __future__ import annotations

import pytest

import picchio
from picchio.diagnosis.percussion.criteria.dominance import dominant_causes, explained_share
from picchio.diagnosis.percussion.criteria.whiteness import whiteness_test
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.diagnosis import _fitted_to_all
from picchio.diagnosis.percussion.fit.least_squares import fit, fit_growing
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.search.candidates import measure_scales
from picchio.diagnosis.percussion.search.state import Search
from picchio.model.effects.registry import effect_class
from worlds import campaign as worlds

ROBOT = "fanuc_like_3dof"
SOFTER = ("joint_stiffness", "joint_1", {"scale": 0.7})
TILTED = ("sensor_misalignment", "accelerometer.tool", {"rx": 0.05, "ry": 0.03, "rz": 0.0})
UNKNOWN = ("quadratic_damping", "joint_2", {"damping": 400.0})


IMITATION = ("hysteresis", "joint_2", {"torque": 5.0, "deflection": 1e-3})


def made(causes):
    """(campaign, truth)."""
    sensors = ("accelerometer.tool", "deflection")
    return worlds.make(robot=ROBOT, seed=21, causes=causes, sensors=sensors, records=4)


def fitted(causes, *suspects):
    """(problem, fit of the suspects, truth)."""
    robot = picchio.load_robot(ROBOT)
    campaign, truth = made(causes)
    problem = Problem(robot, campaign)
    known = fit_growing(problem, Hypothesis.baseline(robot, campaign.tolerance)).hypothesis
    for effect, target, values in suspects:
        known = known.plus(effect_class(effect)(target, **values))
    return problem, fit_growing(problem, known), truth


def test_what_imitates_the_unknown_rest_is_not_claimed():
    problem, found, truth = fitted((SOFTER, UNKNOWN), SOFTER, IMITATION)
    alone = fit(problem, found.hypothesis.minus("hysteresis:joint_2"))
    # it helps a lot, and leaves much
    assert found.cost < alone.cost - 100.0
    assert not whiteness_test(problem, found).is_noise
    assert 0.1 < explained_share(found, alone) < 0.9
    stands = dominant_causes(problem, found)
    assert stands.hypothesis.labels == {"joint_stiffness:joint_1"}
    (softer,) = stands.hypothesis.causes
    true = 0.7 * truth["nuisances"]["stiffness"]["joint_1"]
    assert softer.values["scale"] == pytest.approx(true, rel=0.02)


def test_causes_that_are_there_stay():
    problem, found, _ = fitted((SOFTER, TILTED, UNKNOWN), SOFTER, TILTED)
    assert not whiteness_test(problem, found).is_noise
    assert dominant_causes(problem, found) is found


def test_where_noise_is_left_every_cause_explains_all():
    problem, found, _ = fitted((SOFTER, TILTED), SOFTER, TILTED)
    assert whiteness_test(problem, found).is_noise
    assert dominant_causes(problem, found) is found


def test_a_diagnosis_leaves_the_imitation_out():
    """Where a search ends with a cause too many and more than noise, it is not fitted to all."""
    problem, found, _ = fitted((SOFTER, UNKNOWN), SOFTER, IMITATION)
    nominal = fit_growing(problem, Hypothesis.baseline(problem.robot, problem.campaign.tolerance))
    effects = nominal.hypothesis.effects
    scales = measure_scales(problem, effects, problem.predictions(effects))
    search = Search(problem, (), scales, problem.records, (), nominal, found)
    whole, after = _fitted_to_all(search, nominal, problem.records)
    assert whole.hypothesis.labels == search.labels == {"joint_stiffness:joint_1"}
    assert not after.is_noise
