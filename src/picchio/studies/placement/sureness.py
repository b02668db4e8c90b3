"""How sure a placement's gain is: both places under the same drawn values of the robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from picchio.core import spoken
from picchio.core.arrays import FloatArray
from picchio.studies.placement.loads import Loads
from picchio.studies.placement.search import Spot
from picchio.studies.placement.work import Work
from picchio.studies.rivet.variation import WornParts
from picchio.studies.tasks import Task
from picchio.studies.uncertainty.cases import Cases
from picchio.studies.uncertainty.drawn import Drawn, interval


@dataclass(frozen=True)
class Sureness:
    """What uncertain values of the robot leave of a gain. Intervals are P10 to P90.

    A value that both places share, such as a joint's stiffness, is the same at both in each case:
    so the gain is more certain than either life.

    Attributes:
        cases: how many were drawn.
        start: (P10, P50, P90) rivets to failure, of the work as it is now.
        best: likewise, at the best place.
        life: of the ratio of the two; None where every life is unlimited.
        utilisation: of the start's highest utilisation over the best place's.
        better_share: of the cases, in which the best place is the better one.
    """

    cases: int
    start: tuple[float, float, float]
    best: tuple[float, float, float]
    life: tuple[float, float] | None
    utilisation: tuple[float, float]
    better_share: float

    @classmethod
    def between(cls, before: Drawn, after: Drawn, limits: FloatArray | None) -> Sureness:
        """From what the same cases do at both places.

        Args:
            before: at the start.
            after: at the best place.
            limits: (n,) N m, by which torques are ranked; None: shafts and reducers rank.
        """
        one, other = before.robots_life, after.robots_life
        endless = np.isinf(one) & np.isinf(other)
        with np.errstate(invalid="ignore"):
            ratio = np.where(endless, 1.0, other / one)
        used, less = (_used(drawn, limits) for drawn in (before, after))
        better = (other > one) | ((other == one) & (less < used))
        return cls(
            cases=len(one),
            start=_quantiles(one),
            best=_quantiles(other),
            life=None if endless.all() else interval(ratio),
            utilisation=interval(used / np.maximum(less, 1e-300)),
            better_share=float(better.mean()),
        )

    def words(self) -> str:
        """What the cases tell, in a sentence."""
        low, high = self.utilisation
        told = f"the highest utilisation falls by a factor of {low:.3g} to {high:.3g}"
        if self.life is not None:
            lives = [f"{_rounded(each[0])} to {_rounded(each[2])}" for each in
                     (self.start, self.best)]  # fmt: skip
            times = " to ".join(map(_rounded, self.life))
            told = (
                f"the life is {lives[0]} rivets now and {lives[1]} at the best place, {times} "
                f"times as long; {told}"
            )
        return (
            f"Values of the robot are uncertain. In {self.cases} drawn cases (P10 to P90) {told}. "
            f"The best place is the better one in {100 * self.better_share:.0f} % of them."
        )

    def to_dict(self) -> dict[str, Any]:
        """As plain values, in the parts of a placement's JSON that they belong to."""
        names = ("p10", "p50", "p90")
        return {
            "start": {"life": dict(zip(names, self.start, strict=True))},
            "best": {"life": dict(zip(names, self.best, strict=True))},
            "gain": {
                "life_interval": self.life,
                "utilisation_interval": self.utilisation,
                "better_share": self.better_share,
            },
        }


def sureness(loads: Loads, work: Work, start: Spot, best: Spot) -> Sureness | None:
    """How sure a gain is; None where no value of the robot has a spread.

    Args:
        loads: of the robot on its task.
        work: that was moved.
        start: how it is done now.
        best: how it would be done.
    """
    if not loads.model.robot.spreads:
        return None
    before, after = _drawn(loads, work, [start, best])
    return Sureness.between(before, after, _limits(loads))


def surest(loads: Loads, work: Work, spots: Sequence[Spot]) -> Spot | None:
    """Of several places the one that is best in most drawn cases, more certain than any life.

    Args:
        loads: of the robot on its task.
        work: that is moved.
        spots: the best at the stated values first; it wins where no value has a spread.
    """
    if len(spots) < 2 or not loads.model.robot.spreads:
        return spots[0] if spots else None
    cases, limits = _drawn(loads, work, spots), _limits(loads)
    lives = np.array([drawn.robots_life for drawn in cases])
    used = np.array([_used(drawn, limits) for drawn in cases])
    longest = lives == lives.max(axis=0)  # of places alike in life the less used one is better
    first = np.where(longest, used, np.inf).argmin(axis=0)
    return spots[int(np.bincount(first, minlength=len(spots)).argmax())]


def _limits(loads: Loads) -> FloatArray | None:
    return np.array([joint.effort_limit for joint in loads.joints]) if loads.by_effort else None


def _drawn(loads: Loads, work: Work, spots: Sequence[Spot]) -> list[Drawn]:
    """What the same drawn cases do at each place."""
    robot = loads.model.robot
    known = [(j, curve) for j, curve in enumerate(loads.curves) if curve is not None]
    stress = WornParts(
        [robot.flexible_joints[j] for j, _ in known], [j for j, _ in known],
        [curve for _, curve in known], "half-cycles", "none",
    )  # fmt: skip
    tasks = [moved(loads.task, work, spot) for spot in spots]
    both = replace(loads.task, operations=tuple(op for task in tasks for op in task.operations))
    cases = Cases(loads.model, both, stress)
    return [cases.at(task, every=1) for task in tasks]


def moved(task: Task, work: Work, spot: Spot) -> Task:
    """The task with its work somewhere else.

    Args:
        task: as it is.
        work: of the task.
        spot: the move, the period and the poses.
    """
    turn = work.turn(float(spot.move[3]))
    operations = [
        replace(
            op,
            direction=turn @ op.direction,
            poses=spot.poses[work.operation == k],
            excitation=op.excitation
            if spot.period is None
            else op.excitation.with_period(spot.period),
        )
        for k, op in enumerate(task.operations)
    ]
    return replace(task, operations=tuple(operations))


def _used(drawn: Drawn, limits: FloatArray | None) -> FloatArray:
    """(m,) the highest utilisation: of shafts and reducers, or of torques over limits."""
    if limits is not None:
        return np.asarray((drawn.peak / limits[:, None]).max(axis=0))
    return np.asarray(np.nanmax(np.concatenate([drawn.used, drawn.geared]), axis=0))


def _rounded(value: float) -> str:
    """Two digits: more a few hundred cases do not tell."""
    return spoken.count(float(f"{value:.2g}"))


def _quantiles(values: FloatArray) -> tuple[float, float, float]:
    low, middle, high = np.quantile(values, [0.1, 0.5, 0.9], method="inverted_cdf")
    return float(low), float(middle), float(high)
