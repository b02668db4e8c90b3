"""The measurement that is asked for, as a test plan."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import timedelta
from typing import Any

from picchio.campaign.record import Record
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.excitation.table import excitation_class
from picchio.prediction.percussion import PercussionSetup
from picchio.prediction.plan import Plan, SensorTable, plan_toml


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
