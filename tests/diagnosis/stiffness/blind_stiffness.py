"""Blind trials of finding stiffness from nothing: campaigns of the worlds, and how they are judged.

Used by the tests on a few campaigns and by `benchmarks/stiffness.py` on many.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

import picchio
from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record

SIZES = (3, 6, 7)


@dataclass(frozen=True)
class Judged:
    """One joint of one campaign.

    Attributes:
        robot, joint: names.
        seed: of the campaign.
        error: ln(value / truth).
        std: of the logarithm, as stated by the interval.
        told, inside: whether it is told, and whether the 90 % interval has the truth.
        bound: the least deviation of the logarithm that these readings allow (Cramer and Rao), the
            prior and what is never exact in; NaN where it was not asked.
    """

    robot: str
    joint: str
    seed: int
    error: float
    std: float
    told: bool
    inside: bool
    bound: float


def campaign(world) -> Campaign:
    """The world's columns as a campaign."""
    record = Record.from_columns("loads.csv", world.columns, kind="static")
    return Campaign.from_records([record], robot=world.robot)


def judge(world, seed: int, found) -> list[Judged]:
    """Every joint of a campaign against the truth."""
    bound = lower_bound(world, found)
    judged = []
    for k, (joint, truth) in enumerate(zip(found.joints, world.truth, strict=True)):
        assert joint.name == world.joints[k]
        s = joint.stiffness
        judged.append(Judged(
            world.robot, joint.name, seed, math.log(s.value / truth),
            math.log(s.high / s.low) / (2.0 * 1.645), s.told, s.low <= truth <= s.high, bound[k],
        ))  # fmt: skip
    return judged


def lower_bound(world, found) -> np.ndarray:
    """(n,) least standard deviations at the truth, joint springs alone, the true noise known."""
    plain = replace(found.answer.fit.problem, causes=())
    n = plain.joints
    at = np.zeros(len(plain.precision))
    at[:n] = np.log(world.truth / world.nominal)
    information = np.array(plain.precision)
    for part in plain.predict(at):
        r = part.residual.shape[1]
        spread = part.own + max(world.noise, 1e-9) ** 2 * np.eye(r)
        white = np.linalg.solve(np.linalg.cholesky(spread), part.slope).reshape(-1, len(at))
        information += white.T @ white
    return np.sqrt(np.diag(np.linalg.inv(information)))[:n]


def static_trial(worlds, count: int, first: int = 0, **options) -> list[Judged]:
    """So many campaigns of arms with 3, 6 and 7 joints in turn."""
    judged = []
    for seed in range(first, first + count):
        world = worlds.draw(SIZES[seed % 3], seed)
        found = picchio.identify(world.robot, campaign(world))
        judged += judge(world, seed, found)
    return judged


def frf_campaign(world) -> Campaign:
    """The world's functions as a campaign, a record each."""
    records = [
        Record.from_columns(f"f{k:02d}.csv", columns, kind="frf", **table)
        for k, (columns, table) in enumerate(world.records)
    ]
    return Campaign.from_records(records, robot=world.robot)


def tap_campaign(world) -> Campaign:
    """The world's taps as a campaign, a record each."""
    records = [
        Record.from_arrays(f"t{k:02d}.csv", held["time"],
                           {name: x for name, x in held.items() if name != "time"}, **table)
        for k, (held, table) in enumerate(world.records)
    ]  # fmt: skip
    return Campaign.from_records(records, robot=world.robot)


def press_campaign(world) -> Campaign:
    """The world's presses as a campaign, a record each."""
    records = [
        Record.from_arrays(f"p{k}.csv", held["time"],
                           {name: x for name, x in held.items() if name != "time"},
                           kind="clamped", **table)
        for k, (held, table) in enumerate(world.records)
    ]  # fmt: skip
    return Campaign.from_records(records, robot=world.robot)


def press_trial(worlds, count: int, first: int = 0) -> tuple[list, list]:
    """So many campaigns of motors that press; of damping they say nothing."""
    return _trial(worlds.draw, press_campaign, count, first, SIZES)


def frf_trial(worlds, count: int, first: int = 0, sizes=SIZES) -> tuple[list, list]:
    """So many campaigns; stiffness, and damping ratios, judged alike."""
    return _trial(worlds.draw, frf_campaign, count, first, sizes)


