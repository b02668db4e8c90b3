"""Choosing causes: what is chosen first may be wrong, and every cause must be a candidate."""

from __future__ import annotations

from itertools import permutations
from types import SimpleNamespace

import follow_up
import pytest
import trial

import picchio
from picchio.diagnosis.percussion.criteria.bic import SAME, bic
from picchio.diagnosis.percussion.criteria.whiteness import whiteness_test
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.data.split import held_out
from picchio.diagnosis.percussion.diagnosis import diagnose_percussion
from picchio.diagnosis.percussion.fit.drawn import fit_latent
from picchio.diagnosis.percussion.fit.least_squares import fit, fit_growing
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.search import exchange as exchange_module
from picchio.diagnosis.percussion.search import select
from picchio.diagnosis.percussion.search.candidates import all_candidates, measure_scales
from picchio.diagnosis.percussion.search.exchange import exchange, prune
from picchio.diagnosis.percussion.search.restart import restarted
from picchio.diagnosis.percussion.search.screen import Suspect, acts_either_way, smallest
from picchio.diagnosis.percussion.search.state import Trial
from picchio.diagnosis.percussion.search.trials import (
    _short_list,
    fit_short,
    holdout_choice,
    over_the_same_samples,
    records_of_every_pose,
)
from picchio.model.effects.registry import effect_class
from worlds import campaign as worlds
from worlds import cases
from worlds.effects import EFFECTS

ROBOT = "fanuc_like_3dof"
SENSORS = ("accelerometer.tool", "deflection")
TRUE = (
    ("joint_stiffness", "joint_1", {"scale": 1.4}),
    ("force_amplitude", "tool", {"scale": 0.75}),
)


@pytest.fixture(scope="module")
def arm():
    return picchio.load_robot(ROBOT)


@pytest.mark.parametrize("effect", EFFECTS)
def test_whatever_may_be_hidden_is_a_candidate(effect, arm, plain_problem):
    have = {f"{kind.name}:{target}" for kind, target in all_candidates(plain_problem)}
    for seed in range(6):
        causes = cases.causes(
            "single", seed, robot=ROBOT, effect=effect, sensors=SENSORS, records=3
        )
        for name, target, _ in causes:
            assert f"{name}:{target}" in have


@pytest.fixture(scope="module")
def plain_problem(arm):
    campaign, _ = worlds.make(robot=ROBOT, seed=11, sensors=SENSORS, records=3)
    return Problem(arm, campaign)


@pytest.fixture(scope="module")
def two_causes(arm):
    """Two causes in the data; one of them is known, the other was taken for hysteresis."""
    campaign, _ = worlds.make(robot=ROBOT, seed=12, causes=TRUE, sensors=SENSORS, records=3)
    problem = Problem(arm, campaign)
    start = Hypothesis.baseline(arm, campaign.tolerance)
    baseline = fit_growing(problem, start)

    def trial_of(name, **values):
        known = baseline.hypothesis.plus(effect_class(name)("joint_1", **values))
        found = fit_growing(problem, known)
        return Trial(f"{name}:joint_1", found, bic(found), 0.0)

    wrong = trial_of("hysteresis", torque=20.0, deflection=2e-4)
    right = trial_of("joint_stiffness", scale=1.3)
    both = wrong.fit.hypothesis.plus(effect_class("force_amplitude")("tool", scale=0.8))
    best = fit(problem, both, iterations=6)
    return problem, wrong, right, best


def test_a_rival_replaces_what_was_chosen_too_early(two_causes):
    problem, wrong, right, best = two_causes
    later = Trial("force_amplitude:tool", best, bic(best), 0.0)
    better = exchange(problem, best, [[wrong, right], [later]], problem.records, 8.0)
    assert better.hypothesis.labels == {"joint_stiffness:joint_1", "force_amplitude:tool"}
    assert better.chi_square / better.samples < 1.1 < best.chi_square / best.samples


def test_what_is_right_is_not_replaced(two_causes):
    problem, wrong, right, _ = two_causes
    both = right.fit.hypothesis.plus(effect_class("force_amplitude")("tool", scale=0.8))
    best = fit(problem, both, iterations=6)
    later = Trial("force_amplitude:tool", best, bic(best), 0.0)
    assert exchange(problem, best, [[right, wrong], [later]], problem.records, 8.0) is best


