"""Records that the campaign's steps leave behind, each sought by itself."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import picchio
from picchio.diagnosis.percussion.data.problem import Problem, held_out
from picchio.diagnosis.percussion.search.select import begin_search
from picchio.diagnosis.percussion.tolerance.alone import _Alone, left_behind, sought_alone
from picchio.diagnosis.percussion.tolerance.linearise import linearise
from worlds import campaign as worlds


@pytest.mark.parametrize(
    ("powers", "expected"),
    [
        ([1.0, 1.0, 1.0, 1.0], []),
        ([1.0, 1.0, 1.0, 1.6, 40.0], [3, 4]),
        ([1.35, 1.4, 1.3, 1.45], []),  # something else is wrong, in all of them
        ([1.35, 1.4, 1.3, 9.0], [3]),
    ],
)
def test_a_record_is_left_behind_where_much_more_is_left_of_it(powers, expected):
    rows = np.resize([1.0, -1.0], (6, 500))
    left = [rows * np.sqrt(power) for power in powers]
    problem = SimpleNamespace(records=list(range(len(left))), residuals=lambda effects: left)
    assert left_behind(problem, SimpleNamespace(effects=())) == expected


def test_a_record_that_its_own_numbers_cannot_explain_is_given_up_early(monkeypatch):
    """At its first blows, or each would be asked blow by blow to the end."""
    robot = "fanuc_like_3dof"
    softer = ("joint_stiffness", "joint_2", {"scale": 0.5})
    campaign, _ = worlds.make(robot=robot, seed=5, causes=[softer], records=3, mismatch=1.0)
    problem = Problem(picchio.load_robot(robot), campaign, workers=1)
    search = begin_search(problem, [], held_out(problem)[0])
    linearise(problem, search.baseline.hypothesis, problem.records)
    asked = []
    move = _Alone.move
    monkeypatch.setattr(_Alone, "move", lambda self, end: (asked.append(end), move(self, end)))
    assert sought_alone(problem, search.baseline.hypothesis, problem.records[:1]) == {}
    assert len(asked) == 1
