"""The measurement that a diagnosis asks for, taken in the world and added to the campaign."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from worlds import campaign as worlds
from worlds import robots


def taken(ask, campaign, truth, seed):
    """The campaign with one more record: the pose, direction, force and sensor asked for.

    Args:
        ask: `next_measurement` of a diagnosis.
        campaign, truth: as `worlds.make` gave them.
        seed: of the noise.
    """
    world = truth["world"]
    nominal = robots.load(world.plan.robot)
    pose = np.array([ask["pose"][joint] for joint in nominal.joints])
    last = world.plan.shots[-1]
    shot = replace(
        last,
        pose=pose, direction=np.array(ask["direction"]), force=float(ask["force"]),
        temperature=float(ask.get("temperature", last.temperature)),
        when=float(ask.get("days", last.when)),
    )  # fmt: skip
    groups = tuple(truth["noise"])
    extra = worlds.groups_of((ask["sensor"],), nominal)
    every = tuple(dict.fromkeys((*groups, *extra)))
    number = len(campaign)
    data, _ = world.record(number, every, shot)
    times = world.plan.times()
    levels = worlds.noise_levels([data], times, truth["snr_db"]) | truth["noise"]
    rng = np.random.default_rng([seed, 8])
    arrays = {}
    for group in every:
        read = data[group] + levels[group] * worlds.noise(data[group].shape, rng)
        names = worlds.channels(group, nominal)
        arrays |= {n: np.ascontiguousarray(v) for n, v in zip(names, read.T, strict=True)}
    record = Record.from_arrays(
        f"r{number + 1:02d}.csv", times, arrays,
        pose=ask["pose"], direction=ask["direction"], force=shot.force,
        time=campaign.records[0].table.time + timedelta(days=shot.when - world.plan.shots[0].when),
        temperature=shot.temperature,
    )  # fmt: skip
    table = campaign.table
    return Campaign.from_records(
        [*campaign.records, record],
        robot=table.robot, tool=table.tool,
        excitation=table.excitation.model_dump(exclude_none=True),
        tolerance=table.tolerance.model_dump(),
    )  # fmt: skip


def told_sets(diagnosis):
    """Every set of causes that a diagnosis tells."""
    claimed = frozenset((c.effect, c.target) for c in diagnosis.causes)
    return {claimed, *(frozenset(tuple(p) for p in each) for each in diagnosis.alternatives)}
