"""What bursts add up to, in bounded memory: by hour, by place, and some that stand for all."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from picchio.core.arrays import FloatArray, IndexArray
from picchio.fatigue.sn.curve import SNCurve
from picchio.ledger.blows import SEEN, Burst
from picchio.ledger.damage import AS_LOGGED, BurstDamage, Sum, Totals
from picchio.ledger.finding import NEAR
from picchio.ledger.watch.changes import BlowReadings

HOUR = 3600 * 10**9
"""ns: what happens in the same hour (UTC) is added up."""
_STRETCHES = 256  # at most
_PLACES = 4096  # that are told apart; of more the half with the least damage are forgotten
_LONGEST = 4000  # pieces of the force: a longer burst is not typical


@dataclass(frozen=True, eq=False)
class Stretch:
    """Neighbouring bursts.

    Attributes:
        bursts: how many.
        damage: (n,) of each by itself, added up.
        last: ns, the onset of the last.
        burst: one that stands for them, with its first blow alone.
        own: (n,) its damage by itself.
    """

    bursts: int
    damage: FloatArray
    last: int
    burst: Burst
    own: FloatArray

    @property
    def short(self) -> bool:
        """Whether the burst is one that may be computed often."""
        return self.burst.start.size <= _LONGEST


@dataclass(eq=False)
class Place:
    """Bursts at one pose along one direction.

    Attributes:
        pose: (nv,) rad or m, of the first.
        direction: (3,) unit, world, of the first.
        blows: how many.
        damage: (n,) of each burst by itself, added up.
    """

    pose: FloatArray
    direction: FloatArray
    blows: int
    damage: FloatArray


class Counted:
    """What a ledger holds, added up burst by burst; memory does not grow with their number.

    Args:
        curves: of the n joints.
    """

    spans: IndexArray
    """(s, 2) ns, the time that was logged; set where all has been added, as is `totals`."""
    totals: Totals
    """The damage of all bursts."""

    def __init__(self, curves: Sequence[SNCurve | None]) -> None:
        self.readings = BlowReadings()
        self.kinds: Counter[str] = Counter()
        self.cut = 0
        self.forgotten = 0  # places
        self.first = self.last = 0  # ns, onsets
        self.stretches: list[Stretch] = []
        self._each = 1  # bursts of a stretch
        self._sum = Sum(curves)
        self._hours: dict[int, FloatArray] = {}
        self._places: dict[tuple[float, ...], Place] = {}

    def add(self, bursts: Sequence[Burst], damages: Sequence[BurstDamage]) -> None:
        """Further bursts.

        Args:
            bursts: by time.
            damages: of each.
        """
        self.first = self.first or bursts[0].onset
        self.last = bursts[-1].blows[-1].onset
        self._sum.add(damages)
        self.readings.add(bursts)
        for burst, made in zip(bursts, damages, strict=True):
            own, blows = made.alone[:, AS_LOGGED], len(burst.blows)
            self.kinds.update(blow.kind for blow in burst.blows)
            self.cut += sum(blow.cut for blow in burst.blows)
            row, hour = np.array([blows, 1.0, *own]), burst.onset // HOUR
            self._hours[hour] = self._hours.get(hour, 0.0) + row
            key = (*np.round(burst.pose / NEAR).tolist(), *np.round(2 * burst.direction).tolist())
            place = self._places.setdefault(
                key, Place(burst.pose, burst.direction, 0, np.zeros(own.size))
            )
            place.blows += blows
            place.damage = place.damage + own
            slim = replace(burst, blows=burst.blows[:1])
            self._stand(Stretch(1, own, burst.onset, slim, own))
        if len(self._places) > _PLACES:
            worst = sorted(self._places.items(), key=lambda each: -self._weight(each[1].damage))
            self.forgotten += len(worst) - _PLACES // 2
            self._places = dict(worst[: _PLACES // 2])

    def close(self, spans: IndexArray) -> None:
        """All has been added.

        Args:
            spans: (s, 2) ns, the time that was logged.
        """
        self.spans, self.totals = spans, self._sum.totals

    def _stand(self, new: Stretch) -> None:
        """Add a burst to the stretches; where they are too many, join each two."""
        if self.stretches and self.stretches[-1].bursts < self._each:
            self.stretches[-1] = self._joined(self.stretches[-1], new)
            return
        self.stretches.append(new)
        if len(self.stretches) > _STRETCHES:
            *pairs, last = self.stretches
            self.stretches = [*map(self._joined, pairs[::2], pairs[1::2]), last]
            self._each *= 2

    def _joined(self, one: Stretch, other: Stretch) -> Stretch:
        best = max(one, other, key=lambda s: (
            s.short, self._weight(s.own) if s.short else -s.burst.start.size
        ))  # fmt: skip
        return Stretch(one.bursts + other.bursts, one.damage + other.damage, other.last, best.burst,
                       best.own)  # fmt: skip

    def _weight(self, damage: FloatArray) -> float:
        """The largest share of any joint's damage so far."""
        return float(np.max(damage / np.maximum(np.nan_to_num(self._sum.alone), 1e-300)))

    @property
    def blows(self) -> int:
        """How many."""
        return self.kinds.total()

    @property
    def seen(self) -> int:
        """How many of them have a size that was logged."""
        return sum(self.kinds[kind] for kind in SEEN)

    @property
    def bursts(self) -> int:
        """How many."""
        return sum(stretch.bursts for stretch in self.stretches)

    @property
    def together(self) -> FloatArray:
        """(n,) the damage of all bursts over that of each by itself; 0 where there is none."""
        alone = np.nan_to_num(self.totals.alone)
        whole = np.nan_to_num(self.totals.damage)
        return np.divide(whole, alone, out=np.zeros_like(whole), where=alone > 0.0)

    @property
    def hours(self) -> tuple[IndexArray, FloatArray]:
        """(h,) hours since 1970 with bursts, and (h, 2 + n): blows, bursts, damage by joint."""
        if not self._hours:
            return np.empty(0, np.int64), np.empty((0, 2 + self.together.size))
        when, table = zip(*sorted(self._hours.items()), strict=True)
        return np.array(when), np.array(table) * np.concatenate([[1.0, 1.0], self.together])

    @property
    def places(self) -> list[Place]:
        """Where the damage comes from; those with the most of a joint's damage first."""
        found = [replace(p, damage=p.damage * self.together) for p in self._places.values()]
        return sorted(found, key=lambda p: (-self._weight(p.damage), -p.blows))
