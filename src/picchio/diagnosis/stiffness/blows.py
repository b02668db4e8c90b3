"""Where a fit of percussion records may begin if hardly anything is known of the stiffness.

A fit in time that begins far off ends in the nearest basin: a cycle too many or too few. What a
record reads over its blows, along a line in the Laplace plane (see `taps`), is a function of the
arm alone; matched by modes first it tells springs and damping from anywhere within the prior.
Masses and places are taken as stated first, which is near enough to begin with.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from picchio.campaign.channels import Channel
from picchio.campaign.tables import Tolerance
from picchio.core.arrays import FloatArray
from picchio.core.workers import worker_pool
from picchio.diagnosis.attempt import trials
from picchio.diagnosis.stiffness.fit import climb
from picchio.diagnosis.stiffness.modes import TAILS, settled_elsewhere, starts
from picchio.diagnosis.stiffness.prior import UNKNOWN, Prior
from picchio.diagnosis.stiffness.responses import (
    Response,
    assembled,
    left_over,
    never_exact,
    response_to,
)
from picchio.diagnosis.stiffness.taps import POWER, SAMPLED, Seen, Window, lines, transform
from picchio.robot.flexible_robot import FlexibleRobot

_LONGEST = 3.0  # s of a record that are looked at: what rings longer hardly tells more
_HIGHEST = 150.0  # Hz, of a line
_SHAKEN = 0.1  # least force over the largest, of a line
_FINER = 16  # steps of a blow's transform in one of the record's
# Where masses, poses and places would be so many standard deviations off, root mean square,
# something else is wrong than springs.
_STRAINED = 3.0
# How hard all blows are, and how far that may be off.
_HARD, _HARDER = "force", 0.1


@dataclass(frozen=True, eq=False)
class BlowRecord:
    """A record of blows whose force is known.

    Attributes:
        name: of the record.
        pose: (nv,) rad or m.
        direction: (3,) unit, world, of the force.
        time: (count,) s.
        force: N, at times in s.
        channels: what is read, with (count,) SI and the standard deviation of its noise.
    """

    name: str
    pose: FloatArray
    direction: FloatArray
    time: FloatArray
    force: Callable[[FloatArray], FloatArray]
    channels: Sequence[tuple[Channel, FloatArray, float]]


@dataclass(frozen=True)
class Rough:
    """Springs and damping as records of blows have them.

    Attributes:
        stiffness: (n,) over the stated.
        stiffness_std: (n,) of the logarithms.
        damping: of all ratios, over the stated.
        left: residual over the functions.
        before: the same with the stated values.
    """

    stiffness: FloatArray
    stiffness_std: FloatArray
    damping: float
    left: float
    before: float


def rough(
    robot: FlexibleRobot,
    records: Sequence[BlowRecord],
    tolerance: Tolerance | None = None,
    begin: Rough | None = None,
    workers: int | None = 1,
) -> Rough | None:
    """Springs and damping from nothing.

    Args:
        robot: flexible.
        records: of blows.
        tolerance: how exact masses, poses and places are; None to take them as stated, which is
            many times faster.
        begin: what was found so, to begin with; None to match modes first.
        workers: processes, as `worker_pool` has them.

    Returns:
        None where no channel tells a motion, or where masses, poses and places would be absurdly
        far off.
    """
    exact = tolerance or Tolerance.zero()
    names = [*never_exact(robot, exact, [record.name for record in records]), _HARD]
    index = {name: k for k, name in enumerate(names)}
    stands: dict[bytes, tuple[FloatArray, tuple[Response, ...]]] = {}
    for record in records:
        key = record.pose.tobytes()
        before = stands.get(key, (record.pose, ()))[1]
        stands[key] = record.pose, (*before, *_functions(robot, record, exact, index))
    if not any(own for _, own in stands.values()):
        return None
    n = len(robot.flexible_index)
    prior = Prior(UNKNOWN**2 * np.eye(n), (False,) * n)
    problem = replace(
        assembled(robot, [one for one in stands.values() if one[1]], exact, prior, index),
        damping_std=np.full(n, UNKNOWN),
    )
    stated = np.zeros(len(problem.precision))
    if begin is None:
        places = starts(problem)
    else:
        at = stated.copy()
        at[:n], at[n : 2 * n] = np.log(begin.stiffness), math.log(begin.damping)
        places = [at]

    # Those that all records share, but for the force, which no stated tolerance is of.
    shared = [2 * n + k for k, name in enumerate(names)
              if name != _HARD and not name.startswith("direction.")]  # fmt: skip

    def astray(at: FloatArray) -> bool:
        off = at[shared]
        return float(off @ off) > _STRAINED**2 * len(shared)

    climbs = partial(climb, problem, tail=TAILS, astray=astray)
    with worker_pool(workers, trials({"climb": climbs})) as mapped:
        climbed = [one for one in mapped("climb", places) if one and not astray(one.mean)]
    if not climbed:
        return None
    found = max(climbed, key=lambda one: one.evidence)
    if begin is not None:
        found = settled_elsewhere(problem, found, free=False)
        if astray(found.mean):
            return None
    damping, size = found.mean[n : 2 * n], found.std[n : 2 * n]
    return Rough(
        np.exp(found.mean[:n]), found.std[:n], float(np.exp(np.average(damping, weights=size**-2))),
        left_over(problem, found.mean), left_over(problem, stated),
    )  # fmt: skip


def _functions(
    robot: FlexibleRobot, record: BlowRecord, tolerance: Tolerance, index: dict[str, int]
) -> list[Response]:
    """What each channel reads over the blows."""
    time = record.time
    step, end = float(np.median(np.diff(time))), min(float(time[-1]), _LONGEST)
    line, fine = lines(end, min(SAMPLED / step, _HIGHEST)), step / _FINER
    within = np.arange(0.5 * fine, end, fine)
    force = record.force(within)
    struck = force != 0.0
    blow = fine * transform(line, within[struck], force[struck])
    if not len(line) or not np.abs(blow).max() > 0.0:
        return []
    kept = np.abs(blow) > _SHAKEN * np.abs(blow).max()
    told = [one for one in record.channels if one[0].kind.name in POWER]
    if not told:
        return []
    window, found = Window(time, line, blow, end), []
    every = np.stack([values for _, values, _ in told], axis=1)
    both = window.over_blow(every, np.array([noise for *_, noise in told]), kept)
    for (channel, *_), value, size in zip(told, *both, strict=True):
        if not np.abs(value).max() > 0.0:
            continue
        seen = Seen.by(channel, record.direction, robot, record.pose)
        made = response_to(robot, record.name, seen, record.pose, tolerance, index)
        gains = made.gains.copy()
        gains[index[_HARD]] = _HARDER
        bends = np.zeros((len(index), len(value)))
        found.append(replace(made, omega=line.imag[kept], measured=value, scale=size,
                             shift=line[0].real, gains=gains, bends=bends))  # fmt: skip
    return found