@pytest.mark.parametrize("order", list(permutations("abc")))
def test_the_idlest_cause_goes_first_in_whatever_order_they_stand(order, monkeypatch):
    """Either `a` or `b` will do; without `b` it is better."""
    scores = {"abc": 100.0, "bc": 104.0, "ac": 101.0, "ab": 300.0}
    scores |= {"a": 500.0, "b": 450.0, "c": 400.0, "": 900.0}

    def of(names):
        hypothesis = SimpleNamespace(
            causes=[SimpleNamespace(label=name) for name in names],
            minus=lambda name: of([other for other in names if other != name]).hypothesis,
        )
        return SimpleNamespace(hypothesis=hypothesis, score=scores["".join(sorted(names))])

    def refitted(problem, hypothesis, *_, **__):
        return of([cause.label for cause in hypothesis.causes])

    monkeypatch.setattr(exchange_module, "fit", refitted)
    monkeypatch.setattr(exchange_module, "score", lambda found: found.score)
    left = prune(None, of(order), (), 8.0)
    assert {cause.label for cause in left.hypothesis.causes} == {"a", "c"}


@pytest.mark.parametrize("seed", [3, 5])
def test_rivals_are_compared_over_the_same_samples(seed, arm):
    """Blows at another rate, or a sensor's clock: each knows other samples, and stops early."""
    late = ("pulse_rate", "tool", {"scale": 1.0046})
    campaign, _ = worlds.make(
        robot=ROBOT, seed=seed, causes=(late,), snr_db=20.0, sensors=SENSORS[:1], records=6
    )
    problem = Problem(arm, campaign)
    baseline = fit_growing(problem, Hypothesis.baseline(arm, campaign.tolerance))

    def trial_of(name, target, **values):
        cause = effect_class(name)(target, **values)
        found = fit_growing(problem, baseline.hypothesis.plus(cause))
        return Trial(cause.label, found, bic(found), 0.0)

    trials = [
        trial_of("clock_drift", SENSORS[0], rate=-0.0043),
        trial_of("pulse_rate", "tool", scale=1.0043),
    ]
    trials.sort(key=lambda t: t.score)
    again = over_the_same_samples(problem, trials, problem.records)
    assert [t.score for t in again] == sorted(t.score for t in again)
    assert abs(again[0].score - again[1].score) < SAME
    rate = next(t for t in again if t.label == "pulse_rate:tool").fit.hypothesis.causes[0]
    assert rate.values["scale"] == pytest.approx(1.0046, abs=1e-4)


def test_late_blows_and_what_is_common_are_found_at_once(arm):
    """From a wrong force: in turns, force and times would follow each other for long."""
    jitter = ("pulse_jitter", "tool", {"std": 1.5e-3})
    campaign, truth = worlds.make(
        robot=ROBOT, seed=13, causes=(jitter,), sensors=SENSORS, records=3
    )
    problem = Problem(arm, campaign)
    start = Hypothesis.baseline(arm, campaign.tolerance)
    early = fit(problem, start, end=0.03)
    known = fit(problem, early.hypothesis, iterations=0)
    found = fit_latent(problem, known, effect_class("pulse_jitter")("tool"))
    assert found.chi_square / found.samples < 1.1
    cause = next(e for e in found.hypothesis.effects if e.name == "pulse_jitter")
    for i, record in enumerate(problem.records):
        late = truth["world"].bench(i).blows.late
        assert max(abs(a - b) for a, b in zip(cause.hidden[record.name], late, strict=True)) < 1e-4


@pytest.mark.parametrize("holds", [True, False])
def test_what_replaces_a_cause_must_hold_on_poses_held_out(holds, two_causes, arm, monkeypatch):
    """Trials and replacement are given; what is tested is who has the last word."""
    problem, wrong, right, best = two_causes
    better = exchange(
        problem, best, [[wrong, right], [Trial("", best, 0.0, 0.0)]], problem.records, 8.0
    )
    rounds = iter([[wrong], [Trial("force_amplitude:tool", best, bic(best), 0.0)], [], []])
    monkeypatch.setattr(select, "try_candidates", lambda *_, **__: next(rounds))
    monkeypatch.setattr(select, "prune", lambda problem, found, *_, **__: found)
    monkeypatch.setattr(select, "unstuck", lambda problem, best, *_: best)
    monkeypatch.setattr(select, "exchange", lambda *_: better)
    monkeypatch.setattr(select, "replaced", lambda problem, best, *_: best)
    start = fit(problem, Hypothesis.baseline(arm, problem.campaign.tolerance))
    found = select.search(
        problem, [], None, problem.records, start,
        lambda before, after: 9.0 if holds or after is not better else -9.0,
    )  # fmt: skip
    assert found.best is (better if holds else best)


