"""The measurement that is asked for, as a test plan."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import timedelta
from typing import Any

import numpy as np

from picchio.core.errors import InputError
from picchio.diagnosis.percussion.problem import Problem
from picchio.prediction.percussion_setup import PercussionSetup
from picchio.prediction.plan import Plan, SensorTable, plan_toml


def asked_plan(problem: Problem, ask: Mapping[str, Any], setup: PercussionSetup) -> str | None:
    """The record as a `picchio-plan/1` file, for the bench and for `picchio simulate`.

    The sensors of the campaign with their noise, and the one that is asked for.

    Args:
        problem: the campaign.
        ask: pose, direction, force, sensor and, where they matter, temperature and days.
        setup: of the record.

    Returns:
        TOML; None where the blows are not those of a plan (a measured force).
    """
    table = problem.campaign.table.excitation
    if table.kind == "measured":
        return None
    samples = setup.samples
    quiet = max(-samples.start, 0.0)
    taken = [record.taken for record in problem.campaign if record.taken is not None]
    sensors = []
    for group in problem.groups:
        own = [c.name for r in problem.records for c in r.setup.channels if c.group == group]
        levels = [problem.noise[name].std for name in own if name in problem.noise]
        sensors.append(SensorTable(channels=group, noise=float(f"{np.mean(levels):.4g}")))
    if not any(group.split(".")[0] == ask["sensor"] for group in problem.groups):
        sensors.append(SensorTable(channels=ask["sensor"]))
    times = [min(taken) + timedelta(days=ask["days"])] if "days" in ask else None
    try:
        plan = Plan(
            poses=[ask["pose"]],
            directions=[ask["direction"]],
            levels=[ask["force"]],
            hits=None if table.hits is not None else _hits(setup),
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


def _hits(setup: PercussionSetup) -> int | None:
    """Blows of the record's burst; None of a steady one."""
    return None if setup.steady else len(setup.blows.height)
