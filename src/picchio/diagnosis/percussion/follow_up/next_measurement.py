"""What to measure next: where the rivals' predictions differ most, whatever else is refitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.criteria.equivalence import SAME
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.follow_up.records import (
    asked_plan,
    percussion_records,
    possible_records,
    sensor_group,
    varied,
    when,
)
from picchio.diagnosis.percussion.follow_up.separation import Contest, new_noise
from picchio.diagnosis.percussion.search.state import Trial
from picchio.prediction.percussion import PercussionSetup

_RIVALS = 4
# What noise may take from a difference that was foreseen.
_ENOUGH = 3.0 * SAME
# The best records are tried with softer blows, in a warmer or cooler room, later as well.
_TRIED_AGAIN = 2


@dataclass(frozen=True, eq=False)
class _Proposal:
    """One record that might be taken, and its `Contest.separations` by one sensor."""

    setup: PercussionSetup
    varied: str
    sensor: str
    at_hand: bool
    told: FloatArray

    @property
    def surely(self) -> FloatArray:
        """(rivals,) chi-square, whichever is the true one."""
        return np.asarray(self.told.min(axis=0))

    @property
    def perhaps(self) -> FloatArray:
        """(rivals,) chi-square, should the right one of the two be true."""
        return np.asarray(self.told.max(axis=0))

    @property
    def least(self) -> float:
        """Chi-square by which it tells the rival that it tells least of those it tells."""
        clear = self.surely >= _ENOUGH
        return float(self.surely[clear].min()) if clear.any() else 0.0

    @property
    def worth(self) -> tuple[int, int, bool, bool, float, float]:
        """Rivals told apart, for sure and perhaps; no new sensor, no other conditions; how far."""
        sure, some = (int((told >= _ENOUGH).sum()) for told in (self.surely, self.perhaps))
        return sure, some, self.at_hand, not self.varied, self.least, float(self.surely.sum())


def next_measurement(
    problem: Problem,
    best: Fit,
    rivals: Sequence[Trial],
    same: Sequence[Trial],
) -> dict[str, Any] | None:
    """The pose, direction and sensors that best separate the best model from its rivals.

    Each rival's best fit is simulated against the best one in records that were not taken: other
    poses and directions, the most force that was used and less, the sensors at hand and those
    missing, another temperature and a later day where records say theirs. A difference counts as
    far as the unknowns of the one that is wrong, known as well as they are by now, could not make
    up for it; `chi_square` is what is left whichever it is, `chi_square_at_best` should it be the
    one that is refuted more easily.

    Returns:
        as in the JSON, with `rivals` (what it would tell the best from, "either way" or "one way"
        only, and what it would not),
        `plan` (the record as a `picchio-plan/1` file), and, where they matter, `temperature`
        (deg C) and `days` (after the first record); None where there is no rival to be told apart.
    """
    others: dict[frozenset[str], Fit] = {}
    for trial in sorted(same or rivals, key=lambda t: t.fit.cost):
        labels = trial.fit.hypothesis.labels
        if labels != best.hypothesis.labels:
            others.setdefault(labels, trial.fit)
    if not others:
        return None
    chosen = list(others.values())[: _RIVALS if same else 1]
    some = max(problem.records, key=lambda r: float(np.abs(r.setup.blows.height).max()))
    fits = [_fitted(problem, other) for other in chosen]
    setups = list(possible_records(problem, some))
    contest = Contest(problem, best, fits, new_noise(problem, setups, best))
    shots = _shots(contest, setups)
    if not shots:
        return None
    shot = _best(contest, shots)
    names = [_name(other.hypothesis) for other in chosen]
    said, conditions = _conditions(problem, shot)
    where = f"here, {said}" if said else "here"
    why = _why(shot, _name(best.hypothesis), names, where)
    pose = zip(problem.robot.joint_names, shot.setup.geometry.pose, strict=True)
    ask: dict[str, Any] = {
        "why": why,
        "pose": {name: round(float(q), 6) for name, q in pose},
        "direction": [round(float(c), 6) for c in shot.setup.blows.direction],
        "force": round(float(np.abs(shot.setup.blows.height).max()), 6),
        "sensor": shot.sensor,
        **conditions,
        "separation": float(shot.surely.max()),
        "rivals": [
            {
                "causes": [label.split(":", 1) for label in sorted(other.hypothesis.labels)],
                "chi_square": float(least),
                "chi_square_at_best": float(most),
                "told": _how_told(least, most),
            }
            for other, least, most in zip(chosen, shot.surely, shot.perhaps, strict=True)
        ],
    }
    text = asked_plan(problem, ask, shot.setup, some.setup.name)
    return ask if text is None else ask | {"plan": text}


def _how_told(least: float, most: float) -> str:
    if least >= _ENOUGH:
        return "either way"
    return "one way" if most >= _ENOUGH else "no"


def _why(shot: _Proposal, best: str, names: Sequence[str], where: str) -> str:
    """What the record tells, what only if it comes out that way, and what it does not."""
    surely = [n for n, value in zip(names, shot.surely, strict=True) if value >= _ENOUGH]
    alike = [n for n, value in zip(names, shot.perhaps, strict=True) if value < _ENOUGH]
    halves = [
        f"from {name}: chi-square would fall by {max(ways):.3g} should it be "
        f"{best if ways[0] > ways[1] else name}, by {min(ways):.3g} otherwise"
        for name, *ways in zip(names, *shot.told, strict=True)
        if name not in (*surely, *alike)
    ]
    if len(alike) == len(names):
        return (
            f"nothing that was tried tells {best} from {' or '.join(alike)}; "
            f"this comes nearest (chi-square {float(shot.perhaps.max()):.3g}, {shot.sensor})"
        )
    told = []
    if surely:
        told.append(f"from {' or '.join(surely)}: chi-square would fall by {shot.least:.3g}")
    told += halves
    if alike:
        told.append(f"from {' or '.join(alike)} nothing that was tried tells it")
    return f"{best} is best told {where}, by the {shot.sensor}, {'; '.join(told)}"


def _fitted(problem: Problem, found: Fit) -> Fit:
    """A fit to all records, with the Jacobian that says how well its unknowns are known."""
    if found.jacobians is not None and len(found.records) == len(problem.records):
        return found
    return fit(problem, found.hypothesis, None, None, iterations=4, with_jacobian=True)


def _best(contest: Contest, shots: Sequence[_Proposal]) -> _Proposal:
    """The best record: of each sensor that which slopes say is best, held against refits."""
    firsts: dict[str, _Proposal] = {}
    for shot in sorted(shots, key=lambda s: s.worth, reverse=True):
        firsts.setdefault(shot.sensor, shot)
    checked: list[_Proposal] = []
    for shot in firsts.values():
        ways = shot.told.copy()
        for k, rival in enumerate(contest.rivals):
            if shot.perhaps[k] >= _ENOUGH:
                ways[:, k] = [
                    contest.expected_rise(shot.setup, shot.sensor, true, other)
                    for true, other in ((contest.best, rival), (rival, contest.best))
                ]
        checked.append(replace(shot, told=ways))
        if (checked[-1].surely >= _ENOUGH).all():
            break
    return max(checked, key=lambda s: s.worth)


def _name(hypothesis: Hypothesis) -> str:
    labels = sorted(label.replace(":", " of ") for label in hypothesis.labels)
    return " + ".join(labels) or "the nominal model"


def _shots(contest: Contest, setups: Sequence[PercussionSetup]) -> list[_Proposal]:
    shots = [shot for setup in setups for shot in _taken(contest, setup)]
    again = dict.fromkeys(s.setup for s in sorted(shots, key=lambda s: s.worth, reverse=True))
    for setup in list(again)[:_TRIED_AGAIN]:
        for what, other in varied(contest.problem, setup).items():
            shots += _taken(contest, other, what)
    return shots


def _taken(contest: Contest, setup: PercussionSetup, what: str = "") -> list[_Proposal]:
    """The record with every sensor; none where one of the models is none there."""
    try:
        told = contest.separations(setup)
    except InputError:
        return []
    problem = contest.problem
    return [
        _Proposal(setup, what, name, sensor_group(problem, name) in problem.groups, value)
        for name, value in told.items()
    ]


def _conditions(problem: Problem, shot: _Proposal) -> tuple[str, dict[str, float]]:
    """What is unlike the campaign's own conditions, in words; and what the JSON has of it."""
    here = shot.setup.conditions
    if shot.varied == "force":
        force = float(np.abs(shot.setup.blows.height).max())
        return f"with soft blows ({force:.3g} N)", {}
    if shot.varied == "temperature" and here.temperature is not None:
        warm = [r.temperature for r in percussion_records(problem) if r.temperature is not None]
        degrees = round(float(np.mean(warm)) + here.temperature, 3)
        return f"at {degrees:.3g} deg C", {"temperature": degrees}
    if shot.varied == "days" and here.days is not None:
        return when(here.days), {"days": round(here.days, 3)}
    return "", {}
