"""What a difference leaves when unknowns, known so far, make up for it: against the closed form."""

from dataclasses import replace

import numpy as np
import pytest

import picchio
from picchio.core.processes import one_thread
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.least_squares import fit
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.follow_up.next_measurement import _Proposal, _why
from picchio.diagnosis.percussion.follow_up.records import possible_records
from picchio.diagnosis.percussion.follow_up.separation import Contest, _left, _root, new_noise
from picchio.diagnosis.percussion.tolerance.linearise import about_another, beside, linearise
from picchio.model.effects.blows.force_amplitude import ForceAmplitude
from picchio.prediction.plan import Plan
from picchio.prediction.simulation import simulate
from worlds import campaign as worlds


@pytest.fixture
def drawn():
    rng = np.random.default_rng(11)
    slopes = rng.standard_normal((60, 4)) * [1.0, 30.0, 1e-3, 5.0]
    spread = rng.standard_normal((4, 4)) * np.array([[1e-2], [1e-5], [10.0], [1e-3]])
    return rng.standard_normal(60), slopes, spread


def test_it_is_the_difference_weighed_by_noise_and_what_is_known(drawn):
    left, slopes, spread = drawn
    covariance = spread @ spread.T
    exact = left @ np.linalg.solve(np.eye(60) + slopes @ covariance @ slopes.T, left)
    assert _left(left, slopes, covariance) == pytest.approx(exact, rel=1e-9)


def test_unknowns_that_no_record_told_apart_are_no_hindrance(drawn):
    """A covariance that is singular, by rounding even negative: it once ended a diagnosis."""
    left, slopes, spread = drawn
    half = spread[:, :2] @ spread[:, :2].T
    rounded = half * (1.0 + 3e-16 * np.arange(16).reshape(4, 4))
    exact = left @ np.linalg.solve(np.eye(60) + slopes @ half @ slopes.T, left)
    assert _left(left, slopes, rounded) == pytest.approx(exact, rel=1e-6)
    fixed = np.zeros((4, 4))
    assert _left(left, slopes, fixed) == pytest.approx(left @ left)


def test_the_root_is_one(drawn):
    covariance = drawn[2] @ drawn[2].T
    root = _root(covariance)
    scale = np.sqrt(covariance.diagonal())
    error = (root @ root.T - covariance) / np.outer(scale, scale)
    assert np.abs(error).max() < 1e-12


def shot(if_best, if_rival):
    return _Proposal(None, "", "deflection", False, np.array([if_best, if_rival]))


def test_what_is_told_either_way_comes_before_what_is_told_one_way():
    """However far the one way would be: the other may be true."""
    sure, half, none = shot([40.0], [50.0]), shot([1e6], [20.0]), shot([3.0], [20.0])
    assert sorted([none, sure, half], key=lambda s: s.worth) == [none, half, sure]
    assert [s.surely[0] for s in (sure, half, none)] == [40.0, 20.0, 3.0]


@pytest.mark.parametrize(
    ("if_best", "if_rival", "words"),
    [
        ([40.0, 70.0], [50.0, 35.0], "A is best told here, by the deflection, from B or C: "
         "chi-square would fall by 35"),
        ([1e6, 2.0], [20.0, 1.0], "A is best told here, by the deflection, from B: chi-square "
         "would fall by 1e+06 should it be A, by 20 otherwise; from C nothing that was tried "
         "tells it"),
        ([3.0, 20.0], [1e6, 90.0], "A is best told here, by the deflection, from B: chi-square "
         "would fall by 1e+06 should it be B, by 3 otherwise; from C: chi-square would fall by 90 "
         "should it be C, by 20 otherwise"),
        ([3.0, 2.0], [2.0, 1.0], "nothing that was tried tells A from B or C; this comes nearest "
         "(chi-square 3, deflection)"),
    ],
)  # fmt: skip
def test_what_a_record_tells_is_said_in_words(if_best, if_rival, words):
    assert _why(shot(if_best, if_rival), "A", ["B", "C"], "here") == words


