"""A burst that nobody measured: what each model says of it, against the world's own simulator."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace

import numpy as np
import rainflow
from scipy.interpolate import CubicSpline

from picchio.campaign.channels import parse_channel
from picchio.core.errors import InputError, PicchioWarning
from picchio.diagnosis.life import life_before_and_after
from picchio.model.geometry import Geometry
from picchio.studies.tasks import Operation, Task
from worlds import campaign as worlds

_AWAY = 0.3  # rad, from a pose that was measured
_STILL = 1e-6  # of the largest deflection
CURVE = "nie-2016"  # it has no endurance limit: every joint has a life
SLOPE = 1.0 / 0.3548  # of the paper's S-N curve (section 4.3), cycles over amplitude


@dataclass(frozen=True, eq=False)
class Unmeasured:
    """Where and when nobody measured, and what the world's joints do there.

    Attributes:
        record: the measured record that it is struck like.
        pose: (nv,) rad or m. direction: (3,) world.
        world: of `worlds.quantities`.
    """

    record: object
    pose: np.ndarray
    direction: np.ndarray
    world: dict

    @classmethod
    def draw(cls, found, truth, seed):
        """Near a record's pose, its errors of pose, direction and blows drawn anew."""
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
        return cls(record, pose, direction, true)

    def pairs(self, problem, effects):
        """(told, true) deflections of every joint that moves, by its name."""
        times, series = _deflections(problem, self.record, self.pose, self.direction, effects)
        inside = (times >= 0.0) & (times <= self.world["time"][-1])
        true = CubicSpline(self.world["time"], self.world["deflection"], axis=1)(times[inside])
        still = _STILL * np.abs(true).max()
        return {
            name: (a[inside], b)
            for name, a, b in zip(problem.robot.flexible_names, series, true, strict=True)
            if np.abs(b).max() > still  # a joint that friction holds has no life to be wrong by
        }


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
    there, told = Unmeasured.draw(found, truth, seed), {}
    baseline = found.search.baseline.hypothesis.effects
    for name, effects in (("baseline", baseline), ("extended", found.effects)):
        try:
            pairs = there.pairs(found.problem, effects).values()
        except InputError:
            continue
        peaks = [float(np.abs(a).max() / np.abs(b).max() - 1.0) for a, b in pairs]
        lives = [float(_damage(b) / _damage(a)) - 1.0 for a, b in pairs]
        told[name] = {"peak": peaks, "life": lives}
    return told


def lives(found, truth, seed):
    """The true life and the two ends of the interval told, logarithms over the life told.

    By the paper's S-N curve.

    Args:
        found: a `PercussionDiagnosis`.
        truth: of the campaign.
        seed: of the burst.

    Returns:
        {joint: [true, low, high]}, and "robot": of whichever joint is the first to fail; empty
        where no life is told.
    """
    there = Unmeasured.draw(found, truth, seed)
    campaign = found.problem.campaign
    record = next(r for r in campaign.records if r.file == there.record.name)
    work = Task((
        Operation("burst", there.direction, record.blows(), record.hits, there.pose[None]),
    ))  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PicchioWarning)
        told = life_before_and_after(
            found.problem.robot, work, found.effects,
            after=found.left_open, sn_curve=CURVE,
        )["extended"]  # fmt: skip
    rows, true_lives = {}, []

    def row(true, told):
        ends = told["rivets_interval"]
        over = [x / told["rivets_to_failure"] for x in (true, *ends)]
        return [round(math.log(x), 4) if x > 0.0 else -math.inf for x in over]

    for name, (ours, true) in there.pairs(found.problem, found.effects).items():
        joint = told["joints"][name]
        if "rivets_interval" in joint and 0.0 < joint["rivets_to_failure"] < math.inf:
            true_lives.append(joint["rivets_to_failure"] * _damage(ours) / _damage(true))
            rows[name] = row(true_lives[-1], joint)
    return {**rows, "robot": row(min(true_lives), told)} if true_lives else {}


def _deflections(problem, record, pose, direction, effects):
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
    effects = [e for e in effects if e.where != "sensor"]
    predicted = setup.predict(problem.model.with_effects(effects))
    return setup.samples.times, [predicted[name] for name in names]


def _damage(series):
    ranges = [(low_high, count) for low_high, _, count, *_ in rainflow.extract_cycles(series)]
    return sum(count * low_high**SLOPE for low_high, count in ranges)
