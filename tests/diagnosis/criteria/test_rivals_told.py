"""Of several causes, one beyond doubt but for a few rivals is told together with them."""

from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest

from picchio.diagnosis.percussion.conclude import others
from picchio.diagnosis.percussion.conclude.others import that_leave_doubt, weighed
from picchio.diagnosis.result import BEYOND_DOUBT

POSES = 6


def fit(labels, worse):
    """A fit that is so much worse at each pose (chi-square), of one record each."""
    records = [SimpleNamespace(pose=pose) for pose in range(POSES)]
    residuals = [np.array([[np.sqrt(100.0 + more)]]) for more in worse]
    cost = float(sum((r * r).sum() for r in residuals))
    hypothesis = SimpleNamespace(labels=frozenset(labels))
    return SimpleNamespace(
        records=records,
        residuals=residuals,
        by_record=None,
        cost=cost,
        chi_square=cost,
        hypothesis=hypothesis,
    )


def search_of(labels, noise=()):
    return SimpleNamespace(
        best=fit(labels, np.zeros(POSES)),
        labels=frozenset(labels),
        leaves_noise=lambda found: found.hypothesis.labels in map(frozenset, noise),
        explains_enough=lambda found: False,
    )


ONE_POSE = [40.0, 0, 0, 0, 0, 0]  # one pose speaks against it, five say nothing
EVERY_POSE = [9.0, 12, 10, 8, 11, 10]
TRUE, RIVAL = {"hysteresis:joint_3", "payload:tool"}, {"hysteresis:joint_3", "link_mass:link_2"}


@pytest.mark.parametrize(
    ("found", "worse", "noise", "told"),
    [
        (TRUE, ONE_POSE, [RIVAL], True),
        (TRUE, EVERY_POSE, [RIVAL], False),  # ruled out by all poses alike
        (TRUE, ONE_POSE, [], False),  # it leaves more than noise: no rival
        ({"payload:tool"}, ONE_POSE, [RIVAL], False),  # a cause alone is named beside lesser ones
    ],
)
def test_which_rivals_leave_doubt(found, worse, noise, told):
    rival = SimpleNamespace(fit=fit(RIVAL, worse))
    assert that_leave_doubt(search_of(found, noise), [rival], []) == ([rival] if told else [])


def test_what_is_told_already_is_not_told_twice():
    rival = SimpleNamespace(fit=fit(RIVAL, ONE_POSE))
    search = search_of(TRUE, [RIVAL])
    assert that_leave_doubt(search, [rival, rival], []) == [rival]
    assert that_leave_doubt(search, [rival], [rival]) == []


NEARLY = [1.4, 2.3, 1.5, 1.7, 2.6, 5.1]  # worse in all, and not beyond doubt


@pytest.mark.parametrize(
    ("found", "worse", "rest", "told"),
    [
        (TRUE, NEARLY, 0.999, True),
        (TRUE, EVERY_POSE, 0.999, False),  # ruled out
        (TRUE, NEARLY, 0.9, False),  # something else leaves doubt: it is none of two
        ({"payload:tool"}, NEARLY, 0.999, False),
    ],
)
def test_what_all_records_do_not_rule_out_is_told(monkeypatch, found, worse, rest, told):
    """A link's mass beside a hardening did nearly as well as a payload: nothing was claimed."""
    rival = SimpleNamespace(fit=fit(RIVAL, worse))
    search, whole = search_of(found, [RIVAL]), fit(found, np.zeros(POSES))

    @contextmanager
    def pinned(effects):
        yield

    search.problem = SimpleNamespace(pinned=pinned)
    for each in (search.best, whole):
        each.hypothesis.effects = ()

    def causes(search, whole, rivals, refuted=()):
        sure = others.confidence(whole, rival.fit) if rival in refuted else rest
        return (SimpleNamespace(confidence=sure),)

    monkeypatch.setattr(others, "alternatives", lambda search: ([rival], [rival]))
    monkeypatch.setattr(others, "fitted_causes", causes)
    monkeypatch.setattr(others, "_on_all_records", lambda problem, whole, trials, doubt=0.0: (
        [], list(trials)))  # fmt: skip
    same, _, (cause,) = weighed(search, whole)
    assert same == ([rival] if told else [])
    if not told:  # whatever is not told leaves its doubt
        assert (cause.confidence < BEYOND_DOUBT) == (worse is NEARLY)
