"""The life by each correction, against the main job, which counts it in its own way."""

import math
import warnings

import numpy as np
import pytest

from picchio.fatigue.sn.library import load_sn_curve
from picchio.paper.life import CORRECTIONS, STEEL, paper_lives
from picchio.studies.assessment.run import assess
from picchio.studies.tasks import Task


@pytest.fixture(scope="module")
def steps(study):
    return {step.corrections: step for step in study.steps}


def by_assess(study, **options):
    world = study.base
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return assess(world.robot, Task(world.operations()), **options)


def test_the_papers_method_is_that_of_assess(study, steps):
    curve = study.printed.sn_curve.sn_curve()
    found = by_assess(study, method="paper", sn_curve=curve)
    assert steps[()].rivets == pytest.approx(found.rivets_to_failure, rel=1e-6)
    assert f"joint_{steps[()].joint}" == found.limiting_joint
    lives = [joint.rivets_to_failure for joint in found.joints]
    np.testing.assert_allclose(paper_lives(study.base), lives, rtol=1e-5)


@pytest.mark.slow
def test_with_all_corrections_the_shafts_have_no_end_as_assess_says(study, steps):
    steel = load_sn_curve(STEEL, quiet=True)
    found = by_assess(study, sn_curve=steel, mean_stress="fkm")
    assert math.isinf(found.rivets_to_failure)
    assert math.isinf(steps[CORRECTIONS].rivets)
    endless = by_assess(study, sn_curve=steel, mean_stress="fkm", miner="elementary")
    assert steps[CORRECTIONS].without_limit == pytest.approx(endless.rivets_to_failure, rel=1e-6)


def test_each_correction_has_the_sign_it_must_have(steps):
    base = steps[()].rivets
    assert steps[("transient",)].rivets < base
    assert steps[("counting",)].rivets > base
    assert steps[("gravity",)].rivets < base
    assert steps[("curve",)].rivets > base
