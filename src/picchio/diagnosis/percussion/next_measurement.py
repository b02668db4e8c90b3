"""What to measure next: where the rivals' predictions differ most, whatever else is refitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from picchio.campaign import parse_channel
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.asked_plan import (
    asked_plan,
    percussion_records,
    sensor_group,
)
from picchio.diagnosis.percussion.fit import Fit
from picchio.diagnosis.percussion.problem import MeasuredRecord, Problem
from picchio.diagnosis.percussion.trials import SAME, Trial
from picchio.diagnosis.percussion.unknowns import Hypothesis
from picchio.model.geometry import Geometry
from picchio.prediction.percussion import PercussionSetup

_POSES = 6
_DIRECTIONS = 3
_SENSORS = ("deflection", "accelerometer")
_RIVALS = 4
_SEED = 20160401
# What noise may take from a difference that was foreseen.
_ENOUGH = 3.0 * SAME
# Relative noise of a sensor that the campaign does not have.
_NEW_SENSOR = 0.01
# The best records are tried with softer blows, in a warmer or cooler room, later as well.
_TRIED_AGAIN = 2
_SOFTER = 0.3
_OTHERWISE = 15.0


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
    rng = np.random.default_rng(_SEED)
    every = max(1, len(problem.records) // 3)
    poses = [r.setup.geometry for r in problem.records[::every]]
    chain = some.setup.geometry.chain
    poses += [Geometry(chain, _pose(problem, rng)) for _ in range(_POSES)]
    # What is measured next without a word on the weather is measured as the last record was.
    last = max(problem.records, key=lambda r: r.setup.conditions.days or 0.0).setup.conditions
    like = replace(some.setup, conditions=replace(last, record="next"))
    shots: list[_Shot] = []
    for geometry in poses:
        for direction in _directions(rng):
            setup = _setup(problem, like, geometry, direction)
            shots += _taken(problem, setup, best, rivals)
    again = dict.fromkeys(s.setup for s in sorted(shots, key=lambda s: s.worth, reverse=True))
    for setup in list(again)[:_TRIED_AGAIN]:
        for what, other in _varied(setup, _span(problem)).items():
            shots += _taken(problem, other, best, rivals, what)
    return shots


def _taken(
    problem: Problem,
    setup: PercussionSetup,
    best: Fit,
    rivals: Sequence[Hypothesis],
    varied: str = "",
) -> list[_Shot]:
    """The record with every sensor; none where one of the models is none there."""
    try:
        told = _told(problem, setup, best, rivals)
    except InputError:
        return []
    return [
        _Shot(setup, varied, name, sensor_group(problem, name) in problem.groups, value)
        for name, value in told.items()
    ]


def _span(problem: Problem) -> float:
    """Days from the first record to the last."""
    known = [r.setup.conditions.days for r in problem.records]
    days = [day for day in known if day is not None]
    return max(days) - min(days) if days else 0.0


def _varied(setup: PercussionSetup, span: float) -> dict[str, PercussionSetup]:
    """The same record with softer blows, in a warmer or cooler room, later."""
    now = setup.conditions
    found = {"force": _fresh(setup, blows=setup.blows.change(height=_SOFTER * setup.blows.height))}
    if now.temperature is not None:
        kelvin = now.temperature + _OTHERWISE * (-1.0 if now.temperature > 0.0 else 1.0)
        found["temperature"] = _fresh(setup, conditions=replace(now, temperature=kelvin))
    if now.days is not None and span > 0.0:  # as long again: what drifts is known no further
        found["days"] = _fresh(setup, conditions=replace(now, days=now.days + span))
    return found


def _fresh(setup: PercussionSetup, **changes: Any) -> PercussionSetup:
    """A setup with changes, and nothing remembered of the old one."""
    return replace(setup, **changes, _motions={}, _forces={}, _systems={}, _plans={})


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
        late = f"{here.days:.3g} days" if here.days >= 2.0 else f"{24.0 * here.days:.3g} hours"
        return _How((f"{late} after the first record",), {"days": round(here.days, 3)})
    return _How((), {})


def _pose(problem: Problem, rng: np.random.Generator) -> FloatArray:
    robot = problem.robot
    seen = np.array([r.setup.geometry.pose for r in problem.records])
    low = np.maximum(robot.lower, seen.min(axis=0) - 0.6)
    high = np.minimum(robot.upper, seen.max(axis=0) + 0.6)
    return np.asarray(rng.uniform(low, np.maximum(high, low)))


def _directions(rng: np.random.Generator) -> list[FloatArray]:
    turned = rng.normal(size=(_DIRECTIONS - 1, 3))
    return [np.eye(3)[int(rng.integers(3))], *(d / np.linalg.norm(d) for d in turned)]


def _setup(
    problem: Problem, like: PercussionSetup, geometry: Geometry, direction: FloatArray
) -> PercussionSetup:
    """The record that would be taken, with every sensor that could be had."""
    frame = problem.robot.tool_frame
    names = [f"deflection.{n}" for n in problem.robot.flexible_names]
    names += [f"accelerometer.{frame}.{a}" for a in "xyz"]
    channels = {c.name: c for c in like.channels}
    channels |= {name: parse_channel(name)[0] for name in names}
    rotation = geometry.motion(frame).rotation
    return _fresh(
        like,
        geometry=geometry,
        blows=like.blows.change(direction=direction, tool_rotation=rotation),
        channels=tuple(channels.values()),
    )


def _told(
    problem: Problem, setup: PercussionSetup, best: Fit, rivals: Sequence[Hypothesis]
) -> dict[str, FloatArray]:
    """Sensor -> by how much chi-square would tell each rival, when the best model is refitted."""
    here = setup.predict(problem.model.with_effects(best.hypothesis.effects))
    there = [setup.predict(problem.model.with_effects(h.effects)) for h in rivals]
    moves, covariance = _moves(problem, setup, best, here)
    own = [c.name for c in setup.channels if c.group in problem.groups]
    found = {}
    for sensor in _SENSORS:
        rows = own + [n for n in here if n.startswith(f"{sensor}.") and n not in own]
        noise = {name: _noise(problem, name, here) for name in rows}
        slopes = np.concatenate([moves[n] / noise[n] for n in rows]) if moves else None
        told = []
        for other in there:
            left = np.concatenate([(other[n] - here[n]) / noise[n] for n in rows])
            told.append(_left(left, slopes, covariance))
        found[sensor] = np.array(told)
    return found


def _noise(problem: Problem, name: str, here: dict[str, FloatArray]) -> float:
    known = problem.noise.get(name)
    if known is not None and known.std > 0.0:
        return known.std
    return _NEW_SENSOR * max(float(np.sqrt(np.mean(here[name] ** 2))), 1e-300)


def _moves(
    problem: Problem, setup: PercussionSetup, best: Fit, here: dict[str, FloatArray]
) -> tuple[dict[str, FloatArray], FloatArray]:
    """Channel -> (samples, unknowns) of the best model, and the unknowns' covariance."""
    if best.jacobians is None:
        return {}, np.zeros((0, 0))
    covariance = best.covariance()
    vector = best.hypothesis.vector()
    steps = np.clip(np.sqrt(np.maximum(covariance.diagonal(), 0.0)), 1e-6, 1e-3)
    columns: dict[str, list[FloatArray]] = {name: [] for name in here}
    for k, step in enumerate(steps):
        moved = vector.copy()
        moved[k] += step
        effects = best.hypothesis.at(moved).effects
        there = setup.predict(problem.model.with_effects(effects))
        for name in here:
            columns[name].append((there[name] - here[name]) / step)
    return {name: np.stack(c, axis=1) for name, c in columns.items()}, covariance


def _left(left: FloatArray, slopes: FloatArray | None, covariance: FloatArray) -> float:
    """Chi-square of a difference after what the unknowns, within what is known, can do."""
    total = float(left @ left)
    if slopes is None:
        return total
    root = np.linalg.cholesky(covariance + 1e-18 * np.eye(len(covariance)) * covariance.max())
    scaled = slopes @ root
    right = scaled.T @ left
    return total - float(right @ np.linalg.solve(np.eye(len(root)) + scaled.T @ scaled, right))
