"""Trials that come close to one another: which go on, and which are given up."""

from __future__ import annotations

from dataclasses import replace

import pytest

import picchio
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.data.problem import Problem, held_out
from picchio.diagnosis.percussion.fit.least_squares import Fit
from picchio.diagnosis.percussion.search import alike, select
from picchio.diagnosis.percussion.search.select import begin_search
from picchio.diagnosis.percussion.search.state import Trial
from picchio.diagnosis.percussion.tolerance import linearise
from picchio.diagnosis.percussion.tolerance.linearise import (
    About,
    about_another,
    left_there,
    settled,
)
from picchio.model.effects.registry import effect_class
from worlds import campaign as worlds

ROBOT = "fanuc_like_3dof"


@pytest.fixture(scope="module")
def heavy():
    """A search of the records of an arm that carries 6 kg more, everything a little wrong."""
    campaign, _ = worlds.make(
        robot=ROBOT, seed=3, causes=[("payload", "tool", {"mass": 6.0})], records=6, mismatch=1.0
    )
    problem = Problem(picchio.load_robot(ROBOT), campaign)
    return begin_search(problem, [], held_out(problem)[0])


def with_cause(search, effect, target, cost, **values) -> Fit:
    """A fit with a cause that is said to cost so much."""
    cause = effect_class(effect)(target, **values)
    return replace(
        search.baseline, hypothesis=search.baseline.hypothesis.plus(cause), cost=cost, end=None
    )


def tried(fit: Fit) -> Trial:
    (cause,) = fit.hypothesis.causes
    return Trial(cause.label, fit, fit.cost, 0.0)


@pytest.fixture
def race(heavy, monkeypatch):
    """A race whose winner costs 1000 in any stretch, about its own numbers; evidence is cost."""
    before = replace(heavy.baseline, cost=1e6)
    search = replace(heavy, baseline=before, best=before)
    search.leaves_noise = lambda found: found.cost < 2000.0
    monkeypatch.setattr(alike, "decisive_gain", lambda one, other: one.cost - other.cost)
    monkeypatch.setattr(alike, "bic", lambda found: found.cost)

    def there(problem, here, records, end, iterations):
        assert problem.sizes is about.sizes and iterations == 0
        return replace(winner, end=end)

    monkeypatch.setattr(alike, "fit", there)
    winner = with_cause(search, "payload", "tool", 1000.0, mass=6.0)
    about = replace(About.of(search.problem), sizes=dict(search.problem.sizes))
    found = alike._Race(search)
    found.won_by(winner, about)
    return found


@pytest.mark.parametrize(
    ("gap", "fall", "given_up"),
    [
        (60.0, None, True),  # about the winner's own numbers, to first order
        (40.0, None, False),
        (40.0, 5.0, True),  # four more such falls do not make up for it
        (40.0, 15.0, False),
        (20.0, 0.0, False),  # it may do as well in the end
        (40.0, -3.0, True),
    ],
)
def test_what_stays_behind_a_fit_that_leaves_noise_is_given_up(gap, fall, given_up, race):
    there = with_cause(race.search, "tool_offset", "tool", 1000.0 + gap, x=0.01)
    sizes = race.search.problem.sizes
    assert race.is_behind(there, fall) == given_up
    assert race.search.problem.sizes is sizes


def test_what_is_behind_by_what_its_fewer_numbers_save_goes_on(race, monkeypatch):
    there = with_cause(race.search, "tool_offset", "tool", 1040.0, x=0.01)
    monkeypatch.setattr(alike, "bic", lambda found: 1000.0)
    assert not race.is_behind(there, 0.0)


def test_a_winner_that_cannot_be_computed_in_a_stretch_gives_up_no_rival(race, monkeypatch):
    def fails(*_, **__):
        raise InputError("no model there")

    monkeypatch.setattr(alike, "fit", fails)
    assert not race.is_behind(with_cause(race.search, "tool_offset", "tool", 1e6, x=0.01), 0.0)


def test_nothing_is_given_up_behind_a_fit_that_leaves_more_than_noise(heavy):
    search = replace(heavy)
    search.leaves_noise = lambda found: False
    race = alike._Race(search)
    race.won_by(with_cause(search, "payload", "tool", 1000.0, mass=6.0), About.of(search.problem))
    far = with_cause(search, "hysteresis", "joint_1", 1e6, torque=20.0, deflection=2e-4)
    assert race.first is None and not race.is_behind(far, 0.0) and race.beside(tried(far)) is None


