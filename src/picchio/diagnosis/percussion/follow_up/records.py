"""Records that might be taken next, and the test plan of the one that is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import timedelta
from typing import Any

import numpy as np

from picchio.campaign.channels import addable_kinds
from picchio.campaign.record import Record
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem
from picchio.excitation.table import excitation_class
from picchio.model.geometry import Geometry
from picchio.prediction.percussion import PercussionSetup
from picchio.prediction.plan import Plan, SensorTable, plan_toml

_POSES = 6
_DIRECTIONS = 3
_SEED = 20160401
_SOFTER = 0.3
_OTHERWISE = 15.0


def possible_records(problem: Problem, like: MeasuredRecord) -> Iterator[PercussionSetup]:
    """Poses and directions, some that were measured and some not, with every sensor there is.

    Args:
        problem: the campaign.
        like: the record whose blows are used.
    """
    rng = np.random.default_rng(_SEED)
    every = max(1, len(problem.records) // 3)
    poses = [r.setup.geometry for r in problem.records[::every]]
    chain = like.setup.geometry.chain
    poses += [Geometry(chain, _pose(problem, rng)) for _ in range(_POSES)]
    # What is measured next without a word on the weather is measured as the last record was.
    last = max(problem.records, key=lambda r: r.setup.conditions.days or 0.0).setup.conditions
    usual = replace(like.setup, conditions=replace(last, record="next"))
    for geometry in poses:
        for direction in _directions(rng):
            yield _setup(problem, usual, geometry, direction)


def varied(problem: Problem, setup: PercussionSetup) -> dict[str, PercussionSetup]:
    """The same record with softer blows, in a warmer or cooler room, later."""
    now = setup.conditions
    known = [r.setup.conditions.days for r in problem.records]
    days = [day for day in known if day is not None]
    found = {"force": replace(setup, blows=setup.blows.change(height=_SOFTER * setup.blows.height))}
    if now.temperature is not None:
        kelvin = now.temperature + _OTHERWISE * (-1.0 if now.temperature > 0.0 else 1.0)
        found["temperature"] = replace(setup, conditions=replace(now, temperature=kelvin))
    if now.days is not None and days and max(days) > min(days):
        later = now.days + (max(days) - min(days))  # as long again: what drifts is known no further
        found["days"] = replace(setup, conditions=replace(now, days=later))
    return found


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
    robot = problem.robot
    channels = {c.name: c for c in like.channels}
    for kind in addable_kinds():
        channels |= {c.name: c for c, _ in SensorTable(channels=kind.name).expand(robot)}
    rotation = geometry.motion(robot.tool_frame).rotation
    return replace(
        like,
        geometry=geometry,
        blows=like.blows.change(direction=direction, tool_rotation=rotation),
        channels=tuple(channels.values()),
    )


def percussion_records(problem: Problem) -> list[Record]:
    """The campaign's records that the diagnosis is of."""
    return [record for record in problem.campaign if record.kind == "percussion"]


def sensor_group(problem: Problem, kind: str) -> str:
    """The channel group that a kind of sensor is asked for as: at the tool, or on every joint."""
    return SensorTable(channels=kind).expand(problem.robot)[0][0].group


def when(days: float) -> str:
    """A time after the campaign's first record, in words."""
    late = f"{days:.3g} days" if days >= 2.0 else f"{24.0 * days:.3g} hours"
    return f"{late} after the first record"


def asked_plan(
    problem: Problem, ask: Mapping[str, Any], setup: PercussionSetup, like: str
) -> str | None:
    """The record as a `picchio-plan/1` file, for the bench and for `picchio simulate`.

    The channels of the campaign with their noise, and those that are asked for.

    Args:
        problem: the campaign.
        ask: pose, direction, force, sensor and, where they matter, temperature and days.
        setup: of the record.
        like: file of the record whose blows these are.

    Returns:
        TOML; None where the blows are not those of a plan (a measured force).
    """
    records = percussion_records(problem)
    table = next(record for record in records if record.file == like).excitation
    if not excitation_class(table.kind).programmed:
        return None
    samples = setup.samples
    quiet = max(-samples.start, 0.0)
    taken = [record.taken for record in records if record.taken is not None]
    times = [min(taken) + timedelta(days=ask["days"])] if "days" in ask else None
    names = {c.name: None for r in problem.records for c in r.setup.channels}
    sensors = [
        SensorTable(
            channels=name,
            noise=float(f"{problem.noise[name].std:.4g}") if name in problem.noise else 0.0,
        )
        for name in names
    ]
    wanted = sensor_group(problem, ask["sensor"])
    if wanted not in problem.groups:
        sensors.append(SensorTable(channels=wanted))
    try:
        plan = Plan(
            poses=[ask["pose"]],
            directions=[ask["direction"]],
            levels=[ask["force"]],
            sample_rate=float(f"{1.0 / samples.step:.9g}"),
            quiet=quiet,
            length=samples.count * samples.step - quiet,
            times=times,
            temperatures=[ask["temperature"]] if "temperature" in ask else None,
            excitation=table,
            tolerance=problem.campaign.tolerance,
            sensor=sensors,
            notes=ask["why"],
        )
        plan.check()
    except (InputError, ValueError):
        return None
    return plan_toml(plan)
