"""What is left: the worlds that may be, and blows as they have come so far."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.excitation.measured import MeasuredForce
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.uncertain_lives import Draws, Uncertain
from picchio.ledger.blows import Burst
from picchio.ledger.counted import Counted, Stretch
from picchio.model.model import Model
from picchio.robot.spread import root_of
from picchio.studies.rivet.variation import WornParts
from picchio.studies.tasks import Operation, Task
from picchio.studies.uncertainty.inputs import DEFAULT_INPUTS
from picchio.studies.uncertainty.sampler import Sampler

UNLIKELY = 0.05
"""Share of the worlds: where a joint is whole in fewer, something is not as it was taken to be."""
# Bursts that stand for all; their damage is followed through every drawn world.
_TYPICAL = 4
FORCE_SPREAD = {"force": 0.05, "acceleration": 0.075, "trigger": 0.15, "poses": 0.15}
"""Of a blow's size, one factor for all blows: a calibrated force; one told from an acceleration
(5 % each of the sensor and of the blow's width, which is the task's, the rest of the masses and of
the reading of the peak); one that the task states."""


@dataclass(frozen=True, eq=False)
class Worlds:
    """Drawn worlds: what the joints have suffered in each.

    Attributes:
        damage: (n, m) so far; NaN without a curve.
        mix: (m,) factor on the damage a blow to come does: the days so far, drawn anew.
    """

    damage: FloatArray
    mix: FloatArray

    def interval(self, joint: int, share: float = 0.9) -> tuple[float, float]:
        """Where the damage of a joint lies in so many of the worlds.

        Args:
            joint: which.
            share: of the worlds.
        """
        values = self.damage[joint]
        low, high = np.quantile(values, [0.5 - 0.5 * share, 0.5 + 0.5 * share])
        return float(low), float(high)

    def whole(self, joint: int) -> float:
        """In which share of the worlds a joint is whole by now; 1 of one without a curve.

        Args:
            joint: which.
        """
        return float((~(self.damage[joint] >= 1.0)).mean())

    def blows_left(self, joint: int, blows: int) -> FloatArray:
        """How many blows are left until the sum is one.

        The joint is whole: worlds in which it had to be broken by now are none of ours. That is
        Bayes' rule, since a world says for certain whether the joint has failed.

        Args:
            joint: which.
            blows: so far.

        Returns:
            (w,) of the worlds in which the sum is below one; inf without end.
        """
        done = self.damage[joint]
        alive = done < 1.0
        done, mix = done[alive], self.mix[alive]
        with np.errstate(divide="ignore", invalid="ignore"):
            left = (1.0 - done) * blows / (done * mix)
        return np.where(done > 0.0, left, np.inf)


def quantiles(values: FloatArray) -> dict[str, float]:
    """P10, P50 and P90 of what one more draw would be, each a value that is there.

    By ranks, so that few worlds that are left make it wider: the next of m + 1 equal draws lies
    below the k-th of m with the chance k / (m + 1). What lies below the least of fewer than nine is
    nothing: the next blow may be the last.

    Args:
        values: (w,), inf allowed.

    Returns:
        them by name; zeros of none.
    """
    count = values.size
    if not count:
        return {"p10": 0.0, "p50": 0.0, "p90": 0.0}
    order = np.append(0.0, np.sort(values))
    ranks = {"p10": math.floor(0.1 * (count + 1)), "p50": round(0.5 * (count + 1)),
             "p90": min(math.ceil(0.9 * (count + 1)), count)}  # fmt: skip
    return {name: float(order[rank]) for name, rank in ranks.items()}


def typical(stretches: Sequence[Stretch]) -> list[Stretch]:
    """Stretches whose bursts stand for all: as many in each part of equal damage.

    Args:
        stretches: by time.

    Returns:
        some of them, one perhaps several times.
    """
    done = np.array([each.damage for each in stretches])
    weight = (done / np.maximum(done.sum(axis=0), 1e-300)).max(axis=1)
    whole = np.cumsum(weight + 1e-12 * max(float(weight.max()), 1e-300))
    targets = (np.arange(_TYPICAL) + 0.5) / _TYPICAL * whole[-1]
    chosen = [stretches[int(k)] for k in np.searchsorted(whole, targets)]
    short = [each for each in chosen if each.short]
    return short or [min(stretches, key=lambda each: each.pieces)]


def force_of(burst: Burst) -> MeasuredForce:
    """A burst as a measured force, straight lines between its samples.

    Args:
        burst: any.
    """
    end = burst.start[1:]
    span = np.diff(burst.start)
    last = burst.constant[:-1] + burst.slope[:-1] * span
    before = end - np.minimum(1e-9, 0.01 * span)
    # Where pulses touch, a piece may be as short as the rounding of its times.
    lasting = span > 1e-9
    time = np.column_stack([burst.start[:-1], before])[lasting].ravel()
    force = np.column_stack([burst.constant[:-1], last])[lasting].ravel()
    time, force = np.append(time, burst.start[-1]), np.append(force, 0.0)
    return MeasuredForce(time, force, float(time[-1]))


def worlds(
    model: Model,
    curves: Sequence[SNCurve | None],
    sn_curve: str | SNCurve | None,
    counted: Counted,
    samples: int,
    seed: int,
) -> Worlds:
    """Draw the worlds: stiffness, damping, force, the model's error, the specimens' strength.

    Each factor is one for all blows of a world. What bursts do there is followed through some of
    them, and taken for all.

    Args:
        model: the robot and its effects.
        curves: of the n joints.
        sn_curve: as given for all shafts, or None.
        counted: all bursts.
        samples: worlds to draw, at most 256.
        seed: of the draws.

    Returns:
        what the joints have suffered in each.
    """
    which = typical(counted.stretches)
    operations = tuple(
        Operation(str(k), burst.direction, force_of(burst), 1, burst.pose[None],
                  float(which.count(each)))
        for k, each in enumerate(dict.fromkeys(which))
        for burst in [counted.typical[each.onset]]
    )  # fmt: skip
    squares = sum(count * FORCE_SPREAD[kind] ** 2 for kind, count in counted.kinds.items())
    force = math.sqrt(squares / counted.blows)
    inputs = {k: v for k, v in DEFAULT_INPUTS.items() if k != "width"}
    inputs["force"] = Uncertain(1.0, force)
    stress = WornParts.of(model.robot, sn_curve)
    sampler = Sampler.of(model, Task(operations), stress, inputs, [])
    names = [each.name for each in sampler.inputs]
    draws = Draws(len(names), seed)
    scores = draws.more().reshape(-1, len(names))[:samples] @ root_of(names, model.robot.posterior)
    per = 1.0 / sampler.run(scores).lives  # (k, m) of a typical burst
    n, m = len(curves), per.shape[1]
    damage = np.full((n, m), np.nan)
    count, totals = counted.bursts, counted.totals
    for row, j in enumerate(stress.columns):
        chosen = np.mean([each.own[j] for each in which]) * counted.together[j] * count
        # What the typical ones leave out of the whole, and what residues close together.
        scale = totals.damage[j] / chosen if chosen > 0.0 else 1.0
        own = totals.alone[j] / totals.damage[j] if totals.damage[j] > 0.0 else 1.0
        damage[j] = per[row] * count * scale / own if chosen > 0.0 else per[row] * count
    return Worlds(damage, _mix(counted, m, seed))


def _mix(counted: Counted, m: int, seed: int) -> FloatArray:
    """(m,) damage of a blow over its mean so far, from as many days drawn anew."""
    damage = counted.totals.damage
    worst = int(np.nanargmax(damage)) if np.isfinite(damage).any() else 0
    hour, table = counted.hours
    _, day = np.unique(hour // 24, return_inverse=True)
    done = np.bincount(day, table[:, 2 + worst])
    blows = np.bincount(day, table[:, 1])
    if done.size < 2 or not done.sum() > 0.0:
        return np.ones(m)
    rng = np.random.default_rng(seed)
    chosen = rng.integers(0, done.size, (m, done.size))
    rate = done[chosen].sum(axis=1) / blows[chosen].sum(axis=1)
    return np.maximum(np.asarray(rate / (done.sum() / blows.sum())), 1e-3)