def test_what_has_kinks_is_settled_last_and_all_go_on_by_the_first_that_leaves_noise(
    race, monkeypatch
):
    """Hysteresis took 82 s before a spring of 8; it is given up after 10 beside it."""
    search = race.search
    won = race.first[0]
    far = [10.0 * r / r.std() for r in search.baseline.residuals]
    fits = {"payload:tool": won, "hysteresis:joint_1": replace(search.baseline, residuals=far)}
    by_label = {frozenset({label}): found for label, found in fits.items()}
    monkeypatch.setattr(search, "fit", lambda here, **_: by_label[here.labels], raising=False)
    monkeypatch.setattr(alike, "fit", lambda *_, **__: won)
    monkeypatch.setattr(alike, "allowed", lambda problem: True)
    asked = []

    def by_itself(search, label, start, *, anew=True, patient=False, give_up, **_):
        asked.append((label, patient))
        if label == "payload:tool":
            return replace(start, cost=1000.0), About.of(search.problem)
        assert give_up(replace(start, cost=5000.0), 0.0)
        return None, About.of(search.problem)

    monkeypatch.setattr(alike, "settled_by_itself", by_itself)
    kinked = with_cause(search, "hysteresis", "joint_1", 8000.0, torque=20.0, deflection=2e-4)
    smooth = with_cause(search, "payload", "tool", 9000.0, mass=6.0)
    best, other = alike.settled_alike(search, [tried(kinked), tried(smooth)])
    assert asked == [("payload:tool", False), ("hysteresis:joint_1", True)]
    assert best.label == "payload:tool" and best.fit.cost == 1000.0
    assert other.in_vain and other.fit is kinked
    # What came to nothing is not settled once more.
    alike.settled_alike(search, [other], best=best.fit, near=1e5)
    assert len(asked) == 2
    alike.settled_alike(search, [replace(other, in_vain=False)], best=best.fit, near=1e5)
    assert len(asked) == 3


def test_a_rival_with_kinks_begins_where_the_first_has_what_is_not_exact(race, monkeypatch):
    """A smooth one does not: it may be right, and what is not exact far from where it suits it."""
    search, asked = race.search, {}
    near = replace(search.baseline, residuals=[r / r.std() for r in search.baseline.residuals])
    monkeypatch.setattr(search, "fit", lambda here, iterations: near, raising=False)

    def by_itself(search, label, start, **options):
        asked.update(options, start=start)
        return None, None

    monkeypatch.setattr(alike, "settled_by_itself", by_itself)
    kinked = tried(with_cause(search, "backlash", "joint_1", 9000.0, gap=1e-4))
    assert alike._settled_trial(search, kinked, race).in_vain
    assert asked["start"] is near and asked["begin"] is race.first[1]
    asked.clear()
    smooth = tried(with_cause(search, "tool_offset", "tool", 9000.0, x=0.01))
    assert alike._settled_trial(search, smooth, race).in_vain
    assert asked["start"] is smooth.fit and "begin" not in asked and asked["patient"]


def test_settling_asks_on_its_way_whether_to_go_on(heavy, monkeypatch):
    """Once slopes were taken twice in a stretch; at once where it begins near."""
    problem, payload = heavy.problem, effect_class("payload")("tool", mass=6.0)
    begun = heavy.fit(heavy.baseline.hypothesis.plus(payload), iterations=6)
    asked, taken = [], []
    plain = linearise.linearise

    def noted(*args, **options):
        taken.append(args[3])
        return plain(*args, **options)

    def give_up(fit, fall):
        asked.append((fit.end, fall, len(taken)))
        return len(asked) > 1

    monkeypatch.setattr(linearise, "linearise", noted)
    with about_another(problem), pytest.raises(InputError):
        settled(problem, begun, heavy.records, 3, give_up=lambda *_: True)
    assert taken == [0.16, None, None]
    with about_another(problem):
        there = settled(problem, begun, heavy.records, 2)
        taken.clear()
        with pytest.raises(InputError):
            settled(problem, there, heavy.records, 2, anew=False, give_up=give_up)
    (first, none, one), (again, fall, two) = asked
    assert (first, none, one) == (None, None, 1) and (again, two) == (None, 2)
    assert isinstance(fall, float)


def test_what_a_fit_leaves_is_told_of_its_own_records(heavy):
    """Of all it was half as much again as of the two thirds that were fitted: never foretold."""
    payload, problem = effect_class("payload")("tool", mass=6.0), heavy.problem
    begun = heavy.fit(heavy.baseline.hypothesis.plus(payload), iterations=6)
    with about_another(problem):
        there = settled(problem, begun, heavy.records)
        left = left_there(problem, there)
    assert len(there.records) < len(problem.records)
    assert there.cost == pytest.approx(left, rel=0.02)


def test_an_earlier_cause_that_does_nothing_goes_without_being_settled_again(heavy, monkeypatch):
    search = replace(heavy)
    cause = [
        effect_class("payload")("tool", mass=6.0),
        effect_class("pulse_width")("tool", scale=1),
    ]
    both = search.baseline.hypothesis.plus(cause[1]).plus(cause[0])
    search.best = replace(search.baseline, hypothesis=both)
    rest = replace(search.baseline, hypothesis=both.minus("pulse_width:tool"))
    rest = replace(rest, residuals=[r / r.std() for r in rest.residuals])
    monkeypatch.setattr(search, "fit", lambda here, iterations: rest, raising=False)
    scores = {"as little": 10.0, "more": 500.0}
    monkeypatch.setattr(select, "bic", lambda found: scores[told] if found is rest else 9.5)
    monkeypatch.setattr(search, "pays", lambda *_: 500.0, raising=False)
    settled_anew = []

    def by_itself(search, label, start, **_):
        settled_anew.append(label)
        return start, About.of(search.problem)

    monkeypatch.setattr(select, "settled_by_itself", by_itself)
    told = "as little"
    assert select._without_earlier(search, "payload:tool") is rest and not settled_anew
    told = "more"
    assert select._without_earlier(search, "payload:tool") is search.best
    assert settled_anew == ["pulse_width:tool"]
