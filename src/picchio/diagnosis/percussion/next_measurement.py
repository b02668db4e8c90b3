"""What to measure next: where the rivals' predictions differ most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from picchio.campaign import parse_channel
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.fit import Fit
from picchio.diagnosis.percussion.problem import Problem
from picchio.diagnosis.percussion.trials import Trial
from picchio.diagnosis.percussion.unknowns import Hypothesis
from picchio.model.geometry import Geometry
from picchio.prediction.percussion import PercussionSetup

_POSES = 6
_DIRECTIONS = 3
_SENSORS = ("deflection", "accelerometer")
_SEED = 20160401


def next_measurement(
    problem: Problem,
    best: Fit,
    rivals: Sequence[Trial],
    same: Sequence[tuple[frozenset[str], float]],
) -> dict[str, Any] | None:
    """The pose, direction, level and sensors that best separate the best model from its rival.

    Each rival's best fit is simulated against the other in records that were not taken: new
    poses and directions, more force, the sensors at hand and those that are missing.

    Returns:
        as in the JSON; None where there is no rival to be told apart.
    """
    tied = {labels for labels, _ in same}
    others = [t.fit for t in rivals if not tied or t.fit.hypothesis.labels in tied]
    if not others:
        return None
    other = min(others, key=lambda f: f.cost)
    rng = np.random.default_rng(_SEED)
    robot = problem.robot
    some = problem.records[0]
    poses = [r.setup.geometry for r in problem.records[:: max(1, len(problem.records) // 3)]]
    poses += [Geometry(some.setup.geometry.chain, _pose(problem, rng)) for _ in range(_POSES)]
    force = float(np.abs(some.setup.blows.height).max())
    tried = []
    for geometry in poses:
        for direction in _directions(rng):
            value, sensor = _separation(
                problem, some.setup, geometry, direction, best.hypothesis, other.hypothesis
            )
            tried.append((value, sensor, geometry, direction))
    if not tried:
        return None
    value, sensor, geometry, direction = max(tried, key=lambda item: item[0])
    pose = {
        name: round(float(q), 6) for name, q in zip(robot.joint_names, geometry.pose, strict=True)
    }
    names = " + ".join(sorted(best.hypothesis.labels)) or "the nominal model"
    rival = " + ".join(sorted(other.hypothesis.labels))
    return {
        "why": f"{names} and {rival} differ most here: by {value:.3g} times the noise "
        f"(RMS, {sensor})",
        "pose": pose,
        "direction": [round(float(c), 6) for c in direction],
        "force": force,
        "sensor": sensor,
        "separation": float(value),
    }


def _pose(problem: Problem, rng: np.random.Generator) -> np.ndarray:
    robot = problem.robot
    seen = np.array([r.setup.geometry.pose for r in problem.records])
    low = np.maximum(robot.lower, seen.min(axis=0) - 0.6)
    high = np.minimum(robot.upper, seen.max(axis=0) + 0.6)
    return np.asarray(rng.uniform(low, np.maximum(high, low)))


def _directions(rng: np.random.Generator) -> list[np.ndarray]:
    turned = rng.normal(size=(_DIRECTIONS - 1, 3))
    return [np.eye(3)[int(rng.integers(3))], *(d / np.linalg.norm(d) for d in turned)]


def _separation(
    problem: Problem,
    like: PercussionSetup,
    geometry: Geometry,
    direction: np.ndarray,
    one: Hypothesis,
    other: Hypothesis,
) -> tuple[float, str]:
    """RMS difference of two hypotheses over the noise, and in which sensors it is seen best."""
    robot = problem.robot
    frame = robot.tool_frame
    names = [f"deflection.{n}" for n in robot.flexible_names]
    names += [f"accelerometer.{frame}.{a}" for a in "xyz"]
    channels = tuple(parse_channel(name)[0] for name in names)
    rotation = geometry.motion(robot.tool_frame).rotation
    setup = replace(
        like,
        geometry=geometry,
        blows=like.blows.change(direction=direction, tool_rotation=rotation),
        channels=channels,
        _motions={},
        _forces={},
        _systems={},
    )
    try:
        a = setup.predict(problem.model.with_effects(one.effects))
        b = setup.predict(problem.model.with_effects(other.effects))
    except InputError:
        return 0.0, _SENSORS[0]
    best, where = 0.0, _SENSORS[0]
    for sensor in _SENSORS:
        rows = [name for name in names if name.startswith(sensor)]
        known = [problem.noise[n].std for n in rows if n in problem.noise]
        noise = (
            float(np.mean(known))
            if known
            else 0.01 * float(np.sqrt(np.mean([np.mean(a[n] ** 2) for n in rows])))
        )
        value = float(np.sqrt(np.mean([np.mean((a[n] - b[n]) ** 2) for n in rows])) / noise)
        if value > best:
            best, where = value, sensor
    return best, where
