"""Faint causes: at faint sizes, and without a choice of which samples count."""

import numpy as np
import pytest
import trial

import picchio
from picchio.diagnosis.percussion.criteria.equivalence import confidence
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.search.candidates import all_candidates, measure_scales
from picchio.diagnosis.percussion.search.screen import Screen
from picchio.model.effects.registry import effect_class
from worlds import campaign as worlds

ARM = "fanuc_like_3dof"
CASE = {"robot": ARM, "kind": "null", "snr": 40, "draw": 0, "records": 3}


@pytest.fixture(scope="module")
def problem():
    campaign, _ = trial.make(CASE)
    return Problem(picchio.load_robot(ARM), campaign)


@pytest.fixture(scope="module")
def base(problem):
    start = Hypothesis.baseline(problem.robot, problem.campaign.tolerance)
    return fit(problem, start, with_jacobian=True)


def unknown(problem, effects):
    """How many samples count as unknown: they hold the filler."""
    count = 0
    for record, rows in zip(problem.records, problem.residuals(effects), strict=True):
        for name, row in zip(record.values, rows, strict=True):
            count += int(np.sum(row == record.filler(name)[: row.size]))
    return count


def drift(base, rate):
    effect = effect_class("clock_drift")("accelerometer.tool", rate=rate)
    return base.hypothesis.plus(effect).effects


def test_a_drift_of_a_millionth_moves_no_sample_across(problem, base):
    """These samples stand as far from the edges as separates the known from the unknown."""
    counts = {unknown(problem, drift(base, rate)) for rate in (-3e-6, -1e-9, 0.0, 1e-9, 3e-6)}
    assert len(counts) == 1
    assert counts.pop() > 0


def test_what_is_known_can_be_pinned(problem, base):
    before, large = unknown(problem, base.hypothesis.effects), drift(base, 3e-4)
    assert unknown(problem, large) != before
    with problem.pinned(base.hypothesis.effects):
        assert unknown(problem, large) == before
    assert unknown(problem, large) != before


def test_faint_trials_are_faint(problem, base):
    effects = base.hypothesis.effects
    scales = measure_scales(problem, effects, problem.predictions(effects))
    look = Screen(problem, base, scales, faint=True)
    seen = 0
    for kind, target in all_candidates(problem):
        if kind.name not in ("payload", "link_mass", "joint_damping", "tool_offset"):
            continue
        for values in kind(target).trials(scales):
            trial_ = look._faint(kind(target, **values))
            there = problem.residuals(base.hypothesis.plus(trial_).effects)
            change = np.sqrt(sum(((a - b) ** 2).sum() for a, b in
                                 zip(there, base.residuals, strict=True)))  # fmt: skip
            assert change < 100.0, trial_  # typical sizes change them by thousands
            seen += 1
    assert seen >= 5


def test_confidence_is_of_the_poses_not_of_their_sum(problem, base):
    """One pose that gains a lot and two that gain nothing are no evidence."""
    records = [type(r)(r.setup, r.values, r.noise, i) for i, r in enumerate(problem.records)]

    def like(sums):
        rows = [np.full((1, 4), np.sqrt(s / 4.0)) for s in sums]
        return Fit(base.hypothesis, rows, None, sum(sums), tuple(records), None)

    assert confidence(like([100.0] * 3), like([120.0] * 3)) > 0.99
    assert confidence(like([100.0] * 3), like([1100.0, 100.0, 100.0])) < 0.9
    assert confidence(like([100.0] * 3), like([100.0] * 3)) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("falls", "sure"),
    [
        ((100.0, 570.0, 720.0, -45.0, 100.0, 1130.0), True),  # joint 1 stiffer, or a hysteresis
        ((100.0, 570.0, 720.0, -45.0, -45.0, 1130.0), False),
        ((100.0, 570.0, -45.0, 1130.0), False),
        ((900.0, 0.0, 0.0, 0.0, 0.0, 0.0), False),
    ],
)
def test_of_many_poses_no_single_one_decides(problem, base, falls, sure):
    record = problem.records[0]
    records = [
        type(record)(record.setup, record.values, record.noise, i) for i in range(len(falls))
    ]

    def like(sums):
        rows = [np.full((1, 4), np.sqrt(s / 4.0)) for s in sums]
        return Fit(base.hypothesis, rows, None, sum(sums), tuple(records), None)

    found = confidence(like([100.0] * len(falls)), like([100.0 + fall for fall in falls]))
    assert (found > 0.99) == sure


@pytest.mark.parametrize(("less", "sure"), [(30.0, 0.5), (70.0, 1.0)])
def test_a_single_pose_counts_only_beyond_doubt(problem, base, less, sure):
    record = problem.records[0]

    def like(total):
        rows = [np.full((1, 4), np.sqrt(total / 4.0))]
        return Fit(base.hypothesis, rows, None, total, (record,), None)

    assert confidence(like(100.0), like(100.0 + less)) == sure


@pytest.mark.slow
def test_a_first_look_drops_only_what_promises_nothing():
    """What is worth a fit by all records is not lost by a glance at every third."""
    payload = ("payload", "tool", {"mass": 0.1})
    campaign, _ = worlds.make(
        robot=ARM, seed=3, causes=(payload,), sensors=("accelerometer.tool",), records=6
    )
    problem = Problem(picchio.load_robot(ARM), campaign)
    base = fit(problem, Hypothesis.baseline(problem.robot, campaign.tolerance), with_jacobian=True)
    effects = base.hypothesis.effects
    scales = measure_scales(problem, effects, problem.predictions(effects))
    plain = Screen(problem, base, scales, faint=True)
    quick = Screen(problem, base, scales, faint=True, enough=40.0)
    assert plain.first is None and quick.first is not None
    dropped, kept = [], []
    for candidate in all_candidates(problem):
        whole, glance = plain.suspect(candidate), quick.suspect(candidate)
        if whole is None or glance is None:
            assert whole is None
        elif glance.gain == whole.gain:
            kept.append(whole.label)
        else:
            assert whole.gain < 40.0
            dropped.append(whole.label)
    assert "payload:tool" in kept
    assert len(dropped) > 2


def test_a_trial_far_too_large_is_tried_as_small_as_what_is_left(problem, base):
    """A contact a tenth as stiff as the trials: at their size it no longer looks like itself."""
    effects = base.hypothesis.effects
    scales = measure_scales(problem, effects, problem.predictions(effects))
    look = Screen(problem, base, scales)
    contact = effect_class("workpiece_contact")
    typical = [contact("tool", **values) for values in contact("tool").trials(scales)]
    kept, changes = look._changes(typical)
    assert len(kept) == 2 * len(typical)
    for one, large, small in zip(typical, kept[::2], kept[1::2], strict=True):
        assert large.values == one.values
        assert small.values["stiffness"] < 0.3 * one.values["stiffness"]
    assert all(np.linalg.norm(c) < 10.0 * look.beyond for c in changes[1::2])
    # A vector's components stay one each; an on-off effect has but one size.
    offset = effect_class("tool_offset")
    kept, _ = look._changes([offset("tool", **v) for v in offset("tool").trials(scales)])
    assert len(kept) == 3
    axes = effect_class("sensor_axes")
    place = "accelerometer.tool"
    swapped = [axes(place, **values) for values in axes(place).trials(scales)]
    assert swapped[0].discrete
    assert [e.values for e in look._changes(swapped)[0]] == [e.values for e in swapped]