def test_what_has_nothing_to_do_beside_a_rival_is_taken_out(two_causes, arm, monkeypatch):
    problem, wrong, right, best = two_causes
    idle = effect_class("joint_damping")("joint_3", damping=1e-3)
    force = effect_class("force_amplitude")("tool", scale=0.8)
    three = fit(problem, right.fit.hypothesis.plus(force).plus(idle), iterations=4)
    rounds = iter([[wrong], [Trial("force_amplitude:tool", best, bic(best), 0.0)], []])
    monkeypatch.setattr(select, "try_candidates", lambda *_, **__: next(rounds))
    monkeypatch.setattr(select, "unstuck", lambda problem, best, *_: best)
    monkeypatch.setattr(select, "exchange", lambda *_: three)
    start = fit(problem, Hypothesis.baseline(arm, problem.campaign.tolerance))
    found = select.search(problem, [], None, problem.records, start)
    assert found.best.hypothesis.labels == {"joint_stiffness:joint_1", "force_amplitude:tool"}


def test_swapped_axes_are_fitted_with_their_own_slopes(arm):
    """Slopes that are borrowed from a fit with other axes lead nowhere."""
    campaign, truth = trial.make(
        {"robot": ROBOT, "kind": "weak", "effect": "sensor_axes", "snr": 20, "draw": 3}, 1
    )
    problem = Problem(arm, campaign)
    train, _ = held_out(problem)[0]
    baseline = fit_growing(problem, Hypothesis.baseline(arm, campaign.tolerance), train)
    some = records_of_every_pose(train)
    known = fit(problem, baseline.hypothesis, some, 0.3, iterations=4, with_jacobian=True)
    kind = effect_class("sensor_axes")
    swapped = [kind(SENSORS[0], code=float(code)) for code in range(48)]
    true = truth["causes"][0]["parameters"]["axes"]
    right = next(effect for effect in swapped if effect.axes == true)
    found = fit_short(problem, known, right, some, 0.3)
    assert found.chi_square / found.samples < 1.1


def test_where_poses_held_out_refute_the_best_the_search_goes_wider(two_causes, arm, monkeypatch):
    """The right cause had not been among the suspects that were fitted."""
    problem, wrong, right, _ = two_causes
    asked = []

    def tried(*_, wide=False, **__):
        asked.append(wide)
        return [[wrong], [wrong, right], []][len(asked) - 1]

    monkeypatch.setattr(select, "try_candidates", tried)
    monkeypatch.setattr(select, "prune", lambda problem, found, *_, **__: found)
    monkeypatch.setattr(select, "unstuck", lambda problem, best, *_: best)
    start = fit(problem, Hypothesis.baseline(arm, problem.campaign.tolerance))
    found = select.search(
        problem, [], None, problem.records, start,
        lambda before, after: -9.0 if after is wrong.fit else 9.0,
    )  # fmt: skip
    assert asked == [False, True, False]
    assert found.best is right.fit
    assert found.steps[0][0] is right


def test_of_faint_trials_that_would_become_one_the_smallest_is_tried():
    scale = effect_class("joint_stiffness")
    trials = [scale("joint_1", scale=value) for value in (0.5, 1.6, 0.9, 1.4)]
    assert acts_either_way(scale, faint=True) and not acts_either_way(scale, faint=False)
    assert smallest(trials) is trials[2]
    rate = effect_class("clock_drift")
    (name,) = (p.name for p in rate.parameters)
    trials = [rate("deflection", **{name: value}) for value in (3e-4, -1e-4, 1e-3)]
    assert acts_either_way(rate, faint=False) and smallest(trials) is trials[1]
    assert not acts_either_way(effect_class("backlash"), faint=True)


@pytest.mark.parametrize(
    ("gains", "chosen"),
    [
        ((), None),
        ((5.0, 5.0), 0),
        ((-5.0, 5.0), 1),
        ((-5.0, -9.0), None),
        ((5.0, 14.0), 0),  # no more than chance
        ((5.0, 16.0, 4e3), 2),  # all alike where they were fitted, and clearly not there
        ((None, 4e3), 0),  # cannot be held against those records
        ((5.0, None), 0),
        ((-5.0, None), 1),
    ],
)
def test_of_what_does_as_well_the_records_held_out_choose(gains, chosen):
    tied = [(str(i), gain) for i, gain in enumerate(gains)]
    assert holdout_choice(tied) == (None if chosen is None else str(chosen))


