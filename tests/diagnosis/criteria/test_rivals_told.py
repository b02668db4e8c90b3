"""Of several causes, one beyond doubt but for a few rivals is told together with them."""

from types import SimpleNamespace

import numpy as np
import pytest

from picchio.diagnosis.percussion.conclude.others import that_leave_doubt

POSES = 6


def fit(labels, worse):
    """A fit that is so much worse at each pose (chi-square), of one record each."""
    records = [SimpleNamespace(pose=pose) for pose in range(POSES)]
    residuals = [np.array([[np.sqrt(100.0 + more)]]) for more in worse]
    cost = float(sum((r * r).sum() for r in residuals))
    hypothesis = SimpleNamespace(labels=frozenset(labels))
    return SimpleNamespace(
        records=records, residuals=residuals, cost=cost, chi_square=cost, hypothesis=hypothesis
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