@pytest.mark.slow
def test_a_new_sensor_is_as_noisy_where_little_moves():
    """A hundredth of what it reads in all records, not in each: the stillest would tell most."""
    arm = picchio.load_robot("fanuc_like_3dof")
    plan = Plan(
        poses=[[0.3, 0.5, -0.8]], directions=[[0.6, 0.0, 0.8]], sample_rate=1000.0, quiet=0.3,
        length=0.15, sensor=[{"channels": "accelerometer.tool", "noise": 0.1}],
        excitation={"kind": "pulse_train", "force": 300.0, "period": 0.04, "width": 0.004,
                    "hits": 2},
    )  # fmt: skip
    problem = Problem(arm, simulate(arm, plan).campaign)
    best = fit(problem, Hypothesis.baseline(arm, problem.campaign.tolerance), iterations=0)
    setups = list(possible_records(problem, problem.records[0]))
    names = [f"deflection.joint_{n}" for n in (1, 2, 3)]
    read = [[s.predict(problem.model)[name] for name in names] for s in setups]
    rms = np.array([np.sqrt(np.mean(np.square(record))) for record in read])
    still, moving = np.argmin(rms), np.argmax(rms)
    assert rms[still] < 0.5 * rms[moving]
    found = new_noise(problem, [setups[still], setups[moving]], best)
    assert "accelerometer.tool" not in found  # it is there, with a noise of its own
    both = np.sqrt(np.mean(rms[[still, moving]] ** 2))
    assert found["deflection"] == pytest.approx(0.01 * both, rel=1e-9)


@pytest.fixture(scope="module")
def wrong_everywhere():
    """Records of an arm whose files are a little wrong, about a model that is off by a tenth."""
    robot = picchio.load_robot("fanuc_like_3dof")
    campaign, _ = worlds.make("fanuc_like_3dof", seed=4, records=4, mismatch=1.0)
    problem = Problem(robot, campaign)
    nominal = Hypothesis.baseline(robot, campaign.tolerance)
    with one_thread():
        linearise(problem, nominal, problem.records)
        fits = [
            fit(problem, hypothesis, None, None, iterations=3, with_jacobian=True)
            for hypothesis in (nominal, nominal.plus(ForceAmplitude("tool", scale=1.1)))
        ]
    return problem, nominal, fits


def test_one_more_record_has_the_slopes_that_it_would_have_among_the_others(wrong_everywhere):
    problem, nominal, _ = wrong_everywhere
    record = replace(problem.records[1], setup=replace(problem.records[1].setup, name="next"))
    with about_another(problem), one_thread():
        assert beside(problem, record, nominal) is None
        own, its = (problem.marginal.slopes[r.name] for r in (problem.records[1], record))
        assert [one.name for one in own.what] == [one.name for one in its.what]
        scale = np.abs(own.columns).max(axis=(0, 1))
        assert (np.abs(own.columns - its.columns).max(axis=(0, 1)) < 1e-3 * scale + 1e-3).all()
    assert "next" not in problem.marginal.slopes


def test_what_is_never_exact_makes_a_record_tell_less(wrong_everywhere):
    """It failed before, untold: a record that was but thought of had no tolerances."""
    problem, _, (best, harder) = wrong_everywhere
    setup = next(iter(possible_records(problem, problem.records[0])))
    contest = Contest(problem, best, [harder], new_noise(problem, [setup], best))
    with one_thread():
        found = contest.expected_rise(setup, "accelerometer", harder, best)
        assert contest.expected_rise(setup, "accelerometer", best, best) < 0.1
    read = [setup.predict(problem.model.with_effects(f.hypothesis.effects)) for f in (best, harder)]
    bare = sum(
        float((((read[1][name] - read[0][name]) / noise.std) ** 2).sum())
        for name, noise in problem.noise.items()
    )
    assert 1.0 < found < 0.1 * bare, (found, bare)
