"""A burst that nobody measured: what each model says of it, against the world's own simulator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import rainflow
from scipy.interpolate import CubicSpline

from picchio.campaign.channels import parse_channel
from picchio.core.errors import InputError
from picchio.model.geometry import Geometry
from worlds import campaign as worlds

_AWAY = 0.3  # rad, from a pose that was measured
_STILL = 1e-6  # of the largest deflection
SLOPE = 1.0 / 0.3548  # of the paper's S-N curve (section 4.3), cycles over amplitude


def errors(found, truth, seed):
    """Relative errors of the peak deflection and of the life, per joint, before and after.

    The life is that of a shaft at the joint, by rainflow and the slope of the paper's S-N curve:
    strength and section cancel. Both are taken from deflections, which the world gives back.

    Args:
        found: a `PercussionDiagnosis`.
        truth: of the campaign.
        seed: of the burst.

    Returns:
        {"baseline" or "extended": {"peak": [...], "life": [...]}}; empty where a model has none.
    """
    rng = np.random.default_rng([seed, 9])
    index = int(rng.integers(len(found.problem.records)))
    record = found.problem.records[index]
    robot = found.problem.robot
    pose = record.setup.geometry.pose + rng.uniform(-_AWAY, _AWAY, len(robot.joint_names))
    pose = np.clip(pose, robot.lower, robot.upper)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    number = int(record.name.removeprefix("r").removesuffix(".csv")) - 1
    true = worlds.quantities(truth["world"], pose=pose, direction=direction, index=number)
    told = {}
    for name, fit in (("baseline", found.search.baseline), ("extended", found.extended)):
        try:
            times, series = _deflections(found.problem, record, pose, direction, fit)
        except InputError:
            continue
        inside = (times >= 0.0) & (times <= true["time"][-1])
        world = CubicSpline(true["time"], true["deflection"], axis=1)(times[inside])
        still = _STILL * np.abs(world).max()
        pairs = [
            (a[inside], b)
            for a, b in zip(series, world, strict=True)
            if np.abs(b).max() > still  # a joint that friction holds has no life to be wrong by
        ]
        peaks = [float(np.abs(a).max() / np.abs(b).max() - 1.0) for a, b in pairs]
        lives = [float(_damage(b) / _damage(a)) - 1.0 for a, b in pairs]
        told[name] = {"peak": peaks, "life": lives}
    return told


def _deflections(problem, record, pose, direction, fit):
    """Times, s, and every joint's deflections there, rad."""
    robot = problem.robot
    geometry = Geometry(record.setup.geometry.chain, pose)
    rotation = geometry.motion(robot.tool_frame).rotation
    names = [f"deflection.{joint}" for joint in robot.flexible_names]
    setup = replace(
        record.setup,
        geometry=geometry,
        blows=record.setup.blows.change(direction=direction, tool_rotation=rotation),
        channels=tuple(parse_channel(name)[0] for name in names),
    )
    # A sensor's fault is in the readings, not in the arm.
    effects = [e for e in fit.hypothesis.effects if e.where != "sensor"]
    predicted = setup.predict(problem.model.with_effects(effects))
    return setup.samples.times, [predicted[name] for name in names]


def _damage(series):
    ranges = [(low_high, count) for low_high, _, count, *_ in rainflow.extract_cycles(series)]
    return sum(count * low_high**SLOPE for low_high, count in ranges)
