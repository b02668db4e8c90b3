"""What to measure next: where the rivals' predictions differ most, whatever else is refitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.asked_plan import (
    asked_plan,
    percussion_records,
    sensor_group,
    when,
)
from picchio.diagnosis.percussion.fit import Fit
from picchio.diagnosis.percussion.measured_record import MeasuredRecord
from picchio.diagnosis.percussion.possible_records import possible_records, varied
from picchio.diagnosis.percussion.problem import Problem
from picchio.diagnosis.percussion.separation import separation
from picchio.diagnosis.percussion.trials import SAME, Trial
from picchio.diagnosis.percussion.unknowns import Hypothesis
from picchio.prediction.percussion import PercussionSetup

_RIVALS = 4
# What noise may take from a difference that was foreseen.
_ENOUGH = 3.0 * SAME
# The best records are tried with softer blows, in a warmer or cooler room, later as well.
_TRIED_AGAIN = 2


@dataclass(frozen=True, eq=False)
class _Shot:
    """One record that might be taken, and by how much chi-square would tell each rival."""

    setup: PercussionSetup
    varied: str
    sensor: str
    at_hand: bool
    told: FloatArray

    @property
    def least(self) -> float:
        """Chi-square by which it tells the rival that it tells least of those it tells."""
        clear = self.told >= _ENOUGH
        return float(self.told[clear].min()) if clear.any() else 0.0

    @property
    def worth(self) -> tuple[int, bool, bool, float, float]:
        """Rivals told apart; no new sensor, no other conditions; the least of them; all."""
        told = int((self.told >= _ENOUGH).sum())
        return told, self.at_hand, not self.varied, self.least, float(self.told.sum())


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
    far as the best model's own unknowns, known as well as they are by now, could not make up for
    it.

    Returns:
        as in the JSON, with `rivals` (what it would tell the best from, and what it would not),
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
    shots = _shots(problem, best, [fit.hypothesis for fit in chosen], some)
    if not shots:
        return None
    shot = max(shots, key=lambda s: s.worth)
    names = [_name(fit.hypothesis) for fit in chosen]
    told = [name for name, value in zip(names, shot.told, strict=True) if value >= _ENOUGH]
    alike = [name for name in names if name not in told]
    how = _conditions(problem, shot)
    where = "here" if not how.words else f"here, {' and '.join(how.words)}"
    why = f"{_name(best.hypothesis)} is best told {where}, by the {shot.sensor}, "
    if told:
        why += f"from {' or '.join(told)}: chi-square would fall by {shot.least:.3g}"
        if alike:
            why += f"; from {' or '.join(alike)} nothing that was tried tells it"
    else:
        why = (
            f"nothing that was tried tells {_name(best.hypothesis)} from {' or '.join(alike)}; "
            f"this comes nearest (chi-square {float(shot.told.max()):.3g}, {shot.sensor})"
        )
    pose = zip(problem.robot.joint_names, shot.setup.geometry.pose, strict=True)
    ask: dict[str, Any] = {
        "why": why,
        "pose": {name: round(float(q), 6) for name, q in pose},
        "direction": [round(float(c), 6) for c in shot.setup.blows.direction],
        "force": round(float(np.abs(shot.setup.blows.height).max()), 6),
        "sensor": shot.sensor,
        **how.values,
        "separation": float(shot.told.max()),
        "rivals": [
            {
                "causes": [label.split(":", 1) for label in sorted(fit.hypothesis.labels)],
                "chi_square": float(value),
            }
            for fit, value in zip(chosen, shot.told, strict=True)
        ],
    }
    text = asked_plan(problem, ask, shot.setup, some.setup.name)
    return ask if text is None else ask | {"plan": text}


def _name(hypothesis: Hypothesis) -> str:
    labels = sorted(label.replace(":", " of ") for label in hypothesis.labels)
    return " + ".join(labels) or "the nominal model"


def _shots(
    problem: Problem, best: Fit, rivals: Sequence[Hypothesis], some: MeasuredRecord
) -> list[_Shot]:
    shots = [
        shot
        for setup in possible_records(problem, some)
        for shot in _taken(problem, setup, best, rivals)
    ]
    again = dict.fromkeys(s.setup for s in sorted(shots, key=lambda s: s.worth, reverse=True))
    for setup in list(again)[:_TRIED_AGAIN]:
        for what, other in varied(problem, setup).items():
            shots += _taken(problem, other, best, rivals, what)
    return shots


def _taken(
    problem: Problem,
    setup: PercussionSetup,
    best: Fit,
    rivals: Sequence[Hypothesis],
    what: str = "",
) -> list[_Shot]:
    """The record with every sensor; none where one of the models is none there."""
    try:
        told = separation(problem, setup, best, rivals)
    except InputError:
        return []
    return [
        _Shot(setup, what, name, sensor_group(problem, name) in problem.groups, value)
        for name, value in told.items()
    ]


@dataclass(frozen=True)
class _How:
    """What is unlike the campaign's own conditions."""

    words: tuple[str, ...]
    values: dict[str, float]


def _conditions(problem: Problem, shot: _Shot) -> _How:
    here = shot.setup.conditions
    if shot.varied == "force":
        force = float(np.abs(shot.setup.blows.height).max())
        return _How((f"with soft blows ({force:.3g} N)",), {})
    if shot.varied == "temperature" and here.temperature is not None:
        warm = [r.temperature for r in percussion_records(problem) if r.temperature is not None]
        degrees = round(float(np.mean(warm)) + here.temperature, 3)
        return _How((f"at {degrees:.3g} deg C",), {"temperature": degrees})
    if shot.varied == "days" and here.days is not None:
        return _How((when(here.days),), {"days": round(here.days, 3)})
    return _How((), {})