def test_warmth_is_not_chosen_where_a_record_held_out_says_it_was_the_day(arm):
    """In the records that are fitted both explain as much, to one in chi-square."""
    campaign, truth = trial.make(
        {"robot": ROBOT, "kind": "sets", "effect": "stiffness_drift", "snr": 40, "draw": 10}, 1
    )
    before = diagnose_percussion(arm, campaign).diagnosis
    assert before.verdict == "ambiguous"
    more = follow_up.taken(before.next_measurement, campaign, truth, 5)
    after = diagnose_percussion(arm, more).diagnosis
    assert (after.verdict, [c.effect for c in after.causes]) == ("named", ["stiffness_drift"])


@pytest.mark.slow
@pytest.mark.parametrize(
    "draw",
    [
        0,  # joint 3, 22 times as stiff as the joint
        3,  # joint 1, 23 times; fourteen suspects promised more
        4,  # joint 2, 31 times: between the sizes that were screened, where each fit ran off
    ],
)
def test_a_tilting_bearing_is_found_though_others_promise_more(draw, arm):
    """A narrow resonance: in the first few cycles its frequency is looked for closely."""
    case = {"robot": ROBOT, "kind": "weak", "effect": "transverse_compliance", "snr": 20}
    campaign, truth = trial.make({**case, "draw": draw}, 1)
    found = diagnose_percussion(arm, campaign)
    assert found.diagnosis.verdict == "named"
    cause = found.diagnosis.causes[0]
    true = truth["causes"][0]
    assert (cause.effect, cause.target) == (true["effect"], true["target"])
    stiffness = cause.parameters["stiffness"]
    assert stiffness.value == pytest.approx(true["parameters"]["stiffness"], rel=0.005)


def test_a_contact_that_a_fit_holds_shut_for_ever_is_opened_again(arm):
    """With a preload far beyond the force it is a spring: no slope leads back to less."""
    contact = ("workpiece_contact", "tool", {"stiffness": 1e5, "damping": 290.0, "preload": 34.0})
    campaign, _ = worlds.make(robot=ROBOT, seed=14, causes=(contact,), sensors=SENSORS, records=3)
    problem = Problem(arm, campaign)
    start = Hypothesis.baseline(arm, campaign.tolerance)
    baseline = fit_growing(problem, start)
    shut = effect_class("workpiece_contact")(
        "tool", stiffness=9e4, damping=300.0, preload=1000.0
    )  # fmt: skip
    held = fit(problem, baseline.hypothesis.plus(shut), iterations=8)
    assert not whiteness_test(problem, held).is_noise
    effects = held.hypothesis.effects
    scales = measure_scales(problem, effects, problem.predictions(effects))
    opened = restarted(problem, held, scales, problem.records)
    assert whiteness_test(problem, opened).is_noise
    (found,) = opened.hypothesis.causes
    assert found.values["preload"] == pytest.approx(34.0, rel=0.02)


def test_what_explains_exactly_as_much_as_one_of_the_best_is_fitted_as_well():
    """A gain was named as a force, which came just before it and was the last of the list."""

    def suspect(name, target, gain):
        effect = effect_class(name)(target)
        return Suspect(effect, gain, len(effect.parameters), (effect,))

    force, gain = ("force_amplitude", "tool"), ("sensor_gain", "accelerometer.tool")
    ranked = [suspect("payload", "tool", 9e5), suspect(*force, 349547.3), suspect(*gain, 349546.3),
              suspect("sensor_delay", "accelerometer.tool", 3e5)]  # fmt: skip
    assert [s.label for s in _short_list(ranked, 2)] == [
        "payload:tool", "force_amplitude:tool", "sensor_gain:accelerometer.tool"
    ]  # fmt: skip
    ranked[2] = suspect(*gain, 348000.0)
    assert len(_short_list(ranked, 2)) == 2


def test_what_was_fitted_to_a_part_of_the_records_is_no_alternative(monkeypatch):
    """Of few samples chi-square is small: by that alone it once came before what is right."""

    def trial_of(label, records, end):
        hypothesis = SimpleNamespace(
            labels=frozenset([label]), causes=(SimpleNamespace(label=label),)
        )
        fitted = SimpleNamespace(hypothesis=hypothesis, records=records, end=end)
        return Trial(label, fitted, 0.0, 1.0)

    records = (object(), object())
    right = trial_of("payload:tool", records, None)
    part = trial_of("link_mass:link_3", records[:1], 0.3)
    rival = trial_of("joint_inertia:joint_3", records, None)
    found = SimpleNamespace(best=right.fit, steps=[[right, part, rival]])
    monkeypatch.setattr(select, "behind", lambda problem, best, other, records: -1.0)
    same, tried = select.alternatives(None, found, [], None, records)
    assert same == tried == [rival]