def tap_trial(worlds, count: int, first: int = 0, sizes=SIZES, known=True) -> tuple[list, list]:
    """The same of taps, their force measured or not."""
    return _trial(partial(worlds.draw, known=known), tap_campaign, count, first, sizes)


ARMS = {3: "fanuc_like_3dof", 6: "fanuc_r2000ic", 7: "kinova_gen3"}
FAR, NEAR = math.log(4.0), 0.3


@dataclass(frozen=True)
class Train:
    """A campaign of usual blows on an arm whose springs are far from stated, in a wrong world."""

    robot: str
    campaign: Campaign
    truth: np.ndarray
    damping: np.ndarray


def trains(size: int, seed: int, mismatch: float = 1.0, records: int = 12) -> Train:
    """Stiffness drawn up to a factor of four off, damping up to two; every other one without
    deflections."""
    from worlds import campaign as worlds
    from worlds import robots

    name, rng = ARMS[size], np.random.default_rng([seed, 77])
    nominal = robots.load(name)
    far = rng.choice([-1.0, 1.0], size) * rng.uniform(NEAR, FAR, size)
    damped = rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 0.7)
    causes = [
        ("joint_stiffness", joint, {"scale": math.exp(off)})
        for joint, off in zip(nominal.joints, far, strict=True)
    ]
    causes.append(("modal_damping", "robot", {"scale": math.exp(damped)}))
    sensors = (f"accelerometer.{nominal.tool}", *(("deflection",) if seed % 2 else ()))
    made, truth = worlds.make(robot=name, seed=seed, causes=causes, sensors=sensors,
                              records=records, mismatch=mismatch)  # fmt: skip
    own, stated = truth["nuisances"], picchio.load_robot(name)
    stiffness = np.array([own["stiffness"][joint] for joint in nominal.joints])
    springs = np.array([joint.stiffness for joint in stated.flexible_joints])
    ratio = own["damping_ratio"] * math.exp(damped) * stated.damping_ratio
    return Train(name, made, np.exp(far) * stiffness * springs, ratio)


def train_trial(count: int, first: int = 0, sizes=SIZES) -> tuple[list, list]:
    """So many campaigns of usual blows."""
    return _trial(trains, lambda train: train.campaign, count, first, sizes)


def _trial(draw, campaign_of, count, first, sizes) -> tuple[list, list]:
    stiffness, damping = [], []
    for seed in range(first, first + count):
        world = draw(sizes[seed % len(sizes)], seed)
        found = picchio.identify(world.robot, campaign_of(world))
        for k, joint in enumerate(found.joints):
            pairs = [(stiffness, joint.stiffness, world.truth[k])]
            if hasattr(world, "damping"):
                pairs.append((damping, joint.damping_ratio, world.damping[k]))
            for kind, one, truth in pairs:
                kind.append(Judged(
                    world.robot, joint.name, seed, math.log(one.value / truth),
                    math.log(one.high / one.low) / (2.0 * 1.645), one.told,
                    one.low <= truth <= one.high, math.nan,
                ))  # fmt: skip
    return stiffness, damping


def summary(judged: list[Judged]) -> dict[str, float]:
    """What issue and report ask for, of all joints and of those that are told."""
    told = [one for one in judged if one.told]
    error = np.abs([math.expm1(one.error) for one in told])
    could = [one for one in judged if one.bound <= 0.04]
    wrong = [one for one in told if abs(one.error) > 3.0 * one.std]
    return {
        "campaigns": len({(one.robot, one.seed) for one in judged}),
        "joints": len(judged),
        "told": len(told),
        "told_within_10_percent": float(np.mean(error <= 0.10)) if told else math.nan,
        "median_error": float(np.median(error)) if told else math.nan,
        "coverage_told": float(np.mean([one.inside for one in told])) if told else math.nan,
        "coverage_all": float(np.mean([one.inside for one in judged])),
        "wrong_confident": len(wrong) / max(len(told), 1),
        "could_be_told": len(could),
        "told_of_those": float(np.mean([one.told for one in could])) if could else math.nan,
    }
